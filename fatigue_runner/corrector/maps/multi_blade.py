"""The map of an exponential Adams method: learned parts of its predictor and corrector, matrices in multi-blade coordinates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from fatigue_runner.corrector import features, steps
from fatigue_runner.corrector.coordinates import from_fixed
from fatigue_runner.corrector.errors import CorrectorError
from fatigue_runner.corrector.maps.map import Array, Map, Run
from fatigue_runner.integrators import multi_blade
from fatigue_runner.integrators.command_rows import command_count
from fatigue_runner.integrators.linear_part import linearisation_point
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
    `factors`; (bins, states, k) where there is a map for each of several mean winds.

    `damping` [1/s] is added to the generator's in the method's linear part; `history`: earlier nonlinear parts that are seen, where
    that is more than the method's own. layout: with azimuthal harmonics where they are seen. again: of a map that sees what a
    controller commands within the step (`integrators.command_rows`), the predictor's second product, on its rows and on these.
    """

    kind = features.MULTI_BLADE
    methods = "exponential-adams"

    predictor: Array
    linear: Array
    factors: tuple[str, ...] = ()
    history: int = 0
    damping: float = 0.0
    layout: Layout = T2B1I1CG
    bins: tuple[float, ...] = ()
    again: Array | None = None

    @property
    def commands(self) -> bool:
        """Whether it sees what is commanded within a step."""
        return self.again is not None

    @property
    def past(self) -> int:
        return (self.predictor.shape[-1] - multi_blade.past_row(self.layout)) // multi_blade.parts(
            self.layout
        )

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
        if self.commands and not self.layout.first_order:
            raise CorrectorError("it sees commands, and its turbine has no controller")
        first = (len(self.bins),) if self.bins else ()
        ahead, more = rows - multi_blade.parts(self.layout), command_count(self.past) if self.commands else 0
        found = [self.predictor.shape, self.linear.shape]
        wanted = [(*first, size, ahead), (*first, size, (rows + more) * (1 + len(self.factors)))]
        if self.again is not None:
            found, wanted = [*found, self.again.shape], [*wanted, (*first, size, ahead + more)]
        if found != wanted:
            raise CorrectorError(
                f"weights of shape {' and '.join(map(str, found))} do not fit {method.name}'s "
                f"features, which need {' and '.join(map(str, wanted))}"
            )

    @property
    def _factor_rows(self) -> tuple[int, ...]:
        return features.multi_blade_factor_rows(self.layout, self.factors)

    def data(self, binding: Binding, turbine: Turbine, run: Run) -> MultiBladeData:
        from fatigue_runner.integrators.dense import pack

        method: Any = binding.found
        point = linearisation_point(turbine, run.speed)
        ahead, plain = method.matrices(
            turbine, binding.step, run.pitch, self.past, self.damping, point, run.harmonics
        )
        layout = multi_blade.seen_by(turbine, run.harmonics)
        own = [self._in(weights, run.speed) for weights in (self.predictor, self.linear)]
        predictor = binding.size * _seen(own[0], self.layout, layout, ())
        whole = binding.size * _seen(own[1], self.layout, layout, self.factors)
        whole[:, : plain.shape[1]] += plain
        learned_ahead = ahead + predictor
        again = np.zeros(0)
        if self.again is not None:
            second = binding.size * _seen(self._in(self.again, run.speed), self.layout, layout, ())
            second[:, : ahead.shape[1]] += ahead
            again = pack(second)[0]
        rows = np.array(self._factor_rows, dtype=np.int64)
        return MultiBladeData(pack(learned_ahead)[0], again, pack(whole)[0], pack(plain)[0], rows)

    def sample(
        self, binding: Binding, turbine: Turbine, winds: Sequence[Any], runs: Sequence[Trajectory], per_wind: int, seed: int
    ) -> steps.Steps:  # fmt: skip
        return steps.collect(
            turbine, binding.found, binding.step, self.past, winds, runs, per_wind, seed, self.damping,
            [self._learned(own, binding.size) for own in self._predictors], self.bins, commands=self.commands,
        )  # fmt: skip

    def _learned(self, weights: Array, size: float) -> Callable[[float], Array]:
        """Those of a mean wind, scaled to the defect."""
        return lambda speed: self._in(weights, speed) * size

    @property
    def _predictors(self) -> list[Array]:
        """In the order in which a step uses them."""
        return [self.predictor] if self.again is None else [self.predictor, self.again]

    def predict(self, sampled: steps.Steps, size: float) -> Array:
        """Of the corrector; what the predictor adds is part of the plain results."""
        return self._given(self.linear, sampled.multiplied(self._factor_rows), sampled, size)

    def predict_ahead(self, sampled: steps.Steps, size: float) -> Array:
        """(n, states) what the learned part adds to the predictor's result."""
        return self._given(self._predictors[-1], sampled.ahead_rows, sampled, size)

    def _given(self, weights: Array, seen: Array, sampled: steps.Steps, size: float) -> Array:
        out = np.empty(sampled.plain.shape)
        for speed in np.unique(sampled.speeds):
            here = sampled.speeds == speed
            out[here] = seen[here] @ (self._in(weights, speed) * size).T
        return from_fixed(self.layout, out, sampled.turn)

    def _in(self, weights: Array, speed: float) -> Array:
        """Those of a mean wind's bin."""
        return weights[self.bin_of(speed)] if self.bins else weights

    def tensors(self) -> dict[str, Array]:
        again = {} if self.again is None else {"again": self.again}
        return {"predictor": self.predictor, "linear": self.linear, **again}

    def header(self) -> dict[str, Any]:
        return {
            "factors": self.factors, "history": self.history, "damping": self.damping, "bins": self.bins,
            "harmonics": self.layout.harmonics,
        }  # fmt: skip

    @classmethod
    def read(cls, header: Mapping[str, Any], tensors: Mapping[str, Array], layout: Layout) -> Self:
        return cls(
            tensors["predictor"], tensors["linear"], tuple(header["factors"]), header["history"], header["damping"],
            layout.extended(harmonics=header.get("harmonics", False)), tuple(header.get("bins", ())), tensors.get("again"),
        )  # fmt: skip

    @property
    def sees(self) -> str:
        return self._sees_more(self.factors) + (", commands within the step" if self.commands else "")


def _seen(weights: Array, own: Layout, run: Layout, factors: tuple[str, ...]) -> Array:
    """(states, k) for a run whose rows have azimuthal harmonics and the map's do not, or the other way round: what is not there is zero."""
    if own.harmonics == run.harmonics:
        return weights
    blocks = np.split(weights, 1 + len(factors), axis=1) if factors else [weights]
    first, last = multi_blade.harmonic_row(own), multi_blade.past_row(own if own.harmonics else run)
    if own.harmonics:
        return np.concatenate([np.delete(block, slice(first, last), axis=1) for block in blocks], axis=1)
    none = np.zeros((len(weights), last - first))
    return np.concatenate(
        [np.insert(block, [first] * (last - first), none, axis=1) for block in blocks], axis=1
    )


def past_of(method: Any, history: int) -> int:
    """Earlier nonlinear parts that a map of an exponential Adams method sees."""
    return max(int(method.past), history)
