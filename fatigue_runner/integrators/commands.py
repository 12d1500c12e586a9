"""`fatigue-runner turbine`: what a turbine is, and which steps it takes from the methods, which is why it stands here."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fatigue_runner.terminal import command_group, console

app = command_group()


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
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot", help="Draw the operating curves under the controller into this file (.png, .svg, .pdf)."
        ),
    ] = None,
    write_tables: Annotated[
        bool,
        typer.Option(
            "--write-tables", help="First make the aerodynamic tables that the turbine file names (8 s)."
        ),
    ] = False,
) -> None:
    """Show a turbine: masses, power coefficient, operating points, natural frequencies, stability limits, operation from cut-in to cut-out.

    Examples:

        fatigue-runner turbine

        fatigue-runner turbine t2b1i1cg --wind 8 --wind 11

        fatigue-runner turbine my-turbine.yaml --write-tables

        fatigue-runner turbine nrel5mw --plot operation.png
    """
    to = console()
    if write_tables:
        from fatigue_runner.turbine.table_builder import make_tables

        to.print(f"wrote {make_tables(name)}")
    from fatigue_runner.integrators.turbine_tables import print_turbine

    print_turbine(name, wind or [6.0, 8.0, 10.0], pitch, to, plot)
