"""Winds side by side: the cells of a block of cases that advance together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.layout import T2B1I1CG, Layout
from fatigue_runner.wind.cells import cell_count
from fatigue_runner.wind.source import WindSource


def stack_cells(
    winds: Sequence[WindSource], duration: float, layout: Layout = T2B1I1CG
) -> tuple[float, np.ndarray]:
    """The cells of a block: (cell_duration [s], coefficients (n_cells, 4, rows, n_winds)), rows as `Layout.wind_rows`.

    Winds with `cell_key` None are constant and fit any grid with the same bits; the others must have one and
    the same key (group the cases by it). Grids are never refined to a common one: a case's bits must not
    depend on its neighbours. Raises InputError for differing keys, where a wind is shorter than `duration`, and
    for a signal that the layout does not know.
    """
    if not winds:
        raise InputError("a block needs at least one wind; the list of winds is empty")
    keys = sorted({w.cell_key for w in winds if w.cell_key is not None})
    if len(keys) > 1:
        grids = ", ".join(f"{key:g} s" for key in keys)
        raise InputError(
            f"winds of one block have different cell durations ({grids}); "
            "give each its own block (group by cell_key), or give them one time step"
        )
    parts = [w.cells(duration) for w in winds]
    if keys:
        cell_duration, n_cells = keys[0], cell_count(duration, keys[0])
    else:
        cell_duration, n_cells = parts[0][0], 1
    stacked = np.zeros((n_cells, 4, max(layout.wind_size(w.channels) for w in winds), len(winds)))
    for lane, (wind, (_, coefficients)) in enumerate(zip(winds, parts, strict=True)):
        # a constant's single cell repeats over the grid; signals that a wind does not have are zero
        rows = layout.wind_rows(wind.channels)
        # one slice where it serves: an index for each row takes three times as long
        place = slice(len(rows)) if rows == list(range(len(rows))) else rows
        stacked[:, :, place, lane] = coefficients
    return cell_duration, stacked
