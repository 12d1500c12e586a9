"""Watching a campaign while it runs: starts and ends the process that does it, so that nothing of it can touch the run.

The run writes its logs and records as it always does. A separate process (`bridge`) reads them and talks to the viewer; of it the
run knows a process id and one end of a pipe that is closed when the run is over. Workers never see any of this.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fatigue_runner.errors import InputError
from fatigue_runner.viewer.window import require_display, require_rerun


@dataclass
class Watched:
    """What the bridge is told. jobs: case ids in the order in which their blocks are started, `workers` at a time."""

    folder: str
    total: int
    jobs: list[list[str]]
    workers: int
    pace: float | None = None
    case: str | None = None
    scale: float = 1.0
    port: int | None = None
    stall: float = 30.0  # s without an answer of the viewer after which the bridge ends


def watcher(
    *,
    pace: float | None = None,
    case: str | None = None,
    scale: float = 1.0,
    port: int | None = None,
    say: Callable[[str], Any] = lambda text: None,
) -> Callable[[Path, int, Sequence[Sequence[str]], int], Any]:
    """What `run_campaign` takes as `watch`: (run folder, cases in all, ids of the cases of each job, workers) -> context.

    pace: play the case at this multiple of real time, also beyond the end of the run; default: show it as soon as it is there.
    case: id of the case to show, default the first of the first job. port: of a viewer on this machine that is already
    open; default: open one. Raises InputError where there is no viewer or no display, before anything runs.
    """
    if pace is not None and not 0.0 < pace <= 1e4:
        raise InputError(f"--pace must be above 0 (1 is real time), got {pace:g}")
    require_rerun()
    if port is None:
        require_display()

    @contextmanager
    def watch(folder: Path, total: int, jobs: Sequence[Sequence[str]], workers: int) -> Iterator[None]:
        ids = [name for job in jobs for name in job]
        if case is not None and ids and case not in ids and not (folder / "logs" / f"{case}.mcap").exists():
            say(f"live view: no case {case!r} in this campaign; showing {ids[0]}")
        told = Watched(
            str(folder.resolve()), total, [list(job) for job in jobs], workers, pace, case, scale, port
        )
        bridge = start(told)
        try:
            yield
        finally:
            finish(bridge)

    return watch


def start(told: Watched) -> subprocess.Popen[bytes]:
    """Start the bridge; its life does not depend on this process, except that it ends soon after it."""
    handle, name = tempfile.mkstemp(prefix="fatigue-runner-live-", suffix=".json")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        json.dump(asdict(told), file)
    # A session of its own: Ctrl-C is for the run, which then tells the bridge.
    return subprocess.Popen(
        [sys.executable, "-m", "fatigue_runner.viewer.bridge", name],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def finish(bridge: subprocess.Popen[bytes]) -> None:
    """Tell the bridge that the run is over, and wait for nothing: it sends or plays the rest, and ends by itself with that,
    with the viewer, or when the viewer does not answer."""
    if bridge.stdin is not None:
        with contextlib.suppress(OSError):
            bridge.stdin.close()
