"""A small world for the campaign's tests: a turbine and integrators whose errors are known in closed form.

Every state and load is a sine of amplitude 1 + error, where error = step ** order; so the DEL error of an
integrator against an exact reference is its error. What the program does around the kernels is real: files,
logs, counting, resuming.
"""

from __future__ import annotations

import dataclasses
import types
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner import integrators
from fatigue_runner import turbine as turbines
from fatigue_runner.channels import LOAD_NAMES, STATE_NAMES
from fatigue_runner.layout import T2B1I1CG
from fatigue_runner.rotor import Rotor
from fatigue_runner.trajectory import Trajectory

ORDERS = {"heun": 2, "rk3": 3, "rk4": 4, "rk7": 30}


@dataclasses.dataclass(frozen=True)
class World:
    """What happened (calls: (method, step, wind speeds)), and what shall: cases that diverge, or raise."""

    calls: list[tuple[str, float, list[float]]]
    diverging: dict[tuple[str, float], float]  # (method, speed): time
    raising: dict[str, Exception]  # by method

    def simulated(self, method: str) -> list[float]:
        """All wind speeds that a method was called with."""
        return [speed for name, _, speeds in self.calls if name == method for speed in speeds]


def build_world(monkeypatch: Any) -> World:
    """Put the toy turbine and integrators where the campaign looks for the real ones."""
    world = World([], {}, {})
    turbine = types.SimpleNamespace(
        controller=None,
        control=None,
        pitches=False,
        watched={},
        name="toy",
        hash="0" * 64,
        parameters={"g_ratio": 97.0},
        rotor=Rotor(63.0, 90.0),
        sections={"tower_base": (6.0, 0.027)},
        operating_wind=(5.0, 11.0),
        operated=lambda operation: turbine,
        layout=T2B1I1CG,
        kernel_data=lambda pitch: None,
        operating_point=lambda speed, *shears, pitch: np.full(len(STATE_NAMES), 0.1 * speed),
    )

    def simulate(ensemble, integrator):
        method = integrator.method
        world.calls.append((method, integrator.step, [wind.mean_speed for wind in ensemble.winds]))
        if method in world.raising:
            raise world.raising[method]
        ends = [world.diverging.get((method, wind.mean_speed)) for wind in ensemble.winds]
        return [
            _sine(method, integrator.step, wind, x, ensemble.duration, ensemble.output_step, end)
            for wind, x, end in zip(ensemble.winds, ensemble.initial, ends, strict=True)
        ]

    monkeypatch.setattr(integrators, "simulate", simulate)
    monkeypatch.setattr(integrators, "stability_limit", lambda turbine, method: 0.2)
    monkeypatch.setattr(turbines, "load_turbine", lambda name: turbine)
    from fatigue_runner.campaign import block, prepare, run

    # the toy's reference is exact, and its calls are counted
    monkeypatch.setattr(prepare, "reference_facts", lambda resolved, earlier: {})
    monkeypatch.setattr(run, "warm_up", lambda job: None)
    block._turbine.cache_clear()
    monkeypatch.setattr(block, "_turbine", lambda source, expected_hash, operation: turbine)
    return world


def _sine(
    method: str,
    step: float,
    wind: Any,
    initial: np.ndarray,
    duration: float,
    output_step: float,
    until: float | None,
) -> Trajectory:
    end = duration if until is None else until
    time = np.arange(round(end / output_step) + 1) * output_step
    amplitude = wind.mean_speed * (1.0 + step ** ORDERS[method])
    phase = 2 * np.pi * 0.5 * time[:, None] + np.arange(len(STATE_NAMES))
    state = initial + amplitude * np.sin(phase)
    loads = {
        name: 1e3 * (i + 1) * amplitude * np.sin(2 * np.pi * 0.5 * time) for i, name in enumerate(LOAD_NAMES)
    }
    n = len(time) - 1
    nan = np.full(n, np.nan)
    return Trajectory(
        time,
        state,
        wind.at(time),
        loads,
        np.ones(n, bool),
        nan,
        nan.copy(),
        nan.copy(),
        steps=round(end / step),
        evaluations=round(end / step) * ORDERS[method],
        wall_time=1e-3 * end,
        diverged_at=until,
    )


CAMPAIGN = """\
name: toy
duration: 10
output_rate: 50
initial: operating-point
wind:
  speeds: [6, 8, 10]
integrators:
  - {method: heun, step: [0.05, 0.1]}
  - {method: rk4, step: 0.1}
reference: {method: rk7, step: 0.01}
workers: 1
"""


def write_campaign(folder: Path, text: str = CAMPAIGN, **replace: str) -> Path:
    """A campaign file; `replace` replaces the value of a top-level key by text (None removes the key)."""
    lines = text.splitlines()
    for key, value in replace.items():
        lines = [line for line in lines if not line.startswith(f"{key}:")]
        lines.append(f"{key}: {value}")
    path = folder / "toy.yaml"
    path.write_text("\n".join(lines) + "\n")
    return path
