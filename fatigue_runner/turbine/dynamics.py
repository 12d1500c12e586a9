"""By which equations a turbine moves: the layout of its states, and the compiled model for each kind of input."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fatigue_runner.control import SUBMODELS, Submodel
from fatigue_runner.errors import InputError
from fatigue_runner.layout import FAMILIES, SEEN_OF_CONTROL, Layout

if TYPE_CHECKING:
    from fatigue_runner.turbine.model import Model


@dataclass(frozen=True)
class Dynamics:
    """layout: the states and the wind signals; model: from (prescribed pitch that varies, wind with azimuthal harmonics) to the `Model`;
    controller: whose states stand behind the turbine's own, None where nobody steers.

    All models have the layout's states. `model` is called when something is first evaluated, so that nobody else loads the compiler;
    it raises InputError for inputs that these equations do not take. A turbine with a controller, say, is `replace(turbine,
    dynamics=Dynamics(layout, model))`: operating point, linear parts, runs and logs then have the controller's states behind the
    turbine's own.
    """

    layout: Layout
    model: Callable[[bool, bool], Model]
    controller: Submodel | None = None


def _uncontrolled(family: str) -> Dynamics:
    def model(varying_pitch: bool, harmonics: bool) -> Model:
        from fatigue_runner.turbine.model import MODELS

        kind = "pitched" if varying_pitch else "kernel"
        if harmonics:
            kind = "pitched_harmonic" if varying_pitch else "harmonic"
        return MODELS[family][kind]

    return Dynamics(FAMILIES[family], model)


def _controlled(family: str, controller: Submodel) -> Dynamics:
    def model(varying_pitch: bool, harmonics: bool) -> Model:
        from fatigue_runner.turbine.model import controlled

        if varying_pitch:
            raise InputError(
                "a controller makes the pitch itself; give no pitch over time, or use operation: fixed"
            )
        return controlled(family, controller)

    # its wind may have harmonics or none
    layout = FAMILIES[family].extended(first_order=controller.states, harmonics=True)
    return Dynamics(layout, model, controller)


# by the turbine's model, and by the controller's name
UNCONTROLLED = {family: _uncontrolled(family) for family in FAMILIES}
CONTROLLED_BY = {
    family: {controller.name: _controlled(family, controller) for controller in SUBMODELS}
    for family in FAMILIES
}


def signals_of_control() -> dict[str, str]:
    """Name and unit of every state and signal that a controller may have."""
    states = (channel for controller in SUBMODELS for channel in controller.states)
    seen = (channel for controller in SUBMODELS for channel in controller.seen)
    found = (*(state.signal for state in states), *SEEN_OF_CONTROL, *seen)
    return {channel.name: channel.unit for channel in found}
