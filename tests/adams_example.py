"""Runs of the exponential Adams methods under turbulence, and their errors: for tests of the methods and of their correctors."""

from __future__ import annotations

from functools import cache

import numpy as np
from simulating import simulate_block

from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import TurbulentWind


@cache
def turbine():
    return load_turbine("nrel5mw")


def wind(speed=8.0, seed=4, duration=40.0, harmonics=1):
    found = TurbulentWind(
        speed, intensity=0.14, seed=9_100_000 + seed, duration=duration, harmonics=harmonics
    )
    return found.on(turbine().rotor)


def start(off=True):
    x = turbine().operating_point(8.0)
    if off:
        x[[0, 2, 5]] += 0.05, 0.3, 0.02
    return x


def runs(name, step, corrector=None, mode="enhanced", duration=40.0, harmonics=1):
    blowing = [wind(v, i, duration, harmonics) for i, v in enumerate((5.5, 7.0, 8.5, 9.5))]
    x = np.array([turbine().operating_point(w.mean_speed) for w in blowing])
    return simulate_block(
        turbine(), name, step, blowing, x, duration - 1, 0.6, corrector=corrector, mode=mode
    )


@cache
def truth(harmonics=1):
    return runs("dop853", 0.02, harmonics=harmonics)


def error(found, harmonics=1) -> float:
    out = []
    for run, true in zip(found, truth(harmonics), strict=True):
        assert run.diverged_at is None
        away = np.sqrt(((run.state - true.state) ** 2).mean(axis=0))
        out.append(float((away / np.ptp(true.state, axis=0)).max()))
    return float(np.median(out))
