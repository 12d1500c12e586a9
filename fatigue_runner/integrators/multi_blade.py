"""Multi-blade (Coleman) coordinates: the hub's frame that does not turn, where an isotropic rotor has constant coefficients.

The exponential Adams methods write a step there: one matrix product then makes a predictor or a corrector. What a step sees are rows
[n][LANES]: 1; the relative state; wind at the step's start, middle and end; where the equations take azimuthal harmonics, what the
blades feel of them (mean, cosine and sine part) at these times; then nonlinear parts, the newest first, the new one last.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import factorial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.caches import kept_with
from fatigue_runner.integrators.linear_part import LINEARISED_AT, linear_part, phi_functions
from fatigue_runner.layout import BLADES, Layout

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

STATE_ROW = 1
MOST_PAST = 4
TIMES = 3  # of a step at which the wind is seen


def wind_row(layout: Layout) -> int:
    """First row of the wind."""
    return STATE_ROW + layout.relative_size


def harmonic_row(layout: Layout) -> int:
    """First row of what the blades feel of azimuthal harmonics."""
    return wind_row(layout) + TIMES * len(layout.wind)


def past_row(layout: Layout) -> int:
    """First row of the nonlinear parts."""
    return harmonic_row(layout) + (TIMES * BLADES if layout.harmonics else 0)


def parts(layout: Layout) -> int:
    """Rows of a nonlinear part: accelerations, of the shaft's twist in place of the generator's, and first-order slopes."""
    return layout.freedoms + len(layout.first_order)


def base_rows(layout: Layout, past: int) -> int:
    """Rows that a corrector sees with `past` earlier nonlinear parts."""
    return past_row(layout) + parts(layout) * (past + 1)


def seen_by(turbine: Turbine, harmonics: bool) -> Layout:
    """The turbine's layout as it is under wind with azimuthal harmonics, or without."""
    return turbine.layout.extended(harmonics=turbine.layout.harmonics or harmonics)


def to_multi_blade(rows: int, first: tuple[int, ...]) -> Array:
    """(rows, rows) from three blades' rows, which begin at each of `first`, to mean, cosine and sine part at azimuth zero."""
    out = np.eye(rows)
    half, third = np.sqrt(3) / 2, 1 / 3
    block = np.array([[third] * 3, [2 * third, -third, -third], [0.0, 2 * third * half, -2 * third * half]])
    for i in first:
        out[i : i + BLADES, i : i + BLADES] = block
    return out


@dataclass(frozen=True)
class Transforms:
    """`to_multi_blade` of the state, of the relative state and of a nonlinear part."""

    state: Array
    relative: Array
    parts: Array


@lru_cache
def transforms(layout: Layout) -> Transforms:
    return Transforms(
        to_multi_blade(layout.size, layout.state_blade_sets),
        to_multi_blade(layout.relative_size, layout.relative_blade_sets),
        to_multi_blade(parts(layout), layout.blade_sets),
    )


@dataclass(frozen=True)
class Linear:
    """A in relative coordinates: `low` gives a nonlinear part's rows (accelerations, that of the twist last, first-order slopes),
    `rates` (size, relative) all of A x. `isotropic`: (size, size) A of the state's own coordinates."""

    low: Array
    rates: Array
    isotropic: Array


@kept_with(64)
def linear(turbine: Turbine, pitch: float, damping: float = 0.0, point: float = LINEARISED_AT) -> Linear:
    """The linear part at a linearisation point as it looks from every azimuth alike, to rounding: what the average leaves of a coupling
    is dropped.

    damping [1/s]: added to the generator's. The torque law's line of region 2.5 is 5/s steeper than region 2, and with A of region 2
    steps above 0.1 s are unstable there; between the two both are stable (measured), and a learned part makes up for the accuracy.
    """
    layout = turbine.layout
    ratio, n = turbine.gearbox_ratio, layout.freedoms
    rotor, generator = layout.rotor, layout.generator
    own = linear_part(turbine, pitch, point).copy()
    own[layout.generator_speed, layout.generator_speed] -= damping
    to_fixed = transforms(layout).state
    a = _isotropic(to_fixed @ own @ np.linalg.inv(to_fixed), layout)
    a = np.linalg.inv(to_fixed) @ a @ to_fixed
    a[n:, rotor] = -ratio * a[n:, generator]
    rates = np.zeros((layout.size, layout.relative_size))
    rates[:, :rotor], rates[:, rotor] = a[:, :rotor], -ratio * a[:, generator]
    # one row less before the rates: the two azimuths have become the twist
    speed, slip = rotor + n - 1, 2 * n - 2
    rates[:, n - 1 : speed], rates[:, speed] = (
        a[:, n : n + rotor],
        a[:, n + rotor] + ratio * a[:, n + generator],
    )
    rates[:, slip] = -ratio * a[:, n + generator]
    rates[:, slip + 1 :] = a[:, 2 * n :]
    low = rates[n:].copy()
    low[generator] = rates[n + rotor] - rates[n + generator] / ratio
    return Linear(low, rates, a)


def _isotropic(a: Array, layout: Layout) -> Array:
    """`a` (multi-blade) with the cosine and sine parts coupled to each other alone, and alike."""
    cyclic = [i + 1 for i in layout.state_blade_sets]
    turning = np.zeros(layout.size, bool)
    for i in cyclic:
        turning[i : i + 2] = True
    a[np.ix_(turning, ~turning)] = 0.0
    a[np.ix_(~turning, turning)] = 0.0
    for i in cyclic:
        for j in cyclic:
            same, cross = (a[i, j] + a[i + 1, j + 1]) / 2, (a[i, j + 1] - a[i + 1, j]) / 2
            a[i, j] = a[i + 1, j + 1] = same
            a[i, j + 1], a[i + 1, j] = cross, -cross
    return a


def _parts_to_state(layout: Layout, ratio: float) -> Array:
    """(size, parts): derivatives of the state from a nonlinear part."""
    n, rotor, generator = layout.freedoms, layout.rotor, layout.generator
    out = np.zeros((layout.size, parts(layout)))
    out[n : n + generator, :generator] = np.eye(generator)
    out[n + generator, rotor : rotor + 2] = ratio, -ratio
    out[2 * n :, n:] = np.eye(len(layout.first_order))
    return out


def weights(a: Array, step: float, nodes: list[int]) -> list[Array]:
    """(n, n) each: the step's integral of exp((1 - t) h A) g(t), g the polynomial through its values at `nodes` [steps]."""
    count = len(nodes)
    phi = phi_functions(a * step, count)
    powers = np.linalg.inv(np.vander(nodes, count, increasing=True).astype(float))
    return [sum(powers[k, j] * factorial(k) * step * phi[k + 1] for k in range(count)) for j in range(count)]


@kept_with(256)
def matrices(
    turbine: Turbine, step: float, pitch: float, nodes: tuple[int, int], past: int, damping: float = 0.0, point: float = LINEARISED_AT,
    harmonics: bool = False,
) -> tuple[Array, Array]:  # fmt: skip
    """Predictor (size, rows before the new part) and corrector (size, `base_rows`) on the rows of a step, in multi-blade coordinates.

    nodes: earlier values in the polynomials of predictor and corrector; `past` of them stand in the rows; point: of the linearisation;
    harmonics: whether the equations take azimuthal ones.
    """
    layout, line = seen_by(turbine, harmonics), linear(turbine, pitch, damping, point)
    turn, width = transforms(layout), parts(layout)
    spread = _parts_to_state(layout, turbine.gearbox_ratio)
    back = np.linalg.inv(turn.relative), np.linalg.inv(turn.parts)
    rows, first_part = base_rows(layout, past), past_row(layout)
    state = step * phi_functions(line.isotropic * step, 1)[1] @ line.rates

    def put(at: list[int]) -> Array:
        out = np.zeros((layout.size, rows))
        out[:, STATE_ROW : wind_row(layout)] = turn.state @ state @ back[0]
        for node, weight in zip(at, weights(line.isotropic, step, at), strict=True):
            first = first_part + width * (past if node == 1 else -node)
            out[:, first : first + width] = turn.state @ weight @ spread @ back[1]
        return out

    predictor = put([-j for j in range(nodes[0])])[:, : rows - width]
    return np.ascontiguousarray(predictor), put([1, *(-j for j in range(nodes[1]))])
