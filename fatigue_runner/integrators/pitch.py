"""A blade pitch that varies in time: a cubic spline through samples, the same for all blades and cases of a block."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fatigue_runner.errors import InputError
from fatigue_runner.values import unmasked
from fatigue_runner.wind.cells import cell_count, evaluate, minimum

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PitchSeries:
    """Pitch [rad], positive to feather, through `angle` (n,) at `time` (n,) [s], which starts at 0 and rises in equal steps.

    A cubic spline (not-a-knot), so that a method keeps its order. The modes and coefficients are those of the momentary pitch; pitch
    rate and acceleration are neglected. Raises InputError for fewer than two samples, uneven times and what is no number.
    """

    time: ArrayLike
    angle: ArrayLike

    def __post_init__(self) -> None:
        time, angle = (
            np.asarray(unmasked(f"pitch series: {name}", getattr(self, name)), float).copy()
            for name in ("time", "angle")
        )
        if time.ndim != 1 or time.shape != angle.shape or len(time) < 2:
            raise InputError(
                f"pitch series: give at least two times and one angle for each, got {time.size} and {angle.size}"
            )
        if not (np.isfinite(time).all() and np.isfinite(angle).all()):
            raise InputError("pitch series: times and angles must be finite numbers")
        steps = np.diff(time)
        if time[0] != 0.0 or steps.min() <= 0 or np.ptp(steps) > 1e-6 * steps.max():
            raise InputError(
                "pitch series: times must start at 0 s and rise in equal steps; resample the series"
            )
        for name, values in (("time", time), ("angle", angle)):
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @property
    def time_step(self) -> float:
        """[s]"""
        return float(np.asarray(self.time)[-1]) / (np.size(self.time) - 1)

    @cached_property
    def _coefficients(self) -> Array:
        from scipy.interpolate import CubicSpline

        angle = np.asarray(self.angle)
        return np.ascontiguousarray(CubicSpline(np.arange(len(angle)) * self.time_step, angle).c[::-1].T)

    def at(self, time: ArrayLike) -> Array:
        """Pitch (n,) [rad] at `time` (n,) [s]."""
        return evaluate(self.time_step, self._coefficients[..., None], np.asarray(time, float))[:, 0]

    def cells(self, pitch_range: tuple[float, float], duration: float) -> tuple[float, Array]:
        """Cell duration [s] and cubics (n, 4) of a run of `duration` [s].

        Raises InputError where the series is shorter, or leaves `pitch_range` [rad], that of the turbine's tables.
        """
        count = cell_count(duration, self.time_step)
        if count > len(self._coefficients):
            end = self.time_step * len(self._coefficients)
            raise InputError(
                f"pitch series: it ends at {end:g} s, the run at {duration:g} s; give a longer series"
            )
        cubics = self._coefficients[:count]
        low, high = np.degrees(pitch_range)
        lowest = minimum(self.time_step, cubics)
        highest = minimum(self.time_step, -cubics)
        for angle, at in (lowest, (-highest[0], highest[1])):
            if not low - 1e-7 <= np.degrees(angle) <= high + 1e-7:
                raise InputError(
                    f"pitch series: {np.degrees(angle):.4g} deg at {at:.4g} s is outside the aerodynamic table ({low:g} to {high:g} deg)"
                )
        return self.time_step, np.ascontiguousarray(cubics)


def first_pitch(pitch: float | PitchSeries) -> float:
    """The pitch at the start [rad], to which the operating point belongs."""
    return float(np.asarray(pitch.angle)[0]) if isinstance(pitch, PitchSeries) else float(pitch)
