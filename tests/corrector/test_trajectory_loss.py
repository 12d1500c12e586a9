"""Loss `trajectory`: what it follows, what its fit makes small, what a recipe with it gives and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from fatigue_runner.corrector import Corrector, coordinates, fit, trajectory_loss
from fatigue_runner.corrector.judging import Judge
from fatigue_runner.corrector.recipe import Progress
from fatigue_runner.corrector.samples import places
from fatigue_runner.corrector.train import read_recipe, train
from fatigue_runner.corrector.trajectory_loss import Windows
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import MODES, Integrator, multi_blade
from fatigue_runner.turbine import load_turbine

H, LENGTH, COUNT = 0.1, 30, 40  # s; steps of a window; windows


@pytest.fixture(scope="module", params=["nrel5mw", "nrel5mw_edges"])
def turbine(request):
    return load_turbine(request.param)


def propagated(errors, a):
    """(n, size) of e_n in windows by the recursion itself: E_{n+1} = exp(h A) E_n + e_n."""
    step = expm(H * a)
    out = errors.reshape(-1, LENGTH, errors.shape[1]).copy()
    for n in range(1, LENGTH):
        out[:, n] += out[:, n - 1] @ step.T
    return out.reshape(errors.shape)


def random_steps(turbine, rows=8):
    """Rows, defects and azimuths of windows of steps; the defects have a share that no map of the rows follows, slow against a step."""
    rng = np.random.Generator(np.random.PCG64(5))
    n, size = LENGTH * COUNT, turbine.layout.size
    seen = rng.standard_normal((n, rows))
    rest = np.repeat(rng.standard_normal((n // 10, size)), 10, axis=0) + rng.standard_normal((n, size))
    start = rng.uniform(0, 2 * np.pi, (COUNT, 1))
    azimuth = (start + 0.1 * np.arange(LENGTH) * rng.uniform(0.8, 1.2, (COUNT, 1))).ravel()
    return seen, seen @ rng.standard_normal((rows, size)) + rest, azimuth


def test_modes_carry_errors_as_the_exponential_of_the_linear_part_does(turbine):
    layout = turbine.layout
    a = multi_blade.linear(turbine, 0.0).isotropic
    _, defects, azimuth = random_steps(turbine)

    def followed(fixed, errors, turning):
        windows = Windows(trajectory_loss.modes(turbine, H, fixed), LENGTH, turning)
        return sum(
            mode.times
            * np.outer(windows.followed((errors @ mode.part)[:, None], mode)[:, 0], mode.shape).real
            for mode in windows.modes
        )

    own = propagated(defects, a)
    assert np.abs(followed(False, defects, None) - own).max() < 1e-9 * np.abs(own).max()
    # in multi-blade coordinates the same errors come in turned by the azimuth, and are followed in the frame of azimuth zero
    turn = np.cos(azimuth), np.sin(azimuth)
    still = np.ones(len(azimuth)), np.zeros(len(azimuth))
    fixed = followed(True, coordinates.to_fixed(layout, defects, turn), azimuth)
    assert np.abs(coordinates.from_fixed(layout, fixed, still) - own).max() < 1e-9 * np.abs(own).max()


def test_the_fit_makes_the_trajectories_error_small_and_least_squares_that_of_single_steps(turbine):
    a = multi_blade.linear(turbine, 0.0).isotropic
    seen, defects, _ = random_steps(turbine)
    windows = Windows(trajectory_loss.modes(turbine, H, False), LENGTH)
    modal = np.array([mode.part for mode in windows.modes])

    def sizes(weights):
        left = defects - seen @ weights.T
        return (left**2).mean(), (np.abs(propagated(left, a) @ modal.T) ** 2).mean(axis=0)

    plain = sizes(fit.affine(seen, defects))
    found = sizes(trajectory_loss.fitted(seen, defects, windows, 1e-12, robust=False))
    assert plain[0] < found[0]
    assert (found[1] < plain[1]).all()


def test_the_fit_finds_the_map_that_the_defects_follow_whatever_a_few_windows_do(turbine):
    rng = np.random.Generator(np.random.PCG64(3))
    seen, _, azimuth = random_steps(turbine)
    truth = rng.standard_normal((turbine.layout.size, seen.shape[1]))
    windows = Windows(trajectory_loss.modes(turbine, H, True), LENGTH, azimuth)
    exact = trajectory_loss.fitted(seen, seen @ truth.T, windows, 1e-12, robust=False)
    assert np.abs(exact - truth).max() < 1e-8
    defects = seen @ truth.T + 1e-3 * rng.standard_normal((len(seen), len(truth)))
    defects[5 :: 20 * LENGTH] += 5.0  # two windows cross a corner
    plain, robust = (
        trajectory_loss.fitted(seen, defects, windows, 1e-12, robust) for robust in (False, True)
    )
    assert 5 * np.abs(robust - truth).max() < np.abs(plain - truth).max()


def recipe(**changed):
    winds = {"type": "turbulent", "harmonics": 6}
    data = {
        "name": "small", "family": "affine", "method": "etdabm3", "step": 0.1, "history": 3, "samples": 300,
        "factors": ["wind_speed@start"],
        "training": {**winds, "speeds": {"start": 5, "stop": 10, "count": 12}, "duration": 50, "seed": 1},
        "validation": {**winds, "speeds": [6, 7, 8, 9], "duration": 50, "seed": 2},
    }  # fmt: skip
    return read_recipe({**data, **changed})[0]


@pytest.mark.parametrize(
    ("method", "gain"),  # measured with so few winds: 1.7 and 1.17
    [({}, 1.3), ({"method": "rk4", "history": 0, "factors": []}, 1.1)],
    ids=["etdabm3", "rk4"],
)
def test_runs_are_closer_with_a_map_made_for_the_trajectory_than_with_one_made_for_single_steps(method, gain):
    judge, found = None, {}
    for loss in ("defect", "trajectory"):
        made = recipe(loss=loss, **method)
        turbine = made.load_turbine()
        judge = judge or Judge.of(made, turbine)
        learned = made.train(turbine, Progress())
        assert learned.facts.get("loss") == {"trajectory": "trajectory, followed for 33 steps, 3.3 s"}.get(
            loss
        )
        corrector = Corrector("made", made.family, made.bound_to(turbine), learned.map, learned.guard)
        for mode in MODES:
            errors, accepted = judge.errors(Integrator(made.method, made.step, corrector, mode), discard=10.0)
            assert accepted > 0.99
            found[loss, mode] = np.median(errors)
    for mode in MODES:
        assert found["trajectory", mode] < found["defect", mode] / gain


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"loss": "trajektory"}, "loss: 'trajektory' is not known; did you mean 'trajectory'"),
        ({"horizon": 5.0}, "horizon: is that of loss `trajectory`; leave it out, or add `loss: trajectory`"),
        ({"loss": "trajectory", "horizon": 0.1}, "must be at least two steps, 0.2 s"),
        ({"loss": "trajectory", "horizon": 40.0}, "at most half of the training's duration, 25 s; got 40"),
        (
            {"family": "affine+net", "method": "rk4", "history": 0, "loss": "trajectory", "network": {}},
            "loss: family affine+net knows `defect` alone",
        ),
    ],
)
def test_a_loss_that_cannot_be_is_refused_with_the_way_out(changed, words):
    with pytest.raises(InputError) as caught:
        recipe(**changed)
    assert words in str(caught.value)


def test_winds_too_short_for_a_window_are_refused():
    short = {"type": "turbulent", "speeds": [8.0], "duration": 3, "seed": 1}
    with pytest.raises(InputError, match=r"too short for 33 steps of 0.1 s in a row.*shorter horizon"):
        train(recipe(loss="trajectory", training=short))


def test_single_places_are_drawn_as_ever_and_windows_lie_within_the_run():
    a, b = (np.random.Generator(np.random.PCG64(1)) for _ in range(2))
    assert (places(a, 3, 90, 50, 1, None, 0.1) == b.integers(3, 90, 50)).all()
    windows = places(a, 3, 90, 500, 40, None, 0.1).reshape(-1, 40)
    assert len(windows) == 12 and windows.min() >= 3 and windows.max() < 90 and (np.diff(windows) == 1).all()
