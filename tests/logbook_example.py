"""A small trajectory with everything a log can hold, and whether two are the same to the bit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fatigue_runner import channels
from fatigue_runner.trajectory import Trajectory

RUN = {"case_id": "w08-hybrid-10ms", "wind_speed": "8.25", "method": "rk3", "turbine_hash": "ab12"}
RESULT = {"acceptance_rate": "0.9", "del_blade1_root_flapwise_moment_m10": "4.928e6"}
COMPRESSIONS = ("zstd", "lz4", "none")
ATTACHMENTS = {"campaign.yaml": b"wind:\n  speeds: [8.25]\n", "turbine.yaml": bytes(range(256))}


def example(rows: int = 400, seed: int = 0) -> Trajectory:
    """Noisy harmonics in every channel, awkward numbers among them, at 50 Hz from time 0."""
    rng = np.random.default_rng(seed)
    # Sums of a step that is no binary fraction: times that a whole number of nanoseconds does not give back.
    time = np.cumsum(np.full(rows, 0.02)) - 0.02
    state = np.sin(time[:, None] * np.linspace(1, 9, 16)) + rng.normal(size=(rows, 16)) * 1e-3
    state[:1, :5] = [0.0, -0.0, 5e-324, np.nan, np.inf]
    loads = {name: 1e6 * np.sin(time * 2) + rng.normal(size=rows) * 1e4 for name in channels.LOAD_NAMES}
    wind = np.stack([8 + rng.normal(size=rows), np.full(rows, 0.2), np.zeros(rows)], axis=1)
    discrepancy = rng.random(max(rows - 1, 0))
    return Trajectory(
        time=time,
        state=state,
        wind=wind,
        loads=loads,
        accepted=discrepancy < 0.9,
        discrepancy=discrepancy,
        threshold=np.full(max(rows - 1, 0), 0.9),
        local_error=rng.random(max(rows - 1, 0)) * 1e-6,
        steps=2 * (rows - 1),
        evaluations=6 * (rows - 1),
        clamped_lookups=3,
        wall_time=0.0123,
    )


MORE = (
    channels.Channel("filtered_speed", "rad/s", "generator speed through a low-pass", "rpm"),
    channels.Channel("torque_demand", "N.m", "torque demand", "kN·m", 1e-3),
)


def with_states(run: Trajectory) -> Trajectory:
    """The same with two states of first order behind the turbine's."""
    more = np.random.default_rng(5).normal(size=(len(run.time), len(MORE)))
    return replace(run, state=np.concatenate([run.state, more], axis=1), states=(*channels.STATES, *MORE))


def arrays(t: Any) -> dict[str, np.ndarray]:
    """Every array of a trajectory by name, loads too."""
    names = ("time", "state", "wind", "accepted", "discrepancy", "threshold", "local_error")
    return {name: getattr(t, name) for name in names} | t.loads


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two arrays have the same shape and the same bits, NaN and signed zero included."""
    a, b = np.asarray(a), np.asarray(b)
    return a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes()


def differing(a: Any, b: Any, rows: int | None = None) -> list[str]:
    """Names of the arrays in which trajectory a is not the first `rows` rows (None: all) of trajectory b."""
    wanted = arrays(b)
    if rows is not None:
        intervals = max(rows - 1, 0)
        status = {"accepted", "discrepancy", "threshold", "local_error"}
        wanted = {name: v[: intervals if name in status else rows] for name, v in wanted.items()}
    found = arrays(a)
    return [name for name in wanted if name not in found or not same_bits(found[name], wanted[name])]
