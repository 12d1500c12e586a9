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
    pdf: Annotated[
        bool,
        typer.Option("--pdf", help="Print it as report.pdf, too; needs an installed Chromium or Chrome."),
    ] = False,
) -> None:
    """Write `report.html` of a run folder again.

    Examples:

        fatigue-runner report runs/quickstart

        fatigue-runner report runs/quickstart --pdf
    """
    from fatigue_runner.report import write_report
    from fatigue_runner.report.pdf import find_chromium, write_pdf

    if pdf:
        find_chromium()
    page = write_report(run_folder)
    typer.echo(f"report: {page}")
    if pdf:
        typer.echo(f"PDF: {write_pdf(page)}")
