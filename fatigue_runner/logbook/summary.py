"""What a log tells at a glance: what ran, with what, where the corrector was trusted, the extremes."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fatigue_runner import channels
from fatigue_runner.logbook.reader import Log, number, read_log


@dataclass(frozen=True)
class Stretch:
    """Rejected intervals in a row: begin and end [s], how many, mean wind speed there [m/s]."""

    begin: float
    end: float
    intervals: int
    wind_speed: float | None


@dataclass(frozen=True)
class Extreme:
    """A channel's smallest, mean and largest value (SI) and the times of the two [s]."""

    name: str
    unit: str
    minimum: float
    mean: float
    maximum: float
    time_of_minimum: float
    time_of_maximum: float
    not_finite: int = 0


@dataclass(frozen=True)
class EquivalentLoad:
    """A damage-equivalent load of the result (SI) and its relative error against the reference, where known."""

    channel: str
    exponent: str
    value: float
    error: float | None


@dataclass(frozen=True)
class Peak:
    """Median and largest value of a positive quantity over the intervals, and the time of the largest [s]."""

    median: float
    largest: float
    time: float


@dataclass
class LogSummary:
    """What `fatigue-runner logs info` prints.

    acceptance_rate: of the intervals of a guarded run, None where nothing was guarded; rejections: the
    longest stretches first; rejected_wind, accepted_wind: 5 %, 50 % and 95 % quantiles of the wind speed
    [m/s]; discrepancy: over the threshold; reference_error: against the reference, in ranges of the state;
    discarded: time at the start [s] that the extremes leave out.
    """

    path: Path
    size: int
    rows: int
    duration: float
    rate: float | None
    run: dict[str, str]
    result: dict[str, str]
    attachments: dict[str, int]
    complete: bool
    lost: str
    acceptance_rate: float | None = None
    rejected: int = 0
    rejections: list[Stretch] = field(default_factory=list)
    rejected_wind: tuple[float, float, float] | None = None
    accepted_wind: tuple[float, float, float] | None = None
    discrepancy: Peak | None = None
    reference_error: Peak | None = None
    discarded: float = 0.0
    extremes: list[Extreme] = field(default_factory=list)
    equivalent_loads: list[EquivalentLoad] = field(default_factory=list)


def _extreme(name: str, unit: str, values: np.ndarray, time: np.ndarray) -> Extreme | None:
    good = np.isfinite(values)
    if not good.any():
        return None
    lowest = int(np.argmin(np.where(good, values, np.inf)))
    highest = int(np.argmax(np.where(good, values, -np.inf)))
    return Extreme(
        name=name,
        unit=unit,
        minimum=float(values[lowest]),
        mean=float(values[good].mean()),
        maximum=float(values[highest]),
        time_of_minimum=float(time[lowest]),
        time_of_maximum=float(time[highest]),
        not_finite=int((~good).sum()),
    )


def discarded(log: Log) -> float:
    """Time [s] at the start that its campaign leaves out; 0 where the log ends before it, or does not say."""
    discard = number(log.run, "discard") or 0.0
    return discard if len(log.time) and discard <= log.time[-1] else 0.0


def extremes(log: Log) -> list[Extreme]:
    """Extremes of every channel in the time that counts, loads first; without the azimuths, which only grow."""
    counts = log.time >= discarded(log) - 1e-9
    columns = dict(log.loads)
    columns |= dict(zip((c.name for c in log.states), log.state.T, strict=True)) if len(log.state) else {}
    columns |= dict(zip((c.name for c in log.winds), log.wind.T, strict=True)) if len(log.wind) else {}
    found = []
    for name, values in columns.items():
        unit = channels.BY_NAME[name].unit if name in channels.BY_NAME else log.units.get(name, "")
        extreme = None if name in channels.GROWING else _extreme(name, unit, values[counts], log.time[counts])
        if extreme is not None:
            found.append(extreme)
    return found


def stretches(log: Log) -> list[Stretch]:
    """Every run of rejected intervals, the longest first."""
    rejected = np.concatenate([[False], ~log.accepted, [False]]).astype(np.int8)
    edges = np.diff(rejected)
    speed = log.wind[:, 0] if log.wind.size else None
    found = []
    for begin, end in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        mean = float(speed[begin : end + 1].mean()) if speed is not None else None
        found.append(Stretch(float(log.time[begin]), float(log.time[end]), int(end - begin), mean))
    return sorted(found, key=lambda s: (-s.intervals, s.begin))


def peak(values: np.ndarray, time: np.ndarray) -> Peak | None:
    """Of values per interval, `time` being their ends; None where nothing is known."""
    known = np.isfinite(values)
    if not known.any():
        return None
    top = int(np.argmax(np.where(known, values, -np.inf)))
    return Peak(float(np.median(values[known])), float(values[top]), float(time[top]))


def equivalent_loads(result: Mapping[str, str]) -> list[EquivalentLoad]:
    """Damage-equivalent loads of a result: `del_<channel>_m<exponent>`, with `del_error_...` beside it."""
    found = []
    for key in result:
        name, _, exponent = key.removeprefix("del_").rpartition("_m")
        if not key.startswith("del_") or name not in channels.BY_NAME:
            continue
        value, error = number(result, key), number(result, f"del_error_{name}_m{exponent}")
        if value is not None:
            found.append(EquivalentLoad(name, exponent, value, error))
    return found


def _quantiles(values: np.ndarray) -> tuple[float, float, float] | None:
    if not values.size:
        return None
    low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
    return float(low), float(middle), float(high)


def summarise(path: str | os.PathLike[str]) -> LogSummary:
    """What a log tells, of a damaged one as far as it can be read (then `lost` says why).

    Raises LogError for a file that is missing or no turbine log.
    """
    log = read_log(path, partial=True)
    intervals = len(log.time) - 1
    summary = LogSummary(
        path=Path(path),
        size=Path(path).stat().st_size,
        rows=len(log.time),
        duration=log.duration,
        rate=intervals / log.duration if log.duration else None,
        run=log.run,
        result=log.result,
        attachments={name: len(data) for name, data in log.attachments.items()},
        complete=log.complete,
        lost=log.lost,
        discarded=discarded(log),
        extremes=extremes(log),
        equivalent_loads=equivalent_loads(log.result),
    )
    # Without a threshold nothing was tested, and "100 % accepted" would praise a plain Runge-Kutta method.
    guarded = log.accepted.size and not (np.isnan(log.threshold).all() and log.accepted.all())
    if guarded:
        summary.acceptance_rate = float(log.accepted.mean())
        summary.rejected = int((~log.accepted).sum())
        summary.rejections = stretches(log)
        with np.errstate(divide="ignore", invalid="ignore"):
            summary.discrepancy = peak(log.discrepancy / log.threshold, log.time[1:])
        if log.wind.size:
            speed = log.wind[1:, 0]
            summary.rejected_wind = _quantiles(speed[~log.accepted])
            summary.accepted_wind = _quantiles(speed[log.accepted])
    summary.reference_error = peak(log.reference_error, log.time[1:]) if log.reference_error.size else None
    return summary


# Entries of `run` that the sentence of `what_ran` tells; the case's name does not, as a person copies it from there.
TOLD = (
    "method", "step", "corrector", "mode", "turbine", "wind", "wind_source", "wind_speed", "turbulence_intensity", "harmonics",
    "yaw_misalignment_deg", "upflow_deg", "tower_influence", "seed", "is_reference",
)  # fmt: skip


def what_ran(run: Mapping[str, str]) -> str:
    """`rk4 at 100 ms, corrected by rk4-100ms (hybrid), on nrel5mw in turbulent wind of 8 m/s`; empty where a log does not say."""
    method, step = run.get("method"), number(run, "step")
    if not method or step is None:
        return ""
    words = f"{method} at {step * 1e3:g} ms"
    if run.get("corrector"):
        words += f", corrected by {run['corrector']} ({run.get('mode', '')})"
    if run.get("is_reference") == "True":
        words += ", the reference"
    words += f", on {run.get('turbine', '?')} in {run.get('wind_source', '')} wind".replace("  ", " ")
    speed, intensity = number(run, "wind_speed"), number(run, "turbulence_intensity")
    words += f" of {speed:g} m/s" if speed is not None else ""
    for key, what in (("yaw_misalignment_deg", "yaw misalignment"), ("upflow_deg", "upflow")):
        angle = number(run, key)
        words += f", {what} {angle:g} degrees" if angle else ""
    words += ", tower influence" if run.get("tower_influence") == "True" else ""
    # a series' own intensity is not a point's; where it is, the log tells what the rotor keeps of it
    where = " at a point" if run.get("wind_strength") else ""
    words += f", intensity {intensity:g}{where}" if intensity else ""
    harmonics = number(run, "harmonics")
    words += f", {harmonics:g} azimuthal harmonics" if harmonics is not None and harmonics > 1 else ""
    return words + (f", seed {run['seed']}" if run.get("seed") else "")
