"""The registry of methods: name -> method. Adding a Runge-Kutta method is one entry in tableaux.py and one word here."""

from __future__ import annotations

from functools import cache

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.integrators import tableaux as t
from fatigue_runner.integrators.tableaux import ButcherTableau

_TABLEAUX = {
    m.name: m for m in (t.EULER, t.HEUN, t.RK3, t.HEUN_RICHARDSON, t.BS32, t.RK4, t.DP5, t.TSIT5, t.RK7)
}

METHODS = (*_TABLEAUX, "dop853")


@cache
def method(name: str) -> ButcherTableau:
    """The method of this name. Raises InputError with the nearest known one."""
    if name == "dop853":
        return t.dop853()
    if name not in _TABLEAUX:
        raise InputError(f"unknown integrator {name!r}{did_you_mean(name, METHODS)}")
    return _TABLEAUX[name]
