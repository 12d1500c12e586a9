"""run.json: what a run folder says of its run, and the checksums by which its other files are known to be what the run left."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fatigue_runner.encoded import checksum
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.checked_json import from_checked, to_checked
from fatigue_runner.inputs.files import write_atomically

NAME = "run.json"
MADE = "results"  # entry: what the results were made of, and the checksums of the files that they are in


def write_run_file(folder: Path, data: Mapping[str, Any]) -> None:
    """Write run.json, whole."""
    write_atomically(folder / NAME, to_checked(data))


def read_run_file(folder: Path) -> dict[str, Any]:
    """What run.json says. Raises FileNotFoundError where there is none, InputError for one that is not as it was written."""
    path = folder / NAME
    try:
        return from_checked(path.read_bytes())
    except FileNotFoundError:
        raise
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({error.strerror}); make it readable, or choose another folder"
        ) from None
    except ValueError:
        raise InputError(
            f"{path} is damaged; delete it, and `fatigue-runner run` of the same campaign goes on with the finished cases of the folder"
        ) from None


def as_left(path: Path) -> bool:
    """Whether a file of a run folder is what the run left there; True where the folder does not say."""
    try:
        made = read_run_file(path.parent).get(MADE)
        known = made.get(path.name) if isinstance(made, dict) else None
        return known is None or known == checksum(path)
    except (OSError, InputError):
        return True
