"""A run folder without a simulation: oscillations that each method gets wrong as its order says.

The DEL error of a method is C·h^p, varied a little over wind, channel and exponent: the ranking is known.
"""

from __future__ import annotations

import csv
import json
import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fatigue_runner.channels import FATIGUE_CHANNELS, STATE_NAMES

METHODS = {
    "heun": (2, 2, 30.0),
    "rk3": (3, 3, 300.0),
    "rk4": (4, 4, 3000.0),
}  # evaluations per step, order, constant
EXPONENTS = (3, 4, 5, 10, 12)
DURATION, RATE = 60.0, 50.0


@dataclass
class ExampleLog:
    """What the report reads of a log."""

    time: np.ndarray
    state: np.ndarray
    run: dict[str, str] = field(default_factory=dict)


def trajectory(speed: float, relative_error: float, until: float = DURATION) -> ExampleLog:
    """Tower-top motion at a wind speed with a phase error that grows in time."""
    time = np.arange(0.0, until + 1e-9, 1.0 / RATE)
    state = np.zeros((time.size, len(STATE_NAMES)))
    mean = 0.003 * speed**2
    decay = np.exp(-0.09 * time)
    drift = relative_error * (1 + time / 20)
    state[:, 0] = mean * (
        1
        - decay * np.cos(2.08 * time * (1 + 0.02 * relative_error))
        + 0.05 * np.sin(0.9 * time) * (1 + drift)
    )
    run = {"turbine": "nrel5mw", "turbine_hash": "0123456789abcdef0123"}
    return ExampleLog(time, state, run)


def case_row(
    speed: float,
    method: str,
    step: float,
    *,
    reference: bool = False,
    diverged_at: float | None = None,
    seed="",
) -> dict:
    """One row of the results table."""
    evaluations, order, constant = (10, 7, 0.0) if reference else METHODS[method]
    wall = evaluations / step * DURATION * 55e-9 * (1 + 0.03 * math.sin(speed))
    row = {
        "case_id": f"{method}-{step * 1e3:g}ms-{speed:g}{seed and f'-s{seed}'}", "wind_source": "constant",
        "wind_speed": speed, "vertical_shear": 0.1, "horizontal_shear": 0.0, "turbulence_intensity": "",
        "seed": seed, "pitch_deg": 0.0,
        "method": method, "step": step, "corrector": "", "mode": "", "is_reference": reference,
        "status": "diverged" if diverged_at else "done", "diverged_at": diverged_at or "",
        "error_message": "rotor speed left ±10 rad/s" if diverged_at else "",
        "duration": DURATION, "steps": round(DURATION / step),
        "evaluations": round(DURATION / step) * evaluations,
        "evaluations_per_second": evaluations / step, "wall_time": wall, "clamped_lookups": 0,
    }  # fmt: skip
    error = constant * step**order * (1 + 0.1 * (speed - 5))
    known = not (reference or diverged_at)
    for name, scale in (
        ("max", 1.0),
        ("mean", 0.3),
        *((state, 0.1 * (1 + i % 5)) for i, state in enumerate(STATE_NAMES)),
    ):
        row[f"nrmse_{name}"] = error * scale if known else ""
    scatter = 1 + 0.1 * math.sin(7.0 * int(seed or 0))
    for i, channel in enumerate(FATIGUE_CHANNELS):
        for m in EXPONENTS:
            relative = error * (1 + 0.3 * math.sin(3 * i + speed)) * (1 + m / 24) * (-1 if i % 2 else 1)
            true = 1e6 * (i + 1) * (speed / 8) ** 1.5 * (0.6 + m / 20) * scatter
            row[f"del_{channel}_m{m}"] = "" if diverged_at else true * (1 + (relative if known else 0))
            row[f"del_error_{channel}_m{m}"] = relative if known else ""
            row[f"damage_ratio_{channel}_m{m}"] = (1 + relative) ** m if known else ""
    return row


def example_rows(
    speeds=(5, 6, 7, 8, 9, 10), steps=(0.01, 0.02, 0.04), seeds=("",), diverging: bool = True
) -> list[dict]:
    """Every method and step at every speed beside a reference; heun diverges at the largest of both."""
    rows = []
    for speed in speeds:
        for seed in seeds:
            rows.append(case_row(speed, "rk7", 0.001, reference=True, seed=seed))
            for method in METHODS:
                for step in steps:
                    lost = diverging and method == "heun" and step == max(steps) and speed == max(speeds)
                    rows.append(case_row(speed, method, step, diverged_at=31.4 if lost else None, seed=seed))
    return rows


def example_log(row: dict) -> ExampleLog:
    """The log of a row."""
    order, constant = (7, 0.0) if row["is_reference"] in (True, "True") else METHODS[row["method"]][1:]
    until = float(row["diverged_at"] or DURATION)
    return trajectory(float(row["wind_speed"]), constant * float(row["step"]) ** order, until)


CAMPAIGN = {
    "name": "example", "turbine": "nrel5mw", "duration": DURATION, "output_rate": RATE,
    "initial": "operating-point", "discard": 0.0,
    "fatigue": {"channels": list(FATIGUE_CHANNELS), "wohler_exponents": list(EXPONENTS), "residue": "half"},
}  # fmt: skip


def write_run(folder: Path, rows: list[dict], campaign: dict | None = None) -> Path:
    """A run folder with results.csv and campaign.yaml (JSON is YAML), without logs."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "results.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    (folder / "campaign.yaml").write_text(json.dumps(CAMPAIGN if campaign is None else campaign))
    return folder
