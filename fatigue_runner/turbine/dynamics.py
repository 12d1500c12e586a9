"""By which equations a turbine moves: the layout of its states, and the compiled model for each kind of input."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fatigue_runner.control import BASELINE
from fatigue_runner.errors import InputError
from fatigue_runner.layout import FAMILIES, Layout

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


def _uncontrolled(family: str) -> Dynamics:
    def model(varying_pitch: bool, harmonics: bool) -> Model:
        from fatigue_runner.turbine.model import MODELS

        kind = "pitched" if varying_pitch else "kernel"
        if harmonics:
            kind = "pitched_harmonic" if varying_pitch else "harmonic"
        return MODELS[family][kind]

    return Dynamics(FAMILIES[family], model)


def _controlled(family: str) -> Dynamics:
    def model(varying_pitch: bool, harmonics: bool) -> Model:
        from fatigue_runner.turbine.model import MODELS

        if varying_pitch:
            raise InputError(
                "a controller makes the pitch itself; give no pitch over time, or use operation: fixed"
            )
        return MODELS[family]["controlled"]

    # its wind may have harmonics or none
    return Dynamics(FAMILIES[family].extended(first_order=BASELINE.states, harmonics=True), model)


# by the turbine's model
UNCONTROLLED = {family: _uncontrolled(family) for family in FAMILIES}
BASELINE_CONTROLLED = {family: _controlled(family) for family in FAMILIES}
