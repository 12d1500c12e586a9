"""The campaign file: its keys, their units and defaults, and what is refused.

name            names the run folder; letters, digits, `.`, `_`, `-`
turbine         `nrel5mw` (default), `t2b1i1cg` (the paper's: no tilt, no cone) or the path of a turbine YAML
duration        simulated time of every case [s]; or `analysis_time` and `transient_time`, which is `duration` less `discard`, and `discard`
output_rate     samples per second [Hz] of what is counted, compared and logged (default 50), at any step
initial         state at t = 0: `operating-point` (default), `paper`, `paper-spinning`, or 16 numbers (a controller's states begin
                as if these had been so for long)
operation       who steers: `fixed` (default: the pitch below, torque of the momentary speed), `controlled` (the turbine's
                controller: pitch and torque, 3 to 25 m/s), `torque-law` (its torque at fine pitch)
pitch           with `operation: fixed`: blade pitch [deg], the same for all cases (default 0); or {time: [s], angle: [deg]}, a smooth curve
                through samples at equal steps from 0 to at least `duration` (not for correctors and exponential methods)
discard         seconds dropped from the start before statistics, fatigue and errors (default 0)
workers         parallel processes (default 2; `--workers` overrides it)

wind.type       `constant` (default), `turbulent`, `file`, ...; the other keys of `wind` stand with each source in `wind/`:
                `ConstantSection`, `TurbulentSection`, `FileSection`, ...

integrators     list of {method, step}: `step` [s] is a sweep, and every method meets every wind; with `corrector`, a name of
                `fatigue-runner correctors list` or a file's path, its local error is corrected; `mode`: `hybrid` (default),
                which guards the corrector, or `enhanced`
reference       {method, step}: what the integrators are measured against (default rk7 at 0.001 s); or none

fatigue.channels          load channels that are counted (default: blade 1 root and tower base, two each)
fatigue.wohler_exponents  default [3, 4, 5, 10, 12]
fatigue.residue           what the rainflow residue counts as: `half` (default, ASTM), `full`, `drop`
fatigue.damage            list of {place, curve, ...}: Miner's sum around the wall of a section, see `campaign/damage_section.py`

loads            more places than base and root: {tower_heights, blade_radii, root_directions}, see `campaign/loads_section.py`

delta_t          whether one evaluation of f and of each corrector is timed, and the report tells the cost of arXiv:2504.05493
                (`results/evaluation_cost.py`; default false)
lifetime         the life that the cases stand for, from the site's wind: {climate, years, ...}, see `results/lifetime_section.py`

log.enabled      one MCAP file per case in logs/ (default true)
log.cases        whose: `all` (default up to 400 cases), `none`, {worst: N} (default beyond), {sample: N}, {where: [diverged, rejected]};
                any other log can be made later (`fatigue-runner logs make`)
log.precision    `float32` (default) or `float64`
log.compression  `zstd` (default), `lz4` or `none`
log.topics       which of `state`, `loads`, `status`, `wind`, `control` (default all; less cannot be read back)
log.channels     names of states, wind signals, loads and signals of the controller (default all)

A sweep is a number, a list of numbers, {start, stop, step}, {start, stop, count} (both ends included),
{random: {count, low, high, seed}}, or a list of such pieces.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    PlainSerializer,
    PlainValidator,
    SerializeAsAny,
    field_validator,
    model_validator,
)

from fatigue_runner import shipped
from fatigue_runner.campaign.damage_section import DamageSection
from fatigue_runner.campaign.kept_logs import Kept
from fatigue_runner.campaign.loads_section import LoadsSection
from fatigue_runner.channels import (
    BY_NAME,
    FATIGUE_CHANNELS,
    LOAD_NAMES,
    STATE_NAMES,
    channel_name,
    of_section,
)
from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.inputs.section import Section, problem, validated
from fatigue_runner.inputs.source import Source, read_mapping
from fatigue_runner.inputs.sweep import Piece, Sweep, check_not_empty, expand
from fatigue_runner.integrators.initial import INITIAL_STATES
from fatigue_runner.results.lifetime_section import LifetimeSection
from fatigue_runner.wind.section import WindSection, wind_section

if TYPE_CHECKING:
    from fatigue_runner.integrators.pitch import PitchSeries

NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]*$"


def _initial_state(value: Any) -> str | list[float]:
    if isinstance(value, str):
        if value not in INITIAL_STATES:
            hint = did_you_mean(value, INITIAL_STATES)
            raise problem(f"{value!r} is not known{hint}, or give {len(STATE_NAMES)} numbers")
        return value
    if not isinstance(value, list) or len(value) != len(STATE_NAMES) or not all(map(_is_number, value)):
        raise problem(
            f"must be one of {', '.join(INITIAL_STATES)}, or {len(STATE_NAMES)} finite numbers: "
            f"{', '.join(STATE_NAMES)}"
        )
    return [float(number) for number in value]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _positive_steps(pieces: list[Piece]) -> list[Piece]:
    for value, _ in expand(pieces):
        if value <= 0:
            raise problem(f"must be above 0 s; got {value:g}")
    return pieces


def _none_in_words(value: Any) -> Any:
    """`none` is what a person writes for YAML's `null`."""
    return None if isinstance(value, str) and value.strip().lower() == "none" else value


class IntegratorSection(Section):
    """One method and the steps [s] it runs at; `steps` may be written for `step`."""

    synonyms: ClassVar = {"steps": "step"}

    method: str
    step: Annotated[Sweep, AfterValidator(_positive_steps)]
    corrector: Annotated[str | None, BeforeValidator(_none_in_words)] = None
    mode: Literal["hybrid", "enhanced"] = "hybrid"

    @model_validator(mode="after")
    def _mode_of_something(self) -> IntegratorSection:
        if self.corrector is None and "mode" in self.model_fields_set:
            raise problem("means nothing without `corrector`; add one or remove it", key="mode")
        return self


class Reference(Section):
    """The integrator that the others are measured against."""

    method: str = "rk7"
    step: float = Field(default=0.001, gt=0)


Exponent = Annotated[float, Field(ge=1, le=50)]


class Fatigue(Section):
    """What is counted and how."""

    channels: Annotated[list[str], BeforeValidator(check_not_empty)] = Field(default=[*FATIGUE_CHANNELS])
    wohler_exponents: Annotated[list[Exponent], BeforeValidator(check_not_empty)] = Field(
        default=[3.0, 4.0, 5.0, 10.0, 12.0]
    )
    residue: Literal["half", "full", "drop"] = "half"
    damage: list[DamageSection] = Field(default=[])

    @field_validator("damage")
    @classmethod
    def _each_place_once(cls, damage: list[DamageSection]) -> list[DamageSection]:
        for index, entry in enumerate(damage):
            if any(entry.place == other.place for other in damage[:index]):
                raise problem(
                    f"{entry.place!r} stands twice; remove one, or run the other curve as a campaign of its own"
                )
        return damage

    @property
    def angles(self) -> dict[str, list[int]]:
        """The azimuths [deg] of every place, for the columns of the results."""
        return {
            entry.place: [round(i * 360 / entry.azimuths) for i in range(entry.azimuths)]
            for entry in self.damage
        }

    @field_validator("channels")
    @classmethod
    def _channels_exist(cls, channels: list[str]) -> list[str]:
        channels = [channel_name(name) for name in channels]
        for name in channels:
            if of_section(name):
                raise problem(f"{name!r} is counted where `loads` asks for its section; leave it out here")
            if name not in LOAD_NAMES:
                raise problem(f"{name!r} is no load channel{did_you_mean(name, LOAD_NAMES)}")
        return list(dict.fromkeys(channels))

    @field_validator("wohler_exponents")
    @classmethod
    def _exponents_differ(cls, exponents: list[float]) -> list[float]:
        named: dict[str, float] = {}
        for m in dict.fromkeys(exponents):
            first = named.setdefault(f"{m:g}", m)
            if first != m:
                raise problem(
                    f"{first!r} and {m!r} would have one column, m{m:g}, in the table; keep one of the two"
                )
        return list(named.values())


Topic = Literal["state", "loads", "status", "wind", "control"]


class Log(Section):
    """One MCAP file per case."""

    enabled: bool = True
    cases: Kept | None = None
    compression: Literal["zstd", "lz4", "none"] = "zstd"
    precision: Literal["float32", "float64"] = "float32"
    topics: Annotated[list[Topic], BeforeValidator(check_not_empty)] | None = None
    channels: Annotated[list[str], BeforeValidator(check_not_empty)] | None = None

    @field_validator("channels")
    @classmethod
    def _signals_exist(cls, channels: list[str] | None) -> list[str] | None:
        from fatigue_runner.turbine.dynamics import signals_of_control

        known = dict.fromkeys((*BY_NAME, *signals_of_control()))
        channels = None if channels is None else [channel_name(name) for name in channels]
        for name in channels or ():
            if name not in known and not of_section(name):
                raise problem(
                    f"{name!r} is no state, wind signal, load or signal of a controller{did_you_mean(name, known)}"
                )
        return channels


class Pitch(Section):
    """A pitch that varies in time: cubic spline through the samples; pitch rate and acceleration are neglected."""

    time: list[float] = Field(min_length=2)
    angle: list[float] = Field(min_length=2)

    @model_validator(mode="after")
    def _is_a_series(self) -> Pitch:
        try:
            self.series()
        except InputError as error:
            raise problem(str(error)) from None
        return self

    def series(self) -> PitchSeries:
        """The schedule for the integrators; raises InputError for uneven times."""
        from fatigue_runner.integrators.pitch import PitchSeries

        return PitchSeries(self.time, [math.radians(x) for x in self.angle])


def _pitch(value: Any) -> Any:
    """A number or the section `Pitch`, told apart here, so that an error speaks of one of the two only."""
    if isinstance(value, dict | Pitch):
        return Pitch.model_validate(value)
    if not _is_number(value):
        raise problem(
            f"must be a number of degrees or a section with the keys time, angle; got {value!r:.60}"
        )
    return float(value)


def _plain_pitch(pitch: float | Pitch) -> Any:
    return pitch.model_dump() if isinstance(pitch, Pitch) else pitch


class Campaign(Section):
    """A whole campaign file; see the module's text for every key."""

    name: Annotated[str, Field(pattern=NAME_PATTERN)]
    turbine: str = "nrel5mw"
    duration: float = Field(gt=0, le=1e5)
    output_rate: float = Field(default=50.0, gt=0, le=10_000)
    initial: Annotated[str | list[float], PlainValidator(_initial_state)] = "operating-point"
    pitch: Annotated[float | Pitch, PlainValidator(_pitch), PlainSerializer(_plain_pitch)] = 0.0
    operation: Literal["fixed", "torque-law", "controlled"] = "fixed"
    discard: float = Field(default=0.0, ge=0)
    workers: int = Field(default=2, ge=1, le=1024)
    wind: Annotated[SerializeAsAny[WindSection], PlainValidator(wind_section)]
    integrators: Annotated[list[IntegratorSection], BeforeValidator(check_not_empty)]
    reference: Annotated[Reference | None, BeforeValidator(_none_in_words)] = Reference()
    fatigue: Fatigue = Fatigue()
    log: Log = Log()
    loads: LoadsSection = LoadsSection()
    delta_t: bool = False
    lifetime: LifetimeSection | None = None

    @property
    def counted(self) -> list[str]:
        """All channels whose cycles are counted: those of `fatigue`, and the sections of `loads`."""
        return [*self.fatigue.channels, *(c.name for c in self.loads.channels)]

    @property
    def logged(self) -> list[str] | None:
        """The channels that logs keep; None for all."""
        there = [c.name for c in self.loads.channels]
        return None if self.log.channels is None else [channel_name(n, there) for n in self.log.channels]

    @model_validator(mode="before")
    @classmethod
    def _times_by_their_names_in_weis(cls, data: Any) -> Any:
        """`analysis_time` after `transient_time`, which is left out, for `duration` and `discard`."""
        if not isinstance(data, dict) or not {"analysis_time", "transient_time"} & data.keys():
            return data
        for key in ("analysis_time", "transient_time"):
            for own in ("duration", "discard"):
                if key in data and own in data:
                    raise problem(
                        f"is part of what {own!r} says; keep `duration` and `discard`, or the other two",
                        key=key,
                    )
        if "analysis_time" not in data:
            raise problem("needs `analysis_time` beside it", key="transient_time")
        found = data["analysis_time"], data.get("transient_time", 0.0)
        for key, value, least in zip(("analysis_time", "transient_time"), found, (1e-9, 0.0), strict=True):
            if not _is_number(value) or value < least:
                raise problem(f"must be {'above 0' if least else 'at least 0'} s; got {value!r:.60}", key=key)
        others = {key: value for key, value in data.items() if key not in ("analysis_time", "transient_time")}
        return others | {"duration": float(sum(found)), "discard": float(found[1])}

    @model_validator(mode="after")
    def _who_steers(self) -> Campaign:
        if self.operation != "fixed" and "pitch" in self.model_fields_set:
            raise problem(
                f"operation {self.operation!r} makes the pitch itself; remove `pitch`, or use operation: fixed",
                key="pitch",
            )
        return self

    @property
    def blade_pitch(self) -> float | PitchSeries:
        """The pitch [rad] as the integrators take it."""
        return self.pitch.series() if isinstance(self.pitch, Pitch) else math.radians(self.pitch)

    @model_validator(mode="after")
    def _logged_sections_are_there(self) -> Campaign:
        there = [c.name for c in self.loads.channels]
        if len(set(there)) < len(there):
            raise problem("two places differ in digits that no name shows; remove one", key="loads")
        for name in self.logged or ():
            if of_section(name) and name not in there:
                raise problem(f"{name!r} is a section that `loads` does not ask for; add it there", key="log")
        return self

    @model_validator(mode="after")
    def _times_fit(self) -> Campaign:
        samples = self.duration * self.output_rate
        if samples < 2 or abs(samples - round(samples)) > 1e-6 * samples:
            raise problem(
                f"{self.duration:g} s at {self.output_rate:g} Hz is {samples:g} output intervals; "
                "it must be a whole number of at least 2",
                key="duration",
            )
        if self.discard > self.duration - 2 / self.output_rate:
            raise problem(
                f"{self.discard:g} s leaves nothing of the {self.duration:g} s; make it smaller",
                key="discard",
            )
        return self

    @model_validator(mode="after")
    def _no_integrator_twice(self) -> Campaign:
        seen: dict[Any, str] = {}
        if self.reference:
            seen[self.reference.method, self.reference.step, None, ""] = "the reference"
        for index, integrator in enumerate(self.integrators):
            for step, _ in expand(integrator.step):
                if step > self.duration:
                    raise problem(f"step {step:g} s of {integrator.method} is longer than the whole case")
                mode = integrator.mode if integrator.corrector else ""
                key = integrator.method, step, integrator.corrector, mode
                first = seen.setdefault(key, f"integrators[{index}]")
                if first != f"integrators[{index}]":
                    raise problem(
                        f"{integrator.method} at {step * 1e3:g} ms is integrators[{index}] and also {first}; "
                        "remove one",
                        key="integrators",
                    )
        return self


def read_campaign(campaign: str | Path | Mapping[str, Any]) -> tuple[Campaign, Source]:
    """A campaign file, a shipped campaign's name or a mapping, validated; raises InputError with "file:line" per problem."""
    source = campaign_source(campaign)
    for key in ("cases", "benchmark"):
        if key in source.data:
            raise InputError(
                f"{source.where((key,))}: the key {key!r} makes it a benchmark's file; "
                f"run it with `fatigue-runner benchmark work-precision {source.name}`"
            )
    return parse_campaign(source), source


def campaign_source(campaign: str | Path | Mapping[str, Any]) -> Source:
    """What the file holds; a bare word such as `quickstart` that is no file here names a shipped campaign."""
    if not isinstance(campaign, Mapping):
        path = Path(campaign)
        if path.name == str(campaign) and not path.suffix and not path.exists():
            path = shipped.campaign(path.name)
        return read_mapping(path, "campaign", "name, duration, wind, integrators, ...")
    return Source("campaign", campaign, what="campaign")


def parse_campaign(source: Source) -> Campaign:
    """The validated campaign; raises InputError with one sentence and "file:line" per problem."""
    return validated(Campaign, source)
