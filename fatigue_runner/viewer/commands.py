"""`fatigue-runner view`: a log, or a run folder, as a moving turbine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fatigue_runner.terminal import command_group

app = command_group()


@app.command()
def view(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...", help="Logs (.mcap), or the folder that `run` wrote.", show_default=False
        ),
    ],
    case: Annotated[
        str | None,
        typer.Option("--case", "-c", help="Case of the run folder; default: the first.", show_default=False),
    ] = None,
    scale: Annotated[float, typer.Option("--scale", help="Draw deflections at this multiple.")] = 1.0,
    save: Annotated[
        Path | None,
        typer.Option("--save", "-s", help="Write a Rerun recording (.rrd) instead.", show_default=False),
    ] = None,
    web: Annotated[
        bool, typer.Option("--web", help="Serve a page for a browser on this machine instead of a window.")
    ] = False,
    port: Annotated[
        int | None,
        typer.Option("--port", min=1, max=65535, help="Port of that page; default 9090.", show_default=False),
    ] = None,
    turbine: Annotated[
        str | None,
        typer.Option(
            "--turbine",
            help="Turbine to draw, by name or file; default: as the log says.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Show logs in 3-D with their loads and the solver's decisions.

    Of a run folder, one wind with every integrator is shown side by side, the reference first.

    Examples:

        fatigue-runner view runs/quickstart

        fatigue-runner view runs/quickstart/logs/v08.00_ntmB_s800001_rk4_50ms.mcap --scale 3

        fatigue-runner view runs/quickstart --save turbine.rrd
    """
    from fatigue_runner.viewer.window import view as show

    show(logs, save, web, case=case, scale=scale, turbine=turbine, port=port, say=typer.echo)
