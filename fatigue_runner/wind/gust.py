"""The extreme winds of IEC 61400-1 as a source: a gust, a change of direction or of shear in steady wind."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, Field, field_validator, model_validator

from fatigue_runner.channels import wind_channels
from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.inputs.section import known_name
from fatigue_runner.inputs.sweep import Sweep, as_list, check_not_empty, expand
from fatigue_runner.layout import ACROSS, WIND, Channel, harmonic_channels
from fatigue_runner.naming import joined, speed_id
from fatigue_runner.rotor import Rotor
from fatigue_runner.wind.azimuthal_spectrum import DEFAULT_HARMONICS
from fatigue_runner.wind.checks import number, refuse_standstill, wind_speed
from fatigue_runner.wind.gusts import EVENTS, Gust, gust_signals
from fatigue_runner.wind.gusts import Site as GustSite
from fatigue_runner.wind.mean_shear import (
    NO_TURBINE,
    checked_harmonics,
    mean_profile,
    mean_signals,
    one_profile,
)
from fatigue_runner.wind.profiles import PowerLaw, Profile
from fatigue_runner.wind.section import Harmonics, Realisation, Site, WindSection
from fatigue_runner.wind.source import WindSource
from fatigue_runner.wind.spectrum import TURBULENCE_CLASSES, WIND_CLASSES, wind_class

IEC_EXPONENT = 0.2
FARTHEST = 85.0  # degrees that a wind may turn by: at 90 nothing of it blows along the shaft
TOLD = 30.0  # degrees; compare `misaligned`
CELL = 0.1  # s; every gust of the standard lasts whole tenths


@dataclass(frozen=True)
class GustWind(WindSource):
    """Steady wind of `speed` [m/s] at the hub in which an extreme wind of IEC 61400-1 begins at `begin` [s].

    gust: a name of `gusts.EVENTS` (EOG, EDC+, EDC-, ECD+, ECD-, EWSV+, EWSV-, EWSH+, EWSH-); the classes say how large it is. The
    mean wind is a power law of `shear_exponent` (default 0.2) or logarithmic with a `roughness_length` [m], of which the blades
    feel `harmonics`. EOG and ECD raise the wind all over the disc, the shear of the EWS is linear over it. A wind that turns (EDC, ECD)
    blows along the nacelle's axis with its cosine and across with its sine; the nacelle does not follow.

    Raises InputError for what is not known or not positive, for a beginning off the tenths of a second, and where the wind turns
    away from the rotor.
    """

    kind = "gust"

    speed: float
    gust: str = "EOG"
    turbulence_class: str = "A"
    wind_class: str = "I"
    begin: float = 30.0
    shear_exponent: float | None = None
    roughness_length: float | None = None
    harmonics: int = DEFAULT_HARMONICS
    rotor: Rotor | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "speed", wind_speed("gust wind: speed", self.speed))
        if self.gust not in EVENTS:
            raise InputError(
                f"gust wind: unknown gust {self.gust!r}{did_you_mean(str(self.gust).upper(), EVENTS)}"
            )
        put(self, "begin", number("gust wind: begin", self.begin, at_least=0.0, unit=" s"))
        if abs(self.begin / CELL - round(self.begin / CELL)) > 1e-6:
            raise InputError(
                f"gust wind: begin must be whole tenths of a second, got {self.begin!r}; round it"
            )
        put(self, "harmonics", checked_harmonics("gust wind", self.harmonics))
        if self.harmonics == 0 and self._event.code == "EWS":
            raise InputError("gust wind: a shear has one harmonic or more, not 0; give 1 or more")
        _ = self.profile  # refuses an impossible one
        if self._turn > FARTHEST:
            raise InputError(
                f"gust wind: {self.gust} at {self.speed:g} m/s turns the wind by {self._turn:.0f} degrees, away from the rotor, and "
                f"the model holds up to {FARTHEST:g}; take more wind, or another gust"
            )

    @classmethod
    def example(cls) -> GustWind:
        return cls(12.0, "EWSV+", begin=2.0)

    def on(self, rotor: Rotor) -> Self:
        return self if self.rotor is not None else replace(self, rotor=rotor)

    @property
    def _event(self) -> Gust:
        return EVENTS[self.gust]

    @property
    def _site(self) -> GustSite:
        rotor, reference = self.rotor or NO_TURBINE, wind_class(self.wind_class).reference_speed
        return GustSite(self.speed, rotor.hub_height, 2 * rotor.radius, self.turbulence_class, reference)

    @property
    def _turn(self) -> float:
        """By how much the wind turns [deg]."""
        end = np.array([self._event.duration])
        return float(np.degrees(abs(self._event.direction(self._site, end)[0])))

    @property
    def profile(self) -> Profile:
        """Of the mean wind."""
        return mean_profile("gust wind", self.shear_exponent, self.roughness_length) or PowerLaw(IEC_EXPONENT)

    @property
    def channels(self) -> tuple[Channel, ...]:
        across = ACROSS if self._turn else ()
        return (*WIND, *across, *harmonic_channels(self.harmonics))

    @property
    def name(self) -> str:
        return f"gust-{self.speed:g}-{self.gust}"

    @property
    def mean_speed(self) -> float:
        """The steady wind [m/s] before the gust."""
        return self.speed

    @property
    def parameters(self) -> dict[str, Any]:
        steady = mean_signals(self.profile, self.speed, self.rotor or NO_TURBINE, self.harmonics)
        left = {"speed", "harmonics", "rotor", "shear_exponent", "roughness_length"}
        law = "roughness_length", self.roughness_length
        if self.roughness_length is None:
            law = "shear_exponent", IEC_EXPONENT if self.shear_exponent is None else self.shear_exponent
        given = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in left}
        return {"vertical_shear": float(steady[1]), "horizontal_shear": 0.0, law[0]: law[1], **given}

    @property
    def description(self) -> str:
        return f"{self._event.words} of IEC 61400-1 ({self.gust}) in steady wind, {self.profile.words}"

    @property
    def notes(self) -> tuple[str, ...]:
        if not self._turn:
            return ()
        far = f", and the model's wake is made for up to {TOLD:g}" if self._turn > TOLD else ""
        return (
            f"{self.gust} at {self.speed:g} m/s turns the wind by {self._turn:.0f} degrees; the nacelle does not follow{far}.",
        )

    @property
    def cell_key(self) -> float:
        return CELL

    @property
    def _settled(self) -> float:
        return self.begin + self._event.duration + CELL

    def _samples(self, time: np.ndarray) -> np.ndarray:
        """Signals at `time` (n,) [s] after the beginning."""
        steady = mean_signals(self.profile, self.speed, self.rotor or NO_TURBINE, self.harmonics)
        added = gust_signals(self._event, self._site, time)
        along = np.cos(added.direction)
        speed = steady[0] + added.speed
        places, out = {c: i for i, c in enumerate(self.channels)}, np.zeros((len(time), self.signals))
        felt = [places[c] for c in wind_channels(len(steady))]
        out[:, felt] = np.multiply.outer(along, steady)
        out[:, 0] = along * speed
        if self._turn:
            out[:, places[ACROSS[0]]] = -np.sin(added.direction) * speed
        # shears are changes [m/s] over R; what they are divided by is the wind of the moment
        out[:, 1] = along * (steady[0] * steady[1] + added.vertical) / out[:, 0]
        out[:, 2] = along * added.horizontal / out[:, 0]
        return out

    @cached_property
    def _transient(self) -> np.ndarray:
        """Cells from the beginning to the end of the gust; both ends have no slope, as the standard's formulas."""
        from scipy.interpolate import CubicSpline  # slower to import than all of wind

        time = CELL * np.arange(round(self._event.duration / CELL) + 1)
        samples = self._samples(time)
        speed = np.zeros((len(samples), 4, 1))
        speed[:, 0, 0] = samples[:, 0]
        refuse_standstill(self.name, CELL, speed, "take more wind")
        return np.ascontiguousarray(CubicSpline(time, samples, bc_type="clamped").c[::-1].transpose(1, 0, 2))

    def _cells(self, n_cells: int) -> np.ndarray:
        out = np.zeros((n_cells, 4, self.signals))
        first, transient = round(self.begin / CELL), self._transient
        before, after = self._samples(np.array([0.0, self._event.duration]))
        out[:first, 0], out[first:, 0] = before, after
        held = out[first : first + len(transient)]
        held[:] = transient[: len(held)]
        return out


def _gusts(value: Any) -> Any:
    """Names as the table spells them."""
    names = as_list(value)
    return [name.upper() if isinstance(name, str) else name for name in names]


class GustSection(WindSection):
    """Every combination of speed and gust, in this order.

    speeds             hub-height speeds before the gust [m/s]: a sweep
    gusts              one or a list of EOG, EDC+, EDC-, ECD+, ECD-, EWSV+, EWSV-, EWSH+, EWSH- (vertical, horizontal shear)
    turbulence_class   `A+`, `A`, `B` or `C`
    wind_class         `I` (default), `II` or `III`
    begin              time at which it begins [s], whole tenths (default 30)
    shear_exponent     power-law exponent alpha of the steady wind (default 0.2), or
    roughness_length   z_0 [m] of a logarithmic one
    harmonics          azimuthal harmonics that the blades feel (default 6)
    """

    kind = "gust"

    speeds: Sweep
    gusts: Annotated[list[str], BeforeValidator(check_not_empty), BeforeValidator(_gusts)]
    turbulence_class: str
    wind_class: str = "I"
    begin: float = Field(default=30.0, ge=0)
    shear_exponent: float | None = Field(default=None, ge=-1, le=1)
    roughness_length: float | None = Field(default=None, gt=0)
    harmonics: Harmonics = DEFAULT_HARMONICS

    @field_validator("gusts")
    @classmethod
    def _gusts_exist(cls, names: list[str]) -> list[str]:
        return list(dict.fromkeys(known_name(name, EVENTS) for name in names))

    @field_validator("turbulence_class")
    @classmethod
    def _class_exists(cls, name: str) -> str:
        return known_name(name, TURBULENCE_CLASSES, name.upper())

    @field_validator("wind_class")
    @classmethod
    def _wind_class_exists(cls, name: str) -> str:
        return known_name(name, WIND_CLASSES, name.upper())

    @model_validator(mode="after")
    def _one_profile(self) -> GustSection:
        one_profile(self)
        return self

    def realisations(self, site: Site) -> Iterator[Realisation]:
        keys = "turbulence_class", "wind_class", "begin", "shear_exponent", "roughness_length"
        given = tuple((key, getattr(self, key)) for key in keys if getattr(self, key) is not None)
        for speed, piece in expand(self.speeds):
            for name in self.gusts:
                end = self.begin + EVENTS[name].duration
                if end > site.duration:
                    raise InputError(
                        f"{site.place.where('begin')}: {name} lasts from {self.begin:g} to {end:g} s, but the campaign runs "
                        f"{site.duration:g} s; give an earlier `begin` or a longer `duration`"
                    )
                word = name.lower().replace("-", "-minus").replace("+", "-plus")
                yield Realisation(
                    joined(speed_id(speed), word), self.kind,
                    (("speed", speed), ("gust", name), *given, ("harmonics", self.harmonics)), ("speeds", piece), speed,
                )  # fmt: skip
