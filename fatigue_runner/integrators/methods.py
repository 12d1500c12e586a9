"""The registry of methods: name -> method, gathered from the files of the families.

A new Runge-Kutta method is one entry in tableaux.py, an Adams method one in adams.py; a new family is one file, named here.
"""

from __future__ import annotations

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.integrators import adams, exponential_adams, exponential_runge_kutta, tableaux
from fatigue_runner.integrators.contract import Method

_FAMILIES = (tableaux, adams, exponential_runge_kutta, exponential_adams)
_BY_NAME: dict[str, Method] = {
    found.name: found
    for family in _FAMILIES
    for key, found in vars(family).items()
    if not key.startswith("_") and hasattr(found, "prepare") and isinstance(getattr(found, "name", None), str)
}

# the method of the next order that has the same first stages, by name
SHARING = {
    name: other.name
    for name, found in _BY_NAME.items()
    if (other := getattr(found, "shared_by", None)) is not None
}

METHODS = (*_BY_NAME, "dop853")


def method(name: str) -> Method:
    """The method of this name. Raises InputError with the nearest known one."""
    if name == "dop853":  # made from SciPy's coefficients: not before someone asks
        return tableaux.dop853()
    if name not in _BY_NAME:
        raise InputError(f"unknown integrator {name!r}{did_you_mean(name, METHODS)}")
    return _BY_NAME[name]
