"""The command line: parses and prints, decides nothing.

Exit codes: 0 all done; 1 some cases failed or diverged; 2 the input was wrong; 130 interrupted, resumable.
"""

from __future__ import annotations

import sys
from contextlib import ExitStack
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from fatigue_runner.errors import FatigueRunnerError

if TYPE_CHECKING:
    from rich.console import Console

# Command groups of other rooms, loaded when they are called: (module, its Typer app).
MOUNTED = {
    "benchmark": ("fatigue_runner.benchmark.commands", "app"),
    "correctors": ("fatigue_runner.corrector.commands", "app"),
    "logs": ("fatigue_runner.logbook.commands", "app"),
    "view": ("fatigue_runner.viewer.commands", "app"),
}


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


def _print_version(wanted: bool) -> None:
    if wanted:
        from fatigue_runner._version import __version__

        typer.echo(f"fatigue-runner {__version__}")
        raise typer.Exit


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
        str | None, typer.Option("--live-case", help="The case to show; default: the first.")
    ] = None,
    viewer_port: Annotated[
        int | None, typer.Option("--viewer-port", help="Port of a viewer that is already open here.")
    ] = None,
) -> None:
    """Run a campaign, or the rest of one, and say which integrator is good enough.

    Finished cases are kept: the same command after Ctrl-C goes on where it was. The run folder holds
    `results.csv`, `report.html` and one log per case in `logs/`.

    Examples:

        fatigue-runner run campaigns/quickstart.yaml

        fatigue-runner run my.yaml --out runs/try --workers 8

        fatigue-runner run my.yaml --live --pace 1
    """
    from fatigue_runner.campaign import CampaignInterrupted, run_campaign
    from fatigue_runner.cli_tables import print_results

    console = _console()
    with ExitStack() as until_the_end:
        watch = None
        if live or pace is not None:
            from fatigue_runner.viewer.live import watcher

            watch = until_the_end.enter_context(
                watcher(pace=pace, case=live_case, port=viewer_port, say=console.print)
            )
        try:
            results = run_campaign(
                campaign, out, workers=workers, fresh=fresh, dask=dask, console=console, watch=watch
            )
        except KeyboardInterrupt:
            raise CampaignInterrupted("interrupted; the same command goes on") from None
    print_results(results, console)
    raise typer.Exit(results.exit_code)


@app.command()
def report(
    run_folder: Annotated[
        Path, typer.Argument(metavar="RUN_FOLDER", help="The folder that `run` wrote.", show_default=False)
    ],
) -> None:
    """Write `report.html` of a run folder again.

    Example:

        fatigue-runner report runs/quickstart
    """
    from fatigue_runner.report import write_report

    typer.echo(f"report: {write_report(run_folder)}")


@app.command()
def turbine(
    name: Annotated[
        str, typer.Argument(metavar="[NAME]", help="A shipped turbine, or the path of a turbine YAML.")
    ] = "nrel5mw",
    wind: Annotated[
        list[float] | None,
        typer.Option("--wind", "-w", help="Wind speed [m/s]; may be repeated. Default 6, 8, 10."),
    ] = None,
    pitch: Annotated[float, typer.Option("--pitch", help="Blade pitch [deg], positive to feather.")] = 0.0,
    write_tables: Annotated[
        bool,
        typer.Option(
            "--write-tables", help="First make the aerodynamic tables that the turbine file names (8 s)."
        ),
    ] = False,
) -> None:
    """Show a turbine: masses, power coefficient, operating points, natural frequencies, stability limits.

    Examples:

        fatigue-runner turbine

        fatigue-runner turbine t2b1i1cg --wind 8 --wind 11

        fatigue-runner turbine my-turbine.yaml --write-tables
    """
    if write_tables:
        from fatigue_runner.turbine.table_builder import make_tables

        _console().print(f"wrote {make_tables(name)}")
    from fatigue_runner.cli_tables import print_turbine

    print_turbine(name, wind or [6.0, 8.0, 10.0], pitch, _console())


@app.command()
def train(
    recipe: Annotated[
        Path, typer.Argument(metavar="RECIPE", help="The recipe's YAML file.", show_default=False)
    ],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder of the result; default: the recipe's.")
    ] = None,
    step: Annotated[float | None, typer.Option("--step", help="Another step [s] than the recipe's.")] = None,
    seed: Annotated[int | None, typer.Option("--seed", help="Another seed than the recipe's.")] = None,
    name: Annotated[str | None, typer.Option("--name", help="Another name than the recipe's.")] = None,
    tune: Annotated[
        int, typer.Option("--tune", min=0, help="Networks: first search with this many Optuna trials.")
    ] = 0,
    tune_epochs: Annotated[int, typer.Option("--tune-epochs", min=1, help="Epochs of a trial.")] = 100,
) -> None:
    """Train a corrector: NAME.safetensors and its card NAME.md beside the recipe.

    Affine ones take seconds. A network's training can be stopped with Ctrl-C: the same command goes on.

    Examples:

        fatigue-runner train correctors/rk4-100ms.yaml

        fatigue-runner train correctors/rk4-100ms.yaml --step 0.08 --name rk4-80ms --out runs
    """
    from fatigue_runner.cli_tables import train_with_progress, tune_with_progress
    from fatigue_runner.integrators.initial import initial_state

    overrides: dict[str, Any] = {"step": step, "seed": seed, "name": name}
    if tune:
        settings = tune_with_progress(recipe, out, initial_state, overrides, tune, tune_epochs, _console())
        if settings is None:
            raise typer.Exit(130)
        overrides |= {"training": settings, "seed": None}
    train_with_progress(recipe, out, initial_state, overrides, _console())


def _console() -> Console:
    from rich.console import Console

    console = Console(highlight=False)
    # A file or a pipe has no width; the default of 80 would fold the tables.
    return console if console.is_terminal else Console(highlight=False, width=120)


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
