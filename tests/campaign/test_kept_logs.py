"""Few logs are kept where a campaign says so, and any other is made afterwards: the same one, or none."""

from __future__ import annotations

import json

import pytest
from campaign_world import build_world, write_campaign
from typer.testing import CliRunner

from fatigue_runner import on_demand
from fatigue_runner.campaign import log_on_demand, make_logs, run_campaign
from fatigue_runner.campaign.kept_logs import MANY, KeptLogs, afterwards, at_once, chosen
from fatigue_runner.campaign.plan import make_plan
from fatigue_runner.cli import app
from fatigue_runner.errors import FatigueRunnerError, InputError
from fatigue_runner.logbook import read_log
from fatigue_runner.results.records import to_line, whole_records
from fatigue_runner.viewer.cases import find_logs


@pytest.fixture(autouse=True)
def no_report(monkeypatch):
    monkeypatch.setattr("fatigue_runner.report.write_report", lambda folder: folder / "report.html")


SPEC = {
    "name": "kept",
    "duration": 8,
    "workers": 1,
    "wind": {"type": "turbulent", "speeds": [7, 9], "intensity": 0.12},
    "integrators": [{"method": "rk4", "step": [0.05, 0.1]}],
    "reference": {"method": "dop853", "step": 0.05},
    "fatigue": {"wohler_exponents": [4]},
}


def logs(out):
    return sorted(path.name for path in (out / "logs").glob("*"))


def content(path):
    """Of a log, without how long the case took."""
    log = read_log(path)
    arrays = [log.time, log.state, log.wind, log.accepted, log.local_error, *log.loads.values()]
    said = {key: value for key, value in log.result.items() if key != "wall_time"}
    return [a.tobytes() for a in arrays], log.run, said, log.attachments


def test_a_log_made_afterwards_is_the_one_that_was_made_at_once(tmp_path):
    run_campaign(SPEC | {"log": {"cases": "all"}}, tmp_path / "all")
    none = run_campaign(SPEC | {"log": {"cases": "none"}}, tmp_path / "none")
    assert logs(tmp_path / "none") == [] and none.simulated == 6
    first, *others = none.column("case_id")
    (made,) = make_logs(tmp_path / "none", [first])
    assert logs(tmp_path / "none") == [made.name]
    assert len(make_logs(tmp_path / "none")) == 6 and len(logs(tmp_path / "none")) == 6
    for name in (first, *others):
        theirs, ours = (tmp_path / run / "logs" / f"{name}.mcap" for run in ("all", "none"))
        arrays, run, said, attached = content(ours)
        other = content(theirs)
        assert arrays == other[0] and said == other[2]
        assert {k: v for k, v in run.items()} == other[1]
        assert attached.keys() == other[3].keys()
    # they are known, and the results are as they were
    again = run_campaign(SPEC | {"log": {"cases": "all"}}, tmp_path / "none")
    assert again.simulated == 0 and again.column("nrmse_max") == none.column("nrmse_max")


@pytest.fixture
def finished(tmp_path):
    out = tmp_path / "out"
    run_campaign(
        SPEC | {"log": {"cases": {"worst": 1}}, "integrators": [{"method": "rk4", "step": 0.1}]}, out
    )
    return out


def test_what_is_not_the_same_case_any_more_is_refused(finished, monkeypatch):
    (worst,) = logs(finished)
    assert "rk4" in worst
    with pytest.raises(
        InputError, match=r"has no case '.*'; did you mean 'v07\.00_ti0\.12_s700001_rk4_100ms'"
    ):
        make_logs(finished, ["v07.00_ti0.12_s700001_rk4_10ms"])
    with pytest.raises(InputError, match="is no run folder"):
        make_logs(finished / "logs")
    with monkeypatch.context() as patch:
        patch.setattr("fatigue_runner.campaign.plan.code_hash", lambda: "other")
        with pytest.raises(
            InputError, match="logs cannot be made: the folder was written by another version"
        ):
            make_logs(finished)
    # another result than that which is recorded: of another machine, say
    journal = finished / "cases.jsonl"
    found = whole_records(journal.read_bytes())[0]
    for record in found:
        record["row"]["mean_rotor_thrust"] *= 1 + 1e-9
    journal.write_bytes(b"".join(map(to_line, found)))
    with pytest.raises(
        FatigueRunnerError, match=r"3 cases came out otherwise than recorded, .*mean_rotor_thrust"
    ):
        make_logs(finished)
    assert logs(finished) == [worst]


def test_who_opens_a_log_that_is_not_there_gets_it(finished, monkeypatch):
    """As at the command line, where the maker is in place."""
    records = whole_records((finished / "cases.jsonl").read_bytes())[0]
    names = list(dict.fromkeys(record["row"]["case_id"] for record in records))
    missing = [name for name in names if f"{name}.mcap" not in logs(finished)]
    assert on_demand.maker is not None
    shown = CliRunner().invoke(app, ["logs", "info", str(finished / "logs" / f"{missing[0]}.mcap")])
    assert shown.exit_code == 0 and "401 rows" in shown.output
    assert not log_on_demand(finished / "logs" / "none.mcap")
    assert not log_on_demand(finished / "none.mcap")
    for path in (finished / "logs").glob("*.mcap"):
        path.unlink()
    found = find_logs([finished], names[-1])
    assert [path.exists() for path in found] == [True, True]  # with the reference of its wind
    made = CliRunner().invoke(app, ["logs", "make", str(finished), "--all"])
    assert made.exit_code == 0 and len(logs(finished)) == len(names)
    both = CliRunner().invoke(app, ["logs", "make", str(finished), names[0], "--all"])
    assert isinstance(both.exception, InputError)


def test_a_run_with_nothing_to_do_does_not_look_for_the_worst_again(finished, monkeypatch):
    spec = SPEC | {"log": {"cases": {"worst": 1}}, "integrators": [{"method": "rk4", "step": 0.1}]}
    monkeypatch.setattr(
        "fatigue_runner.campaign.run.afterwards", lambda *_: pytest.fail("nothing has changed")
    )
    assert run_campaign(spec, finished).simulated == 0
    monkeypatch.undo()
    more = run_campaign(spec | {"log": {"cases": {"worst": 2}}}, finished)
    assert more.simulated == 0 and len(logs(finished)) == 2


def row(case_id, status="done", accepted=None, **figures):
    return {"case_id": case_id, "status": status, "acceptance_rate": accepted, "nrmse_max": None, **figures}


def test_the_worst_and_those_where_something_happened_are_chosen_when_all_are_known():
    rows = [
        row("reference"),
        row("good", del_error_a_m4=1e-5, del_error_b_m4=-2e-5, accepted=1.0),
        row("bad", del_error_a_m4=-0.3, del_error_b_m4=None, accepted=0.9),
        row("states", nrmse_max=0.1),
        row("gone", status="diverged"),
        row("failed", status="failed"),
    ]
    assert afterwards(KeptLogs(worst=3), rows) == ["gone", "bad", "states"]
    assert afterwards(KeptLogs(worst=9), rows) == ["gone", "bad", "states", "good"]
    assert afterwards(KeptLogs(where=["diverged"]), rows) == ["gone"]
    assert afterwards(KeptLogs(where=["rejected", "diverged"]), rows) == ["bad", "gone"]
    assert afterwards("all", rows) == afterwards(KeptLogs(sample=2), rows) == []


def test_a_sample_is_spread_over_the_campaign(tmp_path):
    ids = [case.id for case in make_plan(SPEC).cases]
    assert at_once("all", ids) == set(ids) and at_once("none", ids) == set()
    assert at_once(KeptLogs(sample=2), ids) == {ids[1], ids[4]}
    assert at_once(KeptLogs(sample=100), ids) == set(ids)
    assert at_once(KeptLogs(worst=3), ids) == set()
    results = run_campaign(SPEC | {"log": {"cases": {"sample": 2}}}, tmp_path / "out")
    assert logs(tmp_path / "out") == sorted(f"{name}.mcap" for name in (ids[1], ids[4]))
    assert run_campaign(SPEC | {"log": {"cases": {"sample": 2}}}, tmp_path / "out").simulated == 0
    assert results.simulated == 6


def test_beyond_some_hundred_cases_the_default_is_told(monkeypatch, tmp_path):
    world = build_world(monkeypatch)
    assert world.calls == []
    assert (chosen(None, MANY), chosen(None, MANY + 1)) == ("all", KeptLogs(worst=20))
    monkeypatch.setattr("fatigue_runner.campaign.kept_logs.MANY", 3)
    (sentence,) = make_plan(write_campaign(tmp_path)).words_of_logs
    assert "12 cases: logs of 20 of them are kept, of the worst" in sentence
    assert make_plan(write_campaign(tmp_path, log="{cases: all}")).words_of_logs == []


def test_who_watches_a_large_campaign_sees_some_cases_of_it(monkeypatch, tmp_path):
    build_world(monkeypatch)
    monkeypatch.setattr("fatigue_runner.campaign.kept_logs.MANY", 3)
    plan = make_plan(write_campaign(tmp_path))
    plan.watched = True
    assert len(plan.logged_at_once) == 12 and "of every so many" in plan.words_of_logs[0]
    blind = make_plan(write_campaign(tmp_path, log="{cases: {worst: 3}}"))
    blind.watched = True
    assert "nothing to watch" in blind.words_of_logs[0]


@pytest.mark.parametrize(
    ("cases", "told"),
    [
        ("foo", "log.cases: 'foo' is not known; known: all, none"),
        ("{worst: 0}", "log.cases.worst must be above 0"),
        ("{worst: 2, sample: 2}", "give exactly one of worst, sample and where"),
        ("{}", "give exactly one of worst, sample and where"),
        ("{where: [slow]}", "'slow' is not known; known: diverged, rejected"),
        ("{wurst: 3}", "unknown key 'wurst' in log.cases; did you mean 'worst'"),
    ],
)
def test_what_says_nothing_is_refused_with_its_line(tmp_path, cases, told):
    with pytest.raises(InputError, match=rf"toy\.yaml:\d+: .*{told}"):
        make_plan(write_campaign(tmp_path, log=f"{{cases: {cases}}}"))


def test_the_worst_need_a_reference(tmp_path):
    with pytest.raises(InputError, match="without a reference nobody knows which cases are the worst"):
        make_plan(write_campaign(tmp_path, log="{cases: {worst: 3}}", reference="none"))


def test_the_resolved_campaign_says_the_same(finished):
    text = (finished / "campaign.yaml").read_text()
    assert (
        "worst: 1" in text
        and json.loads((finished / "run.json").read_text())["campaign"]["log"]["cases"]["worst"] == 1
    )
    assert make_plan(finished / "campaign.yaml").kept_logs == KeptLogs(worst=1)
