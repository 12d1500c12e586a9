"""The campaign as it fills: how many cases are done, running, failed, and their DELs over wind speed. No viewer is needed."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner.channels import BY_NAME
from fatigue_runner.naming import integrator_label
from fatigue_runner.results.cells import format_percent
from fatigue_runner.results.ranking import fatigue_columns
from fatigue_runner.results.relevance import relevant_errors
from fatigue_runner.viewer import colours

CHART = (160.0, 90.0)  # width and height of the chart, in its own units


@dataclass
class Overview:
    """Reads `cases.jsonl` of a run folder as it grows. jobs: case ids in the order of their start; workers: at a time."""

    folder: Path
    total: int
    jobs: Sequence[Sequence[str]] = ()
    workers: int = 1
    rows: dict[str, dict[str, Any]] = field(default_factory=dict)
    worst: dict[str, float] = field(
        default_factory=dict
    )  # DEL error of each integrator, as the verdict counts it
    trouble: str = ""  # why there is no turbine to show
    _read: int = 0

    def update(self) -> bool:
        """Take in the records that were added; True where there are any. A line that is not whole yet is left for later."""
        try:
            with (self.folder / "cases.jsonl").open("rb") as file:
                file.seek(0, 2)
                if file.tell() < self._read:  # begun anew with --fresh
                    self._read, self.rows, self.worst = 0, {}, {}
                file.seek(self._read)
                whole, newline, _ = file.read().rpartition(b"\n")
        except OSError:
            return False
        self._read += len(whole) + len(newline)
        found = [_row(line) for line in whole.split(b"\n") if line]
        new = {row["case_id"]: row for row in found if row}
        self.rows |= new
        for row in new.values():
            errors = relevant_errors(row, fatigue_columns([row])) if row.get("status") == "done" else {}
            if errors:
                name = integrator(row)
                self.worst[name] = max(self.worst.get(name, 0.0), *map(abs, errors.values()))
        return bool(found)

    def counts(self) -> dict[str, int]:
        """Numbers of cases: done, diverged, failed, running, waiting. Blocks are started in order, so those that run are the
        first ones that are not finished."""
        status = [row.get("status") for row in self.rows.values()]
        out = {name: status.count(name) for name in ("done", "diverged", "failed")}
        open_jobs = [[name for name in job if name not in self.rows] for job in self.jobs]
        out["running"] = sum(len(job) for job in [job for job in open_jobs if job][: self.workers])
        out["waiting"] = max(0, self.total - len(self.rows) - out["running"])
        return out

    def figure(self) -> str | None:
        """The column that the chart shows: blade 1's flapwise DEL at the highest exponent up to 10, else the first DEL."""
        names = next(
            (n for row in self.rows.values() if (n := [f"del_{s}" for *_, s in fatigue_columns([row])])), []
        )
        flap = [name for name in names if name.startswith("del_blade1_root_flapwise_moment_m")]
        flap = [name for name in flap if float(name.rpartition("_m")[2]) <= 10] or flap
        return (
            max(flap, key=lambda name: float(name.rpartition("_m")[2])) if flap else next(iter(names), None)
        )

    def points(self) -> dict[str, np.ndarray]:
        """(n, 2) wind speed [m/s] and DEL of the cases that are done, by integrator, the reference first."""
        name = self.figure()
        found: dict[str, list[tuple[float, float]]] = {}
        rows = sorted(self.rows.values(), key=lambda row: not row.get("is_reference"))
        for row in rows:
            if (
                name
                and row.get("status") == "done"
                and row.get(name) is not None
                and row.get("wind_speed") is not None
            ):
                found.setdefault(integrator(row), []).append((row["wind_speed"], row[name]))
        return {key: np.array(sorted(values)) for key, values in found.items()}

    def text(self) -> str:
        """Markdown: counts, and a line per integrator with its worst DEL error so far."""
        counts = self.counts()
        finished = len(self.rows)
        bar = "█" * round(24 * finished / max(self.total, 1))
        lines = [
            f"## {finished} of {self.total} cases",
            f"`{bar:░<24}`",
            "",
            "| " + " | ".join(counts) + " |",
            "|" + "---|" * len(counts),
            "| " + " | ".join(str(value) for value in counts.values()) + " |",
            "",
            "| integrator | cases | worst DEL error |",
            "|---|---|---|",
        ]
        cases = Counter(map(integrator, self.rows.values()))
        for name, number in sorted(cases.items()):
            error = format_percent(max(self.worst[name], 1e-5)) if name in self.worst else "–"
            error = f"< {error}" if self.worst.get(name, 1.0) < 1e-5 else error
            lines.append(f"| {name} | {number} | {error} |")
        if self.worst:
            lines += [
                "",
                "Over all loads, exponents and winds so far; of a load that is next to nothing, over the one that governs there.",
            ]
        return "\n".join([*lines, "", self.trouble])


def integrator(row: dict[str, Any]) -> str:
    """As a person calls the integrator of a row of the results."""
    name = integrator_label(
        str(row.get("method")), row.get("step"), row.get("corrector") or "", row.get("mode") or ""
    )
    return f"{name} (reference)" if row.get("is_reference") else name


@dataclass
class Chart:
    """A drawing in units of `CHART`: y down, as in pictures."""

    lines: list[np.ndarray]
    labels: list[tuple[float, float, str]]
    series: dict[str, tuple[np.ndarray, tuple[int, int, int]]]


def chart(overview: Overview) -> Chart | None:
    """DEL over wind speed with axes; None before there is anything to draw."""
    points = overview.points()
    if not points:
        return None
    every = np.concatenate(list(points.values()))
    name = (overview.figure() or "").removeprefix("del_")
    channel, _, exponent = name.rpartition("_m")
    known = BY_NAME.get(channel)
    factor, unit = (known.scale, known.read_unit) if known else (1.0, "")
    x_ticks, y_ticks = ticks(*_span(every[:, 0])), ticks(*_span(every[:, 1] * factor))

    def place(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        across = (x - x_ticks[0]) / (x_ticks[-1] - x_ticks[0])
        up = (y - y_ticks[0]) / (y_ticks[-1] - y_ticks[0])
        return np.column_stack([CHART[0] * across, CHART[1] * (1 - up)])

    corners = np.array([[0.0, 0.0], [0.0, CHART[1]], [CHART[0], CHART[1]]])
    grid = [np.array([[0.0, h], [CHART[0], h]]) for _, h in place(np.full(len(y_ticks), x_ticks[0]), y_ticks)]
    labels = [
        (float(p[0]), CHART[1] + 6.0, f"{x:g}")
        for x, p in zip(x_ticks, place(x_ticks, 0 * x_ticks), strict=True)
    ]
    labels += [
        (-9.0, float(p[1]), f"{y:g}") for y, p in zip(y_ticks, place(0 * y_ticks, y_ticks), strict=True)
    ]
    labels += [(CHART[0] / 2, CHART[1] + 14.0, "wind speed [m/s]")]
    labels += [(CHART[0] / 2, -8.0, f"DEL of {known.label if known else channel}, m = {exponent} [{unit}]")]
    shades = cycle(colours.INTEGRATORS)
    series = {}
    for key, values in points.items():
        colour = colours.REFERENCE if "reference" in key else next(shades)
        series[key] = (place(values[:, 0], values[:, 1] * factor), colour)
    return Chart([corners, *grid], labels, series)


def ticks(low: float, high: float, about: int = 5) -> np.ndarray:
    """Round numbers that enclose low..high, about so many."""
    step = 10.0 ** np.floor(np.log10((high - low) / about))
    step *= next(k for k in (1, 2, 5, 10) if (high - low) / (k * step) <= about)
    return step * np.arange(np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9) + 1)


def _span(values: np.ndarray) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    return (low, high) if high > low else (low - 0.05 * abs(low) - 1e-9, high + 0.05 * abs(high) + 1e-9)


def _row(line: bytes) -> dict[str, Any] | None:
    try:
        row = json.loads(line)["row"]
        return row if "case_id" in row else None
    except (ValueError, KeyError, TypeError):
        return None
