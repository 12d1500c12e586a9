"""The command line: parses and prints, decides nothing.

Exit codes: 0 all done; 1 some cases failed or diverged; 2 the input was wrong; 130 interrupted, resumable (143 by SIGTERM, 129 by
SIGHUP).
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from contextlib import ExitStack
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from fatigue_runner import on_demand
from fatigue_runner.errors import FatigueRunnerError, FatigueRunnerWarning
from fatigue_runner.interruption import Interrupted, exit_code_of
from fatigue_runner.terminal import console, write_plainly

if TYPE_CHECKING:
    from rich.console import Console

    from fatigue_runner.results import Results

# The rooms' commands, loaded when they are called: modules with a Typer app named `app`.
MOUNTED = {
    "report": "fatigue_runner.report.commands",
    "compare": "fatigue_runner.report.compare_command",
    "view": "fatigue_runner.viewer.commands",
    "logs": "fatigue_runner.logs_command",
    "turbine": "fatigue_runner.integrators.commands",
    "train": "fatigue_runner.corrector.train_command",
    "correctors": "fatigue_runner.corrector.commands",
    "calibrate": "fatigue_runner.calibration.commands",
    "benchmark": "fatigue_runner.benchmark.commands",
    "version": "fatigue_runner.version_command",
}


class _LazyGroup(TyperGroup):
    """A group that imports `MOUNTED` commands only when they are asked for, so that `run` starts at once."""

    def list_commands(self, ctx: Any) -> list[str]:
        return [*super().list_commands(ctx), *MOUNTED]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in MOUNTED:
            return super().get_command(ctx, cmd_name)
        command = typer.main.get_command(import_module(MOUNTED[cmd_name]).app)
        command.name = cmd_name
        return command

    def invoke(self, ctx: Any) -> Any:
        """Run the command; ended from outside, whatever it is, it says so in one sentence."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as interrupt:
            if "joblib" in sys.modules:
                from fatigue_runner.campaign.pool import dismiss_workers

                dismiss_workers()
            raise Interrupted(
                "interrupted; the same command does the rest", exit_code_of(interrupt)
            ) from None


app = typer.Typer(
    cls=_LazyGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="Fatigue campaigns for wind turbines with Runge-Kutta methods that learn their own error.\n\n"
    "Start with: `fatigue-runner run campaigns/quickstart.yaml`",
    epilog="Every command takes --debug, which shows the traceback of an error.",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from fatigue_runner._version import __version__

        typer.echo(f"fatigue-runner {__version__}")
        raise typer.Exit


def _make_log(path: Path) -> bool:
    """A log of a run that keeps few of them, for whoever opens it."""
    from fatigue_runner.campaign import log_on_demand

    return log_on_demand(path, lambda what: typer.echo(f"{what} ...", err=True))


on_demand.maker = _make_log


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version and end.", is_eager=True, callback=_print_version),
    ] = False,
) -> None:
    pass


@app.command()
def run(
    campaign: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN", help="The campaign's YAML file.", show_default=False)
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Run folder; default `runs/NAME` with the campaign's name."),
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
    live: Annotated[
        bool, typer.Option("--live", help="Watch in the viewer while it runs (docs/viewer.md).")
    ] = False,
    pace: Annotated[
        float | None,
        typer.Option("--pace", min=0.0, help="Play one case at this multiple of real time; implies --live."),
    ] = None,
    live_case: Annotated[
        str | None,
        typer.Option(
            "--live-case",
            help="The case to show, default the first that is done; implies --live.",
            show_default=False,
        ),
    ] = None,
    viewer_port: Annotated[
        int | None,
        typer.Option(
            "--viewer-port",
            min=1,
            max=65535,
            help="Port of a viewer that is already open here; implies --live.",
            show_default=False,
        ),
    ] = None,
    live_share: Annotated[
        float,
        typer.Option(
            "--live-share",
            help="Part of a core that watching may take where the workers leave none idle (docs/viewer.md).",
        ),
    ] = 0.2,
) -> None:
    """Run a campaign, or the rest of one, and say which integrator is good enough.

    Finished cases are kept: the same command after Ctrl-C goes on where it was. The run folder holds
    `results.csv`, `report.html` and one log per case in `logs/`.

    Examples:

        fatigue-runner run campaigns/quickstart.yaml

        fatigue-runner run my.yaml --out runs/try --workers 8

        fatigue-runner run my.yaml --live --pace 1
    """
    from fatigue_runner.campaign import run_campaign

    to = console()
    with ExitStack() as until_the_end:
        watch = None
        if live or any(asked is not None for asked in (pace, live_case, viewer_port)):
            from fatigue_runner.viewer.live import watcher

            watch = until_the_end.enter_context(
                watcher(pace=pace, case=live_case, port=viewer_port, share=live_share, say=_plainly(to))
            )
        results = run_campaign(
            campaign, out, workers=workers, fresh=fresh, dask=dask, console=to, watch=watch
        )
    _print_outcome(results, to)
    raise typer.Exit(results.exit_code)


def _plainly(console: Console) -> Callable[[str], None]:
    """Prints a sentence as it is."""
    return lambda text: console.print(text, markup=False, highlight=False)


def _print_outcome(results: Results, console: Console) -> None:
    """Which integrator is good enough and what it costs, what was lost, and where the files are."""
    from rich.markup import escape

    from fatigue_runner.report.terminal import print_life, print_ranking

    console.print()
    print_ranking(results, console)
    if results.life is not None:
        print_life(results.life, results.summaries, console)
    for sentence in results.notes:
        console.print(escape(sentence), style="yellow")
    for row in results.lost[:10]:
        when = (
            f"at {row['diverged_at']:.4g} s" if row["status"] == "diverged" else f": {row['error_message']}"
        )
        console.print(f"[red]{row['status']}[/] {escape(row['case_id'])} {escape(when)}", soft_wrap=True)
    if len(results.lost) > 10:
        console.print(f"... and {len(results.lost) - 10} more; see the column `status` of results.csv")
    console.print(
        f"{len(results)} cases, {results.simulated} of them simulated now, in {results.wall_time:.1f} s; "
        f"table: {escape(str(results.out / 'results.csv'))}",
        soft_wrap=True,
    )
    if results.report_error:
        console.print(f"[red]no report:[/] {escape(results.report_error)}", soft_wrap=True)
        console.print(
            f"`fatigue-runner report {escape(str(results.out))} --debug` tries again", soft_wrap=True
        )
    else:
        console.print(f"report: {escape(str(results.out / 'report.html'))}", soft_wrap=True)


def _say_warnings_plainly() -> None:
    """A warning of this program is a sentence for its user, without the line of code that gave it."""
    usual = warnings.formatwarning

    def plain(message: Any, category: type[Warning], *place: Any) -> str:
        own = issubclass(category, FatigueRunnerWarning)
        return f"warning: {message}\n" if own else usual(message, category, *place)

    warnings.formatwarning = plain  # type: ignore[assignment]


def main() -> None:
    """Entry point: runs the command and turns errors into one sentence and an exit code."""
    arguments = [argument for argument in sys.argv[1:] if argument != "--debug"]
    debug = len(arguments) != len(sys.argv) - 1
    _say_warnings_plainly()
    write_plainly()
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
