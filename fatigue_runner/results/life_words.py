"""A life in words: how long each place lasts, which wind does it, which integrator is good enough for it, and what to distrust."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from fatigue_runner.channels import BY_NAME
from fatigue_runner.fatigue.sections import PLACES
from fatigue_runner.results.cells import format_count, format_percent
from fatigue_runner.results.lifetime import Figure, Key, Life, label_of
from fatigue_runner.results.ranking import MethodSummary

LONG = 1000.0  # years; what lasts longer does not govern, and its digits mean nothing
PART_OF_SCATTER = 0.1  # an integrator is good enough for a life where it errs by less than this share of what the seeds leave
WITHOUT_SCATTER = 0.01  # and by less than this where one seed says nothing of it
LEAST_SEEDS = 6  # IEC 61400-1:2019, 7.5: stochastic realisations for each mean wind speed
SHORT = 600.0  # s, the ten minutes of the same clause


def told(life: Life) -> Key | None:
    """The integrator whose life is told: the reference, or the one with most winds where there is none."""
    if not life.loads:
        return None
    return max(
        life.integrators, key=lambda key: (key[-1], max(f.covered for f in life.loads if f.integrator == key))
    )


def place_label(place: str) -> str:
    """A place as a person reads it."""
    return PLACES[place].label if place in PLACES else place.replace("_", " ")


def years_text(years: float | None) -> str:
    """Years as a person reads them: two digits, and no more than is known."""
    if years is None or years > LONG:
        return f"more than {LONG:g}"
    return f"{years:.3g}" if years >= 100 else f"{years:.2g}"


def places_in_words(life: Life) -> list[str]:
    """A sentence for each place, the one that lasts shortest first."""
    key = told(life)
    if key is None:
        return []
    found = [(life.hot_spot(key, place), place) for place in life.places]
    found.sort(key=lambda item: -(item[0].value or 0.0) if item[0] else math.inf)
    return [_place(life, figure, place) for figure, place in found]


def _place(life: Life, figure: Figure | None, place: str) -> str:
    name = place_label(place)
    if figure is None:
        return f"{name[:1].upper()}{name[1:]}: no life, no case counts."
    years = life.years_of(figure)
    between = ""
    if figure.low is not None and figure.high is not None and (years or LONG) < LONG:
        low, high = (life.section.years / d if d else math.inf for d in (figure.high, figure.low))
        between = (
            f" (the seeds leave {years_text(low)} to {years_text(high)}, {life.section.confidence:.0%} of it)"
        )
    return f"{name[:1].upper()}{name[1:]}: {years_text(years)} years{between} at azimuth {figure.at:.0f}°{_wind(life, figure)}."


def _wind(life: Life, figure: Figure) -> str:
    place = figure.governing
    if place is None:
        return ", where nothing wears"
    wind = life.bins[place]
    return f"; winds of {wind.low:g} to {wind.high:g} m/s do {figure.shares[place]:.0%} of the damage"


def loads_in_words(life: Life) -> list[str]:
    """A sentence on the lifetime loads: each channel at its customary exponent."""
    key = told(life)
    if key is None:
        return []
    said = []
    for channel in dict.fromkeys(f.name for f in life.loads):
        exponents = [f.at for f in life.loads if f.integrator == key and f.name == channel]
        figure = life.load(key, channel, customary_exponent(channel, exponents))
        if figure is not None and figure.value is not None:
            known = BY_NAME.get(channel)
            scale, unit, label = (known.scale, known.read_unit, known.label) if known else (1.0, "", channel)
            plus = "" if figure.scatter is None else f" ± {format_percent(figure.scatter)}"
            said.append(f"{label} {figure.value * scale:.0f} {unit}{plus} (m = {figure.at:g})")
    if not said:
        return ["No lifetime load: no case counts."]
    return [
        f"Lifetime equivalent loads for {cycles_text(life.section.n_eq)} cycles in {life.section.years:g} years: {'; '.join(said)}."
    ]


def cycles_text(number: float) -> str:
    """A number of cycles as a person reads it: 1e7."""
    return f"{number:g}".replace("e+0", "e").replace("e+", "e")


def customary_exponent(channel: str, exponents: Iterable[float]) -> float:
    """The exponent nearest to the material's: 10 for a blade's composite, 4 for welded steel elsewhere."""
    wanted = 10.0 if channel.startswith("blade") else 4.0
    return min(exponents, key=lambda m: (abs(m - wanted), m))


def worst_error(life: Life, key: Key) -> Figure | None:
    """The lifetime load that an integrator gets most wrong, against what its seeds leave; None where nothing was compared."""
    found = [f for f in life.loads if f.integrator == key and f.error is not None]
    return max(found, key=lambda f: abs(f.error or 0.0) / (f.scatter or WITHOUT_SCATTER), default=None)


def good_enough(life: Life, key: Key) -> bool:
    """Whether an integrator errs by a tenth of what the seeds leave open, or less, in every lifetime load, and lost no case."""
    mine = [f for f in life.loads if f.integrator == key and f.value is not None]
    compared = [f for f in mine if f.error is not None]
    return bool(compared) and all(
        f.lost_cases == 0
        and abs(f.error or 0.0) <= (PART_OF_SCATTER * f.scatter if f.scatter else WITHOUT_SCATTER)
        for f in compared
    )


def integrator_in_words(life: Life, summaries: Sequence[MethodSummary]) -> list[str]:
    """Which integrator is good enough for this life, and what it saves."""
    tested = [s for s in summaries if not s.is_reference and worst_error(life, s.key) is not None]
    if not tested:
        return []
    reference = next((s for s in summaries if s.is_reference), None)
    good = [s for s in tested if good_enough(life, s.key) and s.evaluations_per_second is not None]
    if not good:
        least = min(tested, key=lambda s: abs(_error(life, s)))
        return [
            f"No integrator errs by less than a tenth of what the seeds leave open in every lifetime load; the nearest is {least.label} "
            f"with {_of(life, least)}."
        ]
    best = min(good, key=lambda s: s.evaluations_per_second or math.inf)
    saved = ""
    if reference and reference.evaluations_per_second and best.evaluations_per_second:
        ratio = reference.evaluations_per_second / best.evaluations_per_second
        saved = f", {format_count(ratio)} times cheaper than the reference" if ratio >= 1.05 else ""
    return [f"Good enough for this life: {best.label}{saved}; at worst it errs by {_of(life, best)}."]


def _error(life: Life, summary: MethodSummary) -> float:
    figure = worst_error(life, summary.key)
    return math.inf if figure is None or figure.error is None else figure.error


def _of(life: Life, summary: MethodSummary) -> str:
    figure = worst_error(life, summary.key)
    assert figure is not None and figure.error is not None, "compared"
    known = BY_NAME.get(figure.name)
    label = known.label.removesuffix(" moment") if known else figure.name
    seeds = "" if figure.scatter is None else f" where the seeds leave ± {format_percent(figure.scatter)}"
    return f"{format_percent(abs(figure.error))} ({label}, m = {figure.at:g}){seeds}"


def distrust(life: Life, counted: float | None = None) -> list[str]:
    """What limits the life, a sentence each; counted: seconds of every case."""
    said = []
    lost: dict[tuple[int, float], list[str]] = {}
    for key in life.integrators:
        found = max((f for f in life.loads if f.integrator == key), key=lambda f: f.lost, default=None)
        if found is not None and found.lost_cases:
            lost.setdefault((found.lost_cases, found.lost), []).append(label_of(key))
    for (cases, probability), labels in lost.items():
        said.append(
            f"{', '.join(labels)}: {cases} case{'s' * (cases != 1)} with a probability of {probability:.4f} "
            f"{'are' if cases != 1 else 'is'} lost; the life is that of the others, as if nothing wore in the lost winds."
        )
    seeds = min(wind.winds for wind in life.bins)
    if seeds < LEAST_SEEDS:
        said.append(
            f"The emptiest bin has {seeds} wind{'s' * (seeds != 1)}; IEC 61400-1 asks for {LEAST_SEEDS}. "
            + (
                "With one there is no telling what the seeds leave."
                if seeds < 2
                else "The interval of so few is too narrow."
            )
        )
    if counted is not None and counted < SHORT:
        said.append(
            f"Each case counts {counted:g} s where IEC 61400-1 asks for {SHORT:g} s: slow gusts and rare cycles are missing."
        )
    if not life.places:
        said.append(
            "No S-N curve was given (`fatigue.damage`), so that there are lifetime loads, but no life in years."
        )
    return said
