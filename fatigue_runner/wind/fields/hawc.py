"""HAWC2's turbulence boxes: single-precision floats of one component, nothing else in the file.

Order of the numbers: x slowest (the first plane is the one that arrives first), then y from left to right
looking downwind, then z upwards; as OpenFAST's WindType 5 reads them and TurbSim writes them. Sizes, mean wind,
scale and profile stand elsewhere, in HAWC2's `htc` or TurbSim's `.hawc`, and are given as a `MannBox`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.wind.checks import number
from fatigue_runner.wind.fields.field import WindField, centred, grid
from fatigue_runner.wind.fields.files import read_bytes, read_text
from fatigue_runner.wind.profiles import PowerLaw, Profile

DESCRIPTIONS = (".hawc", ".htc")  # text that names the u component's file and its sizes
DIMENSIONS = ("box_dim_u", "box_dim_v", "box_dim_w")  # along x, y, z
FASTEST = 200.0  # m/s: no box has such a wind, but floats read in the wrong order do


@dataclass(frozen=True)
class MannBox:
    """What a box does not say itself: its mean wind, where it stands, how large its turbulence is.

    `mean_speed` [m/s] at `reference_height` [m], the middle of the box; `points` and `spacing` [m] along
    (x, y, z), needed where no .hawc or .htc says them; `profile` of the mean wind that is added (None: the same
    at every height). Turbulence is taken as it is, or times `scale`, or scaled to the standard deviation
    `sigma` [m/s] at the middle; the last two take each point's own mean away first, as OpenFAST does. The box
    starts `upstream` [m] of the tower. Raises InputError for what is not positive, and for scale with sigma.
    """

    mean_speed: float
    reference_height: float
    points: tuple[int, ...] | None = None
    spacing: tuple[float, ...] | None = None
    profile: Profile | None = None
    scale: float | None = None
    sigma: float | None = None
    upstream: float = 0.0

    def __post_init__(self) -> None:
        number("Mann box: mean_speed", self.mean_speed, above=0.0, unit=" m/s")
        number("Mann box: reference_height", self.reference_height, above=0.0, unit=" m")
        number("Mann box: upstream", self.upstream, unit=" m")
        for name in ("scale", "sigma"):
            if getattr(self, name) is not None:
                number(f"Mann box: {name}", getattr(self, name), at_least=0.0)
        if self.scale is not None and self.sigma is not None:
            raise InputError("a Mann box takes a scale or a sigma, not both; leave one out")
        for name, kind in (("points", int), ("spacing", float)):
            given: Any = getattr(self, name)
            if given is None:
                continue
            three = isinstance(given, tuple | list) and len(given) == 3
            if not three or not all(isinstance(v, int | kind) and v > 0 for v in given):
                raise InputError(
                    f"Mann box: {name} must be three positive numbers along x, y, z, got {given!r}"
                )


def read_hawc(path: str | Path, box: MannBox) -> WindField:
    """The longitudinal wind of a box: `path` is the u component's binary, or a .hawc or .htc that names it.

    Raises InputError for sizes that nobody says or that do not fit the file, for bytes in the wrong order, and
    for a box without turbulence that is to be scaled.
    """
    path = Path(path)
    if path.suffix.lower() in DESCRIPTIONS:
        path, box = _described(path, box)
    if box.points is None or box.spacing is None:
        raise InputError(
            f"{path}: a Mann box does not say its size; give points and spacing along x, y, z, or name the .hawc or "
            ".htc that has them"
        )
    (nx, ny, nz), (dx, dy, dz) = box.points, box.spacing
    u = _floats(path, (nx, ny, nz))[:, ::-1]
    if box.scale is not None or box.sigma is not None:
        u = _scale(path, u, box) * (u - u.mean(axis=0, dtype=float).astype(np.float32))
    profile = box.profile or PowerLaw(0.0)
    z = grid(nz, dz, box.reference_height - dz * (nz - 1) / 2)
    if not z[0] > 0:
        raise InputError(
            f"{path}: a box of {nz} points every {dz:g} m around {box.reference_height:g} m reaches into the ground; "
            "raise reference_height or check the spacing"
        )
    mean = box.mean_speed * profile.factor(z, box.reference_height)
    return WindField(
        time_step=dx / box.mean_speed,
        y=centred(ny, dy),
        z=z,
        u=np.ascontiguousarray(u + mean.astype(np.float32)),
        mean_speed=box.mean_speed,
        reference_height=box.reference_height,
        periodic=True,
        source=path,
        upstream=box.upstream,
        profile=profile,
    )


def _floats(path: Path, shape: tuple[int, int, int]) -> np.ndarray:
    data = read_bytes(path)
    expected = 4 * shape[0] * shape[1] * shape[2]
    if len(data) != expected:
        raise InputError(
            f"{path}: a box of {shape[0]} x {shape[1]} x {shape[2]} points has {expected} bytes, but the file has "
            f"{len(data)}; check the sizes, or make the file anew"
        )
    values = np.frombuffer(data, "<f4").reshape(shape)
    if not _plausible(values) and _plausible(values.view(">f4")):
        raise InputError(
            f"{path}: the floats of this box stand in big-endian order; write it in little-endian order, as HAWC2 "
            "and OpenFAST read it"
        )
    return values


def _plausible(values: np.ndarray) -> bool:
    """Whether these could be wind speeds: floats in the wrong byte order are huge, tiny or NaN at once."""
    with np.errstate(invalid="ignore", over="ignore"):
        size = np.abs(values.astype(float))
        return bool(np.isfinite(size).all() and size.max() < FASTEST and np.mean(size > 1e-9) > 0.5)


def _scale(path: Path, u: np.ndarray, box: MannBox) -> np.float32:
    """The factor on the turbulence: OpenFAST's ScaleMethod 1 or 2."""
    if box.scale is not None:
        return np.float32(box.scale)
    _, ny, nz = u.shape
    found = float(u[:, (ny - 1) // 2, (nz - 1) // 2].astype(float).std())
    if not found > 0:
        raise InputError(
            f"{path}: the middle of the box has no turbulence (standard deviation {found:g}), so none of "
            f"{box.sigma:g} m/s can be made of it; take another box"
        )
    return np.float32((box.sigma or 0.0) / found)


def described_file(path: Path) -> Path:
    """The u component's file of a .hawc or .htc; raises InputError where it names none."""
    return path.parent / _said(path)["filename_u"][0]


def _said(path: Path) -> dict[str, list[str]]:
    """The words behind `filename_u` and DIMENSIONS in a .hawc or .htc, between `begin mann` and `end mann`."""
    said: dict[str, list[str]] = {}
    for line in read_text(path):
        key, *words = line.split(";", 1)[0].split() or [""]
        if key in ("filename_u", *DIMENSIONS) and words:
            said[key] = words
    for key in ("filename_u", *DIMENSIONS):
        if key not in said:
            raise InputError(
                f"{path}: no line says {key}; it must describe a turbulence box (begin mann ...)"
            )
    return said


def _described(path: Path, box: MannBox) -> tuple[Path, MannBox]:
    """File of the u component and the sizes that a .hawc or .htc says."""
    said = _said(path)
    try:
        points = tuple(int(said[key][0]) for key in DIMENSIONS)
        spacing = tuple(float(said[key][1]) for key in DIMENSIONS)
    except (IndexError, ValueError):
        raise InputError(
            f"{path}: a line of the box cannot be read; filename_u has a name, box_dim_u, _v and _w have a number of "
            "points and a spacing each"
        ) from None
    for given, here, what in ((box.points, points, "points"), (box.spacing, spacing, "spacing")):
        if given is not None and not np.allclose(given, here, rtol=1e-4):
            raise InputError(f"{path}: it says {what} {here}, but {given} are asked for; leave them out")
    return described_file(path), replace(box, points=points, spacing=spacing)
