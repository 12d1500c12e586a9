"""Compiled functions whose code depends on the type of their first argument, so that a family of methods is one file.

`stepper.advance`, say, is a stub. A family that has its arrays in a NamedTuple registers its own code for it:

    @compiled_for(advance, RungeKuttaArrays)
    @njit(**INLINE)
    def _advance(method, ...): ...

A loop that calls `advance(method, ...)` is then compiled anew for each family, with that family's code inside.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from numba.core import types
from numba.extending import overload


def compiled_for(stub: Callable[..., Any], kind: type | None) -> Callable[[Any], Any]:
    """Register a compiled function as `stub`'s code where the first argument is of NamedTuple class `kind`, or None."""
    names = list(inspect.signature(stub).parameters)

    def fits(argument: Any) -> bool:
        if kind is None:
            return isinstance(argument, types.NoneType)
        return getattr(argument, "instance_class", None) is kind

    def register(function: Any) -> Any:
        listed = ", ".join(names)
        space: dict[str, Any] = {"fits": fits, "function": function}
        # numba matches the names of the arguments, so that they must be the stub's
        exec(
            f"def chosen({listed}):\n"
            f"    if fits({names[0]}):\n"
            f"        def call({listed}):\n"
            f"            return function({listed})\n"
            "        return call\n"
            "    return None\n",
            space,
        )
        overload(stub, inline="always")(space["chosen"])
        return function

    return register
