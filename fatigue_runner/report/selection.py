"""Which integrators and winds a figure shows, where all of them would be a tangle."""

from __future__ import annotations

from fatigue_runner.report.rundata import Run, WindCase
from fatigue_runner.report.style import family
from fatigue_runner.results.ranking import LEVELS, MethodSummary, cheapest_within


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


def left_out(run: Run, shown: list[MethodSummary]) -> str:
    """A sentence on the integrators that a figure leaves out; empty where it shows all."""
    missing = len(run.integrators) - len(shown)
    if missing <= 0:
        return ""
    return f" {missing} of the {len(run.integrators)} integrators are left out here; the first table has all."
