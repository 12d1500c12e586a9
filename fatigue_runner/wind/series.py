"""A smooth series: cubic splines through samples, twice continuously differentiable.

Linear interpolation would have a kink at every sample, which no high-order method survives; here only the
third derivative jumps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.wind.checks import digest, number, refuse_standstill, signal_table
from fatigue_runner.wind.source import WindSource


@dataclass(frozen=True, eq=False)
class SeriesWind(WindSource):
    """Cubic spline (not-a-knot) through samples every `time_step` [s], the first at 0.

    values (n, 3) in the order of `channels.WIND_SIGNALS`, or (n,) speeds [m/s]; the series ends at the last
    sample. `origin` says where the samples come from (a file's name), for names and labels. Raises InputError
    for fewer than two samples, NaN, and a speed that is not positive everywhere, between the samples too.
    """

    kind = "series"

    time_step: float
    values: Any
    origin: str = ""

    def __post_init__(self) -> None:
        time_step = number("series wind: time_step", self.time_step, above=0.0, unit=" s")
        object.__setattr__(self, "time_step", time_step)
        object.__setattr__(self, "values", signal_table("series wind", self.values))
        if len(self.values) < 2:
            raise InputError("series wind has one sample; give at least two, or use constant wind")
        way_out = "the spline through a jump overshoots it: raise the samples there, or spread the jump over several samples"
        refuse_standstill(self.name, self.time_step, self._coefficients, way_out)

    @classmethod
    def example(cls) -> SeriesWind:
        time = np.arange(25) * 0.5
        signals = [8 + np.sin(time), 0.1 + 0.05 * np.cos(time), 0.1 * np.sin(2 * time)]
        return cls(0.5, np.stack(signals, axis=1))

    @property
    def name(self) -> str:
        return f"series-{self.origin or format(self.mean_speed, '.3g')}-{digest(self.values)}"

    @property
    def mean_speed(self) -> float:
        return float(self.values[:, 0].mean())

    @property
    def parameters(self) -> dict[str, Any]:
        speeds = self.values[:, 0]
        return {
            "vertical_shear": float(self.values[:, 1].mean()),
            "horizontal_shear": float(self.values[:, 2].mean()),
            "turbulence_intensity": float(speeds.std() / speeds.mean()),
            "time_step": self.time_step,
            "origin": self.origin,
            "samples": digest(self.values),
        }

    @property
    def description(self) -> str:
        return "a series of the rotor's wind speed and linear shears"

    @property
    def cell_key(self) -> float:
        return self.time_step

    @property
    def length(self) -> float:
        return (len(self.values) - 1) * self.time_step

    @cached_property
    def _coefficients(self) -> np.ndarray:
        from scipy.interpolate import CubicSpline  # slower to import than all of wind

        spline = CubicSpline(np.arange(len(self.values)) * self.time_step, self.values)
        return np.ascontiguousarray(spline.c[::-1].transpose(1, 0, 2))

    def _cells(self, n_cells: int) -> np.ndarray:
        return self._coefficients[:n_cells]


def periodic_cubics(samples: np.ndarray, time_step: float) -> np.ndarray:
    """Coefficients (n, 4, n_signals) of the periodic C2 cubic spline through samples (n, n_signals).

    The spline's slopes m solve m[i-1] + 4 m[i] + m[i+1] = 3 (y[i+1] - y[i-1]) / h, a circulant system: one
    division in Fourier space.
    """
    n, h = len(samples), time_step
    angle = 2 * np.pi * np.arange(n // 2 + 1) / n
    transfer = 6j * np.sin(angle) / (h * (4 + 2 * np.cos(angle)))
    slopes = np.fft.irfft(np.fft.rfft(samples, axis=0) * transfer[:, None], n, axis=0)
    rise = (np.roll(samples, -1, axis=0) - samples) / h
    ahead = np.roll(slopes, -1, axis=0)
    c2 = (3 * rise - 2 * slopes - ahead) / h
    c3 = (slopes + ahead - 2 * rise) / h**2
    return np.stack([samples, slopes, c2, c3], axis=1)
