"""A signal of the wind, and a state of first order that answers to it alone: y' = (gust - y) / T."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fatigue_runner.layout import WIND, Channel, FirstOrder
from fatigue_runner.wind import WindSource

TIME_CONSTANT = 0.1  # s
LENGTH = 4.0  # s

SIGNAL = Channel("gust", "m/s", "gust", "m/s")
STATE = FirstOrder(Channel("gust_response", "m/s", "answer to the gust", "m/s"))


def rates(symbol):
    """Slopes by name of the state, for `derivation.printer.Submodel`."""
    return {STATE.signal.name: (symbol[SIGNAL.name] - symbol[STATE.signal.name]) / TIME_CONSTANT}


CUBIC = np.polynomial.Polynomial(
    [0.0, 3.0 / LENGTH, -8.0 / LENGTH**2, 6.0 / LENGTH**3]
)  # the gust [m/s] over time [s]


def answer(time: Any, start: float, size: float = 1.0) -> Any:
    """The state at `time` (n,) [s] from `start` [m/s] at 0: what follows a cubic, y = g - T g' + T^2 g'' - ..., and what fades."""
    followed = size * sum((-TIME_CONSTANT) ** k * (CUBIC.deriv(k) if k else CUBIC) for k in range(4))
    return followed(np.asarray(time)) + (start - followed(0.0)) * np.exp(-np.asarray(time) / TIME_CONSTANT)


@dataclass(frozen=True)
class GustyWind(WindSource):
    """A mean wind of `speed` [m/s] that swings, as the turbine knows it, and beside it the gust, `size` times its cubic.

    Without the gust where the size is None: what another turbine knows of it.
    """

    speed: float = 9.0
    size: float | None = 1.0

    @property
    def channels(self) -> tuple[Channel, ...]:
        return WIND if self.size is None else (*WIND, SIGNAL)

    @property
    def name(self) -> str:
        return f"gusty-{self.speed:g}"

    @property
    def mean_speed(self) -> float:
        return self.speed

    @property
    def parameters(self) -> dict[str, Any]:
        return {}

    @property
    def cell_key(self) -> float:
        return LENGTH

    @property
    def length(self) -> float:
        return LENGTH

    def _cells(self, n_cells: int) -> np.ndarray:
        out = np.zeros((n_cells, 4, self.signals))
        out[:, :, 0] = self.speed, 1.0 / LENGTH, -3.0 / LENGTH**2, 2.0 / LENGTH**3
        out[:, :2, 1] = 0.1, 0.1 / LENGTH
        if self.size is not None:
            out[:, :, len(WIND)] = self.size * CUBIC.coef
        return out


# behind the class's body: a `kind` in it would offer this wind to every campaign under test
GustyWind.kind = "toy-gust"
