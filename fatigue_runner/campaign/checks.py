"""What only the turbine and the integrators know: refusals that need more than the campaign file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner.campaign.cases import Integration, integrations
from fatigue_runner.campaign.spec import Campaign, Pitch
from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.inputs.source import Source
from fatigue_runner.integrators.initial import initial_state
from fatigue_runner.wind.section import Realisation

# Above this the tip-speed ratio of a 5-MW-sized rotor leaves the aerodynamic tables for good.
HIGHEST_WIND_SPEED = 40.0


def turbine_source(campaign: Campaign, source: Source) -> str:
    """What `load_turbine` takes: a shipped turbine's name, or a YAML's path relative to the campaign file."""
    name = campaign.turbine
    return str(source.file(name)) if Path(name).suffix in {".yaml", ".yml"} or "/" in name else name


def load_turbine(campaign: Campaign, source: Source) -> Any:
    """The campaign's turbine; raises InputError with the line that names it."""
    from fatigue_runner.turbine import load_turbine as load

    try:
        return load(turbine_source(campaign, source))
    except InputError as error:
        raise InputError(f"{source.where(('turbine',))}: {error}") from None


def check_pitch(campaign: Campaign, turbine: Any, source: Source) -> None:
    """Raise InputError, with the line, for a pitch outside the aerodynamic tables, or a schedule that is too short or does not fit."""
    from fatigue_runner.integrators.pitch import PitchSeries

    try:
        pitch = campaign.blade_pitch
        if isinstance(pitch, PitchSeries):
            pitch.cells(turbine, campaign.duration)
            turbine.pitched_kernel_data()
        else:
            turbine.kernel_data(pitch)
    except InputError as error:
        raise InputError(f"{source.where(('pitch',))}: {error}") from None


def check_integrators(campaign: Campaign, turbine: Any, source: Source) -> None:
    """Raise InputError for an unknown method and for a step above its stability limit on this turbine."""
    from fatigue_runner import integrators

    for integration in integrations(campaign, source):
        if integration.method not in integrators.METHODS:
            where = source.where((*integration.path, "method"))
            hint = did_you_mean(integration.method, integrators.METHODS)
            raise InputError(f"{where}: unknown integrator {integration.method!r}{hint}")
        if isinstance(campaign.pitch, Pitch):
            _check_varying_pitch(integration, source)
        if integration.corrector:
            # it may hold a step that the method alone does not; its own binding says what it fits
            _check_corrector(integration, turbine, source)
            continue
        limit = integrators.stability_limit(turbine, integration.method)
        if integration.step > limit:
            raise InputError(
                f"{source.where((*integration.path, 'step'))}: {_unstable(integration, limit, turbine)}"
            )


def _check_varying_pitch(integration: Integration, source: Source) -> None:
    from fatigue_runner.integrators import method

    if integration.corrector or not method(integration.method).varying_pitch:
        what = f"corrector {integration.corrector}" if integration.corrector else integration.method
        raise InputError(
            f"{source.where(integration.path)}: {what} is made for one pitch; with a pitch that varies in time use "
            "Runge-Kutta and Adams methods without corrector"
        )


def _check_corrector(integration: Integration, turbine: Any, source: Source) -> None:
    from fatigue_runner.corrector import load

    try:
        load(integration.file).bind(turbine, integration.method, integration.step)
    except InputError as error:
        raise InputError(f"{source.where((*integration.path, 'corrector'))}: {error}") from None


def unseen_winds(found: Sequence[Integration], winds: Sequence[Any], source: Source) -> list[str]:
    """One sentence per corrector that meets mean wind speeds outside those it was trained on: allowed, but said."""
    from fatigue_runner.corrector import load

    notes = {}
    for integration in found:
        if integration.file:
            low, high = load(integration.file).wind_range
            outside = sorted({w.mean_speed for w in winds if not low <= w.mean_speed <= high})
            if outside:
                notes[integration.corrector] = (
                    f"{source.where((*integration.path, 'corrector'))}: {integration.corrector} was trained on winds of "
                    f"{low:.3g} to {high:.3g} m/s; {len(outside)} mean wind speed(s) lie outside, up to {outside[-1]:g} m/s: "
                    "look at the acceptance rate"
                )
    return list(notes.values())


def _unstable(integration: Integration, limit: float, turbine: Any) -> str:
    return (
        f"{integration.method} at {integration.step * 1e3:g} ms is unstable on {turbine.name}: "
        f"its stability limit is {limit * 1e3:.3g} ms; use a smaller step"
    )


def build_winds(cases: Sequence[Realisation], campaign: Campaign, source: Source) -> list[Any]:
    """The wind sources; raises InputError, with the line, for a wind outside the tables or too short."""
    winds = []
    for case in cases:
        where = source.where(("wind", *case.path))
        if case.mean_speed is not None:
            _check_speed(case.mean_speed, where)
        try:
            wind = case.build()
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        _check_speed(wind.mean_speed, where)
        if wind.length < campaign.duration * (1 - 1e-9):
            raise InputError(
                f"{where}: the wind {wind.name} is {wind.length:g} s long, the campaign runs "
                f"{campaign.duration:g} s; give a longer file or a shorter `duration`"
            )
        winds.append(wind)
    return winds


def initial_states(
    cases: Sequence[Realisation], winds: Sequence[Any], campaign: Campaign, turbine: Any, source: Source
) -> dict[str, np.ndarray]:
    """{wind id: state (16,) at t = 0}; raises InputError, with the line, where there is no operating point.

    Found here, once per mean wind, so that a wind without one is refused before anything runs.
    """
    from fatigue_runner.integrators.pitch import first_pitch

    found: dict[Any, np.ndarray] = {}
    states = {}
    pitch = first_pitch(campaign.blade_pitch)
    for case, wind in zip(cases, winds, strict=True):
        label = wind.label
        key = wind.mean_speed, label.get("vertical_shear"), label.get("horizontal_shear")
        if key not in found:
            try:
                found[key] = initial_state(turbine, campaign.initial, wind, pitch)
            except InputError as error:
                raise InputError(f"{source.where(('wind', *case.path))}: {error}") from None
        states[case.id] = found[key]
    return states


def _check_speed(speed: float, where: str) -> None:
    if not 0.0 < speed <= HIGHEST_WIND_SPEED:
        raise InputError(
            f"{where}: wind speed {speed:g} m/s is outside the aerodynamic tables; "
            f"use speeds above 0 and up to {HIGHEST_WIND_SPEED:g} m/s"
        )
