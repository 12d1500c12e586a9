"""Numbers and arrays that somebody gave: what is one, and what only looks like one."""

from __future__ import annotations

from typing import Any

import numpy as np

from fatigue_runner.errors import InputError


def decimal(text: str) -> float | None:
    """The number that a text of a file is, NaN and infinities too; None for anything else: `1_0.3` is a damaged number, not 10.3."""
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None


def unmasked(what: str, values: Any, error: type[InputError] = InputError) -> Any:
    """`values` as they are; raises `error` for a masked array with a masked sample, below which a number lies that nobody meant.

    NumPy drops the mask wherever it makes a plain array of one.
    """
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        index = int(np.argmax(np.ma.getmaskarray(values).ravel()))
        raise error(f"{what} is masked at index {index}; fill or cut the gap")
    return values
