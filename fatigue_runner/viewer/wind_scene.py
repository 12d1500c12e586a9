"""The wind in the scene: the disc behind the rotor, and at each blade an arrow with its number."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import rerun as rr

from fatigue_runner import channels
from fatigue_runner.layout import BLADES
from fatigue_runner.viewer import colours, shapes
from fatigue_runner.viewer.cases import Viewed
from fatigue_runner.viewer.inflow import SPAN, blade_wind, local_wind

ARROW_SCALE = 3.0  # m of an arrow per m/s of wind at a blade
DISC_X = 14.0  # m, behind the nacelle: seen from upwind, the blades keep their own colours in front of it

Columns = Callable[..., None]  # (entity path, times, columns of components, ...)


def disc_wind(case: Viewed, rows: Any) -> np.ndarray:
    """(rows, points) wind on the rotor disc [m/s]; of a slice some rows."""
    if not len(case.log.wind):
        return np.empty((0, 1))
    y, z = shapes.disc_points(case.geometry)[0].T
    wind = _signals(case, rows)
    if isinstance(rows, slice):
        wind = wind[:: max(1, len(case.log.wind) // 500)]
    return local_wind(wind, y, z, case.geometry.radius)


def wind_of_blades(case: Viewed, rows: np.ndarray) -> np.ndarray:
    """(rows, 3) wind at each blade [m/s]."""
    return blade_wind(_signals(case, rows), case.log.state[rows, case.geometry.layout.rotor])


def wind_across(case: Viewed, rows: np.ndarray) -> np.ndarray:
    """(rows, 2) lateral and vertical wind over the rotor [m/s], zero where it blows straight on."""
    out = np.zeros((len(rows), len(channels.WIND_ACROSS)))
    for column, channel in enumerate(channels.WIND_ACROSS):
        if channel in case.log.winds:
            out[:, column] = case.log.wind[rows, case.log.winds.index(channel)]
    return out


def _signals(case: Viewed, rows: Any) -> np.ndarray:
    """(rows, 3 + 2 M) speed, shears and harmonics, without what else a wind may have."""
    felt = [c in (*channels.WIND_SIGNALS, *channels.WIND_HARMONICS) for c in case.log.winds]
    return case.log.wind[rows][:, felt]


def set_up(log: Callable[[str, Any], None], case: Viewed, root: str) -> None:
    """What does not move: the disc's shape, the looks of arrows and numbers."""
    if len(case.log.wind):
        log(f"{root}/blade_wind", rr.Arrows3D.from_fields(colors=colours.BLADES, radii=0.5))
        numbers = rr.Points3D.from_fields(colors=colours.BLADES, radii=0.01, show_labels=True)
        log(f"{root}/blade_wind/speed", numbers)
    points, triangles = shapes.disc_points(case.geometry)
    centre = np.array([0.0, case.geometry.hub_height])
    disc = np.column_stack([np.full(len(points), DISC_X), points + centre])
    looks = rr.Mesh3D.from_fields(
        vertex_positions=disc, triangle_indices=triangles, albedo_factor=(255, 255, 255, 90)
    )
    log(f"{root}/wind", looks)


def send_disc(columns: Columns, case: Viewed, root: str, frames: np.ndarray, low: float, high: float) -> None:
    """The disc's colours, between `low` and `high` [m/s]."""
    shade = colours.on_scale(disc_wind(case, frames), low, high, colours.WIND_SCALE)
    mesh = rr.Mesh3D.columns(vertex_colors=colours.packed(shade).reshape(-1))
    columns(f"{root}/wind", case.log.time[frames], mesh.partition([shade.shape[1]] * len(frames)))


def send_arrows(
    columns: Columns, case: Viewed, root: str, frames: np.ndarray, scale: float, numbers: bool
) -> None:
    """The wind of each blade as an arrow that ends at the blade, in the colour of its curve; numbers: whether they stand at its tail.

    scale: times true deflection.
    """
    span = np.array([SPAN * case.geometry.radius])
    pitch = case.log.pitch[frames] if len(case.log.pitch) else None
    ends = case.geometry.pose(case.log.state[frames], span, scale=scale, pitch=pitch).blades[:, :, 0]
    vectors = np.zeros_like(ends)
    vectors[..., 0] = ARROW_SCALE * np.nan_to_num(wind_of_blades(case, frames))
    vectors[..., 1:] = ARROW_SCALE * np.nan_to_num(wind_across(case, frames))[:, None]
    tails, each, time = (ends - vectors).reshape(-1, 3), [BLADES] * len(frames), case.log.time[frames]
    arrows = rr.Arrows3D.columns(origins=tails, vectors=vectors.reshape(-1, 3))
    columns(f"{root}/blade_wind", time, arrows.partition(each))
    if numbers:
        places = rr.Points3D.columns(positions=tails)
        columns(f"{root}/blade_wind/speed", time, places.partition(each))


def send_numbers(columns: Columns, case: Viewed, root: str, frames: np.ndarray) -> None:
    """What the arrows say in numbers; they change more slowly than the arrows move, to be read."""
    speeds = wind_of_blades(case, frames).reshape(-1)
    labels = [f"{speed:.1f} m/s" if np.isfinite(speed) else "" for speed in speeds]
    told = rr.Points3D.columns(labels=labels).partition([BLADES] * len(frames))
    columns(f"{root}/blade_wind/speed", case.log.time[frames], told)
