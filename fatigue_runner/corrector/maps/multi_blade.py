"""The map of an exponential Adams method: learned parts of its predictor and corrector, matrices in multi-blade coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from fatigue_runner.corrector import features, steps
from fatigue_runner.corrector.coordinates import from_fixed
from fatigue_runner.corrector.errors import CorrectorError
from fatigue_runner.corrector.maps.map import Array, Map
from fatigue_runner.integrators import multi_blade
from fatigue_runner.integrators.protocol import MultiBladeData
from fatigue_runner.layout import T2B1I1CG, Layout

if TYPE_CHECKING:
    from fatigue_runner.corrector.binding import Binding
    from fatigue_runner.corrector.guard import Guard
    from fatigue_runner.integrators.contract import Method
    from fatigue_runner.trajectory import Trajectory
    from fatigue_runner.turbine import Turbine

MOST_DAMPING = 100.0  # 1/s


@dataclass(frozen=True, eq=False)
class MultiBladeMap(Map):
    """predictor (states, k) acts on the rows that are known before the evaluation of the step, linear on `features.multi_blade` with
    `factors`.

    `damping` [1/s] is added to the generator's in the method's linear part; `history`: earlier nonlinear parts that are seen, where
    that is more than the method's own.
    """

    kind = features.MULTI_BLADE
    methods = "exponential-adams"

    predictor: Array
    linear: Array
    factors: tuple[str, ...] = ()
    history: int = 0
    damping: float = 0.0
    layout: Layout = T2B1I1CG

    @property
    def past(self) -> int:
        return (self.predictor.shape[1] - multi_blade.past_row(self.layout)) // multi_blade.parts(self.layout)

    def check(self, method: Method, guard: Guard) -> None:
        guard.check(self.layout.size, predicts=True)
        features.check_multi_blade_factors(self.factors)
        if guard.low:
            raise CorrectorError("one of an exponential method has no bounds")
        if not 0 <= self.damping < MOST_DAMPING:
            raise CorrectorError(f"the generator's damping must be a number from 0 to {MOST_DAMPING:g} 1/s")
        if not 0 <= self.history <= multi_blade.MOST_PAST:
            raise CorrectorError(
                f"one of an exponential method looks back {multi_blade.MOST_PAST} steps at most"
            )
        size, rows = self.layout.size, multi_blade.base_rows(self.layout, past_of(method, self.history))
        wanted = (size, rows - multi_blade.parts(self.layout)), (size, rows * (1 + len(self.factors)))
        if (self.predictor.shape, self.linear.shape) != wanted:
            raise CorrectorError(
                f"weights of shape {self.predictor.shape} and {self.linear.shape} do not fit {method.name}'s "
                f"features, which need {wanted[0]} and {wanted[1]}"
            )

    @property
    def _factor_rows(self) -> tuple[int, ...]:
        return features.multi_blade_factor_rows(self.layout, self.factors)

    def data(self, binding: Binding, turbine: Turbine, pitch: float) -> MultiBladeData:
        from fatigue_runner.integrators.dense import pack

        method: Any = binding.found
        ahead, plain = method.matrices(turbine, binding.step, pitch, self.past, self.damping)
        whole = self.linear * binding.size
        whole[:, : plain.shape[1]] += plain
        learned_ahead = ahead + self.predictor * binding.size
        rows = np.array(self._factor_rows, dtype=np.int64)
        return MultiBladeData(pack(learned_ahead)[0], pack(ahead)[0], pack(whole)[0], pack(plain)[0], rows)

    def sample(
        self, binding: Binding, turbine: Turbine, winds: Sequence[Any], runs: Sequence[Trajectory], per_wind: int, seed: int
    ) -> steps.Steps:  # fmt: skip
        return steps.collect(
            turbine, binding.found, binding.step, self.past, winds, runs, per_wind, seed, self.damping,
            self.predictor * binding.size,
        )  # fmt: skip

    def predict(self, sampled: steps.Steps, size: float) -> Array:
        """Of the corrector; what the predictor adds is part of the plain results."""
        seen = sampled.multiplied(self._factor_rows)
        return from_fixed(self.layout, seen @ (self.linear * size).T, sampled.turn)

    def tensors(self) -> dict[str, Array]:
        return {"predictor": self.predictor, "linear": self.linear}

    def header(self) -> dict[str, Any]:
        return {"factors": self.factors, "history": self.history, "damping": self.damping}

    @classmethod
    def read(cls, header: Mapping[str, Any], tensors: Mapping[str, Array], layout: Layout) -> Self:
        return cls(
            tensors["predictor"], tensors["linear"], tuple(header["factors"]), header["history"], header["damping"], layout
        )  # fmt: skip

    @property
    def sees(self) -> str:
        return self._sees_more(self.factors)


def past_of(method: Any, history: int) -> int:
    """Earlier nonlinear parts that a map of an exponential Adams method sees."""
    return max(int(method.past), history)
