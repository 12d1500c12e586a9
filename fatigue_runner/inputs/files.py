"""What is written: files that are whole or absent, and YAML that `source` reads again."""

from __future__ import annotations

import io
import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from fatigue_runner.errors import InputError


def write_atomically(path: Path, content: bytes | Iterable[bytes]) -> None:
    """Write `content`, whole or in parts, under a temporary name, flush it to the disk, rename: nobody ever sees half a file."""
    part = path.with_name(f"{path.name}.part")
    try:
        with part.open("wb") as file:
            file.writelines([content] if isinstance(content, bytes) else content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except BaseException:
        with suppress(OSError):
            part.unlink()
        raise


def write_new(path: Path, content: bytes, overwrite: bool) -> None:
    """The same for what somebody may want to keep. Raises InputError where something else is there already, unless `overwrite`, and where
    it cannot be written."""
    try:
        if not overwrite and path.exists() and path.read_bytes() != content:
            raise InputError(
                f"{path} is there already and holds something else; move it, or give --overwrite to replace it"
            )
        write_atomically(path, content)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}); choose another place") from None


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
