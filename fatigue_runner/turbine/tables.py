"""Aerodynamic coefficient tables over tip-speed ratio and pitch, and the cubic cells that the kernels read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.encoded import refuse_pointer
from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.rotor import SQUARE

HEADER = 8  # first tip-speed ratio, cells per unit, padding to one cache line
INTERPOLATIONS = ("cubic", "bilinear")

# How a load answers to an azimuthal harmonic of the wind, whose amplitude is averaged with the flap moment's weight (mean radius 0.71).
# SWING: loads are no straight lines over the wind, their slope is largest where a turbine operates: the slope at the mean makes 4 to 5 %
# more of OpenFAST's field at 8 m/s than blade elements that see it point by point. The secant over sqrt(3) standard deviations
# is the best line for a Gaussian wind (Gauss-Hermite); a blade feels 0.13 V at 8 m/s and 0.11 V at 18 m/s (class B).
# Thrust (mean radius 0.63), bending (0.70) and the flap mode (0.79) answer as their own weights would have it. The tangential force (0.58)
# would be a fifth smaller then, and the tower's side-side load in turbulence a sixth to a third too small (docs/validation.md).
SWING, SLOPE = 0.2, 1e-4
OF_THEIR_OWN_RADIUS = ("thrust", "bending", "flap")
REACH = (0.7, 1.2)


@dataclass(frozen=True, eq=False)
class AeroTables:
    """Coefficients by name.

    tip_speed_ratio (n,) uniform [-]; pitch (k,) [rad], rising; coefficients {name: (n, k)}. `interpolation`: cubic (C2 splines in
    both directions) or bilinear, whose kinks stall methods of high order but reproduce CADynTurb. span_weight: `rotor.Rotor.weight`, or
    None where the tables come from a program that does not tell.
    """

    tip_speed_ratio: NDArray[np.float64]
    pitch: NDArray[np.float64]
    coefficients: Mapping[str, NDArray[np.float64]]
    interpolation: str = "cubic"
    span_weight: tuple[tuple[float, ...], tuple[float, ...]] | None = None

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
            if values.shape != shape:
                raise InputError(
                    f"aerodynamic tables: {name} must have the shape {shape}, got {values.shape}"
                )
            if not np.isfinite(values).all():
                raise InputError(
                    f"aerodynamic tables: {name} must be finite numbers; {np.sum(~np.isfinite(values))} of {values.size} are not"
                )

    def at_pitch(self, pitch: float, names: Sequence[str]) -> NDArray[np.float64]:
        """(n, len(names)) values at one pitch [rad]; a name without a table is zero. Raises InputError outside the table."""
        low, high = float(self.pitch[0]), float(self.pitch[-1])
        if not low - 1e-9 <= pitch <= high + 1e-9:
            raise InputError(
                f"pitch {np.degrees(pitch):g} deg is outside the aerodynamic table "
                f"({np.degrees(low):g} to {np.degrees(high):g} deg)"
            )
        stack = np.stack([self.coefficient(name) for name in names], axis=-1)
        if len(self.pitch) == 1:
            return stack[:, 0]
        if self.interpolation == "bilinear":
            i = int(np.clip(np.searchsorted(self.pitch, pitch) - 1, 0, len(self.pitch) - 2))
            u = (pitch - self.pitch[i]) / (self.pitch[i + 1] - self.pitch[i])
            return (1 - u) * stack[:, i] + u * stack[:, i + 1]
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.pitch, stack, axis=1)(pitch)

    def coefficient(self, name: str) -> NDArray[np.float64]:
        """(n, k) of a table, zero without one; `X_w`, by an azimuthal harmonic of the wind, from the tables X and X_kappa."""
        shape = (len(self.tip_speed_ratio), len(self.pitch))
        if name in self.coefficients or not name.endswith("_w"):
            return self.coefficients.get(name, np.zeros(shape))
        load = name.removesuffix("_w")
        if load not in self.coefficients:
            return np.zeros(shape)
        if load not in OF_THEIR_OWN_RADIUS:
            return self._by_wind(load, SLOPE)
        return self._by_wind(load, SWING) * self._reach(load)

    def _by_wind(self, load: str, share: float) -> NDArray[np.float64]:
        """Change of a load by the wind of the whole blade at a fixed rotor speed: secant over a swing of `share` of the wind, (n, k).

        A load is rho/6 A V^2 X(lambda); over no swing at all this is rho/6 A V (2 X - lambda X').
        """
        ratio, values = self.tip_speed_ratio, self.coefficients[load]

        def at(wind: float) -> NDArray[np.float64]:
            place = np.clip(ratio / wind, ratio[0], ratio[-1])
            if self.interpolation == "bilinear":
                return wind**2 * np.stack([np.interp(place, ratio, column) for column in values.T], axis=1)
            return np.asarray(wind**2 * spline(place))

        from scipy.interpolate import CubicSpline

        spline = CubicSpline(ratio, values)
        return (at(1 + share) - at(1 - share)) / (2 * share)

    def _reach(self, load: str) -> NDArray[np.float64]:
        """Mean radius at which a load feels the wind over that of the weight that a harmonic's amplitude is made with, (n, k)."""
        linear = self.coefficients.get(f"{load}_kappa")
        if linear is None:
            return np.ones((len(self.tip_speed_ratio), len(self.pitch)))
        radii, density = (np.asarray(x) for x in self.span_weight or SQUARE)
        mean_radius = np.trapezoid(radii * density, radii) / np.trapezoid(density, radii)
        with np.errstate(divide="ignore", invalid="ignore"):  # where a load stalls, both change their signs
            found = linear / self._by_wind(load, SLOPE) / mean_radius
        return np.clip(np.nan_to_num(found, nan=1.0), *REACH)

    def cells(self, pitch: float, names: Sequence[str]) -> NDArray[np.float64]:
        """Flat array for the kernels: header, then per cell the coefficients 1, u, u^2, u^3 of all names side by side.

        Zero columns fill up the last group of eight.
        """
        powers = self._powers(self.at_pitch(pitch, names), len(names))
        return np.concatenate([self._header(), powers.ravel()])

    def pitched_cells(self, names: Sequence[str]) -> NDArray[np.float64]:
        """The same over tip-speed ratio and pitch: per cell (pitch, ratio) the 16 coefficients w^a u^b, a the slower one.

        The header goes on with the first pitch [rad], cells per radian and their number. The cells have the table's smallest pitch
        step. Raises InputError where the others are no multiples of it.
        """
        steps = np.diff(self.pitch)
        step = float(steps.min()) if len(steps) > 2 else 0.0
        if not step or np.abs(steps / step - np.rint(steps / step)).max() > 1e-6:
            raise InputError(
                "pitch varying in time needs aerodynamic tables at four or more pitches, at multiples of one step"
            )
        # at a pitch of the table a spline through its values is the value, but for the last, which lies at the end of a piece
        stack = np.stack([self.coefficient(name) for name in names], axis=-1)
        values = [*(stack[:, i] for i in range(len(self.pitch) - 1)), self.at_pitch(self.pitch[-1], names)]
        nodes = np.stack([self._powers(at, len(names)) for at in values])
        parts = self._along(nodes, self.pitch)
        count = round(float(self.pitch[-1] - self.pitch[0]) / step)
        starts = self.pitch[0] + step * np.arange(count)
        parent = np.searchsorted(self.pitch, starts + step / 2) - 1
        # place and width of the cell within its parent
        at, width = (starts - self.pitch[parent]) / steps[parent], step / steps[parent]
        at, width = (x.reshape(-1, *[1] * (nodes.ndim - 2)) for x in (at, width))
        header = self._header()
        header[2:5] = self.pitch[0], 1.0 / step, count
        # on a cache line from the start: copying megabytes for every block would cost as much as running it
        size = HEADER + 4 * count * nodes[0].size
        room = np.empty(size + HEADER)
        begin = -room.ctypes.data % 64 // 8
        out = room[begin : begin + size]
        out[:HEADER] = header
        body = out[HEADER:].reshape(count, nodes.shape[1], 4, *nodes.shape[2:])
        for ratio in range(nodes.shape[1]):  # one by one: all at once they take as much again as the result
            c0, c1, c2, c3 = (part[parent, ratio] for part in parts)
            cells = (
                ((c3 * at + c2) * at + c1) * at + c0,
                (3 * c3 * at + 2 * c2) * at + c1,
                3 * c3 * at + c2,
                c3,
            )
            for power, values in enumerate(cells):
                body[:, ratio, power] = values * width**power
        return out

    def _header(self) -> NDArray[np.float64]:
        header = np.zeros(HEADER)
        header[:2] = self.tip_speed_ratio[0], 1.0 / float(self.tip_speed_ratio[1] - self.tip_speed_ratio[0])
        return header

    def _powers(self, values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
        """(n - 1, 4, columns) coefficients of values (n, count) over the tip-speed ratio."""
        padded = np.pad(values, ((0, 0), (0, -count % HEADER)))
        return np.stack(self._along(padded, self.tip_speed_ratio), axis=1)

    def _along(self, values: NDArray[np.float64], nodes: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Coefficients of 1, u, u^2, u^3 (0 <= u <= 1 in every cell) along the first axis."""
        if self.interpolation == "bilinear":
            flat = np.zeros_like(values[:-1])
            return [values[:-1], np.diff(values, axis=0), flat, flat]
        from scipy.interpolate import CubicSpline

        highest_first = CubicSpline(nodes, values).c
        width = np.diff(nodes).reshape(-1, *[1] * (values.ndim - 1))
        return [highest_first[3 - power] * width**power for power in range(4)]


@contextmanager
def table_file(path: Path) -> Iterator[Any]:
    """The arrays of a table file, by name. Raises InputError where it is missing, or no such file."""
    if not path.is_file():
        raise InputError(
            f"aerodynamic tables {path} do not exist (aerodynamics: tables names them); {_MAKE_TABLES}"
        )
    refuse_pointer(path.read_bytes()[:64], path, "aerodynamic tables")
    try:
        with np.load(path, allow_pickle=False) as data:
            yield data
    except InputError:
        raise
    except (OSError, ValueError, TypeError, AttributeError, EOFError, KeyError, BadZipFile) as error:
        cause = (
            f"it has no {str(error.args[0]).split()[0]}"
            if isinstance(error, KeyError)
            else "it is cut off, or another file"
        )
        raise InputError(
            f"{path} holds no aerodynamic tables ({cause}; aerodynamics: tables names it); {_MAKE_TABLES}"
        ) from None


_MAKE_TABLES = "make them with `fatigue-runner turbine tables FILE`"


def read_tables(path: Path, interpolation: str) -> AeroTables:
    """Tables of an npz written by tools/build_aero_tables.py. Raises InputError where it is missing or of another kind."""
    with table_file(path) as data:
        names = [str(n) for n in data["names"]]
        coefficients = dict(zip(names, data["coefficients"].astype(float), strict=True))
        weight = None
        if "span_weight" in data:
            radii, density = data["span_weight"].astype(float).tolist()
            weight = tuple(radii), tuple(density)
        return AeroTables(
            data["tip_speed_ratio"].astype(float),
            data["pitch"].astype(float),
            coefficients,
            interpolation,
            weight,
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
