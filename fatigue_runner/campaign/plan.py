"""From a campaign file to the work to be done, without writing or running anything: read, resolve once, check, cases."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from fatigue_runner.campaign.block import Job, Setup
from fatigue_runner.campaign.bounds import winds_in_memory
from fatigue_runner.campaign.cases import Case, blocks, make_cases
from fatigue_runner.campaign.check import check
from fatigue_runner.campaign.provenance import code_hash
from fatigue_runner.campaign.resolve import Resolved, ResolvedWind, resolve
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
    """A checked campaign and its cases; notes: what a person should know before the run."""

    resolved: Resolved
    cases: list[Case]
    notes: list[str] = field(default_factory=list)

    @property
    def campaign(self) -> Campaign:
        """What the file says."""
        return self.resolved.campaign

    @cached_property
    def winds(self) -> dict[str, ResolvedWind]:
        """The winds by their ids."""
        return {wind.named.id: wind for wind in self.resolved.winds}

    @property
    def identity(self) -> dict[str, Any]:
        """What a run folder of this campaign must have in common with it."""
        common = self.campaign.model_dump(include={"name", "duration", "output_rate", "initial", "pitch"})
        return {"code": code_hash(), "turbine_hash": self.resolved.turbine.hash, **common}

    @cached_property
    def columns(self) -> list[Column]:
        """Of the table of results, in their order."""
        fatigue, states = self.campaign.fatigue, self.resolved.turbine.layout.states
        return table(self.campaign.counted, fatigue.wohler_exponents, states, fatigue.angles)

    @property
    def logs_are_whole(self) -> bool:
        """Whether a log holds all that a trajectory needs to be evaluated again, to the bit."""
        log = self.campaign.log
        return log.topics is None and log.channels is None and log.precision == "float64"

    @property
    def log_bytes(self) -> float:
        """About what the log of one case takes [bytes]: a number and its tag, the messages' heads, less what compression takes off."""
        campaign = self.campaign
        if not campaign.log.enabled:
            return 0.0
        layout = self.resolved.turbine.layout
        signals = max(len(wind.source.channels) for wind in self.resolved.winds)
        topics = {
            "state": layout.size,
            "loads": len(LOADS) + len(campaign.loads.channels),
            "status": STATUS_FIELDS,
            "wind": signals,
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

    def jobs(self, store: Store, setup: Setup, workers: int) -> list[Job]:
        """The blocks of all cases that are not finished in the store, with the references that they need."""
        pending: dict[str, list[Case]] = {}
        references: dict[str, Case] = {}
        for case in self.cases:
            if case.integration.is_reference:
                references[case.wind.id] = case
            if not store.finished(case, self.campaign.log.enabled):
                pending.setdefault(case.wind.id, []).append(case)
        layout, sources = self.resolved.turbine.layout, [self.winds[wind].source for wind in pending]
        keys = [(source.cell_key, layout.wind_size(source.channels)) for source in sources]
        jobs = []
        at_risk = int(AT_RISK * len(self.cases) / workers)
        size = min(BLOCK_SIZE, max(BLOCK_SIZE // 2, at_risk))
        size = min(size, winds_in_memory(self.campaign.duration * self.campaign.output_rate))
        for winds in blocks(list(pending), keys, size, workers):
            needed = [references[wind] for wind in winds if wind in references]
            cases = [case for wind in winds for case in pending[wind]]
            logged = {case.id for case in [*needed, *cases] if self.logs_are_whole and store.logged(case)}
            initial = {wind: self.winds[wind].initial for wind in winds}
            jobs.append(Job(setup, cases, needed, initial, logged))
        return jobs


def make_plan(
    campaign: str | Path | Mapping[str, Any], say: Callable[[str], None] = lambda what: None
) -> Plan:
    """Read, validate and expand a campaign file or mapping. Raises InputError with "file:line".

    say: told what is going on, since the first checks on a machine compile the kernels.
    """
    say("reading the campaign")
    spec, source = read_campaign(campaign)
    say("loading the kernels (the first run compiles them)")
    resolved = resolve(spec, source)
    notes = check(resolved)
    return Plan(resolved, make_cases(resolved), notes)
