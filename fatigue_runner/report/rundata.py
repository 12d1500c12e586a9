"""A run folder as the report sees it: the results table, the resolved campaign, and the logs, each read once.

Settings and facts come from `run.json`; a folder without one (results from elsewhere) falls back to
`campaign.yaml` and to the metadata of a log.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fatigue_runner.errors import FatigueRunnerError, FatigueRunnerWarning, InputError
from fatigue_runner.inputs.source import read_mapping
from fatigue_runner.results.cells import Row, number, text
from fatigue_runner.results.columns import WIND
from fatigue_runner.results.lifetime_section import LifetimeSection
from fatigue_runner.results.ranking import MethodSummary, fatigue_columns, integrator_key, rank, reference_of
from fatigue_runner.results.run_file import read_run_file
from fatigue_runner.results.table import changed_files, read_rows

if TYPE_CHECKING:
    from fatigue_runner.logbook import Log
    from fatigue_runner.results.lifetime import Life


@dataclass(frozen=True)
class WindCase:
    """One wind and every integrator's row for it."""

    speed: float | None
    key: tuple[str, ...]
    rows: tuple[Row, ...]

    def row_of(self, summary: MethodSummary) -> Row | None:
        """The row of an integrator under this wind; None where it did not run."""
        return next((row for row in self.rows if integrator_key(row) == summary.key), None)


class Run:
    """Everything the sections draw on; raises InputError where the folder holds no results."""

    def __init__(
        self,
        folder: Path,
        rows: Sequence[Row],
        campaign: Mapping[str, Any],
        facts: Mapping[str, str] | None = None,
        wind: Mapping[str, list[str]] | None = None,
        operating_curve: Mapping[str, list[float]] | None = None,
    ) -> None:
        self.folder = folder
        self._facts = facts or {}
        self._wind = wind or {}
        self.operating_curve = (
            operating_curve or {}
        )  # steady operation: {channel: values over its `wind_speed`}
        self.rows = list(rows)
        self.campaign = campaign
        self.summaries = rank(self.rows)
        self.columns = fatigue_columns(self.rows)
        self._logs: dict[str, Log | None] = {}

    @property
    def name(self) -> str:
        """The campaign's name; the folder's where the campaign has none."""
        return str(self.campaign.get("name") or self.folder.resolve().name)

    @cached_property
    def _by_integrator(self) -> dict[tuple[Any, ...], list[Row]]:
        found: dict[tuple[Any, ...], list[Row]] = {}
        for row in self.rows:
            found.setdefault(integrator_key(row), []).append(row)
        return found

    def rows_of(self, summary: MethodSummary) -> list[Row]:
        """All rows of one integrator."""
        return self._by_integrator.get(summary.key, [])

    @cached_property
    def reference(self) -> MethodSummary | None:
        """The reference's summary; None where the campaign ran without one."""
        return reference_of(self.summaries)

    @cached_property
    def integrators(self) -> list[MethodSummary]:
        """The summaries of all integrators but the reference, cheapest first."""
        return [summary for summary in self.summaries if not summary.is_reference]

    @cached_property
    def winds(self) -> list[WindCase]:
        """Every wind of the campaign with its rows, slowest first."""
        groups: dict[tuple[str, ...], list[Row]] = {}
        for row in self.rows:
            groups.setdefault(tuple(text(row, column) for column in WIND), []).append(row)
        winds = [WindCase(number(rows[0], "wind_speed"), key, tuple(rows)) for key, rows in groups.items()]
        return sorted(winds, key=lambda wind: (wind.speed is None, wind.speed or 0.0, wind.key))

    @cached_property
    def life(self) -> Life | None:
        """What the cases stand for; None where the campaign does not say of which life, or a wind is missing."""
        given = self.setting("lifetime")
        if given is None:
            return None
        from fatigue_runner.results.lifetime import life_of

        try:
            return life_of(self.rows, LifetimeSection.model_validate(_known(given)))
        except (InputError, ValueError) as error:
            self.no_life = " ".join(str(error).split())
            return None

    no_life: str = ""  # why there is none
    changed: Sequence[str] = ()  # what of the folder is not what the run left, in sentences
    planned: int | None = None  # cases of the campaign, where the folder says so
    evaluation_times: Mapping[
        str, Mapping[str, float]
    ] = {}  # see `results.evaluation_cost`; empty where not measured

    @property
    def missing(self) -> int:
        """Cases of the campaign that the run has not come to."""
        return max(0, (self.planned or 0) - len(self.rows))

    def setting(self, path: str, default: Any = None) -> Any:
        """A value of the resolved campaign by its dotted path; `default` where it is absent or null."""
        value: Any = self.campaign
        for key in path.split("."):
            value = value.get(key) if isinstance(value, Mapping) else None
        return default if value is None else value

    def log(self, case_id: str) -> Log | None:
        """The log of a case; None where it is missing or cannot be read."""
        if case_id not in self._logs:
            self._logs[case_id] = _read_log(self.folder / "logs" / f"{case_id}.mcap")
        return self._logs[case_id]

    def forget_log(self, case_id: str) -> None:
        """Let go of a log that was read, so that a report of hundreds of cases does not hold them all."""
        self._logs.pop(case_id, None)

    @cached_property
    def facts(self) -> list[tuple[str, str]]:
        """What was run, with what, when and where: (name, value) of the page's head."""
        facts = self._facts or self._facts_of_a_log()
        table = self.folder / "results.csv"
        finished = datetime.fromtimestamp(table.stat().st_mtime, tz=UTC) if table.is_file() else None
        shown = {
            "Campaign": self.name,
            "Turbine": str(facts.get("turbine") or self.setting("turbine", "")),
            "Turbine hash": str(facts.get("turbine_hash", ""))[:16],
            "Cases": f"{len(self.winds)} winds × {len(self.summaries)} integrators = {len(self.rows)}",
            "Finished": "not yet" if finished is None else finished.strftime("%Y-%m-%d %H:%M UTC"),
            "Machine": str(facts.get("machine", "")),
            "Versions": str(facts.get("versions", "")),
        }
        return [(name, value) for name, value in shown.items() if value]

    def fact(self, name: str) -> str:
        """A fact of the run by its name in run.json; empty where it is unknown."""
        return str((self._facts or self._facts_of_a_log()).get(name, ""))

    def wind_words(self, what: str) -> list[str]:
        """Sentences about the winds: "descriptions", "left_out" or "notes"; from a log where the folder does not say."""
        if self._wind:
            return list(self._wind.get(what, ()))
        entry = {"descriptions": "wind_description", "left_out": "wind_left_out", "notes": "wind_notes"}[what]
        return [words] if (words := self._facts_of_a_log().get(entry)) else []

    def _facts_of_a_log(self) -> dict[str, str]:
        logs = (self.log(text(row, "case_id")) for row in self.rows[:20])
        return next((dict(log.run) for log in logs if log is not None), {})


def _known(section: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in section.items() if value is not None}


def load_run(folder: Path) -> Run:
    """Read `results.csv` and the settings of a run folder.

    Raises InputError, one sentence, for a folder without results, an empty or foreign table, or unreadable
    settings.
    """
    stored = _stored(folder)
    run = Run(folder, read_rows(folder), *_settings(folder, stored))
    planned, times = stored.get("cases"), stored.get("evaluation_times")
    run.planned = planned if isinstance(planned, int) else None
    run.evaluation_times = times if isinstance(times, Mapping) else {}
    run.changed = changed_files(folder)
    return run


def _stored(folder: Path) -> Mapping[str, Any]:
    """run.json; empty where there is none."""
    try:
        return read_run_file(folder)
    except OSError:
        return {}


def _settings(
    folder: Path, stored: Mapping[str, Any]
) -> tuple[Mapping[str, Any], Mapping[str, str], Mapping[str, list[str]], Mapping[str, list[float]]]:
    """The resolved campaign, the facts (turbine, hash, versions, machine), what is said of the winds, steady operation; empty where
    unknown."""
    if not stored:
        return _read_campaign(folder / "campaign.yaml"), {}, {}, {}
    campaign = stored.get("campaign")
    facts, wind, curve = (stored.get(name, {}) for name in ("facts", "wind", "operating_curve"))
    if not all(isinstance(part, Mapping) for part in (campaign, facts, wind, curve)):
        raise InputError(
            f"{folder / 'run.json'} is of no run of this program; run the campaign again into a new folder"
        )
    return campaign, facts, wind, curve  # type: ignore[return-value]


def _read_campaign(path: Path) -> Mapping[str, Any]:
    return read_mapping(path, "campaign", "name, duration, ...").data if path.is_file() else {}


def _read_log(path: Path) -> Log | None:
    if not path.is_file():
        return None
    from fatigue_runner.logbook import read_log

    try:
        return read_log(path)
    except (FatigueRunnerError, OSError) as error:
        warnings.warn(f"the page goes without a log: {error}", FatigueRunnerWarning, stacklevel=2)
        return None
