"""Sections along tower and blade carry what lies beyond them: base and root are their first, tip and top their last."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from independent_model import IndependentModel, rot_x, rot_y

import fatigue_runner as fr
from fatigue_runner.channels import BY_NAME, channel_name, placed, sections
from fatigue_runner.errors import InputError
from fatigue_runner.layout import HARMONICS, WIND
from fatigue_runner.turbine.beam import blade_modes, tower_modes
from fatigue_runner.turbine.section_loads import SectionLoads

ROOT, TIP, TOP = 1.5, 63.0, 87.6
HEIGHTS, RADII = (0.0, 20.0, 50.0, TOP), (ROOT, 20.0, 41.0, TIP)


@pytest.fixture(scope="module")
def nrel5mw(nrel5mw):
    """With its tables at every 2.5 degrees only: blade elements for all would take most of the time."""
    kept = [
        i
        for i, pitch in enumerate(np.degrees(nrel5mw.tables.pitch))
        if abs(pitch % 2.5) < 1e-6 and pitch < 26
    ]
    tables = {name: values[:, kept] for name, values in nrel5mw.tables.coefficients.items()}
    fewer = dataclasses.replace(nrel5mw.tables, pitch=nrel5mw.tables.pitch[kept], coefficients=tables)
    return dataclasses.replace(nrel5mw, tables=fewer)


@pytest.fixture(scope="module")
def made(nrel5mw):
    return SectionLoads.of_turbine(nrel5mw, HEIGHTS, RADII)


def swaying(turbine, wind, count=40):
    """States about the operating point, in which everything moves as much as in operation."""
    rng = np.random.default_rng(1)
    layout, point = turbine.layout, turbine.operating_point(wind)
    extent = np.zeros(layout.size)
    extent[: layout.rotor] = 0.3
    extent[layout.freedoms : layout.freedoms + layout.rotor] = 0.3
    states = point + extent * rng.normal(size=(count, layout.size))
    states[:, layout.rotor] = np.linspace(0.0, 6.0, count)
    states[:, layout.generator] = point[layout.generator] + turbine.gearbox_ratio * (
        states[:, layout.rotor] - point[layout.rotor]
    )
    return states


@pytest.mark.parametrize("operation, speed", [("fixed", 8.0), ("controlled", 17.0)])
def test_the_section_at_the_foot_is_the_base_and_that_at_the_root_is_the_root(
    nrel5mw, made, operation, speed
):
    turbine = nrel5mw.operated(operation)
    states = swaying(turbine, speed)
    signals = WIND if operation == "fixed" else (*WIND, *HARMONICS[:6])
    rng = np.random.default_rng(2)
    wind = np.column_stack([rng.normal(x, 0.1, len(states)) for x in (speed, 0.15, -0.05, *[0.0] * 6)])
    wind = wind[:, : len(signals)]
    loads = turbine.loads(states, wind, 0.0, signals)
    found = made.of(turbine, states, wind, loads, 0.0, signals)
    for section, channel in {
        "tower_0m_fore_aft_moment": "tower_base_fore_aft_moment",
        "tower_0m_side_side_moment": "tower_base_side_side_moment",
        "blade1_1.5m_flapwise_moment": "blade1_root_flapwise_moment",
        "blade1_1.5m_edgewise_moment": "blade1_root_edgewise_moment",
    }.items():
        assert np.ptp(loads[channel]) > 1e6
        np.testing.assert_allclose(
            found[section], loads[channel], rtol=0, atol=1e-10 * np.abs(loads[channel]).max()
        )
    tip = [abs(found[f"blade1_63m_{way}_moment"]).max() for way in ("flapwise", "edgewise")]
    assert max(tip) < 1e-6  # N m: nothing lies beyond the tip


def test_a_bend_grows_from_tip_to_root_and_from_top_to_foot_by_the_thrust(nrel5mw, made):
    """In steady wind a tower carries the thrust by its lever, and next to nothing else grows along it."""
    states = nrel5mw.revolution(8.0)
    wind = np.tile([8.0, 0.0, 0.0], (len(states), 1))
    loads = nrel5mw.loads(states, wind)
    mean = {name: series.mean() for name, series in made.of(nrel5mw, states, wind, loads).items()}
    tower = [mean[f"tower_{h:g}m_fore_aft_moment"] for h in HEIGHTS]
    slopes = np.diff(tower) / np.diff(HEIGHTS)
    tilt = np.radians(5.0)
    # less what the weight of the rotor bends where the tower leans: 4 % of it here
    np.testing.assert_allclose(-slopes, loads["rotor_thrust"].mean() * np.cos(tilt), rtol=0.05)
    for way in ("flapwise", "edgewise"):
        blade = np.abs([mean[f"blade1_{r:g}m_{way}_moment"] for r in RADII])
        assert np.all(np.diff(blade) < 0)


@pytest.fixture(scope="module")
def airless(nrel5mw):
    """The turbine in a vacuum: what is left is inertia and weight, of points that can be followed one by one."""
    return dataclasses.replace(nrel5mw, parameters={**nrel5mw.parameters, "q_area": 0.0})


class Points:
    """Positions (m, 3) of the mass points of a blade, a tower and what stands on it, from rotations alone."""

    def __init__(self, turbine):
        self.model, self.p = IndependentModel(turbine.parameters), turbine.parameters
        self.blade, self.tower = blade_modes(turbine.content), tower_modes(turbine.content)

    def axes(self, q, number):
        _, _, apex, rotor = self.model.frames(q)
        return apex, rotor @ rot_x(2 * np.pi / 3 * (number - 1)) @ rot_y(self.model.cone)

    def of_blade(self, q, number, a):
        """a: (m, 9) functions of `beam.INTEGRAND_NAMES` at the points."""
        apex, axes = self.axes(q, number)
        f, e = q[1 + number], q[5]
        along = a[:, 1] - (a[:, 6] * f**2 + 2 * a[:, 7] * f * e + a[:, 8] * e**2) / 2
        local = np.stack([a[:, 2] * f + a[:, 4] * e, a[:, 3] * f + a[:, 5] * e, along], axis=1)
        return apex + local @ axes.T

    def of_tower(self, q, z):
        fore, side = self.tower.fore_aft, self.tower.side_side
        sunk = np.array(
            [(fore.shortening_at(h) * q[0] ** 2 + side.shortening_at(h) * q[1] ** 2) / 2 for h in z]
        )
        return np.stack([fore.shape_at(z) * q[0], side.shape_at(z) * q[1], z - sunk], axis=1)

    def above(self, q):
        """Masses and positions of nacelle, hub and all blade elements."""
        p = self.p
        top, nacelle, apex, _ = self.model.frames(q)
        masses, a = self.blade.elements
        blades = [self.of_blade(q, number, a) for number in (1, 2, 3)]
        points = [(top + nacelle @ np.array([p["n_x"], p["n_y"], p["n_z"]]))[None], apex[None], *blades]
        return np.concatenate([[p["n_m"], p["h_m"]], *[masses] * 3]), np.concatenate(points)


def accelerated(position, q, v, acc, d=1e-4):
    """Second derivative of positions along the motion, by central differences."""
    at = [position(q + v * t + acc * t * t / 2) for t in (-d, 0.0, d)]
    return (at[0] - 2 * at[1] + at[2]) / d**2


def test_sections_are_in_equilibrium_with_every_mass_point_beyond_them(nrel5mw, airless, made):
    """Newton's law for each lumped mass, with kinematics that share nothing with the derivation's; the model drops terms of third order."""
    points, gravity = Points(airless), np.array([0.0, 0.0, -airless.parameters["gravity"]])
    states = swaying(nrel5mw, 8.0, 6)
    deflections = [*range(airless.layout.rotor), *range(airless.layout.freedoms, airless.layout.rotor_speed)]
    rng = np.random.default_rng(3)
    states[:, deflections] = 0.1 * rng.normal(
        size=(len(states), len(deflections))
    )  # there is no wind to lean on
    wind = np.tile([8.0, 0.0, 0.0], (len(states), 1))
    found = made.of(airless, states, wind, airless.loads(states, wind))
    slopes = airless.derivative(states, wind)
    n = airless.layout.freedoms
    for i, state in enumerate(states):
        q, v, acc = state[:n], state[n:], slopes[i, n:]
        masses, a = points.blade.elements
        for radius in (20.0, 41.0):
            outer = a[:, 1] > radius
            here = np.array([[1.0, radius, *points.blade.flap_at(np.array(radius)), *points.blade.edge_at(np.array(radius)),
                              *(np.interp(radius, points.blade.grid, s) for s in points.blade.shortening.T)]])  # fmt: skip
            moving = accelerated(lambda x, of=a[outer]: points.of_blade(x, 1, of), q, v, acc)
            arm = points.of_blade(q, 1, a[outer]) - points.of_blade(q, 1, here)
            moment = np.cross(arm, masses[outer, None] * (gravity - moving)).sum(axis=0)
            edgewise, flapwise, _ = points.axes(q, 1)[1].T @ moment
            assert found[f"blade1_{radius:g}m_flapwise_moment"][i] == pytest.approx(
                flapwise, rel=1e-3, abs=30
            )
            assert found[f"blade1_{radius:g}m_edgewise_moment"][i] == pytest.approx(
                edgewise, rel=1e-3, abs=30
            )
        mass = points.above(q)[0][:, None]
        push = (mass * (gravity - accelerated(lambda x: points.above(x)[1], q, v, acc))).sum(axis=0)
        z, masses = points.tower.elements
        top = points.of_tower(q, np.array([TOP]))[0]
        at_top = np.array([found[f"tower_{TOP:g}m_{way}_moment"][i] for way in ("side_side", "fore_aft")])
        for height in (0.0, 20.0, 50.0):
            higher = z > height
            place = points.of_tower(q, np.array([height]))[0]
            moving = accelerated(lambda x, of=z[higher]: points.of_tower(x, of), q, v, acc)
            weights = masses[higher, None] * (gravity - moving)
            moment = np.cross(top - place, push) + np.cross(
                points.of_tower(q, z[higher]) - place, weights
            ).sum(axis=0)
            ours = [found[f"tower_{height:g}m_{way}_moment"][i] for way in ("side_side", "fore_aft")]
            np.testing.assert_allclose(ours, at_top + moment[:2], rtol=1e-3, atol=300)


def test_the_root_by_direction_is_flapwise_at_0_and_edgewise_at_90_degrees(nrel5mw):
    loads = {
        "blade1_root_flapwise_moment": np.array([3.0, 1.0]),
        "blade1_root_edgewise_moment": np.array([4.0, -2.0]),
    }
    found = SectionLoads.of_turbine(nrel5mw, directions=12).of(
        nrel5mw, np.zeros((2, 16)), np.zeros((2, 3)), loads
    )
    assert len(found) == 12
    np.testing.assert_allclose(found["blade1_root_moment_0deg"], [3.0, 1.0])
    np.testing.assert_allclose(found["blade1_root_moment_90deg"], [4.0, -2.0], atol=1e-15)
    largest = np.max([series[0] for series in found.values()])
    assert 5.0 * np.cos(np.radians(7.5)) <= largest <= 5.0


@pytest.mark.parametrize(
    "places, said",
    [
        ({"tower_heights": [90]}, "tower_heights: 90 m is not on it: the tower reaches from 0 at its foot to 87.6 m at its top"),
        ({"blade_radii": [1.0]}, "blade_radii: 1 m is not on it: blade 1 reaches from 1.5 m at its root to 63 m at its tip"),
        ({"root_directions": -1}, "root_directions must be 0 or more, got -1"),
    ],
)  # fmt: skip
def test_a_place_off_the_turbine_is_refused(nrel5mw, places, said):
    trajectory = fr.simulate(nrel5mw, 8.0, step=0.1, duration=1.0)
    with pytest.raises(InputError, match=said):
        fr.section_loads(nrel5mw, trajectory, **places)
    with pytest.raises(InputError, match="give the turbine and the operation that it was simulated with"):
        fr.section_loads(nrel5mw, trajectory, root_directions=4, operation="controlled")


def test_a_turbine_of_finished_tables_has_no_sections(nrel5mw):
    bare = dataclasses.replace(nrel5mw, content=None)
    with pytest.raises(InputError, match="gives no blade elements"):
        SectionLoads.of_turbine(bare, tower_heights=[10.0])


def test_sections_are_known_by_their_names_and_by_openfasts_gauges():
    channels = sections([0, 38.8], [1.5, 20], 2)
    assert [c.name for c in channels] == [
        "tower_0m_fore_aft_moment", "tower_0m_side_side_moment", "tower_38.8m_fore_aft_moment", "tower_38.8m_side_side_moment",
        "blade1_1.5m_flapwise_moment", "blade1_1.5m_edgewise_moment", "blade1_20m_flapwise_moment", "blade1_20m_edgewise_moment",
        "blade1_root_moment_0deg", "blade1_root_moment_90deg",
    ]  # fmt: skip
    names = [c.name for c in channels]
    assert all(BY_NAME[c.name] == c and c.name in BY_NAME and placed(c.name) for c in channels)
    assert "tower_xm_fore_aft_moment" not in BY_NAME and "blade1_root_flapwise_moment" in BY_NAME
    assert [channel_name(n, names) for n in ("TwHt1MLyt", "twht2mlxt", "Spn2MLyb1", "Spn1MLxb1", "TwHt3MLyt")] == [
        "tower_0m_fore_aft_moment", "tower_38.8m_side_side_moment", "blade1_20m_flapwise_moment", "blade1_1.5m_edgewise_moment",
        "TwHt3MLyt",
    ]  # fmt: skip
