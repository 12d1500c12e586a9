"""A small corrector, trained in a second on constant winds, for tests."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache

import numpy as np

from fatigue_runner.corrector import features, fit, guard, samples
from fatigue_runner.corrector.artefact import Corrector, Guard
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import ConstantWind

SPEEDS = (6.0, 7.0, 8.0, 9.0)


@cache
def turbine():
    return load_turbine("nrel5mw")


@cache
def training_samples(method="heun", step=0.02, history=0):
    winds = [ConstantWind(v, 0.1, 0.02) for v in SPEEDS]
    return samples.collect(turbine(), method, step, winds, 15.0, 400, 1e-5, 0, history=history)


@cache
def trained(method="heun", step=0.02, factors=(), history=0, substeps=None) -> Corrector:
    found = training_samples(method, step, history)
    size = step ** (samples.tableau(method).order + 1)
    weights = fit.affine(found.features(features.STAGE_AWARE, factors), found.defect) / size
    t = turbine()
    open_guard = Guard(0.0, "max", 1.0, 1.0, (1.0,) * 16, (0.0,) * 16, 2)
    out = Corrector(
        name="example", family="affine", method=method, step=step, turbine=t.name, turbine_hash=t.hash,
        kind=features.STAGE_AWARE, factors=factors, linear=weights, layers=(), activation="identity",
        guard=open_guard, wind_range=(6.0, 9.0), history=history,
    )  # fmt: skip
    return replace(out, guard=guard.from_training_set(out, t, found, substeps=substeps))


def with_weights(corrector: Corrector, weights) -> Corrector:
    return replace(corrector, linear=np.asarray(weights, float))


def network(raw: bool, activation="isru", seed=0) -> Corrector:
    """Random layers of moderate size, for comparing the compiled network with numpy's."""
    rng = np.random.default_rng(seed)
    inputs = 18 if raw else len(features.names(features.STAGE_AWARE, 2))
    sizes = (inputs - 1, 13, 24, 16)
    layers = tuple(rng.normal(size=(b, a + 1)) / (10 * a) for a, b in itertools.pairwise(sizes))
    kind = features.RAW if raw else features.STAGE_AWARE
    return replace(trained(), family="test", kind=kind, linear=None, layers=layers, activation=activation)
