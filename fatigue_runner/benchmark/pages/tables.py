"""The tables of the pages: headings and rows of plain text, and the rich tables that only the terminal shows."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from fatigue_runner.benchmark.pages.render import Table
from fatigue_runner.benchmark.study import answers
from fatigue_runner.benchmark.study.answers import Answer, Reached
from fatigue_runner.benchmark.study.points import Point
from fatigue_runner.integrators import ENHANCED, HYBRID
from fatigue_runner.results.evaluation_cost import KINDS, F


def optional(value: float | None, text: str) -> str:
    """A number by a format; empty where it is unknown."""
    return "" if value is None else format(value, text)


def _microseconds(value: float | None) -> str:
    return "" if value is None else f"{value * 1e6:.2f}"


def nanoseconds(value: dict[str, float]) -> str:
    """Median and quartiles."""
    return f"{value['median']:.1f} ({value['low']:.1f} to {value['high']:.1f})"


def _reached(r: Reached | None) -> str:
    if r is None:
        return "none gets there"
    return f"{r.series}, {'~' if len(r.between) > 1 else ''}{r.step * 1e3:.3g} ms"


_UNITS: dict[str, tuple[str, Callable[[Reached], str]]] = {
    "wall": ("µs/s", lambda r: _microseconds(r.wall)),
    "evaluations": ("per s", lambda r: f"{r.evaluations:.1f}"),
    "delta_t": ("δt [µs/s]", lambda r: _microseconds(r.delta_t)),
}


def verdicts(result: dict[str, Any], cost: str) -> Table:
    """The cheapest classical and the cheapest corrected integrator for every accuracy, by one cost."""
    unit, shown = _UNITS[cost]
    rows = []
    for a in answers.answers(result, cost):
        c, n = a.classical, a.corrected
        rows.append(
            [a.target, _reached(c), shown(c) if c else "", _reached(n), shown(n) if n else "", _ratio(a)]
        )
    return Table(["error", "classical", unit, "with corrector", unit, "times cheaper"], rows)


def _ratio(answer: Answer) -> str:
    return optional(answer.ratio, ".2f")


def evaluations(times: Mapping[str, Mapping[str, float]]) -> Table:
    """What one evaluation of f takes, and one of every corrector's N beside it."""
    of_f, rows = times[F], []
    for name, own in times.items():
        ratio = "" if name == F else f"{own['lane'] / of_f['lane']:.2f}"
        cells = [f"{own[kind] * 1e9:.0f}" for kind in ("lane", "single")]
        rows.append(["f" if name == F else f"N of {name}", *cells, ratio])
    return Table(["", *(f"{KINDS[kind]} [ns]" for kind in ("lane", "single")), "time(N) / time(f)"], rows)


def fronts(result: dict[str, Any]) -> list[tuple[str, list[str]]]:
    """(what a Pareto front is of, the labels of its points)."""
    return [
        (words, [p.label for p in answers.front(result["points"], cost, error)])
        for words, cost, error in (
            ("time, NRMSE", answers.wall, answers.nrmse),
            ("evaluations, NRMSE", answers.evaluations, answers.nrmse),
            ("time, DEL error", answers.wall, answers.del_error),
        )
    ]


def duels(result: dict[str, Any]) -> Table:
    """Every corrector at its own error against the classical curves there."""
    rows = []
    for d in answers.duels(result):
        p = d.point
        ratios = [optional(d.ratio(cost), ".2f") for cost in answers.COSTS]
        rival = d.rivals["wall"]
        rows.append([
            p.label, f"{p.step * 1e3:g}", f"{d.error:.1e}", optional(p.nrmse_worst, ".1e"), optional(p.del_error_max, ".1e"),
            _microseconds(answers.wall(p)), f"{p.evaluations_per_second:.0f}", _reached(rival),
            _microseconds(rival.wall if rival else None), *ratios, _share(p.accepted),
        ])  # fmt: skip
    head = (
        *("corrector", "step [ms]", "NRMSE", "worst case", "DEL error", "µs/s", "evaluations/s"),
        *("best classical at that NRMSE", "µs/s", "times cheaper: time", "evaluations", "δt", "accepted"),
    )
    return Table(head, rows)


def in_winds(result: dict[str, Any]) -> Table:
    """Every corrector in each mean wind, beside its method alone and the classical method with the fewest evaluations for its DEL error."""
    rows = [
        [
            w.point.label, w.wind, optional(w.point.nrmse_max, ".1e"), _percent(w.point), _share(w.point.accepted),
            f"{w.point.evaluations_per_second:.1f}", _percent(w.alone) if w.alone else "", _reached(w.rival),
            f"{w.rival.evaluations:.1f}" if w.rival else "", optional(w.ratio, ".2f"),
        ]
        for w in answers.in_winds(result)
    ]  # fmt: skip
    head = (
        *("corrector", "wind [m/s]", "NRMSE", "DEL error", "accepted", "evaluations/s", "method alone"),
        *("fewest evaluations of a classical method", "evaluations/s", "times fewer"),
    )
    return Table(head, rows)


def _percent(point: Point) -> str:
    return "" if point.del_error_max is None else f"{point.del_error_max * 100:.2g} %"


def _share(value: float | None) -> str:
    return "" if value is None else f"{value * 100:.1f} %"


def points(found: Sequence[Point]) -> Table:
    """Costs and errors."""
    head = (
        *(
            "integrator",
            "step [ms]",
            "evaluations/s",
            "µs/s",
            "δt [µs/s]",
            "δt, one case [µs/s]",
            "NRMSE",
            "worst case",
        ),
        *("DEL error", "delta_e", "delta_e_range"),
    )
    return Table(head, [_point(p) for p in found])


def _point(p: Point) -> list[str]:
    cost = [p.label, f"{p.step * 1e3:g}", f"{p.evaluations_per_second:.0f}"]
    if p.diverged:
        return [*cost, "", "", "", "", f"{p.diverged} diverged, first at {p.diverged_at:.1f} s", "", "", ""]
    time = ""
    if p.wall:
        time = f"{p.wall['median'] * 1e6:.2f} ({p.wall['low'] * 1e6:.2f} to {p.wall['high'] * 1e6:.2f})"
    median = [float(np.median(v)) for v in (p.delta_e, p.delta_e_range)]
    return [
        *cost, time, *(_microseconds(p.delta_t.get(kind)) for kind in ("lane", "single")), optional(p.nrmse_max, ".1e"),
        optional(p.nrmse_worst, ".1e"), optional(p.del_error_max, ".1e"), f"{median[0]:.1e}", f"{median[1]:.1e}",
    ]  # fmt: skip


def adaptive(found: Sequence[Point]) -> Table:
    """Of methods with steps of their own."""
    rows = [
        [
            p.label,
            f"{p.evaluations_per_second:.0f}",
            optional(p.nrmse_max, ".1e"),
            optional(p.del_error_max, ".1e"),
            f"{p.step * 1e3:.0f}",
        ]
        for p in found
    ]
    return Table(["method", "evaluations/s", "NRMSE", "DEL error", "mean step [ms]"], rows)


def per_state(found: Sequence[Point]) -> Table:
    """NRMSE of every state."""
    shown = [p for p in found if p.nrmse]
    names = list(shown[0].nrmse) if shown else []
    return Table(["integrator", *names], [[p.label, *(f"{p.nrmse[n]:.0e}" for n in names)] for p in shown])


def per_channel(found: Sequence[Point]) -> Table:
    """DEL error of every channel."""
    shown = [p for p in found if p.del_error]
    names = list(dict.fromkeys(name for p in shown for name in p.del_error))
    rows = [[p.label, *(optional(p.del_error.get(n), ".1e") for n in names)] for p in shown]
    return Table(["integrator", *names], rows)


def limits(rows: Sequence[dict[str, Any]]) -> Table:
    """Stability limits."""
    cells = [
        [
            r["method"],
            f"{'at least ' if r['at_least'] else ''}{r['limit'] * 1e3:.3g}",
            optional(r["evaluations_per_second"], ".3g"),
        ]
        for r in rows
    ]
    return Table(["method", "largest stable step [ms]", "evaluations/s there"], cells)


def kernel(result: dict[str, Any]) -> Table:
    """One evaluation of f."""
    rows = [
        [r["cases"], nanoseconds(r["packed"]), nanoseconds(r["scalar"]), f"{r['ratio']:.2f}"]
        for r in result["cases"]
    ]
    return Table(["cases", "packed [ns]", "scalar [ns]", "scalar / packed"], rows)


def whole_steps(result: dict[str, Any]) -> Table:
    """Whole steps, per evaluation."""
    rows = [
        [r["method"], nanoseconds(r["whole_step"]), f"{r['over_kernel'] * 100:+.0f} %"]
        for r in result["whole_steps"]
    ]
    return Table(["method", "ns", "over the kernel alone"], rows)


def network(result: dict[str, Any]) -> Table:
    """The paper's network."""
    rows = [
        [r["precision"], r["samples"], f"{r['time']['median']:.0f}", f"{r['evaluations']:.1f}"]
        for r in result["rows"]
    ]
    return Table(["precision", "samples", "ns per sample", "evaluations of f"], rows)


def stability(result: dict[str, Any]) -> Table:
    """What diverges of every corrector that was not refused."""

    def lost(value: dict[str, Any]) -> str:
        return f"{value['diverged']}" + (f", first at {value['first']:.1f} s" if value["diverged"] else "")

    rows = [
        [
            r["corrector"], r["wind"], lost(r[ENHANCED]), lost(r[HYBRID]), f"{r['accepted'] * 100:.2f} %",
            f"{r['evaluations_per_second']:.1f}", *_stability_errors(r),
        ]
        for r in result["rows"]
        if "refused" not in r
    ]  # fmt: skip
    headings = [
        *("corrector", "wind [m/s]", "enhanced diverged", "hybrid diverged", "hybrid accepted", "evaluations/s"),
        *("NRMSE, hybrid", "method alone", "fallback alone"),
    ]  # fmt: skip
    return Table(headings, rows)


def _stability_errors(row: dict[str, Any]) -> list[str]:
    """Of the hybrid, of its method and of its fallback; empty where they were not measured."""
    if "nrmse" not in row:
        return [""] * 3
    found = [row["nrmse"].get(name, math.nan) for name in ("hybrid", "alone", "fallback")]
    return ["diverged" if e is None else "" if math.isnan(e) else f"{e:.1e}" for e in found]


def logs(result: dict[str, Any]) -> Any:
    """The figures of `speed.logs.measure` as a rich table."""
    from rich.table import Table as RichTable

    made = RichTable(title=f"Logs: {result['rows']} rows, topics {', '.join(result['topics'])}, one core")
    made.add_column("")
    made.add_column("rows per second", justify="right")
    made.add_column("ratio", justify="right")
    for title, kind in (("writing", "writers"), ("reading", "readers")):
        made.add_section()
        made.add_row(f"[bold]{title}[/]", "", "")
        for name, figures in sorted(result[kind].items(), key=lambda item: -item[1]["ratio"]):
            made.add_row(name, f"{figures['per_second']:,.0f}", f"{figures['ratio']:.2f}")
    made.caption = f"{result['bytes_per_row']:.0f} bytes per row with zstd"
    return made


def wind(result: dict[str, Any]) -> Any:
    """The figures of `speed.wind.measure` as a rich table."""
    from rich.table import Table as RichTable

    made = RichTable(title=f"Wind on {result['turbine']}, one core")
    series = f"{result['series']} series, s"
    for heading in ("harmonics", series, "field on the rotor, s", "ns per evaluation", "ratio"):
        made.add_column(heading, justify="right")
    for row in result["harmonics"]:
        seconds = f"{row['series_seconds']:.2f}", f"{row['field_seconds']:.2f}"
        made.add_row(str(row["harmonics"]), *seconds, nanoseconds(row["evaluation"]), f"{row['ratio']:.2f}")
    made.caption = "series of 600 s; field of 15 x 15 points, 660 s, read and projected; whole steps of rk4, 16 turbulent cases"
    return made


def live(result: dict[str, Any]) -> Any:
    """The figures of `speed.live.measure` as a rich table."""
    from rich.table import Table as RichTable

    made = RichTable(
        title=f"A watched campaign: {result['workers']} workers on {result['cores']} cores, {result['rounds']} rounds, "
        f"Rerun {result['rerun']} ({result['viewer']})"
    )
    for heading in ("", "wall, s", "ratio", "lowest", "highest", "CPU, s", "waited, s", "slower", "watching"):
        made.add_column(heading, justify="right" if heading else "left", no_wrap=True)
    for name, figures in result["situations"].items():
        made.add_row(
            name,
            f"{statistics.median(figures['seconds']):.2f}",
            *(f"{figures[key]:.3f}" for key in ("ratio", "lowest", "highest")),
            *(f"{figures[key]:.2f}" for key in ("cpu", "waited")),
            *(f"{figures[key]:.1%}" for key in ("slower", "watching")),
        )
    made.caption = (
        "ratio: of the clock, to the unwatched runs of the same round; CPU, waited: the run's processes together; slower: by "
        "waiting, at most; watching: share of all cores that bridge and viewer took. "
        f"Slower by at most {result['slower']:.1%}"
    )
    return made


def campaign(result: dict[str, Any]) -> Any:
    """The figures of `speed.campaign.measure` as a rich table."""
    from rich.table import Table as RichTable

    from fatigue_runner.benchmark.speed.campaign import FIXED, OPENFAST, REST, STAGES

    situations, one = result["situations"], result["evaluation"]
    made = RichTable(
        title=f"A campaign of {situations[0]['cases']} cases of {result['duration']:g} s at 50 Hz"
    )
    made.add_column("us per simulated second and case, on one core")
    for s in situations:
        made.add_column(
            f"{'logs' if s['logged'] else 'no logs'}, {s['workers']} process{'es' * (s['workers'] > 1)}",
            justify="right",
        )

    def line(name: str, values: Iterable[float], digits: int = 2) -> None:
        made.add_row(name, *(f"{value:.{digits}f}" for value in values))

    for stage in (*STAGES, REST):
        line(stage, (s["stages"][stage] for s in situations))
    made.add_section()
    line("together", (s["sum"] for s in situations))
    line("of the core, waits included", (s["core"] for s in situations))
    line("in evaluations of the kernel", (s["core"] * 1e3 / one for s in situations), 0)
    line(
        f"times OpenFAST's {OPENFAST:g} times real time", (1e6 / s["core"] / OPENFAST for s in situations), 0
    )
    made.add_section()
    for name in FIXED:
        line(f"{name}, s", (s["fixed"][name] for s in situations))
    line("the whole run, s", (s["whole"] for s in situations))
    line("a log, MB", (s["log_bytes_per_case"] / 1e6 for s in situations))
    made.caption = (
        f"one evaluation of the kernel: {one:.1f} ns in the same runs; before the run the program starts in {result['start']:.2f} s; "
        "rk4 at 100 ms and, as the reference, at 50 ms"
    )
    return made
