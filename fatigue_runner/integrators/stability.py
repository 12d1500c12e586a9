"""The largest step at which a method is stable on a turbine, from the linearised spinning turbine."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.integrators.methods import method as find_method

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

LARGEST = 1.0  # s; no method of this program is used beyond


@lru_cache(maxsize=256)
def stability_limit(turbine: Turbine, method: str, wind: float = 8.0, pitch: float = 0.0) -> float:
    """Largest step [s] for which no solution grows, |R(h lambda)| <= 1, in every mode of the turbine linearised at `wind` [m/s].

    Linear and at one wind: a run below it may still diverge. 0.0 for a method that is unstable at every step.
    """
    from fatigue_runner.turbine.steady import linearised

    growth = find_method(method).growth
    values = np.linalg.eigvals(linearised(turbine, wind, pitch))
    # the azimuth's free rotation has eigenvalue 0, which every method keeps
    values = values[np.abs(values) > 1e-3]
    if np.any(values.real > 0):
        raise InputError(f"{turbine.name} itself is unstable at {wind:g} m/s, so that no step can be stable")

    def stable(h: float) -> bool:
        return bool(np.all(growth(h * values) <= 1 + 1e-12))

    steps = np.geomspace(1e-5, LARGEST, 2000)
    unstable = next((i for i, h in enumerate(steps) if not stable(h)), None)
    if unstable is None:
        return LARGEST
    return float(steps[unstable - 1]) if unstable else 0.0
