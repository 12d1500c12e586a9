"""What the commands of all rooms share: how a group of them is made, the console that they print to, and where they may write.

A room's commands stand in its `commands.py` as a Typer app named `app`; cli.py mounts it under its name.
"""

from __future__ import annotations

import codecs
import io
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer
from typer.core import TyperGroup

from fatigue_runner.errors import InputError

if TYPE_CHECKING:
    from rich.console import Console


def command_group(help: str | None = None, cls: type[TyperGroup] = TyperGroup) -> typer.Typer:
    """An app for several commands with a help text, or for one command, which is then mounted itself; cls: of the group."""
    return typer.Typer(
        cls=cls,
        no_args_is_help=help is not None,
        rich_markup_mode="markdown",
        pretty_exceptions_enable=False,
        add_completion=False,  # the whole program has it
        help=help,
    )


# What a terminal or a pipe without these signs gets instead; for the rest a question mark.
_PLAIN = {"≤": "<=", "≥": ">=", "−": "-", "–": "-", "—": "-", "…": "...", "×": "x", "·": ".", "●": "*", "°": "deg", "µ": "u", "σ": "sigma",
          "α": "alpha", "κ": "kappa", "²": "2", "³": "3", "ö": "oe", "ü": "ue", "ä": "ae", "\u00a0": " "}  # fmt: skip


def _plainly(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(_PLAIN.get(sign, "?") for sign in error.object[error.start : error.end]), error.end


def write_plainly() -> None:
    """Let output and errors of this process be written in whatever encoding their pipe has, so that none ends a finished campaign."""
    codecs.register_error("plainly", _plainly)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="plainly")


def console(least: int = 0) -> Console:
    """Where tables are printed; `least`: columns below which they rather wrap than lose figures."""
    from rich.console import Console

    made = Console(highlight=False)
    # A file or a pipe has no width; the default of 80 would fold the tables.
    width = made.width if made.is_terminal else 120
    return made if made.is_terminal and width >= least else Console(highlight=False, width=max(width, least))


def writable_file(path: Path | None, option: str, endings: Sequence[str] = ()) -> Path | None:
    """The path of a file that a command will write after long work. Raises InputError before that where it cannot be written.

    option: that names it; endings: of which the name must have one, lower case with the dot; empty: any.
    """
    if path is None:
        return None
    if path.is_dir():
        raise InputError(f"{path} is a folder; give {option} the name of a file")
    if endings and path.suffix.lower() not in endings:
        raise InputError(f"{option} {path} must end in {' or '.join(endings)}")
    if not path.parent.is_dir():
        raise InputError(
            f"{path} cannot be written: {path.parent} is not a folder; make it first, or give {option} another path"
        )
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise InputError(f"{path} cannot be written: you have no right to; give {option} another path")
    return path


def writable_folder(path: Path | None, option: str) -> Path | None:
    """The same of a folder that is there or will be made."""
    if path is None:
        return None
    there = next((folder for folder in (path, *path.parents) if folder.exists()), Path())
    if not there.is_dir():
        raise InputError(f"{there} is a file; give {option} a folder")
    try:
        # some file systems (/proc) say that one may write, and do not let anybody
        probe = there / f".fatigue-runner-{os.getpid()}"
        probe.mkdir()
        probe.rmdir()
    except OSError as error:
        raise InputError(
            f"{path} cannot be written ({error.strerror}); give {option} another folder"
        ) from None
    return path
