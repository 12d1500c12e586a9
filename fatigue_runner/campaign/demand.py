"""Logs on demand: a case of a run is made again, to the bit, and its log written; refused where it would not be the same case."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from fatigue_runner.campaign.block import Job, run_block
from fatigue_runner.campaign.plan import make_plan
from fatigue_runner.campaign.pool import run_jobs
from fatigue_runner.campaign.store import ANSWER, Store
from fatigue_runner.errors import FatigueRunnerError, InputError, did_you_mean
from fatigue_runner.interruption import end_if_asked
from fatigue_runner.results.records import head_of, lines_of

_OF_THE_RUN = ("wall_time",)  # columns that are of the moment when a case ran


def make_logs(
    folder: Path,
    cases: Collection[str] | None = None,
    workers: int | None = None,
    say: Callable[[str], None] = lambda what: None,
) -> list[Path]:
    """Write the logs of these cases (None: of all) of a run folder, those that are there and whole left as they are; returns their places.

    Raises InputError where the folder is no run, a case is not of it or not finished, or where code, turbine, corrector or campaign have
    changed since, so that it would be another case; FatigueRunnerError where a case does not come out as it did.
    """
    if not (folder / "cases.jsonl").is_file() or not (folder / "campaign.yaml").is_file():
        raise InputError(f"{folder} is no run folder; give the folder that `run` wrote")
    plan = make_plan(folder / "campaign.yaml", say)
    try:
        store = Store(folder, plan.identity, columns=[column.name for column in plan.columns])
    except InputError as error:
        reason = str(error).partition(";")[0].removeprefix(f"{folder} ")
        raise InputError(
            f"{folder}: its logs cannot be made: the folder {reason}; run the campaign again"
        ) from None
    known = {case.id: case for case in plan.cases}
    for name in cases or ():
        if name not in known:
            raise InputError(f"{folder} has no case {name!r}{did_you_mean(name, known)}")
    wanted = list(known if cases is None else dict.fromkeys(cases))
    for name in wanted:
        if not store.finished(known[name], logged=False):
            raise InputError(f"{folder}: {_why_not(name, store)}; run the campaign again")
    missing = [name for name in wanted if not store.finished(known[name], logged=True)]
    if missing:
        untouched = store.untouched
        earlier = store.about_earlier
        text = (folder / "campaign.yaml").read_text(encoding="utf-8")
        setup = plan.setup(store.out, earlier.get("facts", {}), text)
        store.open(earlier, text)
        try:
            processes = workers or plan.campaign.workers
            jobs = plan.jobs_for_logs(missing, store, setup, processes)
            write_logs(store, jobs, run_block, processes, None, say)
            if untouched:
                store.settle(store.earlier.get(ANSWER))  # the results are what they were
        finally:
            store.close()
    return [store.log_path(name) for name in wanted]


def write_logs(
    store: Store,
    jobs: Sequence[Job],
    run: Callable[[Job], Any],
    workers: int,
    dask: str | None,
    say: Callable[[str], None],
) -> None:
    """The logs of finished cases, in a store that is open. Raises FatigueRunnerError where one is not what its record says."""
    count = sum(len(job.cases) for job in jobs)
    say(f"writing the logs of {count} case{'s' * (count != 1)}")
    other: list[str] = []
    for records in run_jobs(run, jobs, workers, dask):
        for record in records:
            name = record["row"]["case_id"]
            before = store.record(name)
            differing = ["its record"] if before is None else _differing(before["row"], record["row"])
            if before is None or differing:
                with suppress(OSError):
                    store.log_path(name).unlink()
                other.append(f"{name} ({', '.join(differing[:3])})")
            else:
                store.add([before | {key: record[key] for key in ("log_bytes", "log_checksum")}])
        end_if_asked()
    if other:
        raise FatigueRunnerError(
            f"{store.out}: {len(other)} case{'s' * (len(other) != 1)} came out otherwise than recorded, {other[0]} for instance: on "
            "another machine, or with other libraries than the run; no log of them is kept, run the campaign again with `log: {cases: all}`"
        )


def _differing(before: Mapping[str, Any], again: Mapping[str, Any]) -> list[str]:
    """Columns that are not the same, as they are in a file."""
    written = json.loads(json.dumps(dict(again)))
    if written["status"] == "failed":
        return [written["error_message"] or "status"]
    return [name for name in before if name not in _OF_THE_RUN and before[name] != written.get(name)]


def _why_not(name: str, store: Store) -> str:
    record = store.record(name)
    if record is None:
        return f"case {name} is not finished"
    if record["row"]["status"] == "failed":
        return f"case {name} failed"
    return f"case {name} was run with another corrector, wind or evaluation than there is now"


def log_on_demand(path: Path, say: Callable[[str], None] = lambda what: None) -> bool:
    """Make a log that is not there, where its place says which case of which run it is of; returns whether it is there now."""
    folder, name = path.parent.parent, path.name.removesuffix(".mcap")
    if path.parent.name != "logs" or path.suffix != ".mcap" or not (folder / "cases.jsonl").is_file():
        return False
    with (folder / "cases.jsonl").open("rb") as journal:
        heads = (head_of(line) for _, line in lines_of(journal))
        if not any(head is not None and head.case_id == name for head in heads):
            return False
    make_logs(folder, [name], 1, say)
    return True
