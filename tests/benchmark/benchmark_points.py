"""Points made by hand, as the benchmark measures them."""

from __future__ import annotations

from fatigue_runner.benchmark.study.points import Point


def point(series, step, cost, error, kind="classical", **others):
    """cost: microseconds and evaluations per simulated second alike."""
    corrector = f"{series}-{step}" if kind in ("enhanced", "hybrid") else ""
    label = f"{series} {step * 1e3:g} ms"
    values = {"wall": {"median": cost * 1e-6}, "nrmse_max": error, "del_error_max": error, **others}
    return Point("x", series.split(" ")[0], step, cost, series, label, kind, corrector, **values)


def result(points, turbulent=True, **others):
    return {"points": points, "adaptive": [], "turbulent": turbulent, "turbine": "nrel5mw", **others}
