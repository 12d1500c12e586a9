"""The page on the experiment of arXiv:2504.05493, and what the terminal prints of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner.benchmark.pages import paper_figures, words
from fatigue_runner.benchmark.pages.render import Table, markdown, table
from fatigue_runner.benchmark.speed import machine
from fatigue_runner.benchmark.study import paper
from fatigue_runner.integrators import HYBRID
from fatigue_runner.results.evaluation_cost import F

COMMAND = "fatigue-runner benchmark paper --out docs"
_COSTS = (("paper", "ms/s"), ("single", "µs/s"), ("lane", "µs/s"))
HEAD = (
    *("integrator", "step [ms]", "f per s", "µs/s", *(f"δt, {kind} [{unit}]" for kind, unit in _COSTS)),
    *("NRMSE", "delta_e_range", "delta_e", "diverged", "accepted"),
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
            f"{o.delta_t['paper'] * 1e3:.0f}", *(_microseconds(o.delta_t[kind]) for kind in ("single", "lane")),
            *(f"{r[n]['median']:.1e} ({r[n]['worst']:.1e})" if n in r else "" for n in ("nrmse_max", "delta_e_range")),
            f"{r['delta_e']['median']:.1e}" if "delta_e" in r else "", r["diverged"] or "",
            f"{r['accepted'] * 100:.1f} %" if o.mode == HYBRID else "",
            "" if worse is None else f"{worse[0]} (at most {worse[1]:.3g} times)",
            "" if rival is None or not o.mode else f"{rival:.1e}",
        ])  # fmt: skip
    winds = f"{len(speeds)} winds in {min(speeds):.0f} to {max(speeds):.0f} m/s"
    return f"## {measured['name']}: {winds} on `{measured['turbine']}`\n\n{table(Table(HEAD, cells))}"


def _microseconds(value: float) -> str:
    return f"{value * 1e6:.0f}" if value >= 1e-4 else f"{value * 1e6:.3g}"


def one_evaluation(measured: dict[str, Any]) -> str:
    """A Markdown table of the times of one evaluation."""
    times = measured["evaluation_times"]
    head = [
        "",
        *(f"{words} [µs]" for words in paper.KINDS.values()),
        *(f"time(N) / time(f), {kind}" for kind in paper.KINDS),
    ]
    rows = []
    for name, own in times.items():
        ratios = ["" if name == F else f"{own[kind] / times[F][kind]:.2g}" for kind in paper.KINDS]
        cells = [f"{own[kind] * 1e6:.3g}" for kind in paper.KINDS]
        rows.append(["f" if name == F else f"N of {name}", *cells, *ratios])
    return table(Table(head, rows))


def break_evens(measured: dict[str, Any]) -> str:
    """A Markdown table of the ratios time(N) / time(f) at which a correction stops paying."""
    head = (
        *(
            "integrator",
            "step [ms]",
            "median delta_e_range",
            "f per s",
            "fewest of a classical method",
            "f per s",
        ),
        *("pays where time(N) / time(f) is below", *(f"pays, {words}" for words in paper.KINDS.values())),
    )
    rows = []
    for everyone in (False, True):
        for b in paper.break_evens(measured, everyone):
            o = b.outcome
            pays = [f"{'yes' if b.pays(kind) else 'no'} ({b.measured[kind]:.2g})" for kind in paper.KINDS]
            rows.append([
                o.label, f"{o.step * 1e3:g}", f"{np.median(o.values('delta_e_range')):.1e}", f"{o.evaluations:.0f}", b.rival,
                f"{b.evaluations:.0f}", "nowhere" if b.ratio is None else f"{b.ratio:.2g}", *pays,
            ])  # fmt: skip
    return table(Table(head, rows))


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
        evaluations=one_evaluation(inside),
        break_evens=break_evens(inside),
        figures=[figure.stem for figure in figures],
        sections=[section(measured) for measured in (inside, outside)],
    )
    path.write_text(page + "\n", encoding="utf-8")
    return path
