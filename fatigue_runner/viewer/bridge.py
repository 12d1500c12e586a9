"""The process between a running campaign and the viewer: `python -m fatigue_runner.viewer.bridge LOOK HANDLE`.

LOOK: JSON of `live.Look`; HANDLE: an open file in which the JSON of `live.Watched` stands once standard input says so.

It only reads: records and logs of the run folder, as they grow. It opens the viewer and loads all that it needs while the campaign is
being read. Where the workers leave fewer than two cores idle, it takes no more of one than its share from then on, and the viewer counts
less than a worker. It ends by itself: when the run is over and all is sent or played, when the viewer is gone, or when sending has stood
still for a while, which is how a stopped viewer shows.
"""

from __future__ import annotations

import faulthandler
import json
import os
import select
import sys
import time
from typing import Any

from fatigue_runner.viewer import window
from fatigue_runner.viewer.live import BROKEN, NOT_OPENED, Look, Watched
from fatigue_runner.viewer.priority import Allowance, leave_room, weigh

LOOK_SECONDS = 0.05
BUSY_LOOK_SECONDS = 0.1  # where a core is shared
CONNECT_SECONDS = 60.0  # for a viewer that we opened, on the busiest machine
FIRST_SECONDS = 1.5  # of a core that the first picture may take at once
FIRST_PICTURE_SECONDS = (
    3.0  # after the first picture was sent, for the viewer to draw it as fast as any program
)
UNKNOWN_SECONDS = 20.0  # without a finished case, after which the viewer counts less all the same


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


def main(look: Look, handle: int) -> int:
    """Watch as `look` says what stands in the file `handle`; returns the exit code."""
    ear = Ear()
    port = look.port or window.free_port()
    process = None if look.port else _open_viewer(port, look.viewer)
    import rerun as rr

    from fatigue_runner.viewer.blueprint import live_screen
    from fatigue_runner.viewer.relay import Relay

    while not ear.told and not ear.gone:
        ear.wait(60.0)
    if not ear.told:  # the campaign was refused: there is nothing to look at
        if process is not None:
            window.end(process)
        return 0
    with os.fdopen(handle, encoding="utf-8") as file:
        file.seek(0)
        told = Watched(**json.load(file))
    if not _answers(port, process, ear):
        return 0 if process is None else NOT_OPENED
    heartbeat(look.stall)
    recording = rr.RecordingStream("fatigue-runner-live")
    recording.connect_grpc(
        f"rerun+http://{window.HOST}:{port}/proxy", default_blueprint=live_screen([], look.pace)
    )
    relay = Relay(told, look, recording, lambda: heartbeat(look.stall))
    beside = Beside(look, told, process)
    looked = time.monotonic()
    while True:
        heartbeat(look.stall)
        now = time.monotonic()
        ear.listen()
        if (ear.over or beside.may_work(now, relay.shown_at)) and not relay.step(now, ear.over):
            break
        if now - looked > 1.0:
            looked = now
            if not window.listens(port):
                return 0
        time.sleep(LOOK_SECONDS if ear.over or beside.spare else BUSY_LOOK_SECONDS)
    recording.flush(timeout_sec=look.stall / 2)
    return 0


class Beside:
    """What may be taken beside the workers: everything where cores are idle, else half of the share here and half by a viewer that
    was opened here; all of it here where the viewer is somebody else's."""

    def __init__(self, look: Look, told: Watched, process: Any) -> None:
        self.spare = leave_room(told.workers)
        self._viewer, self._began = process, time.monotonic()
        self._part = look.share if process is None else look.share / 2
        self._allowance = Allowance(self._part, FIRST_SECONDS)

    def may_work(self, now: float, shown_at: float | None) -> bool:
        """Whether another look may be taken now; shown_at: when the first picture was sent."""
        if self.spare:
            return True
        drawn = self._began + UNKNOWN_SECONDS if shown_at is None else shown_at + FIRST_PICTURE_SECONDS
        if self._viewer is not None and now > drawn:
            weigh(self._part, self._viewer.pid)
            self._viewer = None
        return self._allowance.wait(now, time.process_time()) <= 0.0


def _open_viewer(port: int, arguments: list[str]) -> Any:
    """A viewer in the session of the run, so that its priority counts beside the workers'."""
    return window.start_viewer("--port", str(port), *arguments, own_session=False)


def heartbeat(seconds: float) -> None:
    """End this process unless the next heartbeat comes within `seconds`.

    Sending to a viewer that stands still blocks inside Rerun for good. This clock runs in a thread that needs no interpreter.
    """
    faulthandler.dump_traceback_later(seconds, exit=True, file=_NOWHERE)


_NOWHERE = open(os.devnull, "w")  # noqa: SIM115  (as long as the process)


def _answers(port: int, process: Any, ear: Ear) -> bool:
    """Wait for the viewer; False where there is none to wait for: ours ended, or the run did before somebody opened another."""
    until = time.monotonic() + CONNECT_SECONDS
    while not window.listens(port):
        ear.listen()
        ended = ear.over if process is None else process.poll() is not None or time.monotonic() > until
        if ended:
            return False
        time.sleep(0.1)
    return True


if __name__ == "__main__":
    code = BROKEN
    try:
        code = main(Look(**json.loads(sys.argv[1])), int(sys.argv[2]))
    finally:
        # Rerun waits for the viewer when the interpreter ends in the usual way.
        os._exit(code)
