"""The memory of a run of the tests: the proportional set sizes of all its processes, every few seconds.

More than `WANTED` is told, process by process; more than `BOUND` fails the run.
"""

from __future__ import annotations

import os
import threading
from pathlib import Path

WANTED = 4.0  # GB, the whole suite on two processes; a run that takes more tells which processes did
# A run that takes more than this has failed. Far above what was measured here (CONTRIBUTING.md), since one machine told 7.5 GB where
# another told 4.7 with the same tests, and why is not known.
BOUND = 9.0
EVERY = 2.0  # s: a sample takes some 20 ms a GB, and memory grows over minutes


class Watch:
    """Samples until it is stopped; `peak` [GB], 0 where the system does not tell (it does on Linux), and what each process had then."""

    def __init__(self, root: int | None = None) -> None:
        self.peak = 0.0
        self.processes: list[tuple[float, str]] = []  # GB and command, the largest first
        self._root = os.getpid() if root is None else root
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    def stop(self) -> float:
        self._over.set()
        self._thread.join()
        return self.peak

    def _look(self) -> None:
        while not self._over.wait(EVERY):
            sizes = {process: _proportional_set_size(process) / 1e9 for process in tree(self._root)}
            if sum(sizes.values()) > self.peak:
                self.peak = sum(sizes.values())
                self.processes = sorted(((size, _command(p)) for p, size in sizes.items()), reverse=True)


def tree(root: int) -> list[int]:
    """A process and all below it."""
    found, left = [], [root]
    while left:
        found.append(left.pop())
        for path in Path(f"/proc/{found[-1]}/task").glob("*/children"):
            left += map(int, _text(path).split())
    return found


def _proportional_set_size(process: int) -> int:
    """In bytes: what is shared counts in parts. 0 for a process that has ended."""
    lines = _text(Path(f"/proc/{process}/smaps_rollup")).splitlines()
    return 1024 * sum(int(line.split()[1]) for line in lines if line.startswith("Pss:"))


def _command(process: int) -> str:
    return _text(Path(f"/proc/{process}/cmdline")).replace("\0", " ").strip()


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:
        return ""
