"""From a campaign file to the work to be done, without writing or running anything: read, resolve once, check, cases."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from fatigue_runner.campaign.about import resolved_yaml, turbine_yaml
from fatigue_runner.campaign.block import Job, Setup
from fatigue_runner.campaign.bounds import winds_in_memory
from fatigue_runner.campaign.cases import Case, blocks, log_precision, make_cases
from fatigue_runner.campaign.kept_logs import ALL, FEW, NONE, Kept, KeptLogs, at_once, chosen
from fatigue_runner.campaign.prepare import Prepared, prepared
from fatigue_runner.campaign.provenance import code_hash
from fatigue_runner.campaign.resolve import Named, named_by, resolve
from fatigue_runner.campaign.spec import Campaign, read_campaign
from fatigue_runner.campaign.store import Store
from fatigue_runner.channels import LOADS
from fatigue_runner.results.columns import Column, table

# Winds per block: the width of the lane kernel.
BLOCK_SIZE = 16
# What a kill may cost: the workers' cases that are under way are at most this share of the campaign, down to half-filled lanes.
AT_RISK = 0.1
# of a log: fields of a status message, head and index of a message [bytes], what compression leaves (measured)
STATUS_FIELDS, MESSAGE_BYTES, COMPRESSED = 7, 56.0, 0.65


@dataclass
class Plan:
    """A campaign and its cases. Until it is `prepared` it tells which of them are finished, and makes no job."""

    named: Named
    cases: list[Case]
    prepared: Prepared | None = None
    watched: bool = False  # somebody wants to see cases while they run

    @property
    def campaign(self) -> Campaign:
        """What the file says."""
        return self.named.campaign

    @property
    def ready(self) -> Prepared:
        """What was prepared."""
        assert self.prepared is not None, "the plan is not prepared"
        return self.prepared

    @property
    def notes(self) -> list[str]:
        """What a person should know before the run."""
        return self.ready.notes

    @cached_property
    def text(self) -> str:
        """The campaign with every default written out."""
        return resolved_yaml(self.named)

    @cached_property
    def asked(self) -> str:
        """Hash of all that is asked for: nothing is left to do where a folder holds the answer to it."""
        digest = hashlib.sha256(self.text.encode())
        digest.update(repr(self.campaign.model_dump()).encode())
        for case in self.cases:
            digest.update(f"{case.id} {case.hash}\n".encode())
        return digest.hexdigest()

    @property
    def identity(self) -> dict[str, Any]:
        """What a run folder of this campaign must have in common with it."""
        common = self.campaign.model_dump(include={"name", "duration", "output_rate", "initial", "pitch"})
        return {"code": code_hash(), "turbine_hash": self.named.turbine.hash, **common}

    @cached_property
    def columns(self) -> list[Column]:
        """Of the table of results, in their order."""
        fatigue, states = self.campaign.fatigue, self.named.turbine.layout.states
        return table(self.campaign.counted, fatigue.wohler_exponents, states, fatigue.angles)

    def log_is_whole(self, case: Case) -> bool:
        """Whether a case's log holds all that its trajectory needs to be evaluated again, to the bit."""
        log = self.campaign.log
        return log.topics is None and log.channels is None and log_precision(case, self.campaign) == "float64"

    @property
    def log_bytes(self) -> float:
        """About what the log of one case takes [bytes]: a number and its tag, the messages' heads, less what compression takes off."""
        campaign = self.campaign
        topics = {
            "state": self.named.turbine.layout.size,
            "loads": len(LOADS) + len(campaign.loads.channels),
            "status": STATUS_FIELDS,
            "wind": self.ready.signals,
        }
        fields = [count for name, count in topics.items() if name in (campaign.log.topics or topics)]
        chosen = len(campaign.log.channels or ()) or sum(fields)
        row = (5.0 if campaign.log.precision == "float32" else 9.0) * min(
            chosen, sum(fields)
        ) + MESSAGE_BYTES * len(fields)
        return (
            campaign.duration
            * campaign.output_rate
            * row
            * (1.0 if campaign.log.compression == "none" else COMPRESSED)
        )

    @cached_property
    def kept_logs(self) -> Kept:
        """Whose logs stay."""
        if not self.campaign.log.enabled:
            return NONE
        return chosen(self.campaign.log.cases, len(self.cases), self.watched)

    @property
    def words_of_logs(self) -> list[str]:
        """What a person should know of the logs before the run, where it is not what the file says."""
        which, at_once = self.kept_logs, self.logged_at_once
        said = []
        if self.campaign.log.enabled and self.campaign.log.cases is None and which != ALL:
            some = "every so many" if at_once else "the worst"
            said.append(
                f"{len(self.cases):,} cases: logs of {FEW} of them are kept, of {some} (`log: {{cases: all}}` keeps every one; "
                "`fatigue-runner logs make` writes any other later)"
            )
        if self.watched and not at_once:
            said.append(
                "no case of this campaign is logged while it runs, so there is nothing to watch: `log: {cases: {sample: 20}}` logs some"
            )
        return said

    @cached_property
    def logged_at_once(self) -> set[str]:
        """Ids of the cases whose logs are written as they run."""
        return at_once(self.kept_logs, [case.id for case in self.cases])

    @property
    def chooses_afterwards(self) -> bool:
        """Whether more logs are written when all cases have run."""
        return isinstance(self.kept_logs, KeptLogs) and self.kept_logs.sample is None

    def setup(self, out: Path, facts: dict[str, str], text: str) -> Setup:
        """What all blocks share; facts: what the run knows of itself, for the logs; text: the resolved campaign."""
        turbine = self.named.turbine
        return Setup(
            self.campaign,
            self.named.turbine_source,
            turbine.hash,
            turbine.layout.states,
            out.resolve() / "logs",
            facts,
            {"campaign.yaml": text.encode(), "turbine.yaml": turbine_yaml(self.named).encode()},
            self.named.walls,
            self.ready.sections,
        )

    def finished(self, store: Store, case: Case) -> bool:
        """Whether a case need not run again."""
        return store.finished(case, case.id in self.logged_at_once)

    def jobs(self, store: Store, setup: Setup, workers: int) -> list[Job]:
        """The blocks of all cases that are not finished in the store, with the references that they need."""
        pending = [case for case in self.cases if not self.finished(store, case)]
        return self._blocks(pending, store, setup, workers)

    def jobs_for_logs(self, ids: Collection[str], store: Store, setup: Setup, workers: int) -> list[Job]:
        """The blocks of these cases, which are finished, for their logs."""
        cases = [case for case in self.cases if case.id in ids]
        made = self._blocks(cases, store, setup, workers)
        return [replace(job, to_log={case.id for case in job.cases}, leaves=False) for job in made]

    def _blocks(self, cases: Sequence[Case], store: Store, setup: Setup, workers: int) -> list[Job]:
        pending: dict[str, list[Case]] = {}
        for case in cases:
            pending.setdefault(case.wind.id, []).append(case)
        references = {case.wind.id: case for case in self.cases if case.integration.is_reference}
        starts = self.ready.starts
        keys = [starts[wind].grid for wind in pending]
        jobs = []
        at_risk = int(AT_RISK * len(self.cases) / workers)
        size = min(BLOCK_SIZE, max(BLOCK_SIZE // 2, at_risk))
        size = min(size, winds_in_memory(self.campaign.duration * self.campaign.output_rate))
        for winds in blocks(list(pending), keys, size, workers):
            needed = [references[wind] for wind in winds if wind in references]
            own = [case for wind in winds for case in pending[wind]]
            logged = {case.id for case in [*needed, *own] if self.log_is_whole(case) and store.logged(case)}
            initial = {wind: starts[wind].initial for wind in winds}
            to_log = {case.id for case in own} & self.logged_at_once
            jobs.append(Job(setup, own, needed, initial, logged, to_log))
        return jobs


def read_plan(
    campaign: str | Path | Mapping[str, Any], say: Callable[[str], None] = lambda what: None
) -> Plan:
    """Read, validate and expand a campaign file or mapping: its cases, and nothing made. Raises InputError with "file:line"."""
    say("reading the campaign")
    named = named_by(*read_campaign(campaign))
    return Plan(named, make_cases(named))


def make_plan(
    campaign: str | Path | Mapping[str, Any], say: Callable[[str], None] = lambda what: None
) -> Plan:
    """The same, prepared in this process.

    say: told what is going on, since the first checks on a machine compile the kernels.
    """
    plan = read_plan(campaign, say)
    say("loading the kernels (the first run compiles them)")
    plan.prepared = prepared(resolve(plan.named))
    return plan
