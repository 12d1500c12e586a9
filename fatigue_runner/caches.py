"""Where this program keeps what it need not make twice: compiled kernels, the hash of its own code."""

from __future__ import annotations

import os
from pathlib import Path


def cache_base() -> Path:
    """NUMBA_CACHE_DIR where that is set, else the program's folder in the user's cache."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    return Path(
        given
        or os.path.join(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "fatigue-runner")
    )
