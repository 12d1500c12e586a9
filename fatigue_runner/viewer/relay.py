"""What the bridge does once the viewer is there: one look at a time at the run folder, and what is new of it to the viewer."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rerun as rr

from fatigue_runner.errors import FatigueRunnerError
from fatigue_runner.viewer.blueprint import live_screen, shown_live
from fatigue_runner.viewer.cases import Viewed
from fatigue_runner.viewer.live import Look, Watched
from fatigue_runner.viewer.overview import CHART, Overview, chart
from fatigue_runner.viewer.player import Player
from fatigue_runner.viewer.recording import Stage

OVERVIEW_SECONDS = 0.5  # between two pictures of the campaign
SERIES_SECONDS = 0.5  # between two pieces of the curves of a case that is played
WHOLE_SECONDS = 0.5  # for which a log that has begun is waited for
SERIES_RATE = 25.0  # rows per simulated second that are forwarded; `view` shows all
BLOCK = 512  # rows at a time


class Relay:
    """One look at a time at the run folder, and what is new of it to the viewer."""

    def __init__(self, told: Watched, look: Look, recording: Any, alive: Callable[[], Any]) -> None:
        """alive: called in the middle of long work."""
        self.look, self.recording, self._alive = look, recording, alive
        self.folder, self._since = Path(told.folder), told.since
        self.overview = Overview(self.folder, told.total, told.jobs, told.workers)
        self._known = {name for job in told.jobs for name in job}
        self.player: Player | None = None
        if look.case and (look.case in self._known or self._log_of(look.case).exists()):
            self.player = Player(self._log_of(look.case), look.pace)
        self.stage: Any = None
        self.shown_at: float | None = None
        self._drawn = -math.inf
        self._seen = -math.inf
        self._curves = (0, -math.inf)  # rows of the curves that were sent, and when

    def _log_of(self, name: str) -> Path:
        return self.folder / "logs" / f"{name}.mcap"

    def _first_log(self) -> Path | None:
        """The first log of this run's cases; those of an earlier run may still be there."""
        found = []
        with contextlib.suppress(OSError):
            for entry in os.scandir(self.folder / "logs"):
                if entry.name.partition(".mcap")[0] in self._known:
                    found.append((entry.stat().st_mtime, entry.name.removesuffix(".part")))
        new = [name for time, name in found if time >= self._since - 1.0]
        return self.folder / "logs" / min(new) if new else None

    def step(self, now: float, over: bool) -> bool:
        """Send what is new, a piece at a time; False when there is nothing left to come."""
        if over or now - self._drawn > OVERVIEW_SECONDS:
            if self.overview.update() or self._drawn == -math.inf:
                self._draw()
            self._drawn = now
        if self.player is None and (path := self._first_log()) is not None:
            self.player = Player(path, self.look.pace)
        if self.player is not None:
            self._play(self.player, now)
        return not over or (self.player is not None and self.player.has_more)

    def _draw(self) -> None:
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
        try:
            begins = player.read(now)
        except FatigueRunnerError as error:  # a log that was damaged or begun anew: what is shown stays
            player.ended = True
            if player.viewed is None:
                self.overview.trouble = f"No turbine to show: {error}"
                self._draw()
            return
        if player.viewed is None:
            return
        if begins:
            self._seen = now
        if self.stage is None and not player.ended and now - self._seen < WHOLE_SECONDS:
            return  # a log is written in one go: whole, it shows what its colours have to span
        self._begin(player.viewed)
        due = min(player.sent + BLOCK, player.due(now))
        if player.sent < due:
            self._alive()
            self.stage.send_scene(player.viewed, player.sent, due)
            player.sent = due
            self.shown_at = self.shown_at or now
        rows, sent = self._curves
        if rows < player.sent and (
            player.sent - rows >= BLOCK or now - sent >= SERIES_SECONDS or not player.has_more
        ):
            self.stage.send_series(player.viewed, rows, player.sent)
            self._curves = (player.sent, now)

    def _begin(self, viewed: Viewed) -> None:
        if self.stage is not None:
            return
        self.stage = Stage(self.recording, [viewed], self.look.scale, SERIES_RATE, shown_live(viewed))
        self.stage.set_up()
        self.recording.send_blueprint(live_screen([viewed], self.look.pace))
