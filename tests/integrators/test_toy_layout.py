"""A new state and a new signal of the wind are one entry each: every method, a corrector and the log take a turbine that has them.

The toy's kernels are derived and printed into a folder of their own; what runs on them does so in a process with a cache of its own,
which knows nothing of the package's.
"""

from __future__ import annotations

import difflib
import os
import subprocess
import sys
from collections.abc import Mapping
from math import factorial
from pathlib import Path

import numpy as np
import pytest
import toy_gust
import toy_low_pass
from places import ROOT
from toy_gust import GustyWind
from toy_runs import ANSWERED, BETWEEN, COARSE, FILTERED, run, step_of
from toy_turbine import LAYOUT, write_kernels

from fatigue_runner.integrators import METHODS, method
from fatigue_runner.layout import T2B1I1CG
from fatigue_runner.logbook import read_log
from fatigue_runner.turbine.generated import kernel

HERE = Path(__file__).parent
OWN = T2B1I1CG.size  # the turbine's states; the toys follow
LOW_PASS, ANSWER = (LAYOUT.row(toy.STATE.signal.name) for toy in (toy_low_pass, toy_gust))
TAPS = 1 / toy_low_pass.TIME_CONSTANT, 1 / toy_gust.TIME_CONSTANT

slow = pytest.mark.slow(reason="compiles the loops of every method for the toy's equations")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("toy")


@pytest.fixture(scope="module")
def texts(folder) -> Mapping[str, str]:
    """The printed kernels by their modules' names."""
    return write_kernels(folder)


@pytest.fixture(scope="module")
def runs(folder, texts) -> Mapping[str, np.ndarray]:
    """What `toy_runs` made."""
    places = [str(p) for p in (ROOT, ROOT / "tests", HERE, folder)]
    env = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": os.pathsep.join(places)}
    done = subprocess.run(
        [sys.executable, str(HERE / "toy_runs.py"), str(folder)], env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    with np.load(folder / "runs.npz") as found:
        return dict(found)


# --- the kernel


def test_the_toys_kernel_is_the_turbine_s_with_two_lines_for_each_of_them(texts):
    printed = Path(str(kernel.__file__)).read_text(encoding="utf-8").splitlines()
    more = [line[2:] for line in difflib.ndiff(printed, texts["toy_kernel"].splitlines()) if line[:1] == "+"]
    a, b = map(repr, TAPS)
    assert [line for line in more if " = " in line] == [
        f"slow_rotor_speed = x[{LOW_PASS}]",
        f"out[{LOW_PASS}] = {a}*phid - {a}*slow_rotor_speed",
        "gust = wind[3]",
        f"gust_response = x[{ANSWER}]",
        f"out[{ANSWER}] = {b}*gust - {b}*gust_response",
    ]


# --- the turbine does not feel them


@slow
@pytest.mark.parametrize("name", METHODS)
def test_the_turbine_s_own_states_are_those_of_a_run_without_the_toys(runs, turbine, name):
    plain = run(turbine, name, step_of(name), [GustyWind(size=None)])[0].state
    toys = runs[f"method/{name}/state"][:, :OWN]
    assert np.abs(toys - plain).max() < 1e-9 and toys.shape == plain.shape
    if method(name).family in ("runge-kutta", "adams"):
        # no sum over the states: the same operations on the same numbers
        assert np.array_equal(toys, plain)


@slow
def test_a_wind_with_harmonics_and_no_gust_blows_as_it_does_on_the_plain_turbine(runs):
    assert np.array_equal(runs["equations/slopes"][:OWN], runs["equations/plain slopes"])
    # the gust of a wind that has none is zero, and no harmonic stands in its row
    assert runs["equations/slopes"][ANSWER] == pytest.approx(-ANSWERED * TAPS[1], rel=1e-14)


# --- the toys do what their equations say


@slow
def test_the_low_pass_is_that_of_the_run_s_own_rotor_speed(runs):
    state = runs["order/accurate"]
    time = np.arange(len(state)) * 0.0025
    filtered = toy_low_pass.answer(time, state[:, LAYOUT.rotor_speed], FILTERED)
    assert np.ptp(filtered) > 0.1
    assert state[:, LOW_PASS] == pytest.approx(filtered, abs=1e-9)


@slow
@pytest.mark.parametrize("name", METHODS)
def test_the_answer_to_the_gust_is_that_in_closed_form(runs, name):
    time, state = runs[f"method/{name}/time"], runs[f"method/{name}/state"]
    away = np.abs(state[:, ANSWER] - toy_gust.answer(time, ANSWERED)).max()
    found, h = method(name), step_of(name)
    # the fading part's derivatives grow with 1/T; what is linear costs the exponential methods nothing, the gust is slow
    stiff = h * TAPS[1] if found.family in ("runge-kutta", "adams") else h
    share = 2 / factorial(found.order + 1) if found.family == "runge-kutta" else 1.0
    assert 0.0 < away < share * stiff**found.order


@slow
@pytest.mark.parametrize("name", COARSE)
def test_their_errors_fall_with_the_step_as_the_method_s_order_says(runs, name):
    accurate, found = runs["order/accurate"], []
    for part in (1, 2):
        state, h = runs[f"order/{name}/{part}"], COARSE[name] / part
        time = np.arange(len(state)) * h
        at = np.rint(time / 0.0025).astype(int)
        shared = np.isclose(time, at * 0.0025) & (at < len(accurate))
        found.append(
            (
                np.abs(state[shared, LOW_PASS] - accurate[at[shared], LOW_PASS]).max(),
                np.abs(state[:, ANSWER] - toy_gust.answer(time, ANSWERED)).max(),
            )
        )
    low_pass, answer = np.log2(np.array(found[0]) / np.array(found[1]))
    order = method(name).order
    # a linear equation alone, and a small coefficient, may fall faster
    assert order - 0.15 < low_pass < order + 0.8
    assert order - 0.15 < answer < order + 0.8


# --- output between steps


def slopes(time: np.ndarray, state: np.ndarray) -> np.ndarray:
    """(n, 2) of the toys at step ends, by their equations."""
    driven = np.stack([state[:, LAYOUT.rotor_speed], toy_gust.CUBIC(time)], axis=1)
    return (driven - state[:, OWN:]) * np.array(TAPS)


@slow
@pytest.mark.parametrize("name", METHODS)
def test_between_steps_they_are_the_hermite_polynomial_of_value_and_slope(runs, name):
    from scipy.interpolate import KroghInterpolator

    time, state, between = (runs[f"method/{name}/{what}"] for what in ("time", "state", "between"))
    rates, h = slopes(time, state), step_of(name)
    ends = 3 if method(name).order > 4 else 2
    for row, values in enumerate(between):
        place = row * (1 + BETWEEN)
        last = max(int(np.ceil(place - 1e-9)), ends - 1)
        nodes = np.arange(last - ends + 1, last + 1)
        both = np.stack([state[nodes, OWN:], rates[nodes] * h], axis=1).reshape(2 * ends, 2)
        assert values[OWN:] == pytest.approx(KroghInterpolator(np.repeat(nodes, 2), both)(place), abs=1e-9)


@slow
@pytest.mark.parametrize(("name", "bound"), [("etdrk4", 1 / 384), ("dop853", (4 / 27) / 720)])
def test_between_steps_they_are_as_accurate_as_that_polynomial(runs, name, bound):
    """The linear part and the order leave next to nothing at the ends, so that what is left is the interpolation's."""
    between, h = runs[f"method/{name}/between"], step_of(name)
    time = np.arange(len(between)) * (1 + BETWEEN) * h
    away = np.abs(between[:, ANSWER] - toy_gust.answer(time, ANSWERED)).max()
    fading = abs(toy_gust.answer(0.0, 0.0) - toy_gust.answer(1e-9, ANSWERED))
    order = 6 if method(name).order > 4 else 4
    most = bound * fading * (h * TAPS[1]) ** order
    assert 0.1 * most < away < 1.5 * most


# --- a case that leaves the bounds


@slow
def test_a_toy_that_leaves_the_bounds_ends_its_case_and_no_other(runs):
    at = runs["diverging/at"]
    time = np.linspace(0.0, 1.0, 100_001)
    crossed = time[np.argmax(np.abs(toy_gust.answer(time, ANSWERED, 1e5)) >= 1e4)]
    assert crossed <= at[0] <= crossed + 2 * 0.02
    assert at[1] == pytest.approx(0.02)
    assert np.isnan(at[2]) and np.array_equal(runs["diverging/fine"], runs["method/rk4/state"])


# --- a corrector sees them and mends them


@slow
def test_a_stage_map_of_their_rows_mends_them_and_the_turbine(runs):
    exact = runs["corrector/exact"]
    extent = np.ptp(exact, axis=0)

    def errors(name: str) -> np.ndarray:
        return np.sqrt(((runs[f"corrector/{name}"] - exact) ** 2).mean(axis=0)) / extent

    plain = errors("plain")
    for mode in ("enhanced", "hybrid"):
        assert errors(mode).max() < plain.max() / 30
        assert (errors(mode)[OWN:] < plain[OWN:] / 30).all()
    assert runs["corrector/hybrid/accepted"].mean() > 0.9


# --- operating point and linear parts


@slow
def test_operating_point_and_modes_are_the_turbine_s_and_the_toys_rest(runs):
    point, plain = runs["equations/point"], runs["equations/plain point"]
    assert point[:OWN] == pytest.approx(plain, abs=1e-9)
    assert point[[LOW_PASS, ANSWER]] == pytest.approx([point[LAYOUT.rotor_speed], 0.0], abs=1e-9)
    own, theirs = runs["equations/frequencies"]
    assert own == pytest.approx(theirs, rel=1e-6)
    assert runs["equations/limit"][0] == runs["equations/limit"][1]


@slow
@pytest.mark.parametrize("which", ["linear", "isotropic"])
def test_the_linear_part_of_the_exponential_methods_has_their_rates(runs, which):
    a = runs[f"equations/{which}"]
    wanted = np.zeros((2, LAYOUT.size))
    wanted[0, [LAYOUT.rotor_speed, LOW_PASS]] = TAPS[0], -TAPS[0]
    wanted[1, ANSWER] = -TAPS[1]
    assert a[OWN:] == pytest.approx(wanted, abs=1e-8)
    assert not a[:OWN, OWN:].any()


# --- the log


@slow
@pytest.mark.parametrize("name", METHODS)
def test_the_log_gives_them_back_under_their_names(runs, folder, name):
    log = read_log(folder / f"{name}.mcap")
    assert tuple(c.name for c in log.states) == LAYOUT.names
    assert tuple(c.name for c in log.winds) == tuple(c.name for c in LAYOUT.wind)
    assert np.array_equal(log.state, runs[f"method/{name}/state"])
    assert log.wind[:, -1] == pytest.approx(toy_gust.CUBIC(log.time), abs=1e-12)
    assert (log.states[LOW_PASS].unit, log.winds[-1].unit) == ("rad/s", "m/s")
