"""Files that are made when somebody asks for them: whoever opens one asks `present`, the program's roof says who makes it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

maker: Callable[[Path], bool] | None = None  # makes what belongs at a place, and says whether it could


def present(path: Path) -> Path:
    """The same path; a file that is not there, and that a run can make again, is there then."""
    if maker is not None and not path.exists():
        maker(path)
    return path
