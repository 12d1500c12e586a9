"""The whole work-precision benchmark, and the page that docs/work-precision.md is."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from fatigue_runner.benchmark import adaptive, figures, kernel, machine, network, text, work_precision
from fatigue_runner.benchmark.cases import BUILT_IN, load_cases

COMMAND = "fatigue-runner benchmark work-precision --out docs"


def measure(campaigns: Sequence[Path], repeats: int, say: Callable[[str], None]) -> dict[str, Any]:
    """Every set of cases with all integrators; see `work_precision` for what is in a set's result."""
    parts = []
    for campaign in campaigns or BUILT_IN:
        cases = load_cases(campaign)
        part = work_precision.measure(cases, repeats, say=say)
        say(f"{cases.name}: adaptive methods")
        reference = work_precision.make_reference(cases, *work_precision.REFERENCE)
        part["adaptive"] = adaptive.measure(cases, reference)
        parts.append(part)
    say("kernel and network")
    return {
        "machine": machine.describe(),
        "load_average": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "repeats": repeats,
        "cases": parts,
        "kernel": kernel.measure(max(3, repeats)),
        "network": network.measure_with_one_thread(max(3, repeats)),
    }


def write(result: dict[str, Any], folder: Path, images: Path) -> Path:
    """`work-precision.md` in `folder`, its figures in `images`."""
    folder.mkdir(parents=True, exist_ok=True)
    names = figures.write(result["cases"], images)
    where = os.path.relpath(images, folder)
    lines = [
        "# Error over cost of every integrator",
        "",
        f"Made by `{COMMAND}`; every figure is from that one run. {text.machine(result['machine'])}. One pinned thread, CPU "
        f"time, medians of {result['repeats']} interleaved rounds with quartiles; load average at the end "
        f"{result['load_average'] or 0:.1f}.",
        "",
        "NRMSE: RMS error over the range of the state, RMS over the cases, of the worst state; `worst case`: of the worst "
        "state of the worst case. DEL error: the largest over channels, Wöhler exponents 3 to 12 and cases. µs/s: microseconds "
        "of whole steps with output per simulated second and case; the paper's formula of delta_t was not at hand, so this "
        "time stands for it. Points that diverged are never on a front.",
        "",
    ]
    for part in result["cases"]:
        lines += [*text.cases(part), ""]
    if "kernel" in result:
        lines += ["## Kernel", "", *text.kernel(result["kernel"]), ""]
        lines += ["## The paper's network", "", *text.network(result["network"]), ""]
    lines += ["## Stability limits", "", *text.limits(result["cases"][0]), ""]
    lines += ["From the linearised turbine (`etdrk4`: tried out, up to 1 s).", "", "## Figures", ""]
    lines += [f"![{name.removesuffix('.png')}]({where}/{name})\n" for name in names]
    path = folder / "work-precision.md"
    path.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")
    return path
