"""What is written: files that are whole or absent, and YAML that `source` reads again."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from fatigue_runner.errors import InputError


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


def write_atomically(path: Path, content: bytes) -> None:
    """Write `content` under a temporary name, flush it to the disk, rename: nobody ever sees half a file."""
    part = path.with_name(f"{path.name}.part")
    try:
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except BaseException:
        with suppress(OSError):
            part.unlink()
        raise


def to_yaml(heading: str, data: dict[str, Any]) -> str:
    """Plain data as YAML below a line of comment, in the order of the keys."""
    from ruamel.yaml import YAML

    text = io.StringIO()
    text.write(f"# {heading}\n")
    yaml: Any = YAML(typ="safe", pure=True)
    yaml.sort_base_mapping_type_on_output = False
    yaml.default_flow_style = None
    yaml.dump(data, text)
    return text.getvalue()
