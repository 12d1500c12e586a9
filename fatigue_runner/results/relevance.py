"""How much an error of a damage-equivalent load matters: over the load itself, or where that is next to nothing over what governs there.

The side-side moment of a tower in steady wind has a DEL of 1 kN m on a mean of thousands; a tenth of it is nothing to anybody. Standard
library only, as `ranking`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache

from fatigue_runner.results.cells import Row, number

# Of the load that governs at the same place (tower base, blade root): the DEL below which errors are measured against it.
FLOOR = 0.01


@cache
def place_of(channel: str) -> str:
    """What channels of one cross-section have in common: `tower_base`, `blade1_root`."""
    return "_".join(channel.split("_")[:2])


def governing(channel: str, loads: Mapping[str, Iterable[float | None]]) -> float:
    """The largest of the loads (means and DELs, without sign) of all channels at the place of `channel`."""
    place = place_of(channel)
    found = [
        abs(v) for name, values in loads.items() if place_of(name) == place for v in values if v is not None
    ]
    return max(found, default=0.0)


def relevant(error: float, load: float | None, governs: float) -> float:
    """An error relative to the reference's DEL `load`, over FLOOR of what governs where that is more; as it is without a load."""
    if load is None or load <= 0.0 or governs <= 0.0:
        return error
    return error * min(1.0, load / (FLOOR * governs))


def relevant_errors(row: Row, columns: Sequence[tuple[str, float, str]]) -> dict[str, float]:
    """{suffix: error} of a row's DEL errors as they count in the verdict; columns: `ranking.fatigue_columns`."""
    # as `governing`, of all channels at once: a report asks for thousands of rows
    errors: dict[str, float] = {}
    exact: dict[str, float | None] = {}
    governs: dict[tuple[str, float], float] = {}
    places = [(suffix, (place_of(channel), exponent)) for channel, exponent, suffix in columns]
    for suffix, place in places:
        error = number(row, f"del_error_{suffix}")
        if error is not None:
            errors[suffix], exact[suffix] = error, _reference(number(row, f"del_{suffix}"), error)
            governs[place] = max(governs.get(place, 0.0), abs(exact[suffix] or 0.0))
    if not errors:
        return {}
    means: dict[str, float] = {}
    for channel in dict.fromkeys(channel for channel, _, _ in columns):
        mean, where = number(row, f"mean_{channel}"), place_of(channel)
        means[where] = max(means.get(where, 0.0), abs(mean or 0.0))
    return {
        suffix: relevant(errors[suffix], exact[suffix], max(governs[place], means[place[0]]))
        for suffix, place in places
        if suffix in errors
    }


def _reference(load: float | None, error: float) -> float | None:
    """The reference's DEL, from one and its error."""
    return None if load is None or error <= -1.0 else load / (1.0 + error)
