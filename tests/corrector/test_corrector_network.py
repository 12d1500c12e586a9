"""A small network on what an affine map leaves, and refinement by rollouts: from a recipe to the compiled step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from corrector_example import collect, operating_points, trained, training_samples, turbine, with_map
from simulating import simulate_block
from typer.testing import CliRunner

from fatigue_runner.cli import app
from fatigue_runner.corrector import load, rollouts, samples
from fatigue_runner.corrector.families import affine_net
from fatigue_runner.corrector.features import drive
from fatigue_runner.corrector.recipe import Progress
from fatigue_runner.corrector.train import train_file
from fatigue_runner.errors import InputError
from fatigue_runner.integrators.initial import initial_state
from fatigue_runner.wind import ConstantWind

torch = pytest.importorskip("torch", reason="networks are trained with PyTorch")

RECIPE = """
name: tiny
family: affine+net
method: heun
step: 0.05
initial: paper-spinning
training: {type: constant, speeds: [6, 7, 8, 9], vertical_shear: [0.1], duration: 15}
validation: {type: constant, speeds: [7.4], vertical_shear: [0.1], duration: 10}
samples: 200
network: {hidden: [8], epochs: 12, batch: 50, learning_rate: 0.01}
"""


def recipe(folder, change=lambda text: text):
    path = folder / "tiny.yaml"
    path.write_text(change(RECIPE))
    return path


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    told = []
    found = train_file(recipe(tmp_path_factory.mktemp("network")), progress=Progress(epoch=told.append))
    return found, told


def test_the_network_leaves_less_of_unseen_defects_than_the_affine_map_below_it(made):
    corrector = made[0].corrector
    winds = [ConstantWind(7.4, 0.1)]
    start = initial_state(turbine(), "paper-spinning", winds[0])[None]
    unseen = collect("heun", 0.05, winds, 10.0, 200, 1e-5, 7, initial=start)
    affine = with_map(corrector, layers=(), activation="identity")
    left = [
        np.median(np.abs(c.predict(unseen) - unseen.defect), axis=0)[list(drive(turbine().layout))]
        for c in (affine, corrector)
    ]
    assert np.median(left[1] / left[0]) < 0.9


def test_a_compiled_step_adds_the_defect_that_predict_says(made):
    corrector = load(made[0].path)
    wind = ConstantWind(7.4, 0.1)
    start = operating_points([wind])
    (run,) = simulate_block(turbine(), "heun", 0.05, [wind], start, 2.0, corrector=corrector)
    pieces = samples.wind_pieces(turbine(), wind, run.time[:-1], 0.05)
    steps = samples.single_steps(turbine(), "heun", 0.05, run.state[:-1], pieces)
    difference = np.abs(steps.plain + corrector.predict(steps) - run.state[1:])
    assert (difference <= 1e-12 * (1 + np.abs(run.state[1:]))).all()
    assert np.abs(corrector.predict(steps) - with_map(corrector, layers=()).predict(steps)).max() > 1e-9


def test_every_epoch_is_told_and_the_best_one_kept(made):
    found, told = made
    assert [t["epoch"] for t in told] == list(range(1, 13))
    assert {"epochs", "train", "validation", "best", "rate"} <= set(told[0])
    best = found.corrector.training["network_best_epoch"]
    assert told[best - 1]["validation"] == told[-1]["best"]


def test_the_same_seed_gives_the_same_bits_and_another_one_others(made, tmp_path):
    again = train_file(recipe(tmp_path)).corrector
    for a, b in zip(again.map.layers, made[0].corrector.map.layers, strict=True):
        np.testing.assert_array_equal(a, b)
    other = train_file(recipe(tmp_path, lambda t: t.replace("0.01}", "0.01, seed: 1}")))
    np.testing.assert_array_equal(other.corrector.map.linear, again.map.linear)
    assert not np.array_equal(other.corrector.map.layers[0], again.map.layers[0])


def test_a_training_that_was_stopped_goes_on_to_the_same_bits(made, tmp_path):
    def press_ctrl_c(told):
        if told["epoch"] == 5:
            raise KeyboardInterrupt

    path = tmp_path / "training.checkpoint"
    cut = train_file(recipe(tmp_path), progress=Progress(epoch=press_ctrl_c, checkpoint=path)).corrector
    assert path.exists() and cut.training["network_epochs"] == 5
    resumed = train_file(recipe(tmp_path), progress=Progress(checkpoint=path)).corrector
    assert not path.exists()
    for a, b in zip(resumed.map.layers, made[0].corrector.map.layers, strict=True):
        np.testing.assert_array_equal(a, b)


def test_training_leaves_the_callers_random_numbers_and_threads_alone():
    torch.manual_seed(5)
    expected, threads = torch.rand(1).item(), torch.get_num_threads()
    torch.manual_seed(5)
    settings = affine_net.NetworkRecipe(hidden=[4], epochs=1)
    size = trained().binding.size
    affine_net.add(
        trained().map, size, training_samples(), training_samples(), settings, drive(turbine().layout)
    )
    assert torch.rand(1).item() == expected
    assert torch.get_num_threads() == threads


def test_a_folded_layer_sees_plain_rows_as_the_layer_sees_whitened_ones():
    rng = np.random.Generator(np.random.PCG64(1))
    rows = rng.standard_normal((500, 5)) @ rng.standard_normal((5, 5)) * [1, 1e3, 1e-4, 1, 0] + 3.0
    layer = rng.standard_normal((3, 6))
    whitening = affine_net.Whitening.of(rows)
    white = whitening(rows)
    np.testing.assert_allclose(np.cov(white.T).diagonal()[-4:], 1.0, rtol=1e-6)
    folded = whitening.folded(layer)
    expected = layer[:, 0] + white @ layer[:, 1:].T
    np.testing.assert_allclose(folded[:, 0] + rows @ folded[:, 1:].T, expected, atol=1e-8)


def test_a_step_that_nothing_can_follow_hardly_pulls():
    left = torch.tensor([[1.0] * 16, [1e6] * 16], dtype=torch.double, requires_grad=True)
    affine_net.loss(left, torch.full((16,), 1 / 16, dtype=torch.double)).sum().backward()
    assert left.grad[1].abs().max() < 1e-4 * left.grad[0].abs().max()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.replace("hidden:", "hiden:"), "tiny.yaml:10: unknown key 'hiden' in network; did you mean 'hidden'"),
        (lambda t: t.replace("hidden: [8]", "hidden: []"), "network.hidden must hold at least 1 value"),
        (lambda t: t.replace("hidden: [8]", "hidden: [8, 900]"), "network.hidden: hidden layers have 1 to 500 units"),
        (lambda t: t.replace("epochs: 12", "epochs: 0"), "tiny.yaml:10: network.epochs must be at least 1; got 0"),
        (lambda t: t.replace("affine+net", "affine"), "network: the key belongs to family affine+net of runge-kutta methods; leave it out"),
        (lambda t: t[: t.index("network")], "key 'network' is missing"),
        (lambda t: t.replace("affine+net", "affin+net"), "unknown family 'affin+net'; did you mean 'affine+net'"),
        (lambda t: t + "refine: {round: 2}\n", "unknown key 'round' in refine; did you mean 'rounds'"),
        (lambda t: t.replace("method: heun", "method: etdabm3"), "etdabm3 is one of the exponential-adams methods; for those"),
    ],
)  # fmt: skip
def test_a_wrong_recipe_is_refused_with_the_file_the_key_and_the_way_out(tmp_path, change, words):
    with pytest.raises(InputError) as caught:
        train_file(recipe(tmp_path, change))
    assert words in str(caught.value)
    assert str(tmp_path / "tiny.yaml") in str(caught.value)
    assert not list(tmp_path.glob("*.safetensors"))


def test_the_command_line_lists_and_shows_it(made):
    run, folder = CliRunner().invoke, str(made[0].path.parent)
    assert "affine+net" in run(app, ["correctors", "list", "--folder", folder]).output
    shown = run(app, ["correctors", "show", "tiny", "--folder", folder]).output
    assert "16 x 43, 8 x 43, 16 x 9" in shown
    assert "network best epoch" in shown


class TestRefinement:
    def rounds(self, errors, diverged=()):
        """Which round is kept where the rounds' maps have these errors."""
        made = [replace(trained(), name=str(i)) for i in range(len(errors))]
        numbers = iter(made[1:])
        best, _, said = rollouts.refine(
            made[0], training_samples(), len(errors) - 1, lambda found: next(numbers),
            lambda c, number: None if number in diverged else training_samples(), lambda c: errors[int(c.name)],
        )  # fmt: skip
        return int(best.name), said["refinement"]

    def test_the_round_with_the_least_error_is_kept(self):
        assert self.rounds([3e-3, 1e-3, 2e-3]) == (
            1,
            "validation NRMSE 0.003 -> 0.001 -> 0.002; kept round 1",
        )
        assert self.rounds([1e-3, 2e-3, np.inf])[0] == 0

    def test_where_every_run_diverges_it_ends(self):
        assert self.rounds([1e-3, 5e-4, 1e-4], diverged=(2,))[0] == 1

    @pytest.mark.parametrize("history", [0, 1])
    def test_samples_lie_on_the_states_that_the_corrected_method_steps_from(self, history):
        corrector = trained("rk4", 0.1, history=history)
        wind = ConstantWind(7.4, 0.1)
        start = operating_points([wind])
        ground = rollouts.Ground([wind], start, 20, 3)
        found = rollouts.visited(turbine(), corrector, ground, 4.0, 1)
        assert found is not None
        (run,) = simulate_block(turbine(), "rk4", 0.1, [wind], start, 4.0, corrector=corrector)
        nearest = np.abs(found.state[:, None, :] - run.state[None]).max(axis=2).min(axis=1)
        assert nearest.max() == 0.0
        assert np.abs(found.exact - found.plain - found.defect).max() == 0.0

    def test_a_recipe_with_refinement_says_what_each_round_gave(self, tmp_path):
        def refined(text):
            return (
                text[: text.index("network")].replace("affine+net", "affine")
                + "refine: {rounds: 1, duration: 5}\n"
            )

        found = train_file(recipe(tmp_path, refined)).corrector
        assert found.training["refinement"].startswith("validation NRMSE")
        assert "refinement: validation NRMSE" in (tmp_path / "tiny.md").read_text()
