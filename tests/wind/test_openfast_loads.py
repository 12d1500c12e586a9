"""Loads beside OpenFAST's in the same wind: within what is asked for, or as far off as docs/validation.md says and why.

The data lie beside the checkout (`places.SHARED`) and are not part of it; without them these tests are skipped.
"""

from __future__ import annotations

import pytest
from openfast_loads import DATA, amplitudes, field_equivalents, rotor_speed, steady_equivalents

from fatigue_runner.turbine import load_turbine

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"OpenFAST's results are not at {DATA}")

FLAP, EDGE, FORE_AFT, SIDE_SIDE = "RootMyb1", "RootMxb1", "TwrBsMyt", "TwrBsMxt"


def within(pair, share, of_mean=0.01):
    """Within a share of OpenFAST's, or of the channel's mean where the figure is tiny."""
    return abs(pair.ours - pair.theirs) <= max(share * pair.theirs, of_mean * abs(pair.mean))


@pytest.mark.parametrize("speed", [8.0, 18.0])
def test_in_steady_shear_flap_and_tower_swing_at_one_two_and_three_times_the_rotors_speed_as_openfasts(speed):
    off = {
        (pair.channel, pair.what)
        for pair in amplitudes(speed)
        if pair.channel != EDGE and not within(pair, 0.10)
    }
    # the tangential force's second harmonic: see below
    assert off == ({(SIDE_SIDE, "3P")} if speed == 8.0 else set())


@pytest.mark.parametrize(
    ("speed", "channel", "what", "ratio"),
    [(8.0, SIDE_SIDE, "3P", 1.58), (8.0, EDGE, "2P", 1.38), (18.0, SIDE_SIDE, "3P", 1.36)],
)
def test_what_misses_in_steady_shear_misses_as_said(speed, channel, what, ratio):
    (pair,) = (pair for pair in amplitudes(speed) if (pair.channel, pair.what) == (channel, what))
    assert pair.ratio == pytest.approx(ratio, rel=0.03)


@pytest.mark.parametrize("speed", [8.0, 18.0])
def test_in_steady_shear_flap_edge_and_fore_aft_wear_as_openfasts(speed):
    for pair in steady_equivalents(speed):
        if pair.channel != SIDE_SIDE:
            assert pair.ratio == pytest.approx(1.0, abs=0.08), pair


def test_in_a_turbulent_field_where_the_pitch_rests_all_loads_wear_as_openfasts():
    for pair in field_equivalents(8.0, 6):
        assert pair.ratio == pytest.approx(1.0, abs=0.05), pair


def test_in_a_turbulent_field_where_the_pitch_works_flap_and_fore_aft_wear_as_openfasts():
    for pair in field_equivalents(18.0, 6):
        # edge: its mode is collective here; side-side: docs/validation.md
        allowed = {EDGE: 0.08, SIDE_SIDE: 0.12}.get(pair.channel, 0.05)
        assert pair.ratio == pytest.approx(1.0, abs=allowed), pair


@pytest.mark.parametrize(
    ("harmonics", "expected"),
    [
        # flap m = 4 and 10, fore-aft m = 4, side-side m = 4
        (1, (0.86, 0.91, 0.72, 0.27)),
        (3, (0.98, 1.01, 1.00, 0.86)),
    ],
)
def test_fewer_harmonics_lose_what_the_documentation_says(harmonics, expected):
    found = {(p.channel, p.what): p.ratio for p in field_equivalents(8.0, harmonics)}
    keys = (FLAP, "m=4"), (FLAP, "m=10"), (FORE_AFT, "m=4"), (SIDE_SIDE, "m=4")
    assert [found[key] for key in keys] == pytest.approx(expected, abs=0.03)


@pytest.mark.parametrize("speed", [8.0, 18.0])
def test_the_rotor_turns_in_a_field_as_openfasts(speed):
    theirs, ours = rotor_speed(speed, 6)
    assert ours[0] == pytest.approx(theirs[0], rel=0.005)
    assert ours[1] == pytest.approx(theirs[1], rel=0.04)


@pytest.mark.parametrize("speed", [8.0, 18.0])
def test_with_an_edge_of_its_own_a_blade_wears_edgewise_as_openfasts(speed):
    """Within 5 %, where blades that share it have 0.93 at 18 m/s; flap at 8 m/s is 1.05 (1.04), see docs/model.md."""
    machine = load_turbine("nrel5mw_edges").operated("controlled")
    found = {(p.channel, p.what): p.ratio for p in field_equivalents(speed, 6, machine=machine)}
    for m in (4, 10):
        assert found[EDGE, f"m={m}"] == pytest.approx(1.0, abs=0.05)
        assert found[FLAP, f"m={m}"] == pytest.approx(1.0, abs=0.06)
    assert found[FORE_AFT, "m=4"] == pytest.approx(1.0, abs=0.05)
    assert found[SIDE_SIDE, "m=4"] == pytest.approx(1.0, abs=0.15)
