"""By which equations a turbine moves: the layout of its states, and the compiled model for each kind of input."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fatigue_runner.control import BASELINE
from fatigue_runner.errors import InputError
from fatigue_runner.layout import T2B1I1CG, Layout

if TYPE_CHECKING:
    from fatigue_runner.turbine.model import Model


@dataclass(frozen=True)
class Dynamics:
    """layout: the states and the wind signals; model: from (prescribed pitch that varies, wind with azimuthal harmonics) to the `Model`.

    All models have the layout's states. `model` is called when something is first evaluated, so that nobody else loads the compiler;
    it raises InputError for inputs that these equations do not take. A turbine with a controller, say, is `replace(turbine,
    dynamics=Dynamics(layout, model))`: operating point, linear parts, runs and logs then have the controller's states behind the
    turbine's own.
    """

    layout: Layout
    model: Callable[[bool, bool], Model]


def _uncontrolled(varying_pitch: bool, harmonics: bool) -> Model:
    from fatigue_runner.turbine import model

    if varying_pitch:
        return model.VARYING_PITCH_HARMONIC if harmonics else model.VARYING_PITCH
    return model.HARMONIC if harmonics else model.FIXED_PITCH


def _controlled(varying_pitch: bool, harmonics: bool) -> Model:
    from fatigue_runner.turbine import model

    if varying_pitch:
        raise InputError(
            "a controller makes the pitch itself; give no pitch over time, or use operation: fixed"
        )
    return model.CONTROLLED


UNCONTROLLED = Dynamics(T2B1I1CG, _uncontrolled)
# its wind may have harmonics or none
BASELINE_CONTROLLED = Dynamics(T2B1I1CG.extended(first_order=BASELINE.states, harmonics=True), _controlled)
