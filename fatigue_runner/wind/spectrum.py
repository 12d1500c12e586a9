"""The turbulence of IEC 61400-1: classes, normal and extreme models, length scales, spectra and coherences.

Longitudinal component only: the turbine model has no lateral and vertical wind. Sources: IEC 61400-1:2005
(ed. 3) 6.3 and annex B.2, repeated in IEC 61400-1:2019 (ed. 4) 6.3 and annex C.3.
"""

from __future__ import annotations

import math
from collections.abc import Callable
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


@dataclass(frozen=True)
class WindClass:
    """A row of the standard's table of classes: the reference wind speed V_ref [m/s] at hub height."""

    name: str
    reference_speed: float
    reference: str

    @property
    def average_speed(self) -> float:
        """V_ave [m/s], the annual mean at hub height: 0.2 V_ref (IEC 61400-1:2005, 6.3.1.1)."""
        return 0.2 * self.reference_speed


WIND_CLASSES = {
    c.name: c
    for c in (
        WindClass("I", 50.0, "IEC 61400-1:2005 and 2019, table 1"),
        WindClass("II", 42.5, "IEC 61400-1:2005 and 2019, table 1"),
        WindClass("III", 37.5, "IEC 61400-1:2005 and 2019, table 1"),
    )
}


def wind_class(name: Any) -> WindClass:
    """The class of that name; raises InputError, with the nearest known name, for another one."""
    if not isinstance(name, str) or name not in WIND_CLASSES:
        near = did_you_mean(str(name).upper(), WIND_CLASSES)
        raise InputError(f"unknown wind class {name!r}{near}")
    return WIND_CLASSES[name]


def normal_turbulence_sigma(name: Any, mean_speed: float) -> float:
    """sigma_1 [m/s] of the normal turbulence model: I_ref (0.75 V + 5.6 m/s), the 90 % quantile at V."""
    return turbulence_class(name).reference_intensity * (0.75 * mean_speed + 5.6)


def extreme_turbulence_sigma(turbulence: Any, wind: Any, mean_speed: float) -> float:
    """sigma_1 [m/s] of the extreme turbulence model for a turbulence class and a wind class.

    c I_ref (0.072 (V_ave/c + 3) (V/c - 4) + 10), c = 2 m/s. Source: IEC 61400-1:2005, 6.3.2.3, equation 19.
    """
    c, average = 2.0, wind_class(wind).average_speed
    growth = 0.072 * (average / c + 3) * (mean_speed / c - 4) + 10
    return c * turbulence_class(turbulence).reference_intensity * growth


TURBULENCE_MODELS = {"ntm": "normal turbulence model", "etm": "extreme turbulence model"}


def turbulence_scale(hub_height: float) -> float:
    """Lambda_1 [m]: 0.7 z below 60 m and 42 m above (IEC 61400-1:2005, equation 5)."""
    return min(0.7 * hub_height, 42.0)


def length_scale(hub_height: float) -> float:
    """L_1 = L_c = 8.1 Lambda_1 [m], of the Kaimal spectrum and its coherence."""
    return 8.1 * turbulence_scale(hub_height)


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


def exponential_coherence(separation: np.ndarray) -> np.ndarray:
    """Coherence |S_12| / S_11 of points whose distance times `coherence_decay` is `separation`."""
    return np.exp(-separation)


def von_karman_variance(low: np.ndarray, high: np.ndarray, mean_speed: float, scale: float) -> np.ndarray:
    """Share of sigma_1^2 that the von Karman spectrum has between two frequencies [Hz], at one point.

    S(f) = sigma_1^2 4 L/V / (1 + 71 (f L/V)^2)^(5/6), one-sided; its integral is an incomplete beta function.
    All of it is 0.9985 sigma_1^2, because 71 stands for 70.8.
    """
    from scipy.special import beta, betainc  # slower to import than all of wind

    def below(frequency: np.ndarray) -> np.ndarray:
        square = 71 * (frequency * scale / mean_speed) ** 2
        return 2 / math.sqrt(71) * beta(1 / 2, 1 / 3) * betainc(1 / 2, 1 / 3, square / (1 + square))

    return below(high) - below(low)


def von_karman_decay(frequency: np.ndarray, mean_speed: float, scale: float) -> np.ndarray:
    """d [1/m] such that points r apart have the coherence isotropic_coherence(d r): 2 pi hypot(f/V, 0.12/L)."""
    return 2 * np.pi * np.hypot(frequency / mean_speed, 0.12 / scale)


def isotropic_coherence(separation: np.ndarray) -> np.ndarray:
    """Coherence of the longitudinal wind in isotropic turbulence with von Karman's spectrum, across the wind.

    2^(1/6) / Gamma(5/6) (x^(5/6) K_5/6(x) - x^(11/6) K_1/6(x) / 2), one at x = 0. It is negative
    beyond x = 2.27, by up to 0.037. Source: IEC 61400-1:1999 (ed. 2), annex B; Burton et al., Wind Energy
    Handbook, 2.6. The tests derive it from the energy spectrum.
    """
    from scipy.special import gamma, kve  # slower to import than all of wind

    x = np.maximum(separation, 1e-9)  # one to 1e-14
    bracket = x ** (5 / 6) * kve(5 / 6, x) - 0.5 * x ** (11 / 6) * kve(1 / 6, x)
    return 2 ** (1 / 6) / gamma(5 / 6) * np.exp(-x) * bracket


@dataclass(frozen=True)
class TurbulenceSpectrum:
    """One model of the longitudinal wind: how its variance spreads over frequency and over the rotor.

    scales: the length scale L over Lambda_1; variance(low, high, V, L): share of sigma_1^2 between two
    frequencies; decay(f, V, L) [1/m] and coherence(decay * distance): the real coherence of two points.
    """

    name: str
    scales: float
    variance: Callable[[np.ndarray, np.ndarray, float, float], np.ndarray]
    decay: Callable[[np.ndarray, float, float], np.ndarray]
    coherence: Callable[[np.ndarray], np.ndarray]
    reference: str

    def length_scale(self, hub_height: float) -> float:
        """L [m] of the model at that height."""
        return self.scales * turbulence_scale(hub_height)


SPECTRA = {
    s.name: s
    for s in (
        TurbulenceSpectrum(
            name="kaimal",
            scales=8.1,
            variance=kaimal_variance,
            decay=coherence_decay,
            coherence=exponential_coherence,
            reference="IEC 61400-1:2005, annex B.2; 2019, annex C.3",
        ),
        TurbulenceSpectrum(
            name="von-karman",
            scales=3.5,
            variance=von_karman_variance,
            decay=von_karman_decay,
            coherence=isotropic_coherence,
            reference="IEC 61400-1:1999 (ed. 2), annex B, with Lambda_1 of the later editions",
        ),
    )
}


def turbulence_spectrum(name: Any) -> TurbulenceSpectrum:
    """The model of that name; raises InputError, with the nearest known name, for another one."""
    if not isinstance(name, str) or name not in SPECTRA:
        raise InputError(f"unknown turbulence spectrum {name!r}{did_you_mean(str(name), SPECTRA)}")
    return SPECTRA[name]
