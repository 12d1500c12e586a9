"""Aerodynamic coefficient tables over tip-speed ratio and pitch, and the cubic cells that the kernels read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.errors import InputError, did_you_mean

HEADER = 8  # first tip-speed ratio, cells per unit, padding to one cache line
INTERPOLATIONS = ("cubic", "bilinear")


@dataclass(frozen=True)
class AeroTables:
    """Coefficients by name.

    tip_speed_ratio (n,) uniform [-]; pitch (k,) [rad], rising; coefficients {name: (n, k)}. `interpolation`: cubic (C2 splines in
    both directions) or bilinear, whose kinks stall methods of high order but reproduce CADynTurb.
    """

    tip_speed_ratio: NDArray[np.float64]
    pitch: NDArray[np.float64]
    coefficients: Mapping[str, NDArray[np.float64]]
    interpolation: str = "cubic"

    def __post_init__(self) -> None:
        if self.interpolation not in INTERPOLATIONS:
            raise InputError(
                f"interpolation: unknown kind {self.interpolation!r}{did_you_mean(self.interpolation, INTERPOLATIONS)}"
            )
        steps = np.diff(self.tip_speed_ratio)
        if len(steps) < 3 or not np.allclose(steps, steps[0]) or steps[0] <= 0:
            raise InputError("aerodynamic tables: tip_speed_ratio must rise in at least 3 equal steps")
        shape = (len(self.tip_speed_ratio), len(self.pitch))
        for name, values in self.coefficients.items():
            if values.shape != shape or not np.isfinite(values).all():
                raise InputError(
                    f"aerodynamic tables: {name} must be finite numbers of shape {shape}, got {values.shape}"
                )

    def at_pitch(self, pitch: float, names: Sequence[str]) -> NDArray[np.float64]:
        """(n, len(names)) values at one pitch [rad]; a name without a table is zero. Raises InputError outside the table."""
        low, high = float(self.pitch[0]), float(self.pitch[-1])
        if not low - 1e-9 <= pitch <= high + 1e-9:
            raise InputError(
                f"pitch {np.degrees(pitch):g} deg is outside the aerodynamic table "
                f"({np.degrees(low):g} to {np.degrees(high):g} deg)"
            )
        n = len(self.tip_speed_ratio)
        stack = np.stack(
            [self.coefficients.get(name, np.zeros((n, len(self.pitch)))) for name in names], axis=-1
        )
        if len(self.pitch) == 1:
            return stack[:, 0]
        if self.interpolation == "bilinear":
            i = int(np.clip(np.searchsorted(self.pitch, pitch) - 1, 0, len(self.pitch) - 2))
            u = (pitch - self.pitch[i]) / (self.pitch[i + 1] - self.pitch[i])
            return (1 - u) * stack[:, i] + u * stack[:, i + 1]
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.pitch, stack, axis=1)(pitch)

    def cells(self, pitch: float, names: Sequence[str]) -> NDArray[np.float64]:
        """Flat array for the kernels: header, then per cell the coefficients 1, u, u^2, u^3 of all names side by side.

        Zero columns fill up the last group of eight.
        """
        values = self.at_pitch(pitch, names)
        values = np.pad(values, ((0, 0), (0, -len(names) % HEADER)))
        step = float(self.tip_speed_ratio[1] - self.tip_speed_ratio[0])
        powers = np.zeros((len(values) - 1, 4, values.shape[1]))
        if self.interpolation == "bilinear":
            powers[:, 0], powers[:, 1] = values[:-1], np.diff(values, axis=0)
        else:
            from scipy.interpolate import CubicSpline

            highest_first = CubicSpline(self.tip_speed_ratio, values).c
            for power in range(4):
                powers[:, power] = highest_first[3 - power] * step**power
        header = np.zeros(HEADER)
        header[:2] = self.tip_speed_ratio[0], 1.0 / step
        return np.concatenate([header, powers.ravel()])


def read_tables(path: Path, interpolation: str) -> AeroTables:
    """Tables of an npz written by tools/build_aero_tables.py. Raises InputError where it is missing or of another kind."""
    if not path.is_file():
        raise InputError(
            f"aerodynamic tables {path} do not exist; make them with `python tools/build_aero_tables.py`"
        )
    with np.load(path, allow_pickle=False) as data:
        names = [str(n) for n in data["names"]]
        coefficients = dict(zip(names, data["coefficients"].astype(float), strict=True))
        return AeroTables(
            data["tip_speed_ratio"].astype(float), data["pitch"].astype(float), coefficients, interpolation
        )


def tables_from_mapping(data: Mapping[str, Any], interpolation: str) -> AeroTables:
    """Tables given in full: tip_speed_ratio (n,), pitch_deg (k,) (default [0]), coefficients {name: (n,) or (n, k)}."""
    from fatigue_runner.turbine.generated.kernel import TABLES

    ratio = np.asarray(data["tip_speed_ratio"], float)
    pitch = np.radians(np.atleast_1d(np.asarray(data.get("pitch_deg", 0.0), float)))
    out = {}
    for name, values in data["coefficients"].items():
        if name not in TABLES:
            raise InputError(f"aerodynamic tables: unknown name {name!r}{did_you_mean(name, TABLES)}")
        out[name] = np.asarray(values, float).reshape(len(ratio), len(pitch))
    return AeroTables(ratio, pitch, out, interpolation)
