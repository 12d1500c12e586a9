"""How good a corrector is: errors of whole runs under winds that it was not trained on, and what it leaves of single defects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.corrector import samples
from fatigue_runner.integrators import MODES, Ensemble, Integrator, simulate

if TYPE_CHECKING:
    from fatigue_runner.corrector.corrector import Corrector
    from fatigue_runner.corrector.recipe import Recipe
    from fatigue_runner.trajectory import Trajectory
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Judge:
    """Accurate trajectories of an ensemble, and how far others are from them."""

    ensemble: Ensemble
    references: list[Trajectory]

    @classmethod
    def of(cls, recipe: Recipe, turbine: Turbine) -> Judge:
        """Under the winds that the recipe is judged by, sampled at every step."""
        winds, duration = recipe.judged_under()
        start = recipe.starts(turbine, winds)
        runs = samples.references(turbine, winds, start, duration, recipe.step)
        return cls(Ensemble(turbine, winds, start, duration, recipe.step), runs)

    def errors(self, integrator: Integrator, discard: float = 0.0) -> tuple[Array, float]:
        """(winds,) NRMSE, the largest over states, infinite where a run diverged; and the share of accepted steps.

        discard [s]: what is left out at the start, at most half of the run.
        """
        discard = min(discard, 0.5 * self.ensemble.duration)
        out, accepted = np.full(len(self.references), np.inf), []
        for i, (run, true) in enumerate(
            zip(simulate(self.ensemble, integrator), self.references, strict=True)
        ):
            accepted.append(float(run.accepted.mean()) if len(run.accepted) else 1.0)
            if run.diverged_at is None:
                first = int(np.searchsorted(run.time, discard - 1e-9))
                reference, state = true.state[first : len(run.state)], run.state[first:]
                scale = np.ptp(reference, axis=0)
                scale[scale == 0] = 1.0
                out[i] = float((np.sqrt(((state - reference) ** 2).mean(axis=0)) / scale).max())
        return out, float(np.mean(accepted))


def validate(corrector: Corrector, recipe: Recipe, turbine: Turbine) -> dict[str, float]:
    """Figures on the winds that the recipe is judged by: NRMSE (largest over states; median and worst over winds) of the method, enhanced
    and hybrid, accepted share, relative residual per state. What is infinite is left out: a run that diverged has no error."""
    judge = Judge.of(recipe, turbine)
    out: dict[str, float] = {}
    accepted = 1.0
    plain = Integrator(corrector.method, corrector.step)
    corrected = {mode: Integrator(corrector.method, corrector.step, corrector, mode) for mode in MODES}
    for name, integrator in {"plain": plain, **corrected}.items():
        errors, accepted = judge.errors(integrator)
        out |= {f"nrmse_{name}": float(np.median(errors)), f"nrmse_{name}_worst": float(errors.max())}
    out["acceptance"] = accepted  # of the last, the hybrid
    left = recipe.residual(corrector, turbine, judge.ensemble.winds, judge.references)
    out |= {f"residual_{name}": float(value) for name, value in zip(turbine.layout.names, left, strict=True)}
    return {name: value for name, value in out.items() if np.isfinite(value)}


def median_error(judge: Judge, corrector: Corrector, discard: float) -> float:
    """Of enhanced runs over the winds."""
    integrator: Any = Integrator(corrector.method, corrector.step, corrector)
    return float(np.median(judge.errors(integrator, discard)[0]))
