"""Which integrators and winds a figure shows, where all of them would be a tangle."""

from __future__ import annotations

from collections.abc import Iterable

from fatigue_runner.report.rundata import Run, WindCase
from fatigue_runner.report.style import family
from fatigue_runner.results.cells import Row, number
from fatigue_runner.results.ranking import LEVELS, MethodSummary, cheapest_within

MOST_SPEEDS = 120  # marks over wind speed in a figure


def shown_integrators(run: Run, limit: int = 5) -> list[MethodSummary]:
    """At most `limit` integrators, in the order of their cost: all where they fit.

    Otherwise the recommended ones, each method at its largest step that finished everywhere, then the front.
    """
    if len(run.integrators) <= limit:
        return run.integrators
    wanted = [s for level in LEVELS if (s := cheapest_within(run.integrators, level)) is not None]
    largest: dict[tuple[str, str, str], MethodSummary] = {}
    for summary in sorted(run.integrators, key=lambda s: -(s.step or 0.0)):
        if summary.complete:
            largest.setdefault(family(summary), summary)
    wanted += largest.values()
    wanted += [s for s in run.integrators if s.on_front]
    wanted += run.integrators
    chosen = list(dict.fromkeys(wanted))[:limit]
    return [s for s in run.integrators if s in chosen]


def shown_winds(run: Run, count: int = 3) -> list[WindCase]:
    """The slowest, middle and fastest wind of the campaign (fewer where it has fewer), each at its first seed."""
    first: dict[float, WindCase] = {}
    for wind in run.winds:
        if wind.speed is not None:
            first.setdefault(wind.speed, wind)
    winds = list(first.values())
    if len(winds) <= count:
        return winds
    return [winds[round(i * (len(winds) - 1) / (count - 1))] for i in range(count)]


def by_speed(rows: Iterable[Row], most: int = MOST_SPEEDS) -> list[tuple[float, list[Row]]]:
    """(mean wind speed [m/s], its rows), slowest first; where there are more than `most` speeds, those of one of so many equal bins
    together, at their mean."""
    groups: dict[float, list[Row]] = {}
    for row in rows:
        speed = number(row, "wind_speed")
        if speed is not None:
            groups.setdefault(speed, []).append(row)
    if len(groups) <= most:
        return sorted(groups.items())
    first, width = min(groups), (max(groups) - min(groups)) / most
    bins: dict[int, list[float]] = {}
    for speed in sorted(groups):
        bins.setdefault(min(int((speed - first) / width), most - 1), []).append(speed)
    return [
        (sum(speed * len(groups[speed]) for speed in found) / sum(len(groups[speed]) for speed in found),
         [row for speed in found for row in groups[speed]])
        for found in bins.values()
    ]  # fmt: skip


def together(rows: Iterable[Row], most: int = MOST_SPEEDS) -> str:
    """A sentence where `by_speed` takes speeds together; empty elsewhere."""
    speeds = {speed for row in rows if (speed := number(row, "wind_speed")) is not None}
    if len(speeds) <= most:
        return ""
    return f" {len(speeds)} mean wind speeds are drawn in {most} bins of {(max(speeds) - min(speeds)) / most:.2g} m/s."


def left_out(run: Run, shown: list[MethodSummary]) -> str:
    """A sentence on the integrators that a figure leaves out; empty where it shows all."""
    missing = len(run.integrators) - len(shown)
    if missing <= 0:
        return ""
    return f" {missing} of the {len(run.integrators)} integrators are left out here; the first table has all."
