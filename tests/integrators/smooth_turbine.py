"""A turbine and a wind without kinks of any derivative, on which methods of order 8 can show their order."""

from __future__ import annotations

import numpy as np

from fatigue_runner.turbine import Turbine, load_turbine
from fatigue_runner.wind import SeriesWind


def smooth_turbine() -> Turbine:
    """nrel5mw with every coefficient replaced by its cubic fit over tip-speed ratios 4 to 12: one polynomial, no cells felt."""
    real = load_turbine("nrel5mw")
    ratio = real.tables.tip_speed_ratio
    inside = (ratio >= 4) & (ratio <= 12)
    pitch_zero = real.tables.at_pitch(0.0, list(real.tables.coefficients))
    coefficients = {}
    for name, values in zip(real.tables.coefficients, pitch_zero.T, strict=True):
        coefficients[name] = np.polyval(np.polyfit(ratio[inside], values[inside], 3), ratio)
    tables = {"tip_speed_ratio": ratio, "coefficients": coefficients}
    return load_turbine({"name": "smooth", "parameters": real.parameters, "tables": tables})


def smooth_wind(duration: float) -> SeriesWind:
    """All three signals cubic polynomials of time, so that the series' splines are one polynomial."""
    time = np.linspace(0.0, duration, 9)
    u = time / duration
    signals = [8 + 1.5 * u - 3 * u**2 + 2 * u**3, 0.1 + 0.2 * u**2 - 0.1 * u**3, 0.1 * u - 0.15 * u**3]
    return SeriesWind(float(time[1]), np.stack(signals, axis=1), origin="cubic")
