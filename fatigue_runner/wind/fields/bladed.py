"""Bladed-style full-field binary `.wnd` with the summary `.sum` that TurbSim writes beside it.

The binary holds 2-byte integers; a thousand of them are one standard deviation, turbulence intensity times
mean speed. Mean, intensities, hub height, periodicity and the direction of y stand in the summary, as in
OpenFAST's WindType 4. Headers: TurbSim user's guide, appendix D; Bladed's formats -1 ... -3 and -99.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.wind.fields.field import WindField, centred, grid
from fatigue_runner.wind.fields.files import Header, read_bytes, read_text, refuse_swapped, single

OLD, NEW = (-1, -2, -3), -99
FORMATS = (*OLD, NEW)
ONE_COMPONENT, THREE_COMPONENTS, VON_KARMAN, KAIMAL, MANN = (1, 2), (3, 5), 4, 7, 8


@dataclass(frozen=True)
class Binary:
    """What the binary's header says; `intensity` [%] only where it has one, `height` likewise."""

    components: int
    spacing: tuple[float, float, float]  # x, y, z [m]
    steps: int
    mean_speed: float
    points: tuple[int, int]  # y, z
    intensity: float | None = None
    height: float | None = None


@dataclass(frozen=True)
class Summary:
    """What the summary says, with the line of each number for messages."""

    path: Path
    hub_height: tuple[int, float]
    mean_speed: tuple[int, float]
    intensity: tuple[int, float]
    height_offset: float
    periodic: bool
    clockwise: bool
    points: dict[str, tuple[int, float]]


def is_bladed(data: bytes) -> bool:
    """Whether a `.wnd` file's first bytes are a Bladed binary's, in either byte order."""
    return len(data) >= 2 and any(
        int.from_bytes(data[:2], order, signed=True) in FORMATS for order in ("little", "big")
    )


def read_bladed(path: str | Path) -> WindField:
    """The longitudinal wind of a `.wnd` binary and its `.sum`, as OpenFAST's WindType 4 reads them.

    Raises InputError for another format or byte order, a missing or incomplete summary, and where the two say
    different things.
    """
    path = Path(path)
    data = read_bytes(path)
    refuse_swapped(path, data, FORMATS, "Bladed")
    header = Header(path, data)
    binary = _header(header)
    summary = _summary(path)
    _compare(path, binary, summary)
    raw = _integers(header, binary)
    intensity = _stated(binary.intensity) or summary.intensity[1]  # OpenFAST, too, prefers the binary's
    u = np.float32(binary.mean_speed) + np.float32(1e-5 * binary.mean_speed * intensity) * raw
    if summary.clockwise:
        u = np.ascontiguousarray(u[:, ::-1])
    (dx, dy, dz), (ny, nz) = binary.spacing, binary.points
    y = centred(ny, dy)
    centre = summary.hub_height[1] - summary.height_offset
    return WindField(
        time_step=single(dx / binary.mean_speed),
        y=y,
        z=grid(nz, dz, centre - dz * (nz - 1) / 2),
        u=u,
        mean_speed=binary.mean_speed,
        reference_height=summary.hub_height[1],
        periodic=summary.periodic,
        source=path,
        upstream=0.0 if summary.periodic else float(y[-1]),
    )


def _header(header: Header) -> Binary:
    (form,) = header.take("h")
    if form in OLD:
        dz, dy, dx, half, mean, *_ = header.take("5h")
        header.skip(10)  # length scales, an unused number, the seed
        nz, ny = header.take("2h")
        header.skip(12 if form == -3 else 0)
        spacing = (dx / 1000, dy / 1000, dz / 1000)
        return _sensible(header.path, Binary(-form, spacing, 2 * half, mean / 10, (ny // 1000, nz // 1000)))
    if form != NEW:
        raise InputError(
            f"{header.path}: this is not a Bladed .wnd file: it begins with {form} instead of one of "
            f"{FORMATS}; check what made it"
        )
    (spectrum,) = header.take("h")
    intensity, height = None, None
    if spectrum in ONE_COMPONENT:
        components = 1
    elif spectrum in THREE_COMPONENTS:
        components = 3
    elif spectrum == VON_KARMAN:
        components, _, _, height, intensity, *_ = header.take("i6f")
    elif spectrum in (KAIMAL, MANN):
        _, components = header.take("2i")
    else:
        raise InputError(
            f"{header.path}: the turbulence type {spectrum} of this Bladed file is unknown; 1 to 5, 7 and 8 are read"
        )
    dz, dy, dx, half, mean, *_, nz, ny = header.take("3fi4f4i")
    header.skip((24 if components == 3 else 0) + {KAIMAL: 8, MANN: 64}.get(spectrum, 0))
    binary = Binary(components, (dx, dy, dz), 2 * half, single(mean), (ny, nz), intensity, height)
    return _sensible(header.path, binary)


def _sensible(path: Path, binary: Binary) -> Binary:
    if not (
        binary.components in (1, 2, 3)
        and min(*binary.spacing, *binary.points, binary.steps) > 0
        and binary.mean_speed > 0
    ):
        (dx, dy, dz), (ny, nz) = binary.spacing, binary.points
        raise InputError(
            f"{path}: the header makes no sense: {binary.steps} times, {ny} x {nz} points, spacing {dx:g} x {dy:g} x "
            f"{dz:g} m, mean {binary.mean_speed:g} m/s, {binary.components} components; make the file anew"
        )
    return binary


def _integers(header: Header, binary: Binary) -> np.ndarray:
    """First component (nt, ny, nz) of the integers; the header counts steps in pairs, one more may follow."""
    ny, nz = binary.points
    block = binary.components * ny * nz
    found, rest = divmod(len(header.data) - header.position, 2 * block)
    if rest or found - binary.steps not in (0, 1):
        raise InputError(
            f"{header.path}: the header says {binary.steps} or {binary.steps + 1} times of {ny} x {nz} points, but the "
            f"file holds {found + rest / (2 * block):.6g}; it was cut off or written wrongly, make it anew"
        )
    raw = np.frombuffer(header.data, "<i2", offset=header.position).reshape(found, block)
    u = raw[:, :: binary.components].reshape(found, nz, ny).transpose(0, 2, 1)
    return u.astype(np.float32, order="C")


# What the summary must say and may say; the number stands before the words, or behind the equals sign.
LEADING = {
    "hub": re.compile(r"HUB HEIGHT|ZHUB", re.IGNORECASE),
    "nz": re.compile(r"VERTICAL GRID-POINT", re.IGNORECASE),
    "ny": re.compile(r"HORIZONTAL GRID-POINT", re.IGNORECASE),
    "step": re.compile(r"TIME STEP \[SECONDS\]", re.IGNORECASE),
}
BEHIND = {
    "mean": re.compile(r"UBAR", re.IGNORECASE),
    "intensity": re.compile(r"TI\(U\)", re.IGNORECASE),
    "offset": re.compile(r"HEIGHT OFFSET", re.IGNORECASE),
}


def summary_of(path: Path) -> Path | None:
    """The summary that lies beside a `.wnd`, if there is one."""
    beside = (path.with_suffix(suffix) for suffix in (".sum", ".SUM"))
    return next((p for p in beside if p.exists()), None)


def _summary(path: Path) -> Summary:
    """The `.sum` beside a `.wnd`; raises InputError where it is missing or lacks a number."""
    place = summary_of(path)
    if place is None:
        raise InputError(
            f"{path}: the scale of its integers stands in {path.stem}.sum, which is missing; put it beside the .wnd, "
            "or make a .bts"
        )
    found: dict[str, tuple[int, float]] = {}
    lines = read_text(place)
    for number, line in enumerate(lines, 1):
        for key, words in LEADING.items():
            if key not in found and words.search(line):
                found[key] = number, _number(place, number, line)
        for key, words in BEHIND.items():
            if key not in found and words.search(line) and "=" in line:
                found[key] = number, _number(place, number, line.split("=", 1)[1])
    for key, said in (("hub", "hub height"), ("mean", "UBar"), ("intensity", "TI(u)")):
        if key not in found:
            raise InputError(
                f"{place}: no line says '{said}', without which {path.name} cannot be read; "
                "make the summary and the field anew together"
            )
    clockwise = next((line.split() for line in lines if "clockwise" in line.lower()), [""])
    return Summary(
        path=place,
        hub_height=found["hub"],
        mean_speed=found["mean"],
        intensity=found["intensity"],
        height_offset=found.get("offset", (0, 0.0))[1],
        periodic=any(
            "periodic" in line.lower() for line in lines[found.get("offset", (len(lines), 0.0))[0] :]
        ),
        clockwise=clockwise[0][:1].upper() in ("T", "Y"),
        points={key: found[key] for key in ("ny", "nz", "step") if key in found},
    )


def _number(path: Path, line: int, text: str) -> float:
    """The number that a text begins with."""
    match = re.match(r"\s*([-+]?\d*\.?\d+(?:[eE][-+]?\d+)?)", text)
    if not match:
        raise InputError(f"{path}:{line}: a number was expected, got {text.strip()!r}; make the summary anew")
    return float(match.group(1))


def _compare(path: Path, binary: Binary, summary: Summary) -> None:
    """Raises InputError where summary and binary do not belong together; OpenFAST compares the means only."""
    ny, nz = binary.points
    pairs = [
        ("a mean wind speed", summary.mean_speed, binary.mean_speed, 0.1, "m/s"),
        ("a turbulence intensity", summary.intensity, _stated(binary.intensity), 0.01, "%"),
        ("a hub height", summary.hub_height, _stated(binary.height), 0.01, "m"),
        ("as number of points across", summary.points.get("ny"), ny, 0.5, ""),
        ("as number of points upwards", summary.points.get("nz"), nz, 0.5, ""),
        ("a time step", summary.points.get("step"), binary.spacing[0] / binary.mean_speed, 1e-3, "s"),
    ]
    for what, said, there, tolerance, unit in pairs:
        if said is not None and there is not None and abs(said[1] - there) > tolerance:
            raise InputError(
                f"{summary.path}:{said[0]}: the summary says {what} of {said[1]:g} {unit}".rstrip()
                + f", but {path.name} has {there:g} {unit}".rstrip()
                + "; the two were not made together"
            )


def _stated(value: float | None) -> float | None:
    """A header's number, None where it only fills the place."""
    return value if value and value > 0 else None
