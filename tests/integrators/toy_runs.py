"""Everything that `test_toy_layout` looks at, run in a process and with a cache of compiled code of its own.

python toy_runs.py FOLDER     where the toy's kernels are; writes FOLDER/runs.npz
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from smooth_turbine import smooth_turbine
from toy_gust import GustyWind
from toy_turbine import LAYOUT, with_toys

from fatigue_runner.corrector import Corrector, fit, samples, threshold
from fatigue_runner.corrector.binding import Binding
from fatigue_runner.corrector.maps import StageMap
from fatigue_runner.integrators import METHODS, Ensemble, Integrator, multi_blade, simulate, stability_limit
from fatigue_runner.integrators.linear_part import linear_part
from fatigue_runner.logbook import write_log
from fatigue_runner.trajectory import Trajectory
from fatigue_runner.turbine import Turbine, load_turbine
from fatigue_runner.turbine.lanes import evaluate
from fatigue_runner.wind import TurbulentWind, stack_cells

DURATION = 1.6  # s
FILTERED, ANSWERED = 1.1, 0.5  # the toy states' start: rad/s, m/s
BETWEEN = 0.3  # outputs stand at this part of every step

# a step at which the smooth turbine is stable, and at half of which the error is above rounding
COARSE = {
    "euler": 1e-3, "heun": 0.01, "rk3": 0.01, "heun-richardson": 0.02, "bs32": 0.02, "rk4": 0.02, "dp5": 0.02, "tsit5": 0.02,
    "rk7": 0.04, "dop853": 0.08,
}  # fmt: skip


def step_of(method: str) -> float:
    """For the runs next to the plain turbine's [s]."""
    return 1e-3 if method == "euler" else 0.02


def start_of(turbine: Turbine, more: tuple[float, ...] = (FILTERED, ANSWERED)) -> np.ndarray:
    """(size,) off the operating point."""
    x = load_turbine("nrel5mw").operating_point(8.0)
    x[[0, 2, 5]] += 0.05, 0.3, 0.02
    return np.concatenate([x, more])[: turbine.layout.size]


def run(turbine: Turbine, method: str, step: float, winds: Any = None, **given: Any) -> list[Trajectory]:
    """Runs from `start_of` under the winds, the gusty one where none are given."""
    blowing = winds or [GustyWind()]
    initial = given.pop("initial", None)
    start = np.array([start_of(turbine)] * len(blowing)) if initial is None else initial
    output, duration = given.pop("output_step", None), given.pop("duration", DURATION)
    return simulate(Ensemble(turbine, blowing, start, duration, output), Integrator(method, step, **given))


def of_every_method(turbine: Turbine, folder: Path) -> dict[str, np.ndarray]:
    out = {}
    for name in METHODS:
        step = step_of(name)
        whole = run(turbine, name, step)[0]
        out[f"{name}/time"], out[f"{name}/state"] = whole.time, whole.state
        # every output but the first lies between two step ends
        out[f"{name}/between"] = run(turbine, name, step, output_step=(1 + BETWEEN) * step)[0].state
        write_log(folder / f"{name}.mcap", whole)
    return out


def of_smaller_steps() -> dict[str, np.ndarray]:
    turbine = with_toys(smooth_turbine())
    out = {"accurate": run(turbine, "dop853", 0.0025, output_step=0.0025)[0].state}
    for name, step in COARSE.items():
        for part in (1, 2):
            out[f"{name}/{part}"] = run(turbine, name, step / part)[0].state
    return out


def of_a_corrector(turbine: Turbine) -> dict[str, np.ndarray]:
    """Heun with an affine map, trained on the toy and run on a wind that lies between the training's."""
    method, step = "heun", 0.02
    winds, binding = (
        [GustyWind(v, s) for v in (7.0, 8.0, 9.0) for s in (0.5, 1.5)],
        Binding.to(turbine, method, step),
    )
    start = np.array([start_of(turbine)] * len(winds))
    truth = samples.references(turbine, winds, start, DURATION, samples.output_step(step, 0))
    found = samples.along(turbine, method, step, winds, truth, 400, 1e-5, 0)
    learned = StageMap(fit.affine(found.rows, found.defect) / binding.size, layout=LAYOUT)
    guard = threshold.from_training_set(learned, binding, turbine, found)
    corrector = Corrector("toy", "affine", binding, learned, guard, (7.0, 9.0))
    unseen = [GustyWind(8.5, 1.0)]
    out = {
        "exact": run(turbine, "dop853", 0.01, unseen, output_step=step)[0].state,
        "plain": run(turbine, method, step, unseen)[0].state,
    }
    for mode in ("enhanced", "hybrid"):
        made = run(turbine, method, step, unseen, corrector=corrector, mode=mode)[0]
        out[mode], out[f"{mode}/accepted"] = made.state, made.accepted
    return out


def of_diverging(turbine: Turbine) -> dict[str, np.ndarray]:
    """Three cases side by side: a gust that is much too large, a start beyond the bound, and one that is fine."""
    winds = [GustyWind(9.0, 1e5), GustyWind(), GustyWind()]
    start = np.array([start_of(turbine), start_of(turbine, (FILTERED, 2e4)), start_of(turbine)])
    runs = run(turbine, "rk4", 0.02, winds, initial=start)
    return {
        "at": np.array([np.nan if r.diverged_at is None else r.diverged_at for r in runs]),
        "fine": runs[2].state,
        "left": runs[0].state,
    }


def of_the_equations(turbine: Turbine) -> dict[str, np.ndarray]:
    """Operating point, linear parts, and slopes under a wind that has harmonics and no gust."""
    plain, x = load_turbine("nrel5mw"), start_of(turbine)
    wind = TurbulentWind(8.0, 0.14, seed=3, duration=20.0, harmonics=6).on(plain.rotor)
    slopes = [
        evaluate(t.kernel_data(0.0, True), state[:, None], stack_cells([wind], 20.0, t.layout)[1][3, 0])[0][
            :, 0
        ]
        for t, state in ((turbine, x), (plain, x[: plain.layout.size]))
    ]
    return {
        "point": turbine.operating_point(8.0), "plain point": plain.operating_point(8.0),
        "linear": linear_part(turbine, 0.0), "isotropic": multi_blade.linear(turbine, 0.0).isotropic,
        "limit": np.array([stability_limit(turbine, "rk4"), stability_limit(plain, "rk4")]),
        "frequencies": np.array([[m[1:] for m in t.natural_frequencies(8.0)] for t in (turbine, plain)]),
        "slopes": slopes[0], "plain slopes": slopes[1],
    }  # fmt: skip


def main(folder: Path) -> None:
    sys.path.insert(0, str(folder))
    turbine = with_toys(load_turbine("nrel5mw"))
    found = {
        "method": of_every_method(turbine, folder), "order": of_smaller_steps(), "corrector": of_a_corrector(turbine),
        "diverging": of_diverging(turbine), "equations": of_the_equations(turbine),
    }  # fmt: skip
    arrays: Any = {
        f"{group}/{name}": values for group, made in found.items() for name, values in made.items()
    }
    np.savez(folder / "runs.npz", **arrays)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
