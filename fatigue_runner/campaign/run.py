"""Run a campaign: plan, simulate what is not finished, write the results table and the report."""

from __future__ import annotations

import errno
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fatigue_runner.campaign.block import Job, Setup, run_block, warm_up
from fatigue_runner.campaign.cases import Case
from fatigue_runner.campaign.cluster import Cluster
from fatigue_runner.campaign.demand import write_logs
from fatigue_runner.campaign.kept_logs import afterwards
from fatigue_runner.campaign.parcel import pack
from fatigue_runner.campaign.pieces import followed
from fatigue_runner.campaign.plan import Plan, read_plan
from fatigue_runner.campaign.pool import WorkerEndedError, dismiss_workers, elsewhere, run_jobs
from fatigue_runner.campaign.prepare import Prepared, prepare
from fatigue_runner.campaign.resolve import Named
from fatigue_runner.campaign.store import Store
from fatigue_runner.errors import FatigueRunnerError
from fatigue_runner.integrators.memory import release
from fatigue_runner.interruption import Interrupted, end_if_asked, exit_code_of
from fatigue_runner.results.beyond import beyond
from fatigue_runner.results.table import LaterRows, Results, read_rows
from fatigue_runner.stopwatch import stage
from fatigue_runner.turbine.rated import rated_rotor_speed

if TYPE_CHECKING:
    from rich.console import Console


# (run folder, cases in all, ids of the cases of each job, workers) -> the context in which the cases run
Watch = Callable[[Path, int, list[list[str]], int], AbstractContextManager[Any]]


Block = Callable[[Job], list[dict[str, Any]]]

LARGE = 1e9  # bytes of logs that are told before a run


class CampaignInterrupted(Interrupted):
    """Ctrl-C, SIGTERM or SIGHUP: what is finished is kept."""


def run_campaign(
    campaign: str | Path | Mapping[str, Any],
    out: str | Path | None = None,
    *,
    workers: int | None = None,
    fresh: bool = False,
    dask: str | None = None,
    console: Console | None = None,
    watch: Watch | None = None,
    block: Block = run_block,
) -> Results:
    """Run a campaign file (or a mapping with its keys) and return the results table.

    out: run folder, default `runs/<name>`; finished cases found there are kept, unless `fresh`. workers:
    processes, default as the campaign says; dask: address of a scheduler instead. console: where progress is
    shown; None shows nothing. watch: called with the run folder, the number of cases, the ids of the cases of
    each job and the number of workers; the cases run inside the context that it returns. block: what a worker of this
    machine does with a job, for whoever measures that. Raises InputError before
    anything is written where the campaign or the folder is wrong, and CampaignInterrupted on Ctrl-C.
    """
    folder = Path(out) if out is not None else None
    try:
        return _run_campaign(campaign, folder, workers, fresh, dask, console, watch, block)
    except WorkerEndedError as error:  # before or after the cases
        raise FatigueRunnerError(
            f"{error}; what is finished is kept, the same command does the rest (with fewer --workers, which takes less memory)"
        ) from None
    except OSError as error:
        raise FatigueRunnerError(_system_error(error, folder)) from error


def _system_error(error: OSError, folder: Path | None) -> str:
    """What the system says, where, and what helps."""
    where = error.filename or folder or "the run folder"
    helps = {
        errno.ENOSPC: "free some space on that disk",
        errno.EDQUOT: "free some of your quota on that disk",
        errno.EFBIG: "allow larger files (`ulimit -f`), or choose another --out",
        errno.EROFS: "make it writable again, or choose another --out",
        errno.EACCES: "make it writable again, or choose another --out",
        errno.ENOENT: "the folder was removed while the campaign ran",
        errno.EISDIR: "a folder stands where a file belongs; choose another --out",
        errno.EMFILE: "allow more open files (`ulimit -n`), or use fewer --workers",
    }
    way_out = helps.get(error.errno or 0, "see to it")
    return (
        f"{where}: {error.strerror or error}; {way_out}: what is finished is kept where it is still there, and the same command "
        "runs the rest"
    )


def _run_campaign(
    campaign: str | Path | Mapping[str, Any],
    out: Path | None,
    workers: int | None,
    fresh: bool,
    dask: str | None,
    console: Console | None,
    watch: Watch | None,
    block: Block,
) -> Results:
    from fatigue_runner.campaign.progress import Progress

    started = time.perf_counter()
    with Progress(console) as progress:
        with stage("planning"):
            plan = read_plan(campaign, progress.say)
        plan.watched = watch is not None
        folder = out if out is not None else Path("runs") / plan.campaign.name
        store = Store(folder, plan.identity, fresh, [column.name for column in plan.columns])
        results = None if watch else _settled(plan, store, progress)
        if results is None:
            processes = workers or plan.campaign.workers
            pending = {case.wind.id for case in plan.cases if not plan.finished(store, case)}
            # where cases run in workers, what is big is not loaded here either
            helpers = processes if dask is None and len(pending) > 1 else 1
            try:  # the folder is this run's until its results are written
                with nullcontext() if dask is None else Cluster(dask) as cluster:
                    simulated = _simulate(plan, store, processes, helpers, cluster, progress, watch, block)
                settled = not simulated and store.settled
                with stage("table"):
                    results = _collect(plan, store, simulated, settled)
                if not settled:
                    store.unsettle()
                    _write(results, helpers, progress)
                if not results.report_error:
                    _settle(results, plan, store)
            finally:
                store.close()
    results.wall_time = time.perf_counter() - started
    return results


def _settled(plan: Plan, store: Store, progress: Any) -> Results | None:
    """The results of a folder in which nothing is left to do; None where anything is.

    Neither a kernel nor a wind is made for it, and no record and no row is read: all of that was looked at when the folder was settled,
    by this program, and checksums tell that it is as it was. Logs are looked at, each to the last bit.
    """
    said = store.answer_to(plan.asked)
    if said is None:
        return None
    logged = plan.logged_at_once
    if not all(plan.finished(store, case) for case in plan.cases if case.id in logged):
        return None
    for sentence in [*said["before"], *plan.words_of_logs, *_strangers(plan, store)]:
        progress.note(sentence)
    progress.begin(len(plan.cases), len(plan.cases))
    return _with_life(
        Results(
            out=store.out,
            columns=[column.name for column in plan.columns],
            meanings=plan.columns,
            rows=LaterRows(store.out, len(plan.cases)),
            notes=said["notes"],
            kept=len(plan.cases),
            said=said,
        ),
        plan,
    )


def _settle(results: Results, plan: Plan, store: Store) -> None:
    """That the results are there is remembered, so that nobody makes them again, and what they say, if no case is to run again."""
    failed = any(row["status"] == "failed" for row in results.lost)
    before = {"asked": plan.asked, "before": plan.notes}
    store.settle(None if failed else before | results.answer)


def _write(results: Results, helpers: int, progress: Any) -> None:
    """Write the tables and the report."""
    with stage("table"):
        results.write_csv()
        if helpers == 1:
            results.write_parquet()
    if results.life is not None:
        results.life.write(results.out)
    progress.say("writing the report")
    end_if_asked()
    with stage("report"):
        out = results.out
        results.report_error = (
            _write_report(out) if helpers == 1 else elsewhere(_write_parquet_and_report, out, helpers)
        )


def _write_parquet_and_report(out: Path) -> str:
    """In a worker: write what is made of `results.csv`."""
    release()
    if find_spec("pyarrow"):
        rows = read_rows(out)
        Results(out, rows.columns, rows).write_parquet()
        del rows
    return _write_report(out)


def _write_report(out: Path) -> str:
    """Write report.html; what goes wrong there is returned, and costs neither the results nor their table."""
    from fatigue_runner.report import write_report

    try:
        write_report(out)
    except FatigueRunnerError as error:
        return str(error)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def _simulate(
    plan: Plan,
    store: Store,
    workers: int,
    helpers: int,
    cluster: Cluster | None,
    progress: Any,
    watch: Watch | None,
    block: Block,
) -> int:
    """Run the cases that are not finished; returns how many there were.

    helpers: processes that do what is to be done before and after; 1: this one.
    """
    progress.say("loading the kernels (the first run compiles them), checking the reference")
    with stage("preparation"):
        plan.prepared, said = elsewhere(_prepared, (plan.named, store.earlier), helpers)
    for sentence in [*plan.notes, *plan.words_of_logs]:
        progress.note(sentence)
    setup = plan.setup(store.out, said["facts"], plan.text)
    store.open(said, plan.text)
    try:
        jobs = plan.jobs(store, setup, workers)
        pending = sum(len(job.cases) for job in jobs)
        progress.begin(len(plan.cases), len(plan.cases) - pending)
        with _ready(plan, jobs, helpers, cluster, block) as run:
            progress.say("running")
            ids = [[case.id for case in job.cases] for job in jobs]
            for sentence in _before(plan, store, pending):
                progress.note(sentence)
            watched = watch(store.out, len(plan.cases), ids, workers) if watch else nullcontext()
            with watched, followed(lambda: progress.advance(store.take_in())):
                try:
                    _run(run, jobs, workers, cluster, store, progress)
                except WorkerEndedError as error:
                    if cluster is not None:  # which gives the work of a dead worker to another by itself
                        raise
                    progress.note(f"{error}; what it was doing is tried once more")
                    progress.advance(store.take_in())
                    _run_again(error, block, plan.jobs(store, setup, workers), workers, store, progress)
            # after the last look at what workers left, which would put the records without a log behind those with one
            if plan.chooses_afterwards and (pending or not store.settled):
                _write_more_logs(plan, store, setup, run, workers, cluster, progress)
        return pending
    except KeyboardInterrupt as interrupt:
        dismiss_workers()
        store.take_in()
        raise CampaignInterrupted(
            f"interrupted: {_finished(plan, store)} are finished; the same command runs the rest",
            exit_code_of(interrupt),
        ) from None
    except WorkerEndedError as error:
        store.take_in()
        way_out = (
            "with fewer --workers, which takes less memory" if cluster is None else "once the cluster is back"
        )
        raise FatigueRunnerError(
            f"{error}; {_finished(plan, store)} are finished and kept, the same command runs the rest ({way_out})"
        ) from None


def _write_more_logs(
    plan: Plan, store: Store, setup: Setup, run: Callable[[Job], Any], workers: int, cluster: Cluster | None, progress: Any
) -> None:  # fmt: skip
    """The logs of those cases that turned out to be worth one."""
    found = set(afterwards(plan.kept_logs, store.rows(plan.cases)))
    missing = [case.id for case in plan.cases if case.id in found and not store.finished(case, logged=True)]
    if missing:
        jobs = plan.jobs_for_logs(missing, store, setup, workers)
        write_logs(store, jobs, run, workers, None if cluster is None else cluster.address, progress.say)


def _run(
    run: Callable[[Job], Any],
    jobs: Sequence[Job],
    workers: int,
    cluster: Cluster | None,
    store: Store,
    progress: Any,
) -> None:
    for records in run_jobs(run, jobs, workers, None if cluster is None else cluster.address):
        progress.advance(store.add(records))
        end_if_asked()


def _run_again(
    first: WorkerEndedError, block: Block, jobs: Sequence[Job], workers: int, store: Store, progress: Any
) -> None:
    try:
        _run(block, jobs, workers, None, store, progress)
    except WorkerEndedError:
        raise WorkerEndedError(f"{first}, and so did the one that tried it again") from None


def _sample(jobs: Sequence[Job]) -> Job:
    """A job that needs every kernel which any of them needs: one case of each kind, of those that no log holds."""
    kinds: dict[Any, tuple[Case, np.ndarray]] = {}
    for job in jobs:
        for case in (case for case in (*job.references, *job.cases) if case.id not in job.logged):
            method, wind = case.integration, case.wind
            key = method.method, method.corrector, method.mode, wind.kind, bool(wind.tower), any(wind.angles)
            kinds.setdefault(key, (case, job.initial[wind.id]))
    initial = {case.wind.id: state for case, state in kinds.values()}
    return Job(jobs[0].setup, [case for case, _ in kinds.values()], [], initial, set(), set())


@contextmanager
def _ready(
    plan: Plan, jobs: Sequence[Job], helpers: int, cluster: Cluster | None, block: Block
) -> Iterator[Callable[[Job], Any]]:
    """What runs a job; its kernels are compiled, where it will run, once."""
    if not jobs:
        yield block
    elif cluster is None:
        with stage("kernels"):
            elsewhere(warm_up, _sample(jobs), helpers)
        yield block
    else:
        with cluster.prepared(pack(plan.named), _sample(jobs)) as on_worker:
            yield on_worker


def _before(plan: Plan, store: Store, pending: int) -> list[str]:
    """What a person should know of the disk before the cases run: how much the logs will take, and logs that nobody wants any more."""
    said = []
    free = shutil.disk_usage(store.out).free
    logs = min(pending, len(plan.logged_at_once))
    size = logs * plan.log_bytes
    if size > LARGE or size > 0.5 * free:
        little = ", too little" if size > free else ""
        said.append(
            f"the logs of {logs} cases will take about {size / 1e9:.2g} GB; {free / 1e9:.3g} GB are free{little} (`log: {{cases: none}}` "
            "keeps none, and any can be made later)"
        )
    if store.damaged:
        said.append(
            f"{store.damaged} records in {store.out / 'cases.jsonl'} are damaged: these cases run again, or are read from their logs"
        )
    return [*said, *_strangers(plan, store)]


def _strangers(plan: Plan, store: Store) -> list[str]:
    """Logs that nobody wants any more."""
    strangers = store.strangers(plan.cases)
    if not strangers:
        return []
    freed = sum(path.stat().st_size for path in strangers)
    return [
        f"{len(strangers)} logs ({freed / 1e6:.3g} MB) in {store.out / 'logs'} are of cases that are no longer in the campaign, "
        f"{strangers[0].name} for instance; delete them if nobody needs them"
    ]


def _prepared(given: tuple[Named, dict[str, Any]]) -> tuple[Prepared, dict[str, Any]]:
    return prepare(*given)


def _finished(plan: Plan, store: Store) -> str:
    done = sum(plan.finished(store, case) for case in plan.cases)
    return f"{done} of {len(plan.cases)} cases"


def _collect(plan: Plan, store: Store, simulated: int, settled: bool) -> Results:
    rows = read_rows(store.out) if settled else store.rows(plan.cases)
    return _with_life(
        Results(
            out=store.out,
            columns=[column.name for column in plan.columns],
            meanings=plan.columns,
            rows=rows,
            notes=beyond(rows, rated_rotor_speed(plan.named.turbine)),
            simulated=simulated,
            kept=len(plan.cases) - simulated,
        ),
        plan,
    )


def _with_life(results: Results, plan: Plan) -> Results:
    if plan.campaign.lifetime is not None:
        from fatigue_runner.results.lifetime import life_of

        results.life = life_of(results.rows, plan.campaign.lifetime)
    return results
