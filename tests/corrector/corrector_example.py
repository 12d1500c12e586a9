"""A small corrector, trained in a second on constant winds, for tests."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache

import numpy as np

from fatigue_runner.corrector import Corrector, features, fit, samples, threshold
from fatigue_runner.corrector.binding import Binding
from fatigue_runner.corrector.maps import RawNetwork, StageMap
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import ConstantWind

SPEEDS = (6.0, 7.0, 8.0, 9.0)


@cache
def turbine():
    return load_turbine("nrel5mw")


def operating_points(winds):
    return np.array([turbine().operating_point(w.mean_speed) for w in winds])


def collect(method, step, winds, duration, per_wind, perturbation, seed, history=0, initial=None):
    """Samples along accurate trajectories from the winds' operating points."""
    start = operating_points(winds) if initial is None else initial
    grid = samples.output_step(step, history)
    runs = samples.references(turbine(), winds, start, duration, grid)
    return samples.along(turbine(), method, step, winds, runs, per_wind, perturbation, seed, history)


@cache
def training_samples(method="heun", step=0.02, history=0):
    winds = [ConstantWind(v, 0.1, 0.02) for v in SPEEDS]
    return collect(method, step, winds, 15.0, 400, 1e-5, 0, history)


@cache
def trained(method="heun", step=0.02, factors=(), history=0, substeps=None) -> Corrector:
    found, binding = training_samples(method, step, history), Binding.to(turbine(), method, step)
    rows = found.multiplied(features.factor_rows(turbine().layout, factors))
    weights = fit.affine(rows, found.defect) / binding.size
    learned = StageMap(weights, factors=factors, history=history)
    guard = threshold.from_training_set(learned, binding, turbine(), found, substeps=substeps)
    return Corrector("example", "affine", binding, learned, guard, (6.0, 9.0))


def with_map(corrector: Corrector, **changed) -> Corrector:
    return replace(corrector, map=replace(corrector.map, **changed))


def with_weights(corrector: Corrector, weights) -> Corrector:
    return with_map(corrector, linear=np.asarray(weights, float))


def network(raw: bool, activation="isru", seed=0) -> Corrector:
    """Random layers of moderate size, for comparing the compiled network with numpy's."""
    rng = np.random.default_rng(seed)
    layout = turbine().layout
    inputs = len(features.raw(layout) if raw else features.stage_aware(layout, 2)) - 1
    sizes = (inputs, 13, 24, layout.size)
    layers = tuple(rng.normal(size=(b, a + 1)) / (10 * a) for a, b in itertools.pairwise(sizes))
    learned = RawNetwork(layers, activation) if raw else StageMap(None, layers, activation)
    return replace(trained(), family="test", map=learned)
