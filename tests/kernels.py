"""The kernels that most tests need, compiled before the first one: `python tests/kernels.py SITUATION`.

numba keeps all that it has compiled as long as its process lives: compiled by the tests themselves, the kernels were 5 of the suite's 7 GB,
and each process made its own. So every situation, which is one set of equations, has a process of its own that ends; the tests load what
it leaves in the cache. What is missing here is compiled by the tests that need it, and costs them time and memory only: the suite's
bound of memory (`tests/memory.py`) tells when that has become too much.
"""

from __future__ import annotations

import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import Any

LINEAR, HARMONIC = 1, 6  # azimuthal harmonics of the wind
# Turbine, operation, wind, whether the pitch varies, and what tests run there: one method of each family that is compiled for itself, and
# one corrector of each kind. The longest first.
SITUATIONS: dict[str, tuple[str, str, int, bool, tuple[str, ...]]] = {
    "fixed pitch": (
        "nrel5mw", "fixed", LINEAR, False, ("rk4", "abm4", "etdrk4", "etdabm4", "rk4-100ms", "paper-heun-10ms"),
    ),
    "controlled": ("nrel5mw", "controlled", HARMONIC, False, ("rk4", "etdrk4", "etdabm4")),
    "fixed pitch, harmonics": (
        "nrel5mw", "fixed", HARMONIC, False, ("rk4", "abm4", "etdrk4", "etdabm4", "rk4-100ms"),
    ),
    "varying pitch, harmonics": ("nrel5mw", "fixed", HARMONIC, True, ("rk4", "abm4")),
    "own edges, harmonics": ("nrel5mw_edges", "fixed", HARMONIC, False, ("rk4", "etdrk4")),
    "own edges, controlled": ("nrel5mw_edges", "controlled", HARMONIC, False, ("rk4",)),
    "own edges": ("nrel5mw_edges", "fixed", LINEAR, False, ("rk4",)),
    "varying pitch": ("nrel5mw", "fixed", LINEAR, True, ("rk4",)),
}  # fmt: skip
TRAINED = {"fixed pitch", "controlled"}  # tests train correctors there


def compile_all(at_once: int) -> bool:
    """Every situation, in `at_once` processes at a time; whether all could be compiled."""

    def alone(situation: str) -> bool:
        return subprocess.run([sys.executable, __file__, situation]).returncode == 0

    with ThreadPoolExecutor(at_once) as pool:
        return all(list(pool.map(alone, SITUATIONS)))


def compile_situation(situation: str) -> None:
    """Some steps of each, every step and between the steps as output; what times a correction; the single steps of a training."""
    import numpy as np

    import fatigue_runner as fr
    from fatigue_runner.corrector.samples import single_steps
    from fatigue_runner.integrators import Ensemble, Integrator
    from fatigue_runner.integrators.evaluation_times import evaluation_times

    name, operation, harmonics, pitch_varies, runs = SITUATIONS[situation]
    wind = fr.TurbulentWind(8.0, intensity=0.1, seed=1, duration=10.0, harmonics=harmonics)
    pitch: Any = fr.PitchSeries([0.0, 1.0], [0.0, 0.01]) if pitch_varies else 0.0
    correctors = {corrector.name: corrector for corrector in fr.correctors()}
    for run in runs:
        found = correctors.get(run)
        of, method, step = (found.turbine, found.method, found.step) if found else (name, run, 0.01)
        for output in (None, 0.02):
            fr.simulate(
                of, wind, method, step, 4 * step, output_step=output, pitch=pitch, corrector=found, operation=operation
            )  # fmt: skip
        if found:
            turbine = fr.load_turbine(of)
            one = Ensemble(turbine, [wind], turbine.operating_point(8.0)[None], 1.0)
            evaluation_times(one, [Integrator(method, step, found)], rounds=1)
    if situation in TRAINED:
        turbine = fr.load_turbine(name).operated(operation)
        state, cubics = np.full((1, turbine.layout.size), 1e-3), np.ones((1, 1, 4, len(wind.channels)))
        single_steps(turbine, "rk4", 0.1, state, cubics)


if __name__ == "__main__":
    warnings.simplefilter("ignore")  # of winds and steps that no one looks at
    compile_situation(sys.argv[1])
