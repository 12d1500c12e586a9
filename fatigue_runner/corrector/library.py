"""Where correctors are found: the shipped ones and those of a folder, by name; and a file of either by its path."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fatigue_runner import shipped
from fatigue_runner.corrector.artefact import load
from fatigue_runner.corrector.corrector import Corrector
from fatigue_runner.corrector.errors import CorrectorError
from fatigue_runner.errors import InputError, did_you_mean

SUFFIX = ".safetensors"


def files(more: Sequence[Path] = ()) -> dict[str, Path]:
    """{name: file} of all correctors; a file of the folders `more` goes before a shipped one of the same name."""
    found: dict[str, Path] = {}
    for folder in (*more, shipped.correctors()):
        for path in sorted(folder.glob(f"*{SUFFIX}")):
            found.setdefault(path.name.removesuffix(SUFFIX), path)
    return found


def correctors(more: Sequence[Path] = ()) -> list[Corrector]:
    """All correctors that can be read, by name; a damaged file is left out (`find` says what is wrong with it)."""
    out = []
    for path in dict(sorted(files(more).items())).values():
        try:
            out.append(load(path))
        except InputError:
            continue
    return out


def find(name: str | Path | Corrector, more: Sequence[Path] = ()) -> Corrector:
    """A corrector by name, by path, or as it is. Raises CorrectorError with the nearest name for an unknown one."""
    return name if isinstance(name, Corrector) else load(locate(name, more))


def locate(name: str | Path, more: Sequence[Path] = ()) -> Path:
    """The file of a corrector by name or path; relative paths start at the folders `more` too.

    Raises CorrectorError with the nearest name for an unknown one.
    """
    text = str(name)
    if text.endswith(SUFFIX) or "/" in text or "\\" in text:
        for folder in (*more, Path()):
            if (folder / text).is_file():
                return folder / text
        raise CorrectorError(f"there is no corrector file {text}")
    known = files(more)
    if text not in known:
        hint = (
            did_you_mean(text, known)
            if known
            else "; there are none, train one with `fatigue-runner train RECIPE`"
        )
        raise CorrectorError(f"there is no corrector {text!r}{hint}")
    return known[text]
