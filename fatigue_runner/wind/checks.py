"""What every wind source checks when it is made, with errors that name the value and the way out."""

from __future__ import annotations

import hashlib
import math
from typing import Any

import numpy as np

from fatigue_runner.channels import WIND_NAMES
from fatigue_runner.errors import InputError
from fatigue_runner.values import unmasked
from fatigue_runner.wind.cells import minimum


def number(
    what: str,
    value: Any,
    *,
    above: float = -math.inf,
    at_least: float = -math.inf,
    at_most: float = math.inf,
    unit: str = "",
    hint: str = "",
) -> float:
    """`value` as a finite float within the bounds, or an InputError that names it; `hint` is the way out."""
    try:
        result = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        result = math.nan
    if math.isfinite(result) and above < result and at_least <= result <= at_most:
        return result
    bounds = {"above": above, "at least": at_least, "at most": at_most}
    limits = " and ".join(f"{word} {bound:g}{unit}" for word, bound in bounds.items() if math.isfinite(bound))
    wanted = f"a number {limits}" if limits else "a finite number"
    raise InputError(f"{what} must be {wanted}, got {value!r}{f'; {hint}' if hint else ''}")


def wind_speed(what: str, value: Any) -> float:
    """A wind speed [m/s] that the aerodynamics can take: finite and positive."""
    return number(what, value, above=0.0, unit=" m/s", hint="the aerodynamics need wind from the front")


def linear_shear(what: str, value: Any) -> float:
    """A linear shear kappa [-] with which no edge of the rotor has wind from behind."""
    hint = "beyond 1 the wind blows backwards at the rotor's edge"
    return number(what, value, at_least=-1.0, at_most=1.0, hint=hint)


def signal_table(what: str, values: Any) -> np.ndarray:
    """Samples as a read-only (n, n_signals) array; (n,) stands for wind speeds without shear.

    Raises InputError, with the sample's index, for a NaN, for a speed that is not positive and a shear beyond 1, and
    for a wrong shape.
    """
    columns = ", ".join(WIND_NAMES)
    try:
        table = np.array(unmasked(f"{what}: values", values), float)
    except (TypeError, ValueError):
        raise InputError(f"{what}: values must be numbers, one row per sample with {columns}") from None
    if table.ndim == 1:
        table = np.stack([table, *[np.zeros_like(table)] * (len(WIND_NAMES) - 1)], axis=1)
    if table.ndim != 2 or table.shape[1] != len(WIND_NAMES) or not len(table):
        raise InputError(f"{what}: values have shape {table.shape}; give one row per sample with {columns}")
    for row, column in np.argwhere(~np.isfinite(table))[:1]:
        bad = f"{WIND_NAMES[column]} of sample {row} is {table[row, column]}"
        raise InputError(f"{what}: {bad}; fill or cut the gap")
    for row in np.flatnonzero(table[:, 0] <= 0.0)[:1]:
        bad = f"wind_speed of sample {row} is {table[row, 0]:g} m/s"
        raise InputError(f"{what}: {bad}; the aerodynamics need positive wind speeds")
    for row, column in np.argwhere(np.abs(table[:, 1:]) > 1.0)[:1]:
        bad = f"{WIND_NAMES[1 + column]} of sample {row} is {table[row, 1 + column]:g}"
        raise InputError(f"{what}: {bad}; a linear shear beyond 1 blows backwards at the rotor's edge")
    table.flags.writeable = False
    return table


def refuse_standstill(name: str, cell_duration: float, coefficients: np.ndarray, way_out: str) -> None:
    """Raises InputError, with the least wind speed and its time, where that is not positive."""
    lowest, time = minimum(cell_duration, coefficients[:, :, 0])
    if not lowest > 0.0:
        raise InputError(
            f"wind {name}: the wind speed falls to {lowest:.2f} m/s at {time:.1f} s, "
            f"but the aerodynamics need positive wind; {way_out}"
        )


def digest(*arrays: np.ndarray) -> str:
    """Eight hex digits that tell two tables of samples apart, for names and labels."""
    sha = hashlib.sha256()
    for array in arrays:
        sha.update(np.ascontiguousarray(array, "<f8").tobytes())
    return sha.hexdigest()[:8]
