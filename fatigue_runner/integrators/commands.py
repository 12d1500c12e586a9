"""`fatigue-runner turbine`: what a turbine is, and which steps it takes from the methods, which is why it stands here."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from fatigue_runner.terminal import command_group, console, writable_file


class _ShowByDefault(TyperGroup):
    """`turbine NAME` is `turbine show NAME`: what is no command is the name of a turbine."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if not args or (args[0] not in self.commands and args[0] not in ("--help", "-h")):
            args = ["show", *args]
        return super().parse_args(ctx, args)


app = command_group(
    "Show a turbine, import one from an OpenFAST deck, make its aerodynamic tables.", cls=_ShowByDefault
)


@app.command()
def show(
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
            "--plot",
            help="Draw the operating curves under the controller into this file (.png, .svg, .pdf).",
            show_default=False,
            callback=lambda path: writable_file(path, "--plot", (".png", ".svg", ".pdf")),
        ),
    ] = None,
    write_tables: Annotated[bool, typer.Option("--write-tables", hidden=True)] = False,
) -> None:
    """Show a turbine: masses, power coefficient, operating points, natural frequencies, stability limits, operation from cut-in to cut-out.

    Examples:

        fatigue-runner turbine

        fatigue-runner turbine t2b1i1cg --wind 8 --wind 11

        fatigue-runner turbine show my-turbine.yaml

        fatigue-runner turbine nrel5mw --plot operation.png
    """
    to = console()
    if write_tables:  # the name that `turbine tables` had
        tables(name)
    from fatigue_runner.integrators.turbine_tables import print_turbine

    print_turbine(name, wind or [6.0, 8.0, 10.0], pitch, to, plot)


@app.command()
def tables(
    name: Annotated[
        str, typer.Argument(metavar="FILE", help="The path of a turbine YAML.", show_default=False)
    ],
) -> None:
    """Make the aerodynamic tables that a turbine file names, from its blade and its airfoils: after a change of one of them.

    Example:

        fatigue-runner turbine tables my-turbine.yaml
    """
    from fatigue_runner.turbine.table_builder import make_tables

    to = console()
    with to.status("making the aerodynamic tables"):
        made = make_tables(name)
    to.print(f"wrote {made}", soft_wrap=True)


@app.command("import")
def import_(
    deck: Annotated[
        Path, typer.Argument(metavar="MODEL.fst", help="The deck's .fst file.", show_default=False)
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="The turbine YAML to write; default: the deck's name in this folder."
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files that are there.")] = False,
) -> None:
    """Make a turbine file from an OpenFAST deck, with airfoils and tables beside it; say what the model leaves out.

    Reads ElastoDyn, AeroDyn 15, ServoDyn and ROSCO's DISCON.IN, of OpenFAST 2 to 5, land-based or with the tower clamped where it begins.
    docs/turbines.md says what each number becomes.

    Examples:

        fatigue-runner turbine import IEA-3.4-130-RWT.fst

        fatigue-runner turbine import deck/model.fst --out turbines/mine.yaml
    """
    from fatigue_runner.integrators.turbine_tables import print_imported
    from fatigue_runner.turbine.deck.importing import import_deck

    to = console()
    with to.status("reading the deck") as status:
        made = import_deck(deck, out, overwrite, status.update)
    print_imported(made, to)
