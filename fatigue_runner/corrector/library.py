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


class Correctors(list[Corrector]):
    """A list that reads as a table: what each is for, and its median error under winds that it was not trained on."""

    COLUMNS = ("name", "family", "turbine", "operation", "method", "step [ms]", "plain", "enhanced", "hybrid")
    FIGURES = COLUMNS[5:]
    NOTE = "plain, enhanced, hybrid: median NRMSE over winds that were not trained on; - : diverged or not measured"

    def rows(self) -> list[tuple[str, ...]]:
        """Texts of `COLUMNS`, one row per corrector."""
        return [
            (
                c.name, c.family, c.turbine, c.binding.operation, c.method, f"{c.step * 1e3:g}",
                *(_error(c, mode) for mode in self.FIGURES[1:]),
            )
            for c in self
        ]  # fmt: skip

    def __repr__(self) -> str:
        rows = [self.COLUMNS, *self.rows()]
        widths = [max(len(row[i]) for row in rows) for i in range(len(self.COLUMNS))]

        def cell(column: str, text: str, width: int) -> str:
            return text.rjust(width) if column in self.FIGURES else text.ljust(width)

        lines = ("  ".join(map(cell, self.COLUMNS, row, widths)).rstrip() for row in rows)
        return "\n".join((*lines, self.NOTE))


def _error(corrector: Corrector, mode: str) -> str:
    value = corrector.validation.get(f"nrmse_{mode}")
    return "-" if value is None else f"{value:.1e}"


def correctors(more: Sequence[Path] = ()) -> Correctors:
    """All correctors that can be read, by name; a damaged file is left out (`find` says what is wrong with it)."""
    out = Correctors()
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
