"""`fatigue-runner correctors list | show`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fatigue_runner.terminal import command_group, console

app = command_group("Trained correctors: what is there, and how good it is.")

Folder = Annotated[
    Path | None, typer.Option("--folder", "-f", help="Also look in this folder, before the shipped ones.")
]


@app.command("list")
def list_correctors(folder: Folder = None) -> None:
    """One line per corrector: name, turbine, method and step, error on unseen winds.

    Example:

        fatigue-runner correctors list
    """
    from rich.markup import escape
    from rich.table import Table

    from fatigue_runner.corrector import library

    found = library.correctors([folder] if folder else [])
    if not found:
        typer.echo("no correctors found; train one with `fatigue-runner train RECIPE`")
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    for column in found.COLUMNS:
        table.add_column(escape(column), justify="right" if column in found.FIGURES else "left")
    for row in found.rows():
        table.add_row(*row)
    to = console()
    to.print(table)
    to.print(found.NOTE)


@app.command()
def show(
    name: Annotated[str, typer.Argument(help="A corrector's name, or the path of its file.")],
    folder: Folder = None,
) -> None:
    """A corrector's card: what it fits, how it was made, its figures, and the recipe.

    Example:

        fatigue-runner correctors show rk4-100ms
    """
    from fatigue_runner.corrector import library
    from fatigue_runner.corrector.card import card

    corrector = library.find(name, [folder] if folder else [])
    typer.echo(card(corrector))
    if corrector.recipe:
        typer.echo("Recipe:\n\n" + corrector.recipe)
