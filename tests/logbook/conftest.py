"""A log in every compression."""

from __future__ import annotations

from pathlib import Path

import pytest
from logbook_example import ATTACHMENTS, COMPRESSIONS, RESULT, RUN, example

from fatigue_runner.logbook import write_log


@pytest.fixture(scope="module", params=COMPRESSIONS)
def log_path(request, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("logs") / f"{request.param}.mcap"
    return write_log(path, example(3000), RUN, ATTACHMENTS, RESULT, compression=request.param)
