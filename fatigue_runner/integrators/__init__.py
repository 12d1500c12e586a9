"""How time passes: methods, one family a file, and one compiled loop over lanes.

`Ensemble` says what is integrated, `Integrator` who integrates, `simulate` does it. `contract` has the rules for a new method,
`protocol` those for a corrector, `stepper` the loop. Names are loaded when they are first used (PEP 562), so that a campaign file is
read without a compiler.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fatigue_runner.integrators.ensemble import (
        ENHANCED,
        HYBRID,
        MODES,
        Ensemble,
        Integrator,
        simulate,
        warm_up,
    )
    from fatigue_runner.integrators.methods import METHODS, method
    from fatigue_runner.integrators.stability import stability_limit
    from fatigue_runner.integrators.wind_steps import refuse_unresolved

__all__ = [
    "ENHANCED",
    "HYBRID",
    "METHODS",
    "MODES",
    "Ensemble",
    "Integrator",
    "method",
    "refuse_unresolved",
    "simulate",
    "stability_limit",
    "warm_up",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from fatigue_runner.integrators import ensemble, methods, stability, wind_steps

    elsewhere = {
        "METHODS": methods,
        "method": methods,
        "stability_limit": stability,
        "refuse_unresolved": wind_steps,
    }
    place: Any = elsewhere.get(name, ensemble)
    globals()[name] = value = getattr(place, name)
    return value
