"""Which integrator is good enough, and what does it cost: pure functions over the rows of the results table.

Standard library only, so that the command line can use it without a delay.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import median
from typing import Any

from fatigue_runner.channels import BY_NAME, placed
from fatigue_runner.naming import integrator_label
from fatigue_runner.results.cells import (
    Row,
    format_count,
    format_percent,
    number,
    numbers,
    text,
    truth,
)
from fatigue_runner.results.relevance import relevant_errors
from fatigue_runner.results.unseen import Unseen, unseen

# Good enough for engineering (well below the scatter between seeds), and good enough to validate against.
LEVELS = (0.01, 0.001)

_DEL = re.compile(r"^del_(?!error_)(?P<channel>.+)_m(?P<exponent>\d+(?:\.\d+)?)$")


@dataclass(frozen=True)
class DelError:
    """The largest DEL error of one integrator as it counts (`relevance`) and where it was met; `value` keeps its sign."""

    value: float
    channel: str
    exponent: float
    case_id: str
    wind_speed: float | None

    @property
    def size(self) -> float:
        """The error without its sign [-]."""
        return abs(self.value)

    def where(self) -> str:
        """The place in words: channel, Wöhler exponent, wind."""
        channel = BY_NAME.get(self.channel)
        label = channel.label.removesuffix(" moment") if channel else self.channel
        text = f"{label}, m = {self.exponent:g}"
        return text if self.wind_speed is None else f"{text}, {self.wind_speed:.3g} m/s"


@dataclass(frozen=True)
class MethodSummary:
    """One integrator (method, step, corrector, mode) over all its cases.

    Costs are medians over the finished cases, per simulated second; errors are relative to the reference of
    the same wind and None where nothing could be compared. `on_front`: no other integrator is both cheaper
    (in evaluations) and better (worst DEL error). One with a diverged or failed case is never on the front.
    """

    method: str
    step: float | None
    corrector: str
    mode: str
    is_reference: bool
    cases: int
    done: int
    diverged: int
    failed: int
    evaluations_per_second: float | None
    wall_time_per_second: float | None
    nrmse_median: float | None
    nrmse_worst: float | None
    worst_del_error: DelError | None
    median_del_error: float | None
    channel_errors: tuple[DelError, ...] = ()  # the worst of every channel
    on_front: bool = False
    unseen: Unseen | None = None

    @property
    def key(self) -> tuple[str, float | None, str, str, bool]:
        """What the rows of this integrator have in common; see `integrator_key`."""
        return self.method, self.step, self.corrector, self.mode, self.is_reference

    @property
    def label(self) -> str:
        """The integrator as a person reads it."""
        return integrator_label(self.method, self.step, self.corrector, self.mode)

    @property
    def complete(self) -> bool:
        """Whether every case ended as it should."""
        return self.cases > 0 and self.done == self.cases


def integrator_key(row: Row) -> tuple[str, float | None, str, str, bool]:
    """What makes two rows the same integrator: (method, step, corrector, mode, is_reference)."""
    step, corrector = number(row, "step"), text(row, "corrector")
    return (
        text(row, "method"),
        step,
        corrector,
        text(row, "mode") if corrector else "",
        truth(row, "is_reference"),
    )


def fatigue_columns(rows: Sequence[Row]) -> list[tuple[str, float, str]]:
    """(channel, exponent, suffix) of every DEL that the verdict rests on, in the order of the table's columns."""
    return [found for found in _del_columns(rows) if not placed(found[0])]


def section_columns(rows: Sequence[Row]) -> list[tuple[str, float, str]]:
    """The same of the loads of sections, which say where a beam wears; the verdict does not rest on them."""
    return [found for found in _del_columns(rows) if placed(found[0])]


def _del_columns(rows: Sequence[Row]) -> list[tuple[str, float, str]]:
    alike = dict.fromkeys(tuple(row) for row in rows)  # most rows have the same columns
    names = dict.fromkeys(str(column) for columns in alike for column in columns)
    found = (m for m in map(_DEL.match, names) if m is not None)
    return [(m["channel"], float(m["exponent"]), f"{m['channel']}_m{m['exponent']}") for m in found]


def rank(rows: Iterable[Row]) -> list[MethodSummary]:
    """One summary per integrator, cheapest first (evaluations per simulated second), the reference last."""
    table = list(rows)
    columns = fatigue_columns(table)
    groups: dict[tuple[str, float | None, str, str, bool], list[Row]] = {}
    for row in table:
        groups.setdefault(integrator_key(row), []).append(row)
    summaries = _mark_front([_summarise(key, group, columns) for key, group in groups.items()])
    return sorted(summaries, key=lambda s: (s.is_reference, _or_infinity(s.evaluations_per_second), s.label))


def _summarise(
    key: tuple[str, float | None, str, str, bool], rows: list[Row], columns: list[tuple[str, float, str]]
) -> MethodSummary:
    method, step, corrector, mode, is_reference = key
    done = [row for row in rows if text(row, "status") == "done"]
    nrmse = numbers(done, "nrmse_max")
    worst, middle = ((), None) if is_reference else _del_errors(done, columns)
    return MethodSummary(
        method=method,
        step=step,
        corrector=corrector,
        mode=mode,
        is_reference=is_reference,
        cases=len(rows),
        done=len(done),
        diverged=sum(text(row, "status") == "diverged" for row in rows),
        failed=sum(text(row, "status") == "failed" for row in rows),
        evaluations_per_second=_median_of(numbers(done, "evaluations_per_second")),
        wall_time_per_second=_median_of(wall_times_per_second(done)),
        nrmse_median=None if is_reference else _median_of(nrmse),
        nrmse_worst=None if is_reference else max(nrmse, default=None),
        worst_del_error=max(worst, key=lambda e: e.size, default=None),
        median_del_error=middle,
        channel_errors=worst,
        unseen=unseen(rows),
    )


def as_data(summaries: Iterable[MethodSummary]) -> list[dict[str, Any]]:
    """The summaries as JSON holds them."""
    return [asdict(summary) for summary in summaries]


def from_data(data: Iterable[Mapping[str, Any]]) -> list[MethodSummary]:
    """The summaries that were `as_data`."""

    def error(found: Mapping[str, Any] | None) -> DelError | None:
        return None if found is None else DelError(**found)

    def winds(found: Mapping[str, Any] | None) -> Unseen | None:
        return None if found is None else Unseen(**{**found, "trained": tuple(found["trained"])})

    return [
        MethodSummary(
            **{
                **item,
                "worst_del_error": error(item["worst_del_error"]),
                "channel_errors": tuple(DelError(**found) for found in item["channel_errors"]),
                "unseen": winds(item["unseen"]),
            }
        )
        for item in data
    ]


def unseen_winds(summaries: Iterable[MethodSummary]) -> list[str]:
    """A sentence per integrator whose corrector met winds that it was not trained on."""
    return [s.unseen.sentence(s.label, s.corrector, s.cases) for s in summaries if s.unseen]


def wall_times_per_second(rows: Iterable[Row]) -> list[float]:
    """Measured wall time of the integration per simulated second, of every row that has both."""
    pairs = ((number(row, "wall_time"), number(row, "duration")) for row in rows)
    return [wall / duration for wall, duration in pairs if wall is not None and duration]


def _del_errors(
    rows: list[Row], columns: list[tuple[str, float, str]]
) -> tuple[tuple[DelError, ...], float | None]:
    """The largest DEL error of each channel, in the order of the columns, and the median of all sizes."""
    sizes: list[float] = []
    worst: dict[str, tuple[float, float, Row]] = {}
    for row in rows:
        errors = relevant_errors(row, columns)
        for channel, exponent, suffix in columns:
            error = errors.get(suffix)
            if error is not None:
                sizes.append(abs(error))
                if channel not in worst or abs(error) > abs(worst[channel][0]):
                    worst[channel] = error, exponent, row
    found = [
        DelError(error, channel, exponent, text(row, "case_id"), number(row, "wind_speed"))
        for channel, (error, exponent, row) in worst.items()
    ]
    return tuple(found), _median_of(sizes)


def _mark_front(summaries: list[MethodSummary]) -> list[MethodSummary]:
    points = {s: (_or_infinity(s.evaluations_per_second), _error_size(s)) for s in summaries if _competes(s)}
    front = pareto(points)
    return [replace(s, on_front=s in front) for s in summaries]


def pareto(points: Mapping[MethodSummary, tuple[float, float]]) -> set[MethodSummary]:
    """The integrators whose (cost, error) no other point equals or beats in both and differs from."""

    def beaten(point: tuple[float, float]) -> bool:
        return any(p != point and p[0] <= point[0] and p[1] <= point[1] for p in points.values())

    return {summary for summary, point in points.items() if not beaten(point)}


def _competes(summary: MethodSummary) -> bool:
    compared = summary.evaluations_per_second is not None and summary.worst_del_error is not None
    return summary.complete and not summary.is_reference and compared


def _error_size(summary: MethodSummary) -> float:
    return math.inf if summary.worst_del_error is None else summary.worst_del_error.size


def cheapest_within(summaries: Iterable[MethodSummary], level: float) -> MethodSummary | None:
    """The integrator with fewest evaluations whose worst DEL error is within `level`; None without one."""
    good = [s for s in summaries if _competes(s) and _error_size(s) <= level]
    return min(good, key=lambda s: (_or_infinity(s.evaluations_per_second), _error_size(s)), default=None)


def fastest_within(summaries: Iterable[MethodSummary], level: float) -> MethodSummary | None:
    """The same by the measured time; the cheapest in evaluations where it is as fast to a tenth, which is how well a time is known."""
    candidates = list(summaries)
    good = [s for s in candidates if _competes(s) and _error_size(s) <= level and s.wall_time_per_second]
    best, cheapest = (
        min(good, key=lambda s: s.wall_time_per_second or 0.0, default=None),
        cheapest_within(candidates, level),
    )
    if best is None or cheapest is None or not cheapest.wall_time_per_second:
        return cheapest
    return cheapest if cheapest.wall_time_per_second <= 1.1 * (best.wall_time_per_second or 0.0) else best


def reference_of(summaries: Iterable[MethodSummary]) -> MethodSummary | None:
    """The reference's summary; None where the campaign ran without one."""
    return next((s for s in summaries if s.is_reference), None)


def answer(summaries: Sequence[MethodSummary], levels: Sequence[float] = LEVELS) -> list[str]:
    """The result in sentences: the cheapest integrator at each level of DEL error, and what is out of it."""
    reference, tested = reference_of(summaries), [s for s in summaries if not s.is_reference]
    if not tested:
        return ["Only the reference was run: there is no integrator to compare."]
    if not any(_competes(s) for s in tested):
        why = (
            "no reference was run"
            if reference is None
            else "none finished all its cases beside the reference"
        )
        return [f"No integrator can be judged: {why}.", *_casualties(summaries)]
    winners: dict[tuple[MethodSummary | None, MethodSummary | None], list[float]] = {}
    for level in levels:
        winners.setdefault((cheapest_within(tested, level), fastest_within(tested, level)), []).append(level)
    sentences = []
    for (best, fastest), passed in winners.items():
        if best is None:
            sentences.append(_nearest_sentence(tested, passed[0]))
        else:
            sentences.append(_best_sentence(best, fastest, passed, tested))
    return [*sentences, *_casualties(summaries)]


def _nearest_sentence(tested: list[MethodSummary], level: float) -> str:
    nearest = min((s for s in tested if _competes(s)), key=_error_size)
    return (
        f"No integrator is within {format_percent(level)} DEL error; the nearest is {nearest.label} with "
        f"{_worst(nearest)}."
    )


def _best_sentence(
    best: MethodSummary, fastest: MethodSummary | None, levels: list[float], tested: Sequence[MethodSummary]
) -> str:
    within = " and within ".join(format_percent(level) for level in levels)
    said = (
        f"Cheapest within {within} DEL error: {best.label}, {_count(best.evaluations_per_second)} "
        f"evaluations per simulated second{_saving(best, levels, tested)}; its worst is {_worst(best)}."
    )
    if fastest is None or fastest == best:
        return said
    times = f"{_microseconds(fastest)} µs per simulated second against {_microseconds(best)}"
    return f"{said} Fastest, as measured here: {fastest.label}, {times}."


def _microseconds(summary: MethodSummary) -> str:
    time = summary.wall_time_per_second
    return "unknown" if time is None else format_count(time * 1e6)


def _worst(summary: MethodSummary) -> str:
    error = summary.worst_del_error
    return "unknown" if error is None else f"{format_percent(error.size)} ({error.where()})"


def _count(value: float | None) -> str:
    return "unknown" if value is None else format_count(value)


def _saving(best: MethodSummary, levels: list[float], tested: Sequence[MethodSummary]) -> str:
    """What a corrector saves: against the cheapest method without one, not against a reference, whose step is anybody's choice."""
    if not best.corrector:
        return ""
    rival = cheapest_within([s for s in tested if not s.corrector], min(levels))
    if rival is None:
        return " (no method without a corrector is as good here)"
    ratio = saving(best, rival)
    return (
        f", {format_count(ratio)} times fewer than {rival.label} without a corrector"
        if ratio and ratio >= 1.05
        else ""
    )


def saving(summary: MethodSummary, rival: MethodSummary | None) -> float | None:
    """How many times fewer evaluations than another integrator's; None where either is unknown."""
    if rival is None or not rival.evaluations_per_second or not summary.evaluations_per_second:
        return None
    return rival.evaluations_per_second / summary.evaluations_per_second


def cheapest_classical(summaries: Iterable[MethodSummary]) -> MethodSummary | None:
    """The cheapest integrator without a corrector at the strictest level that one meets: what others are compared with."""
    classical = [s for s in summaries if not s.corrector and not s.is_reference]
    return next((s for level in sorted(LEVELS) if (s := cheapest_within(classical, level))), None)


def _casualties(summaries: Iterable[MethodSummary]) -> list[str]:
    lines = []
    for s in summaries:
        lost = [
            f"{n} of {s.cases} cases {what}"
            for n, what in ((s.diverged, "diverged"), (s.failed, "failed"))
            if n
        ]
        if lost:
            role = "The reference, " if s.is_reference else "Not considered: "
            lines.append(f"{role}{s.label}: {' and '.join(lost)}.")
    return lines


def _or_infinity(value: float | None) -> float:
    return math.inf if value is None else value


def _median_of(values: list[float]) -> float | None:
    return float(median(values)) if values else None
