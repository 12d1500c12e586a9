"""A turbine with two more states and one more signal of the wind, each an entry in a file of its own."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from pathlib import Path

import toy_gust
import toy_low_pass

from fatigue_runner.layout import T2B1I1CG
from fatigue_runner.turbine import Turbine
from fatigue_runner.turbine.dynamics import Dynamics

LAYOUT = T2B1I1CG.extended(first_order=(toy_low_pass.STATE, toy_gust.STATE), wind=(toy_gust.SIGNAL,))
KERNELS = {"toy_kernel": LAYOUT, "toy_harmonic_kernel": LAYOUT.extended(harmonics=True)}


def write_kernels(folder: Path) -> dict[str, str]:
    """Derive and print both kernels, as `tools/generate_kernel.py` does for the shipped ones; {module: text}."""
    from fatigue_runner.turbine.derivation.printer import Submodel, Variant, module

    submodels = Submodel(toy_low_pass.rates), Submodel(toy_gust.rates)
    texts = {
        name: module(Variant("The toy's kernels.", "toy_turbine.py", layout, submodels=submodels))
        for name, layout in KERNELS.items()
    }
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return texts


def with_toys(turbine: Turbine) -> Turbine:
    """The same turbine, moved by the toy's kernels, which are on the path."""
    from fatigue_runner.turbine.model import Model

    still, turning = (Model("toy", import_module(name), layout) for name, layout in KERNELS.items())
    return replace(
        turbine, dynamics=Dynamics(LAYOUT, lambda _pitched, harmonics: turning if harmonics else still)
    )
