"""A field on the rotor: one matrix from the grid's points to the blade-effective azimuthal amplitudes.

The field is interpolated linearly in y and z on circles around the hub, as OpenFAST does at the blades' points,
and analysed over the azimuth; circles are averaged with the weight along the blade. All of that is linear in the
field, so it is one matrix product over all times.

Taylor's hypothesis with OpenFAST's time origin: at run time 0 the first sample of a field that is not periodic
is half the grid's width downwind of the tower's axis, so the rotor plane at `x` sees the field's time
t + (W/2 - x) / U; a periodic field begins at the tower. With the rotor's tilt each height has an x of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.wind.azimuth import (
    analysis_rows,
    azimuth_grid,
    disc_rule,
    radial_shares,
    whole_harmonics,
)
from fatigue_runner.wind.checks import number
from fatigue_runner.wind.direction import directions
from fatigue_runner.wind.fields.field import WindField
from fatigue_runner.wind.profiles import profile_amplitudes, profile_disc_fit


@dataclass(frozen=True, eq=False)
class FieldHarmonics:
    """Wind on the rotor in time, every `time_step` [s]; the first sample passes it at run time `start` [s].

    amplitudes (n, 1 + 2 M) [m/s] in the order c_0, c_1, s_1, ... of `wind.azimuth`: what the blades see.
    disc (n, 3) [m/s]: area-weighted mean v and slopes G_z, G_y per rotor radius of the least-squares plane, so
    that the linear shears are G_z / v and G_y / v: what the tip-speed ratio is made of. `mean_speed` [m/s] as
    the file says it; hub_intensity: standard deviation over mean at the hub's point, None for a wind without points. across (n, 2):
    lateral and vertical wind, mean over the disc [m/s]; None where the file has none.
    """

    time_step: float
    amplitudes: np.ndarray
    disc: np.ndarray
    mean_speed: float
    source: Path
    start: float = 0.0
    periodic: bool = False
    notes: tuple[str, ...] = field(default=())
    hub_intensity: float | None = None
    across: np.ndarray | None = None

    @property
    def end(self) -> float:
        """Last run time [s] that the field covers; a periodic one covers one period from time 0 on."""
        if self.periodic:
            return len(self.amplitudes) * self.time_step
        return self.start + (len(self.amplitudes) - 1) * self.time_step

    def sampled(self, duration: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Amplitudes, disc and what blows across (n, 0 or 2) at run times 0, time_step, 2 time_step, ... up to at least `duration` [s].

        A cubic spline through the field's own samples (a periodic one where it is periodic); linear interpolation,
        as OpenFAST's, halves the amplitudes at a third of the sampling rate midway between samples. The last
        sample stands in within one step of the field's end. Raises InputError where the field does not last that long.
        """
        from scipy.interpolate import CubicSpline  # slower to import than all of wind

        duration = number("duration", duration, above=0.0, unit=" s")
        if self.start > 1e-9 or duration > self.end * (1 + 1e-9):
            raise InputError(
                f"{self.source}: the field passes the rotor from {self.start:.6g} to {self.end:.6g} s of the run, "
                f"which needs 0 to {duration:g} s; make the field longer or the run shorter"
            )
        across = np.zeros((len(self.disc), 0)) if self.across is None else self.across
        samples = np.concatenate([self.amplitudes, self.disc, across], axis=1)
        own = self.start + self.time_step * np.arange(len(samples) + self.periodic)
        if self.periodic:
            samples = np.concatenate([samples, samples[:1]])
        time = self.time_step * np.arange(math.ceil(duration / self.time_step - 1e-9) + 1)
        ends = "periodic" if self.periodic else "not-a-knot"
        values = CubicSpline(own, samples, bc_type=ends)(time if self.periodic else np.minimum(time, own[-1]))
        width, rest = self.amplitudes.shape[1], across.shape[1]
        return (
            values[:, :width],
            values[:, width : values.shape[1] - rest],
            values[:, values.shape[1] - rest :],
        )


@dataclass(frozen=True)
class RotorPlane:
    """The plane of the rotor, its apex at `x` downwind of the tower (an upwind rotor with an overhang of 5 m: -5) and `hub_height` [m].

    It leans by `tilt` [rad] (OpenFAST's ShftTilt, negative for an upwind rotor: the top is farther downwind); the field blows past the
    nacelle's axis by `yaw` and `upflow` [rad] (`wind.direction`), turned about the tower at hub height as OpenFAST turns it.
    """

    hub_height: float
    x: float = 0.0
    tilt: float = 0.0
    yaw: float = 0.0
    upflow: float = 0.0

    def places(self, across: np.ndarray, above: np.ndarray) -> np.ndarray:
        """(3, n): x, y and height in the field [m] of points to the left and above the apex (n,) [m]."""
        points = np.stack([self.x - np.tan(self.tilt) * above, across, above])
        along, left, height = directions(self.yaw, self.upflow) @ points
        return np.stack([along, left, self.hub_height + height])

    def behind(self, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        """(ny, nz): how far [m] downwind of `x` the plane lies at the lines of a field's grid."""
        # the plane is flat in the field, too: three of its points say how it leans
        (x0, y0, z0), *others = self.places(np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])).T
        sides = np.array(others) - (x0, y0, z0)
        slopes = np.linalg.solve(sides[:, 1:], sides[:, 0])
        return x0 - self.x + slopes[0] * (y[:, None] - y0) + slopes[1] * (z[None] - z0)


def harmonics_of(
    wind_field: WindField,
    hub_height: float,
    rotor_radius: float,
    radii: Any,
    weight: Any,
    harmonics: int,
    *,
    x: float = 0.0,
    tilt: float = 0.0,
    yaw: float = 0.0,
    upflow: float = 0.0,
) -> FieldHarmonics:
    """The field's azimuthal amplitudes on the rotor in time, M = `harmonics`; lengths in m.

    radii, weight (k,): the share of each radius as in `radial_shares`. The rotor plane stands in the field as `RotorPlane` says.
    Raises InputError for a grid that does not cover the rotor or belongs to another hub, and for weights and M out of bounds.
    """
    harmonics = whole_harmonics(harmonics)
    radii, weight = radial_shares(radii, weight, rotor_radius)
    wind_field.refuse_rotor(hub_height, rotor_radius)
    plane = RotorPlane(hub_height, x, tilt, yaw, upflow)
    lead = -plane.behind(wind_field.y, wind_field.z) / wind_field.mean_speed / wind_field.time_step
    u, first = _leaning(wind_field.u - _profile_on_grid(wind_field), lead, wind_field.periodic)
    rotor = hub_height, rotor_radius, radii, weight, harmonics
    matrix = projection_matrix(wind_field.y, wind_field.z, plane, *rotor[1:])
    values = u.reshape(len(u), -1) @ matrix.T.astype(np.float32)
    values = values.astype(float) + _profile_on_rotor(wind_field, *rotor)
    start = first * wind_field.time_step - wind_field.delay(x)
    if wind_field.periodic:
        start %= wind_field.length
        start -= wind_field.length if start > 0 else 0.0
    return FieldHarmonics(
        wind_field.time_step,
        values[:, : 1 + 2 * harmonics],
        values[:, 1 + 2 * harmonics :],
        wind_field.mean_speed,
        wind_field.source,
        start=start,
        periodic=wind_field.periodic,
        notes=wind_field.notes + _coarse(wind_field, radii, weight, harmonics),
        hub_intensity=wind_field.intensity_at(hub_height),
    )


def _profile_on_grid(wind_field: WindField) -> np.ndarray:
    """The mean profile (nz,) [m/s] that is not to be interpolated between the grid's heights; zero if it is."""
    if wind_field.profile is None:
        return np.zeros(len(wind_field.z), np.float32)
    factor = wind_field.profile.factor(wind_field.z, wind_field.reference_height)
    return (wind_field.mean_speed * factor).astype(np.float32)


def _profile_on_rotor(
    wind_field: WindField,
    hub_height: float,
    rotor_radius: float,
    radii: np.ndarray,
    weight: np.ndarray,
    harmonics: int,
) -> np.ndarray:
    """What that profile adds to amplitudes and disc fit, (1 + 2 M + 3,) [m/s]."""
    profile, reference = wind_field.profile, wind_field.reference_height
    if profile is None:
        return np.zeros(4 + 2 * harmonics)
    blades = profile_amplitudes(profile, hub_height, radii, weight, harmonics, reference)
    disc = profile_disc_fit(profile, hub_height, rotor_radius, reference)
    return wind_field.mean_speed * np.concatenate([blades, disc])


def _coarse(wind_field: WindField, radii: np.ndarray, weight: np.ndarray, harmonics: int) -> tuple[str, ...]:
    """A note where the grid has fewer than two points per period of the highest harmonic."""
    spacing = max(wind_field.y[1] - wind_field.y[0], wind_field.z[1] - wind_field.z[0])
    resolved = int(np.pi * (weight @ radii) / spacing)
    if harmonics <= resolved:
        return ()
    return (
        f"{wind_field.source}: points every {spacing:g} m hold azimuthal harmonics up to {resolved} on this rotor; "
        f"the higher ones of the {harmonics} are what is left by interpolation.",
    )


def _leaning(u: np.ndarray, lead: np.ndarray, periodic: bool) -> tuple[np.ndarray, float]:
    """The field on a leaning plane: what point (j, k) has lead[j, k] samples later; (field, first sample).

    Linear in time between samples, as OpenFAST reads them. Without a period both ends get shorter.
    """
    if not lead.any():
        return u, 0.0
    nt = len(u)
    whole = np.floor(lead).astype(int)
    first, last = (0, nt) if periodic else (max(0, -whole.min()), nt - 1 - max(0, whole.max()))
    if last - first < 2:
        return u[:0], 0.0
    out = np.empty((last - first, *u.shape[1:]), np.float32)
    # a rotor that is not turned has the same lead all along a row of the grid, which is faster as a whole
    columns = [slice(None)] if (lead == lead[:1]).all() else [slice(j, j + 1) for j in range(len(lead))]
    for j in columns:
        for k in range(lead.shape[1]):
            shift, part = whole[j, k][0], np.float32((lead - whole)[j, k][0])
            index = np.arange(first + shift, last + shift + 1)
            row = u[index % nt, j, k] if periodic else u[index[0] : index[-1] + 1, j, k]
            out[:, j, k] = row[:-1] + part * (row[1:] - row[:-1])
    return out, float(first)


def projection_matrix(
    y: np.ndarray,
    z: np.ndarray,
    plane: RotorPlane,
    rotor_radius: float,
    radii: np.ndarray,
    weight: np.ndarray,
    harmonics: int,
) -> np.ndarray:
    """(1 + 2 M + 3, ny * nz): times a plane of the field (ny, nz) it is its amplitudes and disc fit."""
    rho, mean, slope = disc_rule()
    rows = analysis_rows(max(harmonics, 1))
    matrix = np.zeros((4 + 2 * harmonics, len(y) * len(z)))
    for radius, share in zip(radii, weight, strict=True):
        circle = _circle(y, z, plane, radius)
        matrix[: 1 + 2 * harmonics] += share * _spread(circle, rows[: 1 + 2 * harmonics], matrix.shape[1])
    shares = np.stack([mean, slope, -slope], axis=1)
    for fraction, share in zip(rho, shares, strict=True):
        circle = _circle(y, z, plane, fraction * rotor_radius)
        matrix[1 + 2 * harmonics :] += share[:, None] * _spread(circle, rows[:3], matrix.shape[1])
    return matrix


def _circle(
    y: np.ndarray, z: np.ndarray, plane: RotorPlane, radius: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Grid points and their shares in the wind at the azimuths of a circle: four corners, (AZIMUTHS,) each."""
    psi = azimuth_grid()
    _, across, height = plane.places(-radius * np.sin(psi), radius * np.cos(psi))
    j, b = _between(y, across)
    k, c = _between(z, height)
    place = j * len(z) + k
    return [
        (place, (1 - b) * (1 - c)),
        (place + 1, (1 - b) * c),
        (place + len(z), b * (1 - c)),
        (place + len(z) + 1, b * c),
    ]


def _between(lines: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The grid line below each place and the fraction of the way to the next one."""
    scaled = np.clip((at - lines[0]) / (lines[1] - lines[0]), 0.0, len(lines) - 1.0)
    below = np.minimum(scaled.astype(int), len(lines) - 2)
    return below, scaled - below


def _spread(circle: list[tuple[np.ndarray, np.ndarray]], rows: np.ndarray, points: int) -> np.ndarray:
    """(rows, points): the analysis over a circle's azimuths, spread over the grid."""
    return np.stack([sum(np.bincount(p, row * share, points) for p, share in circle) for row in rows])
