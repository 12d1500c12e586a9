"""One page of two runs: another turbine, corrector, integrator or wind, life beside life, load beside load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fatigue_runner.channels import BY_NAME
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.files import write_atomically
from fatigue_runner.report.blocks import Block, Column, Paragraph, Section, Table, TableRow, Warnings
from fatigue_runner.report.page import render_sections
from fatigue_runner.report.rundata import Run, load_run
from fatigue_runner.results import life_words as words
from fatigue_runner.results.cells import format_percent, number, text
from fatigue_runner.results.life_words import customary_exponent
from fatigue_runner.results.lifetime import Figure, Key, label_of
from fatigue_runner.results.ranking import integrator_key

NOT_COMPARED = ("name",)  # settings that may differ without a word


@dataclass(frozen=True)
class Pair:
    """What the page's head says."""

    name: str
    facts: list[tuple[str, str]]


def write_comparison(first: Path, second: Path, target: Path) -> Path:
    """Write the page of two run folders to `target`; raises InputError where one holds no results or both are the same."""
    if first.resolve() == second.resolve():
        raise InputError(f"{first} is compared with itself; give two run folders")
    a, b = load_run(first), load_run(second)
    try:
        write_atomically(target, render_comparison(a, b).encode())
    except OSError as error:
        raise InputError(
            f"{target} cannot be written: {error.strerror}; give --out a file in a folder that can"
        ) from None
    return target


def render_comparison(a: Run, b: Run) -> str:
    """The page of two runs as one HTML document."""
    names = _names(a, b)
    facts = [
        (f"{name} of {called}", value)
        for called, run in zip(names, (a, b), strict=True)
        for name, value in run.facts
        if name in ("Turbine", "Cases", "Finished")
    ]
    sections = [_answer(a, b), _settings(a, b), _lives(a, b), _loads(a, b)]
    return render_sections(Pair(f"{names[0]} and {names[1]}", facts), [s for s in sections if s is not None])


def _answer(a: Run, b: Run) -> Section:
    """In words: what the second run makes of the first one's life and loads."""
    said: list[Block] = []
    left, right = _names(a, b)
    pairs = _pairs(a, b)
    if pairs:
        (name, one, other, _) = max(pairs, key=lambda p: abs(_ratio(p[1], p[2]) - 1.0))
        change = _ratio(one, other) - 1.0
        beyond = [p for p in pairs if _beyond(p[1], p[2])]
        said.append(
            Paragraph(
                f"Of the lifetime loads {name} changes most from {left} to {right}: by {format_percent(change)}"
                + (
                    f"; {len(beyond)} of {len(pairs)} change by more than what the seeds of both leave."
                    if one.scatter
                    else "."
                ),
                strong=True,
            )
        )
    for place in _places(a, b):
        lives = [(run, called, _hot(run, place)) for run, called in ((a, left), (b, right))]
        shown = " and ".join(
            f"{words.years_text(None if run.life is None or figure is None else run.life.years_of(figure))} years in {called}"
            for run, called, figure in lives
        )
        said.append(Paragraph(f"{words.place_label(place).capitalize()}: {shown}."))
    if not said:
        said.append(
            Paragraph(
                "Neither run asks for a life; the short-term loads of the winds that both know stand below."
            )
        )
    return Section("What changed", said)


def _settings(a: Run, b: Run) -> Section:
    """Every setting of the two campaigns that differs."""
    rows = [
        TableRow([key, _short(one), _short(other)])
        for key, one, other in _differences(a.campaign, b.campaign)
        if key not in NOT_COMPARED
    ]
    for name in ("Turbine hash", "Versions"):
        one, other = (dict(run.facts).get(name, "") for run in (a, b))
        if one != other:
            rows.append(TableRow([name.lower(), one, other]))
    blocks: list[Block] = []
    left, right = _names(a, b)
    if rows:
        heads = [Column("Setting", number=False), Column(left, number=False), Column(right, number=False)]
        blocks.append(Table(heads, rows, "Settings that differ."))
    else:
        blocks.append(Paragraph("No setting differs."))
    if (
        a.life is not None
        and b.life is not None
        and [(w.low, w.high) for w in a.life.bins] != [(w.low, w.high) for w in b.life.bins]
    ):
        blocks.append(
            Warnings(
                ["The wind bins of the two lives differ: part of every change below is that of the bins."]
            )
        )
    return Section("What differs between the two", blocks)


def _lives(a: Run, b: Run) -> Section | None:
    """The lifetime loads and places of both, side by side."""
    pairs = _pairs(a, b)
    if not pairs:
        return None
    left, right = _names(a, b)
    heads = [
        Column("Lifetime load", number=False),
        Column(left),
        Column("seeds", "±"),
        Column(right),
        Column("seeds", "±"),
        Column("Unit", number=False),
        Column("Change"),
        Column("Beyond the seeds", number=False),
    ]
    rows = []
    for name, one, other, (scale, unit) in pairs:
        cells = [name]
        for figure in (one, other):
            cells += [
                f"{(figure.value or 0.0) * scale:.0f}",
                "–" if figure.scatter is None else format_percent(figure.scatter),
            ]
        beyond = _beyond(one, other)
        rows.append(
            TableRow(
                [*cells, unit, format_percent(_ratio(one, other) - 1.0), "yes" if beyond else "no"],
                "bad" if beyond else "",
            )
        )
    keys = " and ".join(
        f"{label_of(key)} in {called}"
        for called, key in ((left, _told(a)), (right, _told(b)))
        if key is not None
    )
    return Section(
        "Life beside life",
        [
            Table(
                heads,
                rows,
                f"By {keys}. Beyond the seeds: the change is larger than both half intervals together.",
            )
        ],
    )


def _loads(a: Run, b: Run) -> Section | None:
    """Short-term loads at the winds that both know, each at its customary exponent: the ratio's mean and extremes."""
    keys = [
        next(
            (s.key for s in run.summaries if s.is_reference), run.summaries[0].key if run.summaries else None
        )
        for run in (a, b)
    ]
    tables = [
        {
            (text(r, "wind_speed"), text(r, "seed"), text(r, "wind_file")): r
            for r in run.rows
            if integrator_key(r) == key and text(r, "status") == "done"
        }
        for run, key in zip((a, b), keys, strict=True)
    ]
    both = [wind for wind in tables[0] if wind in tables[1]]
    channels = dict.fromkeys(c for c, _, _ in a.columns if c in {d for d, _, _ in b.columns})
    left, right = _names(a, b)
    rows = []
    for channel in channels:
        exponents = [
            m for c, m, _ in a.columns if c == channel and (channel, m) in {(d, n) for d, n, _ in b.columns}
        ]
        if not exponents:
            continue
        m = customary_exponent(channel, exponents)
        column = f"del_{channel}_m{m:g}"
        ratios = [
            other / one
            for wind in both
            if (one := number(tables[0][wind], column))
            and (other := number(tables[1][wind], column)) is not None
        ]
        if ratios:
            label = BY_NAME[channel].label if channel in BY_NAME else channel
            mean = sum(ratios) / len(ratios)
            rows.append(
                TableRow(
                    [
                        label,
                        f"{m:g}",
                        f"{len(ratios)}",
                        *(f"{v:.4f}" for v in (mean, min(ratios), max(ratios))),
                    ]
                )
            )
    if not rows:
        return Section(
            "Load beside load", [Paragraph("The two runs have no wind in common (speed, seed and file).")]
        )
    heads = [
        Column("Channel", number=False),
        Column("m"),
        Column("Winds", "in both"),
        Column("Mean ratio"),
        Column("Smallest"),
        Column("Largest"),
    ]
    caption = f"Short-term DEL of {right} over that of {left}, wind by wind, where speed, seed and file are the same."
    return Section("Load beside load", [Table(heads, rows, caption)])


def _names(a: Run, b: Run) -> tuple[str, str]:
    """What the two are called: the campaigns' names, or the folders' where these are the same."""
    if a.name != b.name:
        return a.name, b.name
    return str(a.folder), str(b.folder)


def _told(run: Run) -> Key | None:
    return None if run.life is None else words.told(run.life)


def _pairs(a: Run, b: Run) -> list[tuple[str, Figure, Figure, tuple[float, str]]]:
    """Lifetime loads that both have: name, the two figures, scale and unit."""
    one, other = _told(a), _told(b)
    if a.life is None or b.life is None or one is None or other is None:
        return []
    found = []
    for figure in a.life.loads:
        twin = b.life.load(other, figure.name, figure.at)
        if figure.integrator == one and twin is not None and figure.value and twin.value:
            known = BY_NAME.get(figure.name)
            label = known.label if known else figure.name
            shown = (known.scale, known.read_unit) if known else (1.0, "")
            found.append((f"{label}, m = {figure.at:g}", figure, twin, shown))
    return found


def _ratio(one: Figure, other: Figure) -> float:
    return (other.value or 0.0) / (one.value or 1.0)


def _beyond(one: Figure, other: Figure) -> bool:
    """Whether a change is larger than what the seeds of both leave."""
    return abs(_ratio(one, other) - 1.0) > (one.scatter or 0.0) + (other.scatter or 0.0)


def _places(a: Run, b: Run) -> list[str]:
    return [] if a.life is None or b.life is None else [p for p in a.life.places if p in b.life.places]


def _hot(run: Run, place: str) -> Figure | None:
    key = _told(run)
    return None if run.life is None or key is None else run.life.hot_spot(key, place)


def _differences(one: Any, other: Any, path: str = "") -> list[tuple[str, Any, Any]]:
    """(dotted key, value, value) of everything that differs."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        keys = dict.fromkeys([*one, *other])
        return [
            d for k in keys for d in _differences(one.get(k), other.get(k), f"{path}.{k}" if path else str(k))
        ]
    return [] if one == other else [(path, one, other)]


def _short(value: Any) -> str:
    shown = "–" if value is None else str(value)
    return shown if len(shown) <= 80 else f"{shown[:77]}..."
