"""The process between a running campaign and the viewer: `python -m fatigue_runner.viewer.bridge TOLD.json`.

It only reads: records and logs of the run folder, as they grow. It has the lowest priority, and ends by itself: when the run is
over (its standard input closes) and all is sent or played, when the viewer is gone, or when sending has stood still for a while,
which is how a stopped viewer shows.
"""

from __future__ import annotations

import contextlib
import faulthandler
import json
import os
import select
import socket
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner.errors import FatigueRunnerError
from fatigue_runner.logbook import Log, LogTail
from fatigue_runner.viewer import window
from fatigue_runner.viewer.cases import Viewed, as_viewed
from fatigue_runner.viewer.live import Watched
from fatigue_runner.viewer.overview import CHART, Overview, chart

LOOK_SECONDS = 0.05
OVERVIEW_SECONDS = 0.4  # between two pictures of the campaign
CONNECT_SECONDS = 30.0
START_SECONDS = 300.0  # loading Rerun at the lowest priority beside busy workers can take a minute

_STATUS = ("accepted", "discrepancy", "threshold", "local_error", "reference_error")


class Player:
    """The shown case: follows its log while that is written, and says which rows are due.

    pace: multiple of real time, None for as fast as it is there.
    """

    def __init__(self, path: Path, pace: float | None) -> None:
        self.path, self.pace = path, pace
        self.viewed: Viewed | None = None
        self.sent = 0
        self.ended = False
        self._tail: LogTail | None = None
        self._began = 0.0

    def read(self, now: float) -> bool:
        """Take in what was added to the log; True when the case is seen for the first time."""
        if self.ended:
            return False
        if self._tail is None:
            try:
                self._tail = LogTail(self.path)
            except FatigueRunnerError:
                return False
        block = self._tail.poll()
        self.ended = self._tail.ended
        if block is None or not len(block.time):
            return False
        if self.viewed is None:
            self.viewed, self._began = as_viewed([(self.path, block)])[0], now
            return True
        self.viewed.log = extended(self.viewed.log, block)
        return False

    def due(self, now: float) -> int:
        """Number of rows that should be on the screen."""
        if self.viewed is None:
            return 0
        time_ = self.viewed.log.time
        if self.pace is None:
            return len(time_)
        return int(np.searchsorted(time_, time_[0] + self.pace * (now - self._began), side="right"))

    @property
    def has_more(self) -> bool:
        """Whether rows are there that were not sent; once the run is over no more come, also to a log that was cut off."""
        return self.viewed is not None and self.sent < len(self.viewed.log.time)


def extended(log: Log, block: Log) -> Log:
    """`log` with the rows of the block that follows it."""
    log.time = np.concatenate([log.time, block.time])
    log.state = np.concatenate([log.state, block.state])
    log.wind = np.concatenate([log.wind, block.wind])
    log.loads = {name: np.concatenate([values, block.loads[name]]) for name, values in log.loads.items()}
    for name in _STATUS:
        setattr(log, name, np.concatenate([getattr(log, name), getattr(block, name)]))
    return log


class Bridge:
    """One look at a time at the run folder, and what is new of it to the viewer."""

    def __init__(self, told: Watched, recording: Any) -> None:
        from fatigue_runner.viewer import blueprint

        self.told, self.recording, self._blueprint = told, recording, blueprint
        self.folder = Path(told.folder)
        self.overview = Overview(self.folder, told.total, told.jobs, told.workers)
        first = next((name for job in told.jobs for name in job), None)
        known = {name for job in told.jobs for name in job}
        logged = self._log_of(told.case) if told.case else None
        name = told.case if told.case in known or (logged and logged.exists()) else first
        self.player = Player(self._log_of(name), told.pace) if name else None
        self.stage: Any = None
        self._drawn = 0.0

    def _log_of(self, name: str) -> Path:
        return self.folder / "logs" / f"{name}.mcap"

    def step(self, now: float, over: bool) -> bool:
        """Send what is new; False when there is nothing left to come."""
        if over or now - self._drawn > OVERVIEW_SECONDS:
            if self.overview.update() or not self._drawn:
                self._draw()
            self._drawn = now
        if self.player is not None:
            self._play(self.player, now)
        return not over or (self.player is not None and self.player.has_more)

    def _draw(self) -> None:
        import rerun as rr

        text = self.overview.text()
        self.recording.log(
            "campaign/cases", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True
        )
        drawing = chart(self.overview)
        if drawing is None:
            return
        axes = rr.LineStrips2D([line.tolist() for line in drawing.lines], colors=[(90, 100, 115)], radii=0.15)
        self.recording.log("campaign/chart/axes", axes, static=True)
        places, names = [label[:2] for label in drawing.labels], [label[2] for label in drawing.labels]
        self.recording.log(
            "campaign/chart/labels",
            rr.Points2D(places, labels=names, radii=0.01, colors=[(200, 205, 212)], show_labels=True),
            static=True,
        )
        for place, (name, (points, colour)) in enumerate(drawing.series.items()):
            # good integrators lie on each other: smaller dots on larger ones show that all are there
            size = 3.2 - 1.8 * place / max(len(drawing.series) - 1, 1)
            dots = rr.Points2D(
                points,
                colors=[colour],
                radii=size,
                labels=[name] * len(points),
                show_labels=False,
                draw_order=40.0 + place,
            )
            self.recording.log(f"campaign/chart/series/{place}", dots, static=True)
            spot = [20.0 + 60.0 * (place % 3), CHART[1] + 22.0 + 8.0 * (place // 3)]
            key = rr.Points2D([spot], colors=[colour], radii=0.01, labels=[name], show_labels=True)
            self.recording.log(f"campaign/chart/key/{place}", key, static=True)

    def _play(self, player: Player, now: float) -> None:
        from fatigue_runner.viewer.recording import Stage

        try:
            begins = player.read(now)
        except FatigueRunnerError:  # a log that was damaged or begun anew: what is shown stays
            player.ended = True
            return
        if player.viewed is None:
            return
        if begins:
            self.stage = Stage(self.recording, [player.viewed], self.told.scale)
            self.stage.set_up()
            self.recording.send_blueprint(
                self._blueprint.live_screen([player.viewed], player.pace is not None)
            )
        due = player.due(now)
        if due > player.sent:
            self.stage.send(player.viewed, player.sent, due)
            player.sent = due


def main(path: str) -> None:
    """Run the bridge as `path` (JSON of `Watched`) says."""
    told = Watched(**json.loads(Path(path).read_text(encoding="utf-8")))
    Path(path).unlink(missing_ok=True)
    _yield_to_others()
    heartbeat(START_SECONDS)
    port = told.port or window.free_port()
    # Inherits the low priority: the run comes first, and on a machine with time to spare it makes no difference.
    process = None if told.port else window.start_viewer("--port", str(port))
    if not _answers(port, process):
        return
    import rerun as rr

    from fatigue_runner.viewer.blueprint import live_screen

    recording = rr.RecordingStream("fatigue-runner-live")
    recording.connect_grpc(
        f"rerun+http://{window.HOST}:{port}/proxy", default_blueprint=live_screen([], False)
    )
    bridge = Bridge(told, recording)
    over, looked = False, time.monotonic()
    while True:
        heartbeat(told.stall)
        now = time.monotonic()
        over = over or run_is_over()
        if not bridge.step(now, over):
            break
        if now - looked > 1.0:
            looked = now
            if not listens(port):
                return
        time.sleep(LOOK_SECONDS)
    recording.flush(timeout_sec=told.stall / 2)


def heartbeat(seconds: float) -> None:
    """End this process unless the next heartbeat comes within `seconds`.

    Sending to a viewer that stands still blocks inside Rerun for good. This clock runs in a thread that needs no interpreter.
    """
    faulthandler.dump_traceback_later(seconds, exit=True, file=_NOWHERE)


_NOWHERE = open(os.devnull, "w")  # noqa: SIM115  (as long as the process)


def run_is_over() -> bool:
    """Whether the run has closed its end of our standard input, or is gone."""
    ready, _, _ = select.select([sys.stdin], [], [], 0.0)
    return bool(ready) and not os.read(sys.stdin.fileno(), 1024)


def listens(port: int) -> bool:
    """Whether somebody listens on a port of this machine."""
    try:
        with socket.create_connection((window.HOST, port), timeout=1.0):
            return True
    except OSError:
        return False


def _answers(port: int, process: Any) -> bool:
    """Wait for the viewer; False where there is none to wait for."""
    until = time.monotonic() + CONNECT_SECONDS
    while time.monotonic() < until:
        if listens(port):
            return True
        if run_is_over() or (process is not None and process.poll() is not None):
            return False
        time.sleep(0.1)
    return False


def _yield_to_others() -> None:
    """The lowest ordinary priority: beside a busy worker it is 1.5 % of a core, on a machine with time to spare all it needs."""
    with contextlib.suppress(OSError, AttributeError):
        os.nice(19)


if __name__ == "__main__":
    try:
        main(sys.argv[1])
    finally:
        # Rerun waits for the viewer when the interpreter ends in the usual way.
        os._exit(0)
