"""Loss `trajectory`: a map is fitted to where its errors lead within seconds, not to its errors step by step.

A step that errs by e_n leaves a run E_{n+1} = P E_n + e_n off the true trajectory, P = exp(h A) the step of the linear part. Over a
window of steps that begins on the true trajectory, E is linear in the map's weights, as e is: its mean square is least squares again.
What rings on (tower, edges, shaft) or drifts (rotor speed) counts by what becomes of it, and an error that the next steps take back
does not count. In the modes of A the recursion is one number for each mode: rows and defects go through it, and each mode's weights
are fitted by themselves. System identification calls it an output-error fit, or a prefilter (Ljung, System Identification, 1999, 7.2,
14.4), where the usual one fits equation errors.

A is the same at every azimuth, so that E is followed in the frame that turns with the blades. It is that of the exponential methods, for
Runge-Kutta methods too; P only weighs errors here, so that what A leaves out costs nothing but some of the gain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.corrector.fit import ROUNDS, trust
from fatigue_runner.integrators import multi_blade
from fatigue_runner.integrators.linear_part import LINEARISED_AT

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]


def half_a_revolution(turbine: Turbine) -> float:
    """[s] of half a turn of the rotor at the wind of the linear part, below rated: the default horizon. Longer ones win nothing more below
    rated and lose at it, where one corner of the torque law spoils all that follows in its window (measured)."""
    return float(np.pi / turbine.operating_point(LINEARISED_AT)[turbine.layout.rotor_speed])


@dataclass(frozen=True)
class Mode:
    """One mode, or a conjugate pair: E = `times` Re(shape z), z = part E (states,); growth: of z in a step; turning: of the blades' cosine
    and sine parts, which in coordinates that do not turn also go round with the azimuth."""

    growth: complex | float
    shape: NDArray[Any]
    part: NDArray[Any]
    times: float
    turning: bool


def modes(
    turbine: Turbine, step: float, fixed: bool, damping: float = 0.0, point: float = LINEARISED_AT
) -> list[Mode]:
    """Of errors in multi-blade coordinates (fixed) or in the state's own; damping, point: see `multi_blade.linear`."""
    layout = turbine.layout
    to_fixed = multi_blade.transforms(layout).state
    # cosine part + i sine part of a blade set, and its conjugate: A leaves the two alone, and the azimuth turns each by a factor
    split = np.eye(layout.size, dtype=complex)
    group = np.zeros(layout.size, int)
    for i in layout.state_blade_sets:
        split[i + 1 : i + 3, i + 1 : i + 3] = [[1, 1j], [1, -1j]]
        group[i + 1 : i + 3] = 1, -1
    split = split @ to_fixed
    a = split @ multi_blade.linear(turbine, 0.0, damping, point).isotropic @ np.linalg.inv(split)
    back = to_fixed if fixed else np.eye(layout.size)
    found = []
    for own in (0, 1):  # the conjugates' modes are the conjugate ones
        here = group == own
        block = a[np.ix_(here, here)]
        rates, vectors = np.linalg.eig(
            block if own else block.real
        )  # of a real one pairs are conjugate to the bit
        shapes = (back @ np.linalg.inv(split))[:, here] @ vectors
        parts = np.linalg.inv(vectors) @ (split @ np.linalg.inv(back))[here]
        for number, rate in enumerate(rates):
            alone = not own and rate.imag == 0.0
            if own or rate.imag >= 0.0:
                growth, shape, part = np.exp(step * rate), shapes[:, number], parts[number]
                if alone:
                    growth, shape, part = growth.real, shape.real, part.real
                found.append(Mode(growth, shape, part, 1.0 if alone else 2.0, bool(own)))
    return found


@dataclass(frozen=True)
class Windows:
    """How samples follow one another: windows of `length` steps in a row, each from the true trajectory. azimuth (n,) [rad] of the steps'
    starts where rows and defects are in multi-blade coordinates."""

    modes: list[Mode]
    length: int
    azimuth: Array | None = None

    def followed(self, values: NDArray[Any], mode: Mode) -> NDArray[Any]:
        """(n, k) what is left in the mode of values (n, k), one a step, that have come in since their window began."""
        if mode.turning and self.azimuth is not None:
            values = np.exp(-1j * self.azimuth)[:, None] * values
        out = values.astype(np.result_type(values, mode.growth)).reshape(-1, self.length, values.shape[1])
        for n in range(1, self.length):
            out[:, n] += mode.growth * out[:, n - 1]
        return np.asarray(out.reshape(values.shape))


def fitted(
    rows: Array, defects: Array, windows: Windows, ridge: float, robust: bool, watched: tuple[int, ...] = ()
) -> Array:
    """(states, k) weights W that minimise the mean square of the error that defects - rows W^T leads to: rows (n, k), defects (n, states).

    robust, watched: as `fit.robust`, by the error at each step instead of its defect. Of blades of which each has states of its own the
    error is judged in the turning frame.
    """
    by = np.ones(len(rows))
    for left_to_do in range(ROUNDS if robust else 0, -1, -1):
        weights, left = np.zeros((defects.shape[1], rows.shape[1])), np.zeros(defects.shape)
        for mode in windows.modes:
            seen = windows.followed(rows, mode)
            wanted = windows.followed((defects @ mode.part)[:, None], mode)[:, 0]
            of_mode = _least_squares(seen, wanted, by, ridge)
            weights += mode.times * np.outer(mode.shape, of_mode).real
            if left_to_do:
                left += mode.times * np.outer(wanted - seen @ of_mode, mode.shape).real
        if left_to_do:
            by = trust(left, watched)
    return np.ascontiguousarray(weights)


def _least_squares(seen: NDArray[Any], wanted: NDArray[Any], by: Array, ridge: float) -> NDArray[Any]:
    """(k,) weights, each column scaled to unit size, with a small ridge, as `fit.affine`; by (n,): of the rows."""
    from scipy.linalg import qr, solve_triangular

    n, k = seen.shape
    both = np.empty((n + k, k + 1), seen.dtype, order="F")
    both[:n, :k], both[:n, k] = seen * by[:, None], wanted * by
    size = np.sqrt((np.abs(both[:n]) ** 2).mean(axis=0))
    size[size == 0] = 1.0
    both[:n] /= size
    both[n:] = np.sqrt(ridge * n) * np.eye(k, k + 1)
    triangle = qr(both, overwrite_a=True, mode="r", check_finite=False)[0]
    found = solve_triangular(triangle[:k, :k], triangle[:k, k])
    return np.asarray(found / size[:k] * size[k])
