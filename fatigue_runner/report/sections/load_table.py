"""The damage-equivalent loads as numbers: of every channel, Wöhler exponent and integrator."""

from __future__ import annotations

from fatigue_runner.channels import BY_NAME, Channel
from fatigue_runner.report.blocks import Column, Section, Table, TableRow
from fatigue_runner.report.rundata import Run
from fatigue_runner.report.selection import left_out, shown_integrators
from fatigue_runner.results.cells import format_percent, numbers, text
from fatigue_runner.results.ranking import MethodSummary

ORDER = 42


def build(run: Run) -> Section | None:
    """A row for each channel and exponent, a column for each integrator; None where there are no loads."""
    shown = [*([run.reference] if run.reference else []), *shown_integrators(run)]
    columns = [
        Column("Channel", number=False, pick=True),
        Column("m", pick=True),
        Column("Unit", number=False),
        *(Column(s.label, "reference" if s.is_reference else "") for s in shown),
        *([Column("Between winds", "± of the mean")] if len(run.winds) > 1 else []),
    ]
    rows = [row for channel, m, suffix in run.columns if (row := _row(run, shown, channel, m, suffix))]
    if not rows:
        return None
    caption = (
        "Short-term damage-equivalent loads (ranges), power mean over the winds that the integrator finished, each wind alike: a life "
        "weighs them with its climate. Between winds: standard deviation over mean, by the first integrator shown."
        + left_out(run, shown[1:] if run.reference else shown)
    )
    return Section("Damage-equivalent loads", [Table(columns, rows, caption)])


def _row(run: Run, shown: list[MethodSummary], channel: str, m: float, suffix: str) -> TableRow | None:
    known = BY_NAME.get(channel, Channel(channel, "", channel, ""))
    loads = [
        numbers([row for row in run.rows_of(s) if text(row, "status") == "done"], f"del_{suffix}")
        for s in shown
    ]
    if not any(loads):
        return None
    cells = [known.label, f"{m:g}", known.read_unit, *(_power_mean(found, m, known.scale) for found in loads)]
    return TableRow(cells + ([_spread(loads[0])] if len(run.winds) > 1 else []))


def _power_mean(loads: list[float], m: float, scale: float) -> str:
    largest = max(loads, default=0.0)
    if largest <= 0.0:
        return "0" if loads else "–"
    mean = largest * (sum((load / largest) ** m for load in loads) / len(loads)) ** (1.0 / m)
    return f"{mean * scale:,.1f}"


def _spread(loads: list[float]) -> str:
    mean = sum(loads) / len(loads) if loads else 0.0
    if mean <= 0.0:
        return "–"
    return format_percent((sum((load - mean) ** 2 for load in loads) / len(loads)) ** 0.5 / mean)
