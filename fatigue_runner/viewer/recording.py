"""From logs to a Rerun recording: what stands still once, then blocks of rows as columns.

A recording is filled block by block (`Stage.send`), so that a whole log and a log that is being played go the same way.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import rerun as rr

from fatigue_runner.viewer import colours, shapes, wind_scene
from fatigue_runner.viewer.cases import Viewed
from fatigue_runner.viewer.inflow import BLADE_WIND
from fatigue_runner.viewer.styles import SOLVER_SERIES, read_unit, set_style

TIMELINE = "time"
FRAME_RATE = 20.0  # Hz, of the 3-D scene; series keep the log's rate
MAX_FRAMES = 8000  # in all turbines together; a frame is 5 kB
WIND_RATE = 4.0  # Hz, colours of the rotor disc, and numbers at the blades
BAND_POINTS = 4000  # a band of more points looks the same and draws slower
TOWER_LEVELS = 9
BLOCK = 4096  # rows per message

_WHITE, _GREY, _BLUE = (232, 236, 240), (150, 158, 168), (92, 104, 122)


class Stage:
    """Cases on a recording. scale: times true deflection; series_rate [Hz]: of simulated time, at most so many points per
    series, None for all. Ranges of colours are those of all cases together."""

    def __init__(
        self,
        recording: rr.RecordingStream,
        cases: Sequence[Viewed],
        scale: float = 1.0,
        series_rate: float | None = None,
    ) -> None:
        self.recording, self.cases, self.scale, self.series_rate = recording, cases, scale, series_rate
        self.flap_range = _range([_flap(case) for case in cases])
        self.wind_range = _range([wind_scene.disc_wind(case, slice(None)) for case in cases])

    def set_up(self) -> None:
        """All that does not move: ground, names and colours of series, skins, the scales' legend."""
        self._log("scene", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        for case in self.cases:
            self._set_up_scene(case)
            set_style(self.recording, case, len(self.cases) > 1)
        self._legend()

    def _log(self, path: str, what: Any) -> None:
        self.recording.log(path, what, static=True)

    def _set_up_scene(self, case: Viewed) -> None:
        root = f"scene/{case.key}"
        place = [0.0, case.offset, 0.0]
        self._log(root, rr.Transform3D(translation=place))
        self._log(
            f"{root}/tower",
            rr.Mesh3D.from_fields(
                triangle_indices=shapes.tower_triangles(TOWER_LEVELS), albedo_factor=_WHITE
            ),
        )
        for name, skin, colour in (
            ("nacelle", shapes.nacelle_skin(case.geometry), _WHITE),
            ("hub", shapes.hub_skin(case.geometry), _GREY),
        ):
            self._log(
                f"{root}/{name}",
                rr.Mesh3D(
                    vertex_positions=skin[0],
                    triangle_indices=skin[1],
                    albedo_factor=colour,
                    vertex_normals=shapes.normals(skin[0][None], skin[1])[0],
                ),
            )
        for blade in (1, 2, 3):
            self._log(f"{root}/blade{blade}", rr.Mesh3D.from_fields(triangle_indices=case.skin.triangles()))
        wind_scene.set_up(self._log, case, root)
        # straight pitch axes under the hub's frame: how far the blades bend is the distance to them
        straight = case.geometry.straight_blades()
        self._log(
            f"{root}/hub/straight",
            rr.LineStrips3D(list(straight), colors=[_GREY], radii=rr.Radius.ui_points(0.8)),
        )
        self._log(
            f"{root}/label",
            rr.Points3D(
                [[0.0, 0.0, -6.0]], radii=0.01, labels=[case.label], colors=[case.colour], show_labels=True
            ),
        )
        ring = np.linspace(0, 2 * np.pi, 73)
        pads = [np.column_stack([r * np.cos(ring), r * np.sin(ring), 0 * ring]) for r in (5.0, 30.0, 60.0)]
        self._log(f"{root}/ground", rr.LineStrips3D(pads, colors=[_BLUE], radii=rr.Radius.ui_points(0.7)))

    def _legend(self) -> None:
        """Scales of the two colours, standing beside the first turbine."""
        case = self.cases[0]
        for name, scale, (low, high), side, unit, factor in (
            ("flap moment", colours.FLAP_SCALE, self.flap_range, 12.0, "MN·m", 1e-6),
            ("wind", colours.WIND_SCALE, self.wind_range, 34.0, "m/s", 1.0),
        ):  # fmt: skip
            if not np.isfinite([low, high]).all():
                continue
            wide = 1.0 + 0.5 * (len(self.cases) - 1)  # seen from farther away
            x, y = 0.0, case.offset + case.geometry.radius + side * wide
            z = np.linspace(6.0, 46.0, 21)
            strips = [[[x, y, a], [x, y, b]] for a, b in pairwise(z)]
            shade = colours.on_scale(np.arange(20), 0, 19, scale)
            self._log(
                f"scene/legend/{name.replace(' ', '_')}", rr.LineStrips3D(strips, colors=shade, radii=1.3)
            )
            marks = np.linspace(low, high, 3)
            labels = [f"{value * factor:.3g} {unit}" for value in marks]
            spots = [
                [x, y + 9.0 * wide, 6.0],
                [x, y + 9.0 * wide, 26.0],
                [x, y + 9.0 * wide, 46.0],
                [x, y, 54.0],
            ]
            self._log(
                f"scene/legend/{name.replace(' ', '_')}/marks",
                rr.Points3D(spots, radii=0.01, labels=[*labels, name], colors=[_GREY], show_labels=True),
            )

    def send(self, case: Viewed, start: int = 0, stop: int | None = None) -> None:
        """Rows start..stop of a case's log, in blocks."""
        stop = len(case.log.time) if stop is None else min(stop, len(case.log.time))
        for first in range(start, stop, BLOCK):
            rows = slice(first, min(first + BLOCK, stop))
            self._send_series(case, rows)
            self._send_scene(case, rows)

    def _frames(self, case: Viewed, rows: slice, rate: float, most: int) -> np.ndarray:
        """Rows of the slice that are frames of a slower clock: the same ones however the log is cut into blocks."""
        stride = max(_stride(case, rate), int(np.ceil(len(case.log.time) / most)))
        index = np.arange(rows.start, rows.stop)
        return index[index % stride == 0]

    def _columns(self, path: str, time: np.ndarray, *columns: Any) -> None:
        self.recording.send_columns(
            path,
            [rr.TimeColumn(TIMELINE, duration=nanoseconds(time))],
            [c for group in columns for c in group],
        )

    def _send_scene(self, case: Viewed, rows: slice) -> None:
        frames = self._frames(case, rows, FRAME_RATE, MAX_FRAMES // len(self.cases))
        frames = frames[np.isfinite(case.log.state[frames][:, case.geometry.drawn]).all(axis=1)]
        if len(frames):
            self._send_turbine(case, frames)
        if len(case.log.wind):
            self._send_wind(case, rows, frames)

    def _send_wind(self, case: Viewed, rows: slice, frames: np.ndarray) -> None:
        """frames: of the blades, with which the arrows go."""
        root, alone = f"scene/{case.key}", len(self.cases) == 1  # the numbers of several would be a tangle
        if len(frames):
            wind_scene.send_arrows(self._columns, case, root, frames, self.scale, alone)
        slow = self._frames(case, rows, WIND_RATE, MAX_FRAMES // (4 * len(self.cases)))
        if len(slow):
            wind_scene.send_disc(self._columns, case, root, slow, *self.wind_range)
        if len(slow) and alone:
            wind_scene.send_numbers(self._columns, case, root, slow)

    def _send_turbine(self, case: Viewed, frames: np.ndarray) -> None:
        pitch = case.log.pitch[frames] if len(case.log.pitch) else None
        pose = case.geometry.pose(case.log.state[frames], case.skin.radius, TOWER_LEVELS, self.scale, pitch)
        time, root = case.log.time[frames], f"scene/{case.key}"
        tower = shapes.tower_vertices(pose)
        self._mesh(f"{root}/tower", time, tower, shapes.tower_triangles(TOWER_LEVELS))
        for name, place, turn in (("nacelle", pose.top, pose.nacelle), ("hub", pose.apex, pose.rotor)):
            self._columns(f"{root}/{name}", time, rr.Transform3D.columns(translation=place, mat3x3=turn))
        blades = case.skin.vertices(pose)
        flap = _flap(case)[frames]
        shade = colours.packed(colours.on_scale(flap, *self.flap_range, colours.FLAP_SCALE))
        for blade in range(3):
            self._mesh(
                f"{root}/blade{blade + 1}", time, blades[:, blade], case.skin.triangles(), shade[:, blade]
            )

    def _mesh(
        self,
        path: str,
        time: np.ndarray,
        vertices: np.ndarray,
        triangles: np.ndarray,
        shade: np.ndarray | None = None,
    ) -> None:
        """A moving surface; its normals are sent too, because the viewer draws a mesh without them flat."""
        n, count = vertices.shape[:2]
        surface = rr.Mesh3D.columns(
            vertex_positions=vertices.reshape(-1, 3),
            vertex_normals=shapes.normals(vertices, triangles).reshape(-1, 3),
        ).partition([count] * n)
        tint = () if shade is None else rr.Mesh3D.columns(albedo_factor=shade)
        self._columns(path, time, surface, tint)

    def _send_series(self, case: Viewed, rows: slice) -> None:
        log, stride = case.log, _stride(case, self.series_rate)
        index = np.arange(rows.start, rows.stop)
        index = index[index % stride == 0]
        time = log.time[index]
        for place, channel in enumerate(log.states):
            self._series(
                f"plots/state/{channel.name}/{case.key}", time, log.state[index, place] * channel.scale
            )
        if len(log.wind):
            for place, channel in enumerate(log.winds):
                self._series(f"plots/wind/{channel.name}/{case.key}", time, log.wind[index, place])
            for channel, values in zip(BLADE_WIND, wind_scene.wind_of_blades(case, index).T, strict=True):
                self._series(f"plots/wind/{channel.name}/{case.key}", time, values)
        for channel in log.control_signals:
            values = log.control[channel.name][index] * channel.scale
            self._series(f"plots/control/{channel.name}/{case.key}", time, values)
        for name, values in log.loads.items():
            self._series(f"plots/load/{name}/{case.key}", time, values[index] * read_unit(name)[1])
        self._send_solver(case, rows, stride)

    def _send_solver(self, case: Viewed, rows: slice, stride: int) -> None:
        """What belongs to the interval that ends at a row; errors and norms by their logarithm, as they spread over decades.
        Of a group of `stride` intervals the largest value stands for all."""
        log = case.log
        first = max(rows.start, 1)
        within = slice(first - 1, rows.stop - 1)
        if within.stop <= within.start:
            return
        starts = _starts(within, stride)
        time = log.time[first : rows.stop][starts]
        for name in SOLVER_SERIES:
            values = getattr(log, name)[within]
            if len(values) != within.stop - within.start or not np.isfinite(values).any():
                continue
            values = np.fmax.reduceat(values, starts)
            known = np.isfinite(values) & (values > 0)
            self._series(f"plots/solver/{name}/{case.key}", time[known], np.log10(values[known]))
        if case.is_guarded and len(log.accepted):
            self._send_band(case, within)

    def _send_band(self, case: Viewed, within: slice) -> None:
        """One mark per group of steps in the case's lane, a lower one when any of them fell back."""
        starts = _starts(within, max(1, int(np.ceil(len(case.log.accepted) / BAND_POINTS))))
        time = case.log.time[within.start + 1 : within.stop + 1][starts]
        good = np.minimum.reduceat(case.log.accepted[within].astype(np.uint8), starts) > 0
        lane = band_lane([other.key for other in self.cases if other.is_guarded].index(case.key))
        for name, which, height in (("accepted", good, lane[1]), ("fallen_back", ~good, lane[0])):
            self._series(
                f"plots/solver/{name}/{case.key}", time[which], np.full(int(which.sum()), float(height))
            )

    def _series(self, path: str, time: np.ndarray, values: np.ndarray) -> None:
        if len(values):
            self._columns(path, time, rr.Scalars.columns(scalars=np.asarray(values, float)))


def band_lane(number: int) -> tuple[float, float]:
    """Heights of the marks (fallen back, accepted) of the n-th guarded case in the plot of acceptance, from the top."""
    return -2.0 * number, 1.0 - 2.0 * number


def nanoseconds(time: np.ndarray) -> np.ndarray:
    """Times [s] as timedelta64[ns]."""
    return np.round(np.asarray(time) * 1e9).astype("timedelta64[ns]")


def _stride(case: Viewed, rate: float | None) -> int:
    """Every how many rows a clock of this rate [Hz] ticks."""
    if not rate or len(case.log.time) < 2 or not case.log.duration:
        return 1
    return max(1, round((len(case.log.time) - 1) / (case.log.duration * rate)))


def _starts(within: slice, size: int) -> np.ndarray:
    """Where groups of so many intervals begin in a slice: the same groups however the log is cut into blocks."""
    groups = np.arange(within.start, within.stop) // size
    return np.flatnonzero(np.r_[True, np.diff(groups) > 0])


def _flap(case: Viewed) -> np.ndarray:
    """(n, 3) root flapwise moments [N.m]; NaN where the log does not hold them."""
    missing = np.full(len(case.log.time), np.nan)
    return np.stack(
        [case.log.loads.get(f"blade{i}_root_flapwise_moment", missing) for i in (1, 2, 3)], axis=1
    )


def _range(values: Sequence[np.ndarray]) -> tuple[float, float]:
    """Smallest and largest finite number of all arrays; NaN where there is none."""
    known = [v[np.isfinite(v)] for v in values]
    known = [v for v in known if v.size]
    return (min(v.min() for v in known), max(v.max() for v in known)) if known else (np.nan, np.nan)
