"""Make the aerodynamic tables of the shipped turbines, or check that the committed ones are current.

python tools/build_aero_tables.py            # write fatigue_runner/turbine/data/*_aero.npz
python tools/build_aero_tables.py --check    # exit code 1 where one is old
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.turbine.table_builder import (
    PITCH_DEG,
    TIP_SPEED_RATIO,
    best_weight,
    build_tables,
    has_skewed_wake,
    load_coefficients,
    turbine_blade,
    write_tables,
)

TURBINES = ("nrel5mw", "t2b1i1cg")
SAMPLES = 200


def problems(name: str) -> list[str]:
    """What is wrong with the committed tables of one shipped turbine; empty where they are current."""
    parameters = read_turbine_file(name)
    path = Path(parameters["aerodynamics"]["tables"])
    if not path.is_file():
        return [f"{path.name} is missing"]
    blade, inputs = turbine_blade(parameters)
    with np.load(path, allow_pickle=False) as data:
        found, coefficients = str(data["inputs"]), data["coefficients"]
        weight = data["span_weight"] if "span_weight" in data else np.zeros((2, 1))
    if found != inputs:
        return [f"{path.name} was made from other inputs"]
    random = np.random.default_rng(0)
    i, j = (random.integers(0, len(grid), SAMPLES) for grid in (TIP_SPEED_RATIO, PITCH_DEG))
    again = load_coefficients(
        blade, TIP_SPEED_RATIO[i], np.radians(PITCH_DEG[j]), has_skewed_wake(parameters)
    )
    # Rounding of sin and exp differs between machines; difference quotients enlarge it by 1/step.
    if not np.allclose(again, coefficients[:, i, j], rtol=1e-7, atol=1e-9):
        worst = np.abs(again - coefficients[:, i, j]).max()
        return [f"{path.name} differs from what its inputs give now, by up to {worst:.2g}"]
    expected = best_weight(blade, coefficients)
    if weight.shape != expected.shape or not np.allclose(weight, expected, rtol=1e-6, atol=1e-9):
        return [f"{path.name} holds another span weight than its inputs give now"]
    return []


def main() -> int:
    """Build or check all shipped tables; the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--check", action="store_true", help="only check that the committed tables are current"
    )
    if parser.parse_args().check:
        found = [problem for name in TURBINES for problem in problems(name)]
        for problem in found:
            print(f"{problem}; run `python tools/build_aero_tables.py`", file=sys.stderr)
        return 1 if found else 0
    for name in TURBINES:
        parameters = read_turbine_file(name)
        blade, inputs = turbine_blade(parameters)
        path = Path(parameters["aerodynamics"]["tables"])
        coefficients = build_tables(blade, has_skewed_wake(parameters))
        write_tables(path, coefficients, inputs, best_weight(blade, coefficients))
        print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
