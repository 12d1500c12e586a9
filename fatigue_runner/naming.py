"""How an integrator is called: its id in file names and case ids, its label where a person reads. One place for both."""

from __future__ import annotations


def integrator_id(method: str, step: float, corrector: str = "", mode: str = "") -> str:
    """`heun_10ms`, `rk7_0.1ms`, `heun_10ms_hybrid_heun-10ms`; step [s], corrector: its name."""
    parts = (f"{method}_{step * 1e3:.9g}ms", mode if corrector else "", corrector)
    return "_".join(part for part in parts if part)


def integrator_label(method: str, step: float, corrector: str = "", mode: str = "") -> str:
    """`heun 10 ms`, or `heun-10ms, hybrid`: a corrector's name says its method and step."""
    return f"{corrector}, {mode}" if corrector else f"{method} {step * 1e3:g} ms"


# What a corrector's family is called where a person reads: both are networks, the second one the paper's own.
FAMILIES = {"mlp": "network", "paper": "network"}


def integrator_series(method: str, family: str = "", mode: str = "") -> str:
    """What integrators at any step have in common: `heun`, `heun + network, hybrid`; family: that of the corrector."""
    return f"{method} + {FAMILIES.get(family, family)}, {mode}" if family else method
