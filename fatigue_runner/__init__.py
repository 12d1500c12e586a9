"""Fatigue campaigns for wind turbines with Runge-Kutta methods that learn their own error.

    import fatigue_runner as fr
    turbine = fr.load_turbine("nrel5mw")
    trajectory = fr.simulate(turbine, wind=fr.ConstantWind(8.0), method="heun", step=0.01, duration=20.0)

The names of `api` are loaded when they are first used (PEP 562), so that importing the package costs
next to nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fatigue_runner._version import __version__

if TYPE_CHECKING:
    from fatigue_runner.api import (
        ConstantWind,
        FullFieldWind,
        GustWind,
        MisalignedWind,
        PitchSeries,
        SeriesWind,
        StepWind,
        TowerInfluence,
        TurbulentWind,
        correctors,
        damage_equivalent_load,
        lifetime,
        load_turbine,
        rainflow,
        run_campaign,
        section_loads,
        simulate,
    )

__all__ = [
    "ConstantWind",
    "FullFieldWind",
    "GustWind",
    "MisalignedWind",
    "PitchSeries",
    "SeriesWind",
    "StepWind",
    "TowerInfluence",
    "TurbulentWind",
    "__version__",
    "correctors",
    "damage_equivalent_load",
    "lifetime",
    "load_turbine",
    "rainflow",
    "run_campaign",
    "section_loads",
    "simulate",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from fatigue_runner import api

    globals()[name] = value = getattr(api, name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
