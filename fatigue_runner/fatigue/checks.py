"""What every function of this folder demands of its arrays and numbers, and the error it raises."""

from __future__ import annotations

from typing import Any

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.values import unmasked


class FatigueInputError(InputError, ValueError):
    """A series, a range or an exponent that has no fatigue; also a ValueError, for users of the library."""


def finite_series(series: Any) -> np.ndarray:
    """`series` as contiguous float64 (n,); refused when not one-dimensional or not finite."""
    values = np.ascontiguousarray(unmasked("the load series", series, FatigueInputError), dtype=np.float64)
    if values.ndim != 1:
        raise FatigueInputError(
            f"a load series has one dimension, got shape {values.shape}; count one channel at a time"
        )
    index = first_not_finite(values)
    if index is not None:
        raise FatigueInputError(
            f"the load series is {values[index]} at index {index} of {values.size}; a series that is not "
            "finite has no fatigue: look for a diverged case or a damaged log"
        )
    return values


def first_not_finite(values: np.ndarray) -> int | None:
    """Index of the first NaN or infinity in `values` (n,), None when all are finite."""
    finite = np.isfinite(values)
    return None if finite.all() else int(np.argmin(finite))


def non_negative(name: str, values: Any) -> np.ndarray:
    """`values` as float64; refused when any is negative, NaN or infinite."""
    array = np.asarray(unmasked(name, values, FatigueInputError), dtype=np.float64)
    bad = ~(np.isfinite(array) & (array >= 0.0))
    if bad.any():
        index = int(np.argmax(bad.ravel()))
        raise FatigueInputError(
            f"{name} must be finite and not negative, got {array.ravel()[index]} at index {index}"
        )
    return array


def positive(name: str, value: float) -> float:
    """`value` as a float; refused unless it is finite and above zero."""
    number = float(value)
    if not (np.isfinite(number) and number > 0.0):
        raise FatigueInputError(f"{name} must be finite and above zero, got {value}")
    return number


def cycles_of(ranges: Any, counts: Any) -> tuple[np.ndarray, np.ndarray]:
    """`ranges` and `counts` as (n,) float64, finite, not negative and of one length."""
    r, n = (
        np.atleast_1d(non_negative("load ranges", ranges)),
        np.atleast_1d(non_negative("cycle counts", counts)),
    )
    if r.shape != n.shape or r.ndim != 1:
        raise FatigueInputError(
            f"ranges and counts must be one-dimensional and of one length, got {r.shape} and {n.shape}"
        )
    return r, n
