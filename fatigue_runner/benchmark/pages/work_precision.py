"""The pages that docs/work-precision*.md are, and what the terminal prints of them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from fatigue_runner.benchmark.pages import figures, tables, words
from fatigue_runner.benchmark.pages.render import markdown

COMMAND = "fatigue-runner benchmark work-precision --out docs"
_COSTS = (
    ("By measured time of whole steps", "wall"),
    ("By evaluations of f", "evaluations"),
    ("By δt, the time of the evaluations alone", "delta_t"),
)


def section(part: dict[str, Any]) -> str:
    """What is to be told of one set of cases."""
    timed = any(p.wall for p in part["points"])
    lost = [f"{p.label} ({p.diverged_at:.1f} s)" for p in part["points"] if p.diverged]
    costs = [(title, cost) for title, cost in _COSTS if timed or cost == "evaluations"]
    return markdown("cases", part=part, costs=costs, lost=lost, tables=tables, words=words)


def speed(template: str, result: dict[str, Any]) -> str:
    """What is to be told of a measurement without integrators: `kernel`, `network`, `stability`."""
    return markdown(template, result=result, tables=tables, words=words)


def write(result: dict[str, Any], folder: Path, images: Path) -> Path:
    """`work-precision.md` and `work-precision-tables.md` in `folder`, figures in `images`."""
    folder.mkdir(parents=True, exist_ok=True)
    values = {
        "command": COMMAND,
        "took": _took(result["seconds"]),
        "load": _load(result.get("load_average")),
        "result": result,
        "sections": [section(part) for part in result["cases"]],
        "figures": figures.write(result["cases"], images),
        "images": os.path.relpath(images, folder),
        "tables": tables,
        "words": words,
    }
    for name in ("work-precision", "work-precision-tables"):
        (folder / f"{name}.md").write_text(markdown(name, **values) + "\n", encoding="utf-8")
    return folder / "work-precision.md"


def _took(spent: dict[str, Any]) -> list[str]:
    took = [f"errors {spent['errors']:.0f} s in {spent['workers']} processes"] if "errors" in spent else []
    return took + ([f"times {spent['times']:.0f} s"] if "times" in spent else [])


def _load(average: float | None) -> str:
    return "" if average is None else f", load average of the machine at the end {average:.1f}"
