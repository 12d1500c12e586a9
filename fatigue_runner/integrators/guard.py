"""Compiled: the hybrid's acceptance test (arXiv 2504.05493, algorithm 1, mended).

Accepted where the corrected result agrees with that of the fallback; else the fallback is taken. So every step ends within `limit`
scaled units of it. All of it is compiled without fastmath: a comparison with NaN must be false, so that a NaN correction is refused.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.compiled import njit
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.model import padded_rows, rows, width

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]

NORM_MAX, NORM_RMS = 0, 1


class GuardUnits(NamedTuple):
    """1 / atol (width,), and rtol / atol (width,) or nothing."""

    inverse: Array
    relative: Array


def guard_units(atol: Sequence[float], rtol: Sequence[float]) -> GuardUnits:
    """Of tolerances of the states, repeated for the lanes."""
    inverse = 1.0 / np.repeat(np.array(atol), LANES)
    return GuardUnits(inverse, np.repeat(np.array(rtol), LANES) * inverse if any(rtol) else np.zeros(0))


def norm_of(guard: Any) -> int:
    """The compiled guard's number of a corrector's norm."""
    return NORM_MAX if guard.norm == "max" else NORM_RMS


@njit(nogil=True, error_model="numpy", _nrt=False)
def guard(model, x, fallback, corrected, units, limit, norm, scaled, judged):
    """x = corrected where its scaled distance from the fallback is within the limit, else the fallback; per lane.

    scaled (padded_rows * LANES,): room; judged = (discrepancy, accepted) (LANES,), the worst so far. Loops over whole states with one
    result each, and halves against each other instead of a loop over the states: so they vectorise.
    """
    inverse, relative = units
    discrepancy, accepted = judged
    if len(relative) == 0:
        for m in range(width(model)):
            scaled[m] = abs(corrected[m] - fallback[m]) * inverse[m]
    else:
        for m in range(width(model)):
            scale = 1.0 + max(abs(x[m]), abs(fallback[m])) * relative[m]
            scaled[m] = abs(corrected[m] - fallback[m]) * inverse[m] / scale
    for m in range(width(model)):
        size = scaled[m]
        scaled[m] = size if size < np.inf else np.inf
    for m in range(width(model), padded_rows(model) * LANES):
        scaled[m] = 0.0
    half = padded_rows(model) // 2
    if norm == NORM_RMS:
        for m in range(width(model)):
            scaled[m] *= scaled[m] * (1.0 / rows(model))
        while half > 0:
            for m in range(half * LANES):
                scaled[m] += scaled[half * LANES + m]
            half //= 2
        for j in range(LANES):
            scaled[j] = np.sqrt(scaled[j])
    else:
        while half > 0:
            for m in range(half * LANES):
                size, other = scaled[m], scaled[half * LANES + m]
                scaled[m] = size if size > other else other
            half //= 2
    for j in range(LANES):
        before, size = discrepancy[j], scaled[j]
        discrepancy[j] = before if before > size else size
        accepted[j] = accepted[j] & (size <= limit)
    half = 1
    while half < padded_rows(model):
        for m in range(half * LANES):
            scaled[half * LANES + m] = scaled[m]
        half *= 2
    for m in range(width(model)):
        # both are read first: so the choice is a vector's, not a branch
        good, safe = corrected[m], fallback[m]
        x[m] = good if scaled[m] <= limit else safe


@njit(nogil=True, error_model="numpy", _nrt=False)
def refuse_outside(model, features, low, high, fallback, x, accepted):
    """x = fallback, not accepted, in lanes where a feature leaves [low, high] (one per feature after the leading 1; nothing: no bounds).

    NaN lies outside.
    """
    for j in range(LANES):
        inside = True
        for i in range(len(low)):
            value = features[(1 + i) * LANES + j]
            inside = inside and low[i] <= value <= high[i]
        if not inside:
            accepted[j] = False
            for i in range(rows(model)):
                x[i * LANES + j] = fallback[i * LANES + j]
