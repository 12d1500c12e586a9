"""Training of networks: folding, reproducibility, going on after a stop, and what a good optimiser must reach."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fatigue_runner.corrector.families.mlp import along_trajectories
from fatigue_runner.corrector.maps.layers import apply
from fatigue_runner.corrector.network.pairs import Pairs, Scaling, fold
from fatigue_runner.corrector.network.settings import NetworkSettings
from fatigue_runner.corrector.train import read_recipe
from fatigue_runner.errors import InputError
from fatigue_runner.turbine import load_turbine

pytest.importorskip("torch", reason="training needs the extra `train`")

from fatigue_runner.corrector.network.training import Problem, train, train_scaled

SMALL = NetworkSettings(
    hidden=(12, 12), batch=32, learning_rate=1e-2, patience=10, epochs=12, weight_decay=0.0
)


def linear_problem(n: int = 200, seed: int = 0, noise: float = 0.0) -> Pairs:
    """Inputs far from zero and of very different sizes, as raw azimuths next to strains; targets linear in them."""
    rng = np.random.Generator(np.random.PCG64(seed))
    x = rng.uniform(-1, 1, (n, 3))
    y = x @ np.array([[1.0, -2.0], [0.5, 0.0], [0.0, 1e-3]]) + noise * rng.standard_normal((n, 2))
    return Pairs(x * [1.0, 1e3, 1e-4] + [0.0, 2e3, 1.0], y * [1.0, 1e5] + [3.0, 0.0])


TRAIN, VALIDATION = linear_problem(), linear_problem(60, seed=1)


def same_layers(a, b) -> bool:
    return all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


def is_stopped_after(epochs: int):
    """A progress that presses Ctrl-C."""

    def progress(row):
        if row["epoch"] == epochs:
            raise KeyboardInterrupt

    return progress


@given(seed=st.integers(0, 2**32 - 1), depth=st.integers(1, 3))
def test_folded_scaling_is_the_network_between_two_scalings(seed, depth):
    rng = np.random.Generator(np.random.PCG64(seed))
    sizes = [5, 7, 7, 4][-depth - 1 :]
    layers = [rng.standard_normal((b, a + 1)) for a, b in itertools.pairwise(sizes)]
    x = (
        rng.standard_normal((30, sizes[0])) * 10.0 ** rng.integers(-4, 4, sizes[0])
        + rng.standard_normal(sizes[0]) * 100
    )
    y = rng.standard_normal((30, 4)) * 10.0 ** rng.integers(-3, 3, 4)
    a, b = Scaling.fitted(x), Scaling.fitted(y)
    expected = apply(layers, a.scale(x)) * b.half + b.centre
    # a value far from zero on a small range loses digits in any order of the same arithmetic
    digits = 1e-13 * (1 + np.max(np.abs(x) / a.half))
    np.testing.assert_allclose(
        apply(fold(layers, a, b), x), expected, rtol=0, atol=digits * 1e3 * np.abs(expected).max()
    )


def test_scaling_takes_the_training_set_to_minus_one_and_one_and_leaves_a_constant_column_finite():
    values = np.array([[1.0, 5.0, 0.0], [3.0, 5.0, 0.0], [2.0, 5.0, 0.0]])
    scaled = Scaling.fitted(values).scale(values)
    np.testing.assert_array_equal(scaled[:, 0], [-1.0, 1.0, 0.0])
    np.testing.assert_array_equal(scaled[:, 1:], 0.0)


def test_a_network_overfits_a_linear_problem():
    settings = NetworkSettings(
        hidden=(16,),
        batch=50,
        learning_rate=1e-2,
        patience=20,
        epochs=400,
        weight_decay=0.0,
        activation="isru",
    )
    layers, history = train_scaled(TRAIN, VALIDATION, settings)
    error = apply(layers, VALIDATION.inputs, "isru") - VALIDATION.targets
    assert np.sqrt((error**2).mean(axis=0)) / np.ptp(TRAIN.targets, axis=0) == pytest.approx(0, abs=5e-3)
    assert history.best < 1e-3 * history.validation[0]


def test_the_layers_returned_are_the_ones_with_the_reported_validation_loss():
    layers, history = train_scaled(TRAIN, VALIDATION, SMALL)
    scaling = Scaling.fitted(TRAIN.targets)
    error = (apply(layers, VALIDATION.inputs) - VALIDATION.targets) / scaling.half
    assert np.mean(error**2) == pytest.approx(history.best, rel=1e-4)
    assert history.best == min(history.validation) == history.validation[history.best_epoch - 1]


def test_a_seed_gives_the_same_bits_and_another_seed_others():
    first, again, other = (train_scaled(TRAIN, VALIDATION, s)[0] for s in (SMALL, SMALL, SMALL.but(seed=1)))
    assert same_layers(first, again)
    assert not same_layers(first, other)


def test_training_leaves_the_callers_random_numbers_alone():
    import torch

    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    train_scaled(TRAIN, VALIDATION, SMALL.but(epochs=1))
    assert torch.equal(torch.rand(3), expected)


@pytest.mark.parametrize("there", [False, True])
def test_a_cuda_device_is_used_where_there_is_one_and_made_reproducible(there, monkeypatch):
    import os

    import torch

    from fatigue_runner.corrector.network.training import _device

    monkeypatch.setattr(torch.cuda, "is_available", lambda: there)
    monkeypatch.delenv("CUBLAS_WORKSPACE_CONFIG", raising=False)
    assert _device() == torch.device("cuda" if there else "cpu")
    assert os.environ.get("CUBLAS_WORKSPACE_CONFIG") == (":4096:8" if there else None)


def test_a_training_runs_on_the_device_that_was_chosen(monkeypatch):
    import torch

    if torch.cuda.is_available():
        assert train_scaled(TRAIN, VALIDATION, SMALL)[1].device == "cuda"
        return
    assert train_scaled(TRAIN, VALIDATION, SMALL)[1].device == "cpu"
    # with a device that is not there the first tensor meets it: nothing stays on the processor unasked
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setenv("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    with pytest.raises((AssertionError, RuntimeError), match=r"CUDA|NVIDIA"):
        train_scaled(TRAIN, VALIDATION, SMALL)


def test_a_checkpoints_folder_is_made_before_the_training_and_not_missed_after_it(tmp_path):
    path = tmp_path / "new" / "folder" / "training.ckpt"
    train_scaled(TRAIN, VALIDATION, SMALL, checkpoint=path)
    assert path.is_file()
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be made a folder"):
        train_scaled(TRAIN, VALIDATION, SMALL, checkpoint=tmp_path / "file" / "training.ckpt")


@pytest.mark.parametrize("scheduler", ["plateau", "cosine", "exponential"])
def test_a_resumed_training_equals_an_uninterrupted_one(tmp_path, scheduler):
    settings = SMALL.but(scheduler=scheduler, patience=1)
    whole, history = train_scaled(TRAIN, VALIDATION, settings)
    path = tmp_path / "training.ckpt"
    _, cut = train_scaled(TRAIN, VALIDATION, settings, is_stopped_after(5), path)
    assert cut.stopped and len(cut.train) == 5
    resumed, after = train_scaled(TRAIN, VALIDATION, settings, checkpoint=path)
    assert same_layers(whole, resumed)
    assert (after.validation, after.rate, after.stopped) == (history.validation, history.rate, False)


def test_a_stop_in_the_middle_of_an_epoch_keeps_the_best_and_goes_on_from_the_last_whole_one(
    tmp_path, monkeypatch
):
    import torch

    calls = 0
    whole, history = train_scaled(TRAIN, VALIDATION, SMALL)
    real = torch.nn.functional.mse_loss

    def interrupted(*arguments):
        nonlocal calls
        calls += 1
        if calls == 8 * 6 + 3:  # seven batches and a validation an epoch, and some of the next
            raise KeyboardInterrupt
        return real(*arguments)

    monkeypatch.setattr(torch.nn.functional, "mse_loss", interrupted)
    path = tmp_path / "training.ckpt"
    layers, cut = train_scaled(TRAIN, VALIDATION, SMALL, checkpoint=path)
    assert cut.stopped and len(cut.train) == 6 and cut.best == min(cut.validation)
    scaling = Scaling.fitted(TRAIN.targets)
    kept = np.mean(((apply(layers, VALIDATION.inputs) - VALIDATION.targets) / scaling.half) ** 2)
    assert kept == pytest.approx(cut.best, rel=1e-4)
    resumed, after = train_scaled(TRAIN, VALIDATION, SMALL, checkpoint=path)
    assert same_layers(whole, resumed) and after.validation == history.validation


def test_the_plateau_scheduler_ends_the_training_when_the_rate_cannot_fall_further():
    settings = SMALL.but(patience=1, factor=0.1, smallest_rate=1e-4, epochs=5000)
    _, history = train_scaled(TRAIN, VALIDATION, settings)
    assert len(history.rate) < 5000 and min(history.rate) > 1e-4


def test_a_checkpoint_of_other_samples_or_settings_or_a_cut_one_is_refused(tmp_path):
    path = tmp_path / "training.ckpt"
    train_scaled(TRAIN, VALIDATION, SMALL, checkpoint=path)
    with pytest.raises(InputError, match="other samples or settings"):
        train_scaled(linear_problem(noise=1e-6), VALIDATION, SMALL, checkpoint=path)
    with pytest.raises(InputError, match="other samples or settings"):
        train_scaled(TRAIN, VALIDATION, SMALL.but(batch=64), checkpoint=path)
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(InputError, match="no whole checkpoint"):
        train_scaled(TRAIN, VALIDATION, SMALL, checkpoint=path)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"scheduler": "platau"}, "training.scheduler: 'platau' is not known; did you mean 'plateau'"),
        ({"batch": 0}, "training.batch must be above 0; got 0"),
        ({"factor": 1.0}, "training.factor must be below 1; got 1.0"),
        ({"hidden": [501]}, "hidden layers have 1 to 500 units"),
        ({"smallest_rate": 1.0}, "training.smallest_rate: lies above learning_rate 0.002"),
    ],
)
def test_impossible_settings_are_refused_in_one_sentence(wrong, message):
    speeds = {"train": [6.0], "validation": [7.0]}
    with pytest.raises(InputError, match=message):
        read_recipe({"name": "x", "family": "mlp", "step": 0.01, "speeds": speeds, "training": wrong})


def test_a_network_that_begins_at_zero_is_kept_as_it_is_where_no_epoch_is_better():
    """Its targets are zero on the validation samples: every epoch can only spoil that."""
    still = Pairs(VALIDATION.inputs, 0 * VALIDATION.targets)
    layers, history = train(Problem(TRAIN, still, from_zero=True), SMALL)
    assert (history.best_epoch, history.best, history.start) == (0, 0.0, 0.0)
    np.testing.assert_array_equal(apply(layers, VALIDATION.inputs), 0.0)


def test_samples_that_are_no_numbers_teach_nothing():
    with pytest.raises(InputError, match="not finite"):
        Pairs(np.array([[1.0]]), np.array([[np.nan]]))


@pytest.fixture(scope="module")
def turbine_samples(t2b1i1cg):
    from fatigue_runner.wind import ConstantWind

    turbine = t2b1i1cg
    winds = [ConstantWind(7.0), ConstantWind(8.0)]
    initial = np.array([turbine.operating_point(w.mean_speed) for w in winds])
    return along_trajectories(turbine, "heun", 0.01, winds, initial, 0.5, perturbed=1), initial


def test_samples_along_trajectories_begin_at_the_initial_states_and_follow_one_another(turbine_samples):
    samples, initial = turbine_samples
    raw = samples.raw[:, 1:17]
    np.testing.assert_array_equal(raw[[0, 50]], initial)
    # the exact step from one sample is the next sample
    np.testing.assert_allclose(samples.exact[:49], raw[1:50], rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(samples.raw[:100, 17], np.repeat([7.0, 8.0], 50))


def test_perturbed_samples_follow_the_ones_along_the_trajectories_and_keep_the_azimuth(turbine_samples):
    samples, _ = turbine_samples
    on, off = samples.raw[:100], samples.raw[100:]
    assert len(off) == 100
    np.testing.assert_array_equal(on[:, 7], off[:, 7])
    assert (on[:, 9:15] != off[:, 9:15]).all()


def test_targets_are_the_defect_over_the_step_cubed_for_heun(turbine_samples):
    samples, _ = turbine_samples
    recipe, _ = read_recipe(
        {"name": "x", "family": "mlp", "step": 0.01, "speeds": {"train": [6], "validation": [7]}}
    )
    found, _ = recipe.pair_sets(load_turbine("t2b1i1cg"), samples, samples)
    np.testing.assert_allclose(found.targets, (samples.exact - samples.plain) / 1e-6)
    np.testing.assert_array_equal(found.inputs, samples.raw[:, 1:])
