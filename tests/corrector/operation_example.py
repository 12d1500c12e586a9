"""Runs of the turbine at work, from nearly cut-in to nearly cut-out, that several tests look at."""

from __future__ import annotations

from functools import cache

import numpy as np
from simulating import simulate_block

from fatigue_runner.corrector import find
from fatigue_runner.integrators.initial import initial_state
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import TurbulentWind

SPEEDS = (4.0, 8.0, 12.0, 18.0, 24.0)  # m/s


@cache
def turbine(operation="controlled"):
    return load_turbine("nrel5mw").operated(operation)


@cache
def shipped():
    return find("etdabm3-100ms-operation")


def wind(speed, seed=9_200_000, duration=62.0, harmonics=6):
    found = TurbulentWind(speed, 0.14, seed=seed, duration=duration, shear_exponent=0.2, harmonics=harmonics)
    return found.on(turbine().rotor)


@cache
def runs(name, step, mode="", duration=60.0, corrector=None):
    winds = [wind(v) for v in SPEEDS]
    start = np.array([initial_state(turbine(), "operating-point", w) for w in winds])
    corrector = corrector or (shipped() if mode else None)
    return simulate_block(
        turbine(), name, step, winds, start, duration, 0.1, corrector=corrector, mode=mode or "enhanced"
    )


def error(found):
    """(winds,) NRMSE of the worst state, the first 10 s left out."""
    out = []
    for run, true in zip(found, runs("dop853", 0.025), strict=True):
        assert run.diverged_at is None
        away = np.sqrt(((run.state[100:] - true.state[100:]) ** 2).mean(axis=0))
        out.append(float((away / np.ptp(true.state[100:], axis=0)).max()))
    return np.array(out)
