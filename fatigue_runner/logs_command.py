"""`fatigue-runner logs`: the logbook's commands, and `make`, which runs cases again for their logs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fatigue_runner.logbook.commands import app

__all__ = ["app"]


@app.command()
def make(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.", show_default=False)],
    cases: Annotated[
        list[str] | None, typer.Argument(metavar="CASE...", help="Cases, by their ids.", show_default=False)
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="Of every case of the run.")] = False,
    workers: Annotated[
        int | None,
        typer.Option("--workers", "-w", min=1, help="Parallel processes; default as the campaign says."),
    ] = None,
) -> None:
    """Write logs of cases that have none: each case is run again, to the bit, and checked against what is recorded of it.

    Refused where code, turbine, corrector or campaign have changed since. `view`, `logs info` and `logs export` make the log that they
    are asked for by themselves.

    Examples:

        fatigue-runner logs make runs/dlc12 v12.00_ntmB_s1200003_rk4_100ms

        fatigue-runner logs make runs/dlc12 --all
    """
    from fatigue_runner.campaign import make_logs
    from fatigue_runner.errors import InputError

    if bool(cases) == everything:
        raise InputError("give cases by their ids, the first column of results.csv, or --all")
    made = make_logs(run, cases or None, workers, lambda what: typer.echo(f"{what} ...", err=True))
    for path in made[:10]:
        typer.echo(str(path))
    if len(made) > 10:
        typer.echo(f"... and {len(made) - 10} more in {made[0].parent}")
