"""The wall of a section: stress by beam theory, damage around the circle, laminates at the corners of their triangle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fatigue_runner import fatigue as fa
from fatigue_runner.errors import InputError
from fatigue_runner.fatigue.laminate import SLOPES, Laminate
from fatigue_runner.fatigue.sections import PLACES, Circle, Wall

TOWER = Circle(6.0, 0.0351)
YEAR = 8760 * 3600.0
Y, X = PLACES["tower_base"].about_y, PLACES["tower_base"].about_x


def swinging(amplitude, mean=0.0, cycles=60, samples=6001):
    return mean + amplitude * np.cos(np.linspace(0.0, 2 * np.pi * cycles, samples))


def wall(curve="dnv-d-air", **more):
    return Wall(PLACES["tower_base"], TOWER, fa.sn_curve(curve) if isinstance(curve, str) else curve, **more)


def test_the_section_modulus_is_that_of_a_thin_tube():
    # pi D² t / 4 of the mean diameter, to (t/D)²
    assert TOWER.modulus == pytest.approx(math.pi * 5.9649**2 * 0.0351 / 4 * 5.9649 / 6.0, rel=1e-4)


def test_the_towers_wall_has_the_reports_stiffness(nrel5mw):
    # TP-500-38060, table 6-1: 614.343e9 N·m² at height 0 with 210 GPa; its 0.027 m are before the 30 % that the text adds
    foot = Circle(*nrel5mw.sections["tower_base"])
    assert 210e9 * foot.modulus * foot.diameter / 2 == pytest.approx(614.343e9, rel=1e-4)


def test_the_blades_root_has_the_reports_stiffness(nrel5mw):
    root = Circle(*nrel5mw.sections["blade_root"])
    assert 27.7e9 * root.modulus * root.diameter / 2 == pytest.approx(18.11e9, rel=1e-3)


def test_damage_of_a_swinging_moment_is_that_of_its_stress_by_hand():
    # 60 cycles of ± 60 MN·m in 600 s: S = 120e6 / W, times (35.1/25)^0.2; N = 10^12.164 / S³; 52560 · 60 cycles in a year
    stress = 2 * 60e6 / TOWER.modulus * 1e-6 * (35.1 / 25) ** 0.2
    assert stress == pytest.approx(120 / (614.343 / 210 / 3) * 1.404**0.2, rel=1e-4)
    by_hand = 60 * (YEAR / 600) * stress**3 / 10**12.164
    found = wall().damage_per_year({Y: swinging(60e6), X: swinging(0.0)}, 600.0)
    assert found[0] == found[12] == pytest.approx(by_hand, rel=1e-9)
    assert found[6] == pytest.approx(0.0, abs=1e-12 * by_hand)  # on the axis of bending nothing swings
    # at 45 degrees 93 MPa, still above the knee of 52.6 MPa
    assert found[3] == pytest.approx(by_hand * math.cos(math.pi / 4) ** 3, rel=1e-9)


def test_two_moments_in_phase_wear_where_their_resultant_bends_and_out_of_phase_everywhere_alike():
    together = wall(azimuths=36).damage_per_year({Y: swinging(30e6), X: swinging(30e6)}, 600.0)
    assert np.argmax(together[:18]) * 10 in (130, 140)  # sin a - cos a is largest at 135 degrees
    turning = np.linspace(0.0, 120 * np.pi, 60001)
    around = wall().damage_per_year({Y: 30e6 * np.cos(turning), X: 30e6 * np.sin(turning)}, 600.0)
    assert np.ptp(around) < 0.02 * around.mean()


def test_factors_on_the_stress_count_by_the_slope():
    loads = {Y: swinging(60e6), X: swinging(1.0)}
    plain = wall().damage_per_year(loads, 600.0)[0]
    assert wall(safety_factor=1.25, stress_concentration=1.2).damage_per_year(loads, 600.0)[
        0
    ] == pytest.approx(plain * 1.5**3)


def test_goodman_makes_the_stretched_side_worse_and_the_compressed_side_better():
    # thrust compresses the side downwind (azimuth 0) and stretches the one upwind
    loads = {Y: swinging(30e6, mean=40e6), X: swinging(0.0)}
    found = wall(ultimate=400.0).damage_per_year(loads, 600.0)
    plain = wall().damage_per_year(loads, 600.0)
    mean = 40e6 * wall().stress_per_moment
    assert found[12] == pytest.approx(plain[0] * (400 / (400 - mean)) ** 3, rel=1e-6)
    # the compressed side: ranges shrink; both lie above the knee
    assert found[0] == pytest.approx(plain[0] * (400 / (400 + mean)) ** 3, rel=1e-6)


def test_a_wall_under_a_constant_moment_is_not_worn_and_one_that_is_not_finite_has_no_figure():
    still = wall().damage_per_year({Y: np.full(100, 3e6), X: np.full(100, -1e6)}, 600.0)
    assert (still == 0.0).all()
    broken = swinging(1e6)
    broken[17] = np.nan
    assert wall().damage_per_year({Y: broken, X: swinging(1.0)}, 600.0) is None


def test_a_laminate_holds_its_strength_at_one_cycle_and_nothing_at_a_mean_of_its_strength():
    made = Laminate("glass", 10.0, 600.0, 400.0)
    # the triangle: no mean to lose at (R_t - R_c)/2 = 100 MPa, where the amplitude of one cycle is (R_t + R_c)/2 = 500 MPa
    assert made.cycles_to_failure([1000.0], [100.0])[0] == pytest.approx(1.0)
    assert made.cycles_to_failure([100.0], [100.0])[0] == pytest.approx(10.0**10)
    # half way to the tensile strength half of it is left
    assert made.cycles_to_failure([500.0], [350.0])[0] == pytest.approx(1.0)
    assert made.cycles_to_failure([0.0], [0.0])[0] == np.inf
    with pytest.raises(InputError, match="a mean of 600 MPa reaches the strength of the laminate glass"):
        made.cycles_to_failure([1.0], [600.0])
    halved = Laminate("glass", 10.0, 600.0, 400.0, amplitude_factor=2.0)
    assert halved.cycles_to_failure([500.0], [100.0])[0] == pytest.approx(1.0)


def test_the_slopes_of_laminates_are_the_guidelines():
    assert SLOPES == {"polyester": 9.0, "epoxy": 10.0, "carbon-epoxy": 14.0}


@pytest.mark.parametrize(
    ("name", "k"), [("dnv-b1-air", 0.0), ("dnv-c-air", 0.05), ("dnv-c1-air", 0.1), ("dnv-c2-air", 0.15), ("dnv-d-air", 0.2),
                    ("dnv-f-air", 0.25), ("dnv-w3-seawater-protected", 0.25)],
)  # fmt: skip
def test_thick_plates_are_weaker_by_the_exponent_of_their_class(name, k):
    # thickness exponents of DNVGL-RP-C203, table 2-1, as qats and two other public programs have them, too
    curve = fa.sn_curve(name)
    assert curve.thickness_factor(0.050) == pytest.approx(2.0**k)
    assert curve.thickness_factor(0.020) == 1.0 == curve.thickness_factor(None)


def test_a_section_that_cannot_be_is_refused():
    with pytest.raises(InputError, match="a wall of 2 m does not fit into a diameter of 3 m"):
        Circle(3.0, 2.0)
    with pytest.raises(InputError, match="wall of a section must be finite and above zero"):
        Circle(3.0, 0.0)
