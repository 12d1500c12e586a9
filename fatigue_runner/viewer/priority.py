"""What those that only watch may take from those that work, and what they took.

Linux weighs sessions (its "autogroups") against each other and processes within theirs, so a process that should count less than a
worker stays in the run's session; there `nice` says how much less.
"""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Iterator
from pathlib import Path

SPARE_CORES = 2  # beside the workers': one for the run's own process, one for the viewer
_WEIGHT_OF_A_NICE_STEP = 1.25  # Linux: each step counts that much less beside others


def cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def leave_room(workers: int) -> bool:
    """Whether so many workers leave cores idle for those that watch."""
    return cores() - workers >= SPARE_CORES


def weigh(share: float, process_id: int = 0) -> None:
    """Let each thread of a process (default: this one), and what it starts later, have about this share of a core on which a worker
    is busy, too."""
    steps = math.log((1.0 - share) / share, _WEIGHT_OF_A_NICE_STEP) if share < 0.5 else 0.0
    for thread in _threads(process_id):
        with contextlib.suppress(OSError, AttributeError):
            os.setpriority(os.PRIO_PROCESS, thread, min(19, round(steps)))


def _threads(process_id: int) -> list[int]:
    """Linux knows the priority of threads, not of processes."""
    try:
        return [int(name) for name in os.listdir(f"/proc/{process_id or 'self'}/task")]
    except OSError:
        return [process_id]


class Allowance:
    """`share` of a core beside `first` seconds of one that may be taken at once: whoever has taken more waits."""

    def __init__(self, share: float, first: float) -> None:
        self.share, self._first = share, first
        self._began: tuple[float, float] | None = None

    def wait(self, now: float, used: float) -> float:
        """Seconds until work may go on; now: a clock, used: CPU time of the process, both [s]. The first call begins."""
        began, before = self._began = self._began or (now, used)
        return max(0.0, (used - before - self._first) / self.share - (now - began))


def cpu_of_group(group: int) -> float | None:
    """CPU time of a group's living processes [s]; None where the system does not say."""
    ticks = [ticks for ticks, own in ticks_of_processes().values() if own == group]
    return sum(ticks) / os.sysconf("SC_CLK_TCK") if ticks else None


def ticks_of_processes() -> dict[str, tuple[int, int]]:
    """Ticks of CPU time and group of every process, by its number; empty where the system has no /proc."""
    return {folder.name: (int(f[11]) + int(f[12]), int(f[2])) for folder, f in processes()}


def processes() -> Iterator[tuple[Path, list[str]]]:
    """Folder and status fields of every process; nothing where the system has no /proc."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            yield stat.parent, stat.read_text().rpartition(")")[2].split()
