"""Every case: those that did not finish, with their times, and the table of all."""

from __future__ import annotations

import heapq

from fatigue_runner.report.blocks import Block, Column, Paragraph, Section, Table, TableRow
from fatigue_runner.report.rundata import Run
from fatigue_runner.report.sections.limits import lost_share
from fatigue_runner.results.cells import Row, format_error, format_percent, integrator, number, text, truth
from fatigue_runner.results.relevance import relevant_errors

ORDER = 70
TIME = "Time: of the integration, the case's share of its block, whose cases advance together."
MOST = 200  # rows on paper; the rest is in results.csv


def build(run: Run) -> Section:
    """The cases that did not finish, then all of them (the worst where there are too many for paper)."""
    blocks: list[Block] = [*_unfinished(run), *_all(run)]
    return Section("Cases", blocks)


def _unfinished(run: Run) -> list[Block]:
    bad = [row for row in run.rows if text(row, "status") != "done"]
    if not bad:
        return [Paragraph(f"All {len(run.rows)} cases finished.")]
    shown = bad[:MOST]
    columns = [
        *CASE_COLUMNS[:4],
        Column("Status", number=False),
        Column("at", "s"),
        Column("Reason", number=False),
    ]
    rows = [
        TableRow([*_who(row), text(row, "status"), _at(row), text(row, "error_message") or "–"], "bad")
        for row in shown
    ]
    first = f"The first {MOST} stand here, all of them in results.csv. " if len(bad) > MOST else ""
    caption = (
        f"Cases that did not finish: {len(bad)} of {len(run.rows)} ({format_percent(lost_share(run.rows))}). {first}"
        "They are logged up to the time given and left out of every load."
    )
    return [Table(columns, rows, caption)]


CASE_COLUMNS = (
    Column("Wind", "m/s"),
    Column("Shear", "vertical / horizontal"),
    Column("Seed"),
    Column("Integrator", number=False, pick=True),
    Column("Status", number=False, pick=True),
    Column("Evaluations"),
    Column("Time", "ms"),
    Column("NRMSE", "worst state"),
    Column("DEL error", "worst"),
    Column("Clamped", "look-ups"),
)


def _all(run: Run) -> list[Block]:
    rows = [row for wind in run.winds for row in wind.rows]
    caption = f"All cases, by wind speed. {TIME} Every column of every channel is in results.csv."
    if len(rows) > MOST:
        rows = heapq.nlargest(MOST, rows, key=lambda row: _worst(run, row) or 0.0)
        caption = f"The {MOST} of {len(run.rows)} cases with the largest DEL error. {TIME} All of them are in results.csv."
    return [Table(CASE_COLUMNS, [_case(run, row) for row in rows], caption)]


def _case(run: Run, row: Row) -> TableRow:
    wall, worst = number(row, "wall_time"), _worst(run, row)
    cells = [
        *_who(row),
        text(row, "status"),
        _whole(row, "evaluations"),
        "–" if wall is None else f"{wall * 1e3:.2f}",
        "–" if truth(row, "is_reference") else format_error(number(row, "nrmse_max")),
        "–" if worst is None or truth(row, "is_reference") else format_percent(worst),
        _whole(row, "clamped_lookups"),
    ]
    mark = "bad" if text(row, "status") != "done" else "quiet" if truth(row, "is_reference") else ""
    return TableRow(cells, mark)


def _who(row: Row) -> list[str]:
    speed = number(row, "wind_speed")
    shear = " / ".join(
        "–" if value is None else f"{value:.3g}"
        for value in (number(row, "vertical_shear"), number(row, "horizontal_shear"))
    )
    return ["–" if speed is None else f"{speed:.4g}", shear, text(row, "seed") or "–", integrator(row)]


def _at(row: Row) -> str:
    at = number(row, "diverged_at")
    return "–" if at is None else f"{at:.4g}"


def _whole(row: Row, column: str) -> str:
    value = number(row, column)
    return "–" if value is None else f"{value:.0f}"


def _worst(run: Run, row: Row) -> float | None:
    """The largest size of the row's DEL errors."""
    return max((abs(value) for value in relevant_errors(row, run.columns).values()), default=None)
