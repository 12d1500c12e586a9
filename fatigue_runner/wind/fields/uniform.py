"""AeroDyn's and InflowWind's uniform wind, text `.wnd` or `.hh`: the whole field by eight numbers in time.

Columns: time [s], horizontal speed [m/s], direction [deg], vertical speed [m/s], horizontal linear shear [-],
power-law exponent [-], vertical linear shear [-], gust [m/s], and in newer files upflow [deg]. Between lines all
are interpolated linearly; before the first and after the last they hold (InflowWind's WindType 2). The wind along
the shaft's horizontal, x, at a point is

    u = cos(direction) (cos(upflow) V - sin(upflow) vertical),
    V = speed ((z / h)^exponent + (horizontal y' + linear (z - h)) / L) + gust,   y' = y cos + x sin(direction).

Uniform wind does not travel: it is the same at every x at once. TurbSim's `.hh` of a field therefore comes half
the grid's width later than its `.bts`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.values import decimal
from fatigue_runner.wind.azimuth import radial_shares, whole_harmonics
from fatigue_runner.wind.checks import number
from fatigue_runner.wind.fields.files import read_text
from fatigue_runner.wind.fields.projection import FieldHarmonics
from fatigue_runner.wind.profiles import PowerLaw, profile_amplitudes, profile_disc_fit, refuse_ground

COLUMNS = (
    "time",
    "horizontal speed",
    "direction",
    "vertical speed",
    "horizontal shear",
    "power-law exponent",
    "vertical shear",
    "gust",
    "upflow",
)
WITHOUT_UPFLOW = 8
TURNED = 30.0  # degrees; beyond, the wake's lean is extrapolated
STEP = 0.05  # s, where the file's own times are not uniform or far apart: between them its wind is linear


@dataclass(frozen=True, eq=False)
class UniformWind:
    """The lines of a uniform wind file: `time` (n,) [s] and `values` (n, 8), the other COLUMNS, angles in rad.

    `reference_height` [m] is where the speed holds and `reference_length` [m] what the linear shears refer to;
    the file has neither.
    """

    time: np.ndarray
    values: np.ndarray
    reference_height: float
    reference_length: float
    source: Path
    notes: tuple[str, ...] = field(default=())

    @property
    def mean_speed(self) -> float:
        """Time-weighted mean of the horizontal speed [m/s], gust included; as InflowWind's, but for the gust."""
        speed = self.values[:, 0] + self.values[:, 6]
        if len(self.time) == 1:
            return float(speed[0])
        steps = np.diff(self.time)
        return float((speed[:-1] + speed[1:]) @ steps / 2 / steps.sum())

    @property
    def time_step(self) -> float:
        """The file's own time step [s] where it is uniform and fine, else STEP."""
        steps = np.diff(self.time)
        if len(steps) > 2 and steps[0] <= 2 * STEP and np.allclose(steps, steps[0], rtol=1e-3, atol=1e-6):
            return float(f"{(self.time[-1] - self.time[0]) / len(steps):.9g}")
        return STEP

    def at(self, time: np.ndarray) -> np.ndarray:
        """The values (n, 8) at `time` (n,) [s]."""
        return np.stack([np.interp(time, self.time, column) for column in self.values.T], axis=1)

    def longitudinal(self, time: np.ndarray, x: float, y: float, z: float) -> np.ndarray:
        """Wind along x [m/s] at one point [m] and `time` (n,) [s], as InflowWind gives it there."""
        speed, direction, vertical, across, exponent, linear, gust, upflow = self.at(time).T
        aside = y * np.cos(direction) + x * np.sin(direction)
        above = z - self.reference_height
        shape = (z / self.reference_height) ** exponent
        shape = shape + (across * aside + linear * above) / self.reference_length
        return np.cos(direction) * (np.cos(upflow) * (speed * shape + gust) - np.sin(upflow) * vertical)


def read_uniform(path: str | Path, reference_height: float, reference_length: float) -> UniformWind:
    """A uniform wind file; `reference_height` is the turbine's hub, `reference_length` its rotor diameter [m].

    Raises InputError with file and line for a word that is no number, a wrong number of columns, NaN, times that
    do not rise, and a mean speed that is not positive.
    """
    path = Path(path)
    number("uniform wind: reference_height", reference_height, above=0.0, unit=" m")
    number("uniform wind: reference_length", reference_length, above=0.0, unit=" m")
    lines, rows = _rows(path)
    table = np.array(rows)
    for i in np.flatnonzero(np.abs(table[:, 5]) > 1)[:1]:
        raise InputError(
            f"{path}:{lines[i]}: the power-law exponent is {table[i, 5]:g}; it lies between -1 and 1 (column 6)"
        )
    for i in np.flatnonzero(np.diff(table[:, 0]) <= 0)[:1]:
        raise InputError(
            f"{path}:{lines[i + 1]}: time {table[i + 1, 0]:g} s is not after {table[i, 0]:g} s; times must rise"
        )
    values = table[:, 1:].copy()
    values[:, [1, 7]] = np.radians(values[:, [1, 7]])
    values[:, 1] = np.unwrap(values[:, 1])  # 350 to 10 degrees goes through north, as in InflowWind
    notes = []
    if table[0, 0] > 0:
        notes.append(f"{path} begins at {table[0, 0]:g} s; until then its first line holds.")
    if (farthest := np.degrees(np.abs(values[:, 1])).max()) > TURNED:
        notes.append(
            f"{path} turns the wind by up to {farthest:.3g} degrees against x, along which the nacelle's axis lies; it does not follow."
        )
    wind = UniformWind(table[:, 0], values, reference_height, reference_length, path, tuple(notes))
    if not wind.mean_speed > 0:
        raise InputError(f"{path}: the mean wind speed is {wind.mean_speed:g} m/s; it must be positive")
    return wind


def _rows(path: Path) -> tuple[list[int], list[list[float]]]:
    """Line numbers and the nine numbers of every line that has any; upflow is 0 where the file has none."""
    lines: list[int] = []
    rows: list[list[float]] = []
    for line_number, line in enumerate(read_text(path), 1):
        words = re.sub(r"[!#%].*", "", line).replace(",", " ").split()
        if not words:
            continue
        if (rows and len(words) < len(rows[0])) or len(words) < WITHOUT_UPFLOW:
            raise InputError(
                f"{path}:{line_number}: {len(words)} numbers; a line of uniform wind has {WITHOUT_UPFLOW} or "
                f"{len(COLUMNS)}: {', '.join(COLUMNS)}"
            )
        lines.append(line_number)
        rows.append([_number(path, line_number, *pair) for pair in zip(COLUMNS, words, strict=False)])
    if not rows:
        raise InputError(f"{path}: no line of numbers; uniform wind has {', '.join(COLUMNS)}")
    width = min(map(len, rows))
    return lines, [row[:width] + [0.0] * (len(COLUMNS) - width) for row in rows]


def _number(path: Path, line: int, name: str, word: str) -> float:
    value = decimal(word)
    if value is None:
        raise InputError(f"{path}:{line}: the {name} is {word!r}; give a number")
    if not np.isfinite(value):
        raise InputError(f"{path}:{line}: the {name} is {word}; fill or cut the gap")
    return value


def harmonics_of_uniform(
    wind: UniformWind,
    hub_height: float,
    rotor_radius: float,
    radii: np.ndarray,
    weight: np.ndarray,
    harmonics: int,
    *,
    duration: float,
    x: float = 0.0,
    time_step: float | None = None,
) -> FieldHarmonics:
    """Amplitudes in time of a uniform wind on the rotor plane `x` [m], from 0 to `duration` [s].

    radii, weight (k,) as in `radial_shares`; sampled every `time_step` [s] (None: the file's own). Corners between
    the file's lines lie on samples where the step divides its times.
    """
    harmonics = whole_harmonics(harmonics)
    radii, weight = radial_shares(radii, weight, rotor_radius)
    refuse_ground(hub_height, rotor_radius)
    step = time_step or wind.time_step
    time = step * np.arange(int(np.ceil(duration / step - 1e-9)) + 1)
    speed, direction, vertical, across, exponent, linear, gust, upflow = wind.at(time).T
    along = np.cos(direction) * np.cos(upflow)

    level = speed * (across * x * np.sin(direction) + linear * (hub_height - wind.reference_height))
    level = level / wind.reference_length + gust
    constant = level - np.tan(upflow) * vertical
    upwards = along * speed * linear / wind.reference_length  # [1/s]
    sideways = along * speed * across * np.cos(direction) / wind.reference_length

    reference = wind.reference_height

    def power_law(e: float) -> np.ndarray:
        shape = profile_amplitudes(PowerLaw(e), hub_height, radii, weight, harmonics, reference)
        return np.concatenate([shape, profile_disc_fit(PowerLaw(e), hub_height, rotor_radius, reference)])

    shapes = _over_exponents(power_law, exponent) * speed[:, None]
    whole = shapes[:, 1 + 2 * harmonics] + level  # mean over the disc before it is turned
    aside = -np.sin(direction) * (np.cos(upflow) * whole - np.sin(upflow) * vertical)
    turned = np.stack([aside, np.sin(upflow) * whole + np.cos(upflow) * vertical], axis=1)
    both = shapes * along[:, None]
    amplitudes, disc = both[:, : 1 + 2 * harmonics], both[:, 1 + 2 * harmonics :]
    for table in (amplitudes, disc):
        table[:, 0] += along * constant
    if harmonics:
        amplitudes[:, 1] += upwards * (weight @ radii)
        amplitudes[:, 2] -= sideways * (weight @ radii)
    disc[:, 1] += upwards * rotor_radius
    disc[:, 2] += sideways * rotor_radius
    return FieldHarmonics(
        step,
        amplitudes,
        disc,
        wind.mean_speed,
        wind.source,
        notes=wind.notes,
        across=turned if turned.any() else None,
    )


FEW = 33  # exponents; a file whose exponent changes at every line has thousands


def _over_exponents(of: Callable[[float], np.ndarray], exponent: np.ndarray) -> np.ndarray:
    """`of` each exponent (n,): (n, columns). Of many, through FEW of them by a spline (error below 1e-8)."""
    exponents, place = np.unique(exponent, return_inverse=True)
    if len(exponents) <= FEW:
        return np.stack([of(e) for e in exponents])[place]
    from scipy.interpolate import CubicSpline  # slower to import than all of wind

    nodes = np.linspace(exponents[0], exponents[-1], FEW)
    return CubicSpline(nodes, np.stack([of(e) for e in nodes]))(exponent)
