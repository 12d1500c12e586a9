"""States and slopes in the coordinates that maps see: the shaft's twist for the generator's angle, blades in multi-blade form.

Numpy's form of what integrators/correction.py and integrators/multi_blade_rows.py compile.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.integrators import multi_blade
from fatigue_runner.integrators.linear_part import LINEARISED_AT
from fatigue_runner.layout import BLADES, Layout

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine
    from fatigue_runner.turbine.lanes import KernelData
    from fatigue_runner.wind import WindSource

Array = NDArray[np.float64]
Turn = tuple[Array, Array]  # cosine and sine (n,) of the azimuth


def turn_of(layout: Layout, x: Array) -> Turn:
    """The turn of the rotor in states (n, size)."""
    azimuth = x[:, layout.rotor]
    return np.cos(azimuth), np.sin(azimuth)


def relative(layout: Layout, x: Array, ratio: float) -> Array:
    """(n, size - 1) deflections, shaft twist, rates, rate of the twist, first-order states of states (n, size); ratio: of the gearbox."""
    rotor, n = layout.rotor, layout.freedoms
    twist = x[:, rotor] - x[:, layout.generator] / ratio
    rate = x[:, layout.rotor_speed] - x[:, layout.generator_speed] / ratio
    return np.concatenate(
        [x[:, :rotor], twist[:, None], x[:, n : 2 * n - 1], rate[:, None], x[:, 2 * n :]], axis=1
    )


def blown(turbine: Turbine, wind: WindSource, times: Array, rows: int = 0) -> Array:
    """(n, rows) signals of a wind at times (n,) [s] as the kernels read them: those of the layout, then wind across and harmonics where
    there are any. rows: at least so many, as another wind has."""
    out = np.zeros((len(times), max(rows, turbine.layout.wind_size(wind.channels))))
    out[:, turbine.layout.wind_rows(wind.channels)] = wind.at(times)
    return out


def of_harmonics(layout: Layout, x: Array, ahead: float, harmonics: Array) -> Array:
    """(n, 3) mean, cosine and sine part over the blades of azimuthal harmonics (n, 2 M) [m/s], where the blades stand `ahead` [s] of the
    states x (n, size) at their speed."""
    azimuth = x[:, layout.rotor] + ahead * x[:, layout.rotor_speed]
    blades = np.zeros((len(x), BLADES))
    angles = azimuth[:, None] + np.arange(BLADES) * 2 * np.pi / BLADES
    for i in range(harmonics.shape[1] // 2):
        for part, turned in ((0, np.cos), (1, np.sin)):
            blades += harmonics[:, [2 * i + part]] * turned((i + 1) * angles)
    parts = (
        blades.sum(axis=1) / BLADES,
        *(2 / BLADES * (blades * f(angles)).sum(axis=1) for f in (np.cos, np.sin)),
    )
    return np.stack(parts, axis=1)


def kernel(turbine: Turbine, rows: int) -> KernelData:
    """What the kernels read of the turbine for wind of so many rows."""
    return turbine.kernel_data(0.0, harmonics=rows > len(turbine.layout.wind))


def slopes(turbine: Turbine, x: Array, wind: Array) -> Array:
    """(n, k) accelerations of states (n, size) under wind (n, rows), see `blown`, the twist's in place of the generator's; then slopes
    of the first-order states."""
    from fatigue_runner.turbine.lanes import evaluate

    layout = turbine.layout
    columns, signals = np.ascontiguousarray(x.T), np.ascontiguousarray(wind.T)
    slope = evaluate(kernel(turbine, len(signals)), columns, signals)[0].T
    out = slope[:, layout.freedoms :].copy()
    out[:, layout.generator] = (
        slope[:, layout.rotor_speed] - slope[:, layout.generator_speed] / turbine.gearbox_ratio
    )
    return np.asarray(out)


def nonlinear_part(
    turbine: Turbine, x: Array, wind: Array, damping: float, point: float = LINEARISED_AT
) -> Array:
    """(n, k) slopes without their linear part; damping [1/s], point [m/s]: see `multi_blade.linear`."""
    linear = multi_blade.linear(turbine, 0.0, damping, point).low
    return np.asarray(
        slopes(turbine, x, wind) - relative(turbine.layout, x, turbine.gearbox_ratio) @ linear.T
    )


def _turned(values: Array, first: tuple[int, ...], turn: Turn, sign: int) -> Array:
    """Cosine and sine parts of the blades' columns turned by the azimuth (sign 1) or back (-1)."""
    cosine, sine = turn[0], sign * turn[1]
    out = values.copy()
    for i in first:
        out[:, i + 1] = cosine * values[:, i + 1] - sine * values[:, i + 2]
        out[:, i + 2] = sine * values[:, i + 1] + cosine * values[:, i + 2]
    return out


def from_fixed(layout: Layout, change: Array, turn: Turn) -> Array:
    """(n, size) changes of the state from multi-blade coordinates."""
    back = np.linalg.inv(multi_blade.transforms(layout).state)
    return np.asarray(_turned(change, layout.state_blade_sets, turn, -1) @ back.T)


def to_fixed(layout: Layout, change: Array, turn: Turn) -> Array:
    """(n, size) changes of the state in multi-blade coordinates."""
    return _turned(change @ multi_blade.transforms(layout).state.T, layout.state_blade_sets, turn, 1)


def relative_to_fixed(layout: Layout, values: Array, turn: Turn) -> Array:
    """(n, size - 1) relative coordinates in multi-blade form."""
    return _turned(values @ multi_blade.transforms(layout).relative.T, layout.relative_blade_sets, turn, 1)


def parts_to_fixed(layout: Layout, parts: Array, turn: Turn) -> Array:
    """(n, k) nonlinear parts in multi-blade form."""
    return _turned(parts @ multi_blade.transforms(layout).parts.T, layout.blade_sets, turn, 1)
