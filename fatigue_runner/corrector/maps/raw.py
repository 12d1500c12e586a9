"""The network of arXiv:2504.05493: it sees the state as it is, azimuths included, and the wind speed, but not the stages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from fatigue_runner.corrector import features, samples
from fatigue_runner.corrector.errors import CorrectorError
from fatigue_runner.corrector.maps import layers as dense
from fatigue_runner.corrector.maps.map import Array, Map, Run
from fatigue_runner.integrators.protocol import RawNetworkData
from fatigue_runner.layout import T2B1I1CG, Layout

if TYPE_CHECKING:
    from fatigue_runner.corrector.binding import Binding
    from fatigue_runner.corrector.guard import Guard
    from fatigue_runner.integrators.contract import Method
    from fatigue_runner.trajectory import Trajectory
    from fatigue_runner.turbine import Turbine


@dataclass(frozen=True, eq=False)
class RawNetwork(Map):
    """layers on `features.raw()` without its leading 1."""

    kind = features.RAW
    methods = "runge-kutta"

    layers: dense.Layers
    activation: str = "relu"
    layout: Layout = T2B1I1CG

    def check(self, method: Method, guard: Guard) -> None:
        guard.check(self.layout.size, predicts=False)
        inputs = len(features.raw(self.layout)) - 1
        if not self.layers:
            raise CorrectorError("a network without layers")
        if guard.low and len(guard.low) != inputs:
            raise CorrectorError(f"its guard bounds {len(guard.low)} features, there are {inputs}")
        dense.check(self.layers, inputs, self.layout.size, self.activation)

    def data(self, binding: Binding, turbine: Turbine, run: Run) -> RawNetworkData:
        return RawNetworkData(*dense.packed(self.layers, self.activation, binding.size))

    def sample(
        self, binding: Binding, turbine: Turbine, winds: Sequence[Any], runs: Sequence[Trajectory], per_wind: int, seed: int
    ) -> samples.Samples:  # fmt: skip
        return samples.along(turbine, binding.method, binding.step, winds, runs, per_wind, 0.0, seed)

    def reference_step(self, step: float) -> float:
        return samples.output_step(step, 0)

    def predict(self, sampled: samples.Samples, size: float) -> Array:
        return dense.apply(self.layers, sampled.raw[:, 1:], self.activation) * size

    def tensors(self) -> dict[str, Array]:
        return dense.tensors(self.layers)

    def header(self) -> dict[str, Any]:
        return {"activation": self.activation, "layers": len(self.layers)}

    @classmethod
    def read(cls, header: Mapping[str, Any], tensors: Mapping[str, Array], layout: Layout) -> Self:
        return cls(dense.read(header["layers"], tensors), header["activation"], layout)
