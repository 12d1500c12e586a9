"""A corrector's card: what it is for, how it was made, how well it did; for people."""

from __future__ import annotations

from pathlib import Path

from fatigue_runner.corrector.corrector import Corrector
from fatigue_runner.corrector.guard import Guard

_LABELS = {
    "nrmse_plain": "plain {method}, median NRMSE over winds",
    "nrmse_plain_worst": "plain {method}, worst wind",
    "nrmse_enhanced": "enhanced, median",
    "nrmse_enhanced_worst": "enhanced, worst wind",
    "nrmse_hybrid": "hybrid, median",
    "nrmse_hybrid_worst": "hybrid, worst wind",
    "acceptance": "share of steps that the hybrid accepted",
}


def summary(corrector: Corrector) -> list[tuple[str, str]]:
    """(label, value) pairs of what a person asks first."""
    guard = corrector.guard
    fallback = "the method of the next order"
    if corrector.fallback is not None:
        own = "steps" if corrector.past else "substeps"
        fallback = f"{guard.substeps} {own} of {corrector.fallback[0]}"
    for rung in reversed(corrector.rungs):
        fallback = f"corrected steps of {rung.step * 1e3:g} ms, then {fallback}"
    sizes = [" x ".join(map(str, weights.shape)) for weights in corrector.map.tensors().values()]
    return [
        ("family", corrector.family),
        ("turbine", f"{corrector.turbine} ({corrector.turbine_hash[:12]})"),
        ("operation", corrector.binding.operation),
        ("method, step", f"{corrector.method}, {corrector.step * 1e3:g} ms"),
        ("features", corrector.map.sees),
        ("weights", ", ".join(sizes)),
        ("wind speeds seen", f"{corrector.wind_range[0]:.2f} to {corrector.wind_range[1]:.2f} m/s"),
        (
            "guard",
            f"{guard.norm} norm <= {guard.limit:.4g} (kappa {guard.kappa:g}, quantile {guard.quantile:g}){_bounds(guard)}; "
            f"fallback: {fallback}",
        ),
        ("licence", corrector.licence),
    ]


def _bounds(guard: Guard) -> str:
    if not guard.low:
        return ""
    return f", inputs at most {(guard.margin or 0.0) * 100:g} % outside the extent of the training and validation samples"


def validation_rows(corrector: Corrector) -> list[tuple[str, str]]:
    rows = [
        (
            label.format(method=corrector.method),
            f"{corrector.validation[key]:.3g}" if key in corrector.validation else "diverged",
        )
        for key, label in _LABELS.items()
        if any(name.startswith("nrmse") for name in corrector.validation)
    ]
    rest = [
        (name.replace("_", " "), f"{value:.3g}")
        for name, value in corrector.validation.items()
        if name not in _LABELS
    ]
    return rows + rest


def card(corrector: Corrector, recipe: Path | None = None) -> str:
    """Markdown."""
    lines = [f"# {corrector.name}", ""]
    lines += [f"- {label}: {value}" for label, value in summary(corrector)]
    place = recipe.as_posix() if recipe else f"{corrector.name}.yaml"
    place = f"correctors/{recipe.name}" if recipe and recipe.parent.name == "correctors" else place
    lines += ["", f"Made by `fatigue-runner train {place}`:", ""]
    lines += [f"- {key.replace('_', ' ')}: {value}" for key, value in corrector.training.items()]
    lines += [
        "",
        "On the validation winds, which were not trained on (NRMSE: the largest over the states):",
        "",
    ]
    lines += [
        "| figure | value |",
        "|---|---|",
        *(f"| {label} | {value} |" for label, value in validation_rows(corrector)),
    ]
    return "\n".join([*lines, ""])
