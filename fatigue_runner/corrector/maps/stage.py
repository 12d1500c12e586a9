"""The map of what a Runge-Kutta step has computed anyway: affine, with a small network beside where there is one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from fatigue_runner.corrector import features, samples
from fatigue_runner.corrector.errors import CorrectorError
from fatigue_runner.corrector.maps import layers as dense
from fatigue_runner.corrector.maps.map import Array, Map, Run
from fatigue_runner.integrators.protocol import StageMapData
from fatigue_runner.layout import T2B1I1CG, Layout

if TYPE_CHECKING:
    from fatigue_runner.corrector.binding import Binding
    from fatigue_runner.corrector.guard import Guard
    from fatigue_runner.integrators.contract import Method
    from fatigue_runner.trajectory import Trajectory
    from fatigue_runner.turbine import Turbine


@dataclass(frozen=True, eq=False)
class StageMap(Map):
    """linear (states, k) acts on `features.stage_aware(stages, history)` with `factors`; layers on the same rows without factors and
    without the leading 1. At least one of the two."""

    kind = features.STAGE_AWARE
    methods = "runge-kutta"

    linear: Array | None
    layers: dense.Layers = ()
    activation: str = "identity"
    factors: tuple[str, ...] = ()
    history: int = 0
    layout: Layout = T2B1I1CG

    def check(self, method: Method, guard: Guard) -> None:
        guard.check(self.layout.size, predicts=False)
        features.check_factors(self.factors)
        if not 0 <= self.history <= features.MOST_HISTORY:
            raise CorrectorError(f"features {self.kind!r} that look back {self.history} steps do not exist")
        if self.history and not guard.substeps:
            raise CorrectorError("one that looks back starts with substeps; its guard must have them")
        base = len(features.stage_aware(self.layout, method.evaluations_per_step, self.history))
        rows = base * (1 + len(self.factors))
        if rows > features.MOST_ROWS:
            raise CorrectorError(f"{rows} features are more than {features.MOST_ROWS}")
        if guard.low and len(guard.low) != base - 1:
            raise CorrectorError(f"its guard bounds {len(guard.low)} features, there are {base - 1}")
        if self.linear is None and not self.layers:
            raise CorrectorError("it has neither a linear part nor layers")
        if self.linear is not None and self.linear.shape != (self.layout.size, rows):
            raise CorrectorError(
                f"linear weights of shape {self.linear.shape} do not fit {method.name}'s features"
            )
        dense.check(self.layers, base - 1, self.layout.size, self.activation)

    @property
    def _factor_rows(self) -> tuple[int, ...]:
        return features.factor_rows(self.layout, self.factors)

    def data(self, binding: Binding, turbine: Turbine, run: Run) -> StageMapData:
        from fatigue_runner.integrators.dense import pack

        linear = np.zeros(0) if self.linear is None else pack(self.linear * binding.size)[0]
        factors = np.array(self._factor_rows, dtype=np.int64)
        net = dense.packed(self.layers, self.activation, binding.size)
        return StageMapData(turbine.gearbox_ratio, self.history, factors, linear, *net)

    def sample(
        self, binding: Binding, turbine: Turbine, winds: Sequence[Any], runs: Sequence[Trajectory], per_wind: int, seed: int
    ) -> samples.Samples:  # fmt: skip
        return samples.along(
            turbine, binding.method, binding.step, winds, runs, per_wind, 0.0, seed, history=self.history
        )

    def reference_step(self, step: float) -> float:
        return samples.output_step(step, self.history)

    def predict(self, sampled: samples.Samples, size: float) -> Array:
        out = np.zeros(sampled.plain.shape)
        if self.linear is not None:
            out += sampled.multiplied(self._factor_rows) @ self.linear.T
        if self.layers:
            out += dense.apply(self.layers, sampled.rows[:, 1:], self.activation)
        return out * size

    def tensors(self) -> dict[str, Array]:
        linear = {} if self.linear is None else {"linear": self.linear}
        return {**linear, **dense.tensors(self.layers)}

    def header(self) -> dict[str, Any]:
        return {
            "factors": self.factors, "activation": self.activation, "history": self.history, "layers": len(self.layers),
        }  # fmt: skip

    @classmethod
    def read(cls, header: Mapping[str, Any], tensors: Mapping[str, Array], layout: Layout) -> Self:
        return cls(
            tensors.get("linear"), dense.read(header["layers"], tensors), header["activation"], tuple(header["factors"]),
            header.get("history", 0), layout,
        )  # fmt: skip

    @property
    def sees(self) -> str:
        return self._sees_more(self.factors)
