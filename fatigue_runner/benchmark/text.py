"""The benchmark's results as Markdown: what the terminal prints and what docs/work-precision.md holds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from fatigue_runner.benchmark import answers
from fatigue_runner.benchmark.answers import Answer, Reached
from fatigue_runner.benchmark.points import Point
from fatigue_runner.benchmark.targets import targets
from fatigue_runner.channels import BY_NAME


def table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> list[str]:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return lines + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]


def machine(values: dict[str, Any]) -> str:
    v = values
    return (
        f"{v['processor']} ({v['llvm_cpu']}, {v['vector_bits']}-bit vectors, {v['cores']} cores), {v['system']}, "
        f"Python {v['python']}, numba {v['numba']}, NumPy {v['numpy']}, SciPy {v['scipy']}, {v['date']}"
    )


def _ns(value: dict[str, float]) -> str:
    return f"{value['median']:.1f} ({value['low']:.1f} to {value['high']:.1f})"


def kernel(result: dict[str, Any]) -> list[str]:
    head = ["cases", "packed [ns]", "scalar [ns]", "scalar / packed"]
    rows = [[r["cases"], _ns(r["packed"]), _ns(r["scalar"]), f"{r['ratio']:.2f}"] for r in result["cases"]]
    steps = [
        [r["method"], _ns(r["whole_step"]), f"{r['over_kernel'] * 100:+.0f} %"] for r in result["whole_steps"]
    ]
    peak = result["peak_flop_per_ns"]
    return [
        f"Machine: {machine(result['machine'])}.",
        "",
        "Time of one evaluation of f per case, median and quartiles:",
        "",
        *table(head, rows),
        "",
        f"{result['operations_per_evaluation']} operations per evaluation; peak of fused multiply-adds {peak:.0f} flop/ns, "
        f"so {result['share_of_peak'] * 100:.0f} % of the vector peak at 256 cases.",
        *(
            [f"With a pitch of its own for each of 256 cases: {_ns(result['varying_pitch'])} ns."]
            if "varying_pitch" in result
            else []
        ),
        "",
        "Whole steps of 16 turbulent cases at 10 ms, logged at 50 Hz, per evaluation and case:",
        "",
        *table(["method", "ns", "over the kernel alone"], steps),
    ]


def network(result: dict[str, Any]) -> list[str]:
    rows = [
        [r["precision"], r["samples"], f"{r['time']['median']:.0f}", f"{r['evaluations']:.1f}"]
        for r in result["rows"]
    ]
    sizes = "-".join(str(n) for n in result["sizes"])
    return [
        f"The paper's network {sizes} ({result['multiply_adds']} multiply-adds) with one BLAS thread; f costs "
        f"{result['evaluation']['median']:.0f} ns:",
        "",
        *table(["precision", "samples", "ns per sample", "evaluations of f"], rows),
    ]


def optional(value: float | None, text: str) -> str:
    return "" if value is None else format(value, text)


def microseconds(value: float | None) -> str:
    return "" if value is None else f"{value * 1e6:.2f}"


def winds(result: dict[str, Any]) -> str:
    """What the cases are."""
    kind = "turbulent" if result["turbulent"] else "constant"
    less = f", the first {result['discard']:g} s discarded" if result.get("discard") else ""
    rate = f"{result['output_rate']:g} Hz"
    return f"{len(result['winds'])} cases of {kind} wind, {result['duration']:g} s{less}, on `{result['turbine']}`, output at {rate}."


def trust(result: dict[str, Any]) -> str:
    """How far the reference can be trusted, in one sentence."""
    reference = result["reference"]
    rows = [r for r in reference["agreement"] if r["nrmse_worst"] is not None]
    named = f"{reference['method']} at {reference['step'] * 1e3:g} ms"
    if not rows:
        return f"Reference: {named}; nothing else could check it."
    worst = max(rows, key=lambda r: r["nrmse_worst"])
    others = ", ".join(f"{r['method']} at {r['step'] * 1e3:g} ms" for r in rows)
    moves = f"`{worst['state']}`, which in one of them moves by {worst['moves']:.1e} {BY_NAME[worst['state']].unit} only"
    return (
        f"Reference: {named}; {others} agree with it to an NRMSE of {worst['nrmse_worst']:.0e} (worst state of the worst case: "
        f"{moves}) and a DEL error of {max(r['del_error_max'] for r in rows):.0e}: errors near that say nothing."
    )


def _cell(r: Reached | None) -> str:
    if r is None:
        return "none gets there"
    return f"{r.series}, {'~' if len(r.between) > 1 else ''}{r.step * 1e3:.3g} ms"


def _pair(answer: Answer) -> list[str]:
    c, n = answer.classical, answer.corrected
    unit = {"wall": lambda r: f"{r.wall * 1e6:.2f}", "evaluations": lambda r: f"{r.evaluations:.1f}"}[
        answer.cost
    ]
    values = [unit(r) if r else "" for r in (c, n)]
    ratio = "" if answer.ratio is None else f"{answer.ratio:.2f}"
    return [answer.target, _cell(c), values[0], _cell(n), values[1], ratio]


def verdicts(result: dict[str, Any]) -> list[str]:
    """The cheapest classical and the cheapest corrected integrator for every accuracy, and the targets."""
    lines = []
    for cost, words, unit in (
        ("wall", "By measured time of whole steps", "µs/s"),
        ("evaluations", "By evaluations of f", "per s"),
    ):
        if cost == "wall" and not any(p.wall for p in result["points"]):
            continue
        head = ["error", "classical", unit, "with corrector", unit, "times cheaper"]
        lines += [f"{words}:", "", *table(head, [_pair(a) for a in answers.answers(result, cost)]), ""]
        less = answers.answers(result, cost, with_exponential=False)
        said = [
            f"{a.target} {a.ratio:.2f} ({a.classical.series})"
            for a in less
            if a.ratio is not None and a.classical is not None
        ]
        if said:
            lines += [
                f"Times cheaper than the best Runge-Kutta or Adams method, without the exponential ones: {', '.join(said)}.",
                "",
            ]
    judged = targets(result)
    if judged:
        lines += ["Targets:", "", *[f"- {t}" for t in judged], ""]
    return lines[:-1]


def duels(result: dict[str, Any]) -> list[str]:
    """Every corrector at its own error against the classical curves there."""
    rows = []
    for d in answers.duels(result):
        p = d.point
        ratios = [optional(d.ratio(cost), ".2f") for cost in answers.COSTS]
        rival = d.rivals["wall"]
        rows.append([
            p.label, f"{p.step * 1e3:g}", f"{d.error:.1e}", optional(p.nrmse_worst, ".1e"), optional(p.del_error_max, ".1e"),
            microseconds(answers.wall(p)), f"{p.evaluations_per_second:.0f}", _cell(rival), microseconds(rival.wall if rival else None),
            ratios[0], ratios[1], "" if p.accepted is None else f"{p.accepted * 100:.1f} %",
        ])  # fmt: skip
    head = [
        *(
            "corrector",
            "step [ms]",
            "NRMSE",
            "worst case",
            "DEL error",
            "µs/s",
            "evaluations/s",
            "best classical at that NRMSE",
        ),
        *("µs/s", "times cheaper: time", "evaluations", "accepted"),
    ]
    return table(head, rows)


def _point(p: Point) -> list[str]:
    cost = [p.label, f"{p.step * 1e3:g}", f"{p.evaluations_per_second:.0f}"]
    if p.diverged:
        return [*cost, "", "", f"{p.diverged} diverged, first at {p.diverged_at:.1f} s", "", "", ""]
    time = ""
    if p.wall:
        time = f"{p.wall['median'] * 1e6:.2f} ({p.wall['low'] * 1e6:.2f} to {p.wall['high'] * 1e6:.2f})"
    median = [float(np.median(v)) for v in (p.delta_e, p.delta_e_range)]
    return [
        *cost, time, optional(p.nrmse_max, ".1e"),
        optional(p.nrmse_worst, ".1e"), optional(p.del_error_max, ".1e"), f"{median[0]:.1e}", f"{median[1]:.1e}",
    ]  # fmt: skip


HEAD = (
    *("integrator", "step [ms]", "evaluations/s", "µs/s (delta_t)", "NRMSE", "worst case", "DEL error"),
    *("delta_e", "delta_e_range"),
)


def points(result: dict[str, Any]) -> list[str]:
    """All points of a set of cases: costs and errors."""
    lines = table(HEAD, [_point(p) for p in result["points"]])
    if result["adaptive"]:
        rows = [
            [
                p.label,
                f"{p.evaluations_per_second:.0f}",
                optional(p.nrmse_max, ".1e"),
                optional(p.del_error_max, ".1e"),
                f"{p.step * 1e3:.0f}",
            ]
            for p in result["adaptive"]
        ]
        lines += [
            "",
            "Adaptive, case by case through SciPy on a few of the cases: their steps differ, so they cannot share vectors, and one "
            "evaluation costs them the scalar time:",
            "",
            *table(["method", "evaluations/s", "NRMSE", "DEL error", "mean step [ms]"], rows),
        ]
    return lines


def per_state(result: dict[str, Any]) -> list[str]:
    """NRMSE of every state, of all points."""
    shown = [p for p in result["points"] if p.nrmse]
    names = list(shown[0].nrmse) if shown else []
    return table(["integrator", *names], [[p.label, *(f"{p.nrmse[n]:.0e}" for n in names)] for p in shown])


def per_channel(result: dict[str, Any]) -> list[str]:
    """DEL error of every channel, of all points."""
    shown = [p for p in result["points"] if p.del_error]
    names = list(dict.fromkeys(name for p in shown for name in p.del_error))
    rows = [[p.label, *(optional(p.del_error.get(n), ".1e") for n in names)] for p in shown]
    return table(["integrator", *names], rows)


def fronts(result: dict[str, Any]) -> list[str]:
    """The Pareto fronts."""
    lines = []
    for words, cost, error in (
        ("time, NRMSE", answers.wall, answers.nrmse),
        ("evaluations, NRMSE", answers.evaluations, answers.nrmse),
        ("time, DEL error", answers.wall, answers.del_error),
    ):
        labels = "; ".join(p.label for p in answers.front(result["points"], cost, error))
        lines.append(f"- {words}: {labels or 'no times were measured'}")
    return lines


def cases(result: dict[str, Any]) -> list[str]:
    """What the terminal prints of a set of cases, and the page's section on it."""
    lines = [
        f"## {result['cases'].capitalize()}",
        "",
        f"{winds(result)} {trust(result)}",
        "",
        *verdicts(result),
    ]
    lines += ["", "Pareto fronts, the cheapest first:", "", *fronts(result)]
    if any(p.corrected for p in result["points"]):
        lines += [
            "",
            "Every corrector at its own error against the cheapest classical curve there:",
            "",
            *duels(result),
        ]
    lost = [f"{p.label} ({p.diverged_at:.1f} s)" for p in result["points"] if p.diverged]
    if lost:
        lines += ["", "Diverged (first time), never on a front: " + "; ".join(lost) + "."]
    if result["left_out"]:
        lines += ["", "Left out:", "", *[f"- {reason}" for reason in result["left_out"]]]
    return lines


def limits(rows: Sequence[dict[str, Any]]) -> list[str]:
    cells = [
        [
            r["method"],
            f"{'at least ' if r['at_least'] else ''}{r['limit'] * 1e3:.3g}",
            optional(r["evaluations_per_second"], ".3g"),
        ]
        for r in rows
    ]
    return table(["method", "largest stable step [ms]", "evaluations/s there"], cells)
