"""Beam modes of the NREL 5-MW turbine against the report's figures, closed forms and finite elements."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import TURBINE_DATA as DATA
from ruamel.yaml import YAML

from fatigue_runner.errors import InputError
from fatigue_runner.turbine.beam import INTEGRAND_NAMES, blade_modes, columns, tower_modes
from fatigue_runner.turbine.finite_elements import Beam, blade_beam, clamped_frequencies, tower_beam

PARAMETERS = YAML(typ="safe").load(DATA / "nrel5mw.yaml")
BLADE = blade_modes(PARAMETERS)
TOWER = tower_modes(PARAMETERS)
INDEX = {name: i for i, name in enumerate(INTEGRAND_NAMES)}
ROTOR_NACELLE_MASS = 350_000.0  # kg, NREL/TP-500-38060 table 1-1: nacelle 240 t, rotor 110 t


def test_blade_mass_and_moments_are_those_of_the_report():
    # NREL/TP-500-38060, table 2-2; the report rounds to 1 kg, 1 kg.m and 1 kg.m2
    assert BLADE.mass == pytest.approx(17_740, abs=0.5)
    assert BLADE.first_moment == pytest.approx(363_231, abs=1)
    assert BLADE.second_moment == pytest.approx(11_776_047, rel=1e-6)


def test_tower_mass_and_centre_are_those_of_the_report():
    # NREL/TP-500-38060, table 6-2
    assert TOWER.mass == pytest.approx(347_460, abs=0.5)
    assert TOWER.first_moment / TOWER.mass == pytest.approx(38.234, abs=5e-4)


def test_blade_frequencies_are_near_the_published_ones():
    # OpenFAST 5.0's ElastoDyn with 17 equal elements, summary file: 0.676 and 1.088 Hz
    assert BLADE.flap_frequency == pytest.approx(0.676, rel=0.01)
    assert BLADE.edge_frequency == pytest.approx(1.088, rel=0.01)


def test_damping_is_the_stated_fraction_of_critical():
    for modes, name, ratio in ((BLADE, "flap", 0.00477465), (BLADE, "edge", 0.00477465)):
        k, m, c = (getattr(modes, f"{name}_{key}") for key in ("stiffness", "modal_mass", "damping"))
        assert c == pytest.approx(2 * ratio * np.sqrt(k * m), rel=1e-12)
    for mode in (TOWER.fore_aft, TOWER.side_side):
        assert mode.damping == pytest.approx(2 * 0.01 * np.sqrt(mode.stiffness * mode.modal_mass), rel=1e-12)


def test_the_integrals_are_a_symmetric_positive_matrix_of_a_mass_distribution():
    g = BLADE.integrals
    assert np.array_equal(g, g.T)
    scale = np.sqrt(np.diag(g))
    assert np.linalg.eigvalsh(g / np.outer(scale, scale)).min() > -1e-12


def test_the_twisted_mode_keeps_the_modal_mass_of_the_straight_one_nearly():
    # Twist turns the curvature, so tips bend back by at most 1 - cos(13.3 deg) = 2.7 %.
    g = BLADE.integrals
    for name, mass in (("phi", BLADE.flap_modal_mass), ("psi", BLADE.edge_modal_mass)):
        twisted = g[INDEX[f"{name}_x"], INDEX[f"{name}_x"]] + g[INDEX[f"{name}_y"], INDEX[f"{name}_y"]]
        assert 0.95 * mass < twisted < mass


def test_without_twist_flap_stays_in_plane_x_and_edge_in_plane_y():
    modes = blade_modes(_changed_blade(structural_twist_deg=0.0))
    assert np.abs(modes.flap[:, 1]).max() == 0.0
    assert np.abs(modes.edge[:, 0]).max() == 0.0
    x = np.linspace(0, 1, 13)
    radius = modes.hub_radius + x * (modes.tip_radius - modes.hub_radius)
    polynomial = np.polynomial.Polynomial([0, 0, *PARAMETERS["blade"]["flap_mode"]])
    np.testing.assert_allclose(modes.flap_at(radius)[:, 0], polynomial(x), atol=1e-6)
    np.testing.assert_allclose(modes.integrals[INDEX["S_fe"]], 0.0, atol=1e-12)


def test_shapes_vanish_at_and_inside_the_root():
    np.testing.assert_array_equal(BLADE.flap_at(np.array([0.0, 1.5])), 0.0)
    np.testing.assert_array_equal(BLADE.edge_at(np.array([0.0, 1.5])), 0.0)
    np.testing.assert_array_equal(BLADE.flap_at(63.0), BLADE.flap_tip)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(1.0, 50.0), min_size=3, max_size=12))
def test_centrifugal_stiffening_equals_the_work_of_the_tension(lengths):
    # The order of integration exchanged: int m r S_ff dr = int N phi'^2 dr, N(r) the pull of the mass
    # outside r.
    parameters = copy.deepcopy(PARAMETERS)
    parameters["blade"]["mass_element_lengths"] = lengths
    modes = blade_modes(parameters)
    sizes = np.array(lengths) * 61.5 / sum(lengths)
    nodes = np.cumsum(sizes) - sizes / 2
    table = columns(parameters["blade"]["stations"])
    masses = 1.04536 * sizes * np.interp(nodes / 61.5, table["span_fraction"], table["mass_density"])
    pull = ((1.5 + nodes) * masses) @ (nodes[:, None] >= modes.grid[None, :] - 1.5)
    work = np.trapezoid(pull * (modes.flap_slope**2).sum(axis=1), modes.grid)
    assert modes.integrals[INDEX["r"], INDEX["S_ff"]] == pytest.approx(work, rel=5e-3)


def test_tower_shortening_is_the_integral_of_the_squared_slope():
    z = np.linspace(0, 87.6, 20001)
    for mode in (TOWER.fore_aft, TOWER.side_side):
        assert mode.shortening_top == pytest.approx(np.trapezoid(mode.slope_at(z) ** 2, z), rel=1e-6)
        assert mode.shape_at(87.6) == pytest.approx(1.0, abs=1e-3)
        assert mode.top_slope == pytest.approx(float(mode.slope_at(87.6)), rel=1e-12)
        # less than the whole tower sinks as far as its top
        assert 0 < mode.mass_shortening < TOWER.mass * mode.shortening_top


def test_finite_elements_give_the_closed_form_of_a_uniform_cantilever():
    # Blevins, "Formulas for Natural Frequency and Mode Shape" (1979), table 8-1: 1.87510407 and 4.69409113
    beam = Beam(np.array([0.0, 10.0]), np.full(2, 3.0), np.tile([1e4, 4e4], (2, 1)), np.zeros(2), np.zeros(2))
    first, second = np.array([1.87510407, 4.69409113]) ** 2 / 100 * np.sqrt(1e4 / 3) / (2 * np.pi)
    expected = sorted([first, 2 * first, second, 2 * second])
    np.testing.assert_allclose(clamped_frequencies(beam, 4, 20)[0], expected, rtol=1e-5)


def test_finite_elements_ignore_a_constant_twist_but_turn_the_modes_with_it():
    plain = Beam(
        np.array([0.0, 10.0]), np.full(2, 3.0), np.tile([1e4, 9e4], (2, 1)), np.zeros(2), np.zeros(2)
    )
    turned = Beam(plain.position, plain.mass_density, plain.stiffness, np.full(2, 0.3), plain.tension)
    frequencies, ends = clamped_frequencies(turned, 4, 10)
    np.testing.assert_allclose(frequencies, clamped_frequencies(plain, 4, 10)[0], rtol=1e-7)
    assert ends[0, 1] / ends[0, 0] == pytest.approx(-np.tan(0.3), rel=1e-6)


def test_finite_elements_give_the_closed_form_of_a_light_column_with_a_heavy_top():
    # omega^2 = 3 EI / ((M + 33/140 m L) L^3), Blevins (1979), table 8-8
    beam = Beam(
        np.array([0.0, 10.0]), np.full(2, 0.01), np.tile([1e4, 9e4], (2, 1)), np.zeros(2), np.zeros(2), 50.0
    )
    expected = np.sqrt(3 * np.array([1e4, 9e4]) / ((50.0 + 0.1 * 33 / 140) * 1000)) / (2 * np.pi)
    np.testing.assert_allclose(clamped_frequencies(beam, 2, 10)[0], expected, rtol=1e-5)


def test_a_tower_loses_its_stiffness_at_the_buckling_load_of_euler():
    # pi^2 EI / (4 L^2) on a clamped column; just below it the frequency is nearly zero
    load = np.pi**2 * 1e4 / 400
    below = Beam(
        np.array([0.0, 10.0]),
        np.ones(2),
        np.tile([1e4, 9e4], (2, 1)),
        np.zeros(2),
        np.full(2, -0.9999 * load),
    )
    free = Beam(below.position, below.mass_density, below.stiffness, below.twist, np.zeros(2))
    assert clamped_frequencies(below, 1, 20)[0][0] < 0.02 * clamped_frequencies(free, 1, 20)[0][0]


def test_the_decks_blade_modes_are_those_of_the_finite_element_blade():
    frequencies, ends = clamped_frequencies(blade_beam(PARAMETERS))
    # the prescribed shapes are an approximation from above, but their masses are lumped: one per cent
    assert BLADE.flap_frequency == pytest.approx(frequencies[0], rel=0.01)
    assert BLADE.edge_frequency == pytest.approx(frequencies[1], rel=0.01)
    assert frequencies[0] == pytest.approx(0.68, abs=0.02)
    assert frequencies[1] == pytest.approx(1.09, abs=0.02)
    # twist moves the flapping tip against the edge direction and the edging tip downwind
    for shape, end in ((BLADE.flap_tip, ends[0]), (BLADE.edge_tip, ends[1])):
        angle = np.degrees(np.arccos(abs(shape @ end) / np.linalg.norm(shape)))
        assert angle < 3.0


def test_the_spinning_blade_stiffens_as_the_shortening_integral_says():
    speed = 12.1 * np.pi / 30
    at_rest, spinning = (clamped_frequencies(blade_beam(PARAMETERS, w))[0][0] for w in (0.0, speed))
    g = BLADE.integrals
    modal_mass = g[INDEX["phi_x"], INDEX["phi_x"]] + g[INDEX["phi_y"], INDEX["phi_y"]]
    rise = g[INDEX["r"], INDEX["S_ff"]] / modal_mass * (speed / (2 * np.pi)) ** 2
    assert rise == pytest.approx(spinning**2 - at_rest**2, rel=0.04)


def test_the_decks_tower_modes_are_those_of_the_finite_element_tower():
    fe = clamped_frequencies(tower_beam(PARAMETERS, ROTOR_NACELLE_MASS), 2)[0]
    for mode, allowed in ((TOWER.fore_aft, 0.03), (TOWER.side_side, 0.015)):
        rayleigh = np.sqrt(mode.stiffness / (mode.modal_mass + ROTOR_NACELLE_MASS)) / (2 * np.pi)
        assert fe[0] * 0.999 < rayleigh < fe[0] * (1 + allowed)


def test_the_tower_with_the_whole_rotor_and_nacelle_on_top_swings_near_0_32_hz():
    # Side-side 0.3213 Hz by OpenFAST 5.0 (8 m/s), 0.3120 Hz by FAST and 0.3164 Hz by ADAMS in
    # NREL/TP-500-38060, table 9-1. Inertia: rotor about the shaft, and both masses about their centre.
    nacelle, rotor = (240_000.0, 1.75), (110_000.0, 2.4)
    centre = (nacelle[0] * nacelle[1] + rotor[0] * rotor[1]) / ROTOR_NACELLE_MASS
    about_shaft = 3 * BLADE.integrals[1, 1] + PARAMETERS["hub"]["inertia"]
    roll = about_shaft + sum(m * (z - centre) ** 2 for m, z in (nacelle, rotor))
    beam = tower_beam(PARAMETERS, ROTOR_NACELLE_MASS, centre, (0.5 * roll, roll), gravity=9.80665)
    frequencies, ends = clamped_frequencies(beam, 2)
    side_side = frequencies[np.argmax(np.abs(ends[:, 1]))]
    assert side_side == pytest.approx(0.3164, rel=0.01)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"flap_mode": [0.1, 0.2]}, "add up to 1"),
        ({"stations": {"columns": ["span_fraction"], "rows": [[0.0], [0.5]]}}, "rise from 0 to 1"),
        (
            {"stations": {"columns": ["span_fraction", "x"], "rows": [[0.0]]}},
            "row 1: 1 values for the 2 columns",
        ),
    ],
)
def test_a_blade_that_is_no_beam_is_refused(change, words):
    parameters = copy.deepcopy(PARAMETERS)
    parameters["blade"].update(change)
    with pytest.raises(InputError, match=words):
        blade_modes(parameters)


def test_a_negative_mass_density_is_refused():
    with pytest.raises(InputError, match="mass_density must be positive"):
        blade_modes(_changed_blade(mass_density=-1.0))


def _changed_blade(**values: float) -> dict:
    parameters = copy.deepcopy(PARAMETERS)
    table = parameters["blade"]["stations"]
    for name, value in values.items():
        for row in table["rows"]:
            row[table["columns"].index(name)] = value
    return parameters
