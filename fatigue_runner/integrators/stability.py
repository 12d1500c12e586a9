"""The largest step at which a method is stable on a turbine, from the linearised spinning turbine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fatigue_runner.caches import kept_with
from fatigue_runner.errors import InputError
from fatigue_runner.integrators.ensemble import Ensemble, Integrator, simulate
from fatigue_runner.integrators.methods import method as find_method
from fatigue_runner.turbine.turbine import CONTROLLED

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

TRIED_AT = (8.0, 10.5)  # m/s
OPERATED_AT = (8.0, 18.0)  # m/s
TRIED = 8  # runs
LARGEST = 1.0  # s; no method of this program is used beyond


@kept_with(256)
def stability_limit(turbine: Turbine, method: str, wind: float | None = None, pitch: float = 0.0) -> float:
    """Largest step [s] for which no solution grows, |R(h lambda)| <= 1, in every mode of the turbine linearised at `wind` [m/s],
    8 where none is given; an exponential method, which has that motion exact, is tried out at `wind`, or at 8 and in the steep region
    2.5 of the torque law.

    Linear and at one wind: a run below it may still diverge. 0.0 for a method that is unstable at every step.
    """
    from fatigue_runner.turbine.steady import linearised

    growth = find_method(method).growth
    if growth(np.zeros(1, complex)) is None:
        return min(_tried_limit(turbine, method, v, pitch) for v in (TRIED_AT if wind is None else (wind,)))
    if wind is None and turbine.operation == CONTROLLED:
        # it pitches above rated: other modes than below
        return min(stability_limit(turbine, method, v, pitch) for v in OPERATED_AT)
    wind = TRIED_AT[0] if wind is None else wind
    values = np.linalg.eigvals(linearised(turbine, wind, pitch))
    # the azimuth's free rotation has eigenvalue 0, which every method keeps
    values = values[np.abs(values) > 1e-3]
    if np.any(values.real > 0):
        raise InputError(f"{turbine.name} itself is unstable at {wind:g} m/s, so that no step can be stable")

    def stable(h: float) -> bool:
        grown = growth(h * values)
        return grown is not None and bool(np.all(grown <= 1 + 1e-12))

    steps = np.geomspace(1e-5, LARGEST, 2000)
    unstable = next((i for i, h in enumerate(steps) if not stable(h)), None)
    if unstable is None:
        return LARGEST
    return float(steps[unstable - 1]) if unstable else 0.0


def _tried_limit(turbine: Turbine, method: str, wind: float, pitch: float) -> float:
    """Largest step of a fine scale below which small deviations from the steady rotation die out in simulated runs."""
    from fatigue_runner.wind import ConstantWind

    layout = turbine.layout
    still, rates = layout.deflections, slice(layout.freedoms, layout.freedoms + layout.deflections)
    base = turbine.operating_point(wind, pitch=pitch)
    rng = np.random.Generator(np.random.PCG64(0))
    start = np.repeat(base[None], TRIED, axis=0)
    # deflections and their velocities; the rotation itself is neutral
    start[1:, :still] += 1e-3 * rng.standard_normal((TRIED - 1, still))
    found = 0.0
    for h in np.geomspace(0.1, LARGEST, 24):
        cases = Ensemble(turbine, [ConstantWind(wind)] * TRIED, start, 200 * float(h), pitch=pitch)
        runs = simulate(cases, Integrator(method, float(h)))
        if any(r.diverged_at is not None for r in runs):
            break
        off = np.array([r.state[:, rates] - runs[0].state[:, rates] for r in runs[1:]])
        early, late = np.abs(off[:, 10:50]).max(), np.abs(off[:, -40:]).max()
        if late > early:
            break
        found = float(h)
    return found
