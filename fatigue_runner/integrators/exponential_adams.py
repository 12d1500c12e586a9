"""Exponential Adams methods: one evaluation a step, the linear part exact, the rest a polynomial through its last values.

x' = A x + g(t, x) with A as for ETDRK4. From g at earlier steps a predictor gives x~ at the step's end, f is evaluated there, and a
corrector integrates the polynomial through that value and the earlier ones (PEC mode: the values at x~ are the ones kept; f = A x + g
takes the distance of x~ from x into account to first order). Weights: Hochbruck & Ostermann (2011), doi:10.1007/s11075-010-9408-y, and
Beylkin, Keiser & Vozovoi (1998), doi:10.1006/jcph.1998.6093, for the implicit ones. The step itself: `exponential_steps`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.integrators import multi_blade
from fatigue_runner.integrators.contract import Aligned, Lanes, Prepared, Task
from fatigue_runner.integrators.dense import of_lanes, pack
from fatigue_runner.integrators.exponential_steps import (
    ExponentialAdamsArrays,
    evaluations_of_refused,
    plain_maps,
    room_for,
    tested_by,
)
from fatigue_runner.integrators.linear_part import LINEARISED_AT, linearisation_point
from fatigue_runner.integrators.protocol import MultiBladeData, StepCorrector
from fatigue_runner.integrators.runge_kutta import runge_kutta_arrays
from fatigue_runner.integrators.step_ladder import evaluations_of_rungs, with_rungs
from fatigue_runner.integrators.stepper import RING
from fatigue_runner.integrators.tableaux import RK4

Array = NDArray[np.float64]

STARTING = 8  # sub-steps of RK4 in each step before there are enough earlier values


@dataclass(frozen=True)
class ExponentialAdams:
    """`past` earlier values, this step's included, for the corrector, `predictor` for the predictor; the corrector has the new one too."""

    name: str
    order: int
    source: str
    predictor: int
    past: int
    evaluations_per_step: int = 1

    family = "exponential-adams"
    varying_pitch = False
    correctable = True

    def evaluations(self, steps: int) -> int:
        """Of a run of `steps` steps, with the initial slope and the start."""
        return 1 + min(steps, self.past - 1) * 4 * STARTING + steps

    def growth(self, z: NDArray[np.complex128]) -> Array | None:
        """None: what is linear is exact, so that the rest decides; `stability_limit` tries it out."""
        return None

    def matrices(
        self,
        turbine: Any,
        step: float,
        pitch: float,
        past: int,
        damping: float = 0.0,
        point: float = LINEARISED_AT,
        harmonics: bool = False,
    ) -> tuple[Array, Array]:
        """Predictor and corrector on the rows of a step that holds `past` earlier values; see `multi_blade.matrices`."""
        nodes = self.predictor, self.past
        return multi_blade.matrices(turbine, step, pitch, nodes, past, damping, point, harmonics)

    def prepare(self, task: Task) -> Prepared:
        """See `contract.Method`."""
        corrector = task.corrector
        if corrector is not None:
            corrector.bind(task.turbine, self.name, task.step)
        hybrid = corrector is not None and task.mode == "hybrid"
        rungs = corrector.rungs if corrector is not None and hybrid else ()
        for rung in rungs:
            rung.bind(task.turbine, rung.method, rung.step)
        past = self.past if corrector is None else corrector.past

        def evaluations(steps: int) -> int:
            # a corrector that looks further back starts longer
            begun = min(max(steps, self.past - 1), past - 1) - (self.past - 1)
            return self.evaluations(steps) + begun * 4 * STARTING

        def arrays(lanes: Lanes, aligned: Aligned) -> Any:
            return self._arrays(task, corrector, hybrid, lanes, aligned)

        def ladder(lanes: Lanes, aligned: Aligned) -> Any:
            own = [
                (round(task.step / rung.step), self._arrays(task, rung, True, lanes, aligned))
                for rung in rungs
            ]
            return with_rungs(arrays(lanes, aligned), own, lanes.start, task.layout, aligned)

        if corrector is None or not hybrid:
            return Prepared(arrays, RING, evaluations)
        limit = float(corrector.guard.limit)
        if rungs:
            return Prepared(ladder, RING, evaluations, limit, evaluations_of_rungs)
        return Prepared(arrays, RING, evaluations, limit, evaluations_of_refused)

    def _arrays(
        self, task: Task, corrector: StepCorrector | None, hybrid: bool, lanes: Lanes, aligned: Aligned
    ) -> ExponentialAdamsArrays:
        """Of the method alone or with a corrector."""
        turbine, layout = task.turbine, task.layout
        past = self.past if corrector is None else corrector.past
        damping = 0.0 if corrector is None else corrector.damping
        start = runge_kutta_arrays(RK4)

        def maps_at(point: float) -> MultiBladeData:
            if corrector is not None:
                return corrector.map_data(turbine, task.pitch, point, layout.harmonics)
            return plain_maps(
                *self.matrices(turbine, task.step, task.pitch, past, point=point, harmonics=layout.harmonics)
            )

        points = [linearisation_point(turbine, speed) for speed in lanes.speeds]
        [low] = of_lanes(lambda p: [pack(multi_blade.linear(turbine, task.pitch, damping, p).low)[0]], points)
        factors = maps_at(points[0]).factors
        ahead, again, weights, plain = of_lanes(lambda point: maps_at(point)[:-1], points)
        maps, steered = MultiBladeData(ahead, again, weights, plain, factors), len(again) > 0
        room = room_for(lanes.start, len(lanes.signals.p), layout, past, len(factors), steered, aligned)
        tested = tested_by(corrector, hybrid, layout.size)
        return ExponentialAdamsArrays(
            low, turbine.gearbox_ratio, past, start.stages, start.result, STARTING, maps, tested, room
        )


_SOURCE = (
    "exponential Adams-Bashforth-Moulton, PEC; Hochbruck & Ostermann (2011), doi:10.1007/s11075-010-9408-y"
)
ETDABM3 = ExponentialAdams("etdabm3", 3, _SOURCE, 2, 2)
ETDABM4 = ExponentialAdams("etdabm4", 4, _SOURCE, 3, 3)
