"""Small wind files in every format, written from the formats' descriptions and not with the package's code."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np


def some_field(nt=40, ny=7, nz=6, mean=9.0, seed=1):
    """Wind (nt, ny, nz) [m/s] whose mean at every point is `mean`, different everywhere in time and space."""
    u = np.random.default_rng(seed).normal(0.0, 1.2, (nt, ny, nz))
    return mean + u - u.mean(axis=0)


def write_bts(
    path: Path,
    u,
    *,
    form=7,
    spacing=(10.0, 12.0),
    time_step=0.25,
    mean=9.0,
    hub=50.0,
    base=None,
    tower=0,
    order="<",
    slope=None,
):
    """TurbSim: header, description, then per time three components over y, then z, and the tower's points."""
    nt, ny, nz = u.shape
    dy, dz = spacing
    base = hub - dz * (nz - 1) / 2 if base is None else base
    scale = 60000 / (u.max() - u.min()) if slope is None else slope
    offset = -30000 - scale * u.min()
    text = b"made for a test"
    head = struct.pack(f"{order}h4i6f", form, nz, ny, tower, nt, dz, dy, time_step, mean, hub, base)
    head += struct.pack(f"{order}6fi", scale, offset, 1.0, 0.0, 1.0, 0.0, len(text)) + text
    blocks = np.full((nt, 3 * (ny * nz + tower)), 77, f"{order}i2")
    blocks[:, : 3 * ny * nz : 3] = np.rint(u * scale + offset).transpose(0, 2, 1).reshape(nt, -1)
    path.write_bytes(head + blocks.tobytes())
    return path


SUMMARY = """
This summary file was made for a test.

{ny:10d}  Horizontal grid-point matrix dimension
{nz:10d}  Vertical grid-point matrix dimension
{step:10.3f}  Time step [seconds]
{clockwise}  Clockwise rotation when looking downwind?
{hub:10.3f}  Hub height [m]
   Mean wind speed at hub height = 1.0 m/s

   UBar  = {mean:9.4f} m/s
   TI(u) = {intensity:9.4f} %
   TI(v) = 80.0 %
   TI(w) = 50.0 %

   Height Offset = {offset:9.4f} m
   Grid Base     = 1.0 m
{tail}
"""


def write_bladed(
    path: Path,
    u,
    *,
    spectrum=4,
    spacing=(10.0, 12.0),
    time_step=0.25,
    mean=9.0,
    hub=50.0,
    intensity=15.0,
    clockwise=False,
    periodic=False,
    offset=0.0,
    order="<",
    said=None,
):
    """Bladed: `spectrum` 1 ... 8 for the format -99, -1 or -3 for the old one; `said` contradicts in the summary."""
    nt, ny, nz = u.shape
    dy, dz = spacing
    dx = time_step * mean
    components = {1: 1, 2: 1, -1: 1}.get(spectrum, 3)
    if spectrum < 0:
        numbers = [1000 * dz, 1000 * dy, 1000 * dx, nt // 2, 10 * mean, 0, 0, 0, 0, 1, 1000 * nz, 1000 * ny]
        head = struct.pack(f"{order}13h", spectrum, *(round(n) for n in numbers))
        head += bytes(12 if spectrum == -3 else 0)
    else:
        head = struct.pack(f"{order}2h", -99, spectrum)
        if spectrum == 4:
            head += struct.pack(f"{order}i6f", components, 45.0, 0.03, hub, intensity, 12.0, 8.0)
        elif spectrum in (7, 8):
            head += struct.pack(f"{order}2i", 0, components)
        head += struct.pack(
            f"{order}3fi4f4i", dz, dy, dx, nt // 2, mean, 1.0, 1.0, 1.0, 0, 4711, nz, ny
        ) + bytes((24 if components == 3 else 0) + {7: 8, 8: 64}.get(spectrum, 0))
    raw = np.full((nt, nz, ny, components), 99, f"{order}i2")
    across = slice(None, None, -1 if clockwise else 1)
    scaled = (u - mean) / (mean * intensity / 100) * 1000
    raw[..., 0] = np.rint(scaled).transpose(0, 2, 1)[:, :, across]
    path.write_bytes(head + raw.tobytes())
    summary = {
        "ny": ny,
        "nz": nz,
        "step": time_step,
        "hub": hub,
        "mean": mean,
        "intensity": intensity,
        "offset": offset,
        "clockwise": "T" if clockwise else "F",
        "tail": "Creating a PERIODIC output file." if periodic else "",
    }
    path.with_suffix(".sum").write_text(SUMMARY.format(**summary | (said or {})))
    return path


def write_box(path: Path, u, order="<"):
    """HAWC2: x slowest, y from left (positive) to right, z upwards; fluctuation only."""
    path.write_bytes(np.ascontiguousarray(u[:, ::-1], f"{order}f4").tobytes())
    return path
