"""The command line: parses and prints, decides nothing.

Exit codes: 0 all done; 1 some cases failed or diverged; 2 the input was wrong; 130 interrupted, resumable.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from fatigue_runner.errors import FatigueRunnerError

if TYPE_CHECKING:
    from rich.console import Console

    from fatigue_runner.campaign import Results

# Command groups of other rooms, loaded when they are called: (module, its Typer app).
MOUNTED = {"logs": ("fatigue_runner.logbook.commands", "app")}


class _LazyGroup(TyperGroup):
    """A group that imports `MOUNTED` commands only when they are asked for, so that `run` starts at once."""

    def list_commands(self, ctx: Any) -> list[str]:
        return [*super().list_commands(ctx), *MOUNTED]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in MOUNTED:
            return super().get_command(ctx, cmd_name)
        module, attribute = MOUNTED[cmd_name]
        command = typer.main.get_command(getattr(import_module(module), attribute))
        command.name = cmd_name
        return command


app = typer.Typer(
    cls=_LazyGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="Fatigue campaigns for wind turbines with Runge-Kutta methods that learn their own error.\n\n"
    "Start with: `fatigue-runner run campaigns/quickstart.yaml`",
    epilog="Every command takes --debug, which shows the traceback of an error.",
)


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and end.", is_eager=True)
    ] = False,
) -> None:
    if version:
        from fatigue_runner import __version__

        typer.echo(f"fatigue-runner {__version__}")
        raise typer.Exit


@app.command()
def run(
    campaign: Annotated[Path, typer.Argument(help="The campaign's YAML file.", show_default=False)],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Run folder; default runs/<name of the campaign>.")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", "-w", min=1, help="Parallel processes; default as the campaign says."),
    ] = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Run every case again, also the finished ones.")
    ] = False,
    dask: Annotated[
        str | None,
        typer.Option("--dask", help="Address of a dask scheduler (tcp://host:8786) to run on instead."),
    ] = None,
) -> None:
    """Run a campaign, or the rest of one, and say which integrator is good enough.

    Finished cases are kept: the same command after Ctrl-C goes on where it was. The run folder holds
    `results.csv`, `report.html` and one log per case in `logs/`.

    Examples:

        fatigue-runner run campaigns/quickstart.yaml

        fatigue-runner run campaigns/paper_in_range.yaml --out runs/paper --workers 8
    """
    from rich.console import Console

    from fatigue_runner.campaign import CampaignInterrupted, run_campaign

    console = Console()
    try:
        results = run_campaign(campaign, out, workers=workers, fresh=fresh, dask=dask, console=console)
    except KeyboardInterrupt:
        raise CampaignInterrupted("interrupted; the same command goes on") from None
    print_results(results, console)
    raise typer.Exit(results.exit_code)


@app.command()
def report(
    run_folder: Annotated[Path, typer.Argument(help="The folder that `run` wrote.", show_default=False)],
) -> None:
    """Write `report.html` of a run folder again.

    Example:

        fatigue-runner report runs/quickstart
    """
    from fatigue_runner.report import write_report

    typer.echo(f"report: {write_report(run_folder)}")


def print_results(results: Results, console: Console) -> None:
    """Which integrator is good enough and what it costs, the answer in words, and where everything lies."""
    from rich.markup import escape

    from fatigue_runner.report.ranking import answer, rank

    summaries = rank(results.rows)
    console.print()
    console.print(_table(results, summaries))
    for sentence in answer(summaries):
        console.print(escape(sentence))
    for row in results.lost[:10]:
        when = (
            f"at {row['diverged_at']:.4g} s" if row["status"] == "diverged" else f": {row['error_message']}"
        )
        console.print(f"[red]{row['status']}[/] {escape(row['case_id'])} {escape(when)}", soft_wrap=True)
    if len(results.lost) > 10:
        console.print(f"... and {len(results.lost) - 10} more; see the column `status` of results.csv")
    console.print(
        f"{len(results)} cases, {results.simulated} of them simulated now, in {results.wall_time:.1f} s; "
        f"report: {escape(str(results.out / 'report.html'))}",
        soft_wrap=True,
    )


def _table(results: Results, summaries: Any) -> Any:
    from rich.table import Table

    from fatigue_runner.channels import BY_NAME
    from fatigue_runner.report.cells import format_percent, numbers
    from fatigue_runner.report.ranking import fatigue_columns, integrator_key

    fatigue = fatigue_columns(results.rows)
    channels = list(dict.fromkeys(channel for channel, _, _ in fatigue))
    table = Table(
        title="Integrators, cheapest first; DEL errors are the worst over winds and Wöhler exponents"
    )
    table.add_column("integrator", no_wrap=True)
    for heading in ("f per s", "ms per s", "NRMSE median", "NRMSE worst"):
        table.add_column(heading, justify="right")
    for channel in channels:
        table.add_column(f"DEL error {BY_NAME[channel].label.replace(' moment', '')}", justify="right")
    table.add_column("verdict")
    for summary in summaries:
        rows = [row for row in results.rows if integrator_key(row) == summary.key and row["status"] == "done"]
        errors = []
        for wanted in channels:
            found = [
                abs(e)
                for channel, _, suffix in fatigue
                if channel == wanted
                for e in numbers(rows, f"del_error_{suffix}")
            ]
            errors.append(format_percent(max(found)) if found else "")
        wall_time = summary.wall_time_per_second
        table.add_row(
            summary.label,
            _figure(summary.evaluations_per_second, "{:.0f}"),
            _figure(None if wall_time is None else wall_time * 1e3, "{:.3g}"),
            _figure(summary.nrmse_median, "{:.1e}"),
            _figure(summary.nrmse_worst, "{:.1e}"),
            *errors,
            _verdict(summary),
        )
    table.caption = "f per s, ms per s: evaluations and wall time of the integration per simulated second"
    return table


def _figure(value: float | None, form: str) -> str:
    return "" if value is None else form.format(value)


def _verdict(summary: Any) -> str:
    from fatigue_runner.report.cells import format_percent
    from fatigue_runner.report.ranking import LEVELS

    if not summary.complete:
        return f"[red]{summary.cases - summary.done} of {summary.cases} lost[/]"
    if summary.is_reference:
        return "reference"
    if summary.worst_del_error is None:
        return "not compared"
    met = [level for level in LEVELS if summary.worst_del_error.size <= level]
    return (
        f"[green]DEL error ≤ {format_percent(min(met))}[/]"
        if met
        else f"DEL error > {format_percent(max(LEVELS))}"
    )


def main() -> None:
    """Entry point: runs the command and turns errors into one sentence and an exit code."""
    arguments = [argument for argument in sys.argv[1:] if argument != "--debug"]
    debug = len(arguments) != len(sys.argv) - 1
    try:
        app(args=arguments, prog_name="fatigue-runner")
    except BrokenPipeError:  # `| head` closed the pipe
        sys.stderr.close()
        sys.exit(1)
    except FatigueRunnerError as error:
        if debug:
            raise
        typer.secho(f"error: {error}", fg="red", err=True)
        sys.exit(error.exit_code)
    except Exception as error:
        if debug:
            raise
        typer.secho(
            f"internal error: {type(error).__name__}: {error}; please report it with what --debug shows",
            fg="red",
            err=True,
        )
        sys.exit(1)
