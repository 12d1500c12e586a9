"""`fatigue-runner logs`: info, check, recover, export."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from fatigue_runner import channels
from fatigue_runner.logbook.check import check as check_log
from fatigue_runner.logbook.errors import LogError
from fatigue_runner.logbook.export import export as export_log
from fatigue_runner.logbook.recovery import recover as recover_log
from fatigue_runner.logbook.summary import TOLD, Extreme, LogSummary, summarise, what_ran
from fatigue_runner.on_demand import present
from fatigue_runner.terminal import command_group

app = command_group("Look into the logs of a run: what ran, whether the file is whole, repair it, export it.")

LogPath = Annotated[Path, typer.Argument(help="A log (.mcap).", show_default=False)]
# Stretches of rejected steps that `info` lists; the longest tell most.
_SHOWN_STRETCHES = 8
_SHOWN_PROBLEMS = 4  # of a file, by `check`
_WIDTH = 130
_HARMONICS = frozenset(channel.name for channel in channels.WIND_HARMONICS)


@app.command()
def info(
    log: LogPath,
    everything: Annotated[
        bool, typer.Option("--all", help="Print every entry of the result as it is, and every extreme.")
    ] = False,
) -> None:
    """Print what ran, with what, how often the corrector was accepted, where not, and the extremes.

    Examples:

        fatigue-runner logs info runs/quickstart/logs/v08.00_ntmB_s800001_rk4_50ms.mcap
    """
    console = Console()
    # A cut number would be a wrong one: rather let a narrow terminal wrap the lines.
    console.width = max(console.width, _WIDTH)
    summary = summarise(present(log))
    _print_head(console, summary, everything)
    _print_acceptance(console, summary)
    if summary.reference_error:
        e = summary.reference_error
        console.print(
            "error against the reference, in ranges of the states: "
            f"median {e.median:.1e}, largest {e.largest:.1e} at {e.time:g} s"
        )
    if summary.equivalent_loads and not everything:
        console.print(_equivalent_loads_table(summary))
    if summary.extremes:
        _print_extremes(console, summary, everything)


def _print_head(console: Console, summary: LogSummary, everything: bool) -> None:
    rate = f", {summary.rate:g} rows per second" if summary.rate else ""
    console.print(f"[bold]{escape(str(summary.path))}[/]", soft_wrap=True)
    console.print(
        f"{summary.rows} rows, {summary.duration:g} s{rate}, {summary.size / 1e6:.2f} MB, "
        + ("complete" if summary.complete else "[red]not complete[/]")
    )
    if summary.lost:
        console.print(f"[red]damaged:[/] {escape(summary.lost)}", soft_wrap=True)
    sentence = what_ran(summary.run)
    if sentence:
        status = summary.result.get("status", "unfinished")
        shade = "green" if status == "done" else "red"
        console.print(f"{escape(sentence)}: [{shade}]{escape(status)}[/]", soft_wrap=True)
    told = () if everything or not sentence else TOLD
    _print_entries(console, "run", {k: v for k, v in summary.run.items() if k not in told})
    result = summary.result
    if not everything:
        known = {*summary.run, *(("status",) if sentence else ())}
        result = {k: v for k, v in result.items() if k not in known and not _is_told_elsewhere(k)}
    _print_entries(console, "result", result)
    if summary.attachments:
        names = ", ".join(f"{name} ({size} bytes)" for name, size in summary.attachments.items())
        console.print(f"attached: {escape(names)}", soft_wrap=True)


def _print_entries(console: Console, title: str, entries: Mapping[str, str]) -> None:
    entries = {key: value for key, value in entries.items() if value != ""}
    if entries:
        console.print(f"[italic]{title}[/]")
    width = max(map(len, entries), default=0)
    for key, value in entries.items():
        console.print(f"  {escape(key):{width}}  {escape(value)}", soft_wrap=True)


def _is_told_elsewhere(key: str) -> bool:
    """Whether `info` shows an entry of a campaign's result in a table, or a summary of it (`nrmse_max`)."""
    if key.startswith(("del_", "damage_ratio_")) or key == "rows":
        return True
    figures = ("mean_", "min_time_", "max_time_", "min_", "max_", "std_", "nrmse_")
    return any(key.startswith(f) and key.removeprefix(f) in channels.BY_NAME for f in figures)


def _equivalent_loads_table(summary: LogSummary) -> Table:
    found = {(e.channel, e.exponent): e for e in summary.equivalent_loads}
    exponents = list(dict.fromkeys(e.exponent for e in summary.equivalent_loads))
    table = _table("damage-equivalent loads, relative error against the reference", "channel", "unit")
    for exponent in exponents:
        table.add_column(f"m = {exponent}", justify="right")
        table.add_column("error", justify="right")
    for channel in dict.fromkeys(e.channel for e in summary.equivalent_loads):
        known = channels.BY_NAME[channel]
        cells = [channel, known.read_unit]
        for exponent in exponents:
            load = found.get((channel, exponent))
            cells.append(f"{load.value * known.scale:.5g}" if load else "")
            cells.append(f"{load.error:.1e}" if load and load.error is not None else "")
        table.add_row(*cells)
    return table


def _table(title: str, *left: str) -> Table:
    table = Table(title=title, title_justify="left", box=None, padding=(0, 2, 0, 0))
    for heading in left:
        table.add_column(heading, no_wrap=True)
    return table


def _print_acceptance(console: Console, summary: LogSummary) -> None:
    if summary.acceptance_rate is None:
        console.print("acceptance: nothing was tested (no hybrid integrator)")
        return
    console.print(f"acceptance: {summary.acceptance_rate:.2%} of the intervals, {summary.rejected} rejected")
    if summary.discrepancy:
        d = summary.discrepancy
        console.print(
            f"  discrepancy over threshold: median {d.median:.2g}, largest {d.largest:.3g} at {d.time:g} s"
        )
    for name, wind in (("accepted", summary.accepted_wind), ("rejected", summary.rejected_wind)):
        if wind:
            console.print(
                f"  wind where {name}: median {wind[1]:.2f} m/s, 90 % in {wind[0]:.2f} to {wind[2]:.2f}"
            )
    for s in summary.rejections[:_SHOWN_STRETCHES]:
        speed = "" if s.wind_speed is None else f" at {s.wind_speed:.2f} m/s"
        console.print(f"  rejected {s.begin:.3f} to {s.end:.3f} s ({s.intervals} intervals){speed}")
    more = len(summary.rejections) - _SHOWN_STRETCHES
    if more > 0:
        console.print(f"  and {more} shorter stretches")


def _print_extremes(console: Console, summary: LogSummary, everything: bool) -> None:
    """Of every channel; the wind's harmonics, a dozen and more that say little alone, only where all is asked for."""
    shown = [e for e in summary.extremes if everything or e.name not in _HARMONICS]
    after = f" after the first {summary.discarded:g} s, which do not count" if summary.discarded else ""
    console.print(_extremes_table(shown, f"extremes{after}"))
    left = len(summary.extremes) - len(shown)
    if left:
        console.print(f"and {left} amplitudes of the wind's azimuthal harmonics: `--all` shows them")


def _extremes_table(extremes: Sequence[Extreme], title: str) -> Table:
    table = _table(title, "channel", "unit")
    for heading in ("min", "at s", "mean", "max", "at s"):
        table.add_column(heading, justify="right")
    for e in extremes:
        known = channels.BY_NAME.get(e.name)
        unit, scale = (known.read_unit, known.scale) if known else (e.unit, 1.0)
        values = f"{e.minimum * scale:.5g}", f"{e.mean * scale:.5g}", f"{e.maximum * scale:.5g}"
        name = e.name + (f" ({e.not_finite} not finite)" if e.not_finite else "")
        table.add_row(
            name, unit, values[0], f"{e.time_of_minimum:g}", values[1], values[2], f"{e.time_of_maximum:g}"
        )
    return table


@app.command()
def check(
    logs: Annotated[list[Path], typer.Argument(help="Logs (.mcap), or folders of logs.", show_default=False)],
) -> None:
    """Check every checksum, index, count and time; exit code 1 where one is wrong.

    Examples:

        fatigue-runner logs check runs/quickstart/logs

        fatigue-runner logs check case.mcap other.mcap
    """
    console = Console()
    damaged = 0
    for path in _expand(logs):
        try:
            found = check_log(path)
        except LogError as error:
            if len(logs) == 1 and path == logs[0]:
                raise
            console.print(f"[red]wrong[/] {escape(str(error))}", soft_wrap=True)
            damaged += 1
            continue
        if found.ok:
            what = f"{found.chunks} chunks, {found.messages} messages, {found.rows} rows"
            if not found.ours:
                what = f"{found.chunks} chunks, {found.messages} messages, of another program"
            elif not found.complete:
                what += ", but without the end of its run"
            console.print(f"[green]good[/]  {escape(str(path))}: {what}", soft_wrap=True)
            continue
        damaged += 1
        told = found.problems[:_SHOWN_PROBLEMS]
        more = f"; and {len(found.problems) - len(told)} more" if len(found.problems) > len(told) else ""
        console.print(f"[red]wrong[/] {escape(str(path))}: {escape('; '.join(told))}{more}", soft_wrap=True)
    if damaged:
        console.print("`fatigue-runner logs recover FILE` keeps what is good of a damaged log")
        raise typer.Exit(1)


def _expand(paths: list[Path]) -> list[Path]:
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = sorted([*path.rglob("*.mcap"), *path.rglob("*.mcap.part")])
            if not inside:
                raise LogError(f"there is no log (.mcap) in {path}")
            found += inside
        else:
            found.append(path)
    return found


@app.command()
def recover(
    log: LogPath,
    to: Annotated[
        Path | None, typer.Option("--out", "-o", "--to", help="Write a copy there; default: repair in place.")
    ] = None,
) -> None:
    """Repair a log that was cut off or damaged and say what was lost.

    Keeps every whole row before the first damage. A `.mcap.part` file, as an interrupted run leaves it,
    gets its final name. The file is replaced only when the repaired one is whole.

    Examples:

        fatigue-runner logs recover case.mcap.part

        fatigue-runner logs recover damaged.mcap --to repaired.mcap
    """
    console = Console()
    done = recover_log(log, to)
    if not done.changed and not done.lost:
        copied = f", copied to {done.path}" if to else ""
        console.print(f"{escape(str(log))} is whole, nothing to repair{escape(copied)}", soft_wrap=True)
        return
    kept = f"{done.rows} rows up to {done.end_time:g} s"
    console.print(f"repaired: {escape(str(done.path))}, {kept}", soft_wrap=True)
    for sentence in done.lost or ["nothing"]:
        console.print(f"lost: {escape(sentence)}", soft_wrap=True)


@app.command()
def export(
    log: LogPath,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="File to write: .csv or .parquet.", show_default=False)
    ],
    channels: Annotated[
        list[str] | None,
        typer.Option(
            "--channel", "-c", help="Channel name or pattern; repeatable. Default: all.", show_default=False
        ),
    ] = None,
) -> None:
    """Write channels of a log as a table (SI units, one row per time).

    Examples:

        fatigue-runner logs export case.mcap -o case.parquet

        fatigue-runner logs export case.mcap -o flap.csv -c 'blade*_root_flapwise_moment' -c wind_speed
    """
    names = export_log(present(log), channels, out)
    typer.echo(f"{out}: {', '.join(names)}")
