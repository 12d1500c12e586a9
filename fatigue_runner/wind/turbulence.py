"""Turbulent wind as the rotor's parameters in time: IEC Kaimal turbulence projected on the disc.

The longitudinal wind over the disc is V (1 + k z/R) + u'(y, z, t) with the mean shear k = alpha R/H. Its
least-squares fit by v + G_v z/R + G_h y/R has v = V + a_0, G_v = V k + a_z, G_h = a_y (`rotor_modes`). The
signals are (v, G_v/v, G_h/v), so v (1 + kappa_v z/R + kappa_h y/R) is that fit, without linearising in u'/V.
v is a disc average: it varies less than the wind at the hub, whose intensity is the input (600 s at 10 m/s
on the 5 MW: 0.62 sigma_1). Eddies of the second azimuthal harmonic and up are left out.

Each amplitude is one inverse FFT; its harmonics hold the Kaimal spectrum's exact integral over their
frequency bin, times H_n. There is nothing below half the first harmonic and above the Nyquist frequency: at a
point, 600 s at 10 m/s hold 88 % of sigma_1^2 (steps of 0.2 s lose less than 1e-4 of the disc's variances).
`scaled` brings the variance at a point up to sigma_1^2 (as TurbSim's ScaleIEC, off by default there too).
`amplitudes` says what is random:

- "gaussian" (default): Rayleigh amplitudes and uniform phases, a stationary Gaussian process. The variance of
  one series scatters from seed to seed, so a mean wind speed needs several seeds: that of v over 600 s at
  10 m/s by 37 %, in a full field (Veers, SAND88-0152, as TurbSim) by 29 %; the shears' by 23 % in both.
- "random-phase": expected amplitudes, random phases. Every seed has exactly the expected spectrum and
  variance, so few seeds give steady loads. In a full field only the first point is like that, the disc
  average is not: loads scatter too little between seeds to measure an integrator's error against.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.layout import WIND
from fatigue_runner.rotor import Rotor
from fatigue_runner.wind import spectrum
from fatigue_runner.wind.azimuthal_spectrum import DEFAULT_HARMONICS
from fatigue_runner.wind.checks import number, refuse_standstill
from fatigue_runner.wind.disc_turbulence import modal_series, modal_variances
from fatigue_runner.wind.harmonic_series import RotorTurbulence
from fatigue_runner.wind.mean_shear import NO_TURBINE, checked_harmonics, mean_profile, mean_signals
from fatigue_runner.wind.profiles import PowerLaw, Profile
from fatigue_runner.wind.radial_weight import RadialWeight
from fatigue_runner.wind.series import periodic_cubics
from fatigue_runner.wind.source import WindSource
from fatigue_runner.wind.strength import Strength
from fatigue_runner.wind.words import told_strength

IEC_EXPONENT = 0.2
AMPLITUDES = ("gaussian", "random-phase")


@dataclass(frozen=True)
class TurbulentWind(WindSource):
    """IEC 61400-1 turbulence over the rotor: Kaimal spectrum, exponential coherence, one series per seed.

    `mean` is the hub-height mean V [m/s]; give either `intensity` = sigma_1/V [-] or `turbulence_class`
    ("A+", "A", "B", "C"): of the normal turbulence model, or with turbulence "etm" and a `wind_class` (I, II,
    III) of the extreme one. The series is periodic, `duration` [s] long, with a sample
    every `time_step` [s]; halving it adds higher harmonics to the same series. `shear_exponent` is alpha,
    unless the mean wind is logarithmic with a `roughness_length` z_0 [m];
    `rotor_radius` and `hub_height` [m] are those of the turbine that it blows on, unless they are given (`on`;
    before there is a turbine: the NREL 5 MW's). Equal parameters give equal series on every
    machine, up to the FFT's rounding; one seed gives independent series at different mean wind speeds.

    Raises InputError for parameters out of range. The series is made when first asked for; `cells`, `at` and
    `lowest_speed` raise InputError where its wind speed would fall to zero.
    """

    kind = "turbulent"

    mean: float
    intensity: float | None = None
    turbulence_class: str | None = None
    seed: int = 0
    duration: float = 600.0
    shear_exponent: float = IEC_EXPONENT
    time_step: float = 0.2
    rotor_radius: float | None = None
    hub_height: float | None = None
    amplitudes: str = "gaussian"
    scaled: bool = False
    harmonics: int = DEFAULT_HARMONICS
    spectrum_name: str = "kaimal"
    disc: Rotor | None = None
    turbulence: str = "ntm"
    wind_class: str | None = None
    roughness_length: float | None = None

    def __post_init__(self) -> None:
        for key, bounds in BOUNDS.items():
            if key not in OPTIONAL or getattr(self, key) is not None:
                object.__setattr__(self, key, number(f"turbulent wind: {key}", getattr(self, key), **bounds))
        _ = self._strength, self.profile  # both refuse what contradicts itself
        if isinstance(self.seed, bool) or not hasattr(self.seed, "__index__") or self.seed < 0:
            raise InputError(f"turbulent wind: seed must be a whole number, 0 or more, got {self.seed!r}")
        object.__setattr__(self, "seed", self.seed.__index__())
        if self.amplitudes not in AMPLITUDES:
            near = did_you_mean(str(self.amplitudes), AMPLITUDES)
            raise InputError(f"turbulent wind: unknown amplitudes {self.amplitudes!r}{near}")
        if not isinstance(self.scaled, bool):
            raise InputError(f"turbulent wind: scaled must be true or false, got {self.scaled!r}")
        checked_harmonics("turbulent wind", self.harmonics)
        if self.spectrum_name not in spectrum.SPECTRA:
            near = did_you_mean(str(self.spectrum_name), spectrum.SPECTRA)
            raise InputError(f"turbulent wind: unknown spectrum {self.spectrum_name!r}{near}")
        if self.spectrum_name != "kaimal" and self.harmonics < 2:
            raise InputError(
                "turbulent wind: with 0 or 1 harmonics the spectrum is kaimal; take more harmonics"
            )
        if self.duration < 4 * self.time_step:
            short = f"duration {self.duration:g} s is less than four time steps of {self.time_step:g} s"
            raise InputError(f"turbulent wind: {short}; make it longer or the time step shorter")

    @classmethod
    def example(cls) -> TurbulentWind:
        return cls(9.0, intensity=0.12, seed=3, duration=30.0)

    def __getstate__(self) -> dict[str, Any]:
        # Without the series: a worker makes it again in less time than it takes to send.
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def on(self, rotor: Rotor) -> Self:
        if self.disc is not None:
            return self
        own = self._rotor_or(rotor)
        return replace(self, rotor_radius=own.radius, hub_height=own.hub_height, disc=own)

    def _rotor_or(self, other: Rotor) -> Rotor:
        """The sizes that were given, those of `other` where none were."""
        return replace(
            other,
            radius=other.radius if self.rotor_radius is None else self.rotor_radius,
            hub_height=other.hub_height if self.hub_height is None else self.hub_height,
        )

    @property
    def rotor(self) -> Rotor:
        """The disc that the series is made for."""
        return self.disc or self._rotor_or(NO_TURBINE)

    @property
    def _strength(self) -> Strength:
        return Strength(self.intensity, self.turbulence_class, self.turbulence, self.wind_class)

    @property
    def profile(self) -> Profile:
        """Of the mean wind."""
        if self.roughness_length is None:
            return PowerLaw(self.shear_exponent)
        exponent = None if self.shear_exponent == IEC_EXPONENT else self.shear_exponent
        profile = mean_profile("turbulent wind", exponent, self.roughness_length)
        assert profile is not None
        return profile

    @property
    def name(self) -> str:
        strength = self._strength.id if self.intensity is None else f"i{self.intensity:g}"
        return f"turbulent-{self.mean:g}-{strength}-seed{self.seed}"

    @property
    def mean_speed(self) -> float:
        return self.mean

    @property
    def mean_shear(self) -> float:
        """Linear vertical shear of the mean wind: the profile's slope at the hub (alpha R/H), or its blade-effective part."""
        return float(self._mean[1])

    @cached_property
    def _mean(self) -> np.ndarray:
        return mean_signals(self.profile, self.mean, self.rotor, self.harmonics)

    @property
    def sigma(self) -> float:
        """sigma_1 [m/s], the standard deviation of the longitudinal wind at a point."""
        return self._strength.sigma(self.mean)

    @property
    def parameters(self) -> dict[str, Any]:
        derived = {"vertical_shear": self.mean_shear, "horizontal_shear": 0.0}
        derived["turbulence_intensity"] = self.sigma / self.mean
        left = {
            "mean",
            "intensity",
            "disc",
            "roughness_length" if self.roughness_length is None else "shear_exponent",
        }
        given = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in left}
        return {**derived, **given, "rotor_radius": self.rotor.radius, "hub_height": self.rotor.hub_height}

    @property
    def cell_key(self) -> float:
        return self.time_step

    @property
    def samples(self) -> int:
        """Number of samples of one period: even, and enough for `duration`."""
        return 2 * math.ceil(self.duration / self.time_step / 2 - 1e-9)

    @property
    def length(self) -> float:
        return self.samples * self.time_step

    @cached_property
    def modal_series(self) -> np.ndarray:
        """Amplitudes a_0, a_z, a_y of the fluctuation at the samples, (n, 3) [m/s]; of zero mean."""
        random_phase = self.amplitudes == "random-phase"
        return modal_series(self._modal_variances, self.mean, self.seed, random_phase) * self.sigma

    @property
    def _turbulence(self) -> RotorTurbulence:
        rotor = self.rotor
        return RotorTurbulence(
            self.mean, rotor.radius, rotor.hub_height, RadialWeight(*rotor.weight), self.harmonics, self.samples,
            self.time_step, self.spectrum_name, self.scaled,
        )  # fmt: skip

    @cached_property
    def harmonic_series(self) -> np.ndarray:
        """Amplitudes c_0, c_1, s_1, ... of the fluctuation at the samples, (n, 1 + 2 M) [m/s]; of zero mean."""
        return self.sigma * self._turbulence.series(self.seed, self.amplitudes == "random-phase")

    @property
    def description(self) -> str:
        spectra = {
            "kaimal": "Kaimal spectrum and exponential",
            "von-karman": "von Karman spectrum and isotropic",
        }
        model = f"turbulence{self._strength.words}, {spectra[self.spectrum_name]} coherence"
        return f"IEC 61400-1 {model}; mean wind: {self.profile.words}"

    @property
    def strength(self) -> str:
        """Expected over all seeds; a series' own scatters, and holds nothing slower than twice its length."""
        variances = self._expected
        blade = self.sigma * math.sqrt(variances.sum()) if self.harmonics > 1 else None
        rotor = self.sigma * math.sqrt(variances[0].sum())
        return told_strength(self.mean, self.sigma, rotor, blade, self.harmonics)

    @property
    def _expected(self) -> np.ndarray:
        """Variance over sigma_1^2 of the rotor's mean, of c_1 and of s_1, ... (1 + M or more, frequencies)."""
        if self.harmonics > 1:
            return self._turbulence.variances()
        return self._modal_variances

    @property
    def _modal_variances(self) -> np.ndarray:
        rotor = self.rotor
        return modal_variances(
            self.mean, rotor.radius, rotor.hub_height, self.samples, self.time_step, self.scaled
        )

    def _harmonic_signals(self) -> np.ndarray:
        """(n, 3 + 2 M): gusts move the disc mean v and the harmonics; the mean shear stays what it is in m/s."""
        found, count = self.harmonic_series, len(WIND)
        out = np.tile(self._mean, (len(found), 1))
        speed = self._mean[0] + found[:, 0]
        out[:, 1] *= self._mean[0] / speed
        out[:, 0] = speed
        out[:, count:] += found[:, 1:]
        return out

    @cached_property
    def _coefficients(self) -> np.ndarray:
        if self.harmonics > 1:
            signals = self._harmonic_signals()
            self._refuse_standstill(signals[:, :1])
            return periodic_cubics(signals, self.time_step)
        fit = self.modal_series + np.array([self.mean, self.mean * self.mean_shear, 0.0])
        speed = fit[:, :1]
        self._refuse_standstill(speed)
        if self.harmonics == 0:
            fit = fit * np.array([1.0, 0.0, 0.0])
        return periodic_cubics(np.concatenate([speed, fit[:, 1:] / speed], axis=1), self.time_step)

    def _refuse_standstill(self, speed: np.ndarray) -> None:
        way_out = "take another seed, less turbulence or more wind"
        refuse_standstill(self.name, self.time_step, periodic_cubics(speed, self.time_step), way_out)

    def _cells(self, n_cells: int) -> np.ndarray:
        return self._coefficients[:n_cells]


OPTIONAL = {"intensity", "roughness_length", "rotor_radius", "hub_height"}
BOUNDS: dict[str, dict[str, Any]] = {
    "mean": {"above": 0.0, "at_most": 100.0, "unit": " m/s"},
    "intensity": {"at_least": 0.0, "at_most": 1.0, "hint": "it is sigma_1 / mean: 0.14 for 14 %"},
    "duration": {"above": 0.0, "at_most": 86400.0, "unit": " s"},
    "time_step": {"at_least": 0.01, "at_most": 1.0, "unit": " s"},
    "shear_exponent": {"at_least": -1.0, "at_most": 1.0, "hint": "IEC 61400-1 has 0.2"},
    "roughness_length": {"above": 0.0, "unit": " m"},
    "rotor_radius": {"above": 0.0, "unit": " m"},
    "hub_height": {"above": 0.0, "unit": " m"},
}
