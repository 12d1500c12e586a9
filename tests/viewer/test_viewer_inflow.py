"""The wind that is shown is the one that the blades feel: over the disc, at each blade, as curves and arrows."""

from __future__ import annotations

import numpy as np
import pytest
from viewer_example import shape

from fatigue_runner.layout import T2B1I1CG
from fatigue_runner.viewer.inflow import SPAN, blade_wind, local_wind
from fatigue_runner.wind.azimuth import wind_at


def signals(harmonics: int, n: int = 7) -> np.ndarray:
    """(n, 3 + 2 M) of which none is like another."""
    random = np.random.default_rng(harmonics)
    rotor = np.column_stack(
        [8 + random.normal(size=n), 0.2 + 0.1 * random.normal(size=n), 0.1 * random.normal(size=n)]
    )
    return np.concatenate([rotor, random.normal(size=(n, 2 * harmonics))], axis=1)


def test_disc_wind_is_the_linear_shear_of_the_design():
    wind = np.array([[8.0, 0.25, -0.125]])
    v = local_wind(wind, np.array([0.0, 0.0, 63.0]), np.array([0.0, 63.0, 0.0]), 63.0)
    assert v[0] == pytest.approx([8.0, 8.0 * 1.25, 8.0 * 0.875])


@pytest.mark.parametrize("harmonics", [2, 6])
def test_each_blade_has_the_amplitudes_wind_at_its_own_azimuth(harmonics):
    wind = signals(harmonics)
    azimuth = np.linspace(0.0, 9.0, len(wind))
    linear = blade_wind(wind[:, :3], azimuth)
    for blade in range(3):
        psi = azimuth + 2 * np.pi / 3 * blade
        amplitudes = np.concatenate([np.zeros((len(wind), 1)), wind[:, 3:]], axis=1)
        felt = [wind_at(a, np.array([p]))[0] for a, p in zip(amplitudes, psi, strict=True)]
        assert blade_wind(wind, azimuth)[:, blade] - linear[:, blade] == pytest.approx(felt)
        assert linear[:, blade] == pytest.approx(
            wind[:, 0] * (1 + SPAN * (wind[:, 1] * np.cos(psi) - wind[:, 2] * np.sin(psi)))
        )


@pytest.mark.parametrize("harmonics", [0, 3])
def test_a_blade_feels_the_colour_of_the_disc_that_it_passes(harmonics):
    """Signs and sense of rotation of the drawn turbine and of the disc are one."""
    geometry, wind = shape("t2b1i1cg"), signals(harmonics)
    state = np.zeros((len(wind), 16))
    state[:, T2B1I1CG.rotor] = np.linspace(0.0, 5.0, len(wind))
    pose = geometry.pose(state, np.array([SPAN * geometry.radius]))
    blades = pose.blades[:, :, 0] - pose.apex[:, None]
    for row in range(len(wind)):
        y, z = blades[row, :, 1], blades[row, :, 2]
        shown = local_wind(wind[row : row + 1], y, z, geometry.radius)[0]
        assert shown == pytest.approx(blade_wind(wind, state[:, T2B1I1CG.rotor])[row])
