"""The benchmark's results as Markdown: what the terminal prints and what docs/work-precision.md holds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from fatigue_runner.benchmark import answers
from fatigue_runner.benchmark.work_precision import Point


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


def _optional(value: float | None, text: str) -> str:
    return "" if value is None else format(value, text)


def _point(p: Point) -> list[str]:
    cost = [p.method, f"{p.step * 1e3:g}", f"{p.evaluations_per_second:.0f}"]
    if p.diverged:
        return [*cost, "", "", f"{p.diverged} diverged, first at {p.diverged_at:.1f} s", "", "", ""]
    time = f"{p.wall['median'] * 1e6:.1f} ({p.wall['low'] * 1e6:.1f} to {p.wall['high'] * 1e6:.1f})"
    mean = [sum(v) / len(v) for v in (p.delta_e, p.delta_e_range)]
    return [
        *cost, time, _optional(p.nrmse_max, ".1e"),
        _optional(p.nrmse_worst, ".1e"), _optional(p.del_error_max, ".1e"), f"{mean[0]:.1e}", f"{mean[1]:.1e}",
    ]  # fmt: skip


def _adaptive(p: Point) -> list[str]:
    errors = [_optional(p.nrmse_max, ".1e"), _optional(p.del_error_max, ".1e")]
    return [p.method, f"{p.evaluations_per_second:.0f}", *errors, f"{p.step * 1e3:.0f}"]


HEAD = (
    *("method", "step [ms]", "evaluations/s", "µs/s (delta_t)", "NRMSE", "worst case", "DEL error"),
    *("delta_e", "delta_e_range"),
)


def cases(result: dict[str, Any]) -> list[str]:
    agreement = result["reference"]["agreement"]
    reference = result["reference"]
    largest = max(r["nrmse_worst"] for r in agreement)
    dels = max(r["del_error_max"] for r in agreement)
    points = result["points"]
    return [
        f"## {result['cases'].capitalize()} wind",
        "",
        f"{len(result['winds'])} cases of {result['duration']:g} s on `{result['turbine']}`. Reference: {reference['method']} at "
        f"{reference['step'] * 1e3:g} ms; dop853 at half the step and rk7 at both agree with it to an NRMSE of {largest:.0e} "
        f"(worst state of the worst case) and a DEL error of {dels:.0e}. Errors near that say nothing.",
        "",
        "By time of whole steps:",
        "",
        *[f"- {s}" for s in answers.sentences(points)],
        "",
        "By evaluations of f:",
        "",
        *[f"- {s}" for s in answers.sentences(points, answers.evaluations)],
        "",
        "Pareto front (time, NRMSE): "
        + ", ".join(p.label for p in answers.front(points, answers.wall, answers.nrmse))
        + ".",
        "",
        *table(HEAD, [_point(p) for p in points]),
        "",
        "Adaptive, case by case through SciPy (a few of the cases; their steps differ, so they cannot share vectors, and one "
        "evaluation costs them the scalar time):",
        "",
        *table(
            ["method", "evaluations/s", "NRMSE", "DEL error", "mean step [ms]"],
            [_adaptive(p) for p in result["adaptive"]],
        ),
    ]


def limits(result: dict[str, Any]) -> list[str]:
    rows = [
        [r["method"], f"{r['limit'] * 1e3:.3g}", _optional(r["evaluations_per_second"], ".3g")]
        for r in result["stability_limits"]
    ]
    return table(["method", "largest stable step [ms]", "evaluations/s there"], rows)
