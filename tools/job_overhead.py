"""What a job costs beside its work: blocks of a campaign that are handed to workers and done at once.

    python tools/job_overhead.py [--dask tcp://host:8786] [--jobs 200] [CAMPAIGN]

Prints the size of a job and the time for each [ms], of one worker and of the process that hands out. docs/scale.md has the figures.
"""

from __future__ import annotations

import argparse
import pickle
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from fatigue_runner.campaign.block import Job, Setup
from fatigue_runner.campaign.cluster import Cluster
from fatigue_runner.campaign.plan import make_plan
from fatigue_runner.campaign.pool import run_jobs
from fatigue_runner.campaign.store import Store


def at_once(job: Job) -> list[dict[str, Any]]:
    """In place of `run_block`: a row of nothing for every case."""
    return [{"row": {"case_id": case.id, **dict.fromkeys(map(str, range(250)), 1.0)}} for case in job.cases]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("campaign", nargs="?", default="dlc12")
    parser.add_argument("--dask")
    parser.add_argument("--jobs", type=int, default=200)
    asked = parser.parse_args()
    plan = make_plan(asked.campaign)
    named, out = plan.named, Path("no such folder")
    setup = Setup(plan.campaign, named.turbine_source, named.turbine.hash, named.turbine.layout.states, out)
    job = max(plan.jobs(Store(out, plan.identity), setup, 1), key=lambda job: len(job.cases))
    cluster = Cluster(asked.dask) if asked.dask else None
    with nullcontext() if cluster is None else cluster:
        address = cluster.address if cluster else None
        list(run_jobs(at_once, [job] * 8, 2, address))  # workers are there, and have imported
        begun, spent = time.perf_counter(), time.process_time()
        list(run_jobs(at_once, [job] * asked.jobs, 2, address))
        wall, own = time.perf_counter() - begun, time.process_time() - spent
        workers = 2 if cluster is None else cluster.workers
    print(f"a job of {len(job.cases)} cases: {len(pickle.dumps(job)) / 1e3:.0f} kB")
    print(
        f"{1e3 * workers * wall / asked.jobs:.1f} ms of each of {workers} workers, {1e3 * own / asked.jobs:.1f} ms of the run's own process"
    )


if __name__ == "__main__":
    main()
