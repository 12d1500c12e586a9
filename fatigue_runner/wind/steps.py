"""Stepwise wind: each value holds until the next step time; the last one holds on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.values import unmasked
from fatigue_runner.wind.checks import digest, signal_table
from fatigue_runner.wind.source import WindSource

TICKS_PER_SECOND = 1000  # step times are whole milliseconds: a finer grid would need millions of cells


@dataclass(frozen=True, eq=False)
class StepWind(WindSource):
    """Piecewise-constant wind: `values[i]` holds from `times[i]` to `times[i + 1]`, the last one for ever.

    times (n,) [s], rising, the first 0; values (n, 3) in the order of `channels.WIND_SIGNALS`, or (n,) speeds
    [m/s]. The signals jump at the step times, so a method keeps its order only where its steps end on them.
    The cell is the greatest common divisor of the step times. Raises InputError for unsorted times, times off
    the millisecond, NaN, and speeds <= 0. `mean_speed` is the plain mean of the values: how long the last one
    holds depends on the run.
    """

    kind = "steps"

    times: Any
    values: Any

    def __post_init__(self) -> None:
        values = signal_table("step wind", self.values)
        times = _step_times(self.times)
        if len(times) != len(values):
            raise InputError(f"step wind has {len(times)} times but {len(values)} values; give one per time")
        times.flags.writeable = False
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "times", times)

    @classmethod
    def example(cls) -> StepWind:
        return cls([0.0, 2.0, 5.0], [[8.0, 0.1, 0.0], [10.0, 0.2, 0.1], [7.0, 0.0, -0.1]])

    @property
    def name(self) -> str:
        return f"steps-{self.values[0, 0]:g}-to-{self.values[-1, 0]:g}-{digest(self.times, self.values)}"

    @property
    def mean_speed(self) -> float:
        return float(self.values[:, 0].mean())

    @property
    def parameters(self) -> dict[str, Any]:
        return {
            "vertical_shear": float(self.values[:, 1].mean()),
            "horizontal_shear": float(self.values[:, 2].mean()),
            "steps": len(self.times),
            "samples": digest(self.times, self.values),
        }

    @property
    def description(self) -> str:
        return "steps of the rotor's wind speed and linear shears"

    @property
    def cell_key(self) -> float | None:
        return self._cell_ticks / TICKS_PER_SECOND if self._cell_ticks else None

    @property
    def _ticks(self) -> np.ndarray:
        return np.rint(self.times * TICKS_PER_SECOND).astype(np.int64)

    @property
    def _cell_ticks(self) -> int:
        return int(np.gcd.reduce(self._ticks))

    @property
    def _settled(self) -> float:
        return float(self.times[-1]) + (self.cell_key or 1.0)

    def _cells(self, n_cells: int) -> np.ndarray:
        starts = np.arange(n_cells) * self._cell_ticks
        coefficients = np.zeros((n_cells, 4, self.values.shape[1]))
        coefficients[:, 0] = self.values[np.searchsorted(self._ticks, starts, side="right") - 1]
        return coefficients


def _step_times(times: Any) -> np.ndarray:
    """Step times (n,) [s], checked."""
    try:
        times = np.array(unmasked("step wind: times", times), float)
    except (TypeError, ValueError):
        raise InputError(f"step wind: times must be numbers in seconds, got {times!r}") from None
    if times.ndim != 1 or not len(times):
        raise InputError(f"step wind: times have shape {times.shape}; give a list of seconds, the first 0")
    for i, time in enumerate(times):
        if not math.isfinite(time):
            raise InputError(f"step wind: time {i} is {time}; give a time in seconds")
        if i == 0 and time != 0.0:
            raise InputError(f"step wind: the first time is {time:g} s; it must be 0, where the run starts")
        if i > 0 and not time > times[i - 1]:
            before = f"time {i} ({time:g} s) is not after time {i - 1} ({times[i - 1]:g} s)"
            raise InputError(f"step wind: times must rise, but {before}; sort them")
        if abs(time * TICKS_PER_SECOND - round(time * TICKS_PER_SECOND)) > 1e-6:
            raise InputError(
                f"step wind: time {i} ({float(time)!r} s) is not a whole number of milliseconds, "
                f"so no uniform cells fit the steps; round it, for instance to {round(time, 3):g} s"
            )
    return times
