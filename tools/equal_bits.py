"""Prove that the working tree gives the figures of a git revision, to the bit.

python tools/equal_bits.py              against the last tag
python tools/equal_bits.py 2ae44e5      against a revision
python tools/equal_bits.py --tree DIR   against a source tree
python tools/equal_bits.py --python .venv313/bin/python   the working tree under another Python, which has the dependencies
python tools/equal_bits.py --only 'method rk4*varying'

The same figures (tools/bit_figures.py: trajectories, loads and step figures of every method, corrector and kind of start; results and
logs of campaigns; turbines; fatigue) are made by both trees and compared by SHA-256 of their raw bytes. Exit status 1 where one
differs, fails or is missing; what only the working tree has is told and does not count.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from revisions import ROOT, add_arguments, base_tree, start

FIGURES = Path(__file__).with_name("bit_figures.py")
SHOWN = 4  # parts of a figure that are named


@dataclass(frozen=True)
class Verdict:
    """How one figure of the working tree compares: `same` is None for one that the other tree does not have."""

    name: str
    same: bool | None
    what: str = ""


def relative_difference(old: np.ndarray, new: np.ndarray) -> float | None:
    """Largest difference over the largest magnitude of the old array; infinite where only one is a number, None for texts and
    arrays of different shapes."""
    if old.shape != new.shape or old.dtype.kind not in "fiub" or old.dtype == np.uint8:
        return None
    a, b = old.astype(float), new.astype(float)
    if (np.isfinite(a) != np.isfinite(b)).any():
        return np.inf
    fine = np.isfinite(a)
    if not fine.any():
        return 0.0
    largest = np.abs(a[fine] - b[fine]).max()
    scale = np.abs(a[fine]).max()
    return float(largest / scale) if scale else float(np.inf if largest else 0.0)


def compare(old: Mapping[str, Any], new: Mapping[str, Any], arrays: Any = None) -> Verdict:
    """The verdict on one figure from what both trees told of it; arrays(side, part) gives an array of a part that differs."""
    name = new["name"]
    failed = [
        f"{side} failed: {told['error']}" for side, told in (("old", old), ("new", new)) if "error" in told
    ]
    if failed:
        return Verdict(name, False, "; ".join(failed))
    before, after = old["parts"], new["parts"]
    notes = []
    for part in before:
        if part not in after:
            notes.append(f"{part} is missing")
        elif before[part] != after[part]:
            notes.append(_difference(part, arrays))
    rest = f" and {len(notes) - SHOWN} more" if len(notes) > SHOWN else ""
    return Verdict(name, not notes, "; ".join(notes[:SHOWN]) + rest)


def _difference(part: str, arrays: Any) -> str:
    if arrays is None:
        return part
    old, new = arrays("old", part), arrays("new", part)
    if old.shape != new.shape or old.dtype != new.dtype:
        return f"{part}: {old.dtype}{list(old.shape)} became {new.dtype}{list(new.shape)}"
    size = relative_difference(old, new)
    return f"{part}: text" if size is None else f"{part}: {size:.1e}"


def verdicts(
    old: Mapping[str, Any], new: Mapping[str, Any], folders: Mapping[str, Path]
) -> Iterator[Verdict]:
    """The verdicts on all figures {name: what a tree told}, in the order of the working tree, then what it lacks."""
    for name, told in new.items():
        if name not in old:
            yield Verdict(name, None, told.get("error", "only in the working tree"))
            continue
        files = {"old": folders["old"] / old[name]["file"], "new": folders["new"] / told["file"]}

        def arrays(side: str, part: str, files: Mapping[str, Path] = files) -> np.ndarray:
            with np.load(files[side], allow_pickle=False) as stored:
                return np.asarray(stored[part])

        yield compare(old[name], told, arrays)
    for name in old:
        if name not in new:
            yield Verdict(name, False, "missing in the working tree")


def table(found: list[Verdict]) -> str:
    """One line per figure and the count."""
    mark = {True: "equal", False: "DIFFERS", None: "new"}
    width = max(len(v.name) for v in found)
    lines = [f"{v.name:<{width}}  {mark[v.same]:<7}  {v.what}".rstrip() for v in found]
    return "\n".join([*lines, f"{_count(found, True)} figures equal, {_count(found, False)} differ"])


def _count(found: list[Verdict], same: bool) -> int:
    return sum(verdict.same is same for verdict in found)


def make_figures(tree: Path, out: Path, pattern: str, python: str) -> dict[str, Any]:
    """{name: what the tree told of the figure}; exits where the tree's process fails as a whole."""
    told: dict[str, Any] = {}
    process = start(tree, FIGURES, [str(tree), str(out), pattern], python)
    assert process.stdout is not None
    for line in process.stdout:
        figure = json.loads(line)
        told[figure["name"]] = figure
        if sys.stderr.isatty():
            print(f"\r\x1b[K{len(told)} {figure['name'][:90]}", end="", file=sys.stderr)
    if sys.stderr.isatty():
        print("\r\x1b[K", end="", file=sys.stderr)
    if process.wait():
        sys.exit(f"the figures of {tree} could not be made: exit status {process.returncode}")
    return told


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    add_arguments(parser)
    parser.add_argument(
        "--only", default="", metavar="PATTERN", help="figures whose names match it, * for anything"
    )
    parser.add_argument(
        "--python", metavar="PROGRAM", help="the working tree under this Python, instead of a revision"
    )
    given = parser.parse_args(arguments)
    if given.python and (given.revision or given.tree):
        sys.exit("give a revision, --tree or --python")
    name, base = (given.python, ROOT) if given.python else base_tree(given)
    pythons = {"old": given.python or sys.executable, "new": sys.executable}
    with tempfile.TemporaryDirectory() as made:
        folders = {side: Path(made) / side for side in ("old", "new")}
        told = {}
        for side, tree in (("old", base), ("new", ROOT)):
            folders[side].mkdir()
            began = time.perf_counter()
            told[side] = make_figures(tree, folders[side], given.only, pythons[side])
            label = name if side == "old" else "the working tree"
            print(f"{len(told[side])} figures of {label} in {time.perf_counter() - began:.0f} s", flush=True)
        found = list(verdicts(told["old"], told["new"], folders))
    if not found:
        sys.exit(f"no figure is called {given.only!r}; without --only all are told")
    print(table(found))
    return 1 if _count(found, False) else 0


if __name__ == "__main__":
    sys.exit(main())
