"""From a recipe file to a corrector in a campaign: what is trained, what is refused, what is found."""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

from fatigue_runner.cli import app
from fatigue_runner.corrector import fit, load
from fatigue_runner.corrector.train import read_recipe, train_file
from fatigue_runner.errors import InputError

RECIPE = """
name: quick
family: affine
method: heun
step: 0.02
training: {type: constant, speeds: [6, 7, 8, 9], vertical_shear: [0.1], duration: 15}
validation: {type: constant, speeds: [7.4], vertical_shear: [0.1], duration: 10}
samples: 300
"""


def recipe(tmp_path, change=lambda text: text):
    path = tmp_path / "quick.yaml"
    path.write_text(change(RECIPE))
    return path


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("correctors")
    return train_file(recipe(folder))


def test_a_recipe_gives_a_corrector_that_beats_its_method_on_winds_it_has_not_seen(made):
    figures = load(made.path).validation
    assert figures["nrmse_enhanced"] < figures["nrmse_plain"] / 50
    assert figures["nrmse_hybrid"] < figures["nrmse_plain"] / 50
    assert figures["acceptance"] > 0.99


def test_the_card_says_how_it_was_made_and_how_good_it_is(made):
    text = made.card.read_text()
    for words in (
        "# quick",
        "heun, 20 ms",
        "fatigue-runner train",
        "| enhanced, median |",
        "seed: 0",
        "6.00 to 9.00 m/s",
    ):
        assert words in text


def test_the_same_recipe_gives_the_same_bits_and_another_seed_others(made, tmp_path):
    again = train_file(recipe(tmp_path)).corrector
    np.testing.assert_array_equal(again.map.linear, made.corrector.map.linear)
    assert again.guard == made.corrector.guard
    other = train_file(recipe(tmp_path), overrides={"seed": 1}).corrector
    assert not np.array_equal(other.map.linear, made.corrector.map.linear)
    assert "seed: 1" in other.recipe


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.replace("samples:", "sampels:"), "quick.yaml:8: unknown key 'sampels'; did you mean 'samples'"),
        (lambda t: t.replace("vertical_shear", "vertikal_shear"), "quick.yaml:6: unknown key 'vertikal_shear' in training; did you mean"),
        (lambda t: t + "factors: [wind_sped@start]\n", "unknown feature factor 'wind_sped@start'; did you mean 'wind_speed@start'"),
        (lambda t: t.replace("family: affine", "family: afine"), "quick.yaml:3: unknown family 'afine'; did you mean 'affine'"),
        (lambda t: t.replace("family: affine\n", ""), "key 'family' is missing; known: affine, affine+net, mlp"),
        (lambda t: t.replace("method: heun", "method: hein"), "quick.yaml:4: method: unknown integrator 'hein'; did you mean 'heun'"),
        (lambda t: t.replace("method: heun", "method: ab4"), "correctors exist for Runge-Kutta and exponential Adams methods"),
        (lambda t: t.replace("step: 0.02", "step: -1"), "quick.yaml:5: step must be above 0; got -1"),
        (lambda t: t.replace("step: 0.02\n", ""), "key 'step' is missing"),
        (
            lambda t: t.replace("speeds: [7.4]", "speeds: [6, 7, 8, 9]").replace("duration: 10", "duration: 15"),
            "quick.yaml:7: validation: must hold other winds",
        ),
        (lambda t: t.replace("samples: 300", "samples: ["), "not valid YAML"),
        (lambda t: "[1, 2]", "a recipe is a mapping of keys (name, family, method"),
        (lambda t: t.replace("duration: 15", "duration: 0.02"), "training.duration must be at least 2; got 0.02"),
        (lambda t: t + "turbine: nrel5mv\n", "nrel5mv"),
        (lambda t: t + "generator_damping: 1.5\n", "the key belongs to family affine of exponential-adams methods"),
        (
            lambda t: t.replace("heun", "etdabm3") + "perturbation: 1.0e-5\n",
            "quick.yaml:9: perturbation: the key belongs to family affine of runge-kutta methods",
        ),
        (lambda t: t.replace("heun", "etdabm3") + "guard: {substeps: 2}\n", "quick.yaml:9: unknown key 'substeps' in guard"),
        (
            lambda t: t.replace("heun", "etdabm3") + "factors: [sin_azimuth]\n",
            "quick.yaml:9: factors: feature factor 'sin_azimuth' does not exist for exponential methods",
        ),
    ],
)  # fmt: skip
def test_a_wrong_recipe_is_refused_with_the_file_and_the_way_out(tmp_path, change, words):
    with pytest.raises(InputError) as caught:
        train_file(recipe(tmp_path, change))
    assert words in str(caught.value)
    assert not list(tmp_path.glob("*.safetensors"))


def test_a_missing_recipe_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        train_file(tmp_path / "none.yaml")


def test_turbulent_winds_of_a_recipe_are_the_same_each_time_and_differ_from_those_of_validation():
    part = {"speeds": {"start": 5, "stop": 10, "count": 3}, "duration": 10}
    parsed, _ = read_recipe(
        {
            "name": "x",
            "family": "affine",
            "method": "rk4",
            "step": 0.1,
            "training": {**part, "seed": 1},
            "validation": {**part, "seed": 2},
        }
    )
    a, b, c = parsed.training.build(), parsed.training.build(), parsed.validation.build()
    assert a == b
    assert {w.seed for w in a}.isdisjoint({w.seed for w in c})
    assert [w.mean_speed for w in a] == [5.0, 7.5, 10.0]


def test_the_command_line_lists_and_shows_correctors(made):
    run = CliRunner().invoke
    listed = run(app, ["correctors", "list", "--folder", str(made.path.parent)])
    assert listed.exit_code == 0
    assert "quick" in listed.output and "step [ms]" in listed.output
    shown = run(app, ["correctors", "show", "quick", "--folder", str(made.path.parent)])
    assert "# quick" in shown.output
    assert "family: affine" in shown.output


def test_the_command_line_trains(tmp_path):
    ran = CliRunner().invoke(
        app,
        ["train", str(recipe(tmp_path)), "--step", "0.01", "--name", "quick10", "--out", str(tmp_path / "o")],
    )
    assert ran.exit_code == 0, ran.output
    assert load(tmp_path / "o" / "quick10.safetensors").step == 0.01
    assert (tmp_path / "o" / "quick10.md").is_file()


class TestInACampaign:
    def campaign(self, made, **more):
        return {
            "name": "corrected", "duration": 10, "wind": {"speeds": [7.4], "vertical_shear": 0.1}, "log": {"enabled": False},
            "integrators": [{"method": "heun", "step": 0.02}, {"method": "heun", "step": 0.02, "corrector": str(made.path), **more}],
            "reference": {"method": "dop853", "step": 0.02},
        }  # fmt: skip

    def test_a_corrected_integrator_is_one_more_row_with_its_corrector_and_mode(self, made, tmp_path):
        from fatigue_runner.campaign import run_campaign

        results = run_campaign(self.campaign(made), tmp_path / "out", workers=1)
        (plain,) = results.where(method="heun", corrector=None)
        (hybrid,) = results.where(corrector="quick", mode="hybrid")
        assert hybrid["case_id"].endswith("heun_20ms_hybrid_quick")
        assert hybrid["nrmse_max"] < plain["nrmse_max"] / 10
        assert hybrid["acceptance_rate"] > 0.99
        assert (hybrid["trained_from"], hybrid["trained_to"]) == load(made.path).wind_range
        assert plain["trained_from"] is None

    @pytest.mark.parametrize(
        ("more", "words"),
        [
            ({"corrector": "quikc"}, "there is no corrector"),
            ({"step": 0.01}, "trained for step 0.02 s, the campaign uses 0.01 s"),
            ({"method": "rk4"}, "was trained for heun, the campaign uses rk4"),
            ({"mode": "hybird"}, "'hybird' is not known; did you mean 'hybrid'"),
        ],
    )
    def test_one_that_does_not_fit_is_refused_before_anything_runs(self, made, tmp_path, more, words):
        from fatigue_runner.campaign import run_campaign

        with pytest.raises(InputError, match=words):
            run_campaign(self.campaign(made, **more), tmp_path / "out")
        assert not (tmp_path / "out").exists()

    def test_winds_outside_those_of_the_training_are_allowed_and_said_once(self, made):
        from fatigue_runner.campaign.plan import make_plan

        campaign = self.campaign(made)
        assert not [note for note in make_plan(campaign).notes if "trained" in note]
        campaign["wind"]["speeds"] = [5.0, 7.4, 10.5]
        (note,) = (note for note in make_plan(campaign).notes if "trained" in note)
        assert (
            "quick was trained on winds of 6 to 9 m/s; 2 mean wind speed(s) lie outside, up to 10.5 m/s"
            in note
        )

    def test_a_mode_without_a_corrector_is_refused(self, made, tmp_path):
        from fatigue_runner.campaign import run_campaign

        campaign = self.campaign(made)
        campaign["integrators"][0]["mode"] = "hybrid"
        with pytest.raises(InputError, match="means nothing without `corrector`"):
            run_campaign(campaign, tmp_path / "out")


def test_the_api_simulates_with_a_corrector(made):
    import fatigue_runner as fr

    run = fr.simulate("nrel5mw", 7.4, "heun", 0.02, 1.0, corrector=made.path, mode="hybrid")
    assert np.isfinite(run.discrepancy).all()
    assert all(c.method and c.step for c in fr.correctors())


def test_a_robust_fit_finds_the_map_that_most_steps_follow_whatever_a_few_do():
    rng = np.random.Generator(np.random.PCG64(3))
    rows = rng.standard_normal((2000, 6))
    truth = rng.standard_normal((16, 6))
    defects = rows @ truth.T + 1e-3 * rng.standard_normal((2000, 16))
    defects[:40] += 5.0  # two in a hundred steps cross a corner
    plain, robust = fit.affine(rows, defects), fit.robust(rows, defects, watched=(0, 3))
    assert 5 * np.abs(robust - truth).max() < np.abs(plain - truth).max()
