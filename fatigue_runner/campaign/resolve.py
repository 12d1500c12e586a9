"""From the words of a campaign file to what they name, in two steps.

`named_by` says what there is: turbine, integrators, winds by their names. That is enough to tell the cases and which of them are
finished, and takes neither the compiler nor any wind. `resolve` makes it: pitch, winds and starts, each once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.campaign.bounds import check_memory, check_steps, realisations
from fatigue_runner.campaign.integration import Integration, file_hash, load_corrector
from fatigue_runner.campaign.spec import Campaign, IntegratorSection
from fatigue_runner.errors import InputError
from fatigue_runner.fatigue.sections import Wall
from fatigue_runner.inputs.source import Place, Source
from fatigue_runner.inputs.sweep import expand
from fatigue_runner.rotor import Rotor
from fatigue_runner.wind.section import Realisation, Site
from fatigue_runner.wind.source import WindSource

if TYPE_CHECKING:
    from fatigue_runner.integrators import Ensemble
    from fatigue_runner.integrators.pitch import PitchSeries
    from fatigue_runner.turbine import Turbine
    from fatigue_runner.turbine.section_loads import SectionLoads

# Above this the tip-speed ratio of a 5-MW-sized rotor leaves the aerodynamic tables for good.
HIGHEST_WIND_SPEED = 40.0


@dataclass(frozen=True, eq=False)
class ResolvedWind:
    """One wind of the campaign: what names it, what blows, the state (size,) in which its cases start, and what one should know of it."""

    named: Realisation
    source: WindSource
    initial: NDArray[np.float64]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Named:
    """A campaign and what it names. `turbine_source` is what a worker gives to `load_turbine`."""

    campaign: Campaign
    source: Source
    turbine: Turbine
    turbine_source: str
    integrations: list[Integration]  # the reference first
    realisations: list[Realisation]  # the winds, by name
    walls: dict[str, Wall] = field(default_factory=dict)  # of the places whose damage is counted


@dataclass(frozen=True, eq=False, kw_only=True)
class Resolved(Named):
    """A campaign and everything that it names, made; pitch [rad]."""

    pitch: float | PitchSeries
    winds: list[ResolvedWind]
    sections: SectionLoads | None = None  # what makes the loads of sections, where some are asked for

    @property
    def operating_wind(self) -> tuple[float, float] | None:
        """Where the turbine turns [m/s]; known of one under control only."""
        return self.turbine.operating_wind if self.campaign.operation == "controlled" else None

    def ensemble(
        self, winds: Sequence[ResolvedWind] | None = None, duration: float | None = None
    ) -> Ensemble:
        """The cases of one integrator: of all winds, or of some, up to `duration` [s] where it is given."""
        from fatigue_runner.integrators import Ensemble

        chosen = self.winds if winds is None else winds
        return Ensemble(
            self.turbine,
            [wind.source for wind in chosen],
            np.stack([wind.initial for wind in chosen]),
            self.campaign.duration if duration is None else duration,
            1.0 / self.campaign.output_rate,
            self.pitch,
        )


def named_by(campaign: Campaign, source: Source) -> Named:
    """What a campaign names. Raises InputError, with the line, for what is not there or cannot be read, and for too much."""
    turbine_source = _turbine_source(campaign, source)
    turbine = _operated(_load_turbine(turbine_source, source), campaign, source)
    integrations = _integrations(campaign, source)
    check_steps(campaign, integrations, source)
    check_memory(campaign, source)
    site = Site(turbine.rotor, campaign.duration, Place(source, ("wind",)))
    winds = realisations(campaign, site, len(integrations), source)
    return Named(
        campaign, source, turbine, turbine_source, integrations, winds, _walls(campaign, turbine, source)
    )


def resolve(named: Named) -> Resolved:
    """Everything that a campaign names, made. Raises InputError, with the line, for what cannot be made."""
    campaign, turbine, source = named.campaign, named.turbine, named.source
    _check_loop(turbine, source)
    pitch = _pitch(campaign, turbine, source)
    _check_methods(named.integrations, source)
    winds = _winds(named, pitch)
    sections = _sections(campaign, turbine, source)
    given = {item.name: getattr(named, item.name) for item in fields(Named)}
    return Resolved(**given, pitch=pitch, winds=winds, sections=sections)


def _sections(campaign: Campaign, turbine: Turbine, source: Source) -> SectionLoads | None:
    """What makes the loads of sections; refused off the tower and the blade."""
    try:
        return campaign.loads.of(turbine)
    except InputError as error:
        raise InputError(f"{source.where(('loads',))}: {error}") from None


def _walls(campaign: Campaign, turbine: Turbine, source: Source) -> dict[str, Wall]:
    """The walls whose damage is counted, by place; refused where the turbine does not say how thick they are."""
    found = {}
    for index, entry in enumerate(campaign.fatigue.damage):
        try:
            found[entry.place] = entry.wall(turbine.sections)
        except InputError as error:
            raise InputError(f"{source.where(('fatigue', 'damage', index))}: {error}") from None
    return found


def _turbine_source(campaign: Campaign, source: Source) -> str:
    """A shipped turbine's name, or a YAML's path relative to the campaign file."""
    name = campaign.turbine
    return str(source.file(name)) if Path(name).suffix or "/" in name or "\\" in name else name


def _load_turbine(turbine: str, source: Source) -> Turbine:
    from fatigue_runner.turbine import load_turbine

    try:
        return load_turbine(turbine)
    except InputError as error:
        raise InputError(f"{source.where(('turbine',))}: {error}") from None


def _operated(turbine: Turbine, campaign: Campaign, source: Source) -> Turbine:
    try:
        return turbine.operated(campaign.operation)
    except InputError as error:
        raise InputError(f"{source.where(('operation',))}: {error}") from None


def _check_loop(turbine: Turbine, source: Source) -> None:
    """Refuses a controller that makes the turbine unstable."""
    from fatigue_runner.turbine.loop import check_loop

    try:
        check_loop(turbine)
    except InputError as error:
        raise InputError(f"{source.where(('operation',))}: {error}") from None


def _pitch(campaign: Campaign, turbine: Turbine, source: Source) -> float | PitchSeries:
    """The pitch [rad]; refused outside the aerodynamic tables, and a schedule that is too short or does not fit."""
    from fatigue_runner.integrators.pitch import PitchSeries

    pitch = campaign.blade_pitch
    try:
        if isinstance(pitch, PitchSeries):
            pitch.cells(turbine.pitch_range, campaign.duration)
            turbine.pitched_kernel_data()
        else:
            turbine.kernel_data(pitch)
    except InputError as error:
        raise InputError(f"{source.where(('pitch',))}: {error}") from None
    return pitch


def _integrations(campaign: Campaign, source: Source) -> list[Integration]:
    """The reference first, then every integrator at each of its steps; correctors are found and read here."""
    reference = campaign.reference
    found = [Integration(reference.method, reference.step, True, ("reference",))] if reference else []
    for index, section in enumerate(campaign.integrators):
        path = ("integrators", index)
        corrector = _corrector(section, source, path)
        found += [
            Integration(section.method, step, False, path, **corrector) for step, _ in expand(section.step)
        ]
    return found


def _check_methods(integrations: Sequence[Integration], source: Source) -> None:
    """Refuses methods that nobody knows."""
    from fatigue_runner.integrators import method

    for integration in integrations:
        try:
            method(integration.method)
        except InputError as error:
            raise InputError(f"{source.where((*integration.path, 'method'))}: {error}") from None


def _corrector(section: IntegratorSection, source: Source, path: tuple[str | int, ...]) -> dict[str, str]:
    """The fields of an `Integration` that say which corrector; none where there is none."""
    if section.corrector is None:
        return {}
    from fatigue_runner.corrector import library

    try:
        file = library.locate(
            section.corrector, [source.folder, source.file(section.corrector).parent]
        ).resolve()
        digest = file_hash(file)
        name = load_corrector(str(file), digest).name
    except InputError as error:
        raise InputError(f"{source.where((*path, 'corrector'))}: {error}") from None
    return {"corrector": name, "mode": section.mode, "file": str(file), "digest": digest}


def _winds(named: Named, pitch: float | PitchSeries) -> list[ResolvedWind]:
    """Every wind with its start; those of one mean wind share it."""
    from fatigue_runner.turbine.envelope import check_wind

    campaign, turbine, place = named.campaign, named.turbine, Place(named.source, ("wind",))
    winds, starts, told_of = [], _Starts(campaign, turbine, pitch), cache(partial(check_wind, turbine))
    for wind in named.realisations:
        where = place.where(*wind.path)
        blowing = _blowing(wind, turbine.rotor, campaign.duration, where)
        try:
            told = told_of(blowing.mean_speed)
            notes = (*blowing.notes, *([f"{where}: {told}"] if told else []))
            winds.append(ResolvedWind(wind, blowing, starts.of(blowing), notes))
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
    return winds


def _blowing(named: Realisation, rotor: Rotor, duration: float, where: str) -> WindSource:
    """The wind source; refused outside the tables or where it is too short."""
    if named.mean_speed is not None:
        _check_speed(named.mean_speed, where)
    try:
        wind = named.build(rotor)
        speed, length = wind.mean_speed, wind.length  # a file's are known when it has been read
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    _check_speed(speed, where)
    if length < duration * (1 - 1e-9):
        raise InputError(
            f"{where}: the wind {wind.name} is {length:g} s long, the campaign runs "
            f"{duration:g} s; give a longer file or a shorter `duration`"
        )
    return wind


def _check_speed(speed: float, where: str) -> None:
    if not 0.0 < speed <= HIGHEST_WIND_SPEED:
        raise InputError(
            f"{where}: wind speed {speed:g} m/s is outside the aerodynamic tables; "
            f"use speeds above 0 and up to {HIGHEST_WIND_SPEED:g} m/s"
        )


class _Starts:
    """The state in which a wind's cases start, found once per mean wind: so a wind without one is refused before anything runs."""

    def __init__(self, campaign: Campaign, turbine: Turbine, pitch: float | PitchSeries) -> None:
        from fatigue_runner.integrators.pitch import first_pitch

        self._turbine, self._initial, self._pitch = turbine, campaign.initial, first_pitch(pitch)
        self._found: dict[Any, NDArray[np.float64]] = {}

    def of(self, wind: WindSource) -> NDArray[np.float64]:
        from fatigue_runner.integrators.initial import initial_state

        label = wind.label
        key = wind.axial_speed, label.get("vertical_shear"), label.get("horizontal_shear")
        if key not in self._found:
            self._found[key] = initial_state(self._turbine, self._initial, wind, self._pitch)
        return self._found[key]
