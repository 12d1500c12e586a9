"""What every reader gives: longitudinal wind over a grid in time, checked when it is made."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.wind.profiles import Profile

TOLD, REFUSED = 0.02, 0.20  # how far the field's mean may be from what its file says, relative


@dataclass(frozen=True, eq=False)
class WindField:
    """Longitudinal wind `u` (nt, ny, nz) [m/s], mean included, every `time_step` [s] on a grid `y`, `z` [m].

    y (ny,) to the left looking downwind, z (nz,) above ground, both rising by equal steps. `mean_speed` [m/s] is
    the file's own mean at `reference_height` [m], with which the field travels downwind (Taylor): the sample at
    field time t passes the plane x at run time t - (upstream - x) / mean_speed, `upstream` [m] as OpenFAST's
    InitXPosition. A `periodic` field begins again where it ends. `profile` is the mean profile that u holds on
    the grid and that goes on between the grid's heights, where the file's reader adds it there (None: linear).
    `notes` are full sentences about what a user should know.

    Raises InputError for NaN, a mean that is not positive or far from the field's, and a grid of a single line.
    """

    time_step: float
    y: np.ndarray
    z: np.ndarray
    u: np.ndarray
    mean_speed: float
    reference_height: float
    periodic: bool
    source: Path
    upstream: float = 0.0
    profile: Profile | None = None
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        nt, ny, nz = self.u.shape
        for what, value, unit in (
            ("time step", self.time_step, "s"),
            ("mean wind speed", self.mean_speed, "m/s"),
            ("reference height", self.reference_height, "m"),
        ):
            if not (np.isfinite(value) and value > 0):
                raise InputError(
                    f"{self.source}: the {what} is {value:g} {unit} but must be positive; make the file anew"
                )
        if nt < 2 or ny < 2 or nz < 2:
            raise InputError(
                f"{self.source}: the field has {nt} times on {ny} x {nz} points; it needs at least 2 of each"
            )
        if not np.isfinite(self.u).all():
            i, j, k = np.argwhere(~np.isfinite(self.u))[0]
            raise InputError(
                f"{self.source}: the wind at sample {i}, y {self.y[j]:g} m, z {self.z[k]:g} m is {self.u[i, j, k]}; "
                "make the file anew"
            )
        self._compare_mean()

    def _compare_mean(self) -> None:
        """Holds the mean that the file says against the one that its reference point has."""
        if not self.z[0] <= self.reference_height <= self.z[-1]:
            return
        found = float(np.interp(self.reference_height, self.z, self._centre_line()))
        off = abs(found / self.mean_speed - 1)
        said = (
            f"the file says a mean wind of {self.mean_speed:g} m/s at {self.reference_height:g} m "
            f"but its field has {found:.3g} m/s there"
        )
        if off > REFUSED:
            raise InputError(f"{self.source}: {said}; make the file anew or correct what it says")
        if off > TOLD:
            object.__setattr__(self, "notes", (*self.notes, f"{said}."))

    def _centre_line(self) -> np.ndarray:
        """Mean wind (nz,) over time at y = 0."""
        mean = self.u.mean(axis=0, dtype=float)
        return np.array([np.interp(0.0, self.y, mean[:, k]) for k in range(len(self.z))])

    def intensity_at(self, height: float) -> float:
        """Standard deviation over mean of the wind at the grid's middle at that height [m], linear between points."""
        k = int(np.clip(np.searchsorted(self.z, height) - 1, 0, len(self.z) - 2))
        j = int(np.clip(np.searchsorted(self.y, 0.0) - 1, 0, len(self.y) - 2))
        b, c = -self.y[j] / (self.y[j + 1] - self.y[j]), (height - self.z[k]) / (self.z[k + 1] - self.z[k])
        rows = self.u[:, j, k : k + 2] * (1 - b) + self.u[:, j + 1, k : k + 2] * b
        series = (rows[:, 0] * (1 - c) + rows[:, 1] * c).astype(float)
        return float(series.std() / series.mean())

    @property
    def length(self) -> float:
        """Time [s] that the field lasts: from the first to the last sample, or one period."""
        return (len(self.u) - (0 if self.periodic else 1)) * self.time_step

    def delay(self, x: float) -> float:
        """Field time [s] that passes the plane `x` [m] (downwind positive) at run time 0."""
        return (self.upstream - x) / self.mean_speed

    def refuse_rotor(self, hub_height: float, rotor_radius: float) -> None:
        """Raises InputError where the grid does not cover the rotor, or was made for another hub."""
        slack = 1e-3 * (self.z[1] - self.z[0])  # InflowWind's GridTol
        low, high = hub_height - rotor_radius, hub_height + rotor_radius
        covered = self.z[0] - slack <= low and high <= self.z[-1] + slack
        if not covered or min(-self.y[0], self.y[-1]) + slack < rotor_radius:
            raise InputError(
                f"{self.source}: the grid reaches from {self.z[0]:g} to {self.z[-1]:g} m above ground and "
                f"{self.y[0]:g} to {self.y[-1]:g} m sideways, but the rotor needs {low:g} to {high:g} m and "
                f"{rotor_radius:g} m to each side; make the field wider and higher than the rotor"
            )
        if abs(self.reference_height - hub_height) > 0.01 * hub_height:
            raise InputError(
                f"{self.source}: the field was made for a hub at {self.reference_height:g} m, but the turbine's is "
                f"at {hub_height:g} m; make the field for that height"
            )


def refuse_mean(source: Path, mean_speed: float, said: float) -> None:
    """Raises InputError where another mean wind speed [m/s] is asked for than the file has."""
    if abs(mean_speed - said) > 0.1:  # m/s, as InflowWind
        raise InputError(
            f"{source}: the field has a mean wind speed of {mean_speed:.6g} m/s, but {said:g} m/s is asked for; leave that out "
            "or take another file"
        )


def grid(count: int, spacing: float, start: float) -> np.ndarray:
    """Coordinates [m] of `count` lines every `spacing` [m]."""
    return start + spacing * np.arange(count)


def centred(count: int, spacing: float) -> np.ndarray:
    """The same, around zero."""
    return grid(count, spacing, -spacing * (count - 1) / 2)
