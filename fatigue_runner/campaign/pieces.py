"""Finished cases in small pieces: every worker leaves the record of a case as soon as that is done, the run's own process takes them in.

A block of cases can take minutes; what of it is finished counts at once, on the bar and for whoever interrupts the run. One file for each
block, so that no two processes write one, on one machine or on several.
"""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from fatigue_runner.results.records import head_of, to_line

FOLDER = "finished"  # in the run folder, while cases run
EVERY = 0.5  # s between two looks


def leave(folder: Path, block: str, record: dict[str, Any]) -> None:
    """Append a record to the file of its block in the run folder `folder`."""
    path = folder / FOLDER / f"{block}.jsonl"
    path.parent.mkdir(exist_ok=True)
    with path.open("ab") as file:
        file.write(to_line(record))


class Pieces:
    """Reads what was left in a run folder; `new` has each record once."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / FOLDER
        self._read: dict[str, int] = {}

    def new(self) -> list[bytes]:
        """The lines of the records that were left since the last call; one that is not whole yet is left for later."""
        found = []
        for path in sorted(self._folder.glob("*.jsonl")):
            with path.open("rb") as file:
                file.seek(self._read.get(path.name, 0))
                whole, newline, _ = file.read().rpartition(b"\n")
            self._read[path.name] = self._read.get(path.name, 0) + len(whole) + len(newline)
            found += [line + b"\n" for line in whole.split(b"\n") if head_of(line)]
        return found

    def clear(self) -> None:
        """All of it has been taken in."""
        shutil.rmtree(self._folder, ignore_errors=True)
        self._read = {}


@contextmanager
def followed(take_in: Callable[[], Any]) -> Iterator[None]:
    """Call `take_in` every EVERY seconds while the block runs, and once after it."""
    over = threading.Event()

    def look() -> None:
        while not over.wait(EVERY):
            with suppress(OSError):  # a full disk: whoever takes in the block's own records says so
                take_in()

    thread = threading.Thread(target=look, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
        take_in()
