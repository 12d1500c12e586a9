"""The process between a running campaign and the viewer: `python -m fatigue_runner.viewer.bridge LOOK HANDLE`.

LOOK: JSON of `live.Look`; HANDLE: an open file in which the JSON of `live.Watched` stands once standard input says so.

It only reads: records and logs of the run folder, as they grow. It runs when nothing else wants to, and ends by itself: when the run is
over and all is sent or played, when the viewer is gone, or when sending has stood still for a while, which is how a stopped viewer
shows.

Even a process of the idle class costs those that work something: a worker that wakes up on its core waits for the next tick of the
clock, milliseconds, where the kernel is a server's. So where all cores are busy, and the campaign is so short that opening a viewer
would cost it more than a percent, the viewer opens with the program's end. Until then this process has loaded nothing and sleeps.
"""

from __future__ import annotations

import faulthandler
import json
import math
import os
import select
import socket
import sys
import time
from pathlib import Path
from typing import Any

from fatigue_runner.viewer import window
from fatigue_runner.viewer.live import Look, Watched
from fatigue_runner.viewer.priority import yield_to_others

LOOK_SECONDS = 0.05
CONNECT_SECONDS = 30.0
START_SECONDS = 900.0  # loading Rerun when nothing else wants to run can take minutes
LONG_RUN = 60.0  # s; opening a viewer takes some 2 s of a core, and those that work lose a fifth of that
UNKNOWN_RUN = 30.0  # s without a finished case after which a run counts as long
REPORT_SECONDS = 20.0  # after the last case, for the report that is written then
SPARE_CORES = 2  # beside the workers': one for the run's own process, one for the viewer


class Ear:
    """What the run says on our standard input: what it is, that it is over; and that its program is gone."""

    told = over = gone = False

    def listen(self) -> None:
        """Take in what was said; waits for nothing."""
        while not self.gone and select.select([sys.stdin], [], [], 0.0)[0]:
            heard = os.read(sys.stdin.fileno(), 1024)
            self.gone = not heard
            self.told |= b"t" in heard
            self.over |= self.gone or b"o" in heard

    def wait(self, seconds: float) -> None:
        """Sleep until something is said, at most so long."""
        if self.gone:
            time.sleep(seconds)
        elif select.select([sys.stdin], [], [], seconds)[0]:
            self.listen()


class Room:
    """Whether the viewer may open now."""

    def __init__(self, told: Watched, now: float) -> None:
        self._records = Path(told.folder) / "cases.jsonl"
        self._pending = sum(map(len, told.jobs))
        self._before, self._began = self._lines(), now
        self._over = math.inf
        self.spare = cores() - told.workers >= SPARE_CORES

    def is_there(self, now: float, over: bool, gone: bool) -> bool:
        """Yes where cores are idle, where the program is gone, and where the run takes so long that opening a viewer hardly counts.

        over: the cases have run.
        """
        if gone or self.spare:
            return True
        if over:
            self._over = min(self._over, now)
            return now - self._over >= REPORT_SECONDS
        elapsed, done = now - self._began, self._lines() - self._before
        if done <= 0:
            return elapsed >= UNKNOWN_RUN
        return elapsed * self._pending / done >= LONG_RUN

    def _lines(self) -> int:
        try:
            return self._records.read_bytes().count(b"\n")
        except OSError:
            return 0


def cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def main(look: Look, handle: int) -> None:
    """Watch as `look` says what stands in the file `handle`."""
    yield_to_others()
    ear = Ear()
    while not ear.told and not ear.gone:
        ear.wait(60.0)
    if not ear.told:  # the campaign was refused: there is nothing to look at
        return
    with os.fdopen(handle, encoding="utf-8") as file:
        file.seek(0)
        told = Watched(**json.load(file))
    room = Room(told, time.monotonic())
    while not look.at_once and not room.is_there(time.monotonic(), ear.over, ear.gone):
        ear.wait(0.5)
    heartbeat(START_SECONDS)
    port = look.port or window.free_port()
    process = None if look.port else _open_viewer(port, look.viewer)
    import rerun as rr

    from fatigue_runner.viewer.blueprint import live_screen
    from fatigue_runner.viewer.relay import Relay

    if not _answers(port, process, ear):
        return
    recording = rr.RecordingStream("fatigue-runner-live")
    recording.connect_grpc(
        f"rerun+http://{window.HOST}:{port}/proxy", default_blueprint=live_screen([], False)
    )
    relay = Relay(told, look, recording, lambda: heartbeat(look.stall), room.spare)
    looked = time.monotonic()
    while True:
        heartbeat(look.stall)
        now = time.monotonic()
        ear.listen()
        if not relay.step(now, ear.over):
            break
        if now - looked > 1.0:
            looked = now
            if not listens(port):
                return
        time.sleep(LOOK_SECONDS if ear.over or room.spare or look.pace else 4 * LOOK_SECONDS)
    recording.flush(timeout_sec=look.stall / 2)


def _open_viewer(port: int, arguments: list[str]) -> Any:
    """A viewer that gives way to the run as this process does: what it starts inherits that."""
    return window.start_viewer("--port", str(port), *arguments, own_session=False)


def heartbeat(seconds: float) -> None:
    """End this process unless the next heartbeat comes within `seconds`.

    Sending to a viewer that stands still blocks inside Rerun for good. This clock runs in a thread that needs no interpreter.
    """
    faulthandler.dump_traceback_later(seconds, exit=True, file=_NOWHERE)


_NOWHERE = open(os.devnull, "w")  # noqa: SIM115  (as long as the process)


def listens(port: int) -> bool:
    """Whether somebody listens on a port of this machine."""
    try:
        with socket.create_connection((window.HOST, port), timeout=1.0):
            return True
    except OSError:
        return False


def _answers(port: int, process: Any, ear: Ear) -> bool:
    """Wait for the viewer; False where there is none to wait for. One that we opened comes, however late."""
    until = time.monotonic() + (CONNECT_SECONDS if process is None else START_SECONDS)
    while time.monotonic() < until:
        if listens(port):
            return True
        ear.listen()
        if (ear.over or ear.gone) if process is None else process.poll() is not None:
            return False
        time.sleep(0.1)
    return False


if __name__ == "__main__":
    try:
        main(Look(**json.loads(sys.argv[1])), int(sys.argv[2]))
    finally:
        # Rerun waits for the viewer when the interpreter ends in the usual way.
        os._exit(0)
