"""The answer of a results table in the terminal: which integrator is good enough, and what it costs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fatigue_runner.channels import BY_NAME
from fatigue_runner.results.cells import format_percent
from fatigue_runner.results.ranking import (
    LEVELS,
    MethodSummary,
    answer,
    fatigue_columns,
    unseen_winds,
)

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from fatigue_runner.results.lifetime import Life
    from fatigue_runner.results.table import Results


def print_ranking(results: Results, console: Console) -> None:
    """A table of the integrators and the answer in words."""
    from rich.markup import escape

    summaries = results.summaries
    console.print(_table(results.columns, summaries, console))
    for sentence in [*answer(summaries), *unseen_winds(summaries), *results.operation]:
        console.print(escape(sentence))


def print_life(life: Life, summaries: Sequence[MethodSummary], console: Console) -> None:
    """The life in words: how long, which wind, which integrator is good enough, what to distrust."""
    from rich.markup import escape

    from fatigue_runner.results import life_words as words

    console.print(f"\n[bold]A life of {life.section.years:g} years[/]")
    for sentence in [
        *words.places_in_words(life),
        *words.loads_in_words(life),
        *words.integrator_in_words(life, summaries),
    ]:
        console.print(escape(sentence))
    for sentence in [*life.statement(), *words.distrust(life)]:
        console.print(f"[dim]{escape(sentence)}[/]")


def _table(columns: Sequence[str], summaries: Sequence[MethodSummary], console: Console) -> Table:
    """Integrators, cheapest first; a narrow terminal gets one column for the worst of all channels."""
    from rich import box
    from rich.table import Table

    fatigue = fatigue_columns([dict.fromkeys(columns)])
    channels = list(dict.fromkeys(channel for channel, _, _ in fatigue))
    labels = {channel: BY_NAME[channel].label.removesuffix(" moment") for channel in channels}
    groups = {label.replace("blade ", "blade\u00a0"): [channel] for channel, label in labels.items()}
    longest = max((len(summary.label) for summary in summaries), default=0)
    if 46 + max(20, longest) + 12 * len(groups) > console.width:
        groups = {"DEL error": channels}
    table = Table(
        box=box.SIMPLE_HEAD, title="Integrators, cheapest first; DEL errors in %", title_justify="left"
    )
    # a long name may wrap, a figure must not
    table.add_column("integrator", vertical="bottom", min_width=min(longest, 24))
    for heading in ("evals per s", "wall ms per s", "NRMSE median", "NRMSE worst"):
        table.add_column(heading.replace(" ", "\n"), justify="right", no_wrap=True)
    for heading in groups:
        table.add_column(heading.replace(" ", "\n"), justify="right", no_wrap=True)
    table.add_column("DEL\nerror", no_wrap=True)
    for summary in summaries:
        wall_time = summary.wall_time_per_second
        table.add_row(
            summary.label,
            _figure(summary.evaluations_per_second, "{:.0f}"),
            _figure(None if wall_time is None else wall_time * 1e3, "{:.3g}"),
            _figure(summary.nrmse_median, "{:.1e}"),
            _figure(summary.nrmse_worst, "{:.1e}"),
            *(_worst_error(summary, group) for group in groups.values()),
            _verdict(summary),
        )
    table.caption = (
        "evaluations and wall time per simulated second; DEL errors: worst over winds and exponents"
    )
    table.caption_justify = "left"
    return table


def _worst_error(summary: MethodSummary, channels: Sequence[str]) -> str:
    errors = [100 * error.size for error in summary.channel_errors if error.channel in channels]
    if not errors:
        return ""
    return f"{max(errors):.2g}" if max(errors) >= 1e-3 else "< 0.001"


def _figure(value: float | None, form: str) -> str:
    return "" if value is None else form.format(value)


def _verdict(summary: MethodSummary) -> str:
    if not summary.complete:
        return f"[red]{summary.cases - summary.done} of {summary.cases} lost[/]"
    if summary.is_reference:
        return "reference"
    if summary.worst_del_error is None:
        return "not compared"
    met = [level for level in LEVELS if summary.worst_del_error.size <= level]
    return f"[green]≤ {format_percent(min(met))}[/]" if met else f"> {format_percent(max(LEVELS))}"
