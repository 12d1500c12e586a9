"""Workers on other machines: what they are sent, and what a run says and keeps when scheduler or workers are gone.

The first tests need nothing; those with a real scheduler skip without `distributed` (`pip install fatigue-runner[cluster]`).
"""

from __future__ import annotations

import json
import math
import pickle
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import pytest

from fatigue_runner import shipped
from fatigue_runner.campaign import cluster as cluster_room
from fatigue_runner.campaign import pool, run_campaign
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
    resolved = plan.named
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
    resolved = plan.named
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


def _deep(job):
    return _deep(job)


def _with_a_lock(job):
    error = ValueError("no number")
    error.lock = threading.Lock()
    raise error


@pytest.mark.parametrize(("work", "words"), [(_deep, "RecursionError"), (_with_a_lock, "no number")])
def test_an_error_that_could_not_travel_is_told_in_words(work, words):
    """The client would wait for it for ever."""
    with pytest.raises(RuntimeError, match=words) as caught:
        pool._told_in_words(work, None)
    assert words in str(pickle.loads(pickle.dumps(caught.value)))
    assert caught.value.__context__ is None and len(str(caught.value)) < 5000


def test_an_error_that_is_a_sentence_stays_one():
    def refuse(job):
        raise InputError("line 3: no such wind")

    with pytest.raises(InputError, match="line 3"):
        pool._told_in_words(refuse, None)


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

HANGS = 600.0  # s: nothing here is slow, and on a busy machine only what never ends takes so long
# Loaded by every worker: after each record that it leaves it says so, and waits until it may go on.
GATE = """
import os
import time
from pathlib import Path

from fatigue_runner.campaign import block
from fatigue_runner.campaign.pieces import leave

gate, left = Path({gate!r}), 0


def leave_and_wait(*arguments):
    global left
    leave(*arguments)
    left += 1
    (gate / f"{{os.getpid()}}-{{left}}").touch()
    while not any((gate / f"{{name}}-may-leave-{{left + 1}}").exists() for name in ("all", os.getpid())):
        time.sleep(0.02)


block.leave = leave_and_wait
"""


@contextmanager
def cluster(gate, workers=2):
    """(address, scheduler, workers): real processes, which see this Python's packages but stand in another folder; all are there.
    gate: an empty folder, see `GATE`."""
    distributed = pytest.importorskip("distributed", reason="distributed is not installed")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    code = gate / "preloaded.py"
    code.write_text(GATE.format(gate=str(gate)))
    begun = []

    def begin(module, *options):
        command = [sys.executable, "-m", f"distributed.cli.{module}", *options, "--no-dashboard"]
        silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        begun.append(subprocess.Popen(command, cwd="/", **silent))

    try:
        begin("dask_scheduler", "--host", "127.0.0.1", "--port", str(port))
        for number in range(workers):
            begin(
                "dask_worker", address, "--nworkers", "1", "--nthreads", "1", "--no-nanny", "--preload", str(code),
                "--death-timeout", f"{HANGS:g}", "--local-directory", str(gate / f"worker{number}"),
            )  # fmt: skip
        with distributed.Client(address, timeout=HANGS, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=HANGS)
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
    """How many cases: another worker makes again what a dead one had left of its block."""
    files = [out / "cases.jsonl", *(out / "finished").glob("*.jsonl")]
    lines = [line for file in files if file.exists() for line in file.read_bytes().splitlines()]
    return len({json.loads(line)["hash"] for line in lines})


def open_gate(gate, who, before, to):
    for number in range(before + 1, to + 1):
        (gate / f"{who}-may-leave-{number}").touch()


def until_left(gate, worker, number, run):
    """Until this worker has left so many records; it then waits at the gate."""
    until = time.monotonic() + HANGS
    while not (gate / f"{worker.pid}-{number}").exists():
        assert run.poll() is None, run.communicate()[0]
        assert time.monotonic() < until
        time.sleep(0.02)


@pytest.mark.slow(reason="a scheduler, workers and two runs")
def test_a_dead_worker_and_a_dead_scheduler_cost_the_cases_under_way(tmp_path):
    campaign, out, gate = (
        write(tmp_path / "project", duration=10, winds=48),
        tmp_path / "out",
        tmp_path / "gate",
    )
    gate.mkdir()
    with cluster(gate) as (address, scheduler, workers):
        open_gate(gate, "all", 0, 3)
        process = started(campaign, out, address)
        for worker in workers:
            until_left(gate, worker, 3, process)
        workers[0].send_signal(signal.SIGKILL)  # in the middle of a block
        open_gate(gate, workers[1].pid, 3, 40)
        until_left(gate, workers[1], 40, process)  # it goes on, beyond its own block
        scheduler.send_signal(signal.SIGKILL)
        told = process.communicate(timeout=HANGS)[0]
    assert process.returncode == 1, told
    assert f"the dask scheduler at {address} or its workers are lost" in told, told
    assert (
        "cases are finished and kept, the same command runs the rest (once the cluster is back)"
        in " ".join(told.split())
    )
    assert "Traceback" not in told
    kept = recorded(out)
    assert 40 <= kept <= 43  # those of the dead worker may have been among the others'
    rest = run_campaign(campaign, out, workers=2)  # on this machine, which gives the same bits
    assert (rest.kept, rest.simulated) == (kept, 96 - kept)
    assert rows(rest) == rows(run_campaign(campaign, tmp_path / "whole", workers=2))
