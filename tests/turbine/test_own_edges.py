"""T2B2cG, each blade with an edge mode of its own: against a second formulation, its collective special case and OpenFAST."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cadynturb
import numpy as np
import pytest
from independent_model import IndependentModel
from scipy.optimize import root
from simulating import simulate_block
from test_equations import free_turbine, needs_shared, violent_states

import fatigue_runner as fr
from fatigue_runner.corrector import features, find
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import multi_blade
from fatigue_runner.integrators.initial import initial_state
from fatigue_runner.integrators.stability import stability_limit
from fatigue_runner.layout import T2B1I1CG, T2B2CG
from fatigue_runner.logbook import read_log, write_log
from fatigue_runner.turbine import Turbine, load_turbine
from fatigue_runner.turbine.dynamics import UNCONTROLLED
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.turbine.generated.kernel import TABLES
from fatigue_runner.turbine.parameters import at_pitch
from fatigue_runner.viewer.scene import geometry
from fatigue_runner.wind import ConstantWind

FREEDOMS = T2B2CG.freedoms
EDGES = slice(T2B2CG.row("blade1_edge"), T2B2CG.row("blade1_edge") + 3)
RATES = slice(FREEDOMS + EDGES.start, FREEDOMS + EDGES.stop)


def own_edges(turbine: Turbine) -> Turbine:
    return replace(turbine, family="t2b2cg", dynamics=UNCONTROLLED["t2b2cg"])


def widened(x: np.ndarray) -> np.ndarray:
    """(n, 20) states of three equal edges from states of the collective one."""
    names = [name if name in T2B1I1CG.names else f"edge{name[len('blade1_edge') :]}" for name in T2B2CG.names]
    return x[:, [T2B1I1CG.row(name) for name in names]]


def uneven_states(n: int) -> np.ndarray:
    """(n, 20) states far beyond operation, with another edge deflection on each blade."""
    x, rng = widened(violent_states(n)), np.random.default_rng(2)
    x[:, EDGES] = rng.uniform(-0.5, 0.5, (n, 3))
    x[:, RATES] = rng.uniform(-1.0, 1.0, (n, 3))
    return x


@pytest.mark.parametrize("pitch", [0.0, 0.2])
def test_accelerations_equal_those_of_a_formulation_without_frames(pitch):
    turbine, x = own_edges(free_turbine()), uneven_states(8)
    model = IndependentModel(at_pitch(turbine.parameters, pitch), own_edges=True)
    expected = np.array([model.accelerations(row) for row in x])
    np.testing.assert_allclose(
        turbine.rhs(x.T, 8.0, pitch=pitch)[FREEDOMS:].T, expected, rtol=1e-7, atol=1e-7
    )


def test_energy_is_conserved_over_100_s_without_damping_aerodynamics_and_torque():
    turbine, x = own_edges(free_turbine()), uneven_states(4)
    model = IndependentModel(turbine.parameters, own_edges=True)
    for run in simulate_block(turbine, "rk7", 0.005, [ConstantWind(8.0)] * 4, x, 100.0, 10.0):
        energy = np.array([model.energy(row) for row in run.state])
        rotation = 0.5 * 3.5e7 * run.state[0, T2B2CG.rotor_speed] ** 2  # J
        assert np.ptp(energy) / rotation < 1e-9


@needs_shared
def test_three_equal_flaps_and_edges_are_cadynturb_s_t2b2cg():
    """CADynTurb's model of that name has one flap and one edge mode for all blades: ours under the constraint of equal ones.

    cadynturb_t2b2cg.csv: accelerations that its generated equations (model/T2B2cG at commit 7d34997 of jgeisler0303/CADynTurb) give in
    twelve states, without aerodynamics, its generator torque 2.332287 N.m.s2 times the speed squared. It is linear in the blades'
    deflections, which are large in the first eight states (flap up to 5 m) and a thirtieth of that in the last four.
    """
    data = cadynturb.load()
    still = {name: 0.0 * values for name, values in cadynturb.tables(data).items() if name in TABLES}
    turbine = own_edges(
        load_turbine(
            {
                "name": "cadyn",
                "parameters": cadynturb.parameters(data),
                "tables": {"tip_speed_ratio": data["tip_speed_ratio"], "coefficients": still},
                "interpolation": "bilinear",
            }
        )
    )
    rows = np.loadtxt(Path(__file__).with_name("cadynturb_t2b2cg.csv"), delimiter=",", skiprows=1)
    q, rates, expected = np.split(rows, 3, axis=1)
    shared = [0, 1, *[2] * 3, *[3] * 3, 4, 5]  # which of theirs each of our coordinates is
    bound = np.eye(6)[shared]
    x = np.concatenate([q @ bound.T, rates @ bound.T], axis=1)
    free = turbine.rhs(x.T, 8.0)[FREEDOMS:].T
    model = IndependentModel(turbine.parameters, own_edges=True)
    masses = [bound.T @ model.mass_matrix(row[:FREEDOMS]) for row in x]
    held = np.array([np.linalg.solve(m @ bound, m @ a) for m, a in zip(masses, free, strict=True)])
    for states, bars in (
        (slice(0, 8), (0.002, 0.003, 0.01, 0.02, 0.02, 0.001)),
        (slice(8, 12), (0.001, 0.001, 1e-4, 1e-4, 1e-4, 1e-4)),
    ):
        away = np.abs(held - expected)[states].max(axis=0) / np.abs(expected[states]).max(axis=0)
        assert (away < bars).all(), away


@pytest.mark.parametrize("pitch", [0.0, 0.15])
def test_the_collective_model_is_what_three_equal_edges_give_when_they_are_held_together(pitch):
    """Its accelerations are those of the larger model under the constraint of equal edges, aerodynamics included."""
    collective = load_turbine("nrel5mw")
    larger, x = own_edges(collective), violent_states(6)
    wide = widened(x)
    bound = np.array([[float(column == row) for column in T2B1I1CG.names] for row in T2B2CG.names])
    bound[EDGES, T2B1I1CG.row("edge")] = 1.0
    bound = bound[:FREEDOMS, : T2B1I1CG.freedoms]
    model = IndependentModel(at_pitch(collective.parameters, pitch), own_edges=True)
    free = larger.rhs(wide.T, 9.0, 0.2, 0.1, pitch)[FREEDOMS:].T
    expected = collective.rhs(x.T, 9.0, 0.2, 0.1, pitch)[T2B1I1CG.freedoms :].T
    for row, acceleration, theirs in zip(wide, free, expected, strict=True):
        mass = model.mass_matrix(row[:FREEDOMS])
        held = np.linalg.solve(bound.T @ mass @ bound, bound.T @ mass @ acceleration)
        np.testing.assert_allclose(held, theirs, rtol=1e-10, atol=1e-10 * np.abs(theirs).max())


def test_loads_of_three_equal_blades_are_the_collective_model_s():
    """Where nothing tells one blade from another, so that their edges stay equal: no gravity, no tilt, no shear, a tower that does not
    nod; at 8 revolutions a minute, where the wake is skewed for none."""
    even = {"gravity": 0.0, "t_slope_fa": 0.0, "t_slope_ss": 0.0, "cos_tilt": 1.0, "sin_tilt": 0.0}
    shipped = load_turbine("nrel5mw")
    collective = replace(shipped, parameters=shipped.parameters | even)
    x = violent_states(6)
    x[:, [3, 4]], x[:, [11, 12]] = x[:, [2]], x[:, [10]]
    x[:, [0, 1, 8, 9]] = 0.0
    x[:, 14] = np.abs(x[:, 14])
    wind = np.tile([9.0, 0.0, 0.0], (6, 1))
    found = own_edges(collective).loads(widened(x), wind)
    for name, expected in collective.loads(x, wind).items():
        scale = max(np.abs(expected).max(), 1.0)
        np.testing.assert_allclose(found[name], expected, rtol=1e-10, atol=1e-9 * scale, err_msg=name)


def test_a_pitch_that_varies_is_a_fixed_pitch_where_it_rests():
    turbine, x = load_turbine("nrel5mw_edges"), uneven_states(8)
    wind = np.tile([9.0, 0.2, 0.1], (8, 1))
    for pitch in (0.0, 0.15):
        fixed, varying = (turbine.rhs(x.T, 9.0, 0.2, 0.1, p) for p in (pitch, np.full(8, pitch)))
        np.testing.assert_allclose(varying, fixed, rtol=1e-11, atol=1e-11)
        loads = [turbine.loads(x, wind, p) for p in (pitch, np.full(8, pitch))]
        for name, series in loads[0].items():
            np.testing.assert_allclose(loads[1][name], series, rtol=1e-10, atol=1e-6)


def test_the_turbine_turned_by_120_degrees_is_the_turbine_with_its_blades_renamed():
    turbine, x = load_turbine("nrel5mw_edges"), uneven_states(6).T
    turned = x.copy()
    turned[T2B2CG.rotor] += 2 * np.pi / 3
    turned[T2B2CG.generator] += turbine.gearbox_ratio * 2 * np.pi / 3
    sets = T2B2CG.state_blade_sets
    for first in sets:
        turned[first : first + 3] = x[np.roll(np.arange(first, first + 3), -1)]
    a, b = turbine.rhs(x, 9.0, 0.2, 0.1), turbine.rhs(turned, 9.0, 0.2, 0.1)
    for first in sets:
        a[first : first + 3] = a[np.roll(np.arange(first, first + 3), -1)]
    np.testing.assert_allclose(b[FREEDOMS:], a[FREEDOMS:], rtol=1e-9, atol=1e-9)


def test_edge_whirls_at_openfasts_frequencies():
    """OpenFAST at 8 m/s: 0.945 and 1.256 Hz (its linearisation with these degrees of freedom)."""
    modes = {name: f for name, f, _ in load_turbine("nrel5mw_edges").natural_frequencies(8.0)}
    assert modes["edge regressing"] == pytest.approx(0.945, rel=0.01)
    assert modes["edge progressing"] == pytest.approx(1.256, rel=0.01)


def test_the_parked_rotor_s_edges_swing_at_openfasts_frequencies():
    """OpenFAST, parked: 1.087 and 1.098 Hz. Here the generator is held, blade 1 up, without wind."""
    still = {"q_area": 0.0, "tg_k": 0.0, "tg_a2": 0.0, "tg_t2": -1e9, "tg_p": 0.0, "tg_t": 1e9, "tg_e": 0.0}
    turbine = load_turbine("nrel5mw_edges")
    turbine = replace(turbine, parameters={**turbine.parameters, **still})
    held = T2B2CG.generator  # the last coordinate

    def accelerations(deflections: np.ndarray) -> np.ndarray:
        state = np.zeros(T2B2CG.size)
        state[:held] = deflections
        state[T2B2CG.generator_speed] = 1e-3  # the torque law divides by it
        return turbine.rhs(state, 8.0)[FREEDOMS : FREEDOMS + held]

    rest = root(accelerations, np.zeros(held), tol=1e-12).x
    nudges = 1e-4 * np.eye(held)
    jacobian = np.column_stack([(accelerations(rest + d) - accelerations(rest - d)) / 2e-4 for d in nudges])
    found = np.sort(np.sqrt(-np.linalg.eigvals(jacobian).real)) / (2 * np.pi)
    assert found[6:8] == pytest.approx([1.087, 1.098], rel=0.01)


def test_an_unknown_model_is_refused_with_its_line(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("base: nrel5mw\nname: mine\nmodel: t2b2c\n")
    with pytest.raises(InputError, match=r"mine.yaml:3: model: 't2b2c' is not known.*t2b2cg"):
        load_turbine(file)


@pytest.fixture(scope="module")
def run():
    """Five seconds in shear and turbulence."""
    turbine = load_turbine("nrel5mw_edges")
    wind = fr.TurbulentWind(mean=9.0, intensity=0.14, seed=1, duration=5.0, harmonics=6)
    return fr.simulate(turbine, wind=wind, method="rk4", step=0.02, duration=5.0)


def test_a_log_holds_each_blade_s_edge_and_the_viewer_bends_each_blade_its_own_way(run, tmp_path):
    path = write_log(tmp_path / "a.mcap", run, {"turbine": "nrel5mw_edges"})
    log = read_log(path)
    assert [c.name for c in log.states] == list(T2B2CG.names)
    np.testing.assert_array_equal(log.state, run.state)
    shape = geometry(read_turbine_file("nrel5mw_edges"))
    drawn = shape.tip_channels(log.state)
    for i in range(3):
        for k, way in enumerate(("out_of_plane", "in_plane")):
            np.testing.assert_allclose(
                drawn[:, i, k], log.loads[f"blade{i + 1}_tip_{way}"], rtol=1e-9, atol=1e-9
            )
    # the blades hang in their own weight, each in another direction
    assert np.ptp(drawn[-1, :, 1]) > 0.3


def test_exponential_steps_take_the_edge_whirl_for_linear(run):
    """At 50 ms, where the edge turns by a third of a radian in a step, ETDRK4 is as close as RK4 at 20 ms."""
    wind = fr.TurbulentWind(mean=9.0, intensity=0.14, seed=1, duration=5.0, harmonics=6)
    turbine = load_turbine("nrel5mw_edges")
    found, fine = (
        fr.simulate(turbine, wind=wind, method=method, step=step, duration=5.0, output_step=0.1).state
        for method, step in (("etdrk4", 0.05), ("rk4", 0.002))
    )
    coarse = run.state[::5]
    errors = [np.abs(x - fine)[:, EDGES].max() for x in (found, coarse)]
    assert errors[0] < errors[1] < 1e-3


def test_exponential_adams_steps_have_the_edge_whirl_in_their_matrices():
    """Seen from the blades both whirls turn by the rotor's own speed: what an exponential step integrates exactly, and a corrector sees."""
    turbine = load_turbine("nrel5mw_edges")
    modes = {name: f for name, f, _ in turbine.natural_frequencies(8.0)}
    once = turbine.operating_point(8.0)[T2B2CG.rotor_speed] / (2 * np.pi)  # Hz
    found = np.abs(np.linalg.eigvals(multi_blade.linear(turbine, 0.0, 0.0, 8.0).isotropic)) / (2 * np.pi)
    for whirl in (modes["edge regressing"] + once, modes["edge progressing"] - once):
        assert np.abs(found - whirl).min() < 1e-3 * whirl
    seen = features.multi_blade(turbine.layout, 3)
    assert {"mean_edge", "cosine_edge", "sine_edge", "cosine_edge_velocity", "sine_edge_velocity"} <= set(
        seen
    )


@pytest.mark.slow(reason="compiles corrected steps for these states")
def test_the_shipped_corrector_in_operation_is_nearer_than_its_method_in_every_wind():
    """All 22 states of blades with edges of their own under control; docs/correctors.md has more winds and their loads."""
    corrector, turbine = find("etdabm3-100ms-operation-edges"), load_turbine("nrel5mw_edges")
    turbine = turbine.operated("controlled")
    winds = [
        fr.TurbulentWind(v, 0.14, seed=9_300_000, duration=42.0, shear_exponent=0.2, harmonics=6).on(
            turbine.rotor
        )
        for v in (4.0, 8.0, 18.0, 24.0)
    ]
    start = np.array([initial_state(turbine, "operating-point", wind) for wind in winds])

    def run(method: str, step: float, **corrected: object) -> list:
        return simulate_block(turbine, method, step, winds, start, 40.0, 0.1, **corrected)

    def errors(found: list) -> np.ndarray:
        away = [
            np.sqrt(((x.state - y.state)[100:] ** 2).mean(axis=0)) for x, y in zip(found, true, strict=True)
        ]
        return np.array([(a / np.ptp(y.state[100:], axis=0)).max() for a, y in zip(away, true, strict=True)])

    true, plain = run("rk7", 0.01), run("etdabm3", 0.1)
    hybrid = run("etdabm3", 0.1, corrector=corrector, mode="hybrid")
    assert (errors(hybrid) < errors(plain) / 2).all()
    assert np.mean([x.accepted.mean() for x in hybrid]) > 0.99


@pytest.mark.slow(reason="compiles a method of every family for these states")
@pytest.mark.parametrize(  # each pair costs a minute of compiling; the exponential Adams methods run above
    ("method", "operation"),
    [("rk4", "fixed"), ("abm4", "controlled"), ("etdrk4", "fixed")],
)
def test_every_family_of_methods_and_every_operation_runs_on_it(method, operation):
    step = 0.2 * stability_limit(load_turbine("nrel5mw_edges"), method)
    wind = fr.TurbulentWind(mean=9.0, intensity=0.14, seed=1, duration=4.0, harmonics=6)
    runs = [
        fr.simulate(
            "nrel5mw_edges",
            wind=wind,
            method=name,
            step=h,
            duration=4.0,
            output_step=0.1,
            operation=operation,
        )
        for name, h in ((method, step), ("rk7", 0.002))
    ]
    assert runs[0].diverged_at is None
    scale = np.ptp(runs[1].state, axis=0)
    errors = np.abs(runs[0].state - runs[1].state).max(axis=0) / scale
    assert errors.max() < 0.02
