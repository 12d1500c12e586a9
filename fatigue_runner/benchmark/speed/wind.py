"""What wind costs: making turbulence, projecting a full field, and every evaluation with azimuthal harmonics.

CPU times, of all threads where a library starts some: the wall time on one idle core. Turbulence is measured from nothing, as a campaign
meets it: the tables of what coherence and radial weight leave of the spectrum are made in the first series and kept for the others.
"""

from __future__ import annotations

import struct
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fatigue_runner.benchmark.speed import machine
from fatigue_runner.benchmark.speed.kernel import whole_steps

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

SPEEDS, SEEDS, SECONDS = 11, 6, 600.0  # a design load case: 66 series
HARMONICS = (1, 3, 6)
POINTS, FIELD_SECONDS, FIELD_STEP, WIDTH = 15, 660.0, 0.05, 145.0
MEAN = 8.0  # m/s


def series_of_a_design_load_case(turbine: Turbine, harmonics: int) -> float:
    """CPU seconds of all cubics of 66 ten-minute turbulent winds."""
    from fatigue_runner.wind import TurbulentWind

    begin = time.process_time()
    for speed in np.linspace(4.0, 24.0, SPEEDS):
        for seed in range(1, SEEDS + 1):
            wind = TurbulentWind(
                float(speed), turbulence_class="B", seed=seed, duration=SECONDS, harmonics=harmonics
            )
            wind.on(turbine.rotor).cells(SECONDS)
    return time.process_time() - begin


def write_field(path: Path) -> None:
    """A TurbSim field (format 7) of noise: what reading and projecting it cost does not depend on what blows."""
    steps, spacing = round(FIELD_SECONDS / FIELD_STEP), WIDTH / (POINTS - 1)
    grid = spacing, spacing, FIELD_STEP, MEAN, 90.0, 90.0 - WIDTH / 2
    scales = 1000.0, 0.0, 1.0, 0.0, 1.0, 0.0
    head = struct.pack("<h4i6f6fi", 7, POINTS, POINTS, 0, steps, *grid, *scales, 0)
    noise = 1000 * np.random.default_rng(0).normal(MEAN, 0.5, (steps, POINTS * POINTS, 3))
    path.write_bytes(head + noise.astype("<i2").tobytes())


def field_on_the_rotor(turbine: Turbine, harmonics: int) -> float:
    """CPU seconds of reading a field of 15 x 15 points and 660 s, projecting it and making its cubics."""
    from fatigue_runner.wind import FullFieldWind

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "field.bts"
        write_field(path)
        begin = time.process_time()
        FullFieldWind(path, harmonics=harmonics).on(turbine.rotor).cells(SECONDS)
        return time.process_time() - begin


def measure(repeats: int = 5, turbine_name: str = "nrel5mw") -> dict[str, Any]:
    """All figures of `fatigue-runner benchmark wind` as plain values; s, and ns per evaluation and case."""
    from fatigue_runner.turbine import load_turbine
    from fatigue_runner.wind import TurbulentWind

    turbine = load_turbine(turbine_name)
    with machine.pinned():
        TurbulentWind(MEAN, intensity=0.1, duration=10.0, harmonics=2).cells(
            10.0
        )  # libraries are loaded before
        series = {m: series_of_a_design_load_case(turbine, m) for m in HARMONICS}
        field = {m: field_on_the_rotor(turbine, m) for m in HARMONICS}
        work = {
            str(m): whole_steps(turbine, "rk4", duration=20.0, output_step=0.1, harmonics=m)
            for m in HARMONICS
        }
        found = machine.interleaved(work, repeats)
    one = found["1"]["median"]
    return {
        "machine": machine.describe(),
        "turbine": turbine.name,
        "series": SPEEDS * SEEDS,
        "harmonics": [
            {
                "harmonics": m,
                "series_seconds": series[m],
                "field_seconds": field[m],
                "evaluation": found[str(m)],
                "ratio": found[str(m)]["median"] / one,
            }
            for m in HARMONICS
        ],
    }
