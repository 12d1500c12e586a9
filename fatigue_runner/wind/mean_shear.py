"""The mean wind over the rotor as signals: disc mean, linear shears, and what a profile has beyond them as harmonics.

m = 1 of the mean wind keeps the linear profile along the blade that shears have, with the slope whose blade-effective part is the
profile's; m = 2 and up act all along the blade, as those of turbulence.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.inputs.section import problem
from fatigue_runner.layout import MOST_HARMONICS, WIND
from fatigue_runner.rotor import Rotor
from fatigue_runner.wind.azimuth import whole_harmonics
from fatigue_runner.wind.azimuthal_spectrum import DEFAULT_HARMONICS
from fatigue_runner.wind.profiles import Logarithmic, PowerLaw, Profile, profile_amplitudes, profile_disc_fit
from fatigue_runner.wind.radial_weight import RadialWeight

# what a wind that blows on no turbine yet is made for: the NREL 5 MW
NO_TURBINE = Rotor(63.0, 90.0)


def checked_harmonics(what: str, harmonics: Any) -> int:
    """M; raises InputError for what is no whole number from 0 to the most that a wind has."""
    return whole_harmonics(harmonics, MOST_HARMONICS, f"{what}: ")


def mean_profile(what: str, shear_exponent: Any, roughness_length: Any) -> Profile | None:
    """The profile of a mean wind by its one parameter, alpha [-] or z_0 [m]; None where neither is given.

    Raises InputError for both and for impossible ones.
    """
    if shear_exponent is not None and roughness_length is not None:
        raise InputError(f"{what} has both shear_exponent and roughness_length; give one of the two")
    if roughness_length is not None:
        return Logarithmic(roughness_length)
    return None if shear_exponent is None else PowerLaw(shear_exponent)


def checked_order(what: str, harmonics: Any, profile: Profile | None, vertical_shear: float) -> int | None:
    """M of a steady wind: as given, or the default where there is a profile. Raises InputError for what contradicts itself."""
    if profile is None:
        if harmonics is not None and checked_harmonics(what, harmonics) > 1:
            raise InputError(
                f"{what}: a linear shear has one harmonic, not {harmonics}; give shear_exponent for a power law, "
                "or roughness_length for a logarithmic profile"
            )
        return None
    if vertical_shear:
        given = "shear_exponent" if isinstance(profile, PowerLaw) else "roughness_length"
        raise InputError(f"{what} has both vertical_shear and {given}; give one of the two")
    return DEFAULT_HARMONICS if harmonics is None else checked_harmonics(what, harmonics)


@lru_cache(maxsize=64)
def radial_rule(rotor: Rotor) -> tuple[np.ndarray, np.ndarray, float]:
    """Radii (k,) [m], their shares (k,) in the blade-effective wind, and its mean radius over R."""
    rho, shares = RadialWeight(*rotor.weight).rule()
    return rho * rotor.radius, shares, float(shares @ rho)


def one_profile(section: Any) -> None:
    """For a section of a campaign with keys for both profiles: raises the problem where both are given."""
    if {"shear_exponent", "roughness_length"} <= section.model_fields_set:
        raise problem("stands beside shear_exponent; give one of the two", key="roughness_length")


def mean_signals(profile: Profile, speed: float, rotor: Rotor, harmonics: int) -> np.ndarray:
    """Signals (3 + 2 M,) of a profile with `speed` [m/s] at hub height; (3,) for M of 0 (no shear) and 1 (the slope at the hub)."""
    return _mean_signals(profile, speed, rotor, harmonics).copy()


@lru_cache(maxsize=256)  # one mean wind has many seeds
def _mean_signals(profile: Profile, speed: float, rotor: Rotor, harmonics: int) -> np.ndarray:
    if harmonics < 2:
        slope = profile.factor(np.array([1.001, 0.999]) * rotor.hub_height, rotor.hub_height)
        kappa = float(slope[0] - slope[1]) / 0.002 * rotor.radius / rotor.hub_height
        if isinstance(profile, PowerLaw):
            kappa = profile.exponent * rotor.radius / rotor.hub_height
        return np.array([speed, kappa if harmonics else 0.0, 0.0])
    radii, shares, mean_radius = radial_rule(rotor)
    amplitudes = profile_amplitudes(profile, rotor.hub_height, radii, shares, harmonics)
    disc = profile_disc_fit(profile, rotor.hub_height, rotor.radius)
    out = np.zeros(len(WIND) + 2 * harmonics)
    out[0], out[1] = speed * disc[0], amplitudes[1] / mean_radius / disc[0]
    out[len(WIND) + 2 :] = speed * amplitudes[3:]
    return out
