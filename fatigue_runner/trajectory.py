"""The plain result of one simulated case: arrays that fatigue, logbook, report and viewer read."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fatigue_runner.channels import STATES, Channel, channel_name, wind_channels
from fatigue_runner.errors import InputError, did_you_mean


@dataclass
class Trajectory:
    """One case, sampled at the output times.

    time (n,) [s]; state (n, k) in the order of `states`, which are `channels.STATES` and the first-order states of a controller, say,
    behind them; wind (n, 3): speed and linear shears, or (n, 3 + 2 M) where the wind has M > 1 azimuthal harmonics, columns named by
    `winds`: `wind_signals` where they are given, else `channels.wind_channels` (docs/wind.md); loads {channel: (n,)} SI.

    The status arrays have one entry per output interval, (n-1,): `accepted` is False where any step in the interval fell back,
    `discrepancy` and `threshold` are the hybrid's norms (NaN where there is no test), `local_error` the embedded error estimate's largest
    scaled component (NaN for methods without one). `diverged_at` [s] is None for a finished case; otherwise the arrays end there.
    pitch (n,) [rad]; control {state of the controller: (n,)} and what else is seen of it, `control_signals`: the pitch's rate, the torque's
    region, ...; empty where the pitch is given.
    """

    time: np.ndarray
    state: np.ndarray
    wind: np.ndarray
    loads: dict[str, np.ndarray] = field(default_factory=dict)
    accepted: np.ndarray = field(default_factory=lambda: np.empty(0, bool))
    discrepancy: np.ndarray = field(default_factory=lambda: np.empty(0))
    threshold: np.ndarray = field(default_factory=lambda: np.empty(0))
    local_error: np.ndarray = field(default_factory=lambda: np.empty(0))
    steps: int = 0
    evaluations: int = 0
    clamped_lookups: int = 0
    wall_time: float = 0.0
    diverged_at: float | None = None
    states: tuple[Channel, ...] = STATES
    wind_signals: tuple[Channel, ...] | None = None
    pitch: np.ndarray = field(default_factory=lambda: np.empty(0))
    control: dict[str, np.ndarray] = field(default_factory=dict)
    control_signals: tuple[Channel, ...] = ()

    def __getitem__(self, name: str) -> np.ndarray:
        """(n,) of a state, load, wind signal or signal of the controller by its name, or by OpenFAST's (`RootMyb1`); raises InputError."""
        there = dict(zip((c.name for c in self.states), self.state.T, strict=False))
        there |= dict(zip((c.name for c in self.winds), self.wind.T, strict=False))
        there |= {**self.control, **self.loads}
        found = there.get(channel_name(name, there))
        if found is None:
            raise InputError(f"the trajectory has no channel {name!r}{did_you_mean(name, there)}")
        return np.asarray(found)

    @property
    def winds(self) -> tuple[Channel, ...]:
        """What the columns of `wind` are."""
        return self.wind_signals or wind_channels(self.wind.shape[1] if np.ndim(self.wind) == 2 else 0)

    @property
    def duration(self) -> float:
        """Simulated time covered by the arrays [s]."""
        return float(self.time[-1] - self.time[0])
