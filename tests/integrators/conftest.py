"""What most tests of the integrators run on."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="session")
def turbine(nrel5mw):
    return nrel5mw
