"""The columns of the results table as data: name, unit, meaning, and the group to which each belongs.

What a group is made of stands here and nowhere else: which columns tell two winds apart, which name an integrator, which say in a log
what was simulated.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from fatigue_runner.channels import BY_NAME, LOADS, STATES, Channel, placed

Kind = Literal["number", "whole", "truth", "text"]
Group = Literal[
    "case", "wind", "operation", "integrator", "outcome", "cost", "training", "accuracy", "fatigue", "statistics"
]  # fmt: skip


@dataclass(frozen=True)
class Column:
    """One column; an empty cell is unknown or does not apply."""

    name: str
    group: Group
    meaning: str
    unit: str = "-"
    kind: Kind = "number"


def _text(name: str, group: Group, meaning: str) -> Column:
    return Column(name, group, meaning, "", "text")


# in the order of the table
CASE = (
    _text("case_id", "case", "name of the case; its log is logs/<case_id>.mcap"),
    _text("wind_source", "wind", "type of the wind in the campaign file"),
    Column("wind_speed", "wind", "mean hub-height wind speed", "m/s"),
    Column("vertical_shear", "wind", "mean linear vertical shear, change of the wind over R"),
    Column("horizontal_shear", "wind", "mean linear horizontal shear, change of the wind over R"),
    Column("shear_exponent", "wind", "power-law exponent alpha of the mean wind"),
    Column("roughness_length", "wind", "of a logarithmic mean wind", "m"),
    Column("turbulence_intensity", "wind", "standard deviation over mean of the wind at a point at the hub; of a series, its own"),
    Column("harmonics", "wind", "azimuthal harmonics of the wind that the blades feel; 1: linear shears", kind="whole"),
    Column("yaw_misalignment_deg", "wind", "angle by which the wind blows past the nacelle's axis, clockwise seen from above", "deg"),
    Column("upflow_deg", "wind", "angle by which it blows upwards", "deg"),
    Column("tower_influence", "wind", "whether the tower takes from the wind of the blades that pass it", "", "truth"),
    Column("seed", "wind", "of the turbulence", kind="whole"),
    _text("gust", "wind", "extreme wind of IEC 61400-1 that blows"),
    _text("wind_file", "wind", "file that the wind was read from"),
    Column("rotor_intensity", "statistics", "standard deviation over mean of the wind averaged over the rotor, in the counted time"),
    _text("operation", "operation", "who steers: fixed, torque-law or controlled"),
    Column("pitch_deg", "operation", "blade pitch, positive to feather; empty where it varies in time", "deg"),
    Column("pitch_rate_max", "statistics", "largest pitch rate of the controller, in the counted time", "rad/s"),
    Column("pitch_rate_limited_time", "statistics", "counted time in which the pitch turns faster than its limit, which does not act", "s"),
    _text("method", "integrator", "integration method"),
    Column("step", "integrator", "its time step", "s"),
    _text("corrector", "integrator", "name of the learned corrector"),
    _text("mode", "integrator", "enhanced: corrected; hybrid: corrected and guarded"),
    Column("is_reference", "integrator", "whether the others are measured against it", "", "truth"),
    _text("status", "outcome", "done, diverged (it ended early) or failed (it could not run or be written)"),
    Column("diverged_at", "outcome", "simulated time at which the case diverged", "s"),
    _text("error_message", "outcome", "why a case failed"),
    Column("duration", "cost", "simulated time", "s"),
    Column("steps", "cost", "steps taken", "-", "whole"),
    Column("evaluations", "cost", "evaluations of the equations of motion", "-", "whole"),
    Column("evaluations_per_second", "cost", "evaluations per simulated second", "1/s"),
    Column("wall_time", "cost", "time of the integration, the case's share of its block", "s"),
    Column("clamped_lookups", "cost", "look-ups outside the aerodynamic tables", "-", "whole"),
    Column("acceptance_rate", "cost", "share of the steps at which a guard accepted the corrector"),
    Column("trained_from", "training", "lowest mean wind speed that the corrector was trained on", "m/s"),
    Column("trained_to", "training", "highest mean wind speed that the corrector was trained on", "m/s"),
    Column("nrmse_max", "accuracy", "RMS error over the reference's range, of the worst state"),
    Column("nrmse_mean", "accuracy", "RMS error over the reference's range, mean over the states"),
    Column("delta_e", "accuracy", "mean square of error over value, arXiv:2504.05493"),
    Column("delta_e_range", "accuracy", "mean square of error over range"),
)  # fmt: skip

_FATIGUE = (
    ("del", "damage-equivalent load at 1 Hz, Wöhler exponent {m:g}: {label}", None),
    ("del_error", "relative error of that load against the reference's", "-"),
    ("damage_ratio", "damage over the reference's", "-"),
)
_STATISTICS = {
    "mean": ("mean", None), "min": ("smallest", None), "max": ("largest", None), "std": ("standard deviation", None),
    "min_time": ("simulated time of the smallest", "s"), "max_time": ("simulated time of the largest", "s"),
}  # fmt: skip
_OF_STATES = ("rotor_speed",)  # states with statistics of their own, as every load has


def damage_keys(angles: Mapping[str, Sequence[int]]) -> list[tuple[str, int, str]]:
    """(place, azimuth [deg], its column): `damage_tower_base_015`."""
    return [
        (place, angle, f"damage_{place}_{angle:03d}") for place, found in angles.items() for angle in found
    ]


def statistics_keys(
    states: Sequence[Channel] = STATES, channels: Iterable[str] = ()
) -> list[tuple[str, str]]:
    """(statistic, channel) of every column of a statistic; channels: among them are those loads of sections that there are."""
    named = {state.name for state in states}
    measured = [c.name for c in LOADS] + [name for name in _OF_STATES if name in named]
    measured += [name for name in channels if placed(name)]
    return [(figure, name) for name in measured for figure in _STATISTICS]


def fatigue_keys(channels: Sequence[str], exponents: Sequence[float]) -> list[tuple[str, float, str]]:
    """(channel, exponent, suffix of its columns): `blade1_root_flapwise_moment_m10`."""
    return [(channel, m, f"{channel}_m{m:g}") for channel in channels for m in exponents]


def _statistic(figure: str, channel: Channel) -> Column:
    word, unit = _STATISTICS[figure]
    return Column(f"{figure}_{channel.name}", "statistics", f"{word}: {channel.label}", unit or channel.unit)


def table(
    channels: Sequence[str],
    exponents: Sequence[float],
    states: Sequence[Channel] = STATES,
    angles: Mapping[str, Sequence[int]] | None = None,
) -> list[Column]:
    """All columns of the results table in their order, for these fatigue channels, Wöhler exponents and states.

    angles: the azimuths [deg] around each place whose wall is counted.
    """
    loads = {load.name: load for load in LOADS} | {name: BY_NAME[name] for name in channels}
    measured = loads | {state.name: state for state in states}
    errors = [
        Column(f"nrmse_{state.name}", "accuracy", f"RMS error over the reference's range: {state.label}")
        for state in states
    ]
    fatigue = [
        Column(f"{figure}_{suffix}", "fatigue", meaning.format(m=m, label=loads[channel].label), unit or loads[channel].unit)
        for channel, m, suffix in fatigue_keys(channels, exponents)
        for figure, meaning, unit in _FATIGUE
    ]  # fmt: skip
    damage = [
        Column(
            column,
            "fatigue",
            f"Miner's sum of a year of this wind: {place.replace('_', ' ')} at {angle} deg",
            "1/year",
        )
        for place, angle, column in damage_keys(angles or {})
    ]
    statistics = [_statistic(figure, measured[name]) for figure, name in statistics_keys(states, channels)]
    return [*CASE, *errors, *fatigue, *damage, *statistics]


def units_csv(columns: Iterable[Column]) -> str:
    """What every column of results.csv is, as a table beside it: column, unit, meaning."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("column", "unit", "meaning"))
    writer.writerows((c.name, c.unit, c.meaning) for c in columns)
    return text.getvalue()


def columns(
    channels: Sequence[str],
    exponents: Sequence[float],
    states: Sequence[Channel] = STATES,
    angles: Mapping[str, Sequence[int]] | None = None,
) -> list[str]:
    """Their names."""
    return [column.name for column in table(channels, exponents, states, angles)]


def of_group(*groups: Group) -> tuple[str, ...]:
    """Names of the columns of these groups, in the table's order."""
    return tuple(column.name for column in CASE if column.group in groups)


WIND = of_group("wind")  # what tells two winds apart
DESCRIPTION = of_group("wind", "operation", "integrator")  # what was simulated; a log says it, too
NEEDED = ("case_id", "method", "step", "is_reference", "status")  # without them no table is a campaign's
_KINDS = {column.name: column.kind for column in CASE}


def kind_of(name: str) -> Kind:
    """What stands in the cells of a column."""
    return _KINDS.get(name, "number")
