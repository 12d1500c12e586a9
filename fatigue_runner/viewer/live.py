"""Watching a campaign while it runs: starts and ends the process that does it, so that nothing of it can touch the run.

The run writes its logs and records as it always does. A separate process (`bridge`) reads them and talks to the viewer; of it the
run knows a process id and one end of a pipe that is closed when the program is over. Workers never see any of this.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from fatigue_runner.errors import InputError
from fatigue_runner.viewer import window
from fatigue_runner.viewer.priority import cpu_of_group, leave_room
from fatigue_runner.viewer.window import require_display, require_rerun

SHARE = 0.2
# Exit codes of the bridge, and what they mean to a person.
NOT_OPENED, BROKEN = 3, 4
_ENDED = {
    0: "the viewer was closed",
    NOT_OPENED: "the viewer could not be opened (it needs a graphics driver)",
    1: "the viewer did not answer any more",
    BROKEN: "it ended with an internal error",
}


@dataclass
class Look:
    """How to watch; the bridge has it from its start. viewer: arguments of the
    viewer's program, where it opens one."""

    pace: float | None = None
    case: str | None = None
    scale: float = 1.0
    port: int | None = None
    share: float = (
        SHARE  # of a core, for the bridge and a viewer that it opened, where the workers leave none idle
    )
    stall: float = 30.0  # s without an answer of the viewer after which the bridge ends
    viewer: list[str] = field(default_factory=list)


@dataclass
class Watched:
    """What to watch; told when it begins. jobs: case ids in the order in which their blocks are started, `workers` at a time;
    since: time of day [s] before the first of them."""

    folder: str
    total: int
    jobs: list[list[str]]
    workers: int
    since: float = 0.0


class Watcher:
    """What `run_campaign` takes as `watch`; as a context, it lets the bridge know when the program is over."""

    def __init__(self, look: Look, say: Callable[[str], Any] = lambda text: None) -> None:
        self._look, self._say = look, say
        self.bridge: BridgeProcess | None = None
        try:
            self.bridge = BridgeProcess(look)
        except OSError as error:  # no memory, no process: the run is worth more than its picture
            say(f"live view: it could not be started ({error.strerror}); the run goes on")

    @contextmanager
    def __call__(
        self, folder: Path, total: int, jobs: Sequence[Sequence[str]], workers: int
    ) -> Iterator[None]:
        """(run folder, cases in all, ids of the cases of each job, workers) -> the context in which the cases run."""
        ids, case = [name for job in jobs for name in job], self._look.case
        if case is not None and ids and case not in ids and not (folder / "logs" / f"{case}.mcap").exists():
            self._say(f"live view: no case {case!r} in this campaign; showing the first that is there")
        if self.bridge is None:
            yield
            return
        began, before = time.monotonic(), self.bridge.cpu()
        self.bridge.tell(
            Watched(str(folder.resolve()), total, [list(job) for job in jobs], workers, time.time())
        )
        try:
            yield
        finally:
            wall, after, code = time.monotonic() - began, self.bridge.cpu(), self.bridge.process.poll()
            self.bridge.over()
            if ids:
                self._tell(wall, before, after, code, workers)

    def _tell(
        self, wall: float, before: float | None, after: float | None, code: int | None, workers: int
    ) -> None:
        """What watching took, or why it ended early.

        wall: for how long the cases ran; before, after: CPU time of bridge and viewer then [s]; code: with which the bridge ended.
        """
        if code is not None:
            self._say(f"live view: {_ENDED.get(code, 'it was ended')}; `fatigue-runner view` shows the logs")
        elif before is not None and after is not None:
            used = max(after - before, 0.0)
            who = "bridge and viewer" if self._look.port is None else "the bridge to the viewer"
            limit = "" if leave_room(workers) else f"; --live-share {self._look.share:g}"
            self._say(
                f"live view: {who} took {used:.1f} s of a core in the {wall:.1f} s of the cases ({used / max(wall, 0.1):.0%} of one"
                f"{limit})"
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.bridge is not None:
            self.bridge.close()


def watcher(
    *,
    pace: float | None = None,
    case: str | None = None,
    scale: float = 1.0,
    port: int | None = None,
    share: float = SHARE,
    say: Callable[[str], Any] = lambda text: None,
) -> Watcher:
    """Start watching: the viewer opens while the campaign is read, and shows the cases that run inside `watch(...)`.

    pace: play the case at this multiple of real time, also beyond the end of the run; default: show it as soon as it is there.
    case: id of the case to show, default the first that is there. port: of a viewer on this machine that is already
    open; default: open one. share: of a core that watching may take where the workers leave none idle. What it took is said when
    the cases have run. Raises InputError where there is no viewer or no display, before anything runs.
    """
    if pace is not None and not 0.0 < pace <= 1e4:
        raise InputError(f"--pace must be above 0 (1 is real time) and at most 10000, got {pace:g}")
    if not 0.01 <= share <= 1.0:
        raise InputError(f"--live-share must be a part of a core, 0.01 to 1, got {share:g}")
    require_rerun()
    if port is None:
        require_display(
            "start `rerun --serve-web --bind 127.0.0.1` for a browser and give --viewer-port 9876, or run without --live"
        )
    elif not window.listens(port):
        say(
            f"live view: nobody listens on port {port} of this machine yet; the run goes on, and a viewer may still come"
        )
    return Watcher(Look(pace, case, scale, port, share), say)


class BridgeProcess:
    """The bridge as the run sees it. Nothing here waits for it: what is said fits into the pipe, whether it is read or not."""

    def __init__(self, look: Look) -> None:
        # Anonymous: it is gone with its last reader, however that ends.
        self._told = tempfile.TemporaryFile("w", encoding="utf-8")  # noqa: SIM115
        handle = self._told.fileno()
        # In the run's session, or the two would have equal rights on the cores (see `priority`), but out of reach of a Ctrl-C:
        # that is for the run, which then tells the bridge.
        self.process = subprocess.Popen(
            [sys.executable, "-m", "fatigue_runner.viewer.bridge", json.dumps(asdict(look)), str(handle)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            process_group=0,
            pass_fds=(handle,),
        )

    def tell(self, watched: Watched) -> None:
        """What is to be watched, from now on."""
        with contextlib.suppress(OSError, ValueError):
            json.dump(asdict(watched), self._told)
            self._told.flush()
        self._say(b"t")

    def cpu(self) -> float | None:
        """CPU time of the bridge and of a viewer that it opened [s]; None where the system does not say."""
        return cpu_of_group(self.process.pid)

    def over(self) -> None:
        """The cases have run: no more will come. The bridge sends or plays the rest, and ends by itself with that, with the
        viewer, or when the viewer does not answer."""
        self._say(b"o")

    def close(self) -> None:
        """The program is over, too."""
        self._told.close()
        if self.process.stdin is not None:
            with contextlib.suppress(OSError):
                self.process.stdin.close()

    def _say(self, word: bytes) -> None:
        if self.process.stdin is not None and not self.process.stdin.closed:
            with contextlib.suppress(OSError):  # it is gone, with its viewer or without
                self.process.stdin.write(word)
                self.process.stdin.flush()
