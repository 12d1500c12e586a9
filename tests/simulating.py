"""Simulations in one call, for tests that vary methods, steps and correctors."""

from __future__ import annotations

from fatigue_runner.integrators import ENHANCED, Ensemble, Integrator, simulate


def simulate_block(
    turbine,
    method,
    step,
    winds,
    initial,
    duration,
    output_step=None,
    pitch=0.0,
    corrector=None,
    mode=ENHANCED,
):
    """Trajectories of all winds from initial (n, size)."""
    cases = Ensemble(turbine, winds, initial, duration, output_step, pitch)
    return simulate(cases, Integrator(method, step, corrector, mode))
