"""The whole work-precision benchmark, and the pages that docs/work-precision*.md are."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fatigue_runner import shipped
from fatigue_runner.benchmark import answers, figures, kernel, machine, network, text, work_precision
from fatigue_runner.benchmark.cases import load

COMMAND = "fatigue-runner benchmark work-precision --out docs"

Say = Callable[[str], None]


def measure(
    campaign: Path | Mapping[str, Any] | None = None,
    *,
    rounds: int | None = None,
    workers: int = 2,
    timed: bool = True,
    earlier: tuple[dict[str, Any], str] | None = None,
    say: Say = lambda what: None,
) -> dict[str, Any]:
    """Every set of cases of a campaign (default: the shipped one) with all integrators, the kernel and the network.

    rounds: of the timing, default as the campaign says; timed: False leaves the times out; earlier: the result of such a run and
    where it was read, so that only the times are measured. Raises InputError for a wrong campaign and for an earlier run of
    another version.
    """
    began = time.perf_counter()
    sets, settings = load(shipped.campaign("work_precision") if campaign is None else campaign)
    same = work_precision.identity(sets, settings)
    if earlier is None:
        parts = work_precision.errors(sets, settings, workers, say)
        spent = {"errors": time.perf_counter() - began, "workers": workers}
    else:
        parts, spent = (
            work_precision.reused(earlier[0], same, earlier[1]),
            dict(earlier[0].get("seconds", {})),
        )
    result: dict[str, Any] = {
        "identity": same,
        "machine": machine.describe(),
        "cases": parts,
        "seconds": spent,
    }
    if timed:
        begin, count = time.perf_counter(), rounds or settings.rounds
        work_precision.times(sets, settings, parts, count, say)
        say("kernel and network")
        result |= {
            "rounds": count,
            "kernel": kernel.measure(count),
            "network": network.measure_with_one_thread(count),
            "load_average": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        }
        spent["times"] = time.perf_counter() - begin
    for part in parts:
        part["summary"] = answers.summary(part)
    return result


def _how(result: dict[str, Any]) -> list[str]:
    spent, load_average = result["seconds"], result.get("load_average")
    took = [f"errors {spent['errors']:.0f} s in {spent['workers']} processes"] if "errors" in spent else []
    took += [f"times {spent['times']:.0f} s"] if "times" in spent else []
    load_words = (
        "" if load_average is None else f", load average of the machine at the end {load_average:.1f}"
    )
    return [
        f"Made by `{COMMAND}`; every figure is from that one run ({'; '.join(took)}). {text.machine(result['machine'])}. "
        f"Times: one pinned thread, CPU time of whole steps with output, medians of {result.get('rounds', 0)} interleaved "
        f"rounds{load_words}.",
        "",
        "**Errors.** NRMSE: RMS error over the range of the state, RMS over the cases, of the worst state; `worst case`: worst state of "
        "the worst case. DEL error: the largest over channels, Wöhler exponents 3 to 12 and cases. delta_e, delta_e_range: medians "
        "over the cases. **Costs.** µs/s: microseconds per simulated second and case; the paper's formula of delta_t is not in its public "
        "abstract, so this time stands for it. The cost of an accuracy is read from a method's curve between the two steps "
        "that enclose it (straight in log-log; `~` marks it), never beyond its ends. `times cheaper`: cost of the cheapest classical "
        "method over that of the cheapest integrator with a corrector, enhanced or hybrid; below 1 the corrector loses. Every "
        "registered method and every shipped corrector runs unless the file names some; what diverged is listed and is no point "
        "of a front.",
        "",
        "All points, per state and per channel: [work-precision-tables.md](work-precision-tables.md).",
        "",
    ]  # fmt: skip


def write(result: dict[str, Any], folder: Path, images: Path) -> Path:
    """`work-precision.md` and `work-precision-tables.md` in `folder`, figures in `images`."""
    folder.mkdir(parents=True, exist_ok=True)
    names = figures.write(result["cases"], images)
    where = os.path.relpath(images, folder)
    lines = ["# Error over cost of every integrator", "", *_how(result)]
    lines += ["## In words", "", "By measured time:", ""]
    for part in result["cases"]:
        said = "\n".join(f"  - {sentence}" for sentence in answers.summary(part)["in_words"])
        lines += [f"- {part['cases'].capitalize()} (`{part['turbine']}`):", said]
    lines += ["", *[f"![{name.removesuffix('.png')}]({where}/{name})\n" for name in names[:2]]]
    for part in result["cases"]:
        lines += [*text.cases(part), ""]
    lines += ["## Stability limits", "", f"![{names[2]}]({where}/{names[2]})", ""]
    lines += [*text.limits(result["cases"][0]["stability_limits"]), ""]
    lines += ["From the linearised turbine (exponential methods: tried out, up to 1 s).", ""]
    if "kernel" in result:
        lines += ["## Kernel", "", *text.kernel(result["kernel"]), ""]
        lines += ["## The paper's network", "", *text.network(result["network"]), ""]
    (folder / "work-precision-tables.md").write_text(_tables(result), encoding="utf-8")
    path = folder / "work-precision.md"
    path.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")
    return path


def _tables(result: dict[str, Any]) -> str:
    lines = [
        "# Work-precision: all points",
        "",
        f"Made by `{COMMAND}` with [work-precision.md](work-precision.md).",
        "",
    ]
    for part in result["cases"]:
        lines += [f"## {part['cases'].capitalize()}", "", f"{text.winds(part)} {text.trust(part)}", ""]
        lines += [*text.points(part), "", "NRMSE per state:", "", *text.per_state(part), ""]
        lines += ["DEL error per channel:", "", *text.per_channel(part), ""]
    return "\n".join(lines).rstrip() + "\n"
