"""The turbulence of IEC 61400-1: classes, length scale, Kaimal spectrum and exponential coherence.

Longitudinal component only: the turbine model has no lateral and vertical wind. Sources: IEC 61400-1:2005
(ed. 3) 6.3 and annex B.2, repeated in IEC 61400-1:2019 (ed. 4) 6.3 and annex C.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fatigue_runner.errors import InputError, did_you_mean


@dataclass(frozen=True)
class TurbulenceClass:
    """A row of the standard's table of classes: the reference turbulence intensity at 15 m/s [-]."""

    name: str
    reference_intensity: float
    reference: str


TURBULENCE_CLASSES = {
    c.name: c
    for c in (
        TurbulenceClass("A+", 0.18, "IEC 61400-1:2019, table 1"),
        TurbulenceClass("A", 0.16, "IEC 61400-1:2005 and 2019, table 1"),
        TurbulenceClass("B", 0.14, "IEC 61400-1:2005 and 2019, table 1"),
        TurbulenceClass("C", 0.12, "IEC 61400-1:2005 and 2019, table 1"),
    )
}


def turbulence_class(name: Any) -> TurbulenceClass:
    """The class of that name; raises InputError, with the nearest known name, for another one."""
    if not isinstance(name, str) or name not in TURBULENCE_CLASSES:
        near = did_you_mean(str(name).upper(), TURBULENCE_CLASSES)
        raise InputError(f"unknown turbulence class {name!r}{near}")
    return TURBULENCE_CLASSES[name]


def normal_turbulence_sigma(name: Any, mean_speed: float) -> float:
    """sigma_1 [m/s] of the normal turbulence model: I_ref (0.75 V + 5.6 m/s), the 90 % quantile at V."""
    return turbulence_class(name).reference_intensity * (0.75 * mean_speed + 5.6)


def length_scale(hub_height: float) -> float:
    """L_1 = L_c = 8.1 Lambda_1 [m], with Lambda_1 = 0.7 z below 60 m and 42 m above."""
    return 8.1 * min(0.7 * hub_height, 42.0)


def kaimal_variance(low: np.ndarray, high: np.ndarray, mean_speed: float, scale: float) -> np.ndarray:
    """Share of sigma_1^2 that the Kaimal spectrum has between two frequencies [Hz], at one point.

    S(f) = sigma_1^2 4 L/V / (1 + 6 f L/V)^(5/3), one-sided, has the integral 1 - (1 + 6 f L/V)^(-2/3).
    """
    time_scale = scale / mean_speed
    return (1 + 6 * low * time_scale) ** (-2 / 3) - (1 + 6 * high * time_scale) ** (-2 / 3)


def coherence_decay(frequency: np.ndarray, mean_speed: float, scale: float) -> np.ndarray:
    """d [1/m] such that two points r apart have coherence exp(-d r): 12 sqrt((f/V)^2 + (0.12/L_c)^2).

    Coherence here is |S_12| / S_11, not its square; the cross-spectrum is real. It stays below one as f -> 0.
    """
    return 12 * np.hypot(frequency / mean_speed, 0.12 / scale)
