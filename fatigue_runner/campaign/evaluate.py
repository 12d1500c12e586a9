"""One case's row of the results table: costs, errors against the reference, fatigue, statistics."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from fatigue_runner.campaign.cases import Case
from fatigue_runner.campaign.integration import Integration
from fatigue_runner.campaign.spec import Campaign
from fatigue_runner.channels import Channel, placed
from fatigue_runner.errors import FatigueRunnerError
from fatigue_runner.fatigue.sections import Wall
from fatigue_runner.layout import PITCH_RATE, PITCH_RATE_LIMITED
from fatigue_runner.results.columns import WIND, columns, damage_keys, fatigue_keys, statistics_keys
from fatigue_runner.results.table import known
from fatigue_runner.stopwatch import stage
from fatigue_runner.trajectory import Trajectory


@dataclass
class Evaluated:
    """A trajectory, the part that counts, its DELs {(channel, exponent): value or None}, and damage a year {column: value}."""

    whole: Trajectory
    trajectory: Trajectory
    loads: dict[tuple[str, float], float | None]
    damage: dict[str, float] = field(default_factory=dict)

    @property
    def compared(self) -> Evaluated:
        """What others are compared with, without the loads' series: half of the memory."""

        def bare(t: Trajectory) -> Trajectory:
            return Trajectory(t.time, t.state, np.empty((0, 0)), states=t.states)

        return Evaluated(bare(self.whole), bare(self.trajectory), self.loads)


def discarded(trajectory: Trajectory, discard: float) -> Trajectory:
    """The trajectory from `discard` [s] on; status arrays stay whole, nothing reads them by time here."""
    if discard <= 0.0:
        return trajectory
    first = int(np.searchsorted(trajectory.time, discard - 1e-9))
    return dataclasses.replace(
        trajectory,
        time=trajectory.time[first:],
        state=trajectory.state[first:],
        wind=trajectory.wind[first:],
        loads={name: series[first:] for name, series in trajectory.loads.items()},
        pitch=trajectory.pitch[first:],
        control={name: series[first:] for name, series in trajectory.control.items()},
    )


def evaluate(
    trajectory: Trajectory, campaign: Campaign, walls: Mapping[str, Wall] = MappingProxyType({})
) -> Evaluated:
    """Count every fatigue channel once, all exponents on the same cycles, and the walls of places; a diverged case has no loads, a
    trajectory without the loads of sections none of those.
    """
    from fatigue_runner.fatigue import count_channels

    if not np.isfinite(np.sum(trajectory.state)) and not np.isfinite(trajectory.state).all():
        finite = np.isfinite(trajectory.state).all(axis=1)
        when = trajectory.time[np.argmin(finite)]
        raise FatigueRunnerError(f"the state is no number from {when:g} s on, and no divergence was reported")
    kept = discarded(trajectory, campaign.discard)
    if trajectory.diverged_at is not None:
        return Evaluated(trajectory, kept, {})
    fatigue = campaign.fatigue
    counted = count_channels(
        {c: kept.loads[c] for c in campaign.counted if c in kept.loads or not placed(c)},
        fatigue.wohler_exponents,
        kept.duration,
        fatigue.residue,
    )
    loads = {
        (channel, m): found.load(m) for channel, found in counted.items() for m in fatigue.wohler_exponents
    }
    return Evaluated(trajectory, kept, loads, _damage(kept, campaign, walls))


def _damage(kept: Trajectory, campaign: Campaign, walls: Mapping[str, Wall]) -> dict[str, float]:
    """Damage a year around every place, by column; nothing for one whose moments have no fatigue."""
    found: dict[str, float] = {}
    angles = campaign.fatigue.angles
    for place, wall in walls.items():
        damage = wall.damage_per_year(kept.loads, kept.duration, campaign.fatigue.residue)
        if damage is not None:
            columns = [column for _, _, column in damage_keys({place: angles[place]})]
            found |= {column: float(value) for column, value in zip(columns, damage, strict=True)}
    return found


def scaled_error(test: Trajectory, reference: Trajectory) -> np.ndarray:
    """Error over time for the log, (n-1,): largest |x - x_ref| / range of the state, at the intervals' ends.

    NaN where no state of the reference moves.
    """
    extent = np.ptp(reference.state, axis=0)
    moving = extent > 0.0
    if not moving.any():
        return np.full(len(test.time) - 1, np.nan)
    return np.max(np.abs(test.state - reference.state)[1:, moving] / extent[moving], axis=1)


def make_row(
    case: Case,
    wind: Any,
    trajectory: Trajectory,
    own: Evaluated,
    reference: Evaluated | None,
    campaign: Campaign,
) -> dict[str, Any]:
    """The row of a case that ran, every column present, None where a figure is unknown.

    wind: the case's wind source; reference: that of the same wind, None where there is none or it diverged.
    """
    row = empty_row(case, campaign, trajectory.states) | describe(case, wind, campaign) | _costs(trajectory)
    if trajectory.diverged_at is not None:
        return row
    speed = own.trajectory.wind[:, 0]
    row["rotor_intensity"] = np.std(speed) / np.mean(speed)
    row |= own.damage
    row |= {f"del_{suffix}": own.loads[channel, m] for channel, m, suffix in _fatigue(campaign)}
    with stage("statistics"):
        row |= _statistics(own.trajectory) | _pitch_rate(own.trajectory)
    if reference is not None and not case.integration.is_reference:
        with stage("comparison"):
            row |= _errors(own, reference, campaign)
    return {name: known(row[name]) for name in row}


def _statistics(trajectory: Trajectory) -> dict[str, Any]:
    """Of every load, and of those states that have columns for them."""
    names = [channel.name for channel in trajectory.states]
    series = dict(zip(names, trajectory.state.T, strict=True)) | trajectory.loads
    time = trajectory.time
    keys = [key for key in statistics_keys(trajectory.states, trajectory.loads) if key[1] in series]
    rows = {name: row for row, name in enumerate(dict.fromkeys(name for _, name in keys))}
    block = np.stack([series[name] for name in rows], dtype=np.float64)
    figures = {
        "mean": block.mean(axis=1),
        "min": block.min(axis=1),
        "max": block.max(axis=1),
        "min_time": time[block.argmin(axis=1)],
        "max_time": time[block.argmax(axis=1)],
    }
    block -= figures["mean"][:, None]
    figures["std"] = np.sqrt(np.einsum("ij,ij->i", block, block) / len(time))
    plain = {figure: values.tolist() for figure, values in figures.items()}
    return {f"{figure}_{name}": plain[figure][rows[name]] for figure, name in keys}


def _pitch_rate(trajectory: Trajectory) -> dict[str, Any]:
    """How fast a controller turns the blades, and for how long faster than its limit."""
    rate, beyond = (trajectory.control.get(c.name) for c in (PITCH_RATE, PITCH_RATE_LIMITED))
    if rate is None or beyond is None or len(rate) < 2:
        return {}
    return {
        "pitch_rate_max": np.max(np.abs(rate)),
        "pitch_rate_limited_time": np.mean(beyond) * trajectory.duration,
    }


def failed_row(
    case: Case, wind: Any, error: Exception, campaign: Campaign, states: Sequence[Channel]
) -> dict[str, Any]:
    """The row of a case that could not run or be written; the error's text says why."""
    text = " ".join(str(error).split()) or type(error).__name__
    row = empty_row(case, campaign, states) | (describe(case, wind, campaign) if wind is not None else {})
    return row | {"status": "failed", "error_message": text}


def empty_row(case: Case, campaign: Campaign, states: Sequence[Channel]) -> dict[str, Any]:
    """Every column, with what is known of a case before it runs."""
    settings = campaign.fatigue
    angles = tuple((place, tuple(found)) for place, found in settings.angles.items())
    names = _columns(tuple(campaign.counted), tuple(settings.wohler_exponents), tuple(states), angles)
    row: dict[str, Any] = dict.fromkeys(names)
    return row | {
        "case_id": case.id,
        "method": case.integration.method,
        "step": case.integration.step,
        "corrector": case.integration.corrector or None,
        "mode": case.integration.mode or None,
        "is_reference": case.integration.is_reference,
    }


@lru_cache(maxsize=8)
def _columns(
    channels: tuple[str, ...],
    exponents: tuple[float, ...],
    states: tuple[Channel, ...],
    angles: tuple[tuple[str, tuple[int, ...]], ...],
) -> list[str]:
    return columns(channels, exponents, states, dict(angles))


def describe(case: Case, wind: Any, campaign: Campaign) -> dict[str, Any]:
    """The columns that say which wind and which pitch [deg] it was, and which winds a corrector knows."""
    label = wind.label
    return {
        **{name: known(label.get(name)) for name in WIND},
        "wind_source": case.wind.kind,
        "wind_file": case.wind.file,
        "operation": campaign.operation,
        "pitch_deg": campaign.pitch
        if isinstance(campaign.pitch, float) and campaign.operation == "fixed"
        else None,
        **_trained(case.integration),
    }


def _trained(integration: Integration) -> dict[str, float]:
    """The mean wind speeds [m/s] that a case's corrector was trained on."""
    try:
        corrector = integration.build().corrector if integration.file else None
    except (
        FatigueRunnerError
    ):  # its file has changed while the campaign ran: that is said where its cases fail
        corrector = None
    return (
        {}
        if corrector is None
        else dict(zip(("trained_from", "trained_to"), corrector.wind_range, strict=True))
    )


def _fatigue(campaign: Campaign) -> list[tuple[str, float, str]]:
    return fatigue_keys(campaign.counted, campaign.fatigue.wohler_exponents)


def _costs(trajectory: Trajectory) -> dict[str, Any]:
    duration = trajectory.duration
    guarded = np.isfinite(trajectory.threshold).any()
    return {
        "status": "done" if trajectory.diverged_at is None else "diverged",
        "diverged_at": known(trajectory.diverged_at),
        "duration": known(duration),
        "steps": int(trajectory.steps),
        "evaluations": int(trajectory.evaluations),
        "evaluations_per_second": known(trajectory.evaluations / duration) if duration > 0 else None,
        "wall_time": known(trajectory.wall_time),
        "clamped_lookups": int(np.sum(trajectory.clamped_lookups)),
        "acceptance_rate": known(np.mean(trajectory.accepted)) if guarded else None,
    }


def _errors(own: Evaluated, reference: Evaluated, campaign: Campaign) -> dict[str, Any]:
    from fatigue_runner.fatigue import damage_ratio, load_error
    from fatigue_runner.results.accuracy import compare

    errors: dict[str, Any] = dict(compare(own.trajectory, reference.trajectory).to_dict())
    for channel, m, suffix in _fatigue(campaign):
        load, theirs = own.loads[channel, m], reference.loads[channel, m]
        if load is not None and theirs is not None:
            errors[f"del_error_{suffix}"] = load_error(load, theirs)
            errors[f"damage_ratio_{suffix}"] = damage_ratio(load, theirs, m)
    return errors
