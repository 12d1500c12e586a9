"""What only turbine and integrators know of each other: refusals before anything runs, and what a person should know."""

from __future__ import annotations

from fatigue_runner import channels
from fatigue_runner.campaign.about import wind_words
from fatigue_runner.campaign.integration import Integration
from fatigue_runner.campaign.kept_logs import KeptLogs
from fatigue_runner.campaign.resolve import Resolved
from fatigue_runner.campaign.spec import Pitch
from fatigue_runner.errors import InputError
from fatigue_runner.integrators.pitch import PitchSeries
from fatigue_runner.results.beyond import no_pitch_control
from fatigue_runner.results.lifetime_section import check_covered
from fatigue_runner.turbine.dynamics import signals_of_control
from fatigue_runner.turbine.rated import rated_rotor_speed, rated_speed_wind


def check(resolved: Resolved) -> list[str]:
    """Sentences that a person should read before the run.

    Raises InputError, with the line, for a step above the stability limit, a corrector that does not fit, a method that cannot
    take the campaign's pitch, a step that is too long for the wind's harmonics, a channel to log that not every wind has, and winds
    that make no bins of a life.
    """
    _check_logged_channels(resolved)
    _check_kept_logs(resolved)
    _check_lifetime(resolved)
    for integration in resolved.integrations:
        try:
            _check(integration, resolved)
        except _Refused as refused:
            where = resolved.source.where((*integration.path, *refused.key))
            raise InputError(f"{where}: {refused}") from None
    return [*_fixed_pitch(resolved), *wind_words(resolved)["notes"], *_unseen_winds(resolved)]


def _fixed_pitch(resolved: Resolved) -> list[str]:
    """That nobody pitches, where the rotor so reaches its rated speed, and which winds are above."""
    if resolved.campaign.operation != "fixed":
        return []
    rated = rated_rotor_speed(resolved.turbine)
    at = (
        None
        if isinstance(resolved.pitch, PitchSeries)
        else rated_speed_wind(resolved.turbine, resolved.pitch)
    )
    if at is None:
        return [no_pitch_control(rated)]
    above = sum(wind.source.mean_speed > at for wind in resolved.winds)
    beyond = (
        f", and {above} of {len(resolved.winds)} winds are above: use operation: controlled there"
        if above
        else ""
    )
    return [f"{no_pitch_control(rated)} It turns so fast in some {at:.2g} m/s{beyond}."]


def _check_logged_channels(resolved: Resolved) -> None:
    """What not every case has: the spec knows all names, only winds and controller which of them there are."""
    some = (*channels.WIND_ACROSS, *channels.WIND_HARMONICS)
    everywhere = set(some).intersection(*(wind.source.channels for wind in resolved.winds))
    missing = {c.name for c in some if c not in everywhere}
    turbine, log = resolved.turbine, resolved.campaign.log
    seen = () if turbine.controller is None else tuple(c.name for c in turbine.controller.seen)
    of_others = set(signals_of_control()) - {*turbine.layout.names, *seen}
    for index, name in enumerate(log.channels or ()):
        where = resolved.source.where(("log", "channels", index))
        if name in missing and channels.BY_NAME[name] in channels.WIND_ACROSS:
            raise InputError(
                f"{where}: {name!r} cannot be logged, the wind blows straight on; remove it or "
                "give the wind `yaw_misalignment` or `upflow`"
            )
        if name in missing:
            harmonics = min(wind.source.harmonics for wind in resolved.winds)
            raise InputError(
                f"{where}: {name!r} cannot be logged, the wind has {harmonics} azimuthal "
                f"harmonic{'s' * (harmonics != 1)}; remove it or give the wind more `harmonics`"
            )
        if name in of_others:
            raise InputError(
                f"{where}: {name!r} cannot be logged with operation {turbine.operation!r}; remove it or use operation: controlled"
            )
    if "control" in (log.topics or ()) and not seen:
        where = resolved.source.where(("log", "topics", (log.topics or []).index("control")))
        raise InputError(
            f"{where}: with operation {turbine.operation!r} there is no controller to log; remove 'control'"
        )


def _check_kept_logs(resolved: Resolved) -> None:
    """What is chosen by errors needs what they are measured against."""
    kept = resolved.campaign.log.cases
    if isinstance(kept, KeptLogs) and kept.worst is not None and resolved.campaign.reference is None:
        raise InputError(
            f"{resolved.source.where(('log', 'cases', 'worst'))}: without a reference nobody knows which cases are the worst; use `sample` "
            "or give a reference"
        )


def _check_lifetime(resolved: Resolved) -> None:
    """The winds must fill the bins of a life; under control these must cover the operating range."""
    section = resolved.campaign.lifetime
    if section is None:
        return
    try:
        bins = section.bins_of([wind.source.mean_speed for wind in resolved.winds])
        operating = resolved.operating_wind
        if operating is not None and section.operating_range is None:
            check_covered(bins, operating)
    except InputError as error:
        raise InputError(f"{resolved.source.where(('lifetime', 'bins'))}: lifetime: {error}") from None


class _Refused(Exception):
    """A sentence, and the key of the integrator's section that it is about."""

    def __init__(self, sentence: str, *key: str) -> None:
        super().__init__(sentence)
        self.key = key


def _check(integration: Integration, resolved: Resolved) -> None:
    from fatigue_runner.integrators import refuse_unresolved, stability_limit

    built = integration.build()
    try:
        # seeds differ in nothing that a step must resolve
        alike = {(w.source.harmonics, w.source.mean_speed, id(w.initial)): w for w in resolved.winds}
        for wind in alike.values():
            refuse_unresolved(resolved.turbine, wind.source, wind.initial, integration.step)
    except InputError as error:
        raise _Refused(str(error), "step") from None
    if isinstance(resolved.campaign.pitch, Pitch) and (built.corrector or not built.found.varying_pitch):
        what = f"corrector {integration.corrector}" if built.corrector else integration.method
        raise _Refused(
            f"{what} is made for one pitch; with a pitch that varies in time use Runge-Kutta and Adams methods without corrector"
        )
    if built.corrector:
        # it may hold a step that the method alone does not; its own binding says what it fits
        try:
            built.corrector.bind(resolved.turbine, integration.method, integration.step)
        except InputError as error:
            raise _Refused(str(error), "corrector") from None
        return
    limit = stability_limit(resolved.turbine, integration.method)
    if integration.step > limit:
        raise _Refused(
            f"{integration.method} at {integration.step * 1e3:g} ms is unstable on {resolved.turbine.name}: "
            f"its stability limit is {limit * 1e3:.3g} ms; use a smaller step",
            "step",
        )


def _unseen_winds(resolved: Resolved) -> list[str]:
    """One sentence per corrector that meets mean wind speeds outside those it was trained on: allowed, but said."""
    notes = {}
    speeds = sorted({wind.source.mean_speed for wind in resolved.winds})
    for integration in resolved.integrations:
        corrector = integration.build().corrector
        if corrector is None:
            continue
        low, high = corrector.wind_range
        outside = [speed for speed in speeds if not low <= speed <= high]
        if outside:
            notes[integration.corrector] = (
                f"{resolved.source.where((*integration.path, 'corrector'))}: {integration.corrector} was trained on winds of "
                f"{low:.3g} to {high:.3g} m/s; {len(outside)} mean wind speed(s) lie outside, up to {outside[-1]:g} m/s: "
                "look at the acceptance rate"
            )
    return list(notes.values())
