"""The right-hand side for compiled loops: at a fixed pitch or with the pitch as a fourth signal, told apart by the type of the tables.

`KernelData.tables` is flat at a fixed pitch and (1, n) with a varying one, so that a loop is compiled for what it is given and the other
kernel is not even loaded.
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload

from fatigue_runner.compiled import INLINE, njit


def _kernel(x, wind, out, start, tables, cells, constants, scratch, row, clamped):
    raise NotImplementedError("compiled code only")


@overload(_kernel, inline="always")
def _kernel_by_type(x, wind, out, start, tables, cells, constants, scratch, row, clamped) -> Any:
    if tables.ndim == 1:
        from fatigue_runner.turbine.generated.kernel import rhs

        def fixed(x, wind, out, start, tables, cells, constants, scratch, row, clamped):
            rhs(x, wind, out, start, tables, cells, constants, scratch, row, clamped)

        return fixed
    from fatigue_runner.turbine.generated.pitched import rhs as pitched_rhs

    def varying(x, wind, out, start, tables, cells, constants, scratch, row, clamped):
        pitched_rhs(x, wind, out, start, tables.reshape(tables.size), cells, constants, scratch, row, clamped)

    return varying


@njit(**INLINE)
def rhs(x, wind, out, start, tables, cells, constants, scratch, row, clamped):
    """out[start:] = state derivatives of LANES states x (16, LANES) under wind (3 or 4, LANES), all flat; the last signal is the pitch."""
    _kernel(x, wind, out, start, tables, cells, constants, scratch, row, clamped)


def _load_kernel(x, wind, derivative, out, start, tables, cells, constants, scratch, row, clamped):
    raise NotImplementedError("compiled code only")


@overload(_load_kernel, inline="always")
def _load_kernel_by_type(
    x, wind, derivative, out, start, tables, cells, constants, scratch, row, clamped
) -> Any:
    if tables.ndim == 1:
        from fatigue_runner.turbine.generated.kernel import loads as fixed_loads

        def fixed(x, wind, derivative, out, start, tables, cells, constants, scratch, row, clamped):
            fixed_loads(x, wind, derivative, out, start, tables, cells, constants, scratch, row, clamped)

        return fixed
    from fatigue_runner.turbine.generated.pitched import loads as pitched_loads

    def varying(x, wind, derivative, out, start, tables, cells, constants, scratch, row, clamped):
        flat = tables.reshape(tables.size)
        pitched_loads(x, wind, derivative, out, start, flat, cells, constants, scratch, row, clamped)

    return varying


@njit(**INLINE)
def loads(x, wind, derivative, out, start, tables, cells, constants, scratch, row, clamped):
    """out[start:] = load channels (k, LANES) of states with their derivatives; else as `rhs`."""
    _load_kernel(x, wind, derivative, out, start, tables, cells, constants, scratch, row, clamped)
