"""The shipped turbines against OpenFAST's published behaviour, and what load_turbine refuses."""

from __future__ import annotations

import gc
import warnings
import weakref

import numpy as np
import pytest
from simulating import simulate_block

from fatigue_runner.caches import kept_with
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import exponential_runge_kutta, multi_blade
from fatigue_runner.integrators.stability import stability_limit
from fatigue_runner.turbine import load_turbine, table_builder
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.turbine.parameters import DATA, at_pitch
from fatigue_runner.wind import ConstantWind

# OpenFAST 5.0, the same degrees of freedom, quasi-steady BEM, k = 0.0255764 N.m/rpm^2, pitch 0, 8 m/s: rotor speed [rpm],
# generator torque [kN.m], tower top [m], tip out of plane [m], flap root moment [kN.m], tower-base moment [kN.m]
OPENFAST_8 = {
    "nrel5mw": (9.127, 20.05, 0.197, 3.155, 5692.0, 33269.0),
    "t2b1i1cg": (9.130, 20.06, 0.205, 2.848, 4928.0, 34083.0),
}


@pytest.fixture(scope="module")
def runs():
    out = {}
    for name in OPENFAST_8:
        turbine = load_turbine(name)
        start = turbine.operating_point(8.0)[None]
        out[name] = simulate_block(turbine, "dop853", 0.05, [ConstantWind(8.0)], start, 120.0, 0.05)[0]
    return out


@pytest.mark.parametrize("name", OPENFAST_8)
def test_means_at_8_m_s_are_within_two_per_cent_of_openfast(runs, name):
    run = runs[name]
    late = run.time >= 60.0
    ours = (
        run.state[late, 14].mean() * 30 / np.pi,
        run.loads["generator_torque"][late].mean() / 1e3,
        run.state[late, 0].mean(),
        run.loads["blade1_tip_out_of_plane"][late].mean(),
        run.loads["blade1_root_flapwise_moment"][late].mean() / 1e3,
        run.loads["tower_base_fore_aft_moment"][late].mean() / 1e3,
    )
    np.testing.assert_allclose(ours, OPENFAST_8[name], rtol=0.02)


def test_frequencies_are_within_one_and_a_half_per_cent_of_openfast():
    modes = {name: (f, d) for name, f, d in load_turbine("nrel5mw").natural_frequencies(8.0)}
    # OpenFAST 5.0 linearised at 8 m/s, Hz; the flap modes are given to two digits
    for name, expected in {
        "tower side-side": 0.3213,
        "tower fore-aft": 0.3349,
        "drivetrain and collective edge 1": 1.744,
        "drivetrain and collective edge 2": 3.802,
    }.items():
        assert modes[name][0] == pytest.approx(expected, rel=0.015), name
    for name, expected in {
        "flap regressing": 0.58,
        "flap collective": 0.72,
        "flap progressing": 0.84,
    }.items():
        assert modes[name][0] == pytest.approx(expected, abs=0.0099), name
    for name, damping in {
        "tower side-side": 0.0054,
        "tower fore-aft": 0.065,
        "drivetrain and collective edge 1": 0.052,
        "drivetrain and collective edge 2": 0.055,
    }.items():
        assert modes[name][1] == pytest.approx(damping, rel=0.05), name


@pytest.mark.parametrize("name", ["nrel5mw", "t2b1i1cg"])
def test_power_equals_torque_times_speed_through_the_drivetrain(runs, name):
    run = runs[name]
    late = run.time >= 60.0
    shaft = (run.loads["low_speed_shaft_torque"] * run.state[:, 14])[late].mean()
    generator = (run.loads["generator_torque"] * run.state[:, 15])[late].mean()
    assert shaft == pytest.approx(generator, rel=2e-3)


def test_gravity_swings_the_edgewise_moment_by_the_blades_first_moment(runs):
    # a horizontal blade weighs on its root with g times its first moment about the root: 363 231 kg.m (TP-500-38060)
    edge = runs["t2b1i1cg"].loads["blade1_root_edgewise_moment"][-400:]
    assert np.ptp(edge) / 2 == pytest.approx(9.80665 * 363231, rel=0.01)


def test_tilt_and_cone_change_the_flapwise_moment_as_in_openfast(runs):
    mean = {n: r.loads["blade1_root_flapwise_moment"][-600:].mean() for n, r in runs.items()}
    # OpenFAST: 5 692 against 4 928 kN.m
    assert (mean["nrel5mw"] - mean["t2b1i1cg"]) / 1e3 == pytest.approx(5692 - 4928, rel=0.1)


def test_tilt_and_cone_take_two_fifths_of_the_flap_load_cycle_under_shear():
    # OpenFAST at 8 m/s with shear exponent 0.2: the flap DEL falls by 40 % when tilt and cone are there
    loads = {}
    for name in OPENFAST_8:
        turbine, wind = load_turbine(name), ConstantWind(8.0, vertical_shear=0.2 * 63.0 / 90.0)
        start = turbine.operating_point(8.0)[None]
        run = simulate_block(turbine, "dop853", 0.05, [wind], start, 120.0, 0.05)[0]
        loads[name] = np.ptp(run.loads["blade1_root_flapwise_moment"][run.time > 80.0])
    assert loads["nrel5mw"] / loads["t2b1i1cg"] == pytest.approx(0.6, abs=0.05)


@pytest.mark.parametrize("name", ["nrel5mw", "t2b1i1cg", "nrel5mw_edges"])
def test_a_turbine_that_stands_still_has_accelerations_and_no_torque(name):
    """Power over speed is no number there, and `initial: paper`, the literal start of arXiv:2504.05493, has this speed."""
    turbine = load_turbine(name)
    still = np.zeros((1, turbine.layout.size))
    assert np.isfinite(turbine.rhs(still[0], 8.0)).all()
    loads = turbine.loads(still, np.array([[8.0, 0.0, 0.0]]))
    assert all(np.isfinite(series).all() for series in loads.values())
    assert loads["generator_torque"][0] == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize("name", ["nrel5mw", "t2b1i1cg"])
@pytest.mark.parametrize("wind", [5.0, 8.0, 11.0])
def test_the_operating_point_is_where_the_turbine_stays(name, wind):
    turbine = load_turbine(name)
    x = turbine.operating_point(wind)
    run = simulate_block(turbine, "dop853", 0.05, [ConstantWind(wind)], x[None], 60.0, 0.5)[0]
    assert run.state[-40:, 14].mean() == pytest.approx(x[14], rel=0.01)
    # higher harmonics of the loads shift the mean by a millimetre
    assert run.state[-40:, 0].mean() == pytest.approx(x[0], abs=0.003)


def test_pitch_to_feather_sheds_power():
    turbine = load_turbine("nrel5mw")
    speed = [turbine.operating_point(10.0, pitch=np.radians(p))[14] for p in (0.0, 3.0, 8.0)]
    assert speed[0] > speed[1] > speed[2]


def test_pitching_the_modes_keeps_masses_and_stiffness():
    p = load_turbine("nrel5mw").parameters
    q = at_pitch(p, 0.4)
    for a, b in (("b_fxfx", "b_fyfy"), ("b_exex", "b_eyey"), ("b_fxex", "b_fyey")):
        assert q[a] + q[b] == pytest.approx(p[a] + p[b], rel=1e-12, abs=1e-9)
    # 90 degrees to feather turn out of plane into minus in plane
    turned = at_pitch(p, np.pi / 2)
    assert turned["b_fy"] == pytest.approx(-p["b_fx"], rel=1e-12)


def generator_torque(turbine, speeds_rpm):
    """Through the load channels, so through the compiled law."""
    states = np.repeat(turbine.operating_point(8.0)[None], len(speeds_rpm), axis=0)
    states[:, 15] = np.asarray(speeds_rpm) * np.pi / 30
    return turbine.loads(states, np.tile([8.0, 0.0, 0.0], (len(speeds_rpm), 1)))["generator_torque"]


def test_the_generator_follows_the_regions_of_the_report():
    # TP-500-38060, 7.2: k omega^2 in region 2, 43 093.55 N.m at the rated 1 173.7 rpm, constant power above
    turbine = load_turbine("nrel5mw")
    low, rated, high = generator_torque(turbine, [900.0, 1173.7, 1250.0])
    assert low == pytest.approx(0.0255764 * 900**2, rel=1e-3)
    assert rated == pytest.approx(43093.55, rel=0.01)
    assert high * 1250 == pytest.approx(43093.55 * 1173.7, rel=2e-3)


def test_the_generator_law_has_no_kink():
    speeds = np.linspace(800, 1300, 20001)
    slope = np.diff(generator_torque(load_turbine("nrel5mw"), speeds)) / np.diff(speeds)
    # the slope falls from about 400 to -37 N.m/rpm at rated speed: nowhere at once
    assert np.abs(np.diff(slope)).max() < 0.02 * np.ptp(slope)


def test_the_papers_torque_is_k_omega_squared_everywhere():
    speeds = np.array([100.0, 871.0, 1173.7, 2000.0])
    torque = generator_torque(load_turbine("t2b1i1cg"), speeds)
    np.testing.assert_allclose(torque, 2.332287 * (speeds * np.pi / 30) ** 2, rtol=1e-9)


def test_look_ups_outside_the_table_are_clamped_and_counted():
    turbine = load_turbine("nrel5mw")
    x = turbine.operating_point(8.0)
    inside = simulate_block(turbine, "rk4", 0.01, [ConstantWind(8.0)], x[None], 0.1)[0]
    fast = x.copy()
    fast[14:] *= 3.0
    outside = simulate_block(turbine, "rk4", 0.01, [ConstantWind(8.0)], fast[None], 0.1)[0]
    assert inside.clamped_lookups == 0
    assert outside.clamped_lookups == outside.evaluations


def test_one_state_and_many_states_give_the_same_bits():
    turbine = load_turbine("nrel5mw")
    rng = np.random.default_rng(0)
    x = turbine.operating_point(8.0)[:, None] * (1 + 0.01 * rng.standard_normal((16, 37)))
    many = turbine.rhs(x, 8.0, 0.1)
    for i in (0, 15, 16, 36):
        np.testing.assert_array_equal(turbine.rhs(x[:, i], 8.0, 0.1), many[:, i])


def test_what_is_made_of_a_turbine_goes_with_the_last_who_holds_it():
    turbine = load_turbine("nrel5mw")
    operated = turbine.operated("controlled")
    assert operated.kernel_data() is operated.kernel_data()
    assert operated.tables is turbine.tables
    assert len(operated.kernel_data().load_tables) > len(operated.kernel_data().tables)
    seen = [
        weakref.ref(made)
        for made in (turbine, operated, turbine.tables, turbine.kernel_data(0.1), operated.kernel_data())
    ]
    assert turbine.hash != operated.hash
    assert stability_limit(turbine, "rk4") > 0
    multi_blade.matrices(turbine, 0.1, 0.0, (3, 2), 2)
    exponential_runge_kutta.matrices(turbine, 0.1, 0.0)
    del turbine, operated
    gc.collect()
    assert [made() for made in seen] == [None] * len(seen)


def test_of_what_is_kept_with_an_object_the_oldest_goes_first():
    made = []

    @kept_with(2)
    def product(of: type, first: int, second: int = 1) -> int:
        made.append((first, second))
        return first * second

    calls = [(1,), (2,), (1,), (3,), (2,), (1,)]
    assert [product(int, *call) for call in calls] == [1, 2, 1, 3, 2, 1]
    assert made == [(1, 1), (2, 1), (3, 1), (1, 1)]
    assert product(float, 1, second=5) == 5
    assert len(made) == 5


def test_the_hash_knows_parameters_tables_and_interpolation():
    a, b = load_turbine("nrel5mw"), load_turbine("nrel5mw")
    assert a.hash == b.hash
    heavier = read_turbine_file("nrel5mw")
    heavier["hub"] = {**heavier["hub"], "mass": heavier["hub"]["mass"] + 1}
    assert load_turbine(heavier).hash != a.hash
    bilinear = read_turbine_file("nrel5mw")
    bilinear["aerodynamics"] = {**bilinear["aerodynamics"], "interpolation": "bilinear"}
    assert load_turbine(bilinear).hash != a.hash
    assert load_turbine("t2b1i1cg").hash != a.hash


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"hub": {}}, "mass"),
        ({"drivetrain": {}}, "missing"),
        ({"aerodynamics": {"tables": "nowhere.npz"}}, "nowhere.npz"),
        (
            {"aerodynamics": {"tables": DATA / "nrel5mw_aero.npz", "interpolation": "cubc"}},
            "did you mean 'cubic'",
        ),
        ({"generator": {"law": "optimum", "optimal_gain": 2.0}}, "did you mean 'optimal'"),
    ],
)
def test_an_impossible_turbine_is_refused_with_the_place(change, message):
    data = read_turbine_file("nrel5mw") | change
    with pytest.raises(InputError, match=message):
        load_turbine(data)


@pytest.mark.parametrize(
    "change", ["geometry: {tower_height: 1e200}", "blade: {mass_factor: 1e308}", "drivetrain: {gearbox_ratio: 1e308}"]
)  # fmt: skip
def test_numbers_that_are_beyond_computing_are_refused_with_the_file_and_no_warning(change, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(f"base: nrel5mw\nname: mine\n{change}\n")
    with warnings.catch_warnings(), pytest.raises(InputError) as caught:
        warnings.simplefilter("error")
        load_turbine(file)
    assert str(caught.value).startswith(
        f"{file}: turbine mine: a value of blade, tower or drivetrain is far too large"
    )


def test_tables_of_another_blade_are_refused_and_can_be_made_anew(tmp_path, monkeypatch):
    child = tmp_path / "coned.yaml"
    child.write_text("name: coned\nbase: nrel5mw\ngeometry: {precone_deg: -4.0}\n")
    with pytest.raises(InputError, match=r"made for another blade.*turbine tables FILE"):
        load_turbine(str(child))
    with pytest.raises(InputError, match="shipped"):
        table_builder.make_tables(str(child))
    child.write_text(child.read_text() + "aerodynamics: {tables: coned.npz}\n")
    # a coarse grid: the whole one takes 8 s
    monkeypatch.setattr(table_builder, "TIP_SPEED_RATIO", np.linspace(5.0, 10.0, 6))
    monkeypatch.setattr(table_builder, "PITCH_DEG", np.array([-1.0, 0.0, 1.0, 2.0]))
    monkeypatch.setattr(
        table_builder.build_tables,
        "__defaults__",
        (True, table_builder.TIP_SPEED_RATIO, table_builder.PITCH_DEG),
    )
    assert table_builder.make_tables(str(child)) == tmp_path / "coned.npz"
    assert load_turbine(str(child)).hash != load_turbine("nrel5mw").hash


def test_a_turbine_in_another_folder_inherits_the_tables_of_its_base(tmp_path):
    child = tmp_path / "heavier.yaml"
    child.write_text("name: heavier\nbase: nrel5mw\nhub: {mass: 60000.0}\n")
    assert load_turbine(str(child)).parameters["h_m"] == 60000.0


def test_an_unknown_turbine_is_refused_with_the_nearest_name():
    with pytest.raises(InputError, match="did you mean 'nrel5mw'"):
        load_turbine("nrel5m")
    with pytest.raises(InputError, match="does not exist"):
        load_turbine("somewhere/else.yaml")


def test_a_wrong_parameter_set_is_refused():
    good = dict(load_turbine("nrel5mw").parameters)
    tables = {"tip_speed_ratio": np.linspace(1, 10, 10), "coefficients": {"thrust": np.ones(10)}}
    for change, message in (({"b_mass": 1.0}, "unknown name 'b_mass'"), ({"b_m": float("nan")}, "finite")):
        with pytest.raises(InputError, match=message):
            load_turbine({"parameters": good | change, "tables": tables})
    del good["b_m"]
    with pytest.raises(InputError, match="missing b_m"):
        load_turbine({"parameters": good, "tables": tables})


def test_a_state_of_the_wrong_shape_is_refused():
    with pytest.raises(InputError, match="shape"):
        load_turbine("nrel5mw").rhs(np.zeros(8), 8.0)
    with pytest.raises(InputError, match="positive"):
        load_turbine("nrel5mw").operating_point(-1.0)
