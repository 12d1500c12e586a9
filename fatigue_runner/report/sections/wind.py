"""Which wind blew: its model, how strong it is at a point and how much of that the rotor's mean keeps, and what it leaves out."""

from __future__ import annotations

from collections.abc import Sequence

from fatigue_runner.report.blocks import Block, Column, Paragraph, Section, Table, TableRow, Warnings
from fatigue_runner.report.rundata import Run, WindCase
from fatigue_runner.results.cells import Row, number, text

ORDER = 25
MOST = 24  # mean speeds in the table; a random sweep has hundreds

COLUMNS = (
    Column("Mean wind", "m/s"),
    Column("Winds"),
    Column("σ at a point", "m/s, of the mean"),
    Column("σ of the rotor's mean", "m/s, of the mean"),
    Column("Harmonics"),
    Column("Shear", "α, or linear"),
    Column("File", number=False),
)
CAPTION = (
    "Standard deviation σ of the longitudinal wind. A turbulence intensity is that of a point at the hub; eddies smaller than the "
    "rotor average out over it, so its mean, of which the tip-speed ratio is made, keeps less: as it blew in the counted time (a short "
    "one misses slow gusts), root mean square over the winds. A file's series is taken for the whole rotor, and its intensity is its "
    "own. Harmonics: what of the rest the blades feel, each at its own azimuth."
)


def build(run: Run) -> Section | None:
    """A paragraph, a table by mean wind speed where the wind is turbulent, and what is to be known of wind files."""
    blocks: list[Block] = [Paragraph(sentence) for sentence in _sentences(run)]
    table = _table(run.winds)
    blocks += [table] if table.rows else []
    notes = run.wind_words("notes")
    blocks += [Warnings(notes)] if notes else []
    return Section("The wind", blocks) if blocks else None


def _sentences(run: Run) -> list[str]:
    found = [f"{_capital(words)}." for words in run.wind_words("descriptions")]
    counts = sorted({int(m) for wind in run.winds if (m := _of(wind, "harmonics")) is not None})
    if counts[-1:] > [1]:
        many = " or ".join(f"{m}" for m in counts)
        found.append(
            f"Each blade feels, at its own azimuth, {many} azimuthal harmonics of what differs over the rotor."
        )
    left_out = run.wind_words("left_out")
    found += [f"Left out: {'; or '.join(left_out)}."] if left_out else []
    return [" ".join(found)] if found else []


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]


def _of(wind: WindCase, column: str) -> float | None:
    return number(wind.rows[0], column)


def _table(winds: Sequence[WindCase]) -> Table:
    """A row per mean wind speed, file and count of harmonics; only winds that have an intensity."""
    groups: dict[tuple[float, str, str], list[WindCase]] = {}
    for wind in winds:
        if wind.speed is not None and _of(wind, "turbulence_intensity"):
            key = wind.speed, text(wind.rows[0], "wind_file"), text(wind.rows[0], "harmonics")
            groups.setdefault(key, []).append(wind)
    chosen = list(groups.items())
    caption = CAPTION
    if len(chosen) > MOST:
        picked = sorted({round(i * (len(chosen) - 1) / (MOST - 1)) for i in range(MOST)})
        caption += f" {len(picked)} of {len(chosen)} rows; all winds stand in results.csv."
        chosen = [chosen[i] for i in picked]
    return Table(COLUMNS, [TableRow(_cells(*item)) for item in chosen], caption)


def _cells(key: tuple[float, str, str], winds: Sequence[WindCase]) -> list[str]:
    speed, file, harmonics = key
    point = _rms([_of(wind, "turbulence_intensity") for wind in winds])
    # one figure per wind: every integrator blew in the same one
    rotor = _rms(
        [next(filter(None, (number(row, "rotor_intensity") for row in wind.rows)), None) for wind in winds]
    )
    return [
        f"{speed:.4g}",
        f"{len(winds)}",
        _strength(point, speed),
        _strength(rotor, speed),
        harmonics or "–",
        _shear(winds[0].rows[0]),
        file or "–",
    ]


def _rms(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return (sum(value**2 for value in known) / len(known)) ** 0.5 if known else None


def _strength(intensity: float | None, speed: float) -> str:
    return "–" if intensity is None else f"{intensity * speed:.2f} ({intensity:.1%})".replace("%", "\u00a0%")


def _shear(row: Row) -> str:
    exponent, linear = number(row, "shear_exponent"), number(row, "vertical_shear")
    if exponent is not None:
        return f"α {exponent:.3g}"
    return "–" if linear is None else f"{linear:.3g}"
