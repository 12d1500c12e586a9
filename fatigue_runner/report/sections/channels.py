"""Where each integrator errs: worst DEL error per channel, and the error of every state."""

from __future__ import annotations

from statistics import median

from fatigue_runner.channels import BY_NAME, STATES
from fatigue_runner.report.blocks import Block, Column, Section, Table, TableRow
from fatigue_runner.report.rundata import Run
from fatigue_runner.report.selection import left_out, shown_integrators
from fatigue_runner.results.cells import format_error, format_percent, numbers
from fatigue_runner.results.ranking import MethodSummary

ORDER = 60


def build(run: Run) -> Section | None:
    """Two tables: integrators × channels, states × integrators; None where nothing was compared."""
    blocks: list[Block] = [
        table for table in (_dels(run), _states(run)) if table.rows and len(table.columns) > 1
    ]
    return Section("Where the integrators err", blocks) if blocks else None


def _dels(run: Run) -> Table:
    channels = list(dict.fromkeys(channel for channel, _, _ in run.columns))
    heads = [Column(BY_NAME[c].label if c in BY_NAME else c, "DEL error, worst (at m)") for c in channels]
    compared = [s for s in run.integrators if s.worst_del_error is not None]
    rows = [
        TableRow([s.label, *(_worst(s, c) for c in channels)], "" if s.complete else "bad") for s in compared
    ]
    caption = (
        "Worst DEL error of each channel over all winds and exponents, with its sign; finished cases only. As in the verdict, see the "
        "definition of DEL error."
    )
    return Table([Column("Integrator", number=False), *heads], rows, caption)


def _worst(summary: MethodSummary, channel: str) -> str:
    found = next((error for error in summary.channel_errors if error.channel == channel), None)
    return "–" if found is None else f"{format_percent(found.value)} (m = {found.exponent:g})"


def _states(run: Run) -> Table:
    shown = shown_integrators(run)
    rows = [
        TableRow([state.label, *(_median(run, s, f"nrmse_{state.name}") for s in shown)]) for state in STATES
    ]
    rows = [row for row in rows if any(cell != "–" for cell in row.cells[1:])]
    caption = (
        "Median over the winds of each state's error: RMS over the range of the reference (NRMSE)."
        + left_out(run, shown)
    )
    return Table([Column("State", number=False), *(Column(s.label) for s in shown)], rows, caption)


def _median(run: Run, summary: MethodSummary, column: str) -> str:
    values = numbers(run.rows_of(summary), column)
    return format_error(median(values) if values else None)
