"""Where correctors are found: the shipped ones and those of a folder, by name; and a file of either by its path."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fatigue_runner.corrector.artefact import Corrector, CorrectorError, load
from fatigue_runner.errors import did_you_mean

SUFFIX = ".safetensors"
PACKAGE = Path(__file__).parents[1]


def shipped_folders() -> list[Path]:
    """`correctors/` beside the package in a source tree, `fatigue_runner/correctors/` in an installed one (pyproject.toml)."""
    return [folder for folder in (PACKAGE.parent / "correctors", PACKAGE / "correctors") if folder.is_dir()]


def files(more: Sequence[Path] = ()) -> dict[str, Path]:
    """{name: file} of all correctors; a file of the folders `more` goes before a shipped one of the same name."""
    found: dict[str, Path] = {}
    for folder in (*more, *shipped_folders()):
        for path in sorted(folder.glob(f"*{SUFFIX}")):
            found.setdefault(path.name.removesuffix(SUFFIX), path)
    return found


def correctors(more: Sequence[Path] = ()) -> list[Corrector]:
    """All correctors that can be read, by name; a damaged file is left out (`find` says what is wrong with it)."""
    out = []
    for path in dict(sorted(files(more).items())).values():
        try:
            out.append(load(path))
        except CorrectorError:
            continue
    return out


def find(name: str | Path | Corrector, more: Sequence[Path] = ()) -> Corrector:
    """A corrector by name, by path, or as it is. Raises CorrectorError with the nearest name for an unknown one."""
    if isinstance(name, Corrector):
        return name
    text = str(name)
    if text.endswith(SUFFIX) or "/" in text or "\\" in text:
        for folder in (Path(), *more):
            if (folder / text).is_file():
                return load(folder / text)
        return load(Path(text))
    known = files(more)
    if text not in known:
        hint = (
            did_you_mean(text, known)
            if known
            else "; there are none, train one with `fatigue-runner train RECIPE`"
        )
        raise CorrectorError(f"there is no corrector {text!r}{hint}")
    return load(known[text])
