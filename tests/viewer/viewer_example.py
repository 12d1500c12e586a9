"""Logs of the 5-MW turbine whose states are set by hand: what the viewer must draw is then known in closed form."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner.channels import LOAD_NAMES
from fatigue_runner.logbook import write_log
from fatigue_runner.trajectory import Trajectory
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.viewer.scene import Geometry, geometry

ROTOR_SPEED = 1.2  # rad/s


@cache
def shape(name: str = "nrel5mw", pitch: float = 0.0) -> Geometry:
    """Geometry of a shipped turbine."""
    return geometry(read_turbine_file(name), pitch)


def harmonics(time: np.ndarray) -> list[np.ndarray]:
    """Amplitudes c_1, s_1, c_2, s_2 [m/s] of the example's wind."""
    return [amplitude * np.cos(0.2 * time) for amplitude in (0.5, -0.8, 0.4, 0.3)]


def motion(rows: int = 400, step: float = 0.05, error: float = 0.0) -> Trajectory:
    """A turning, bending turbine; the last third of its steps fell back; `error` is added to the flap."""
    time = step * np.arange(rows)
    state = np.zeros((rows, 16))
    state[:, 0] = 0.4 + 0.2 * np.sin(2 * time)
    state[:, 1] = -0.1 + 0.05 * np.cos(2 * time)
    for i in range(3):
        state[:, 2 + i] = 4.0 + np.sin(ROTOR_SPEED * time + 2 * np.pi / 3 * i) + error
    state[:, 5] = 0.5
    state[:, 6] = ROTOR_SPEED * time
    state[:, 7] = 97 * ROTOR_SPEED * time
    state[:, 14], state[:, 15] = ROTOR_SPEED, 97 * ROTOR_SPEED
    tips = shape().tip_channels(state)
    loads = {name: 1e6 * (8 + np.sin(time)) for name in LOAD_NAMES} | {"blade_pitch": np.zeros_like(time)}
    for i in (1, 2, 3):
        loads[f"blade{i}_root_flapwise_moment"] = 2e6 * state[:, 1 + i]
        loads[f"blade{i}_tip_out_of_plane"] = tips[:, i - 1, 0]
        loads[f"blade{i}_tip_in_plane"] = tips[:, i - 1, 1]
    discrepancy = np.where(np.arange(rows - 1) < 2 * rows // 3, 0.1, 2.0)
    wind = np.column_stack([10 + np.sin(time / 3), np.full(rows, 0.14), np.zeros(rows), *harmonics(time)])
    return Trajectory(
        time=time, state=state, wind=wind, loads=loads,
        accepted=discrepancy < 1.0, discrepancy=discrepancy, threshold=np.ones(rows - 1),
        local_error=np.full(rows - 1, 1e-5), steps=rows - 1, evaluations=2 * rows,
    )  # fmt: skip


def write(folder: Path, method: str = "rk3", wind: str = "u10", *, rows: int = 400, **run: Any) -> Path:
    """Write the log of one case into `folder` and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{wind}_{method}_20ms.mcap"
    is_reference = method == "dop853"
    identity = {
        "case_id": path.stem, "wind": "turbulent", "wind_speed": wind[1:], "seed": 1, "pitch_deg": 0.0,
        "method": method, "step": 0.02, "is_reference": is_reference, "turbine": "nrel5mw", **run,
    }  # fmt: skip
    error = None if is_reference else 1e-4 * np.ones(rows - 1)
    write_log(path, motion(rows), identity, {}, {"status": "done"}, reference_error=error)
    return path
