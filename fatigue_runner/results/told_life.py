"""A life of anything that holds results, for whoever works in Python."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fatigue_runner.errors import InputError
from fatigue_runner.inputs.section import validated
from fatigue_runner.inputs.source import Source
from fatigue_runner.results import life_words
from fatigue_runner.results.cells import Row
from fatigue_runner.results.frames import rows_of
from fatigue_runner.results.lifetime import Life, life_of
from fatigue_runner.results.lifetime_section import LifetimeSection
from fatigue_runner.results.run_file import read_run_file
from fatigue_runner.results.table import read_rows


class ToldLife(Life):
    """A life that prints as its words."""

    def __str__(self) -> str:
        places, loads = life_words.places_in_words(self), life_words.loads_in_words(self)
        return "\n".join([*places, *loads, *self.statement(), *life_words.distrust(self)])


def lifetime(results: Any, climate: Any = None, **keys: Any) -> ToldLife:
    """The life that results stand for, under the climate of a site.

    results: of `run_campaign`, a run folder, a pandas DataFrame, a pyarrow Table, or rows as dicts. climate: "I", "II", "III",
    {"weibull": {"mean": 8.2, "shape": 2.1}} or {"table": {"speeds": [...], "probabilities": [...]}}; None takes that of the run folder's
    own campaign. keys: `years`, `n_eq`, `bins`, `availability`, `renormalise` and the others of a campaign's `lifetime`, over those of the
    run folder. Raises InputError for a wrong key, for winds that make no bins, and without a climate.
    """
    given: dict[str, Any] = {}
    if isinstance(results, str | Path):
        given = _section_of(Path(results))
        rows: Sequence[Row] = read_rows(Path(results))
    else:
        rows = rows_of(results)
        given = _section_of(results.out) if hasattr(results, "out") else {}
    given |= keys if climate is None else keys | {"climate": climate}
    if "climate" not in given:
        raise InputError(
            'a life needs a climate: lifetime(results, climate="II"), or a campaign with `lifetime`'
        )
    life = life_of(rows, validated(LifetimeSection, Source("lifetime", given, what="lifetime")))
    return ToldLife(life.section, life.climate, life.bins, life.loads, life.damages, life.sections)


def _section_of(folder: Path) -> dict[str, Any]:
    """What the campaign of a run folder says of its life; nothing where it says nothing."""
    try:
        found = read_run_file(folder)["campaign"].get("lifetime")
    except (OSError, KeyError, AttributeError):
        return {}
    return {key: value for key, value in (found or {}).items() if value is not None}
