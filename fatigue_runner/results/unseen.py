"""Winds outside those that a corrector was trained on: allowed, and counted here. Standard library only, as `ranking`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fatigue_runner.results.cells import Row, number, numbers


@dataclass(frozen=True)
class Unseen:
    """`count` winds of an integrator whose mean speed lies outside the `trained` range [m/s], from `lowest` to `highest`.

    The hybrid's mean acceptance rate under them and under the other winds is None without a guard, or without such winds.
    """

    count: int
    trained: tuple[float, float]
    lowest: float
    highest: float
    acceptance: float | None
    elsewhere: float | None

    def sentence(self, integrator: str, corrector: str, cases: int) -> str:
        """What a person should know of it."""
        where = (
            f"at {self.lowest:.3g} m/s"
            if self.lowest == self.highest
            else f"between {self.lowest:.3g} and {self.highest:.3g} m/s"
        )
        known = f"the {self.trained[0]:.3g} to {self.trained[1]:.3g} m/s that {corrector} was trained on"
        return f"{integrator}: {self.count} of {cases} winds lie outside {known}, {where}; {self._trust()}."

    def _trust(self) -> str:
        if self.acceptance is None:
            return "no guard tells whether it can be trusted there"
        rest = f", under the others {_share(self.elsewhere)}" if self.elsewhere is not None else ""
        return f"the hybrid's acceptance rate is {_share(self.acceptance)} there{rest}"


def unseen(rows: Sequence[Row]) -> Unseen | None:
    """The winds of one integrator's rows that its corrector does not know; None where there are none or the range is unknown."""
    low, high = (next(iter(numbers(rows, name)), None) for name in ("trained_from", "trained_to"))
    if low is None or high is None:
        return None
    outside: list[Row] = []
    inside: list[Row] = []
    for row in rows:
        speed = number(row, "wind_speed")
        if speed is not None:
            (inside if low <= speed <= high else outside).append(row)
    if not outside:
        return None
    speeds = numbers(outside, "wind_speed")
    accepted, elsewhere = (_mean(numbers(part, "acceptance_rate")) for part in (outside, inside))
    return Unseen(len(outside), (low, high), min(speeds), max(speeds), accepted, elsewhere)


def _mean(values: list[float]) -> float | None:
    return math.fsum(values) / len(values) if values else None


def _share(value: float) -> str:
    """An acceptance rate in percent, never rounded up to all."""
    return f"{math.floor(value * 1000 + 1e-9) / 10:g}\u00a0%"
