"""Rainflow counting as ASTM E1049-85 (2017), clause 5.4.4: the three-point rule, unbinned."""

from __future__ import annotations

from typing import Any

import numpy as np

from fatigue_runner.errors import did_you_mean
from fatigue_runner.fatigue.checks import FatigueInputError, finite_series

# What a range that never closes counts for; MLife calls this number the multiplier of unclosed cycles.
RESIDUE = {"half": 0.5, "full": 1.0, "drop": 0.0}


def residue_count(residue: str) -> float:
    """What a range that never closes counts for; FatigueInputError for an unknown residue."""
    if residue not in RESIDUE:
        raise FatigueInputError(f"unknown residue {residue!r}{did_you_mean(str(residue), RESIDUE)}")
    return RESIDUE[residue]


def rainflow(series: Any, residue: str = "half") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cycles of a load series: ranges, means and counts, each (cycles,), in the order in which they close.

    series: (n,) any unit; ranges and means have the same. counts are 1 for a closed cycle; a range that never
    closes counts as `residue` says: "half" 0.5 (the standard), "full" 1, "drop" not at all. With "half" the
    counts sum to (reversals - 1) / 2.
    A constant series, or one of fewer than three samples, holds no cycle: three empty arrays.
    Raises FatigueInputError (an InputError and a ValueError) for NaN or infinity, naming the index, and for
    an unknown residue.
    Source: ASTM E1049-85 (2017), 5.4.4. Equal, cycle for cycle and bit for bit, to `rainflow.extract_cycles`
    of the PyPI package `rainflow` 3.2, but for a constant series, which that package counts as half a cycle
    of range 0.
    """
    share = residue_count(residue)
    values = finite_series(series)
    if values.size < 3:
        return np.empty(0), np.empty(0), np.empty(0)
    from fatigue_runner.fatigue import kernel  # numba takes longer to import than most series take to count

    return kernel.count(values, share)
