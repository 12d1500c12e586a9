"""Parts that other turbines have: a shaft that does not twist, a gearbox that loses, masses off their axes, a bent blade."""

from __future__ import annotations

from math import cos, radians

import numpy as np
import pytest

from fatigue_runner.api import simulate
from fatigue_runner.errors import InputError
from fatigue_runner.turbine import load_turbine
from fatigue_runner.turbine.aerodynamics import blade_aerodynamics, rotor_loads
from fatigue_runner.turbine.beam import blade_modes, tower_modes
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.turbine.finite_elements import with_modes
from fatigue_runner.turbine.table_builder import _airfoils


def changed(**sections):
    """The 5-MW's file with other entries, its tables as they are."""
    data = read_turbine_file("nrel5mw")
    return load_turbine(data | {name: {**data[name], **entries} for name, entries in sections.items()})


def mean_fore_aft(turbine):
    """Moment at the tower base in steady operation at 8 m/s."""
    azimuths = np.arange(24) * 2 * np.pi / 24
    states = np.array([turbine.operating_point(8.0, azimuth=a) for a in azimuths])
    loads = turbine.loads(states, np.tile([8.0, 0.0, 0.0], (len(azimuths), 1)))
    return float(loads["tower_base_fore_aft_moment"].mean())


def test_a_gearbox_that_loses_takes_more_torque_from_the_rotor():
    turbine = changed(drivetrain={"gearbox_efficiency": 0.95})
    state = turbine.operating_point(8.0)[None]
    loads = turbine.loads(state, np.array([[8.0, 0.0, 0.0]]))
    assert loads["low_speed_shaft_torque"] == pytest.approx(97 / 0.95 * loads["generator_torque"], rel=1e-6)
    assert turbine.hash != load_turbine("nrel5mw").hash


def test_a_lossless_flexible_turbine_keeps_its_hash():
    assert (
        changed(drivetrain={"gearbox_efficiency": 1.0, "shaft": "flexible"}).hash
        == load_turbine("nrel5mw").hash
    )


def direct_drive(shaft):
    """The 5-MW with a generator on its shaft, as stiff as that of the IEA-15 MW: torsion at 26 Hz."""
    data = read_turbine_file("nrel5mw")
    drive = {
        "shaft": shaft,
        "gearbox_ratio": 1.0,
        "generator_inertia": 5.0e5,
        "torsional_stiffness": 1.3e10,
        "torsional_damping": 5e6,
    }
    generator = {"law": "optimal", "optimal_gain": 2.332287 * 97**3}
    return load_turbine(
        data | {"drivetrain": data["drivetrain"] | drive, "generator": data["generator"] | generator}
    )


def test_a_rigid_shaft_is_a_stiff_one_without_its_torsion():
    flexible, rigid = direct_drive("flexible"), direct_drive("rigid")
    found = {name: f for name, f, _ in rigid.natural_frequencies(8.0)}
    stiff = {name: f for name, f, _ in flexible.natural_frequencies(8.0)}
    torsion = stiff.pop("drivetrain and collective edge 2")
    assert 20 < torsion < 40
    stiff["drivetrain and collective edge"] = stiff.pop("drivetrain and collective edge 1")
    assert found == {name: pytest.approx(f, rel=0.01) for name, f in stiff.items()}


def test_a_rigid_shaft_takes_steps_that_tear_a_stiff_one_and_gives_its_loads():
    rigid, flexible = direct_drive("rigid"), direct_drive("flexible")
    wind = {"wind": 8.0, "duration": 20.0, "output_step": 0.05}
    start = rigid.operating_point(8.0)
    start[rigid.layout.rotor_speed] *= 1.02
    start[rigid.layout.generator_speed] *= 1.02
    coarse = simulate(rigid, method="rk4", step=0.05, initial=start, **wind)
    assert simulate(flexible, method="rk4", step=0.05, initial=start, **wind).diverged_at is not None
    fine = simulate(flexible, method="rk4", step=0.002, initial=start, **wind)
    late = slice(40, None)  # the stiff one's first shake is over
    for name in (
        "low_speed_shaft_torque",
        "tower_base_side_side_moment",
        "blade1_root_edgewise_moment",
        "generator_torque",
    ):
        a, b = coarse.loads[name][late], fine.loads[name][late]
        assert np.abs(a - b).max() < 0.01 * np.abs(b).max(), name
    twist = coarse.state[:, rigid.layout.generator] - coarse.state[:, rigid.layout.rotor]
    assert np.ptp(twist) < 1e-10


def test_a_hub_mass_off_the_apex_bends_the_tower_by_its_lever():
    moved = mean_fore_aft(changed(hub={"centre_of_mass": -0.8})) - mean_fore_aft(changed())
    # 0.8 m further upwind; the tower gives way and the weight on it goes with it, some per cent
    assert moved == pytest.approx(-56780.0 * 9.80665 * 0.8 * cos(radians(5.0)), rel=0.06)


def test_the_yaw_bearing_s_mass_stands_on_the_tower():
    heavier = changed(nacelle={"yaw_bearing_mass": 20000.0})
    assert heavier.parameters["n_m"] == 260000.0
    assert heavier.parameters["n_x"] == pytest.approx(1.9 * 240 / 260)
    # its weight stands over the tower's foot, but leans with the top
    assert mean_fore_aft(heavier) == pytest.approx(mean_fore_aft(changed()), rel=0.01)


def test_a_tower_that_begins_above_ground_is_shorter_and_its_hub_as_high():
    turbine = changed(geometry={"tower_base_height": 10.0})
    assert turbine.parameters["t_h"] == pytest.approx(77.6)
    assert turbine.hub_height == pytest.approx(load_turbine("nrel5mw").hub_height)
    assert turbine.rotor.hub_height == pytest.approx(90.0, abs=0.01)


def test_a_tip_mass_adds_its_moments():
    data = read_turbine_file("nrel5mw")
    blade = blade_modes(data | {"blade": data["blade"] | {"tip_mass": 100.0}})
    plain = blade_modes(data)
    assert blade.mass == pytest.approx(plain.mass + 100)
    assert blade.second_moment == pytest.approx(plain.second_moment + 100 * 61.5**2)


def test_constant_torque_above_rated():
    from fatigue_runner.turbine.parameters import generator_law

    regions = {
        "region_3_speed_rpm": 1161.963,
        "slip_percent": 10.0,
        "rated_torque": 43000.0,
        "blend_torque": 0.0,
    }
    law = generator_law({"law": "regions", "optimal_gain": 2.33, "regions": regions})
    speed = 1161.963 * np.pi / 30
    assert law["tg_a2"] * (speed - law["tg_ws"]) == pytest.approx(43000.0)
    assert (law["tg_p"], law["tg_t"]) == (0.0, 43000.0)


def test_modes_that_are_not_given_are_those_of_the_beam():
    data = read_turbine_file("nrel5mw")
    bare = {
        member: {k: v for k, v in data[member].items() if not k.endswith("_mode")}
        for member in ("blade", "tower")
    }
    found = with_modes(data | bare)
    blade, given = blade_modes(found), blade_modes(data)
    # the report's own modes are those of the same beam
    assert blade.flap_frequency == pytest.approx(given.flap_frequency, rel=5e-3)
    assert blade.edge_frequency == pytest.approx(given.edge_frequency, rel=5e-3)
    assert tower_modes(found).fore_aft.frequency == pytest.approx(
        tower_modes(data).fore_aft.frequency, rel=0.06
    )
    assert sum(found["blade"]["flap_mode"]) == pytest.approx(1.0, abs=1e-5)


def bent(prebend, cone=0.0):
    """The 5-MW's blade, `prebend`(span fraction) [m] off its axis."""
    data = read_turbine_file("nrel5mw")
    table = data["aerodynamics"]["stations"]
    rows = [[*row, prebend(row[0] / 61.5)] for row in table["rows"]]
    stations = {"columns": [*table["columns"], "prebend"], "rows": rows}
    data = data | {
        "geometry": data["geometry"] | {"precone_deg": cone},
        "aerodynamics": data["aerodynamics"] | {"stations": stations},
    }
    return blade_aerodynamics(data, _airfoils(data), blade_modes(data))


def test_a_blade_that_is_bent_in_a_line_is_a_coned_one():
    cone = -2.5
    slope = np.tan(radians(cone))
    # from the apex on, so that the lines are the same
    line = bent(lambda x: slope * (1.5 + 61.5 * x))
    coned = bent(lambda x: 0.0, cone)
    # 6 loads at two tip-speed ratios; lengths along the axis and along the line differ by 0.1 %
    for ratio in (6.0, 9.0):
        a = rotor_loads(line, ratio * line.rotor_radius / coned.rotor_radius, 0.0)
        b = rotor_loads(coned, ratio, 0.0)
        thrust, power = (0, np.cos(radians(cone))), (2, np.cos(radians(cone)))
        for row, factor in (thrust, power):
            scale = (line.rotor_radius / coned.rotor_radius) ** (2 if row == 0 else 3)
            assert scale * a[row] == pytest.approx(factor * b[row], rel=3e-3)


CONTRADICTIONS = {
    "twist in radians": (
        "blade:\n  stations:\n    columns: [span_fraction, structural_twist_deg, mass_density, flap_stiffness, edge_stiffness]\n"
        "    rows: [[0, 0.23, 700, 2e10, 2e10], [1, 0, 10, 1e6, 5e6]]\n",
        "mine.yaml:4: structural_twist_deg is at most 0.23 deg, which looks like radians (13.2 deg would be usual at the root)",
    ),
    "tower shorter than the hub": ("geometry: {tower_height: 60, tower_top_to_shaft: 30}\n", "the tower is shorter than the hub is high"),
    "blades in the ground": ("geometry: {tower_height: 55}\n", "the tower is too short: the hub is 57.4 m above ground and"),
    "diameters of another tower": ("tower:\n  diameters: [[0, 6], [120, 3]]\n", "the diameters go up to 120 m, the tower ends at 87.6 m"),
    "a blade heavier than its inertia says": (
        "published:\n  rotor_inertia: 30e6\n",
        "mine.yaml:4: the rotor inertia of the tables is 3.87",
    ),
    "a blade heavier than published": ("published: {blade_mass: 16000}\nblade: {mass_factor: 1.2}\n", "the blade mass of the tables is"),
    "power and torque": ("generator: {regions: {rated_torque: 43000}}\n", "needs rated_mechanical_power (constant power above rated) or"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), CONTRADICTIONS.values(), ids=CONTRADICTIONS.keys())
def test_entries_that_contradict_each_other_are_told(tmp_path, text, message):
    path = tmp_path / "mine.yaml"
    path.write_text(f"name: mine\nbase: nrel5mw\n{text}")
    with pytest.raises(InputError) as caught:
        read_turbine_file(str(path))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_published_and_right_passes(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(
        "name: mine\nbase: nrel5mw\npublished: {blade_mass: 17740, rotor_inertia: 38759228, tower_mass: 347460, tolerance: 0.005}\n"
    )
    assert read_turbine_file(str(path))["name"] == "mine"
