"""What the bridge does once the viewer is there: one look at a time at the run folder, and what is new of it to the viewer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import rerun as rr

from fatigue_runner.errors import FatigueRunnerError
from fatigue_runner.viewer.blueprint import live_screen
from fatigue_runner.viewer.cases import Viewed
from fatigue_runner.viewer.live import Look, Watched
from fatigue_runner.viewer.overview import CHART, Overview, chart
from fatigue_runner.viewer.player import Player
from fatigue_runner.viewer.recording import Stage

OVERVIEW_SECONDS = 0.5  # between two pictures of the campaign
SERIES_RATE = 25.0  # rows per simulated second that are forwarded; `view` shows all
BLOCK = 1024  # rows at a time


class Relay:
    """One look at a time at the run folder, and what is new of it to the viewer."""

    def __init__(
        self, told: Watched, look: Look, recording: Any, alive: Callable[[], Any], playing: bool = True
    ) -> None:
        """alive: called in the middle of long work; playing: whether the shown case moves while the campaign runs."""
        self.look, self.recording, self._alive, self._playing = look, recording, alive, playing
        self.folder = Path(told.folder)
        self.overview = Overview(self.folder, told.total, told.jobs, told.workers)
        first = next((name for job in told.jobs for name in job), None)
        known = {name for job in told.jobs for name in job}
        logged = self._log_of(look.case) if look.case else None
        name = look.case if look.case in known or (logged and logged.exists()) else first
        self.player = Player(self._log_of(name), look.pace) if name else None
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
            if over and not self._playing and self.player.viewed is not None:
                self._playing = True
                self._arrange(self.player.viewed)
        return not over or (self.player is not None and self.player.has_more)

    def _arrange(self, viewed: Viewed) -> None:
        """The screen with the shown case. A moving picture is drawn anew all the time, so it stands where no core is to spare."""
        self.recording.send_blueprint(
            live_screen([viewed], self.look.pace is not None, playing=self._playing)
        )

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
        except FatigueRunnerError:  # a log that was damaged or begun anew: what is shown stays
            player.ended = True
            return
        if player.viewed is None:
            return
        if begins:
            self.stage = Stage(self.recording, [player.viewed], self.look.scale, SERIES_RATE)
            self.stage.set_up()
            self._arrange(player.viewed)
        due = player.due(now)
        while player.sent < due:
            self._alive()
            upto = min(player.sent + BLOCK, due)
            self.stage.send(player.viewed, player.sent, upto)
            player.sent = upto
