"""TurbSim's full-field binary, `.bts` (TurbSim user's guide, appendix E; format 7, or 8 where periodic)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.wind.fields.field import WindField, centred, grid
from fatigue_runner.wind.fields.files import Header, read_bytes, refuse_swapped, single

ONCE, PERIODIC = 7, 8
COMPONENTS = 3


def read_turbsim(path: str | Path) -> WindField:
    """The longitudinal wind of a `.bts` file, to the single-precision number that OpenFAST reads.

    The file's hub height is the reference height; its field starts half the grid's width upstream of the tower,
    as in OpenFAST, unless it is periodic. Tower points and the other two components are passed over. Raises
    InputError for another format, byte order, size than the header says, and a scale that is zero.
    """
    path = Path(path)
    data = read_bytes(path)
    refuse_swapped(path, data, (ONCE, PERIODIC), "TurbSim")
    header = Header(path, data)
    (form,) = header.take("h")
    if form not in (ONCE, PERIODIC):
        raise InputError(
            f"{path}: this is not a TurbSim .bts file: it begins with {form} instead of {ONCE} or "
            f"{PERIODIC}; check what made it"
        )
    nz, ny, n_tower, nt = header.take("4i")
    dz, dy, time_step, mean_speed, hub_height, base = header.take("6f")
    slope, offset, *_ = header.take("6f")
    (text,) = header.take("i")
    if min(nz, ny, nt) < 1 or min(n_tower, text) < 0 or not min(dz, dy) > 0 or slope == 0:
        raise InputError(
            f"{path}: the header makes no sense: {nt} times, {ny} x {nz} points, spacing {dy:g} x {dz:g} m, "
            f"scale {slope:g}; make the file anew"
        )
    header.skip(text)
    u = _longitudinal(header, (nt, ny, nz), n_tower, slope, offset)
    y = centred(ny, dy)
    return WindField(
        time_step=single(time_step),
        y=y,
        z=grid(nz, dz, base),
        u=u,
        mean_speed=single(mean_speed),
        reference_height=single(hub_height),
        periodic=form == PERIODIC,
        source=path,
        upstream=0.0 if form == PERIODIC else float(y[-1]),
    )


def _longitudinal(
    header: Header, shape: tuple[int, int, int], n_tower: int, slope: float, offset: float
) -> np.ndarray:
    """The first component (nt, ny, nz) [m/s] of the 2-byte integers behind the header."""
    nt, ny, nz = shape
    block = COMPONENTS * (ny * nz + n_tower)
    found = len(header.data) - header.position
    if found != 2 * block * nt:
        raise InputError(
            f"{header.path}: the header says {nt} times of {ny} x {nz} points ({2 * block * nt} bytes), but the file "
            f"holds {found / (2 * block):.6g} ({found} bytes); it was cut off or written wrongly, make it anew"
        )
    raw = np.frombuffer(header.data, "<i2", offset=header.position).reshape(nt, block)
    u = raw[:, : COMPONENTS * ny * nz : COMPONENTS].reshape(nt, nz, ny).transpose(0, 2, 1)
    return (u.astype(np.float32, order="C") - np.float32(offset)) / np.float32(slope)
