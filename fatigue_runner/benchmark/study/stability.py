"""Every corrector over many unseen winds of full length: what diverges, enhanced and hybrid, and what the hybrid accepts.

Of a turbine that operates also how far the hybrid is from the reference in each mean wind, beside the method without its corrector and
beside the fallback alone, at its own step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fatigue_runner.benchmark.study.cases import SEEDS
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import MODES, Ensemble, Integrator, simulate
from fatigue_runner.turbine.turbine import FIXED

FIRST_SEED = SEEDS.start + 100  # beyond those of campaigns/work_precision.yaml
SPEEDS, INTENSITY = (5.0, 10.0), 0.14
OPERATED_AT = (
    4.0,
    8.0,
    11.4,
    12.0,
    18.0,
    24.0,
)  # m/s, of those for a turbine under control, which blow with six harmonics
OUTPUT = 2.0  # s
DISCARD = 20.0  # s, of the errors
REFERENCE = Integrator("dop853", 0.05)


def measure(
    seeds: int = 100, duration: float = 600.0, say: Callable[[str], None] = lambda what: None, chosen: Sequence[Any] | None = None
) -> dict[str, Any]:  # fmt: skip
    """{winds, duration, rows}: per corrector how many winds of `duration` [s] diverged, when first, and the share accepted; nrmse
    {hybrid, alone, fallback}: RMS over the winds of the worst state's, of a turbine that operates; None where a run diverged.

    chosen: correctors, default every shipped one that fits its turbine. Mean speeds 5 to 10 m/s, one seed each; for those of a turbine that
    operates, all seeds at each of `OPERATED_AT`, a row for each.
    Raises InputError for more seeds than are kept for benchmarks.
    """
    from fatigue_runner.corrector import correctors

    if FIRST_SEED + seeds > SEEDS.stop:
        raise InputError(f"at most {SEEDS.stop - FIRST_SEED} seeds are kept for benchmarks, got {seeds}")
    rows = []
    for c in correctors() if chosen is None else chosen:
        if c.binding.operation == FIXED:
            sets = [("5 to 10", np.linspace(*SPEEDS, seeds), 1)]
        else:
            sets = [(f"{v:g}", np.full(seeds, v), 6) for v in OPERATED_AT]
        for named, speeds, harmonics in sets:
            say(f"{c.name}, {named} m/s")
            row = {"corrector": c.name, "wind": named}
            try:
                rows.append(row | _row(_ensemble(c, speeds, harmonics, duration), c))
            except InputError as error:  # of another version of the turbine
                rows.append(row | {"refused": str(error)})
    return {"winds": seeds, "duration": duration, "rows": rows}


def _ensemble(corrector: Any, speeds: np.ndarray, harmonics: int, duration: float) -> Ensemble:
    """Winds of these mean speeds [m/s], a seed each, on the turbine that the corrector is for."""
    from fatigue_runner.integrators.initial import initial_state
    from fatigue_runner.turbine import load_turbine
    from fatigue_runner.wind import TurbulentWind

    turbine = load_turbine(corrector.turbine).operated(corrector.binding.operation)
    winds = [
        TurbulentWind(
            float(v), intensity=INTENSITY, seed=FIRST_SEED + i, duration=duration, harmonics=harmonics
        )
        for i, v in enumerate(speeds)
    ]
    starts: dict[float, Any] = {}
    for wind in winds:
        if wind.mean_speed not in starts:
            starts[wind.mean_speed] = initial_state(turbine, "operating-point", wind)
    initial = np.array([starts[wind.mean_speed] for wind in winds])
    return Ensemble(turbine, winds, initial, duration, min(OUTPUT, duration))


def _row(ensemble: Ensemble, corrector: Any) -> dict[str, Any]:
    row: dict[str, Any] = {}
    runs: list[Any] = []
    for mode in MODES:  # the hybrid is the last
        runs = simulate(ensemble, Integrator(corrector.method, corrector.step, corrector, mode))
        lost = [r.diverged_at for r in runs if r.diverged_at is not None]
        row[mode] = {"diverged": len(lost), "first": min(lost, default=None)}
    row["accepted"] = float(np.mean([r.accepted.mean() for r in runs]))
    row["evaluations_per_second"] = float(np.mean([r.evaluations for r in runs])) / ensemble.duration
    if corrector.binding.operation != FIXED and ensemble.duration > DISCARD:
        found = {"hybrid": runs} | {name: simulate(ensemble, i) for name, i in _rivals(corrector).items()}
        true = simulate(ensemble, REFERENCE)
        row["nrmse"] = {name: _nrmse(block, true) for name, block in found.items()}
    return row


def _rivals(corrector: Any) -> dict[str, Integrator]:
    """The method without its corrector, and what a refused step is made by, where that is a method of its own."""
    found = {"alone": Integrator(corrector.method, corrector.step)}
    if corrector.fallback is not None:
        found["fallback"] = Integrator(*corrector.fallback)
    return found


def _nrmse(block: Sequence[Any], true: Sequence[Any]) -> float | None:
    """Of the worst state, RMS over the runs; None where one diverged."""
    if any(run.diverged_at is not None for run in block):
        return None
    late = true[0].time >= DISCARD
    squares = [
        (((run.state - fine.state)[late] / np.ptp(fine.state[late], axis=0)) ** 2).mean(axis=0)
        for run, fine in zip(block, true, strict=True)
    ]
    return float(np.sqrt(np.mean(squares, axis=0)).max())
