"""The deterministic extreme winds of IEC 61400-1 as functions of time.

IEC 61400-1:2005 (ed. 3), 6.3.2, repeated in IEC 61400-1:2019 (ed. 4), 6.3.3: extreme operating gust (EOG, 6.3.2.2
of ed. 3), extreme direction change (EDC, 6.3.2.4), extreme coherent gust with direction change (ECD, 6.3.2.5),
extreme wind shear (EWS, 6.3.2.6). Each adds to the normal wind profile; `gust_signals` gives the hub-height wind,
the linear shears and the direction, which is what the rotor's model knows of them. The transient shear of the
EWS is linear over the disc, so nothing of it is left out.

How smooth they are, which decides what a method of high order makes of them: between its beginning and its end
each is analytic. There, EOG joins its surroundings with two continuous derivatives (it begins as t^3), the three
others with one (1 - cos begins as t^2): their second derivative jumps, by (pi/T)^2 / 2 times the amplitude for EDC
and ECD and (2 pi/T)^2 / 2 times it for EWS. Steps that end on beginning and end keep a method's order; a
cubic spline through samples rounds the jump off over about two of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.wind.checks import number
from fatigue_runner.wind.spectrum import length_scale, normal_turbulence_sigma


@dataclass(frozen=True)
class Site:
    """What the standard's formulas take from turbine and class; lengths in m, speeds in m/s.

    `reference_speed` is V_ref of the wind turbine class (I 50, II 42.5, III 37.5), `turbulence_class` A+, A, B, C.
    Raises InputError for what is not positive, for an unknown class and a mean speed from V_ref on.
    """

    mean_speed: float
    hub_height: float
    rotor_diameter: float
    turbulence_class: str
    reference_speed: float

    def __post_init__(self) -> None:
        for name, unit in (
            ("mean_speed", "m/s"),
            ("hub_height", "m"),
            ("rotor_diameter", "m"),
            ("reference_speed", "m/s"),
        ):
            number(f"gust: {name}", getattr(self, name), above=0.0, unit=f" {unit}")
        if not self.mean_speed < self.reference_speed:
            raise InputError(
                f"gust: the mean speed {self.mean_speed:g} m/s must be below the reference speed "
                f"{self.reference_speed:g} m/s of the wind turbine class (I 50, II 42.5, III 37.5)"
            )
        _ = self.sigma

    @property
    def sigma(self) -> float:
        """sigma_1 [m/s] of the normal turbulence model."""
        return normal_turbulence_sigma(self.turbulence_class, self.mean_speed)

    @property
    def turbulence_scale(self) -> float:
        """Lambda_1 [m]."""
        return length_scale(self.hub_height) / 8.1

    @property
    def annual_extreme(self) -> float:
        """V_e1 [m/s] at the hub, 0.8 * 1.4 V_ref (6.3.2.1)."""
        return 0.8 * 1.4 * self.reference_speed


class Gust:
    """One transient of a site: what it adds at time t after its beginning, 0 before it.

    `duration` T [s] is the standard's; what stays after it (ECD, EDC) stays for ever.
    """

    code: ClassVar[str]
    words: ClassVar[str]
    duration: ClassVar[float]

    def speed(self, site: Site, time: np.ndarray) -> np.ndarray:
        """Added hub-height wind (n,) [m/s]."""
        return np.zeros_like(time)

    def shears(self, site: Site, time: np.ndarray) -> np.ndarray:
        """Added wind (n, 2) [m/s] at the top and the left edge of the rotor, linear over it."""
        return np.zeros((len(time), 2))

    def direction(self, site: Site, time: np.ndarray) -> np.ndarray:
        """Angle (n,) [rad] that the wind has turned by; positive as in `fields.uniform`: it then blows to -y."""
        return np.zeros_like(time)

    def _within(self, time: np.ndarray) -> np.ndarray:
        """Time since the beginning, held at 0 and T."""
        return np.clip(time, 0.0, self.duration)

    def _rise(self, time: np.ndarray) -> np.ndarray:
        """From 0 to 1 as half a cosine, and then 1."""
        return (1 - np.cos(np.pi * self._within(time) / self.duration)) / 2


def _sign(gust: Any) -> None:
    if gust.sign not in (-1, 1):
        raise InputError(f"{gust.code}: sign must be 1 or -1, got {gust.sign!r}")


@dataclass(frozen=True)
class OperatingGust(Gust):
    """EOG: V_gust = min(1.35 (V_e1 - V), 3.3 sigma_1 / (1 + 0.1 D/Lambda_1)), T = 10.5 s.

    -0.37 V_gust sin(3 pi t/T) (1 - cos(2 pi t/T)).
    """

    code = "EOG"
    words = "extreme operating gust"
    duration = 10.5

    @staticmethod
    def magnitude(site: Site) -> float:
        """V_gust [m/s]."""
        local = 3.3 * site.sigma / (1 + 0.1 * site.rotor_diameter / site.turbulence_scale)
        return min(1.35 * (site.annual_extreme - site.mean_speed), local)

    def speed(self, site: Site, time: np.ndarray) -> np.ndarray:
        turn = np.pi * self._within(time) / self.duration
        return -0.37 * self.magnitude(site) * np.sin(3 * turn) * (1 - np.cos(2 * turn))


@dataclass(frozen=True)
class DirectionChange(Gust):
    """EDC: the wind turns by 4 arctan(sigma_1 / (V (1 + 0.1 D/Lambda_1))), at most 180 degrees, in T = 6 s."""

    code = "EDC"
    words = "extreme direction change"
    duration = 6.0
    sign: int = 1

    def __post_init__(self) -> None:
        _sign(self)

    @staticmethod
    def angle(site: Site) -> float:
        """theta_e [rad]."""
        spread = site.mean_speed * (1 + 0.1 * site.rotor_diameter / site.turbulence_scale)
        return min(4 * math.atan(site.sigma / spread), math.pi)

    def direction(self, site: Site, time: np.ndarray) -> np.ndarray:
        return self.sign * self.angle(site) * self._rise(time)


@dataclass(frozen=True)
class CoherentGust(Gust):
    """ECD: the wind rises by 15 m/s and turns by 180 degrees (below 4 m/s) or 720 degrees m/s / V, in T = 10 s."""

    code = "ECD"
    words = "extreme coherent gust with direction change"
    duration = 10.0
    sign: int = 1
    magnitude: ClassVar[float] = 15.0  # m/s

    def __post_init__(self) -> None:
        _sign(self)

    @staticmethod
    def angle(site: Site) -> float:
        """theta_cg [rad]."""
        return math.pi if site.mean_speed < 4.0 else math.radians(720.0 / site.mean_speed)

    def speed(self, site: Site, time: np.ndarray) -> np.ndarray:
        return self.magnitude * self._rise(time)

    def direction(self, site: Site, time: np.ndarray) -> np.ndarray:
        return self.sign * self.angle(site) * self._rise(time)


@dataclass(frozen=True)
class ExtremeShear(Gust):
    """EWS: a linear shear comes and goes in T = 12 s, upwards (`vertical`) or to the left (`horizontal`).

    +-(z - z_hub)/D (2.5 m/s + 0.2 beta sigma_1 (D/Lambda_1)^(1/4)) (1 - cos(2 pi t/T)) with beta = 6.4, or y/D. The
    0.2 is the formula's own number, not the shear exponent. A negative vertical sign takes from the normal shear.
    """

    code = "EWS"
    words = "extreme wind shear"
    duration = 12.0
    across: Literal["vertical", "horizontal"] = "vertical"
    sign: int = 1

    def __post_init__(self) -> None:
        _sign(self)
        if self.across not in ("vertical", "horizontal"):
            raise InputError(f"EWS: the shear is 'vertical' or 'horizontal', got {self.across!r}")

    @staticmethod
    def magnitude(site: Site) -> float:
        """Largest difference [m/s] between the rotor's edge and its hub."""
        ratio = site.rotor_diameter / site.turbulence_scale
        return 2.5 + 0.2 * 6.4 * site.sigma * ratio**0.25

    def shears(self, site: Site, time: np.ndarray) -> np.ndarray:
        turn = 2 * np.pi * self._within(time) / self.duration
        change = self.sign * self.magnitude(site) * (1 - np.cos(turn)) / 2
        none = np.zeros_like(change)
        return np.stack([change, none] if self.across == "vertical" else [none, change], axis=1)


# The transients by the names that design load cases have them under, V for vertical and H for horizontal shear
EVENTS: dict[str, Gust] = {
    "EOG": OperatingGust(),
    "EDC+": DirectionChange(1),
    "EDC-": DirectionChange(-1),
    "ECD+": CoherentGust(1),
    "ECD-": CoherentGust(-1),
    "EWSV+": ExtremeShear("vertical", 1),
    "EWSV-": ExtremeShear("vertical", -1),
    "EWSH+": ExtremeShear("horizontal", 1),
    "EWSH-": ExtremeShear("horizontal", -1),
}


@dataclass(frozen=True)
class GustSignals:
    """A gust in time, (n,) each: added hub-height wind and shears at the rotor's edge [m/s], direction [rad]."""

    speed: np.ndarray
    vertical: np.ndarray
    horizontal: np.ndarray
    direction: np.ndarray


def gust_signals(gust: Gust, site: Site, time: np.ndarray, begin: float = 0.0) -> GustSignals:
    """What a gust that begins at `begin` [s] adds to the normal wind at `time` (n,) [s].

    The linear shears of the campaign are the edge values over the hub-height wind: kappa = (normal + added) / v.
    Of a wind that has turned, the cosine of `direction` blows along the nacelle's axis and minus its sine across (`layout.ACROSS`).
    """
    since = np.asarray(time, float) - begin
    vertical, horizontal = gust.shears(site, since).T
    return GustSignals(gust.speed(site, since), vertical, horizontal, gust.direction(site, since))
