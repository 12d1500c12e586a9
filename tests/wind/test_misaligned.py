"""Wind from aside and from below: what of it blows along and across, what the rotor makes of it, and every source that has it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from field_files import write_bts

import fatigue_runner as fr
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.source import Place, Source
from fatigue_runner.rotor import Rotor
from fatigue_runner.turbine import load_turbine
from fatigue_runner.turbine.aerodynamics import LOAD_NAMES, rotor_loads
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.turbine.lanes import evaluate
from fatigue_runner.turbine.table_builder import turbine_blade
from fatigue_runner.wind import MisalignedWind, TowerInfluence, make_wind, stack_cells
from fatigue_runner.wind.fields.projection import RotorPlane
from fatigue_runner.wind.section import Site, wind_section

HEAVY = 1e9  # times the tower's mass: what it is made of, it does not move
PSI = np.arange(48) * 2 * np.pi / 48


def turbine_of(**changed):
    """The 5 MW without weight, on a tower that stands still."""
    plain = load_turbine("nrel5mw")
    p = dict(plain.parameters) | {"gravity": 0.0}
    p |= {name: HEAVY * p[name] for name in ("t_maa", "t_mss")}
    return replace(plain, parameters=p | changed)


def accelerations(turbine, wind, speed=0.95, psi=PSI):
    """q'' (8, n) of the undeflected turbine over the rotor's azimuth, at a rotor speed [rad/s]."""
    layout = turbine.layout
    x = np.zeros((layout.size, len(psi)))
    x[layout.rotor], x[layout.generator] = psi, 97.0 * psi
    x[layout.rotor_speed], x[layout.generator_speed] = speed, 97.0 * speed
    data = turbine.kernel_data(0.0, layout.beyond(wind.channels))
    cells = stack_cells([wind] * len(psi), 1.0, data.model.layout)[1][0, 0]
    return evaluate(data, x, cells)[0][layout.freedoms :]


def mean_loads(turbine, wind, speed):
    """Means over a turn of the shaft's aerodynamic torque [N m] and of the thrust [N] at a held rotor speed [rad/s]."""
    layout = turbine.layout
    x = np.zeros((len(PSI), layout.size))
    x[:, layout.rotor], x[:, layout.generator] = PSI, 97.0 * PSI
    x[:, layout.rotor_speed], x[:, layout.generator_speed] = speed, 97.0 * speed
    signals = wind.at(np.zeros(len(PSI)))
    thrust = turbine.loads(x, signals, 0.0, wind.channels)["rotor_thrust"].mean()
    # no spring, no damper, and no weight: the rotor accelerates by its torque over its inertia
    p = turbine.parameters
    free = replace(turbine, parameters=dict(p) | {"d_k": 0.0, "d_d": 0.0, "b_ke": 0.0, "b_kf": 0.0})
    return accelerations(free, wind, speed)[6].mean(), thrust


# --- what blows along and across


def test_it_turns_as_openfast_turns_a_wind():
    """IfW_FlowField's UniformField_GetVel: V (cos d cos u, -sin d cos u, sin u)."""
    yaw, up = math.radians(12.0), math.radians(-7.0)
    (signals,) = MisalignedWind(fr.ConstantWind(9.0, 0.1, -0.05), yaw, up).at(0.0)
    along = 9 * math.cos(yaw) * math.cos(up)
    assert signals == pytest.approx(
        [along, 0.1, -0.05, -9 * math.sin(yaw) * math.cos(up), 9 * math.sin(up)], rel=1e-12
    )


@pytest.mark.parametrize(
    "wind",
    [
        fr.ConstantWind(8.0, shear_exponent=0.2),
        fr.TurbulentWind(9.0, 0.14, seed=2, duration=20.0),
        fr.TurbulentWind(9.0, 0.14, seed=2, duration=20.0, harmonics=1),
        fr.StepWind([0.0, 5.0], [8.0, 9.0]),
        fr.SeriesWind(1.0, 8.0 + np.sin(np.arange(21.0))),
        fr.GustWind(12.0, "EWSV+", begin=2.0),
    ],
    ids=lambda wind: wind.name,
)
def test_every_source_can_be_turned_and_keeps_its_speed(wind):
    rotor, yaw, up = load_turbine("nrel5mw").rotor, math.radians(20.0), math.radians(8.0)
    turned, plain = MisalignedWind(wind, yaw, up).on(rotor), wind.on(rotor)
    time = np.linspace(0.0, 19.0, 77)
    signals, straight = turned.at(time), plain.at(time)
    assert np.linalg.norm(signals[:, [0, 3, 4]], axis=1) == pytest.approx(straight[:, 0], rel=1e-12)
    assert signals[:, 1:3] == pytest.approx(straight[:, 1:3], rel=1e-12)  # shares of the wind
    assert signals[:, 5:] == pytest.approx(straight[:, 3:] * math.cos(yaw) * math.cos(up), rel=1e-12)
    assert len(turned.channels) == len(plain.channels) + 2 and turned.mean_speed == plain.mean_speed
    assert turned.axial_speed == pytest.approx(plain.mean_speed * math.cos(yaw) * math.cos(up))


def test_a_gust_of_direction_in_misaligned_wind_adds_its_angle():
    gust = fr.GustWind(15.0, "EDC-", begin=1.0)
    turned, angle = MisalignedWind(gust, math.radians(10.0)), math.radians(gust._turn)
    (end,) = turned.at([15.0])
    assert math.atan2(-end[3], end[0]) == pytest.approx(math.radians(10.0) - angle)


def test_angles_that_are_none_or_too_steep_are_refused():
    wind = fr.ConstantWind(8.0)
    with pytest.raises(InputError, match=r"yaw_misalignment must be .*got 8; angles are in radians, such as"):
        MisalignedWind(wind, 8)
    with pytest.raises(InputError, match="upflow must be a number"):
        MisalignedWind(wind, 0.1, math.nan)
    with pytest.raises(InputError, match="turned twice"):
        MisalignedWind(MisalignedWind(wind, 0.1), 0.1)
    with pytest.raises(InputError, match=r"MisalignedWind\(TowerInfluence"):
        TowerInfluence(MisalignedWind(wind, 0.1))
    (note,) = MisalignedWind(wind, math.radians(35.0)).notes
    assert "35 degrees off the nacelle's axis" in note and MisalignedWind(wind, 0.5).notes == ()


# --- what the rotor makes of it


def test_wind_straight_on_is_the_wind_itself():
    turbine, plain = load_turbine("nrel5mw"), fr.ConstantWind(8.0, 0.1)
    assert accelerations(turbine, MisalignedWind(plain)) == pytest.approx(
        accelerations(turbine, plain), rel=1e-12, abs=1e-12
    )


def test_a_tilt_of_five_degrees_is_an_upflow_of_five_degrees():
    """To a rotor without weight both are the same; what differs is the wind's speed along the shaft, which neither changes."""
    five = math.radians(5.0)
    tilted = turbine_of(cos_tilt=math.cos(five), sin_tilt=-math.sin(five))
    level = turbine_of(cos_tilt=1.0, sin_tilt=0.0)
    one = accelerations(tilted, fr.ConstantWind(8.0))
    other = accelerations(level, MisalignedWind(fr.ConstantWind(8.0), 0.0, five))
    flaps, drive = slice(2, 6), 6
    assert np.ptp(one[2]) > 1.0  # there is a swing to compare
    assert one[flaps] == pytest.approx(other[flaps], rel=1e-7, abs=1e-7)
    assert one[drive] == pytest.approx(other[drive], rel=1e-7)


def test_from_left_from_right_from_below_and_from_above_are_one_flow_turned_about_the_shaft():
    turbine, angle = turbine_of(cos_tilt=1.0, sin_tilt=0.0), math.radians(15.0)
    flap = {
        where: accelerations(turbine, MisalignedWind(fr.ConstantWind(8.0), *angles))[2]
        for where, angles in {
            "right": (angle, 0.0), "left": (-angle, 0.0), "up": (0.0, angle), "down": (0.0, -angle),
        }.items()
    }  # fmt: skip
    quarter = len(PSI) // 4
    # to the right of who looks downwind is where a blade comes by a quarter of a turn after it pointed up
    for turns, where in enumerate(("up", "right", "down", "left")):
        assert np.roll(flap["up"], turns * quarter) == pytest.approx(flap[where], rel=1e-7, abs=1e-7)
    assert np.ptp(flap["up"]) > 1.0


@pytest.mark.parametrize("degrees", [10.0, 20.0, 30.0])
def test_power_and_thrust_fall_with_the_cosine_of_the_misalignment(degrees):
    """Momentum theory of a yawed disc that takes the same share of the wind through it: thrust as cos^2, power as cos^3 (Burton et al.,
    Wind Energy Handbook, 3.10.1 for the axial component). At the same tip-speed ratio of the axial wind the tables give just that."""
    turbine, wind = turbine_of(cos_tilt=1.0, sin_tilt=0.0), fr.ConstantWind(9.0)
    cosine, speed = math.cos(math.radians(degrees)), 1.0
    torque, thrust = mean_loads(turbine, wind, speed)
    less, pushed = mean_loads(turbine, MisalignedWind(wind, math.radians(degrees)), speed * cosine)
    assert less * cosine / torque == pytest.approx(cosine**3, rel=1e-3)
    assert pushed / thrust == pytest.approx(cosine**2, rel=1e-3)


@pytest.mark.parametrize(("degrees", "within"), [(8.0, 0.01), (15.0, 0.02), (30.0, 0.04)])
def test_the_swing_of_the_blade_is_that_of_blade_elements_that_feel_the_wind_across(degrees, within):
    """The tables answer linearly: beside them the blade elements themselves, with the in-plane wind and the wake's lean put in."""
    turbine, yaw = turbine_of(cos_tilt=1.0, sin_tilt=0.0), math.radians(degrees)
    blade, _ = turbine_blade(read_turbine_file("nrel5mw"))
    v, omega, kappa = 8.0, 0.95, 0.02

    def once(series):
        return np.array([(series * wave(PSI)).mean() * 2 for wave in (np.cos, np.sin)])

    def force(axial, **felt):
        """Generalised flap force of a blade over its azimuth, on any scale."""
        ratio = np.full(len(PSI), omega * turbine.rotor_radius / axial)
        return axial**2 * rotor_loads(blade, ratio, np.zeros(len(PSI)), **felt)[LOAD_NAMES.index("flap")]

    axial, aside = v * math.cos(yaw), v * math.sin(yaw)
    # e2 lies against the motion; a blade that points up moves to the right, where this wind blows
    found = once(force(axial, y=-aside / axial * np.cos(PSI), skew=aside / axial * np.sin(PSI)))
    # a blade accelerates by its force: the scale is that of a sheared wind straight on
    sheared = once(accelerations(turbine, fr.ConstantWind(v, kappa), omega)[2])
    scale = np.hypot(*sheared) / np.hypot(*once(force(v, kappa=kappa * np.cos(PSI))))
    made = once(accelerations(turbine, MisalignedWind(fr.ConstantWind(v), yaw), omega)[2]) / scale
    assert np.hypot(*(made - found)) < within * np.hypot(*found)


# --- fields


def test_a_turned_field_is_met_where_openfast_turns_it():
    """IfW_FlowField's GetPrimePosition: positions turned about the tower at hub height by RotToWind."""
    yaw, up, tilt = math.radians(10.0), math.radians(6.0), math.radians(-5.0)
    plane = RotorPlane(90.0, -5.0, tilt, yaw, up)
    point = np.array([-5.0 - math.tan(tilt) * 20.0, 30.0, 20.0])
    (cy, sy), (cu, su) = ((math.cos(a), math.sin(a)) for a in (yaw, up))
    there = np.array([[cu * cy, -cu * sy, su], [sy, cy, 0], [-su * cy, su * sy, cu]]) @ point + (0, 0, 90)
    (found,) = plane.places(np.array([30.0]), np.array([20.0])).T
    assert found == pytest.approx(there)
    # and the grid's point there is as far downwind as that
    assert plane.behind(np.array([there[1]]), np.array([there[2]]))[0, 0] == pytest.approx(there[0] + 5.0)


def test_a_wave_in_a_field_meets_a_turned_rotor_on_one_side_first(tmp_path):
    time, yaw = np.arange(800) * 0.05, math.radians(20.0)
    wave = 9 + np.sin(2 * np.pi * time / 10)[:, None, None] * np.ones((800, 9, 9))
    path = write_bts(tmp_path / "a.bts", wave, spacing=(10.0, 10.0), mean=9.0, hub=50.0, time_step=0.05)
    rotor = Rotor(30.0, 50.0)
    turned = MisalignedWind(fr.FullFieldWind(path, harmonics=1), yaw).on(rotor)
    run = np.arange(20, 300) * 0.05
    signals = turned.at(run)
    # plane x = -y sin(yaw): at the disc's edge as much later; the shear is what that delay makes of the wave
    w, delay = 2 * np.pi / 10, rotor.radius * math.sin(yaw) / 9.0
    arrival = run + 40.0 / 9.0
    speed, slope = (signals[:, 0], signals[:, 2] * signals[:, 0])
    assert speed == pytest.approx((9 + np.sin(w * arrival) * 0.9) * math.cos(yaw), abs=0.1 * math.cos(yaw))
    assert slope == pytest.approx(w * delay * np.cos(w * arrival) * math.cos(yaw), abs=0.15 * w * delay)


# --- in a campaign and in a run


def realisations(**keys):
    turbine = load_turbine("nrel5mw")
    site = Site(turbine.rotor, 20.0, Place(Source("a.yaml", {"wind": keys}), ("wind",)))
    return list(wind_section(keys).winds(site)), turbine


def test_a_campaign_sweeps_both_angles_in_degrees():
    found, turbine = realisations(speeds=[8], yaw_misalignment=[-8, 0, 8], upflow=[0, 8])
    assert [r.id for r in found] == [
        "v08.00_yaw-8.00", "v08.00_yaw-8.00_up8.00", "v08.00", "v08.00_up8.00", "v08.00_yaw8.00", "v08.00_yaw8.00_up8.00",
    ]  # fmt: skip
    assert len({str(r.identity) for r in found}) == 6
    winds = [r.build(turbine.rotor) for r in found]
    assert [w.label.get("yaw_misalignment_deg") for w in winds] == [-8.0, -8.0, None, 0.0, 8.0, 8.0]
    assert winds[2].kind == "constant" and winds[5].left_out == ""
    assert "8\u00a0degrees of yaw misalignment, 8\u00a0degrees of upflow" in winds[5].description


def test_an_angle_beyond_what_the_model_holds_is_refused_with_its_place():
    with pytest.raises(Exception, match="holds 50 degrees; the model holds up to 45"):
        wind_section({"speeds": [8], "yaw_misalignment": {"start": 0, "stop": 50, "step": 10}})


def test_the_tower_stands_in_a_turned_wind_s_own_way():
    rotor = load_turbine("nrel5mw").rotor
    straight, left, right = (
        MisalignedWind(TowerInfluence(fr.ConstantWind(8.0)), math.radians(a)).on(rotor).at(0.0)[0]
        for a in (0, 30, -30)
    )
    # wind that blows to the right passes the tower's front farther to the left
    assert straight[6::2] == pytest.approx(0.0, abs=1e-12)
    assert left[6::2] == pytest.approx(-right[6::2]) and abs(left[6]) > 0.01
    assert left[5::2] == pytest.approx(right[5::2])


def test_a_run_in_misaligned_turbulence_logs_what_blows_across():
    machine = load_turbine("nrel5mw")
    wind = MisalignedWind(fr.TurbulentWind(9.0, 0.14, seed=1, duration=10.0), math.radians(8.0))
    run = fr.simulate(machine, wind, "rk4", 0.05, 10.0)
    assert [c.name for c in run.winds[3:5]] == ["lateral_wind", "vertical_wind"] and run.wind.shape == (
        201,
        17,
    )
    assert run.wind[:, 3] == pytest.approx(-math.tan(math.radians(8.0)) * run.wind[:, 0])
    assert np.isfinite(run.loads["tower_base_side_side_moment"]).all()
    assert make_wind("misaligned", wind=fr.ConstantWind(8.0), upflow=0.1).upflow == 0.1
