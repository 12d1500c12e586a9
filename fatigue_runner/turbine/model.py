"""A set of compiled equations and how compiled code is told which one it runs: by the type of a token.

A `Model` is the layout of a state with the generated module that holds its kernels. Given to compiled code it has a numba type of
its own, so that a loop is compiled for the widths and the kernel of that model, and every one of them is a constant there.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.core.datamodel import models
from numba.extending import NativeValue, intrinsic, overload, register_model, typeof_impl, unbox
from numpy.typing import NDArray

from fatigue_runner.compiled import INLINE, njit
from fatigue_runner.control import Submodel
from fatigue_runner.layout import DEFAULT_FAMILY, FAMILIES, PITCH, Layout
from fatigue_runner.turbine.lane_code import LANES

Array = NDArray[np.float64]


COMMANDS = 2  # what a controller commands: pitch and generator torque


@dataclass(frozen=True, eq=False)
class Model:
    """name: of the equations; generated: the module with `rhs`, `loads`, `constants`, `TABLES`, ...; layout: its states and signals.

    One object for a set of equations: compared by identity, because comparing layouts took longer than evaluating the equations.
    """

    name: str
    generated: ModuleType
    layout: Layout

    def __post_init__(self) -> None:
        _KNOWN[self.key] = self

    @cached_property
    def key(self) -> str:
        """Name of the numba type: two models with other equations or another layout never share compiled code."""
        source = Path(str(self.generated.__file__)).read_bytes()
        digest = hashlib.sha256(source + repr(self.layout).encode()).hexdigest()
        return f"{self.name}-{digest[:16]}"

    @cached_property
    def numba_type(self) -> ModelType:
        return ModelType(self.key)

    @property
    def looks_up_pitch(self) -> bool:
        """Whether its tables go over the pitch, too: it is a signal, or made of the states, and not one number for a whole run."""
        return bool(self.generated.RHS_CODE.second)


_KNOWN: dict[str, Model] = {}


class KernelArrays(NamedTuple):
    """What a kernel reads of a turbine, and the (LANES,) counters of look-ups outside its tables."""

    tables: Array
    cells: int
    constants: Array
    clamped: NDArray[np.int64]


class ModelType(types.Opaque):
    """The numba type of one model; `key` finds it again where compiled code is loaded from the cache."""

    def __init__(self, key: str) -> None:
        self.model_key = key
        super().__init__(name=f"Model({key})")

    @property
    def model(self) -> Model:
        return _KNOWN[self.model_key]


register_model(ModelType)(models.OpaqueModel)


@typeof_impl.register(Model)
def _typeof_model(model: Model, _context: Any) -> ModelType:
    return model.numba_type


def _unbox_model(_type: ModelType, _value: Any, context: Any) -> Any:
    return NativeValue(context.context.get_dummy_value())


unbox(ModelType)(_unbox_model)


def constant(of: Callable[[Layout], int]) -> Any:
    """An intrinsic (model) -> number of its layout, a constant in compiled code."""

    def typed(typing_context: Any, model: Any) -> Any:
        if not isinstance(model, ModelType):
            return None
        value = int(of(model.model.layout))

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return ir.Constant(ir.IntType(64), value)

        return types.int64(model), codegen

    return intrinsic(typed)


width = constant(lambda layout: layout.size * LANES)  # numbers in the state of a group of lanes
rows = constant(lambda layout: layout.size)
padded_rows = constant(
    lambda layout: 1 << (layout.size - 1).bit_length()
)  # the next power of two, for reductions by halves
freedoms = constant(lambda layout: layout.freedoms)
rotor = constant(lambda layout: layout.rotor)
first_order = constant(lambda layout: len(layout.first_order))
wind_signals = constant(lambda layout: len(layout.wind))
harmonics = constant(lambda layout: int(layout.harmonics))
control_signals = constant(lambda layout: len(layout.control))


def _rhs(model, x, wind, control, out, start, data):
    raise NotImplementedError("compiled code only")


@overload(_rhs, inline="always")
def _rhs_of_model(model, x, wind, control, out, start, data):
    kernel = model.model.generated.rhs

    def call(model, x, wind, control, out, start, data):
        kernel(x, wind, control, out, start, data.tables, data.cells, data.constants, data.clamped)

    return call


@njit(**INLINE)
def rhs(model, x, wind, control, out, start, data):
    """out[start:] = state derivatives of LANES states x under wind and control signals, all flat [row][LANES]; data: `KernelArrays`."""
    _rhs(model, x, wind, control, out, start, data)


def _loads(model, x, wind, control, out, start, data):
    raise NotImplementedError("compiled code only")


@overload(_loads, inline="always")
def _loads_of_model(model, x, wind, control, out, start, data):
    kernel = model.model.generated.loads

    def call(model, x, wind, control, out, start, data):
        kernel(x, wind, control, out, start, data.tables, data.cells, data.constants, data.clamped)

    return call


@njit(**INLINE)
def loads(model, x, wind, control, out, start, data):
    """out[start:] = load channels (k, LANES) of states, with the accelerations of the equations; else as `rhs`."""
    _loads(model, x, wind, control, out, start, data)


def _commands(model, x, out, start, data):
    raise NotImplementedError("compiled code only")


@overload(_commands, inline="always")
def _commands_of_model(model, x, out, start, data):
    kernel = getattr(model.model.generated, "commands", None)
    if kernel is None:
        return lambda model, x, out, start, data: None

    def call(model, x, out, start, data):
        kernel(x, out, start, data.tables, data.cells, data.constants, data.clamped)

    return call


@njit(**INLINE)
def commands(model, x, out, start, data):
    """out[start:] = `COMMANDS` of LANES states, pitch [rad] and generator torque [N m], then the rates of the controller's states; nothing
    where nobody steers."""
    _commands(model, x, out, start, data)


def _prefix(family: str) -> str:
    """Of the names of its generated modules."""
    return "" if family == DEFAULT_FAMILY else f"{family}_"


def _model(family: str, kind: str, title: str, layout: Layout) -> Model:
    prefix = _prefix(family)
    generated = import_module(f"{__package__}.generated.{prefix}{kind}")
    return Model(f"{family}-{title}" if prefix else title, generated, layout)


def _models(family: str) -> dict[str, Model]:
    """Every set of equations without a controller of one member of the family, by what it takes beside the turbine's states."""
    layout = FAMILIES[family]
    pitched = layout.extended(control=(PITCH,))
    layouts = {
        "kernel": ("fixed-pitch", layout),
        "pitched": ("varying-pitch", pitched),
        "harmonic": ("fixed-pitch-harmonic", layout.extended(harmonics=True)),
        "pitched_harmonic": ("varying-pitch-harmonic", pitched.extended(harmonics=True)),
    }
    return {kind: _model(family, kind, title, own) for kind, (title, own) in layouts.items()}


MODELS = {family: _models(family) for family in FAMILIES}


@cache
def controlled(family: str, controller: Submodel) -> Model:
    """The model under a controller; its generated module is loaded where somebody runs under it."""
    layout = FAMILIES[family].extended(first_order=controller.states, harmonics=True)
    return _model(family, f"controlled_{controller.name}", f"controlled-{controller.name}", layout)
