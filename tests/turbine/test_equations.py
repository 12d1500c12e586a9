"""The derived equations against a second formulation, conservation laws and CADynTurb's own runs."""

from __future__ import annotations

import cadynturb
import numpy as np
import pytest
from independent_model import IndependentModel
from simulating import simulate_block

from fatigue_runner.turbine import load_turbine
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.turbine.generated import kernel
from fatigue_runner.turbine.parameters import at_pitch, equation_parameters
from fatigue_runner.wind import ConstantWind

RATIO = np.linspace(0.5, 15, 30)


def free_turbine(**changes):
    """The 5-MW turbine without damping, aerodynamics and generator torque, and with every inertia term non-zero."""
    p = equation_parameters(read_turbine_file("nrel5mw"))
    p |= {
        "b_df": 0.0,
        "b_de": 0.0,
        "d_d": 0.0,
        "t_da": 0.0,
        "t_ds": 0.0,
        "q_area": 0.0,
        "tg_k": 0.0,
        "tg_a2": 0.0,
        "tg_t2": -1e9,
        "tg_p": 0.0,
        "tg_t": 1e9,
        "tg_e": 0.0,
    }
    p |= {"h_itt": 5e4, "n_ixx": 1e6, "n_iyy": 2e6, "n_y": 0.3, "b_kfe": 300.0}
    pitches = [-5.0, 10.0, 20.0]
    tables = {"tip_speed_ratio": RATIO, "pitch_deg": pitches, "coefficients": {"thrust": np.ones((30, 3))}}
    return load_turbine({"name": "free", "parameters": p | changes, "tables": tables})


def violent_states(n: int) -> np.ndarray:
    """(n, 16) states far beyond operation, so that every nonlinear term counts."""
    rng = np.random.default_rng(1)
    scale = np.array([0.5, 0.5, 4, 4, 4, 0.5, 3, 0, 0.5, 0.5, 3, 3, 3, 1, 0.3, 0])
    x = scale * rng.uniform(-1, 1, (n, 16))
    x[:, 14] += 1.0
    x[:, 7] = 97 * (x[:, 6] + rng.uniform(-0.002, 0.002, n))
    x[:, 15] = 97 * (x[:, 14] + rng.uniform(-0.05, 0.05, n))
    return x


@pytest.mark.parametrize("pitch", [0.0, 0.2])
def test_accelerations_equal_those_of_a_formulation_without_frames(pitch):
    turbine, x = free_turbine(), violent_states(8)
    acceleration = turbine.rhs(x.T, 8.0, pitch=pitch)[8:].T
    model = IndependentModel(at_pitch(turbine.parameters, pitch))
    expected = np.array([model.accelerations(row) for row in x])
    np.testing.assert_allclose(acceleration, expected, rtol=1e-7, atol=1e-7)


def test_energy_is_conserved_over_100_s_without_damping_aerodynamics_and_torque():
    turbine, x = free_turbine(), violent_states(4)
    model = IndependentModel(turbine.parameters)
    runs = simulate_block(turbine, "rk7", 0.005, [ConstantWind(8.0)] * 4, x, 100.0, 10.0)
    for run in runs:
        energy = np.array([model.energy(row) for row in run.state])
        rotation = (
            0.5 * 3.5e7 * run.state[0, 14] ** 2
        )  # J; the weight's potential energy would flatter the ratio
        assert np.ptp(energy) / rotation < 1e-9


def test_damping_only_takes_energy():
    turbine, x = free_turbine(b_df=35.0, b_de=90.0, d_d=6e6, t_da=6800.0, t_ds=6800.0), violent_states(2)
    model = IndependentModel(turbine.parameters)
    for run in simulate_block(turbine, "rk7", 0.005, [ConstantWind(8.0)] * 2, x, 5.0, 0.05):
        energy = np.array([model.energy(row) for row in run.state])
        assert np.all(np.diff(energy) < 0)


def test_the_turbine_turned_by_120_degrees_is_the_turbine_with_its_blades_renamed():
    turbine, x = load_turbine("nrel5mw"), violent_states(6).T
    turned = x.copy()
    turned[6] += 2 * np.pi / 3
    turned[7] += 97 * 2 * np.pi / 3
    # after 120 degrees blade 1 is where blade 2 was
    for rows in ([2, 3, 4], [10, 11, 12]):
        turned[rows] = x[np.roll(rows, -1)]
    a, b = turbine.rhs(x, 9.0, 0.2, 0.1), turbine.rhs(turned, 9.0, 0.2, 0.1)
    np.testing.assert_allclose(b[[8, 9, 13, 14, 15]], a[[8, 9, 13, 14, 15]], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(b[[10, 11, 12]], a[[11, 12, 10]], rtol=1e-9, atol=1e-9)


def test_sine_and_cosine_of_the_azimuth_hold_after_many_revolutions():
    turbine = free_turbine()
    x = violent_states(1)[0]
    later = x.copy()
    later[6] += 2 * np.pi * 200
    later[7] += 97 * 2 * np.pi * 200
    np.testing.assert_allclose(turbine.rhs(later, 8.0)[8:], turbine.rhs(x, 8.0)[8:], rtol=1e-8, atol=1e-8)


def test_the_foot_carries_the_weight_at_rest():
    """Static moments by hand: every mass at its arm, of the undeformed turbine standing still."""
    # generalised masses beyond measure hold everything still: no deflection's acceleration, none of the loads that go with one
    held = dict.fromkeys(("t_maa", "t_mss", "b_fxfx", "b_fyfy", "b_exex", "b_eyey"), 1e40)
    turbine = free_turbine(t_slope_fa=0.0, t_slope_ss=0.0, h_itt=0.0, **held)
    p, g = turbine.parameters, turbine.parameters["gravity"]
    x = np.zeros((1, 16))
    loads = {name: values[0] for name, values in turbine.loads(x, np.array([[8.0, 0.0, 0.0]])).items()}
    rotor_arm = p["overhang"] * p["cos_tilt"]
    # three coned blades: their common centre lies on the shaft, m1 sin(cone) / m downwind of the apex
    blades = 3 * (p["b_m"] * rotor_arm + p["b_m1"] * p["sin_cone"] * p["cos_tilt"])
    expected = g * (p["n_m"] * p["n_x"] + p["h_m"] * rotor_arm + blades)
    assert loads["tower_base_fore_aft_moment"] == pytest.approx(expected, rel=1e-9)
    assert loads["tower_base_side_side_moment"] == pytest.approx(-g * p["n_m"] * p["n_y"], rel=1e-9)
    # blade 1 points up, leaning by tilt and cone; the lean seen from the root is that of the whole span
    lean = p["sin_cone"] * p["cos_tilt"] + p["cos_cone"] * -p["sin_tilt"]
    moment = g * lean * (p["b_m1"] - p["b_root"] * p["b_m"])
    assert loads["blade1_root_flapwise_moment"] == pytest.approx(moment, rel=1e-9)


needs_shared = pytest.mark.skipif(
    not cadynturb.SHARED.is_dir(), reason="the CADynTurb reference data (../shared/data) are not here"
)


@pytest.fixture(scope="module")
def cadyn():
    data = cadynturb.load()
    tables = {k: v for k, v in cadynturb.tables(data).items() if k in kernel.TABLES}
    given = {"tip_speed_ratio": data["tip_speed_ratio"], "coefficients": tables}
    turbine = load_turbine(
        {
            "name": "cadyn",
            "parameters": cadynturb.parameters(data),
            "tables": given,
            "interpolation": "bilinear",
        }
    )
    return turbine, np.load(cadynturb.SHARED / "t2b1i1cg_reference.npz")


@needs_shared
def test_accelerations_agree_with_cadynturb_within_three_per_cent(cadyn):
    turbine, reference = cadyn
    x, u, expected = reference["x"].T, reference["u"].T, reference["xdot"].T
    ours = turbine.rhs(x, u[4], u[6], u[5])
    # the triples give the generator torque, the kernel has k omega^2
    ours[15] += (2.332287 * x[15] ** 2 - u[0]) / turbine.parameters["g_i"]
    error = np.sqrt(((ours - expected) ** 2).mean(axis=1) / (expected**2).mean(axis=1))
    assert error[8:].max() < 0.03
    assert np.median(error[8:]) < 0.01


@needs_shared
def test_trajectories_agree_with_cadynturb_within_two_per_cent_of_their_range(cadyn):
    turbine, reference = cadyn
    winds = [ConstantWind(float(v)) for v in reference["vwind"]]
    runs = simulate_block(turbine, "rk7", 0.005, winds, reference["V2"][:, 0], 20.0, 0.05)
    for run, expected in zip(runs, reference["V2"], strict=True):
        error = np.sqrt(((run.state - expected) ** 2).mean(axis=0)) / np.ptp(expected, axis=0)
        assert error.max() < 0.02
        assert np.median(error) < 0.005
