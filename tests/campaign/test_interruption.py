"""What ends a run from outside: kills, signals, dead workers and parents, and files that were damaged meanwhile."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import textwrap
import threading
import time
import tracemalloc
from pathlib import Path

import pytest
from places import ROOT

from fatigue_runner.campaign import bounds, pool, run_campaign
from fatigue_runner.campaign.block import Setup, run_block
from fatigue_runner.campaign.plan import make_plan
from fatigue_runner.campaign.store import Store
from fatigue_runner.errors import FatigueRunnerWarning, InputError
from fatigue_runner.integrators import memory
from fatigue_runner.report.rundata import load_run
from fatigue_runner.report.sections import limits
from fatigue_runner.results.records import to_line, whole_records
from fatigue_runner.results.run_file import read_run_file, write_run_file


@pytest.fixture(scope="module", autouse=True)
def no_report():
    """The report is not what is tried here, and takes longer than these runs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fatigue_runner.campaign.run._write_report", lambda results: None)
        yield


CAMPAIGN = """
name: kills
duration: 8
wind: {{type: turbulent, speeds: {{start: 5, stop: 9, count: {winds}}}, intensity: 0.16}}
integrators:
  - {{method: heun, step: [0.005, 0.01, 0.02]}}
  - {{method: rk3, step: [0.01, 0.02, 0.04]}}
  - {{method: rk4, step: [0.02, 0.05, 0.1]}}
reference: {{method: rk7, step: 0.005}}
log: {{compression: lz4}}
"""


def write(folder: Path, winds: int = 20) -> Path:
    path = folder / "kills.yaml"
    path.write_text(CAMPAIGN.format(winds=winds))
    return path


def recorded(out: Path) -> set[str]:
    """The cases whose record is written, in the journal or in what a worker left."""
    files = [out / "cases.jsonl", *(out / "finished").glob("*.jsonl")]
    found = [whole_records(file.read_bytes())[0] for file in files if file.exists()]
    return {record["row"]["case_id"] for records in found for record in records}


def begun(out: Path) -> list[str]:
    """The cases that a kernel was asked for, see `forked`."""
    path = out.with_suffix(".begun")
    return path.read_text().split() if path.exists() else []


def forked(campaign: Path, out: Path) -> int:
    """A process that runs the campaign with all that this one has loaded already, and notes every case that it begins to simulate."""
    child = os.fork()
    if child:
        return child
    from fatigue_runner.campaign import block

    trajectories = block._trajectories

    def noted(job, integration, cases, winds):
        with out.with_suffix(".begun").open("a") as file:
            file.write("".join(f"{case.id}\n" for case in cases if case.id not in job.logged))
        return trajectories(job, integration, cases, winds)

    block._trajectories = noted
    try:
        run_campaign(campaign, out, workers=1)
    finally:
        os._exit(0)


def without_times(table: Path) -> list[list[str]]:
    rows = [line.split(",") for line in table.read_text().splitlines()]
    kept = [i for i, name in enumerate(rows[0]) if name != "wall_time"]
    return [[row[i] for i in kept] for row in rows]


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_while_the_process_cleans_up_is_worth_no_words(number, code):
    text = (
        "import atexit, signal, time\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "atexit.register(lambda: (print('cleaning up', flush=True), time.sleep(60)))\n"
        "from fatigue_runner.interruption import ended_by_signals\n"
        "with ended_by_signals(to_the_end=True): pass\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", text], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "cleaning up\n"
        process.send_signal(number)
        assert process.communicate(timeout=30)[1] == "" and process.returncode == code


@pytest.mark.slow(reason="fifty runs that are killed, and as many that go on")
def test_fifty_kills_cost_the_cases_under_way_and_no_figure(tmp_path):
    campaign = write(tmp_path)
    begin = time.perf_counter()
    whole = run_campaign(campaign, tmp_path / "whole", workers=1)
    begin = time.perf_counter()
    run_campaign(campaign, tmp_path / "whole", workers=1, fresh=True)
    length = time.perf_counter() - begin
    chance, out, lost = random.Random(7), tmp_path / "out", []
    for _ in range(50):
        before = recorded(out)
        if len(before) == len(whole):
            out.rename(tmp_path / f"done{len(lost)}")
            before = set()
        out.with_suffix(".begun").unlink(missing_ok=True)
        child = forked(campaign, out)
        time.sleep(chance.uniform(0.05, 0.6 * length))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        lost.append(len(set(begun(out)) - recorded(out)))
        assert not before & set(begun(out)), "what was recorded is not simulated again"
    assert max(lost) <= 0.1 * len(whole), lost
    run_campaign(campaign, out)
    assert without_times(out / "results.csv") == without_times(tmp_path / "whole" / "results.csv")


def started(campaign: Path, out: Path, *more: str) -> subprocess.Popen:
    # a test run in the background may ignore signals, which its children would inherit
    def listening() -> None:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)

    command = [sys.executable, "-m", "fatigue_runner", "run", str(campaign), "--out", str(out), *more]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=listening
    )  # fmt: skip


def group_is_gone(group: int, within: float) -> bool:
    end = time.monotonic() + within
    while time.monotonic() < end:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


def when(condition, seconds: float = 300.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not come to that"
        time.sleep(0.02)


@pytest.mark.slow(reason="whole runs in processes of their own, ended by real signals")
@pytest.mark.parametrize(("number", "code", "workers"), [("SIGHUP", 129, "2"), ("SIGINT", 130, "1")])
def test_every_signal_ends_a_run_with_one_sentence_and_no_process_left(tmp_path, number, code, workers):
    campaign, out = write(tmp_path, winds=200), tmp_path / "out"
    run = started(campaign, out, "--workers", workers)
    when(lambda: recorded(out))
    os.killpg(run.pid, getattr(signal, number))
    begin = time.monotonic()
    _, errors = run.communicate(timeout=60)
    assert run.returncode == code
    assert time.monotonic() - begin < 20  # 3 s on a machine that does nothing else
    assert "are finished; the same command runs the rest" in errors and "Traceback" not in errors
    assert group_is_gone(run.pid, 20)


@pytest.mark.slow(reason="a job script twice, in processes of its own")
def test_the_job_script_of_the_docs_ends_with_sigterm_and_resumes(tmp_path):
    """SLURM's own commands are stood in for: `srun` runs what follows, `scontrol` notes what it was asked."""
    text = (ROOT / "docs" / "cluster.md").read_text(encoding="utf-8")
    script = tmp_path / "job.sh"
    script.write_text(textwrap.dedent(text[text.index("    #!/bin/bash") :].partition("\n\n")[0]) + "\n")
    commands = tmp_path / "bin"
    commands.mkdir()
    for name, does in (
        ("srun", 'exec "$@"'),
        ("scontrol", f'echo "$@" >> {tmp_path}/asked'),
        ("fatigue-runner", f'exec {sys.executable} -m fatigue_runner "$@"'),
    ):
        (commands / name).write_text(f"#!/bin/sh\n{does}\n")
        (commands / name).chmod(0o755)
    write(tmp_path, winds=60).rename(tmp_path / "my.yaml")
    out = tmp_path / "dlc12"
    environment = {
        **os.environ, "PATH": f"{commands}:{os.environ['PATH']}", "SCRATCH": str(tmp_path), "SLURM_CPUS_PER_TASK": "2", "SLURM_JOB_ID": "7",
    }  # fmt: skip

    def submitted():
        return subprocess.Popen(
            ["bash", script], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            start_new_session=True,
        )  # fmt: skip

    job = submitted()
    when(lambda: recorded(out))
    job.send_signal(signal.SIGTERM)  # to the batch shell, as `--signal=B:TERM` has it
    _, errors = job.communicate(timeout=60)
    assert (
        job.returncode == 143 and "the same command runs the rest" in errors and "Traceback" not in errors
    ), errors
    assert (tmp_path / "asked").read_text() == "requeue 7\n"
    assert group_is_gone(job.pid, 20)
    kept = len(recorded(out))
    assert 0 < kept < 600
    job = submitted()
    told, errors = job.communicate(timeout=300)
    assert job.returncode == 0, errors
    assert f"{kept} of 600 cases are finished from an earlier run" in " ".join(told.split())
    assert (tmp_path / "asked").read_text() == "requeue 7\n"


@pytest.mark.slow(reason="a whole run in processes of its own")
def test_workers_end_when_their_parent_is_killed(tmp_path):
    campaign, out = write(tmp_path, winds=200), tmp_path / "out"
    run = started(campaign, out)
    when(lambda: recorded(out))
    os.kill(run.pid, signal.SIGKILL)
    run.communicate(timeout=60)
    assert group_is_gone(run.pid, 20)


@pytest.mark.slow(reason="a whole run in processes of its own, one of which is killed")
def test_one_worker_that_is_killed_is_replaced(tmp_path):
    campaign, out = write(tmp_path, winds=60), tmp_path / "out"
    run = started(campaign, out)
    when(lambda: recorded(out))
    workers = subprocess.run(
        ["pgrep", "-P", str(run.pid), "-f", "LokyProcess"], capture_output=True, text=True
    )
    os.kill(int(workers.stdout.split()[0]), signal.SIGKILL)
    told, errors = run.communicate(timeout=300)
    assert run.returncode == 0, errors
    told = " ".join(told.split())
    assert "a worker process was ended from outside" in told and "tried once more" in told
    assert "600 cases, " in told


def dies(marks):
    """In a worker: ends it as often as there are marks."""
    for mark in marks:
        if mark.exists():
            mark.unlink()
            os._exit(9)
    return "done"


def test_a_worker_that_dies_before_or_after_the_cases_is_replaced_once(tmp_path):
    marks = [tmp_path / name for name in "ab"]
    marks[0].touch()
    with pytest.warns(FatigueRunnerWarning, match="was ended from outside.* tried once more"):
        assert pool.elsewhere(dies, marks, 2) == "done"
    for mark in marks:
        mark.touch()
    with (
        pytest.warns(FatigueRunnerWarning, match="tried once more"),
        pytest.raises(pool.WorkerEndedError, match="and so did the one that tried it again"),
    ):
        pool.elsewhere(dies, marks, 2)


# --- what was damaged meanwhile


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A finished run and its campaign; tests work on copies of it."""
    folder = tmp_path_factory.mktemp("finished")
    campaign = write(folder, winds=2)
    run_campaign(campaign, folder / "out", workers=1)
    return campaign, folder / "out"


@pytest.fixture
def copy(finished, tmp_path):
    import shutil

    campaign, out = finished
    shutil.copytree(out, tmp_path / "out")
    return campaign, tmp_path / "out"


def test_a_flipped_bit_in_the_journal_costs_that_record_and_nothing_else(copy):
    campaign, out = copy
    table = without_times(out / "results.csv")
    journal, chance = out / "cases.jsonl", random.Random(3)
    for _ in range(4):
        text = journal.read_bytes()
        place = chance.randrange(len(text))
        journal.write_bytes(
            text[:place] + bytes([text[place] ^ 1 << chance.randrange(8)]) + text[place + 1 :]
        )
        assert run_campaign(campaign, out, workers=1).simulated <= 2
        assert without_times(out / "results.csv") == table


def test_line_ends_of_windows_cost_nothing(copy):
    campaign, out = copy
    journal = out / "cases.jsonl"
    journal.write_bytes(journal.read_bytes().replace(b"\n", b"\r\n"))
    assert run_campaign(campaign, out, workers=1).simulated == 0


def test_a_record_without_a_column_is_unwritten(copy):
    campaign, out = copy
    records, _ = whole_records((out / "cases.jsonl").read_bytes())
    del records[5]["row"]["nrmse_max"]
    (out / "cases.jsonl").write_bytes(b"".join(map(to_line, records)))
    assert run_campaign(campaign, out, workers=1).simulated == 1


def test_a_log_that_is_damaged_inside_is_made_again(copy):
    campaign, out = copy
    log = sorted((out / "logs").iterdir())[3]
    whole = log.read_bytes()
    log.write_bytes(whole[:9000] + bytes([whole[9000] ^ 4]) + whole[9001:])
    assert run_campaign(campaign, out, workers=1).simulated == 1
    assert run_campaign(campaign, out, workers=1).simulated == 0


@pytest.mark.parametrize("text", ["[1, 2]", '"kills"', "{", "null"])
def test_a_damaged_run_json_is_told_and_deleting_it_mends(copy, text):
    campaign, out = copy
    (out / "run.json").write_text(text)
    with pytest.raises(InputError, match=r"run\.json is damaged; delete it"):
        run_campaign(campaign, out, workers=1)
    (out / "run.json").unlink()
    assert run_campaign(campaign, out, workers=1).simulated == 0
    assert json.loads((out / "run.json").read_text())["name"] == "kills"


@pytest.mark.parametrize("what", ["turbine_hash", "nrmse_worst", "machine"])
def test_a_flipped_bit_in_run_json_is_never_followed(copy, what):
    """Identity, the answer that a run with nothing to do prints, and what the report says of the run."""
    campaign, out = copy
    whole = (out / "run.json").read_bytes()
    place = whole.index(f'"{what}": '.encode()) + len(what) + 5
    (out / "run.json").write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
    for look in (lambda: run_campaign(campaign, out, workers=1), lambda: load_run(out)):
        with pytest.raises(InputError, match=r"run\.json is damaged; delete it"):
            look()


def test_a_damaged_table_or_journal_is_told_by_whoever_reads_it(copy):
    campaign, out = copy
    table = out / "results.csv"
    whole = table.read_bytes()
    place = whole.rindex(b".") + 1
    table.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
    with pytest.warns(FatigueRunnerWarning, match=r"results\.csv is not what the run wrote"):
        page = limits.build(load_run(out))
    assert "is not what the run wrote" in str(page)
    run_campaign(campaign, out, workers=1)
    assert table.read_bytes() == whole
    table.unlink()
    journal = out / "cases.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join([lines[0].replace(b"done", b"donf"), *lines[1:]]))
    with pytest.warns(FatigueRunnerWarning, match=r"1 records in .*cases\.jsonl are damaged and left out"):
        load_run(out)


def test_the_folder_s_copy_of_the_campaign_is_mended(copy):
    campaign, out = copy
    whole = (out / "campaign.yaml").read_bytes()
    (out / "campaign.yaml").write_bytes(whole.replace(b"duration", b"durasion"))
    assert run_campaign(campaign, out, workers=1).simulated == 0
    assert (out / "campaign.yaml").read_bytes() == whole


@pytest.mark.parametrize(
    "left", [["logs/"], ["logs/", "cases.jsonl"], ["logs/", "cases.jsonl", "run.json.part"]]
)
def test_a_folder_that_a_kill_left_early_is_used(finished, tmp_path, left):
    campaign, out = finished[0], tmp_path / "early"
    out.mkdir()
    for name in left:
        (out / name).mkdir() if name.endswith("/") else (out / name).touch()
    assert len(run_campaign(campaign, out, workers=1)) == 20


def test_a_folder_of_somebody_else_is_not(finished, tmp_path):
    out = tmp_path / "theirs"
    out.mkdir()
    (out / "report.html").write_text("my own")
    with pytest.raises(InputError, match="holds files but no run"):
        run_campaign(finished[0], out, workers=1)


def test_half_written_logs_of_cases_that_are_gone_are_told(copy):
    from fatigue_runner.campaign.plan import make_plan
    from fatigue_runner.campaign.store import Store

    campaign, out = copy
    (out / "logs" / "v04.00_heun_1ms.mcap.part").write_bytes(b"half")
    plan = make_plan(campaign)
    strangers = Store(out, plan.identity).strangers(plan.cases)
    assert [path.name for path in strangers] == ["v04.00_heun_1ms.mcap.part"]


def test_who_holds_the_lock_last_decides_whose_folder_it_is(copy):
    from fatigue_runner.campaign.plan import make_plan
    from fatigue_runner.campaign.store import Store

    campaign, out = copy
    plan = make_plan(campaign)
    store = Store(out, plan.identity)
    theirs = read_run_file(out)
    write_run_file(out, theirs | {"name": "another"})  # between the check and the lock
    with pytest.raises(InputError, match="belongs to another campaign"):
        store.open({}, "")
    write_run_file(out, theirs)
    Store(out, plan.identity).open({}, "")  # the lock was given back


def test_the_folder_is_a_run_s_until_its_results_are_written(copy, monkeypatch):
    """Else another one would write the same tables at the same time."""
    from fatigue_runner.campaign import run

    campaign, out = copy
    (out / "results.csv").unlink()
    plan, write_results = make_plan(campaign), run._write

    def meanwhile(*given):
        write_results(*given)
        with pytest.raises(InputError, match="another run is writing here"):
            Store(out, plan.identity).open({}, "")

    monkeypatch.setattr(run, "_write", meanwhile)
    assert run_campaign(campaign, out, workers=1).simulated == 0
    Store(out, plan.identity).open({}, "")  # and is given back


# --- what is too big, and what the system says


BIG = """name: big
duration: 600
wind: {{type: turbulent, speeds: {speeds}, intensity: 0.1, seeds: {seeds}}}
integrators:
  - {{method: heun, step: {step}}}
"""


@pytest.mark.parametrize(
    ("changes", "more", "told"),
    [
        ({"speeds": "{start: 5, stop: 9, count: 90000}", "seeds": 900}, "", r":3: more than 50,000 winds.*100,000 cases"),
        ({"step": "1e-9"}, "", r":5: 1e-09 s makes 6e\+11 steps of 600 s"),
        ({}, "output_rate: 10000\n", r":2: .*6e\+06 samples"),
        ({"speeds": "[" + "8, " * 1_000_000 + "9]"}, "", r":3: about 1,000,00\d values"),
    ],
    ids=["cases", "steps", "samples", "values"],
)  # fmt: skip
def test_what_is_too_big_is_refused_with_its_line_before_anything_is_built(
    tmp_path, monkeypatch, changes, more, told
):
    monkeypatch.setattr("fatigue_runner.campaign.bounds._memory", lambda: 4e9)
    campaign = tmp_path / "big.yaml"
    campaign.write_text(BIG.format(**{"speeds": "[8]", "seeds": 1, "step": 0.01} | changes) + more)
    begin = time.process_time()
    with pytest.raises(InputError, match=told):
        run_campaign(campaign, tmp_path / "out")
    assert time.process_time() - begin < 5
    assert not (tmp_path / "out").exists()


def test_long_cases_come_in_smaller_blocks():
    from fatigue_runner.campaign.bounds import winds_in_memory

    assert winds_in_memory(600 * 50) >= 16
    assert 1 <= winds_in_memory(3 * 3600 * 50) < 4
    assert winds_in_memory(1e9) == 1


@pytest.mark.parametrize("winds", [1, 5])
def test_a_block_takes_the_memory_that_is_planned_for_it(tmp_path, winds):
    """Whatever the kernel's lanes are: they hold a few hundred rows at a time."""
    speeds = [6.0 + 0.5 * i for i in range(winds)]
    spec = {
        "name": "long",
        "duration": 600,
        "wind": {"speeds": speeds},
        "integrators": [{"method": "rk4", "step": 0.1}],
        "reference": {"method": "rk4", "step": 0.05},
        "log": {"enabled": False},
    }
    plan = make_plan(spec)
    store = Store(tmp_path / "run", plan.identity)
    setup = Setup(
        plan.campaign,
        "nrel5mw",
        plan.named.turbine.hash,
        plan.named.turbine.layout.states,
        tmp_path / "run" / "logs",
    )
    store.open({}, "")
    (job,) = plan.jobs(store, setup, 1)
    run_block(job)  # what stays: libraries, tables, kernels
    memory._free.clear()
    tracemalloc.start()
    run_block(job)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    store.close()
    planned = 600 * 50 * (bounds.SAMPLE + winds * bounds.SAMPLE_OF_CASE)
    assert 0.5 * planned < peak < planned + 5e6


@pytest.mark.parametrize(
    "text", ["!!int x", "!!float abc", "!!timestamp 2020-13-45", "!mine 60", "!!python/object:os.system 1"]
)
def test_a_tag_that_does_not_fit_is_told_with_its_line(tmp_path, text):
    campaign = tmp_path / "tag.yaml"
    campaign.write_text(
        BIG.format(speeds="[8]", seeds=1, step=0.01).replace("duration: 600", f"duration: {text}")
    )
    with pytest.raises(InputError, match=r"tag\.yaml:2: .*tag.*remove"):
        run_campaign(campaign, tmp_path / "out")


@pytest.mark.parametrize(
    ("number", "words"), [("ENOSPC", "free some space"), ("EROFS", "writable again"), ("EDQUOT", "quota")]
)
def test_what_the_system_refuses_is_a_sentence_with_the_path(copy, monkeypatch, number, words):
    import errno

    from fatigue_runner.errors import FatigueRunnerError

    campaign, out = copy
    (out / "cases.jsonl").write_bytes(b"")

    def full(handle):
        raise OSError(getattr(errno, number), os.strerror(getattr(errno, number)))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(FatigueRunnerError, match=rf"out.*{words}.*the same command runs the rest") as told:
        run_campaign(campaign, out, workers=1)
    assert told.value.exit_code == 1
    monkeypatch.undo()
    monkeypatch.setattr("fatigue_runner.campaign.run._write_report", lambda results: None)
    assert len(run_campaign(campaign, out, workers=1)) == 20


def test_a_full_disk_does_not_end_the_thread_that_looks_for_records(monkeypatch):
    """A traceback of its own would stand beside the sentence."""
    from fatigue_runner.campaign import pieces

    told, looked = [], threading.Event()
    monkeypatch.setattr(threading, "excepthook", told.append)
    monkeypatch.setattr(pieces, "EVERY", 0.001)

    def full():
        if threading.current_thread() is not threading.main_thread():
            looked.set()
            raise OSError(28, "No space left on device")

    with pieces.followed(full):
        assert looked.wait(10)
    assert told == []


def test_a_folder_that_is_removed_meanwhile_is_a_sentence(finished, tmp_path, monkeypatch):
    import shutil

    from fatigue_runner.campaign import block
    from fatigue_runner.errors import FatigueRunnerError

    out, evaluate = tmp_path / "out", block.evaluate

    def remove(*arguments):
        shutil.rmtree(out, ignore_errors=True)
        return evaluate(*arguments)

    monkeypatch.setattr(block, "evaluate", remove)
    with pytest.raises(FatigueRunnerError, match=r"out.*removed while the campaign ran"):
        run_campaign(finished[0], out, workers=1)


@pytest.mark.parametrize("how", ["cut", "gone"])
def test_a_corrector_that_is_damaged_meanwhile_fails_its_own_cases_only(tmp_path, monkeypatch, how):
    from fatigue_runner import shipped
    from fatigue_runner.campaign import integration, run

    own = tmp_path / "mine.safetensors"
    own.write_bytes((shipped.correctors() / "rk4-100ms.safetensors").read_bytes())
    campaign = tmp_path / "c.yaml"
    campaign.write_text(
        "name: c\nduration: 5\nreference: none\nwind: {type: constant, speeds: [8]}\nintegrators:\n  - {method: heun, step: 0.01}\n"
        "  - {method: rk4, step: 0.1, corrector: mine.safetensors}\n"
    )

    def damage(*_):
        own.unlink() if how == "gone" else own.write_bytes(own.read_bytes()[:500])
        integration.load_corrector.cache_clear()  # as in a worker that has not read it yet

    monkeypatch.setattr(run, "warm_up", damage)
    results = run_campaign(campaign, tmp_path / "out", workers=1)
    assert {row["method"]: row["status"] for row in results.rows} == {"heun": "done", "rk4": "failed"}
    assert "mine.safetensors" in results.lost[0]["error_message"]


@pytest.mark.parametrize("how", ["changed", "gone"])
def test_a_wind_file_that_is_another_meanwhile_fails_its_own_cases_only(tmp_path, monkeypatch, how):
    """Its cases are those of the file that the campaign was made of: figures of another wind would stand under their name."""
    from fatigue_runner.campaign import run

    for name in ("one", "other"):
        (tmp_path / f"{name}.csv").write_text("time,wind_speed\n0,8\n3,9\n6,8\n")
    campaign = tmp_path / "c.yaml"
    campaign.write_text(
        "name: c\nduration: 5\nreference: none\nwind: {type: file, files: [one.csv, other.csv]}\n"
        "integrators:\n  - {method: heun, step: 0.01}\n"
    )
    own = tmp_path / "one.csv"

    def change(*_):
        own.unlink() if how == "gone" else own.write_text("time,wind_speed\n0,8\n3,9.5\n6,8\n")

    monkeypatch.setattr(run, "warm_up", change)
    results = run_campaign(campaign, tmp_path / "out", workers=1)
    failed = [row for row in results if row["status"] == "failed"]
    assert len(failed) == 1 and "one.csv" in failed[0]["error_message"]
    assert len([row for row in results if row["status"] == "done"]) == 1
