"""`fatigue-runner report`: the page of a run folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fatigue_runner.terminal import command_group

app = command_group()


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
