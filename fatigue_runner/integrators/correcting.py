"""A corrector made ready for its compiled loop: network, fallback and acceptance test as the arrays that it reads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.integrators import exponential_adams as adams
from fatigue_runner.integrators.protocol import Guard, RawNetworkData, StepCorrector
from fatigue_runner.integrators.tableaux import ButcherTableau

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

MODES = ("enhanced", "hybrid")

# the method of the next order that has the same first stages: it costs one more evaluation
SHARING = {"heun": "rk3"}


@dataclass(frozen=True)
class Correcting:
    """What `corrected.corrected_steps`, or the exponential Adams loop, takes beside the plain method's arguments."""

    method: tuple[Any, ...]
    network: tuple[Any, ...]
    safety: tuple[Any, ...]
    limit: float
    extra_per_step: int  # evaluations of the fallback, beyond those it shares
    past: int = 0  # earlier nonlinear parts that an exponential Adams method sees; 0: a Runge-Kutta method
    starting: tuple[int, int] = (
        0,
        0,
    )  # first and end of the steps that a corrector which looks back starts with
    extra_at_start: int = 0  # evaluations in each of them, beyond the plain method's

    @property
    def hybrid(self) -> bool:
        return bool(self.safety[0])

    def loop(self, start: Any, slopes: int, aligned: Any) -> tuple[Any, Any]:
        """The compiled loop, imported only where it is used, and its working arrays for the initial states (WIDTH,)."""
        if self.past:
            from fatigue_runner.integrators import loops_exponential_adams as loops

            inputs = adams.base_rows(self.past) * (1 + len(self.network[4]))
            return loops.exponential_adams, loops.working_arrays(start, self.past, inputs, aligned)
        from fatigue_runner.integrators.corrected import corrected_steps, working_arrays

        return corrected_steps, working_arrays(start, slopes, aligned)

    def extra_evaluations(self, steps: int) -> int:
        """Evaluations beyond the plain method's in a run of `steps` steps."""
        first, end = self.starting
        start = min(max(steps, first), end) - first
        return start * self.extra_at_start + (self.extra_per_step * (steps - start) if self.hybrid else 0)


def prepare_exponential(
    corrector: StepCorrector | None,
    turbine: Turbine,
    method: adams.ExponentialAdams,
    step: float,
    mode: str,
    pitch: float,
) -> Correcting:
    """An exponential Adams method at this step and pitch [rad], plain (corrector None) or with a learned part. Raises as `prepare`."""
    if corrector is None:
        ahead, plain = adams.matrices(turbine, method, step, pitch, method.past)
        network = adams.network((ahead, ahead), (plain, plain))
        data = adams.loop_data(turbine, pitch, method.past)
        units = guard_units((1.0,) * 16, (0.0,) * 16)
        return Correcting(data, network, (False, units, units, 0.0, 0), np.nan, 0, method.past)
    if mode not in MODES:
        raise InputError(f"unknown mode {mode!r}{did_you_mean(mode, MODES)}")
    corrector.bind(turbine, method.name, step)
    past, guard = corrector.past, corrector.guard
    units = guard_units(guard.ahead_atol, guard.rtol), guard_units(guard.atol, guard.rtol)
    safety = (mode == "hybrid", *units, float(guard.limit), _norm(guard))
    data = adams.loop_data(turbine, pitch, past, corrector.damping)
    learned = tuple(corrector.map_data(turbine, pitch))
    starting = method.past - 1, past - 1
    return Correcting(data, learned, safety, float(guard.limit), 0, past, starting, 4 * adams.STARTING)


def guard_units(atol: tuple[float, ...], rtol: tuple[float, ...]) -> tuple[Any, Any]:
    """`units` of the compiled guard: 1 / atol and, where there is any, rtol / atol of the 16 states, repeated for the lanes."""
    from fatigue_runner.turbine.generated.kernel import LANES

    inverse = 1.0 / np.repeat(np.array(atol), LANES)
    return inverse, np.repeat(np.array(rtol), LANES) * inverse if any(rtol) else np.zeros(0)


def _norm(guard: Guard) -> int:
    from fatigue_runner.integrators.corrected import NORM_MAX, NORM_RMS

    return NORM_MAX if guard.norm == "max" else NORM_RMS


def _network(data: Any) -> tuple[Any, ...]:
    """`network` of `correction.correction`."""
    if isinstance(data, RawNetworkData):
        nothing = np.zeros(0)
        return True, 1.0, 0, nothing.astype(np.int64), nothing, *data
    return False, *data


def prepare(
    corrector: StepCorrector, turbine: Turbine, method: ButcherTableau, step: float, mode: str
) -> Correcting:
    """Bind a corrector to a run. Raises InputError for an unknown mode, CorrectorError where it does not fit."""
    from fatigue_runner.integrators.corrected import STARTING
    from fatigue_runner.integrators.kernel_data import runge_kutta_data, stage_rows
    from fatigue_runner.integrators.methods import method as find_method

    if mode not in MODES:
        raise InputError(f"unknown mode {mode!r}{did_you_mean(mode, MODES)}")
    corrector.bind(turbine, method.name, step)
    data = runge_kutta_data(method)
    stages = len(data[0][3])
    rows = stage_rows(stages)
    guard = corrector.guard
    if guard.substeps == 0:
        if method.name not in SHARING:
            raise InputError(
                f"corrector {corrector.name}: {method.name} shares its stages with no method; its guard needs substeps"
            )
        other = find_method(SHARING[method.name])
        assert isinstance(other, ButcherTableau)
        more = runge_kutta_data(other)
        fallback = (*more[:2], stages, 0)
        extra = other.evaluations_per_step - stages
    else:
        # its own copy: the loops write the current slope's row into these tables
        again = runge_kutta_data(method)
        fallback = (*again[:2], 0, guard.substeps)
        extra = guard.substeps * stages - 1
    units = guard_units(guard.atol, guard.rtol)
    bounds = np.array(guard.low), np.array(guard.high)
    safety = (mode == "hybrid", fallback, units, float(guard.limit), _norm(guard), bounds)
    network = _network(corrector.map_data(turbine))
    return Correcting(
        (*data[:2], rows), network, safety, float(guard.limit), extra,
        starting=(0, corrector.history), extra_at_start=STARTING * stages - 1,
    )  # fmt: skip
