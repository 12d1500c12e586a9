"""Every corrector over many unseen winds of full length: what diverges, enhanced and hybrid, and what the hybrid accepts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fatigue_runner.benchmark.study.cases import SEEDS
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import MODES, Ensemble, Integrator, simulate

FIRST_SEED = SEEDS.start + 100  # beyond those of campaigns/work_precision.yaml
SPEEDS, INTENSITY = (5.0, 10.0), 0.14
OUTPUT = 2.0  # s


def measure(
    seeds: int = 100, duration: float = 600.0, say: Callable[[str], None] = lambda what: None, chosen: Sequence[Any] | None = None
) -> dict[str, Any]:  # fmt: skip
    """{winds, duration, rows}: per corrector how many winds of `duration` [s] diverged, when first, and the share accepted.

    chosen: correctors, default every shipped one that fits its turbine. Mean speeds 5 to 10 m/s, one seed each.
    Raises InputError for more seeds than are kept for benchmarks.
    """
    from fatigue_runner.corrector import correctors
    from fatigue_runner.integrators.initial import initial_state
    from fatigue_runner.turbine import load_turbine
    from fatigue_runner.wind import TurbulentWind

    if FIRST_SEED + seeds > SEEDS.stop:
        raise InputError(f"at most {SEEDS.stop - FIRST_SEED} seeds are kept for benchmarks, got {seeds}")
    winds = [
        TurbulentWind(float(v), intensity=INTENSITY, seed=FIRST_SEED + i, duration=duration, harmonics=1)
        for i, v in enumerate(np.linspace(*SPEEDS, seeds))
    ]
    rows = []
    for c in correctors() if chosen is None else chosen:
        turbine = load_turbine(c.turbine)
        start = np.array([initial_state(turbine, "operating-point", w) for w in winds])
        say(c.name)
        try:
            rows.append(_row(Ensemble(turbine, winds, start, duration, min(OUTPUT, duration)), c))
        except InputError as error:  # of another version of the turbine
            rows.append({"corrector": c.name, "refused": str(error)})
    return {"winds": seeds, "duration": duration, "rows": rows}


def _row(ensemble: Ensemble, corrector: Any) -> dict[str, Any]:
    row: dict[str, Any] = {"corrector": corrector.name}
    for mode in MODES:
        runs = simulate(ensemble, Integrator(corrector.method, corrector.step, corrector, mode))
        lost = [r.diverged_at for r in runs if r.diverged_at is not None]
        row[mode] = {"diverged": len(lost), "first": min(lost, default=None)}
    row["accepted"] = float(np.mean([r.accepted.mean() for r in runs]))
    return row
