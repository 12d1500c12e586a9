"""The hybrid's acceptance threshold, from what a map does on its training set."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.corrector.guard import Guard
from fatigue_runner.corrector.samples import Samples, single_steps
from fatigue_runner.errors import InputError

if TYPE_CHECKING:
    from fatigue_runner.corrector.binding import Binding
    from fatigue_runner.corrector.maps import Map
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]


def fallback_substeps(turbine: Turbine, method: str, step: float, history: int = 0) -> int:
    """0 where a method of the next order shares the stages and is stable at this step [s]; else the fewest substeps, two or more,
    that keep the method itself a tenth below its stability limit."""
    from fatigue_runner.integrators import stability_limit
    from fatigue_runner.integrators.methods import SHARING

    if method in SHARING and not history and step <= stability_limit(turbine, SHARING[method]):
        return 0
    limit = stability_limit(turbine, method)
    if limit <= 0:
        raise InputError(
            f"{method} is stable at no step on {turbine.name}, so it has no fallback; use another method"
        )
    return max(2, math.ceil(step / (0.9 * limit)))


def fallback_results(turbine: Turbine, method: str, step: float, substeps: int, samples: Samples) -> Array:
    """(n, states) what the fallback makes of the samples' steps."""
    from fatigue_runner.integrators.methods import SHARING

    assert samples.pieces is not None
    if substeps == 0:
        return single_steps(turbine, SHARING[method], step, samples.state, samples.pieces).plain
    return single_steps(turbine, method, step, samples.state, samples.pieces, method, substeps).exact


def distances(difference: Array, state: Array, fallback: Array, guard: Guard) -> Array:
    """(n,) norm of `difference` (n, states) in the guard's units, as the compiled `guard` measures it."""
    scale = np.array(guard.atol) + np.maximum(np.abs(state), np.abs(fallback)) * np.array(guard.rtol)
    scaled = np.abs(difference) / scale
    return scaled.max(axis=1) if guard.norm == "max" else np.sqrt((scaled**2).mean(axis=1))


def from_training_set(
    learned: Map,
    binding: Binding,
    turbine: Turbine,
    samples: Samples,
    norm: str = "max",
    kappa: float = 2.0,
    quantile: float = 1.0,
    rtol: float = 0.0,
    substeps: int | None = None,
) -> Guard:
    """limit = kappa * the quantile (1: the largest) over the samples of |fallback - corrected| in units of sc.

    sc_i = atol_i + max(|x_i|, |fallback_i|) rtol with atol_i the samples' rms of that difference in state i, so that every state
    weighs by what is usual for it. rtol is 0 by default: states cross zero, azimuths grow without limit. substeps: of the fallback;
    as needed where it is not given.
    """
    if substeps is None:
        substeps = fallback_substeps(turbine, binding.method, binding.step, learned.history)
    other = fallback_results(turbine, binding.method, binding.step, substeps, samples)
    difference = samples.plain + learned.predict(samples, binding.size) - other
    return limit_of(difference, samples.state, other, norm, kappa, quantile, rtol, substeps)


def bounded(guard: Guard, features: Array, margin: float) -> Guard:
    """The guard with bounds: the extent of features (n, 1 + k), whose leading 1 is left out, and `margin` times it on both sides.

    The distance from the fallback holds the fallback's own error, so a network may be as wrong as that without being told from a good
    one; far from the samples that is what happens.
    """
    low, high = features[:, 1:].min(axis=0), features[:, 1:].max(axis=0)
    # what stands still in the samples may move by rounding
    room = margin * (high - low) + 1e-9 * (1 + np.abs(high))
    return replace(guard, low=tuple((low - room).tolist()), high=tuple((high + room).tolist()), margin=margin)


def limit_of(
    difference: Array,
    state: Array,
    fallback: Array,
    norm: str,
    kappa: float,
    quantile: float,
    rtol: float,
    substeps: int = 0,
) -> Guard:
    """The guard whose limit is kappa * the quantile of |difference| (n, states) in its units; see `from_training_set`."""
    usual = np.sqrt((difference**2).mean(axis=0))
    # never 0: a constant wind leaves states at rest
    atol = np.maximum(usual, 1e-15 * (1 + np.abs(state).max(axis=0)))
    guard = Guard(0.0, norm, kappa, quantile, tuple(atol.tolist()), (rtol,) * len(atol), substeps)
    size = distances(difference, state, fallback, guard)
    return replace(guard, limit=kappa * float(np.quantile(size, quantile)))
