"""What the speed stands on: packed instructions, and bits that do not depend on where the compiled code came from."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys

import pytest

from fatigue_runner.benchmark.speed.kernel import operations

pytestmark = pytest.mark.slow(reason="compiles everything anew, since numba shows assembly only then")

# Operations of one evaluation for one case: what an edit of the equations may cost before somebody looks at it.
MOST_OPERATIONS = 1750

# A process of its own with an empty cache: numba shows assembly only of what it has just compiled.
PROGRAM = """
import hashlib, json, re
import numpy as np
from fatigue_runner.integrators import stepper
from simulating import simulate_block
from fatigue_runner.integrators.pitch import PitchSeries
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import TurbulentWind

turbine = load_turbine("nrel5mw")
start = turbine.operating_point(8.0)[None]
wind = TurbulentWind(8.0, intensity=0.1, seed=1, duration=10.0)
digest = hashlib.sha256()
for method in ("heun", "rk4", "tsit5", "abm4"):
    digest.update(simulate_block(turbine, method, 0.01, [wind], start, 5.0, 0.015)[0].state.tobytes())
series = PitchSeries([0, 1, 2, 3], [0.0, 0.01, 0.02, 0.02])
digest.update(simulate_block(turbine, "heun", 0.01, [wind], start, 3.0, pitch=series)[0].state.tobytes())


def count(assembly, functions):
    name, ours = "", False
    for line in assembly.splitlines():
        label = re.match(r"^(_ZN\\w+|lane_kernel\\w*):", line)
        if label:
            name = label.group(1)
            ours = name.startswith("lane_kernel") or ("fatigue_runner" in name and "7cpython" not in name)
        elif ours and not line.strip().startswith("."):
            counts = functions.setdefault(name, [0, 0])
            arithmetic = re.match(r"\\s*v?(add|sub|mul|div|max|f[n]?m(?:add|sub)\\d+)(pd|sd)\\s", line)
            if arithmetic:
                counts[arithmetic.group(2) == "pd"] += 1


functions, pitched = {}, {}
for signature in stepper.run.signatures:
    varying = "varying-pitch" in str(signature)
    count(stepper.run.inspect_asm(signature) or "", pitched if varying else functions)
print(json.dumps({"bits": digest.hexdigest(), "functions": functions, "pitched": pitched}))
"""


def run(cache) -> dict:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    cache = tmp_path_factory.mktemp("cache")
    return run(cache), run(cache)


def arithmetic(runs, part: str, kernel: str = "functions") -> tuple[int, int]:
    """(scalar, packed) arithmetic instructions of the largest compiled function of that name."""
    pattern = rf"(\d|^){part}(B|\d*$)"
    found = [counts for name, counts in runs[0][kernel].items() if re.search(pattern, name)]
    assert found, f"{part} is not among {sorted(runs[0][kernel])}"
    return max(found, key=sum)


@pytest.mark.parametrize("kernel", ["functions", "pitched"])
def test_the_right_hand_side_is_packed_to_the_last_operation(runs, kernel):
    # about 1,000 with 8 doubles a vector; what is left is some arithmetic of constants
    scalar, vector = arithmetic(runs, "lane_kernel", kernel)
    assert vector > 800
    assert scalar < 0.03 * vector


@pytest.mark.parametrize(("part", "least"), [("run", 250), ("write_output", 40)])
def test_stage_arithmetic_wind_and_output_are_packed(runs, part, least):
    """The loop holds its stages and the wind, which are compiled into it."""
    _, vector = arithmetic(runs, part)
    assert vector >= least


def test_code_from_the_cache_gives_the_bits_of_code_compiled_in_the_process(runs):
    """Else a campaign that is resumed differs from one that ran through."""
    cold, warm = runs
    assert not warm["functions"]  # it did come from the cache
    assert cold["bits"] == warm["bits"]


def test_an_evaluation_has_no_more_operations_than_it_had():
    assert operations() <= MOST_OPERATIONS
