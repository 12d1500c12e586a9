"""What must be known before the cases run: starts of all winds, what is refused, how far the reference can be trusted.

Finding it takes compiler, kernels and tables, a quarter of a gigabyte, and what is found is small: so that the run's own process need
not have them, a worker prepares where there are workers.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.campaign.about import about, operating_curve, timed_evaluations, wind_words
from fatigue_runner.campaign.check import check
from fatigue_runner.campaign.resolve import Named, Resolved, resolve
from fatigue_runner.campaign.trust import reference_facts

if TYPE_CHECKING:
    from fatigue_runner.turbine.section_loads import SectionLoads


@dataclass(frozen=True)
class Start:
    """A wind's state (size,) at t = 0; winds of one `grid` (cells in time, number of signals) can share a block."""

    initial: NDArray[np.float64]
    grid: Hashable


@dataclass(frozen=True)
class Prepared:
    """starts: by the winds' ids; signals: of the wind that has most; notes: what a person should know before the run."""

    starts: dict[str, Start]
    signals: int
    notes: list[str]
    sections: SectionLoads | None


def prepared(resolved: Resolved) -> Prepared:
    """Checked as a whole. Raises InputError, with the line, for what does not go together."""
    layout = resolved.turbine.layout
    notes = check(resolved)
    starts = {
        wind.named.id: Start(wind.initial, (wind.source.cell_key, layout.wind_size(wind.source.channels)))
        for wind in resolved.winds
    }
    signals = max(len(wind.source.channels) for wind in resolved.winds)
    return Prepared(starts, signals, notes, resolved.sections)


def prepare(named: Named, earlier: Mapping[str, Any]) -> tuple[Prepared, dict[str, Any]]:
    """What is prepared, and what run.json says of the run; earlier: the run.json of a run that goes on.

    Raises InputError, with the line, for what cannot be made or does not go together.
    """
    resolved = resolve(named)
    ready = prepared(resolved)
    facts = about(named) | reference_facts(resolved, earlier)
    said = {
        "cases": len(named.realisations) * len(named.integrations),
        "facts": facts,
        "campaign": named.campaign.model_dump(),
        "wind": wind_words(resolved),
        "operating_curve": operating_curve(resolved),
    }
    if named.campaign.delta_t:
        said["evaluation_times"] = timed_evaluations(resolved, earlier)
    return ready, said
