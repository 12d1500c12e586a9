"""The page on the experiment of arXiv:2504.05493, and what the terminal prints of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fatigue_runner.benchmark.pages import paper_figures, words
from fatigue_runner.benchmark.pages.render import Table, markdown, table
from fatigue_runner.benchmark.speed import machine
from fatigue_runner.benchmark.study import paper
from fatigue_runner.integrators import HYBRID

COMMAND = "fatigue-runner benchmark paper --out docs"
HEAD = (
    *("integrator", "step [ms]", "f per s", "µs/s", "NRMSE", "delta_e_range", "delta_e", "diverged", "accepted"),
    *("winds > 1 % worse than RK3 at that step", "RK3's delta_e_range at as many evaluations"),
)  # fmt: skip


def section(measured: dict[str, Any]) -> str:
    """A Markdown table of the boxed steps: medians over the winds, the worst wind in brackets."""
    speeds = measured["speeds"]
    cells = []
    for o, r in zip(measured["outcomes"], paper.rows(measured), strict=True):
        if o.step not in paper.BOXED:
            continue
        worse, rival = paper.worse_than_rk3(measured, o), paper.at_equal_cost(measured, o)
        cells.append([
            o.label, f"{o.step * 1e3:g}", f"{o.evaluations:.0f}", f"{o.wall * 1e6:.0f}",
            *(f"{r[n]['median']:.1e} ({r[n]['worst']:.1e})" if n in r else "" for n in ("nrmse_max", "delta_e_range")),
            f"{r['delta_e']['median']:.1e}" if "delta_e" in r else "", r["diverged"] or "",
            f"{r['accepted'] * 100:.1f} %" if o.mode == HYBRID else "",
            "" if worse is None else f"{worse[0]} (at most {worse[1]:.3g} times)",
            "" if rival is None or not o.mode else f"{rival:.1e}",
        ])  # fmt: skip
    winds = f"{len(speeds)} winds in {min(speeds):.0f} to {max(speeds):.0f} m/s"
    return f"## {measured['name']}: {winds} on `{measured['turbine']}`\n\n{table(Table(HEAD, cells))}"


def write(inside: dict[str, Any], outside: dict[str, Any], folder: Path) -> Path:
    """`work-precision-paper.md` in `folder`, the figures in `folder/images`; the page's path."""
    figures = paper_figures.draw(inside, outside, folder / "images")
    path = folder / "work-precision-paper.md"
    page = markdown(
        "paper",
        command=COMMAND,
        machine=words.machine(machine.describe()),
        reference=inside["reference"],
        claims=paper.claims(inside, outside),
        figures=[figure.stem for figure in figures],
        sections=[section(measured) for measured in (inside, outside)],
    )
    path.write_text(page + "\n", encoding="utf-8")
    return path
