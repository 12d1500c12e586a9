"""What the measurements say, in sentences."""

from __future__ import annotations

from typing import Any

from fatigue_runner.benchmark.study.answers import Answer, Reached, answers
from fatigue_runner.benchmark.study.integrators import ADAPTIVE
from fatigue_runner.channels import BY_NAME
from fatigue_runner.turbine.turbine import FIXED


def in_words(answer: Answer) -> str:
    """One sentence."""
    c, n, ratio = answer.classical, answer.corrected, answer.ratio
    if c is None and n is None:
        return f"{answer.target}: no integrator gets there."
    if c is None or n is None:
        one, other = (c or n), "corrected" if n is None else "classical"
        assert one is not None
        return f"{answer.target}: {_said(one)}; no {other} one gets there."
    assert ratio is not None
    verdict = f"{ratio:.2f} times cheaper" if ratio >= 1 else f"{1 / ratio:.2f} times dearer"
    return f"{answer.target}: classical {_said(c)}; corrected {_said(n)}, {verdict}."


def _said(r: Reached) -> str:
    time = "" if r.wall is None or r.kind == ADAPTIVE else f"{r.wall * 1e6:.3g} µs and "
    about = "about " if len(r.between) > 1 else ""
    return f"{r.series} at {about}{r.step * 1e3:.3g} ms ({time}{r.evaluations:.3g} evaluations per simulated second)"


def by_measured_time(result: dict[str, Any]) -> list[str]:
    """A sentence per accuracy."""
    return [in_words(answer) for answer in answers(result, "wall")]


def without_exponential(result: dict[str, Any], cost: str) -> list[str]:
    """How many times cheaper than the best Runge-Kutta or Adams method, where there is an answer."""
    return [
        f"{a.target} {a.ratio:.2f} ({a.classical.series})"
        for a in answers(result, cost, with_exponential=False)
        if a.ratio is not None and a.classical is not None
    ]


def winds(result: dict[str, Any]) -> str:
    """What the cases are."""
    kind = "turbulent" if result["turbulent"] else "constant"
    less = f", the first {result['discard']:g} s discarded" if result.get("discard") else ""
    rate, steered = f"{result['output_rate']:g} Hz", result["operation"]
    turbine = f"`{result['turbine']}`{'' if steered == FIXED else f' with `operation: {steered}`'}"
    return f"{len(result['winds'])} cases of {kind} wind, {result['duration']:g} s{less}, on {turbine}, output at {rate}."


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


def machine(values: dict[str, Any]) -> str:
    """What `speed.machine.describe` found."""
    v = values
    return (
        f"{v['processor']} ({v['llvm_cpu']}, {v['vector_bits']}-bit vectors, {v['cores']} cores), {v['system']}, "
        f"Python {v['python']}, numba {v['numba']}, NumPy {v['numpy']}, SciPy {v['scipy']}, {v['date']}"
    )
