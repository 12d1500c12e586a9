"""The answer first: which integrator is good enough, and what it costs."""

from __future__ import annotations

from fatigue_runner.report.blocks import Column, Paragraph, Section, Table, TableRow
from fatigue_runner.report.rundata import Run
from fatigue_runner.results.cells import format_count, format_error, format_percent
from fatigue_runner.results.ranking import (
    LEVELS,
    MethodSummary,
    answer,
    cheapest_classical,
    cheapest_within,
    saving,
)

ORDER = 10

COLUMNS = (
    Column("Integrator", number=False),
    Column("Cost", "evaluations per simulated s"),
    Column("Fewer than the best classical", "times"),
    Column("Measured", "µs per simulated s"),
    Column("State error", "NRMSE, median"),
    Column("State error", "NRMSE, worst"),
    Column("DEL error", "median"),
    Column("DEL error", "worst"),
    Column("Worst DEL error at", number=False, wide=True),
    Column("Verdict", number=False),
)


def build(run: Run) -> Section:
    """One sentence per level of DEL error, then every integrator with its cost, its errors and a verdict."""
    sentences = answer(run.summaries)
    winners = [cheapest_within(run.integrators, level) for level in LEVELS]
    rows = [TableRow(_cells(run, s), _mark(s, winners)) for s in run.summaries]
    lead = [Paragraph(_unbroken(sentence), strong=i == 0) for i, sentence in enumerate(sentences)]
    best = cheapest_classical(run.summaries)
    compared = (
        ""
        if best is None
        else f" Best classical: {best.label}, the cheapest without a corrector at the strictest level met."
    )
    caption = CAPTION + compared + (UNSEEN if any(s.unseen for s in run.summaries) else "")
    return Section(
        "Which integrator is good enough, and what does it cost?", [*lead, Table(COLUMNS, rows, caption)]
    )


CAPTION = (
    "Cheapest first. Cost: evaluations of the equations of motion, the same on every machine, and the measured "
    "wall-clock time of the integration alone, which suffers from other load on the machine; medians over the "
    "finished cases. Errors against the reference of the same wind; DEL errors over all channels, Wöhler "
    "exponents and winds. ● on the Pareto front: nothing else is both cheaper and better. Shaded: the cheapest "
    "at each level."
)
UNSEEN = " * Some winds lie outside those that the corrector was trained on, see below."


def _cells(run: Run, s: MethodSummary) -> list[str]:
    fewer = None if s.is_reference else saving(s, cheapest_classical(run.summaries))
    worst = s.worst_del_error
    return [
        s.label + (" (reference)" if s.is_reference else " ●" if s.on_front else ""),
        _shown(s.evaluations_per_second),
        _shown(fewer),
        _shown(None if s.wall_time_per_second is None else s.wall_time_per_second * 1e6),
        format_error(s.nrmse_median),
        format_error(s.nrmse_worst),
        "–" if s.median_del_error is None else format_percent(s.median_del_error),
        "–" if worst is None else format_percent(worst.value),
        "–" if worst is None else _unbroken(worst.where()),
        _verdict(s),
    ]


def _unbroken(place: str) -> str:
    """Keep `m = 12` and `5 m/s` on one line each."""
    return place.replace(" = ", "\u00a0=\u00a0").replace(" m/s", "\u00a0m/s")


def _shown(value: float | None) -> str:
    return "–" if value is None else format_count(value)


def _verdict(s: MethodSummary) -> str:
    lost = [
        f"{what} in {n} of {s.cases}" for n, what in ((s.diverged, "diverged"), (s.failed, "failed")) if n
    ]
    if lost:
        return ", ".join(lost)
    if s.is_reference:
        return "reference"
    if s.worst_del_error is None:
        return "not compared"
    within = [level for level in LEVELS if s.worst_del_error.size <= level]
    said = f"within {format_percent(min(within))}" if within else f"not within {format_percent(max(LEVELS))}"
    return f"{said} *" if s.unseen else said


def _mark(s: MethodSummary, winners: list[MethodSummary | None]) -> str:
    if s in winners:
        return "good"
    if s.is_reference:
        return "quiet"
    return "" if s.complete else "bad"
