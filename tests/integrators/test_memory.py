"""Memory of series that nobody has any more is used again, and never while somebody has a view of it."""

from __future__ import annotations

import gc

import numpy as np

from fatigue_runner.integrators.memory import empty

SHAPE = (3, 100_000)


def test_memory_comes_back_with_the_last_view():
    gc.collect()
    first = empty(SHAPE)
    first[:] = 1.0
    row, place = first[1], first.ctypes.data
    del first
    other = empty(SHAPE)
    assert other.ctypes.data != place  # the view still has it
    other[:] = 2.0
    assert (row == 1.0).all() and row.flags.writeable
    del row
    assert empty(SHAPE).ctypes.data == place
    assert empty((3, 50_000), np.float64).ctypes.data != place


def test_small_arrays_are_numpy_s_own():
    assert empty((2, 3), np.float32).base is None
