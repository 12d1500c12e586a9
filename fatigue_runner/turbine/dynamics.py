"""By which equations a turbine moves: the layout of its states, and the compiled model for each kind of input."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

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


UNCONTROLLED = Dynamics(T2B1I1CG, _uncontrolled)
