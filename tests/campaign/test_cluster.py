"""Workers on other machines: what they are sent, and what a run says and keeps when scheduler or workers are gone.

The first tests need nothing; those with a real scheduler skip without `distributed` (`pip install fatigue-runner[cluster]`).
"""

from __future__ import annotations

import math
import shutil
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

from fatigue_runner import shipped
from fatigue_runner.campaign import cluster as cluster_room
from fatigue_runner.campaign import run_campaign
from fatigue_runner.campaign.block import Setup, run_block, warm_up
from fatigue_runner.campaign.parcel import folder_of, here, pack, throw_away, unpack
from fatigue_runner.campaign.plan import make_plan
from fatigue_runner.campaign.run import _sample
from fatigue_runner.campaign.store import Store
from fatigue_runner.errors import InputError

CAMPAIGN = """name: sent
turbine: ./turbines/mine.yaml
duration: {duration}
wind: {{type: file, files: {files}}}
integrators:
  - {{method: heun, step: 0.01}}
  - {{method: rk4, step: 0.1, corrector: ./correctors/mine.safetensors}}
reference: none
log: {{enabled: {log}}}
"""
WALL_TIMES = {"wall_time"}


def write(folder, duration=5, winds=2, log="false"):
    """A campaign whose turbine, tables, corrector and winds are files beside it."""
    for name in ("turbines", "correctors", "winds"):
        (folder / name).mkdir(parents=True)
    shutil.copy(shipped.correctors() / "rk4-100ms.safetensors", folder / "correctors" / "mine.safetensors")
    shutil.copy(shipped.turbines() / "nrel5mw_aero.npz", folder / "turbines" / "tables.npz")
    (folder / "turbines" / "mine.yaml").write_text(
        "name: mine\nbase: nrel5mw\naerodynamics: {tables: tables.npz}\n"
    )
    files = []
    for number in range(winds):
        rows = (f"{0.5 * i:g},{7 + 0.04 * number + math.sin(0.2 * i):.4f}\n" for i in range(2 * duration + 2))
        (folder / "winds" / f"w{number}.csv").write_text("time,wind_speed\n" + "".join(rows))
        files.append(f"winds/w{number}.csv")
    campaign = folder / "sent.yaml"
    campaign.write_text(CAMPAIGN.format(duration=duration, files=files, log=log))
    return campaign


def rows(results):
    return [{key: value for key, value in row.items() if key not in WALL_TIMES} for row in results]


def test_a_job_runs_where_nothing_of_its_folder_is_seen(tmp_path):
    campaign = write(tmp_path / "project")
    here_it_ran = run_campaign(campaign, tmp_path / "out", workers=1)
    plan = make_plan(campaign)
    resolved = plan.resolved
    setup = Setup(
        plan.campaign, resolved.turbine_source, resolved.turbine.hash, resolved.turbine.layout.states, tmp_path / "logs"
    )  # fmt: skip
    (job,) = plan.jobs(Store(tmp_path / "other", plan.identity), setup, 1)
    parcel = pack(resolved)
    winds = (tmp_path / "project" / "winds").iterdir()
    assert set(parcel.places) == {resolved.turbine_source, resolved.integrations[-1].file, *map(str, winds)}
    shutil.rmtree(tmp_path / "project")
    from fatigue_runner.campaign import block, integration

    for cache in (block._turbine, integration.load_corrector):
        cache.cache_clear()
    try:
        unpack(parcel.name, parcel.files)
        unpack(parcel.name, {"no such": b""})  # it is there already
        records = run_block(here(job, parcel.name, parcel.places))
    finally:
        throw_away(parcel.name)
    assert not folder_of(parcel.name).exists()
    there = {record["row"]["case_id"]: record["row"] for record in records}
    assert rows(there[row["case_id"]] for row in here_it_ran) == rows(here_it_ran)


def test_the_sample_has_every_kind_once(tmp_path):
    plan = make_plan(write(tmp_path / "project", winds=5))
    resolved = plan.resolved
    setup = Setup(
        plan.campaign, resolved.turbine_source, resolved.turbine.hash, resolved.turbine.layout.states, tmp_path / "logs"
    )  # fmt: skip
    jobs = plan.jobs(Store(tmp_path / "other", plan.identity), setup, 2)
    sample = _sample(jobs)
    assert [(case.integration.method, case.integration.corrector) for case in sample.cases] == [
        ("heun", ""),
        ("rk4", "rk4-100ms"),
    ]
    warm_up(sample)
    assert list(tmp_path.iterdir()) == [tmp_path / "project"], "nothing is written"


def test_a_scheduler_that_is_not_there_is_told_before_anything_is_written(tmp_path, monkeypatch):
    pytest.importorskip("distributed", reason="distributed is not installed")
    monkeypatch.setattr(cluster_room, "WAIT", 0.5)
    campaign = write(tmp_path / "project")
    with pytest.raises(
        InputError,
        match=r"no dask scheduler answers at tcp://127\.0\.0\.1:1 .*start one with `dask scheduler`",
    ):
        run_campaign(campaign, tmp_path / "out", dask="tcp://127.0.0.1:1")
    assert not (tmp_path / "out").exists()


# --- with a scheduler and workers


@contextmanager
def cluster(folder, workers=2):
    """(address, scheduler, workers): real processes, which see this Python's packages but stand in another folder."""
    pytest.importorskip("distributed", reason="distributed is not installed")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    address, alone = (
        f"tcp://127.0.0.1:{port}",
        {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": "/"},
    )
    python = [sys.executable, "-m"]
    begun = [
        subprocess.Popen([*python, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"], **alone)
    ]  # fmt: skip
    try:
        for number in range(workers):
            begun.append(
                subprocess.Popen([
                    *python, "distributed.cli.dask_worker", address, "--nworkers", "1", "--nthreads", "1", "--no-dashboard",
                    "--no-nanny", "--death-timeout", "60", "--local-directory", str(folder / f"worker{number}"),
                ], **alone)
            )  # fmt: skip
        yield address, begun[0], begun[1:]
    finally:
        for process in begun:
            process.kill()
            process.wait()


def started(campaign, out, address):
    return subprocess.Popen(
        [sys.executable, "-m", "fatigue_runner", "run", str(campaign), "--out", str(out), "--dask", address],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip


def recorded(out):
    files = [out / "cases.jsonl", *(out / "finished").glob("*.jsonl")]
    return sum(file.read_bytes().count(b"\n") for file in files if file.exists())


def until_some_are_finished(process, out, some=3):
    until = time.monotonic() + 120
    while recorded(out) < some and process.poll() is None and time.monotonic() < until:
        time.sleep(0.05)
    assert process.poll() is None, process.communicate()[0]


@pytest.mark.slow(reason="a scheduler, workers and two runs")
def test_a_dead_worker_and_a_dead_scheduler_cost_the_cases_under_way(tmp_path):
    campaign, out = write(tmp_path / "project", duration=200, winds=48), tmp_path / "out"
    with cluster(tmp_path) as (address, scheduler, workers):
        process = started(campaign, out, address)
        until_some_are_finished(process, out)
        workers[0].send_signal(signal.SIGKILL)
        until_some_are_finished(process, out, recorded(out) + 1)  # it goes on
        scheduler.send_signal(signal.SIGKILL)
        told = process.communicate(timeout=120)[0]
    assert process.returncode == 1, told
    assert f"the dask scheduler at {address} or its workers are lost" in told, told
    assert (
        "cases are finished and kept, the same command runs the rest (once the cluster is back)"
        in " ".join(told.split())
    )
    assert "Traceback" not in told
    kept = recorded(out)
    assert 3 < kept < 96
    rest = run_campaign(campaign, out, workers=2)  # on this machine, which gives the same bits
    assert (rest.kept, rest.simulated) == (kept, 96 - kept)
    assert rows(rest) == rows(run_campaign(campaign, tmp_path / "whole", workers=2))
