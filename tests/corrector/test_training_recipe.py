"""From a recipe to an artefact that runs: what the corrector carries, and what a wrong recipe is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from places import CORRECTORS

from fatigue_runner.errors import InputError

pytest.importorskip("torch", reason="training needs the extra `train`")

from simulating import simulate_block

from fatigue_runner.corrector import artefact
from fatigue_runner.corrector.train import read_recipe, train, tune_file
from fatigue_runner.integrators.initial import initial_state
from fatigue_runner.wind import ConstantWind

TINY = {
    "name": "tiny",
    "family": "mlp",
    "method": "heun",
    "step": 0.01,
    "speeds": {"train": [6.0, 8.0], "validation": [7.0]},
    "duration": 0.4,
    "training": {"hidden": [10], "epochs": 30, "learning_rate": 1e-2, "batch": 16},
}


def recipe(**changed):
    return read_recipe({**TINY, **changed})[0]


@pytest.fixture(scope="module")
def turbine(t2b1i1cg):
    return t2b1i1cg


@pytest.fixture(scope="module")
def trained(turbine):
    return train(recipe(), turbine, text="the recipe")


def test_a_trained_corrector_carries_its_origin_and_survives_its_file(trained, turbine, tmp_path):
    corrector = trained
    artefact.save(corrector, tmp_path / "tiny.safetensors")
    again = artefact.load(tmp_path / "tiny.safetensors")
    assert (again.turbine_hash, again.method, again.step, again.wind_range) == (
        turbine.hash,
        "heun",
        0.01,
        (6.0, 8.0),
    )
    assert again.recipe == "the recipe"
    assert again.training == corrector.training and again.training["best_epoch"] > 1
    layers = again.map.layers
    assert all(np.array_equal(a, b) for a, b in zip(layers, corrector.map.layers, strict=True))
    assert [layer.shape for layer in layers] == [(10, 18), (16, 11)]


def test_the_kernel_applies_the_network_that_was_trained(trained, turbine):
    corrector = trained
    samples, _ = recipe().sample_sets(turbine)
    wind = ConstantWind(6.0)
    start = initial_state(turbine, "paper-spinning", wind)
    run = simulate_block(turbine, "heun", 0.01, [wind], start[None], 0.01, corrector=corrector)[0]
    expected = samples.plain[0] + corrector.predict(samples)[0]
    np.testing.assert_allclose(run.state[1], expected, rtol=1e-12, atol=1e-15)


def test_the_hybrid_trusts_the_network_where_the_discrepancy_is_within_the_limit_as_on_most_training_steps(
    trained, turbine
):
    corrector = trained
    samples, _ = recipe().sample_sets(turbine)
    wind = ConstantWind(8.0)
    start = samples.raw[40:41, 1:17]
    run = simulate_block(turbine, "heun", 0.01, [wind], start, 0.1, corrector=corrector, mode="hybrid")[0]
    # which step of this tiny network lies at the limit depends on the last bits of the BLAS that trained it
    assert np.array_equal(run.accepted, run.discrepancy <= corrector.guard.limit)
    assert run.accepted.sum() >= 8


def test_the_hybrid_takes_the_fallback_where_the_wind_leaves_the_bounds_however_near_the_network_is(turbine):
    corrector = train(recipe(guard={"quantile": 1, "margin": 0.25}), turbine)
    guard = corrector.guard
    # 6 to 8 m/s and a quarter of that beyond, on both sides
    assert (guard.low[-1], guard.high[-1]) == (pytest.approx(5.5), pytest.approx(8.5))
    near = replace(corrector, guard=replace(guard, limit=1e30))
    winds = [ConstantWind(v) for v in (5.4, 5.6, 8.4, 8.6)]
    start = np.array([initial_state(turbine, "paper-spinning", ConstantWind(7.0))] * 4)
    run = simulate_block(turbine, "heun", 0.01, winds, start, 0.1, corrector=near, mode="hybrid")
    assert [bool(r.accepted[0]) for r in run] == [False, True, True, False]
    rk3 = simulate_block(turbine, "rk3", 0.01, winds, start, 0.1)
    for i in (0, 3):
        assert not run[i].accepted.any() and np.isfinite(run[i].discrepancy).all()
        np.testing.assert_allclose(run[i].state, rk3[i].state, rtol=1e-12, atol=1e-15)


def test_bounds_survive_the_artefact_and_wrong_ones_are_refused(trained, tmp_path):
    corrector = trained
    bounds = {"low": (-1.0,) * 17, "high": (1.0,) * 17, "margin": 0.5}
    artefact.save(
        replace(corrector, guard=replace(corrector.guard, **bounds)), tmp_path / "bounded.safetensors"
    )
    found = artefact.load(tmp_path / "bounded.safetensors").guard
    assert (found.low, found.high, found.margin) == (bounds["low"], bounds["high"], 0.5)
    with pytest.raises(InputError, match="bounds 3 features, there are 17"):
        replace(corrector, guard=replace(corrector.guard, low=(0.0,) * 3, high=(1.0,) * 3))
    for low, high in (((0.0,), ()), ((2.0,), (1.0,)), ((float("nan"),), (1.0,))):
        with pytest.raises(InputError, match="low and high"):
            replace(corrector.guard, low=low, high=high)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sped": 1}, "recipe: unknown key 'sped'; did you mean 'speeds'"),
        ({"speeds": {"train": []}}, "recipe: speeds.train must hold at least 1 value"),
        ({"training": {"batchsize": 3}}, "unknown key 'batchsize' in training; did you mean 'batch'"),
        ({"guard": {"kappa": 0.5}}, "recipe: guard.kappa must be at least 1"),
        ({"step": -1}, "recipe: step must be above 0"),
        ({"initial": "papr"}, "recipe: initial: 'papr' is not known; did you mean 'paper'"),
        ({"name": "a/b"}, "recipe: name: must consist of letters"),
        (
            {"factors": ["rotor_speed"]},
            "factors: the key belongs to family affine of exponential-adams methods and affine of runge",
        ),
    ],
)
def test_a_wrong_recipe_is_refused_with_the_key(change, message):
    with pytest.raises(InputError, match=message):
        recipe(**change)


def test_a_file_that_is_no_recipe_is_refused(tmp_path):
    for text in ("[1, 2]", "a: [", "\x00"):
        (tmp_path / "recipe.yaml").write_text(text)
        with pytest.raises(InputError, match=r"recipe\.yaml"):
            read_recipe(tmp_path / "recipe.yaml")
    with pytest.raises(InputError, match="no such file"):
        read_recipe(tmp_path / "absent.yaml")


def test_a_method_without_a_cheap_fallback_is_refused():
    with pytest.raises(InputError, match="rk4 shares its stages with no method"):
        recipe(method="rk4")


PAPER = sorted(CORRECTORS.glob("paper-heun-*.yaml"))


@pytest.mark.parametrize("path", PAPER, ids=lambda p: p.stem)
def test_the_papers_recipes_keep_its_sizes_and_its_split(path):
    recipe, _ = read_recipe(path)
    settings = recipe.training
    assert (settings.hidden, settings.activation, settings.scheduler) == ((111, 111, 111), "relu", "plateau")
    assert recipe.speeds.train == [6.1, 6.7, 7.8, 8.3, 8.8, 9.4] and recipe.speeds.validation == [5, 7.2]


@pytest.mark.parametrize("path", PAPER, ids=lambda p: p.stem)
def test_the_papers_networks_are_closer_than_rk3_on_winds_that_they_have_not_seen(path, turbine):
    corrector = artefact.load(path.with_suffix(".safetensors"))
    assert corrector.recipe == path.read_text(encoding="utf-8")
    assert path.with_suffix(".safetensors").stat().st_size < 400_000
    winds = [ConstantWind(v) for v in (6.45, 7.5, 9.1)]
    start = np.array([initial_state(turbine, "paper-spinning", w) for w in winds])
    step = corrector.step
    exact = simulate_block(turbine, "dop853", 0.005, winds, start, 20.0, 0.1)

    def errors(method, **more):
        runs = simulate_block(turbine, method, step, winds, start, 20.0, 0.1, **more)
        extent = np.ptp([e.state for e in exact], axis=(0, 1))
        return [float(np.mean(((r.state - e.state) / extent) ** 2)) for r, e in zip(runs, exact, strict=True)]

    assert all(np.array(errors("heun", corrector=corrector)) < np.array(errors("rk3")))


@pytest.mark.parametrize("path", PAPER, ids=lambda p: p.stem)
def test_the_papers_hybrid_is_nowhere_worse_than_rk3_up_to_20_metres_per_second(path, turbine):
    corrector = artefact.load(path.with_suffix(".safetensors"))
    # in range, at the edges of the bounds, where the network errs most (11 to 13 m/s), and far out
    speeds = (5.0, 7.2, 9.9, 10.05, 10.5, 11.5, 12.4, 13.5, 16.0, 20.0)
    winds = [ConstantWind(v) for v in speeds]
    start = np.array([initial_state(turbine, "paper-spinning", w) for w in winds])
    exact = simulate_block(turbine, "dop853", 0.005, winds, start, 20.0, 0.1)

    def errors(method, **more):
        runs = simulate_block(turbine, method, corrector.step, winds, start, 20.0, 0.1, **more)
        extent = [np.maximum(np.ptp(e.state, axis=0), 1e-12) for e in exact]
        found = [np.mean(((r.state - e.state) / x) ** 2) for r, e, x in zip(runs, exact, extent, strict=True)]
        return np.array(found), np.array([r.accepted.mean() for r in runs])

    hybrid, accepted = errors("heun", corrector=corrector, mode="hybrid")
    rk3, _ = errors("rk3")
    assert (hybrid <= rk3 * (1 + 1e-9)).all()
    # the share of tenths of a second in which every step was accepted
    assert (accepted[:4] > 0.4).all() and not accepted[4:].any()


def test_train_tunes_first_and_keeps_what_it_found(tmp_path, capsys, monkeypatch):
    pytest.importorskip("optuna", reason="tuning needs the extra `train`")
    import sys

    from fatigue_runner.cli import main

    path = tmp_path / "tiny.yaml"
    path.write_text(
        "name: tiny\nfamily: mlp\nmethod: heun\nstep: 0.01\nspeeds: {train: [6, 8], validation: [7]}\nduration: 0.2\n"
        "training: {hidden: [6], epochs: 3}\n"
    )
    monkeypatch.setattr(
        sys,
        "argv",
        ["fatigue-runner", "train", str(path), "--tune", "2", "--tune-epochs", "1", "--seed", "4"],
    )
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code in (0, None)
    assert capsys.readouterr().out.count("trial ") == 2
    made = artefact.load(tmp_path / "tiny.safetensors")
    assert made.training["seed"] == 4 and "'scheduler':" in made.recipe and "'batch':" in made.recipe
    assert (tmp_path / ".tiny.tuning.db").exists() and not (tmp_path / ".tiny.checkpoint").exists()


def test_an_affine_recipe_has_nothing_to_tune():
    path = sorted(CORRECTORS.glob("heun-10ms*.yaml"))[0]
    with pytest.raises(InputError, match="nothing to tune"):
        tune_file(path, Path("unused.db"), 1, 1)
