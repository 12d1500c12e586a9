"""S-N curves and Miner damage against the standards' tables and published results."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from load_series import VARYING

from fatigue_runner import fatigue as fa
from fatigue_runner.errors import InputError
from fatigue_runner.fatigue.sn_curves import register

unhurried = settings(deadline=None)  # the first example may compile the counter


def test_miner_damage_on_a_linear_curve_is_the_published_one():
    # fatpack, TestLinearEnduranceCurve: 4.2859429355281203e-06
    curve = fa.SNCurve.through("linear", 90.0, 5e6, (3.0,), source="fatpack/test.py")
    damage = fa.miner_damage([93.0, 122.0, 14.0, 230.0, 94.0, 12.0, 1.0], np.ones(7), curve)
    assert damage == pytest.approx(4.2859429355281203e-06, rel=1e-12)


@pytest.mark.parametrize("curve", fa.SN_CURVES.values(), ids=fa.SN_CURVES)
def test_every_curve_names_its_source_falls_and_is_inverse_to_itself(curve):
    assert curve.source and curve.unit == "MPa"
    cycles = np.array([1e4, 1e5, 0.99e6, 3e6, 9e6, 1.1e7, 9e7])
    ranges = np.array([curve.stress_range(n) for n in cycles])
    assert (np.diff(ranges) < 0).all()
    np.testing.assert_allclose(curve.cycles_to_failure(ranges), cycles, rtol=1e-9)


# The fatigue limit at 1e7 cycles is a column of its own in DNVGL-RP-C203, table 2-1.
@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("dnv-b1-air", 106.97),
        ("dnv-c-air", 73.10),
        ("dnv-d-air", 52.63),
        ("dnv-e-air", 46.78),
        ("dnv-f-air", 41.52),
        ("dnv-g-air", 29.24),
        ("dnv-w3-air", 21.05),
        ("dnv-d-seawater-protected", 52.63),
    ],
)
def test_a_dnv_curve_gives_its_published_fatigue_limit_at_ten_million_cycles(name, limit):
    assert fa.sn_curve(name).stress_range(1e7) == pytest.approx(limit, rel=5e-4)


def test_a_dnv_curve_turns_from_slope_3_to_slope_5_at_its_knee():
    curve = fa.sn_curve("dnv-d-air")
    n = curve.cycles_to_failure([200.0, 100.0, 40.0, 20.0])
    assert n[1] / n[0] == pytest.approx(2**3) and n[3] / n[2] == pytest.approx(2**5)
    assert n[1] == pytest.approx(10**12.164 / 100.0**3)


@pytest.mark.parametrize("category", [36, 71, 160])
def test_a_eurocode_curve_has_its_published_limits_and_its_cut_off(category):
    # EN 1993-1-9, 7.1: limit 0.737 of the category at 5e6 cycles, cut-off 0.549 of that at 1e8
    curve = fa.sn_curve(f"ec3-{category}")
    assert curve.stress_range(2e6) == pytest.approx(category)
    assert curve.stress_range(5e6) == pytest.approx(0.737 * category, rel=1e-3)
    assert curve.cutoff == pytest.approx(0.549 * 0.737 * category, rel=1e-3)
    assert fa.miner_damage([curve.cutoff * 0.999], [1e9], curve) == 0.0
    assert fa.miner_damage([curve.cutoff], [1e8], curve) == pytest.approx(1.0)
    assert curve.stress_range(math.inf) == curve.stress_range(1e12) == curve.cutoff


def test_miner_damage_takes_the_section_modulus_as_a_scale():
    # 1e6 N·m on 0.5 m³ is 2 MPa per 1e6 N·m
    in_moment = fa.miner_damage([5e7], [1e4], "dnv-d-air", scale=1e-6 / 0.5)
    assert in_moment == pytest.approx(1e4 / fa.sn_curve("dnv-d-air").cycles_to_failure(100.0))


@unhurried
@given(VARYING, st.sampled_from(sorted(fa.SN_CURVES)))
def test_damage_adds_over_cycles_and_grows_with_the_load(values, name):
    ranges, _, counts = fa.rainflow(np.array(values) * 1e-5)
    whole = fa.miner_damage(ranges, counts, name)
    parts = fa.miner_damage(ranges[::2], counts[::2], name) + fa.miner_damage(
        ranges[1::2], counts[1::2], name
    )
    assert whole == pytest.approx(parts, rel=1e-9, abs=1e-300)
    assert fa.miner_damage(1.1 * ranges, counts, name) >= whole


@unhurried
@given(VARYING, st.integers(3, 12))
def test_on_a_linear_curve_the_del_does_the_damage_of_the_series(values, m):
    ranges, _, counts = fa.rainflow(values)
    curve = fa.SNCurve.through(
        "linear", float(ranges.max()), 1e6, (float(m),), source="definition of the DEL"
    )
    load = fa.equivalent_load(ranges, counts, m, 600.0)
    assert fa.miner_damage([load], [600.0], curve) == pytest.approx(
        fa.miner_damage(ranges, counts, curve), rel=1e-9
    )


def test_no_range_and_next_to_no_range_do_no_damage():
    assert fa.miner_damage([0.0, 1e-200], [1e9, 1e9], "dnv-d-air") == 0.0


def test_an_unknown_curve_is_refused_with_the_nearest_name():
    with pytest.raises(InputError, match="unknown S-N curve 'dnv-d-aire'; did you mean 'dnv-d-air'"):
        fa.miner_damage([1.0], [1.0], "dnv-d-aire")


@pytest.mark.parametrize(
    ("exponents", "log_a", "knees", "message"),
    [
        ((3.0, 5.0), (12.164, 16.0), (1e7,), "the branches do not meet at N = 1e\\+07: 52.64 and 63.1 MPa"),
        ((3.0, 5.0), (12.164,), (1e7,), "one log intercept per exponent"),
        ((3.0, 5.0), (12.164, 15.606), (), "one knee between two"),
        ((), (), (), "one log intercept per exponent"),
        ((0.0,), (12.0,), (), "exponents must be above zero"),
        ((3.0, 4.0, 5.0), (12.0, 12.0, 12.0), (1e7, 1e6), "knees must grow"),
    ],
)
def test_a_curve_that_cannot_be_right_is_refused_when_made(exponents, log_a, knees, message):
    with pytest.raises(InputError, match=message):
        fa.SNCurve("mine", exponents, log_a, source="nowhere", knees=knees)


def test_a_curve_with_a_taken_name_is_refused():
    with pytest.raises(InputError, match=r"'dnv-d-air' exists already \(DNVGL-RP-C203"):
        register(fa.SNCurve("dnv-d-air", (3.0,), (12.0,), source="mine"))
