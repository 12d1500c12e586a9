"""A corrector made ready for the compiled loop: network, fallback and acceptance test as the arrays that it reads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.integrators.tableaux import ButcherTableau

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

MODES = ("enhanced", "hybrid")

# the method of the next order that has the same first stages: it costs one more evaluation
SHARING = {"heun": "rk3"}


@dataclass(frozen=True)
class Correcting:
    """What `corrected.corrected_steps` takes beside the plain method's arguments."""

    method: tuple[Any, ...]
    network: tuple[Any, ...]
    safety: tuple[Any, ...]
    limit: float
    fallback_evaluations: int  # per step, beyond those it shares

    @property
    def hybrid(self) -> bool:
        return bool(self.safety[0])

    def extra_evaluations(self, steps: int) -> int:
        """Evaluations of the fallback in a run of `steps` steps: all of a hybrid, the first ones of a network that looks back."""
        from fatigue_runner.integrators.corrected import STARTING

        history, own = self.network[2], len(self.method[2])
        start = min(steps, history)
        return start * (STARTING * own - 1) + (
            self.fallback_evaluations * (steps - start) if self.hybrid else 0
        )


def prepare(corrector: Any, turbine: Turbine, method: ButcherTableau, step: float, mode: str) -> Correcting:
    """Bind a `corrector.Corrector` to a run. Raises InputError for an unknown mode, CorrectorError where it does not fit."""
    from fatigue_runner.integrators.corrected import NORM_MAX, NORM_RMS
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
    norm = NORM_MAX if guard.norm == "max" else NORM_RMS
    safety = (
        mode == "hybrid",
        fallback,
        np.array(guard.atol),
        np.array(guard.rtol),
        float(guard.limit),
        norm,
    )
    network = corrector.kernel_network(turbine.parameters["g_ratio"])
    return Correcting((*data[:2], rows), network, safety, float(guard.limit), extra)
