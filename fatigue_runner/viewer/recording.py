"""From logs to a Rerun recording: what stands still once, then blocks of rows as columns.

A recording is filled block by block (`Stage.send`), so that a whole log and a log that is being played go the same way.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import rerun as rr

from fatigue_runner.viewer import colours, shapes, wind_scene
from fatigue_runner.viewer.cases import Viewed
from fatigue_runner.viewer.inflow import BLADE_WIND
from fatigue_runner.viewer.styles import FALLEN_BACK, SOLVER_SERIES, TRUSTED, read_unit, set_style

TIMELINE = "time"
FRAME_RATE = 20.0  # Hz, of the 3-D scene; series keep the log's rate
MAX_FRAMES = 8000  # in all turbines together; a frame is 5 kB
WIND_RATE = 4.0  # Hz, colours of the rotor disc, and numbers at the blades
BAND_POINTS = 4000  # a band of more points looks the same and draws slower
TOWER_LEVELS = 9
BLOCK = 4096  # rows per message

# Of a scale of colours and between two, in the units of their view.
SCALE_WIDTH, SCALE_GAP = 80.0, 40.0
SCALE_BOUNDS = ((-12.0, 2 * SCALE_WIDTH + SCALE_GAP + 12.0), (-14.0, 17.0))

_WHITE, _GREY, _BLUE = (232, 236, 240), (150, 158, 168), (92, 104, 122)


class Stage:
    """Cases on a recording. scale: times true deflection; series_rate [Hz]: of simulated time, at most so many points per
    series, None for all; only: paths of series below `plots/` without the case, None for all. Ranges of colours are those of all cases
    together."""

    def __init__(
        self,
        recording: rr.RecordingStream,
        cases: Sequence[Viewed],
        scale: float = 1.0,
        series_rate: float | None = None,
        only: Collection[str] | None = None,
    ) -> None:
        self.recording, self.cases, self.scale, self.series_rate = recording, cases, scale, series_rate
        self.only = only
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
        """Scales of the two colours, side by side below the scene."""
        for name, scale, (low, high), left, factor in (
            ("blade root flapwise moment [MN·m]", colours.FLAP_SCALE, self.flap_range, 0.0, 1e-6),
            ("wind at the disc and the blades [m/s]", colours.WIND_SCALE, self.wind_range, SCALE_WIDTH + SCALE_GAP, 1.0),
        ):  # fmt: skip
            if not np.isfinite([low, high]).all():
                continue
            path = "scales/" + name.split()[0]
            x = left + np.linspace(0.0, SCALE_WIDTH, 41)
            strips = [[[a, 0.0], [b, 0.0]] for a, b in pairwise(x)]
            shade = colours.on_scale(np.arange(40), 0, 39, scale)
            self._log(path, rr.LineStrips2D(strips, colors=shade, radii=1.6))
            marks = [f"{value * factor:.3g}" for value in np.linspace(low, high, 3)]
            spots = [[left + part * SCALE_WIDTH, 4.0] for part in (0.0, 0.5, 1.0)]
            told = [[left + SCALE_WIDTH / 2, -13.0]]
            texts = rr.Points2D(
                [*told, *spots], labels=[name, *marks], radii=0.01, colors=[_GREY], show_labels=True
            )
            self._log(f"{path}/marks", texts)

    def send(self, case: Viewed, start: int = 0, stop: int | None = None) -> None:
        """Rows start..stop of a case's log, in blocks."""
        stop = len(case.log.time) if stop is None else min(stop, len(case.log.time))
        for first in range(start, stop, BLOCK):
            last = min(first + BLOCK, stop)
            self.send_series(case, first, last)
            self.send_scene(case, first, last)

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

    def send_scene(self, case: Viewed, start: int, stop: int) -> None:
        """What moves in the scene, of rows start..stop of a case's log."""
        rows = slice(start, stop)
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

    def send_series(self, case: Viewed, start: int, stop: int) -> None:
        """The curves of rows start..stop of a case's log."""
        stride = _stride(case, self.series_rate)
        index = np.arange(start, stop)
        index = index[index % stride == 0]
        for path, values in series(case, index).items():
            self._series(path, case, case.log.time[index], values)
        self._send_solver(case, slice(start, stop), stride)

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
            values = logarithm(values)
            known = np.isfinite(values)
            self._series(f"solver/{name}", case, time[known], values[known])
        if case.is_guarded and len(log.accepted):
            self._send_trust(case, within)

    def _send_trust(self, case: Viewed, within: slice) -> None:
        """Whether the corrector was trusted from one time of the log to the next; of many steps that a picture cannot tell apart it fell
        back where any did."""
        if not self._wanted("trust"):
            return
        starts = _starts(within, max(1, int(np.ceil(len(case.log.accepted) / BAND_POINTS))))
        good = np.minimum.reduceat(case.log.accepted[within].astype(np.uint8), starts) > 0
        before = None if within.start == 0 else bool(case.log.accepted[within.start - 1])
        changes = np.flatnonzero(np.r_[good[0] != before, good[1:] != good[:-1]])
        time = case.log.time[within.start : within.stop][starts][changes]
        states: list[Any] = [TRUSTED if trusted else FALLEN_BACK for trusted in good[changes]]
        if within.stop == len(case.log.time) - 1:  # nothing is known beyond the end
            time, states = np.r_[time, case.log.time[-1]], [*states, None]
        self._columns(f"trust/{case.key}", time, rr.StateChange.columns(state=states))

    def _wanted(self, path: str) -> bool:
        return self.only is None or path in self.only

    def _series(self, path: str, case: Viewed, time: np.ndarray, values: np.ndarray) -> None:
        if len(values) and self._wanted(path):
            scalars = rr.Scalars.columns(scalars=np.asarray(values, float))
            self._columns(f"plots/{path}/{case.key}", time, scalars)


def series(case: Viewed, index: np.ndarray) -> dict[str, np.ndarray]:
    """{path below `plots/`: values as a person reads them} of some rows of a log, all but the solver's."""
    log = case.log
    found = {f"state/{c.name}": log.state[index, place] * c.scale for place, c in enumerate(log.states)}
    if len(log.wind):
        found |= {f"wind/{c.name}": log.wind[index, place] for place, c in enumerate(log.winds)}
        blades = wind_scene.wind_of_blades(case, index).T
        found |= {f"wind/{c.name}": values for c, values in zip(BLADE_WIND, blades, strict=True)}
    found |= {f"control/{c.name}": log.control[c.name][index] * c.scale for c in log.control_signals}
    return found | {f"load/{name}": values[index] * read_unit(name)[1] for name, values in log.loads.items()}


def logarithm(values: np.ndarray) -> np.ndarray:
    """log10; NaN for what has none."""
    return np.log10(np.where(values > 0, values, np.nan))


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
