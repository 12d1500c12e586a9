"""The measure of cost in arXiv:2504.05493: what the evaluations of a run take, and nothing else.

delta_t = (n_RK time(f) + n_N time(N)) / h, with n evaluations in a step of h and time(.) the processor's time for one of them. It
leaves out what a step does beside (sums, wind, output, the matrices of exponential methods), which a measured time has.
"""

from __future__ import annotations

from collections.abc import Mapping

F = "f"  # the equations of motion, beside the names of correctors
KINDS = {"single": "one case alone", "lane": "per case of many"}


def delta_t(evaluations_per_second: float, step: float, of_f: float, of_n: float = 0.0) -> float:
    """Processor seconds per simulated second: of so many evaluations of f at `of_f` [s] each, and one correction a step of `step` [s]
    at `of_n` [s] each."""
    return evaluations_per_second * of_f + of_n / step


def delta_ts(
    times: Mapping[str, Mapping[str, float]], evaluations_per_second: float, step: float, corrector: str = ""
) -> dict[str, float]:
    """delta_t by kind (one of `KINDS`), from measured times {`f` or corrector: {kind: s}}; empty where one of them was not measured."""
    if F not in times or (corrector and corrector not in times):
        return {}
    own = times[corrector] if corrector else {}
    return {
        kind: delta_t(evaluations_per_second, step, of_f, own.get(kind, 0.0))
        for kind, of_f in times[F].items()
    }


def break_even(evaluations: float, step: float, rival: float) -> float | None:
    """time(N) / time(f) above which a corrected method with so many evaluations per second at `step` [s] costs more than a classical
    one with `rival` of them for the same error; None where it does at any ratio."""
    saved = (rival - evaluations) * step
    return saved if saved > 0 else None
