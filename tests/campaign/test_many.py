"""Ten thousand cases in little memory: what is held for each, and what is not done again. Figures of a whole run: docs/reliability.md."""

from __future__ import annotations

import gc
import json
import random
import subprocess
import sys
import tracemalloc
import warnings
from dataclasses import replace
from pathlib import Path

import pytest

from fatigue_runner.campaign import pool, run, run_campaign, store
from fatigue_runner.campaign.store import Store
from fatigue_runner.channels import FATIGUE_CHANNELS
from fatigue_runner.errors import FatigueRunnerWarning
from fatigue_runner.interruption import ENDING
from fatigue_runner.report.page import render
from fatigue_runner.report.rundata import Run
from fatigue_runner.results import read_results, table
from fatigue_runner.results.columns import table as columns_of
from fatigue_runner.results.ranking import fatigue_columns
from fatigue_runner.results.records import from_line, head_of, to_line
from fatigue_runner.results.rows import Rows
from fatigue_runner.results.run_file import read_run_file, write_run_file
from fatigue_runner.results.table import Results, read_rows

COLUMNS = columns_of(FATIGUE_CHANNELS, [3.0, 4.0, 5.0, 10.0, 12.0])
NAMES = [column.name for column in COLUMNS]
MANY = 2000


def row(number: int) -> dict:
    """A case of a campaign of a thousand winds, each at a mean speed of its own, with a reference and one integrator."""
    chance, wind, is_reference = random.Random(number), number // 2, number % 2 == 0
    made = {
        name: None if is_reference and ("error" in name or "nrmse" in name or "ratio" in name) else chance.random()
        for name in (column.name for column in COLUMNS if column.kind == "number")
    }  # fmt: skip
    step = 0.05 if is_reference else 0.1
    words = {
        "case_id": f"v{wind:05d}_s{wind}_rk4_{step * 1e3:g}ms", "wind_source": "turbulent", "wind_speed": 5 + wind * 0.01,
        "seed": wind, "harmonics": 6, "method": "rk4", "step": step, "is_reference": is_reference, "status": "done", "duration": 600.0,
        "steps": 6000, "evaluations": 24000, "operation": "controlled", "clamped_lookups": 0, "diverged_at": None,
    }  # fmt: skip
    return dict.fromkeys(NAMES) | made | words


def record(number: int) -> dict:
    digest = f"{number:064x}"
    return {"hash": digest, "simulation_hash": digest, "log_bytes": 0, "log_checksum": 0, "row": row(number)}


IDENTITY = {
    "name": "many", "code": "c", "turbine_hash": "t", "duration": 600.0, "output_rate": 50.0, "initial": "i", "pitch": 0.0,
}  # fmt: skip


def held(make):
    """(what `make` returns, bytes that it holds then, the most that it held meanwhile)."""
    gc.collect()
    tracemalloc.start()
    try:
        made = make()
        gc.collect()
        return made, *tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run folder of MANY cases."""
    out = tmp_path_factory.mktemp("many") / "out"
    made = Store(out, IDENTITY, columns=NAMES)
    made.open({}, "")
    made.add(record(number) for number in range(MANY))
    made.close()
    Results(out, NAMES, Rows(NAMES, (row(number) for number in range(MANY)))).write()
    return out


def test_a_finished_case_takes_a_kilobyte_until_its_row_is_asked_for(folder):
    found, now, most = held(lambda: Store(folder, IDENTITY, columns=NAMES))
    assert len(found._kept) == MANY
    assert now < 1500 * MANY and most < 2000 * MANY, (now / MANY, most / MANY)


def test_rows_take_a_number_s_eight_bytes(folder):
    rows, now, most = held(lambda: read_rows(folder))
    assert len(rows) == MANY and rows[3] == row(3)
    assert now < 16 * len(NAMES) * MANY
    text = (folder / "results.csv").stat().st_size
    assert most < 2.2 * text + 16 * len(NAMES) * MANY, "the text, once, while it is decoded twice"


def test_a_table_is_read_as_it_was_written_number_by_number(folder):
    rows = read_rows(folder)
    written = [row(number) for number in range(MANY)]
    assert rows == written and rows[0]["nrmse_max"] is None and rows[0]["is_reference"] is True
    assert rows.column("wind_speed") == [r["wind_speed"] for r in written]
    assert [r["seed"] for r in read_results(folder)] == [str(r["seed"]) for r in written]


def test_the_head_of_a_record_is_that_of_the_record():
    for number in (0, 7):
        whole = record(number)
        line = to_line(whole)
        head = head_of(line)
        assert head is not None and from_line(line.rstrip(b"\n")) == whole
        assert (head.case_id, head.status, head.columns) == (whole["row"]["case_id"], "done", len(NAMES))
        assert head.record == {key: value for key, value in whole.items() if key != "row"}
        assert head_of(line.replace(b"turbulent", b"turbulant")) is None
    odd = record(1)
    odd["row"] = {"status": "failed", "case_id": 'a "b": \\c', "error_message": 'x": y'}  # in another order
    head = head_of(to_line(odd))
    assert head is not None and (head.case_id, head.status, head.columns) == ('a "b": \\c', "failed", 3)


def test_the_page_does_not_grow_with_the_cases(folder):
    campaign = {"name": "many", "operation": "controlled", "duration": 600.0, "discard": 0.0}
    few = Run(folder, read_rows(folder)[: MANY // 2], campaign)
    many = Run(folder, read_rows(folder), campaign)
    assert fatigue_columns(many.rows) == fatigue_columns(few.rows)
    sizes = len(render(few)), len(render(many))
    assert sizes[1] < 1.1 * sizes[0] and sizes[1] < 1.5e6, sizes


CAMPAIGN = """
name: settled
duration: 2
wind: {type: constant, speeds: [6, 8]}
integrators:
  - {method: heun, step: 0.02}
reference: {method: rk4, step: 0.02}
log: {enabled: false}
"""


@pytest.fixture(scope="module")
def settled(tmp_path_factory):
    """A finished campaign, and what it gave."""
    path = tmp_path_factory.mktemp("settled") / "settled.yaml"
    path.write_text(CAMPAIGN)
    return path, path.parent / "out", run_campaign(path, path.parent / "out", workers=1)


@pytest.fixture
def counted(monkeypatch):
    """What is made and read: plans prepared, records read whole, heads of records and tables read, reports written."""
    found = dict.fromkeys(("prepared", "heads", "tables", "records", "reports"), 0)

    def read(line):
        found["records"] += 1
        return from_line(line)

    def counting(what, function):
        def called(*arguments):
            found[what] += 1
            return function(*arguments)

        return called

    def write(out, write=run._write_report):
        found["reports"] += 1
        return write(out)

    monkeypatch.setattr(run, "prepare", counting("prepared", run.prepare))
    monkeypatch.setattr(store, "head_of", counting("heads", store.head_of))
    monkeypatch.setattr(run, "read_rows", counting("tables", run.read_rows))
    monkeypatch.setattr(table, "read_rows", counting("tables", table.read_rows))
    monkeypatch.setattr(store, "from_line", read)
    monkeypatch.setattr(run, "_write_report", write)
    return found


def test_a_run_with_nothing_to_do_makes_nothing_again(settled, counted):
    path, out, first = settled
    before = {
        file.name: (file.stat().st_mtime_ns, file.read_bytes()) for file in out.iterdir() if file.is_file()
    }
    again = run_campaign(path, out, workers=1)
    assert again.exit_code == 0 and len(again) == len(first)
    assert (
        again.summaries == first.summaries and again.notes == first.notes and again.columns == first.columns
    )
    assert set(counted.values()) == {0}, "the answer of the first run, without a look at any case"
    assert again.rows == first.rows and again.kept == len(first)
    assert counted == dict.fromkeys(counted, 0) | {"tables": 1}, "rows are read when they are looked at"
    after = {
        file.name: (file.stat().st_mtime_ns, file.read_bytes()) for file in out.iterdir() if file.is_file()
    }
    assert after == before


@pytest.mark.parametrize("name", ["report.html", "results.csv", "columns.csv"])
@pytest.mark.parametrize("how", ["removed", "changed"])
def test_results_that_are_not_as_they_were_are_made_again(settled, counted, name, how):
    path, out, first = settled
    whole = (out / name).read_bytes()
    (out / name).unlink()
    if how == "changed":
        (out / name).write_bytes(whole.replace(b"done", b"gone") + b" ")
    assert run_campaign(path, out, workers=1).rows == first.rows
    assert (counted["records"], counted["reports"], counted["prepared"]) == (len(first), 1, 1)
    if name != "report.html":  # which says when
        assert (out / name).read_bytes() == whole


def test_another_program_makes_the_report_again(settled, counted, monkeypatch):
    path, out, _ = settled
    monkeypatch.setattr(store, "program_hash", lambda: "another")
    run_campaign(path, out, workers=1)
    assert counted["reports"] == 1
    run_campaign(path, out, workers=1)
    assert counted["reports"] == 1


@pytest.mark.parametrize("key", ["run.json", "answer", "record"])
def test_what_is_not_as_it_was_is_looked_at_again(settled, counted, key):
    path, out, first = settled
    told = read_run_file(out)
    if key == "run.json":
        told["facts"]["machine"] = "another"
    elif key == "answer":
        told["answer"]["asked"] = "something else"
    else:
        with (out / "cases.jsonl").open("ab") as journal:
            journal.write(b"half a rec")
    write_run_file(out, told)
    again = run_campaign(path, out, workers=1)
    assert counted["prepared"] == 1 and counted["heads"] > 0
    assert again.rows == first.rows and again.simulated == 0
    assert run_campaign(path, out, workers=1).said is not None, "and settled again"


def test_another_question_is_another_answer(settled, counted, tmp_path):
    path, out, first = settled
    other = tmp_path / path.name
    other.write_text(CAMPAIGN.replace("[6, 8]", "[6]"))
    assert len(run_campaign(other, out, workers=1)) == 2
    assert counted["prepared"] == 1 and counted["reports"] == 1
    assert run_campaign(path, out, workers=1).rows == first.rows
    assert counted["prepared"] == 2


HEAVY = {"numba", "llvmlite", "scipy", "pyarrow", "matplotlib", "jinja2"}
APART = """
import json, re, signal, sys
from functools import partial
from fatigue_runner import run_campaign
from fatigue_runner.campaign.pool import elsewhere

if __name__ == "__main__":  # workers import this file
    results = run_campaign(sys.argv[1], sys.argv[2], workers=2)
    peak = int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1]) / 1e3
    deaf = elsewhere(partial(signal.pthread_sigmask, signal.SIG_BLOCK), [], 2) if results.simulated else []
    print(json.dumps([sorted(deaf), results.simulated, len(results), peak, sorted({name.split(".")[0] for name in sys.modules})]))
"""


@pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="the system does not tell a process's peak memory"
)
def test_with_workers_the_run_s_own_process_loads_neither_compiler_nor_report(tmp_path):
    """Peak memory [MB] of a process that plans, runs and reports: 70 here, and 1 to 3 kB a case (above); 314 before."""
    (tmp_path / "c.yaml").write_text(CAMPAIGN)
    (tmp_path / "apart.py").write_text(APART)
    command = [sys.executable, "apart.py", "c.yaml", "out"]
    for simulated in (4, 0):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        deaf, ran, cases, peak, modules = json.loads(done.stdout.splitlines()[-1])
        assert (ran, cases) == (simulated, 4)
        assert not ran or set(deaf) >= set(ENDING), (
            "Ctrl-C while workers start is the run's own process's alone"
        )
        assert not HEAVY & set(modules)
        assert peak < 120
    assert (tmp_path / "out" / "report.html").is_file() and (tmp_path / "out" / "results.csv").is_file()


def test_a_process_that_has_gone_to_another_folder_finds_its_files_there(tmp_path, monkeypatch):
    """Workers of its first run are still there, and stand where that was."""
    for speeds in ("[6, 8]", "[7, 9]"):
        folder = tmp_path / speeds
        folder.mkdir()
        monkeypatch.chdir(folder)
        Path("c.yaml").write_text(CAMPAIGN.replace("[6, 8]", speeds))
        results = run_campaign("c.yaml", workers=2)
        assert not results.report_error and (results.out / "report.html").is_file()
        assert (folder / "runs").is_dir()


def test_what_workers_warn_of_is_told_once(monkeypatch):
    monkeypatch.setattr(
        pool, "_run_in_processes", lambda function, jobs, workers, dask: iter([function(*jobs)])
    )
    monkeypatch.setattr(pool, "_told", set())

    def warns(sentence):
        warnings.warn(sentence, FatigueRunnerWarning, stacklevel=1)
        return sentence

    with pytest.warns(FatigueRunnerWarning) as told:
        assert [pool.elsewhere(warns, word, 2) for word in ("slow", "slow", "full")] == [
            "slow",
            "slow",
            "full",
        ]
    assert [str(one.message) for one in told] == ["slow", "full"]


def test_a_case_that_changes_its_record_has_the_new_one(tmp_path):
    made = Store(tmp_path / "out", IDENTITY, columns=NAMES)
    made.open({}, "")
    first, second = record(1), record(1)
    second["row"]["nrmse_max"] = 7.0
    assert made.add([first]) == 1 and made.add([first]) == 0 and made.add([second]) == 1
    made.close()
    for found in (made, Store(tmp_path / "out", IDENTITY, columns=NAMES)):
        (only,) = found.rows([case_of(second)])
        assert only["nrmse_max"] == 7.0


def case_of(wanted):
    """A case as far as the store looks at it."""
    from fatigue_runner.campaign.cases import Case

    empty = Case("", None, None, "", "")  # type: ignore[arg-type]
    return replace(empty, id=wanted["row"]["case_id"], hash=wanted["hash"])
