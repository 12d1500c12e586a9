"""How far a trajectory is from its reference: normalised errors per state, and the paper's figure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fatigue_runner.channels import Channel
from fatigue_runner.errors import InputError

# A reference state whose values agree to this fraction of their magnitude is constant: the rest is rounding.
CONSTANT_TO = 1e-10


class Sampled(Protocol):
    """What is compared: a `Trajectory`, or anything with its time (n,) [s], state (n, k) and the k states' names."""

    time: np.ndarray
    state: np.ndarray
    states: tuple[Channel, ...]


@dataclass(frozen=True)
class Accuracy:
    """Errors against a reference, all without unit.

    nrmse {state: RMS error / range of the reference state};
    delta_e: mean of ((x - x_ref) / (|x_ref| + 1e-18))² over states and time, the figure of arXiv:2504.05493,
    which zero crossings dominate; delta_e_range: mean of (error / range of the reference state)².
    """

    nrmse: dict[str, float]
    delta_e: float
    delta_e_range: float

    @property
    def nrmse_max(self) -> float:
        """Error of the worst state."""
        return max(self.nrmse.values())

    @property
    def nrmse_mean(self) -> float:
        """Mean over the states."""
        return math.fsum(self.nrmse.values()) / len(self.nrmse)  # `sum` rounds otherwise since Python 3.12

    def to_dict(self) -> dict[str, float]:
        """The results table's columns: nrmse_max, nrmse_mean, delta_e, delta_e_range, then nrmse_<state>."""
        summary = {
            "nrmse_max": self.nrmse_max,
            "nrmse_mean": self.nrmse_mean,
            "delta_e": self.delta_e,
            "delta_e_range": self.delta_e_range,
        }
        return summary | {f"nrmse_{name}": value for name, value in self.nrmse.items()}


def compare(test: Sampled, reference: Sampled) -> Accuracy:
    """Accuracy of `test` against `reference`, sampled at the same times.

    Azimuths are compared as angles that grow, not wrapped: error of the angle over the angle turned. A state
    that is constant in the reference has no range: its error is taken relative to its magnitude, or counts as
    infinite when the reference is zero throughout and the test is not. No error is 0 in either case.
    Raises InputError when the times differ (a case that diverged ends early: it has no accuracy) or a state
    is not finite.
    """
    names = [c.name for c in reference.states]
    x, x_ref = _states(test, names, "test"), _states(reference, names, "reference")
    t, t_ref = np.asarray(test.time, dtype=float), np.asarray(reference.time, dtype=float)
    if t.shape != t_ref.shape:
        raise InputError(
            f"the trajectory has {t.size} samples to {t[-1]:g} s, its reference {t_ref.size} to "
            f"{t_ref[-1]:g} s; compare cases with the same output step that both ran to the end"
        )
    worst = float(np.abs(t - t_ref).max())
    if worst > 1e-9 * max(1.0, float(np.abs(t_ref).max())):
        raise InputError(
            f"the output times of trajectory and reference differ by up to {worst:g} s; "
            "use one output step for both"
        )
    contiguous = ((np.ascontiguousarray(values[:, i]) for values in (x, x_ref)) for i in range(len(names)))
    found = [_of_state(*both) for both in contiguous]
    nrmse = [error for error, _ in found]
    return Accuracy(
        nrmse=dict(zip(names, nrmse, strict=True)),
        delta_e=float(np.mean([relative for _, relative in found])),
        delta_e_range=float(np.mean(np.square(nrmse))),
    )


def _of_state(x: np.ndarray, x_ref: np.ndarray) -> tuple[float, float]:
    """RMS error over range, and mean square of error over value, of one state (n,): small arrays, which stay in the cache."""
    error = x - x_ref
    rms = math.sqrt(np.einsum("i,i", error, error) / error.size)
    magnitude = np.abs(x_ref)
    scale, extent = float(magnitude.max()), float(np.ptp(x_ref))
    if extent > CONSTANT_TO * scale:
        scale = extent
    magnitude += 1e-18
    error /= magnitude
    relative = float(np.einsum("i,i", error, error)) / error.size
    return 0.0 if rms == 0.0 else rms / scale if scale > 0.0 else math.inf, relative


def _states(trajectory: Sampled, names: list[str], role: str) -> np.ndarray:
    state = np.asarray(trajectory.state, dtype=np.float64)
    samples = np.asarray(trajectory.time).size
    own = [c.name for c in trajectory.states]
    if own != names:
        differing = sorted(set(own) ^ set(names)) or own
        raise InputError(
            f"trajectory and reference do not have the same states, {', '.join(differing)} differ; "
            "compare cases of the same equations"
        )
    if state.shape != (samples, len(names)) or samples == 0:
        raise InputError(
            f"the {role}'s states must be (n, {len(names)}) for n times, got {state.shape} and {samples} times"
        )
    if not np.isfinite(
        np.sum(state)
    ):  # a sum takes a third of the time of a look at each, which may find nothing
        finite = np.isfinite(state)
        if finite.all():
            return state
        row, column = (int(i) for i in np.argwhere(~finite)[0])
        raise InputError(
            f"the {role}'s state {names[column]} is {state[row, column]} at sample {row}; "
            "a case that diverged has no accuracy"
        )
    return state
