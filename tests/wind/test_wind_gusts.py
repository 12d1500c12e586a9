"""The extreme winds of IEC 61400-1 against the standard's formulas, and how smooth they are at their ends."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fatigue_runner.errors import InputError
from fatigue_runner.wind.gusts import (
    CoherentGust,
    DirectionChange,
    ExtremeShear,
    OperatingGust,
    Site,
    gust_signals,
)

# NREL 5 MW in class IB at 12 m/s: sigma_1 = 0.14 (0.75 * 12 + 5.6) = 2.044 m/s, D/Lambda_1 = 126/42 = 3
SITE = Site(12.0, 90.0, 126.0, "B", 50.0)


def test_the_site_has_the_standards_quantities():
    assert SITE.sigma == pytest.approx(2.044)
    assert SITE.turbulence_scale == pytest.approx(42.0)
    assert Site(12.0, 40.0, 60.0, "A", 50.0).turbulence_scale == pytest.approx(28.0)
    assert SITE.annual_extreme == pytest.approx(56.0)  # 0.8 * 1.4 * 50


def test_the_operating_gust_dips_rises_and_dips():
    """V_gust = 3.3 * 2.044 / 1.3 = 5.1886 m/s; at T/2 the wind is 0.74 V_gust higher."""
    assert OperatingGust.magnitude(SITE) == pytest.approx(3.3 * 2.044 / 1.3)
    found = gust_signals(OperatingGust(), SITE, np.array([100.0, 105.25, 110.5, 200.0]), begin=100.0)
    assert found.speed == pytest.approx([0, 0.74 * 5.18862, 0, 0], abs=1e-4)
    inside = OperatingGust().speed(SITE, np.linspace(0, 10.5, 1001))
    assert inside == pytest.approx(inside[::-1], abs=1e-12)
    assert inside.min() == pytest.approx(
        -0.37 * 5.18862 * 0.72447, rel=1e-4
    )  # -2 sin(3 x) sin(x)^2 at x = 0.7353
    assert not found.vertical.any() and not found.horizontal.any() and not found.direction.any()


def test_the_operating_gust_is_limited_by_the_annual_extreme():
    """1.35 (0.8 * 1.4 * 37.5 - 36) = 8.1 m/s, below 3.3 sigma_1 / 1.3 = 11.6 m/s."""
    assert OperatingGust.magnitude(Site(36.0, 90.0, 126.0, "B", 37.5)) == pytest.approx(8.1)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_coherent_gust_rises_by_15_and_turns_by_720_over_v(sign):
    found = gust_signals(CoherentGust(sign), SITE, np.array([-1.0, 0.0, 5.0, 10.0, 60.0]))
    assert found.speed == pytest.approx([0, 0, 7.5, 15, 15])
    assert np.degrees(found.direction) == pytest.approx([0, 0, sign * 30, sign * 60, sign * 60])
    assert CoherentGust.angle(Site(3.9, 90.0, 126.0, "B", 50.0)) == pytest.approx(math.pi)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_direction_change_is_four_arctangents(sign):
    found = gust_signals(DirectionChange(sign), SITE, np.array([0.0, 3.0, 6.0, 60.0]))
    angle = sign * 4 * math.atan(2.044 / (12 * 1.3))
    assert found.direction == pytest.approx([0, angle / 2, angle, angle])
    assert not found.speed.any()
    assert DirectionChange.angle(Site(1.0, 90.0, 10.0, "A+", 50.0)) <= math.pi


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("across", ["vertical", "horizontal"])
def test_the_extreme_shear_comes_and_goes(across, sign):
    """(D/2)/D (2.5 + 0.2 * 6.4 * 2.044 * 3^0.25) (1 - cos) at the rotor's edge, largest at T/2."""
    found = gust_signals(ExtremeShear(across, sign), SITE, np.array([-1.0, 3.0, 6.0, 12.0, 60.0]))
    edge = sign * (2.5 + 0.2 * 6.4 * 2.044 * 3**0.25)
    changed, other = found.vertical, found.horizontal
    if across == "horizontal":
        changed, other = other, changed
    assert changed == pytest.approx([0, edge / 2, edge, 0, 0], abs=1e-12)
    assert not other.any() and not found.speed.any() and not found.direction.any()


def every_signal(gust, time):
    found = gust_signals(gust, SITE, time)
    return np.stack([found.speed, found.vertical, found.horizontal, found.direction])


@pytest.mark.parametrize("kind", [OperatingGust, DirectionChange, CoherentGust, ExtremeShear])
def test_nothing_happens_before_a_gust_and_nothing_new_after_it(kind):
    gust = kind()
    assert not every_signal(gust, np.array([-50.0, -1e-9, 0.0])).any()
    after = every_signal(gust, gust.duration + np.array([0.0, 1.0, 500.0]))
    assert after == pytest.approx(np.tile(after[:, :1], (1, 3)), abs=1e-12)


@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize(
    ("gust", "derivative", "jump"),
    [
        (OperatingGust(), 3, 0.37 * OperatingGust.magnitude(SITE) * 36 * math.pi**3 / 10.5**3),
        (DirectionChange(), 2, DirectionChange.angle(SITE) / 2 * (math.pi / 6) ** 2),
        (CoherentGust(), 2, 15 / 2 * (math.pi / 10) ** 2),
        (ExtremeShear(), 2, ExtremeShear.magnitude(SITE) / 2 * (2 * math.pi / 12) ** 2),
    ],
    ids=lambda value: getattr(value, "code", None),
)
def test_a_gust_joins_its_surroundings_as_smoothly_as_it_says(gust, derivative, jump, end):
    """One-sided differences inside: the first derivative that is not zero at the end has the stated size."""
    h, inwards = 1e-3, 1 - 2 * end
    time = end * gust.duration + inwards * h * np.arange(6)
    inside = every_signal(gust, time)
    inside = inside[np.ptp(inside, axis=1).argmax()] - inside[np.ptp(inside, axis=1).argmax(), 0]
    sizes = [
        abs(np.polynomial.polynomial.polyfit(h * np.arange(6), inside, 5)[n]) * math.factorial(n)
        for n in (1, 2, 3)
    ]
    assert sizes[derivative - 1] == pytest.approx(jump, rel=2e-3)
    assert all(size < 1e-3 * jump for size in sizes[: derivative - 1])


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (lambda: Site(60.0, 90.0, 126.0, "B", 50.0), "must be below the reference speed 50 m/s"),
        (lambda: Site(-1.0, 90.0, 126.0, "B", 50.0), "mean_speed must be a number above 0 m/s"),
        (lambda: Site(12.0, 90.0, 126.0, "D", 50.0), "unknown turbulence class 'D'"),
        (lambda: CoherentGust(2), "ECD: sign must be 1 or -1, got 2"),
        (lambda: DirectionChange(0), "EDC: sign must be 1 or -1, got 0"),
        (lambda: ExtremeShear("diagonal"), "'vertical' or 'horizontal', got 'diagonal'"),
    ],
)
def test_what_cannot_be_is_refused(make, complaint):
    with pytest.raises(InputError, match=complaint):
        make()
