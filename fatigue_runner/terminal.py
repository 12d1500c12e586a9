"""What the commands of all rooms share: how a group of them is made, and the console that they print to.

A room's commands stand in its `commands.py` as a Typer app named `app`; cli.py mounts it under its name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from rich.console import Console


def command_group(help: str | None = None) -> typer.Typer:
    """An app for several commands with a help text, or for one command, which is then mounted itself."""
    return typer.Typer(
        no_args_is_help=help is not None,
        rich_markup_mode="markdown",
        pretty_exceptions_enable=False,
        add_completion=False,  # the whole program has it
        help=help,
    )


def console(least: int = 0) -> Console:
    """Where tables are printed; `least`: columns below which they rather wrap than lose figures."""
    from rich.console import Console

    made = Console(highlight=False)
    # A file or a pipe has no width; the default of 80 would fold the tables.
    width = made.width if made.is_terminal else 120
    return made if made.is_terminal and width >= least else Console(highlight=False, width=max(width, least))
