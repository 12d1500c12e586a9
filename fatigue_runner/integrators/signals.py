"""The inputs of a run as compiled code reads them: wind, and control signals where the model has any, as cubics in time."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.compiled import INLINE, LEAN, njit
from fatigue_runner.integrators.choice import compiled_for
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.model import harmonics, wind_signals

Array = NDArray[np.float64]


class Signals(NamedTuple):
    """cells (n, 4, rows * LANES): cubics of `cell_duration` [s] each; changing: whether they are not just one constant; control: what
    `control_at` takes; p (rows * LANES,) and u: room for the wind and the control signals of one time."""

    cell_duration: float
    cells: Array
    changing: bool
    control: Any
    p: Array
    u: Array


class PitchCells(NamedTuple):
    """A pitch that is the same in all lanes: cells (n, 4) of `cell_duration` [s] each."""

    cell_duration: float
    cells: Array


@njit(**LEAN)
def _wind_cells(model, time, cell_duration, cells, p):
    # 0.3 / 0.1 is 2.9999999999999996: a step time belongs to the cell that begins there
    i = min(max(int(time / cell_duration + 1e-9), 0), cells.shape[0] - 1)
    u = time - i * cell_duration
    # a constant where the model's wind has no harmonics, as many as the wind has otherwise
    count = len(p) if harmonics(model) else wind_signals(model) * LANES
    for m in range(count):
        p[m] = ((cells[i, 3, m] * u + cells[i, 2, m]) * u + cells[i, 1, m]) * u + cells[i, 0, m]


def control_at(control, time, u):
    """u = control signals at `time`. Stub; see `choice`."""
    raise NotImplementedError("compiled code only")


@compiled_for(control_at, None)
@njit(**INLINE)
def _no_control(control, time, u):
    pass


@compiled_for(control_at, PitchCells)
@njit(**LEAN)
def _pitch(control, time, u):
    i = min(max(int(time / control.cell_duration + 1e-9), 0), control.cells.shape[0] - 1)
    t = time - i * control.cell_duration
    c = control.cells
    pitch = ((c[i, 3] * t + c[i, 2]) * t + c[i, 1]) * t + c[i, 0]
    for j in range(LANES):
        u[j] = pitch


@njit(**INLINE)
def signals_at(model, time, signals):
    """Put the signals at `time` [s] into signals.p and signals.u."""
    _wind_cells(model, time, signals.cell_duration, signals.cells, signals.p)
    control_at(signals.control, time, signals.u)
