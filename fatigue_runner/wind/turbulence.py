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
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, PlainValidator, field_validator, model_validator

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.inputs.section import problem
from fatigue_runner.inputs.sweep import Sweep, expand
from fatigue_runner.layout import WIND
from fatigue_runner.naming import joined, speed_id, value_id
from fatigue_runner.rotor import Rotor
from fatigue_runner.wind import rotor_modes, spectrum
from fatigue_runner.wind.azimuthal_spectrum import DEFAULT_HARMONICS
from fatigue_runner.wind.checks import number, refuse_standstill
from fatigue_runner.wind.harmonic_series import RotorTurbulence
from fatigue_runner.wind.mean_shear import NO_TURBINE, checked_harmonics, mean_signals
from fatigue_runner.wind.profiles import PowerLaw
from fatigue_runner.wind.radial_weight import RadialWeight
from fatigue_runner.wind.section import Realisation, Site, WindSection
from fatigue_runner.wind.series import periodic_cubics
from fatigue_runner.wind.source import WindSource
from fatigue_runner.wind.streams import speed_stream, uniform
from fatigue_runner.wind.words import told_strength

# Order n of the azimuthal mode behind each signal, in the order of `channels.WIND_SIGNALS`. A signal's place
# is its random stream, so signals added at the end leave the others' series as they are.
MODES = (0, 1, 1)
AMPLITUDES = ("gaussian", "random-phase")


@dataclass(frozen=True)
class TurbulentWind(WindSource):
    """IEC 61400-1 turbulence over the rotor: Kaimal spectrum, exponential coherence, one series per seed.

    `mean` is the hub-height mean V [m/s]; give either `intensity` = sigma_1/V [-] or `turbulence_class`
    ("A+", "A", "B", "C": normal turbulence model). The series is periodic, `duration` [s] long, with a sample
    every `time_step` [s]; halving it adds higher harmonics to the same series. `shear_exponent` is alpha;
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
    shear_exponent: float = 0.2
    time_step: float = 0.2
    rotor_radius: float | None = None
    hub_height: float | None = None
    amplitudes: str = "gaussian"
    scaled: bool = False
    harmonics: int = DEFAULT_HARMONICS
    spectrum_name: str = "kaimal"
    disc: Rotor | None = None

    def __post_init__(self) -> None:
        for key, bounds in BOUNDS.items():
            if key not in OPTIONAL or getattr(self, key) is not None:
                object.__setattr__(self, key, number(f"turbulent wind: {key}", getattr(self, key), **bounds))
        if (self.intensity is None) == (self.turbulence_class is None):
            how = "neither" if self.intensity is None else "both"
            raise InputError(
                f"turbulent wind has {how} of intensity and turbulence_class; give exactly one of them"
            )
        if self.turbulence_class is not None:
            spectrum.turbulence_class(self.turbulence_class)
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
    def name(self) -> str:
        strength = f"ntm{self.turbulence_class}" if self.intensity is None else f"i{self.intensity:g}"
        return f"turbulent-{self.mean:g}-{strength}-seed{self.seed}"

    @property
    def mean_speed(self) -> float:
        return self.mean

    @property
    def mean_shear(self) -> float:
        """Linear vertical shear of the mean wind: alpha R/H, the power law's slope at the hub, or its blade-effective part."""
        return float(self._mean[1])

    @cached_property
    def _mean(self) -> np.ndarray:
        return mean_signals(PowerLaw(self.shear_exponent), self.mean, self.rotor, self.harmonics)

    @property
    def sigma(self) -> float:
        """sigma_1 [m/s], the standard deviation of the longitudinal wind at a point."""
        if self.intensity is None:
            return spectrum.normal_turbulence_sigma(self.turbulence_class, self.mean)
        return self.intensity * self.mean

    @property
    def parameters(self) -> dict[str, Any]:
        derived = {"vertical_shear": self.mean_shear, "horizontal_shear": 0.0}
        derived["turbulence_intensity"] = self.sigma / self.mean
        given = {
            f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("mean", "intensity", "disc")
        }
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
        variances = self._modal_variances
        half = np.zeros((self.samples // 2 + 1, len(MODES)), complex)
        for place, variance in enumerate(variances):
            stream = (place, *self._stream)  # so that one seed is independent from speed to speed
            power = variance
            if self.amplitudes == "gaussian":
                power = variance * -np.log1p(-uniform(self.seed, (*stream, 1), len(variance)))
            phase = 2 * np.pi * uniform(self.seed, (*stream, 0), len(variance))
            half[1:-1, place] = np.sqrt(power / 2) * np.exp(1j * phase)  # half of A = sqrt(2 * variance)
        return np.fft.irfft(half, self.samples, axis=0, norm="forward") * self.sigma

    @property
    def _stream(self) -> tuple[int, ...]:
        """Whole thousandths as they always were; any other speed by all its digits, so that no two share a stream."""
        thousandths = round(1000 * self.mean)
        return (thousandths,) if thousandths / 1000 == self.mean else speed_stream(self.mean)

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
        model = (
            ""
            if self.intensity is not None
            else f" of class {self.turbulence_class} (normal turbulence model)"
        )
        return f"IEC 61400-1 turbulence{model}, {spectra[self.spectrum_name]} coherence; mean wind: power law"

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


OPTIONAL = {"intensity", "rotor_radius", "hub_height"}
BOUNDS: dict[str, dict[str, Any]] = {
    "mean": {"above": 0.0, "at_most": 100.0, "unit": " m/s"},
    "intensity": {"at_least": 0.0, "at_most": 1.0, "hint": "it is sigma_1 / mean: 0.14 for 14 %"},
    "duration": {"above": 0.0, "at_most": 86400.0, "unit": " s"},
    "time_step": {"at_least": 0.01, "at_most": 1.0, "unit": " s"},
    "shear_exponent": {"at_least": -1.0, "at_most": 1.0, "hint": "IEC 61400-1 has 0.2"},
    "rotor_radius": {"above": 0.0, "unit": " m"},
    "hub_height": {"above": 0.0, "unit": " m"},
}


@lru_cache(maxsize=64)
def modal_variances(
    mean: float, rotor_radius: float, hub_height: float, samples: int, time_step: float, scaled: bool
) -> np.ndarray:
    """Diagonal of the spectral matrix per harmonic, (3, samples/2 - 1), as shares of sigma_1^2; read-only.

    Harmonic k = 1, 2, ... has frequency k / (samples * time_step) and holds the bin half a step to either
    side; the mean and the Nyquist frequency hold nothing. Cached: all seeds and intensities of one mean wind
    speed share it.
    """
    scale, bin_width = spectrum.length_scale(hub_height), 1 / (samples * time_step)
    harmonic = np.arange(1, samples // 2)
    low, high = (harmonic - 0.5) * bin_width, (harmonic + 0.5) * bin_width
    point = spectrum.kaimal_variance(low, high, mean, scale)
    if scaled:
        point = point / point.sum()
    decay = spectrum.coherence_decay(harmonic * bin_width, mean, scale) * rotor_radius
    admittances = {n: rotor_modes.admittance(n, decay) for n in set(MODES)}
    variances = point * np.stack([admittances[n] for n in MODES])
    variances.flags.writeable = False
    return variances


def _seeds(value: Any) -> int | list[int]:
    if isinstance(value, list):
        if not value or not all(type(seed) is int and seed >= 0 for seed in value):
            raise problem(f"must be a count or a list of whole numbers, 0 or more; got {value!r:.60}")
        return list(dict.fromkeys(value))
    if type(value) is not int or not 1 <= value <= 999:
        raise problem(f"must be a count from 1 to 999 or a list of seeds; got {value!r:.60}")
    return value


class TurbulentSection(WindSection):
    """Every combination of speed and seed, in this order.

    speeds             mean hub-height speeds [m/s]: a sweep
    intensity          sigma_1 / mean speed at hub height [-], e.g. 0.14
    turbulence_class   `A+`, `A`, `B` or `C`, the IEC normal turbulence model, instead of `intensity`
    shear_exponent     power-law exponent alpha of the mean wind (default 0.2)
    seeds              how many seeds per speed (default 1), 1, 2, ... at each, or a list; one seed is another turbulence at every speed
    harmonics          azimuthal harmonics that the blades feel: 6 (default) hold 98 % of every load range, 1 is mean and linear shears
    spectrum           `kaimal` (default) or `von-karman`
    """

    kind = "turbulent"

    speeds: Sweep
    intensity: float | None = Field(default=None, gt=0, le=1)
    turbulence_class: str | None = None
    shear_exponent: float | None = Field(default=None, ge=-1, le=1)
    seeds: Annotated[int | list[int], PlainValidator(_seeds)] = 1
    harmonics: int = Field(default=DEFAULT_HARMONICS, ge=0, le=16)
    spectrum: str = "kaimal"

    @field_validator("spectrum")
    @classmethod
    def _spectrum_exists(cls, name: str) -> str:
        if name not in spectrum.SPECTRA:
            raise problem(f"{name!r} is not known{did_you_mean(name, spectrum.SPECTRA)}")
        return name

    @field_validator("turbulence_class")
    @classmethod
    def _class_exists(cls, name: str | None) -> str | None:
        if name is not None and name not in spectrum.TURBULENCE_CLASSES:
            raise problem(f"{name!r} is not known{did_you_mean(name.upper(), spectrum.TURBULENCE_CLASSES)}")
        return name

    @model_validator(mode="after")
    def _one_strength(self) -> TurbulentSection:
        if (self.intensity is None) == (self.turbulence_class is None):
            classes = ", ".join(spectrum.TURBULENCE_CLASSES)
            raise problem(
                f"of type 'turbulent' needs either `intensity` (e.g. 0.14) or `turbulence_class` ({classes})"
            )
        return self

    def seeds_at(self, speed: float) -> list[int]:
        """The seeds of the winds of a mean speed [m/s]: 1, 2, ..., or the list as it stands.

        One seed is another turbulence at every speed (`streams.speed_stream`), so that more speeds or more seeds leave the others as
        they are.
        """
        return self.seeds if isinstance(self.seeds, list) else list(range(1, self.seeds + 1))

    def realisations(self, site: Site) -> Iterator[Realisation]:
        strength: tuple[str, Any] = ("turbulence_class", self.turbulence_class)
        label = f"ntm{self.turbulence_class}"
        if self.intensity is not None:
            strength, label = ("intensity", self.intensity), f"ti{value_id(self.intensity)}"
        shear = () if self.shear_exponent is None else (("shear_exponent", self.shear_exponent),)
        more = (("harmonics", self.harmonics), ("spectrum_name", self.spectrum))
        for speed, piece in expand(self.speeds):
            for seed in self.seeds_at(speed):
                yield Realisation(
                    joined(speed_id(speed), label, f"s{seed}"),
                    self.kind,
                    (("mean", speed), strength, ("seed", seed), ("duration", site.duration), *shear, *more),
                    ("speeds", piece),
                    speed,
                )
