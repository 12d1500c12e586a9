"""Blade-element-momentum loads and their tables against OpenFAST, CADynTurb, a textbook iteration,
identities."""

from __future__ import annotations

import copy
import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import SHARED
from ruamel.yaml import YAML

from fatigue_runner.errors import InputError
from fatigue_runner.turbine import table_builder
from fatigue_runner.turbine.aerodynamics import (
    LOAD_NAMES,
    blade_aerodynamics,
    inflow_angle,
    power_coefficient,
    rotor_loads,
    thrust_coefficient,
)
from fatigue_runner.turbine.beam import blade_modes
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.turbine.generated.kernel import TABLES
from fatigue_runner.turbine.parameters import DATA
from fatigue_runner.turbine.table_builder import PITCH_DEG, TIP_SPEED_RATIO, load_coefficients, table_names
from fatigue_runner.turbine.tables import read_tables

CADYNTURB = SHARED / "t2b1i1cg_params.json"
PARAMETERS = {name: read_turbine_file(name) for name in ("nrel5mw", "t2b1i1cg")}
AIRFOILS = YAML(typ="safe").load(DATA / "nrel5mw_airfoils.yaml")
FLAT, CONED = (
    blade_aerodynamics(PARAMETERS[name], AIRFOILS, blade_modes(PARAMETERS[name]))
    for name in ("t2b1i1cg", "nrel5mw")
)
# OpenFAST 5.0, rigid rotor without tilt and cone, pitch 0, quasi-steady blade-element momentum
OPENFAST_RATIO = np.array([5.0, 7.0, 7.55, 9.0, 10.0])
OPENFAST_POWER = np.array([0.355, 0.480, 0.485, 0.469, 0.443])
OPENFAST_THRUST = np.array([0.513, 0.750, 0.788, 0.867, 0.912])
RATIO = np.array([2.0, 4.0, 5.2, 7.55, 10.0, 13.0])


def load(values, name):
    return values[LOAD_NAMES.index(name)]


def test_power_coefficient_is_openfasts():
    np.testing.assert_allclose(power_coefficient(FLAT, OPENFAST_RATIO, 0.0), OPENFAST_POWER, rtol=0.004)


def test_peak_power_coefficient_is_the_reports():
    # NREL/TP-500-38060, table 7-2: 0.482 at tip-speed ratio 7.55 and pitch 0
    ratio = np.arange(6.0, 9.0, 0.05)
    power = power_coefficient(CONED, ratio, 0.0)
    assert power.max() == pytest.approx(0.482, rel=0.01)
    assert ratio[power.argmax()] == pytest.approx(7.55, abs=0.25)


def test_thrust_coefficient_is_openfasts_up_to_its_tip_station():
    ours = thrust_coefficient(FLAT, OPENFAST_RATIO, 0.0)
    np.testing.assert_allclose(ours, OPENFAST_THRUST, rtol=0.0125)
    # OpenFAST sets the axial induction of the tip station to 1, which leaves there the lift of the
    # undisturbed in-plane flow; Prandtl's loss makes that load zero. With it the figures agree to their last
    # digit.
    lift = float(FLAT.lift[-1](np.radians([-0.106]))[0])
    tip = 3 * lift * 1.419 * (61.5 - 60.1333) / 2 * OPENFAST_RATIO**2 / (np.pi * 63**2)
    np.testing.assert_allclose(ours + tip, OPENFAST_THRUST, atol=0.0011)


@pytest.mark.parametrize("pitch", [0.0, 0.1])
@pytest.mark.parametrize("ratio", [4.0, 7.55, 11.0])
def test_the_induced_flow_is_that_of_the_textbook_iteration(ratio, pitch):
    # Axial and tangential induction by fixed-point iteration: Buhl, NREL/TP-500-36834 (2005), equations 1 to
    # 4 and 18
    r, half = FLAT.radius, 1.5
    solidity = 3 * FLAT.chord / (2 * np.pi * r)
    a, b = np.full_like(r, 0.2), np.zeros_like(r)
    for _ in range(800):
        phi = np.arctan2(1 - a, ratio * r / 63 * (1 + b))
        s, c = np.sin(phi), np.cos(phi)
        lift = np.array([f(x) for f, x in zip(FLAT.lift, phi - FLAT.twist - pitch, strict=True)])
        loss = (2 / np.pi) ** 2 * np.arccos(np.exp(-half * (63 - r) / (r * s)))
        loss = loss * np.arccos(np.exp(-half * (r - 1.5) / (1.5 * s)))
        thrust = solidity * (1 - a) ** 2 * lift * c / s**2
        momentum = 1 / (1 + 4 * loss * s**2 / (solidity * lift * c + 1e-300))
        root = np.sqrt(np.maximum(thrust * (50 - 36 * loss) + 12 * loss * (3 * loss - 4), 0))
        heavy = (18 * loss - 20 - 3 * root) / (36 * loss - 50)
        a = 0.8 * a + 0.2 * np.where(thrust > 0.96 * loss, heavy, momentum)
        swirl = solidity * lift / (4 * loss * c)
        b = 0.8 * b + 0.2 * swirl / (1 - swirl)
    angle = inflow_angle(FLAT, np.ones((1, r.size)), ratio * r[None] / 63, np.full((1, 1), pitch))[0]
    np.testing.assert_allclose(angle, phi, atol=1e-9)


def test_a_blade_that_moves_downwind_as_a_whole_sees_less_wind():
    blade = with_shapes(FLAT, (1, 0, 0, 0))
    for f in (-0.3, 0.05, 0.2):
        direct = rotor_loads(blade, RATIO, 0.0, flap=f)
        np.testing.assert_allclose(
            direct, (1 - f) ** 2 * rotor_loads(blade, RATIO / (1 - f), 0.0), atol=1e-11
        )


@pytest.mark.parametrize("blade", [FLAT, CONED], ids=["flat", "coned"])
def test_shear_is_a_flap_mode_that_grows_with_the_radius(blade):
    cos = np.cos(blade.cone)
    mode = with_shapes(blade, (blade.radius / blade.rotor_radius * cos, 0, 0, 0))
    np.testing.assert_allclose(
        rotor_loads(mode, RATIO, 0.0, kappa=0.1), rotor_loads(mode, RATIO, 0.0, flap=-0.1), atol=1e-11
    )


@pytest.mark.parametrize("blade", [FLAT, CONED], ids=["flat", "coned"])
def test_an_edge_mode_that_grows_with_the_radius_slows_the_rotor(blade):
    mode = with_shapes(blade, (0, 0, 0, blade.radius / blade.rotor_radius * np.cos(blade.cone)))
    np.testing.assert_allclose(
        rotor_loads(mode, RATIO, 0.0, edge=0.3), rotor_loads(mode, RATIO - 0.3, 0.0), atol=1e-11
    )


def test_air_along_e2_is_an_edge_velocity_against_it():
    mode = with_shapes(FLAT, (0, 0, 0, 1))
    np.testing.assert_allclose(
        rotor_loads(mode, RATIO, 0.1, y=0.05, edge=0.0)[:4],
        rotor_loads(with_shapes(FLAT, (0, 0, -np.sin(0.1), np.cos(0.1))), RATIO, 0.1, edge=-0.05)[:4],
        atol=1e-11,
    )


def test_pitch_turns_the_modes_with_the_blade():
    # In axes turned by the pitch, (cos, sin) is the pure out-of-plane motion of the first identity.
    blade = with_shapes(FLAT, (np.cos(0.2), np.sin(0.2), 0, 0))
    direct = rotor_loads(blade, RATIO, 0.2, flap=0.1)
    np.testing.assert_allclose(direct[:4], 0.81 * rotor_loads(FLAT, RATIO / 0.9, 0.2)[:4], atol=1e-11)


def test_generalised_forces_are_the_virtual_work_of_the_loads():
    out = with_shapes(FLAT, (1, 0, FLAT.radius / 63.0, 0), (1, 0, "r", 0))
    values = rotor_loads(out, RATIO, 0.0)
    np.testing.assert_allclose(load(values, "flap"), load(values, "thrust"), rtol=1e-12)
    np.testing.assert_allclose(load(values, "edge"), load(values, "bending"), rtol=1e-12)
    across = with_shapes(FLAT, (0, 1, 0, FLAT.radius / 63.0), (0, 1, 0, "r"))
    values = rotor_loads(across, RATIO, 0.0)
    np.testing.assert_allclose(load(values, "flap"), -load(values, "tangential"), rtol=1e-12)
    np.testing.assert_allclose(load(values, "edge"), -load(values, "torque"), rtol=1e-12)


def test_a_load_that_is_linear_along_the_blade_is_integrated_exactly():
    # the load r (zero at the ends only by the last intervals): integral of the hats times r against the
    # grid's own
    inner = FLAT.radius
    radius = np.concatenate([[1.5], inner, [63.0]])
    values = np.concatenate([[0.0], inner, [0.0]])
    exact = np.sum(np.diff(radius) * (values[1:] + values[:-1]) / 2)
    assert FLAT.weights[0] @ inner == pytest.approx(exact, rel=1e-6)
    third = np.diff(radius) / 6
    moment = np.sum(
        third * (radius[:-1] * (2 * values[:-1] + values[1:]) + radius[1:] * (values[:-1] + 2 * values[1:]))
    )
    assert FLAT.weights[1] @ inner == pytest.approx(moment, rel=1e-6)


@pytest.mark.parametrize("pitch_deg", [-5.0, -2.0, 0.0, 10.0, 30.0])
def test_loads_have_no_jump_over_the_tip_speed_ratio(pitch_deg):
    ratio = np.arange(0.5, 15.0, 0.005)
    values = rotor_loads(CONED, ratio, np.radians(pitch_deg))
    assert np.isfinite(values).all()
    # the steepest honest slope is below 2 per unit of tip-speed ratio
    assert np.abs(np.diff(values, axis=1)).max() < 0.015


@settings(max_examples=60, deadline=None)
@given(st.floats(0.5, 15.0), st.floats(-5.0, 30.0))
def test_no_rotor_beats_betz(ratio, pitch_deg):
    assert float(power_coefficient(FLAT, ratio, np.radians(pitch_deg))) < 16 / 27


def test_arguments_broadcast_and_a_table_row_is_the_single_values():
    table = rotor_loads(CONED, RATIO[:, None], np.array([0.0, 0.1]), kappa=0.02)
    assert table.shape == (6, 6, 2)
    np.testing.assert_allclose(table[:, 3, 1], rotor_loads(CONED, RATIO[3], 0.1, kappa=0.02), rtol=1e-12)


@pytest.mark.skipif(
    not CADYNTURB.exists(), reason="CADynTurb's tables are in ../shared/data, which is not here"
)
def test_tables_are_cadynturbs_at_pitch_0():
    # CADynTurb: torque and thrust of the rotor, flap force of one blade; its thrust has OpenFAST's tip
    # station too (see above), and its flap mode comes from another beam program: derivatives agree to some
    # per cent.
    data = json.loads(CADYNTURB.read_text())
    theirs = {name: np.array(values) for name, values in data["tables_at_pitch_0"].items()}
    ratio = np.array(data["tip_speed_ratio"])
    at = ratio >= 6
    ours = dict(zip(table_names(True), load_coefficients(CONED, ratio, np.zeros_like(ratio)), strict=True))
    for name, theirs_name, factor, allowed in (
        ("torque", "cm_lut", 1, 0.006),
        ("thrust", "ct_lut", 1, 0.02),
        ("flap", "cf_lut", 1 / 3, 0.035),
        ("thrust_flap", "dct_dvf_v_lut", 1, 0.03),
        ("torque_flap", "dcm_dvf_v_lut", 1, 0.03),
        ("thrust_edge", "dct_dve_v_lut", 1, 0.05),
        ("torque_edge", "dcm_dve_v_lut", 1, 0.08),
        ("flap_flap", "dcf_dvf_v_lut", 1 / 3, 0.03),
        ("tangential_y", "dcs_dvy_v_lut", -1 / 3, 0.10),
    ):
        stalled = 6.5 if name == "tangential_y" else 0.0  # changes its sign at 6
        use = at & (ratio > stalled)
        np.testing.assert_allclose(
            ours[name][use] * factor, theirs[theirs_name][use], rtol=allowed, err_msg=name
        )


@pytest.mark.parametrize("name", ["nrel5mw", "t2b1i1cg"])
def test_the_committed_tables_are_those_of_the_committed_inputs(name):
    parameters = PARAMETERS[name]
    path = DATA / parameters["aerodynamics"]["tables"]
    blade, inputs = table_builder.turbine_blade(parameters)
    with np.load(path) as data:
        assert str(data["inputs"]) == inputs, "run `python tools/build_aero_tables.py`"
        stored = data["coefficients"]
        skewed = table_builder.has_skewed_wake(parameters)
        np.testing.assert_array_equal(data["names"], table_builder.table_names(skewed))
    assert set(table_names(True)) == set(TABLES)
    i, j = np.random.default_rng(1).integers(0, [[len(TIP_SPEED_RATIO)], [len(PITCH_DEG)]], (2, 40))
    again = load_coefficients(blade, TIP_SPEED_RATIO[i], np.radians(PITCH_DEG[j]), skewed)
    np.testing.assert_allclose(again, stored[:, i, j], rtol=1e-7, atol=1e-9)


def test_the_hash_of_the_inputs_sees_what_the_tables_depend_on_and_nothing_else():
    def changed(*keys, value):
        parameters = copy.deepcopy(PARAMETERS["nrel5mw"])
        place = parameters
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = value
        return table_builder.inputs_hash(parameters, AIRFOILS)

    before = table_builder.inputs_hash(PARAMETERS["nrel5mw"], AIRFOILS)
    assert changed("hub", "mass", value=1.0) == before
    assert changed("aerodynamics", "tables", value="x.npz") == before
    assert changed("geometry", "precone_deg", value=-2.4) != before
    assert changed("aerodynamics", "stations", "rows", 3, 1, value=4.0) != before
    assert changed("aerodynamics", "polar_smoothing_deg", value=0.5) != before


@pytest.mark.parametrize(("pitch_deg", "allowed"), [(0.0, 0.001), (2.25, 0.003), (12.5, 0.003)])
def test_splines_through_the_tables_are_the_loads_between_the_nodes(pitch_deg, allowed):
    from scipy.interpolate import CubicSpline

    names = ("thrust", "torque", "flap")
    values = read_tables(DATA / "nrel5mw_aero.npz", "cubic").at_pitch(np.radians(pitch_deg), names)
    ratio = np.linspace(4.0, 12.0, 801)
    spline = CubicSpline(TIP_SPEED_RATIO, values)(ratio)
    direct = np.stack(
        [load(rotor_loads(CONED, ratio, np.radians(pitch_deg)), name) for name in names], axis=1
    )
    # of the value at the design point, as a load passes through zero at high pitch
    design = [abs(load(rotor_loads(CONED, 7.55, 0.0), name)) for name in names]
    assert (np.abs(spline - direct) / design).max() < allowed


def test_the_derivatives_barely_depend_on_their_steps_where_the_blade_does_not_stall(monkeypatch):
    ratio = np.linspace(7.0, 14.0, 29)
    tables = load_coefficients(CONED, ratio, np.zeros_like(ratio))
    monkeypatch.setattr(table_builder, "STEPS", {k: v / 10 for k, v in table_builder.STEPS.items()})
    fine = load_coefficients(CONED, ratio, np.zeros_like(ratio))
    assert (np.abs(tables - fine).max(axis=1) / np.abs(fine).max(axis=1)).max() < 0.04


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"rows": [[0, 1, 0, "naca64-a17"], [61.5, 1, 0, "naca63"]]},
            "no polar of airfoil 'naca63'; did you mean",
        ),
        ({"rows": [[0, 1, 0, "naca64-a17"], [60, 1, 0, "naca64-a17"]]}, "span must rise from 0 at the root"),
    ],
)
def test_stations_that_make_no_blade_are_refused(change, words):
    parameters = copy.deepcopy(PARAMETERS["nrel5mw"])
    parameters["aerodynamics"]["stations"].update(change)
    with pytest.raises(InputError, match=words):
        blade_aerodynamics(parameters, AIRFOILS, blade_modes(parameters))


@pytest.mark.parametrize(
    ("points", "words"),
    [([[0, 1, 0], [-1, 1, 0]], "rows of rising"), ([[-90, 0, 0], [90, 0, 0]], "-180 to 180")],
)
def test_a_polar_that_does_not_go_round_is_refused(points, words):
    airfoils = {"airfoils": {**AIRFOILS["airfoils"], "du40-a17": points}}
    with pytest.raises(InputError, match=f"'du40-a17': .*{words}"):
        blade_aerodynamics(PARAMETERS["nrel5mw"], airfoils, blade_modes(PARAMETERS["nrel5mw"]))


def with_shapes(blade, shapes, weights=None):
    """The blade with other shapes at its stations, and with the integrals of those given (1, "r" or 0)."""
    columns = np.stack([np.broadcast_to(np.asarray(s, float), blade.radius.shape) for s in shapes], axis=1)
    changed = dataclasses.replace(blade, shapes=columns)
    if weights is None:
        return changed
    rows = {1: blade.weights[0], "r": blade.weights[1] / blade.rotor_radius, 0: 0 * blade.weights[0]}
    return dataclasses.replace(changed, weights=np.stack([*blade.weights[:2], *(rows[w] for w in weights)]))


def test_the_leaning_wake_takes_load_from_the_lee_side_as_glauerts_formula_says():
    # a (1 + 15 pi/64 (1 + 0.6 a) r/R skew): at small skew the thrust changes by its slope in the axial speed times that change
    ratio, size = np.array([7.0]), 1e-4
    lee, luff, none = (rotor_loads(FLAT, ratio, np.zeros(1), skew=k)[0, 0] for k in (size, -size, 0.0))
    assert lee < none < luff
    assert (lee - none) / (none - luff) == pytest.approx(1.0, rel=1e-2)
    # induction is near 1/3 on the outer blade, so the axial speed 2/3 falls by 15 pi/64 * 1.2 * 0.75 / 3 per unit of skew there
    change = 15 * np.pi / 64 * 1.2 / 3 * 0.75 / (2 / 3)
    slope = (lee - luff) / (2 * size) / none
    assert -2.0 * change < slope < -0.5 * change
