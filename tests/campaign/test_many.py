"""Ten thousand cases in little memory: what is held for each, and what is not done again. Figures of a whole run: docs/reliability.md."""

from __future__ import annotations

import gc
import random
import tracemalloc
from dataclasses import replace

import pytest

from fatigue_runner.campaign import run, run_campaign, store
from fatigue_runner.campaign.store import Store
from fatigue_runner.channels import FATIGUE_CHANNELS
from fatigue_runner.report.page import render
from fatigue_runner.report.rundata import Run
from fatigue_runner.results import read_results
from fatigue_runner.results.columns import table
from fatigue_runner.results.ranking import fatigue_columns
from fatigue_runner.results.records import from_line, head_of, to_line
from fatigue_runner.results.rows import Rows
from fatigue_runner.results.table import Results, read_rows

COLUMNS = table(FATIGUE_CHANNELS, [3.0, 4.0, 5.0, 10.0, 12.0])
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
    """What is made: records that are read whole, reports that are written."""
    found = {"records": 0, "reports": 0}

    def read(line):
        found["records"] += 1
        return from_line(line)

    def write(results, write=run._write_report):
        found["reports"] += 1
        write(results)

    monkeypatch.setattr(store, "from_line", read)
    monkeypatch.setattr(run, "_write_report", write)
    return found


def test_a_run_with_nothing_to_do_makes_nothing_again(settled, counted):
    path, out, first = settled
    before = {
        file.name: (file.stat().st_mtime_ns, file.read_bytes()) for file in out.iterdir() if file.is_file()
    }
    again = run_campaign(path, out, workers=1)
    assert counted == {"records": 0, "reports": 0}
    assert again.rows == first.rows and again.columns == first.columns and again.kept == len(first)
    after = {
        file.name: (file.stat().st_mtime_ns, file.read_bytes()) for file in out.iterdir() if file.is_file()
    }
    assert {name for name in before if after[name] != before[name]} <= {"run.json", "campaign.yaml"}
    assert after["run.json"][1] == before["run.json"][1]


@pytest.mark.parametrize("name", ["report.html", "results.csv", "columns.csv"])
@pytest.mark.parametrize("how", ["removed", "changed"])
def test_results_that_are_not_as_they_were_are_made_again(settled, counted, name, how):
    path, out, first = settled
    whole = (out / name).read_bytes()
    (out / name).unlink()
    if how == "changed":
        (out / name).write_bytes(whole.replace(b"done", b"gone") + b" ")
    assert run_campaign(path, out, workers=1).rows == first.rows
    assert counted == {"records": len(first), "reports": 1}
    if name != "report.html":  # which says when
        assert (out / name).read_bytes() == whole


def test_another_program_makes_the_report_again(settled, counted, monkeypatch):
    path, out, _ = settled
    monkeypatch.setattr(store, "program_hash", lambda: "another")
    run_campaign(path, out, workers=1)
    assert counted["reports"] == 1
    run_campaign(path, out, workers=1)
    assert counted["reports"] == 1


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
