"""Campaigns on the real turbine: the same bits on any number of workers, honest failures, the shipped files, the API."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from places import CAMPAIGNS

import fatigue_runner as fr
from fatigue_runner.campaign import run_campaign
from fatigue_runner.campaign.about import resolved_yaml
from fatigue_runner.campaign.plan import BLOCK_SIZE, make_plan
from fatigue_runner.channels import LOAD_NAMES
from fatigue_runner.errors import InputError
from fatigue_runner.logbook import read_log

SHIPPED = sorted(
    set(CAMPAIGNS.glob("*.yaml")) - {CAMPAIGNS / "work_precision.yaml"}
)  # that one is a benchmark's

SMALL = {
    "name": "small",
    "duration": 4,
    "wind": {"speeds": [6, 8, 10], "vertical_shear": 0.1},
    "integrators": [{"method": "heun", "step": 0.02}, {"method": "rk4", "step": [0.02, 0.04]}],
    "reference": {"method": "rk7", "step": 0.01},
}


@pytest.fixture(autouse=True)
def no_report(monkeypatch):
    monkeypatch.setattr("fatigue_runner.report.write_report", lambda folder: folder / "report.html")


def without_wall_time(results) -> list[dict]:
    return [{name: value for name, value in row.items() if name != "wall_time"} for row in results]


def test_two_workers_give_the_same_bits_as_one(tmp_path):
    one = run_campaign(SMALL, tmp_path / "one", workers=1)
    two = run_campaign(SMALL, tmp_path / "two", workers=2)
    assert without_wall_time(two) == without_wall_time(one)
    for case_id in one.column("case_id"):
        ours, theirs = (read_log(tmp_path / run / "logs" / f"{case_id}.mcap") for run in ("one", "two"))
        assert np.array_equal(ours.state, theirs.state)
        assert all(np.array_equal(ours.loads[name], theirs.loads[name]) for name in LOAD_NAMES)


def test_a_smaller_step_and_a_higher_order_are_closer_to_the_reference(tmp_path):
    results = run_campaign(SMALL, tmp_path / "out", workers=1)
    assert results.exit_code == 0
    worst = {
        (row["method"], row["step"]): max(
            r["nrmse_max"] for r in results.where(method=row["method"], step=row["step"])
        )
        for row in results
        if not row["is_reference"]
    }
    assert worst["rk4", 0.02] < worst["rk4", 0.04] < 1e-2
    assert worst["rk4", 0.02] < worst["heun", 0.02] < 5e-2


def test_a_turbine_that_is_thrown_diverges_and_says_when(tmp_path):
    thrown = [0.0] * 16
    thrown[2] = 5000.0  # blade 1 flap [m]: no turbine, but numbers
    results = run_campaign(SMALL | {"initial": thrown}, tmp_path / "out", workers=1)
    assert results.exit_code == 1
    row = results.lost[0]
    assert row["status"] == "diverged"
    assert 0 <= row["diverged_at"] < 4
    assert row["del_blade1_root_flapwise_moment_m3"] is None
    assert read_log(tmp_path / "out" / "logs" / f"{row['case_id']}.mcap").duration <= row["diverged_at"]


def test_a_step_above_the_stability_limit_is_refused_with_the_limit(tmp_path):
    campaign = SMALL | {"integrators": [{"method": "heun", "step": 0.04}]}
    with pytest.raises(
        InputError, match=r"heun at 40 ms is unstable on nrel5mw: its stability limit is 3\d\.\d ms"
    ):
        run_campaign(campaign, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("initial", ["operating-point", "paper-spinning"])
def test_a_pitch_outside_the_tables_is_refused(initial, tmp_path):
    with pytest.raises(InputError, match="campaign: pitch 40 deg is outside the aerodynamic table"):
        run_campaign(SMALL | {"pitch": 40.0, "initial": initial}, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_unknown_turbine_is_refused_with_its_line_and_the_nearest_one(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(
        "name: a\nturbine: nrel5m\nduration: 4\nwind: {speeds: 8}\nintegrators: [{method: heun, step: 0.01}]\n"
    )
    with pytest.raises(InputError, match=r"a\.yaml:2: there is no turbine 'nrel5m'; did you mean 'nrel5mw'"):
        run_campaign(path, tmp_path / "out")


def test_a_block_fills_the_lanes_of_the_kernel():
    from fatigue_runner.turbine.generated.kernel import LANES

    assert BLOCK_SIZE % LANES == 0


def test_a_benchmarks_file_is_sent_to_its_command():
    with pytest.raises(InputError, match="fatigue-runner benchmark work-precision"):
        make_plan(CAMPAIGNS / "work_precision.yaml")


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_campaign_is_valid_and_its_resolved_form_means_the_same(path, tmp_path):
    plan = make_plan(path)
    assert path.stem == plan.campaign.name.replace("-", "_")
    copy = tmp_path / "resolved.yaml"
    copy.write_text(resolved_yaml(plan.named))
    assert [case.hash for case in make_plan(copy).cases] == [case.hash for case in plan.cases]


def test_the_quickstart_shows_a_turbulent_life():
    plan = make_plan(CAMPAIGNS / "quickstart.yaml")
    assert {wind.mean_speed for wind in plan.named.realisations} == {4, 8, 12, 16, 20, 24}
    assert {case.integration.method for case in plan.cases} == {"heun", "rk3", "rk4", "dop853"}
    assert (plan.campaign.operation, plan.campaign.turbine) == ("controlled", "nrel5mw")
    assert plan.campaign.lifetime is not None and plan.campaign.wind.type == "turbulent"


def test_dlc_1_2_is_that_of_the_standard():
    plan = make_plan(CAMPAIGNS / "dlc12.yaml")
    assert sorted({wind.mean_speed for wind in plan.named.realisations}) == list(range(4, 25, 2))
    assert len(plan.named.realisations) == 66 and plan.ready.signals == 3 + 2 * 6
    assert (plan.campaign.duration, plan.campaign.discard, plan.campaign.operation) == (
        720,
        120,
        "controlled",
    )
    assert len({case.integration for case in plan.cases}) >= 4


@pytest.mark.parametrize(("name", "beyond"), [("paper_in_range", 0), ("paper_out_of_range", 50)])
def test_the_paper_campaigns_have_the_papers_winds_steps_and_reference(name, beyond):
    plan = make_plan(CAMPAIGNS / f"{name}.yaml")
    winds = {case.wind.id: dict(case.wind.parameters)["speed"] for case in plan.cases}
    assert len(winds) == 200
    assert sum(speed > 10 for speed in winds.values()) == beyond
    assert all(5 <= speed <= 20 for speed in winds.values())
    assert {(c.integration.method, c.integration.step) for c in plan.cases if c.integration.is_reference} == {
        ("rk7", 1e-4)
    }
    others = [c.integration for c in plan.cases if not c.integration.is_reference]
    assert {(i.method, i.step) for i in others if not i.corrector} == {
        *((method, step) for method in ("heun", "rk3", "heun-richardson") for step in (0.01, 0.005)),
        ("rk3", 0.015),  # costs what Heun does at 10 ms
    }
    assert {(i.step, i.mode) for i in others if i.corrector} == {
        (step, mode) for step in (0.01, 0.005) for mode in ("enhanced", "hybrid")
    }
    assert len({i.corrector for i in others if i.corrector}) == 4  # network and affine map, each at its step
    assert (plan.campaign.turbine, plan.campaign.duration, plan.campaign.initial) == (
        "t2b1i1cg",
        20,
        "paper-spinning",
    )


def test_simulate_gives_the_trajectory_that_the_api_promises():
    turbine = fr.load_turbine("nrel5mw")
    trajectory = fr.simulate(turbine, wind=fr.ConstantWind(8.0), method="heun", step=0.01, duration=2.0)
    n = len(trajectory.time)
    assert n == 201 and trajectory.time[-1] == pytest.approx(2.0)
    assert trajectory.state.shape == (n, 16)
    assert set(trajectory.loads) == set(LOAD_NAMES) and trajectory.loads["rotor_thrust"].shape == (n,)
    assert trajectory.accepted.shape == (n - 1,)
    assert trajectory.evaluations >= 400
    # the operating point without shear is steady but for gravity turning with the azimuth
    assert np.ptp(trajectory.state[:, 14]) < 0.01 * trajectory.state[0, 14]


def test_output_between_steps_is_as_close_as_the_method():
    wind = fr.ConstantWind(8.0)
    fine = fr.simulate("nrel5mw", wind, "rk4", 0.01, 2.0, output_step=0.01)
    coarse = fr.simulate("nrel5mw", wind, "rk4", 0.1, 2.0, output_step=0.01)
    assert coarse.state.shape == fine.state.shape
    assert np.abs(coarse.state[:, 0] - fine.state[:, 0]).max() < 1e-4


def test_the_papers_spinning_start_has_no_twist_in_the_shaft_and_the_literal_one_has_60_degrees():
    turbine = fr.load_turbine("t2b1i1cg")
    ratio = turbine.parameters["g_ratio"]
    for initial, twist in (("paper-spinning", 0.0), ("paper", -np.pi / 3)):
        state = fr.simulate(turbine, 8.0, "rk4", 0.001, 0.002, initial=initial).state[0]
        assert state[6] == pytest.approx(np.pi / 3)
        assert state[7] / ratio - state[6] == pytest.approx(twist)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"method": "rk44"}, "did you mean 'rk4'"),
        ({"step": 0.0}, "step must be above 0 s, got 0.0"),
        ({"duration": float("nan")}, "duration must be above 0 s, got nan"),
        ({"initial": "papper"}, "did you mean 'paper'"),
        ({"initial": np.zeros(8)}, "a state of 16 finite numbers"),
    ],
)
def test_simulate_refuses_what_makes_no_sense(change, message):
    with pytest.raises(InputError, match=message):
        fr.simulate("nrel5mw", 8.0, **change)


def test_run_campaign_takes_a_mapping_and_returns_the_table(tmp_path):
    results = fr.run_campaign(SMALL, tmp_path / "out", workers=1)
    assert len(results) == 12
    assert results.where(method="heun")[0]["step"] == 0.02


@pytest.mark.slow(reason="a campaign of 200 winds is started, stopped and gone on with")
def test_ctrl_c_ends_with_130_leaves_no_worker_and_the_same_command_goes_on(tmp_path):
    text = (CAMPAIGNS / "quickstart.yaml").read_text()
    campaign = tmp_path / "long.yaml"
    campaign.write_text(text.replace("name: quickstart", "name: long").replace("seeds: 2 ", "seeds: 200 "))
    command = [sys.executable, "-m", "fatigue_runner", "run", str(campaign), "--out", str(tmp_path / "out")]
    # a test run in the background may ignore SIGINT, which its children would inherit
    listening = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=listening
    )  # fmt: skip
    journal = tmp_path / "out" / "cases.jsonl"
    deadline = time.monotonic() + 300
    while time.monotonic() < deadline and not (journal.exists() and journal.stat().st_size):
        time.sleep(0.2)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the whole group
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "cases are finished; the same command runs the rest" in errors
    assert "Traceback" not in errors
    assert group_is_gone(process.pid), "a worker outlived the campaign"
    finished = journal.read_bytes().count(b"\n")
    assert finished > 0
    assert make_and_count(campaign, tmp_path / "out") == finished


def group_is_gone(group: int) -> bool:
    """Whether all processes of a group end within seconds; joblib's resource tracker ends after its parent."""
    for _ in range(100):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


def make_and_count(campaign: Path, out: Path) -> int:
    """How many cases of a campaign a run folder has finished."""
    from fatigue_runner.campaign.store import Store

    plan = make_plan(campaign)
    store = Store(out, plan.identity)
    return sum(plan.finished(store, case) for case in plan.cases)
