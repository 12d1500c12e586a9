"""`fatigue-runner compare`: one page of two run folders."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fatigue_runner.terminal import command_group

app = command_group()


@app.command()
def compare(
    first: Annotated[
        Path, typer.Argument(metavar="RUN_FOLDER", help="A folder that `run` wrote.", show_default=False)
    ],
    second: Annotated[Path, typer.Argument(metavar="RUN_FOLDER", help="Another one.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="The page; an older one is replaced.")] = Path(
        "comparison.html"
    ),
) -> None:
    """Compare two campaigns: another turbine, integrator, corrector or wind, life beside life.

    Example:

        fatigue-runner compare runs/dlc12 runs/dlc12-stiff --out stiff.html
    """
    from fatigue_runner.report.comparison import write_comparison

    typer.echo(f"comparison: {write_comparison(first, second, out)}")
