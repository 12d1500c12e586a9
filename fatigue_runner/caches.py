"""What this program need not make twice: where compiled kernels and the hash of its own code lie, and what is made of an object."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

Owner = TypeVar("Owner")
Result = TypeVar("Result")
Parameters = ParamSpec("Parameters")


def cache_base() -> Path:
    """NUMBA_CACHE_DIR where that is set, else the program's folder in the user's cache."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    return Path(
        given
        or os.path.join(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "fatigue-runner")
    )


def kept_with(
    most: int,
) -> Callable[
    [Callable[Concatenate[Owner, Parameters], Result]], Callable[Concatenate[Owner, Parameters], Result]
]:
    """Results of a function live as long as its first argument, `most` of them, the oldest go first: what is made of a turbine takes up
    to 50 MB, and a study may make thousands of turbines. No result may hold its owner."""

    def decorate(
        function: Callable[Concatenate[Owner, Parameters], Result],
    ) -> Callable[Concatenate[Owner, Parameters], Result]:
        kept: WeakKeyDictionary[Any, dict[Any, Result]] = WeakKeyDictionary()

        @wraps(function)
        def look_up(owner: Owner, /, *args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
            results, key = kept.setdefault(owner, {}), (args, *kwargs.items())
            try:
                return results[key]
            except KeyError:
                made = function(owner, *args, **kwargs)
            if len(results) >= most:
                results.pop(next(iter(results)), None)  # another thread may have been faster
            results[key] = made
            return made

        return look_up

    return decorate
