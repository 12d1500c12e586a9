"""A campaign runs every case once, keeps what is finished, and never mixes the figures of two campaigns."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from campaign_world import CAMPAIGN, build_world, write_campaign
from ruamel.yaml import YAML

from fatigue_runner.campaign import CampaignInterrupted, run, run_campaign
from fatigue_runner.campaign.pieces import Pieces, leave
from fatigue_runner.campaign.plan import make_plan
from fatigue_runner.campaign.progress import _minutes
from fatigue_runner.campaign.store import Store
from fatigue_runner.channels import FATIGUE_CHANNELS
from fatigue_runner.errors import FatigueRunnerError, FatigueRunnerWarning, InputError
from fatigue_runner.fatigue import damage_equivalent_load, short_term_cycles
from fatigue_runner.logbook import read_log
from fatigue_runner.results.columns import columns
from fatigue_runner.results.records import from_line
from fatigue_runner.results.table import read_results


@pytest.fixture
def world(monkeypatch):
    monkeypatch.setattr("fatigue_runner.report.write_report", lambda folder: folder / "report.html")
    return build_world(monkeypatch)


@pytest.fixture
def campaign(tmp_path):
    return write_campaign(tmp_path)


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out"


def snapshot(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_every_wind_meets_every_integrator_and_the_reference_once(world, campaign, out):
    results = run_campaign(campaign, out)
    with (out / "columns.csv").open(encoding="utf-8", newline="") as file:
        told = {row["column"]: row["unit"] for row in csv.DictReader(file)}
    assert list(told) == results.columns and told["std_blade_pitch"] == "rad" and told["wall_time"] == "s"
    assert len(results) == 3 * 4
    assert results.exit_code == 0
    for method, count in (("rk7", 1), ("rk4", 1), ("heun", 2)):
        assert sorted(world.simulated(method)) == sorted([6.0, 8.0, 10.0] * count)
    assert results.column("case_id")[:4] == [
        "v06.00_rk7_10ms",
        "v06.00_heun_50ms",
        "v06.00_heun_100ms",
        "v06.00_rk4_100ms",
    ]


def test_del_error_and_damage_ratio_are_those_of_the_toy_integrators(world, campaign, out):
    results = run_campaign(campaign, out)
    row = results.where(method="heun", step=0.1, wind_speed=8.0)[0]
    # The toy's amplitude is 1 + step**2; the DEL is linear in it and the damage its power (campaign_world).
    suffix = "blade1_root_flapwise_moment_m10"
    assert row[f"del_error_{suffix}"] == pytest.approx(0.01, rel=1e-9)
    assert row[f"damage_ratio_{suffix}"] == pytest.approx(1.01**10, rel=1e-9)
    assert row["nrmse_max"] == pytest.approx(0.01 * np.sqrt(0.5) / 2, rel=0.02)
    assert row["evaluations_per_second"] == pytest.approx(20.0)


def test_the_reference_has_loads_and_costs_but_no_errors(world, campaign, out):
    (row, *_) = run_campaign(campaign, out).where(is_reference=True)
    assert row["del_blade1_root_flapwise_moment_m3"] > 0
    assert row["evaluations"] > 0
    assert row["nrmse_max"] is None
    assert row["del_error_blade1_root_flapwise_moment_m3"] is None


def test_the_csv_has_the_columns_in_order_and_empty_cells_for_the_unknown(world, campaign, out):
    results = run_campaign(campaign, out)
    with (out / "results.csv").open(newline="") as file:
        reader = csv.DictReader(file)
        rows = list(reader)
    assert reader.fieldnames == columns(FATIGUE_CHANNELS, [3, 4, 5, 10, 12])
    assert reader.fieldnames[:3] == ["case_id", "wind_source", "wind_speed"]
    figures = ("mean", "min", "max", "std", "min_time", "max_time")
    assert reader.fieldnames[-6:] == [f"{name}_rotor_speed" for name in figures]
    assert rows[0]["nrmse_max"] == rows[0]["corrector"] == ""
    assert "nan" not in (out / "results.csv").read_text()
    assert float(rows[1]["nrmse_max"]) == results.rows[1]["nrmse_max"]


def test_the_root_by_direction_is_counted_logged_and_read_again_from_the_log(world, tmp_path, out):
    text = CAMPAIGN + "fatigue: {wohler_exponents: [4]}\nlog: {precision: float64}\n"
    run_campaign(write_campaign(tmp_path, text), out)
    campaign = write_campaign(tmp_path, text + "loads: {root_directions: 4}\n")
    world.calls.clear()
    results = run_campaign(campaign, out)
    assert world.calls == []  # from the logs, which get the new channels
    flap, edge, diagonal = (
        np.array(results.column(f"del_{name}_m4"))
        for name in ("RootMyb1", "RootMxb1", "blade1_root_moment_45deg")
    )
    # the toy's loads are in phase
    np.testing.assert_allclose(diagonal, (flap + edge) / np.sqrt(2), rtol=1e-12)
    assert results.column("del_blade1_root_moment_0deg_m4") == results.column("del_RootMyb1_m4")
    log = read_log(out / "logs" / "v08.00_heun_50ms.mcap")
    np.testing.assert_allclose(log["blade1_root_moment_90deg"], log["RootMxb1"], rtol=1e-12)
    assert results.column("max_blade1_root_moment_45deg")[0] == pytest.approx(log_max(out))
    assert read_results(out)[0]["del_error_blade1_root_moment_135deg_m4"] == ""  # the reference's


def log_max(out):
    return float(read_log(out / "logs" / "v06.00_rk7_10ms.mcap")["blade1_root_moment_45deg"].max())


def test_the_parquet_table_equals_the_rows(world, campaign, out):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    results = run_campaign(campaign, out)
    assert parquet.read_table(out / "results.parquet").to_pylist() == results.rows


def test_every_case_has_a_log_that_says_what_it_is_and_how_far_from_the_reference(world, campaign, out):
    results = run_campaign(campaign, out)
    assert {p.stem for p in (out / "logs").iterdir()} == set(results.column("case_id"))
    log = read_log(out / "logs" / "v08.00_heun_100ms.mcap")
    assert log.run["method"] == "heun" and log.run["step"] == "0.1" and log.run["wind_speed"] == "8.0"
    assert log.run["turbine_hash"] == "0" * 64
    assert log.result["status"] == "done"
    assert b"name: toy" in log.attachments["campaign.yaml"]
    turbine = log.attachments["turbine.yaml"].decode()
    assert log.run["turbine_hash"] in turbine.splitlines()[0]
    assert {"geometry", "blade", "tower", "generator"} <= set(YAML(typ="safe", pure=True).load(turbine))
    assert len(log.time) == 501
    assert log.reference_error.max() == pytest.approx(0.01 / 2, rel=0.01)


def test_the_run_folder_says_whose_it_is_and_can_be_run_again_from_its_own_campaign_file(
    world, campaign, out
):
    first = run_campaign(campaign, out)
    run = json.loads((out / "run.json").read_text())
    assert run["name"] == "toy"
    assert run["facts"]["turbine"] == "toy"
    calls = len(world.calls)
    again = run_campaign(out / "campaign.yaml", out)
    assert (again.kept, again.simulated) == (12, 0)
    assert len(world.calls) == calls
    assert again.rows == first.rows


def test_evaluations_are_timed_where_a_campaign_asks_and_kept_when_it_goes_on(
    world, tmp_path, out, monkeypatch
):
    timed = []

    def evaluation_times(ensemble, integrators):
        timed.append([i.method for i in integrators])
        return {"f": {"single": 1e-6 * len(timed), "lane": 1e-7}}

    monkeypatch.setattr("fatigue_runner.integrators.evaluation_times.evaluation_times", evaluation_times)
    run_campaign(write_campaign(tmp_path), out)
    assert timed == [] and "evaluation_times" not in json.loads((out / "run.json").read_text())
    asked = write_campaign(tmp_path, delta_t=True)
    for _ in range(2):
        run_campaign(asked, out)
        assert json.loads((out / "run.json").read_text())["evaluation_times"]["f"]["single"] == 1e-6
    assert timed == [["rk7", "heun", "heun", "rk4"]]


def test_finished_cases_are_not_run_again(world, campaign, out):
    first = run_campaign(campaign, out)
    calls = len(world.calls)
    second = run_campaign(campaign, out)
    assert len(world.calls) == calls
    assert (first.simulated, first.kept) == (12, 0)
    assert (second.simulated, second.kept) == (0, 12)
    assert second.rows == first.rows


def test_only_the_missing_integrator_runs_and_the_reference_is_read_from_its_log(world, tmp_path, out):
    whole = CAMPAIGN + "log: {precision: float64}\n"
    fresh = run_campaign(write_campaign(tmp_path, whole), tmp_path / "whole").where(method="rk4")
    run_campaign(write_campaign(tmp_path, whole.replace("  - {method: rk4, step: 0.1}\n", "")), out)
    world.calls.clear()
    results = run_campaign(write_campaign(tmp_path, whole), out)
    assert [method for method, _, _ in world.calls] == ["rk4"]
    assert results.simulated == 3
    assert results.where(method="rk4") == fresh  # bit for bit, although the reference came from the log


def test_a_case_whose_log_was_lost_or_cut_runs_again(world, campaign, out):
    run_campaign(campaign, out)
    (out / "logs" / "v06.00_heun_50ms.mcap").unlink()
    cut = out / "logs" / "v08.00_heun_50ms.mcap"
    cut.write_bytes(cut.read_bytes()[:-100])
    world.calls.clear()
    assert run_campaign(campaign, out).simulated == 2
    assert sorted(world.simulated("heun")) == [6.0, 8.0]


def test_other_wohler_exponents_are_evaluated_from_the_logs(world, tmp_path, out):
    exact = {"log": "{precision: float64}"}
    run_campaign(write_campaign(tmp_path, **exact), out)
    world.calls.clear()
    results = run_campaign(write_campaign(tmp_path, fatigue="{wohler_exponents: [8]}", **exact), out)
    assert world.calls == []
    assert results.where(method="heun", step=0.1)[0][
        "del_error_blade1_root_flapwise_moment_m8"
    ] == pytest.approx(0.01)


def test_a_log_of_half_the_precision_is_no_reason_not_to_simulate_again(world, tmp_path, out):
    """Its states are rounded, so that errors from it would not be those of a fresh run; a reference's is whole."""
    run_campaign(write_campaign(tmp_path), out)
    world.calls.clear()
    run_campaign(write_campaign(tmp_path, fatigue="{wohler_exponents: [8]}"), out)
    assert len(world.calls) == 3 and world.simulated("rk7") == []
    world.calls.clear()
    run_campaign(write_campaign(tmp_path, log="{precision: float64}"), out)
    assert len(world.calls) == 4  # what lies there is not what this one writes


def test_what_is_counted_is_what_the_log_holds(world, campaign, out):
    for row in run_campaign(campaign, out):
        log = read_log(out / "logs" / f"{row['case_id']}.mcap")
        kept = log.time >= float(log.run["discard"]) - 1e-9
        cycles = short_term_cycles(log.time[-1] - log.time[kept][0])
        for channel in FATIGUE_CHANNELS:
            series = log[channel][kept]
            assert row[f"del_{channel}_m4"] == damage_equivalent_load(series, 4.0, cycles)
            assert (row[f"max_{channel}"], row[f"min_{channel}"]) == (series.max(), series.min())
            assert (series == series.astype(np.float32)).all()


def test_a_crash_in_the_journal_costs_the_last_line_only(world, campaign, out):
    run_campaign(campaign, out)
    journal = out / "cases.jsonl"
    journal.write_bytes(journal.read_bytes()[:-20])
    world.calls.clear()
    results = run_campaign(campaign, out)
    assert results.simulated == 1
    assert run_campaign(campaign, out).simulated == 0
    assert results.exit_code == 0


def test_fresh_runs_everything_again(world, campaign, out):
    run_campaign(campaign, out)
    world.calls.clear()
    assert run_campaign(campaign, out, fresh=True).simulated == 12


def test_an_interruption_keeps_the_finished_blocks_and_the_next_run_does_the_rest(
    world, tmp_path, out, monkeypatch
):
    campaign = write_campaign(tmp_path, CAMPAIGN.replace("[6, 8, 10]", "{start: 5, stop: 9.9, step: 0.1}"))
    add, seen = Store.add, []

    def stop_after_two(self, records):
        add(self, records)
        seen.append(len(records))
        if len(seen) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(Store, "add", stop_after_two)
    with pytest.raises(
        CampaignInterrupted, match=r"of 200 cases are finished; the same command runs the rest"
    ) as error:
        run_campaign(campaign, out)
    assert error.value.exit_code == 130
    assert not (out / "results.csv").exists()
    monkeypatch.undo()
    build_world(monkeypatch)
    monkeypatch.setattr("fatigue_runner.report.write_report", lambda folder: None)
    results = run_campaign(campaign, out)
    assert results.kept == sum(seen) > 0
    assert results.simulated == 200 - sum(seen) > 0


def test_a_diverged_case_is_reported_with_its_time_and_the_rest_finishes(world, campaign, out):
    world.diverging["heun", 8.0] = 4.0
    results = run_campaign(campaign, out)
    assert results.exit_code == 1
    lost = results.lost
    assert [row["case_id"] for row in lost] == ["v08.00_heun_50ms", "v08.00_heun_100ms"]
    assert lost[0]["status"] == "diverged" and lost[0]["diverged_at"] == 4.0
    assert all(
        lost[0][name] is None for name in lost[0] if name.startswith(("del_", "damage_", "nrmse", "mean_"))
    )
    assert read_log(out / "logs" / "v08.00_heun_50ms.mcap").time[-1] == 4.0
    assert sum(row["status"] == "done" for row in results) == 10
    assert run_campaign(campaign, out).simulated == 0  # it would diverge again


def test_a_state_that_is_no_number_is_a_failure_with_its_time_never_a_figure(
    world, campaign, out, monkeypatch
):
    from fatigue_runner import integrators

    simulate = integrators.simulate

    def poisoned(ensemble, integrator):
        trajectories = simulate(ensemble, integrator)
        if integrator.method == "rk4":
            trajectories[1].state[200:, 3] = np.nan
        return trajectories

    monkeypatch.setattr(integrators, "simulate", poisoned)
    (row,) = run_campaign(campaign, out).lost
    assert (row["case_id"], row["status"]) == ("v08.00_rk4_100ms", "failed")
    assert "no number from 4 s on" in row["error_message"]
    assert row["del_blade1_root_flapwise_moment_m3"] is None


def test_a_report_that_fails_costs_neither_the_results_nor_a_traceback(world, campaign, out, monkeypatch):
    def broken(folder):
        raise ValueError("no ink")

    monkeypatch.setattr("fatigue_runner.report.write_report", broken)
    results = run_campaign(campaign, out)
    assert len(results) == 12 and (out / "results.csv").is_file()
    assert (results.exit_code, results.report_error) == (1, "ValueError: no ink")


def test_nothing_is_compared_with_a_reference_that_diverged(world, campaign, out):
    world.diverging["rk7", 8.0] = 4.0
    results = run_campaign(campaign, out)
    row = results.where(method="rk4", wind_speed=8.0)[0]
    assert row["status"] == "done" and row["del_blade1_root_flapwise_moment_m3"] > 0
    assert row["nrmse_max"] is None and row["del_error_blade1_root_flapwise_moment_m3"] is None


def test_an_integrator_that_raises_fails_alone_and_is_tried_again(world, campaign, out):
    world.raising["rk4"] = RuntimeError("no luck")
    results = run_campaign(campaign, out)
    assert {row["method"] for row in results.lost} == {"rk4"}
    assert {row["error_message"] for row in results.lost} == {"no luck"}
    world.raising.clear()
    again = run_campaign(campaign, out)
    assert (again.simulated, again.exit_code) == (3, 0)


def test_a_log_that_cannot_be_written_fails_its_case_only(world, campaign, out, monkeypatch):
    import fatigue_runner.logbook as logbook

    write = logbook.log_of

    def full_disk(path, *args, **kwargs):
        if path.stem == "v08.00_rk4_100ms":
            raise logbook.LogError("the disk is full; free space or choose another folder")
        return write(path, *args, **kwargs)

    monkeypatch.setattr(logbook, "log_of", full_disk)
    results = run_campaign(campaign, out)
    assert [row["case_id"] for row in results.lost] == ["v08.00_rk4_100ms"]
    assert "the disk is full" in results.lost[0]["error_message"]


def test_without_logs_a_campaign_still_resumes(world, tmp_path, out):
    campaign = write_campaign(tmp_path, log="{enabled: false}")
    run_campaign(campaign, out)
    assert list((out / "logs").iterdir()) == []
    assert run_campaign(campaign, out).simulated == 0


def test_without_a_reference_there_are_loads_and_no_errors(world, tmp_path, out):
    text = CAMPAIGN.replace("{method: rk7, step: 0.01}", "null")
    results = run_campaign(write_campaign(tmp_path, text), out)
    assert len(results) == 9
    assert all(row["nrmse_max"] is None and row["del_blade1_root_flapwise_moment_m3"] > 0 for row in results)


def test_discarded_seconds_count_nowhere(world, tmp_path, out):
    row = run_campaign(write_campaign(tmp_path, discard="4"), out).rows[0]
    log = read_log(out / "logs" / f"{row['case_id']}.mcap")
    load = log.loads["blade1_root_flapwise_moment"][log.time >= 4]
    expected = damage_equivalent_load(load, 4, short_term_cycles(6.0))
    assert row["del_blade1_root_flapwise_moment_m4"] == expected
    assert row["mean_blade1_root_flapwise_moment"] == np.mean(load)
    assert row["duration"] == log.duration == 10.0  # the log and the costs are of the whole case


FOREIGN = {
    "another campaign": (
        "name",
        "other",
        "belongs to another campaign (toy, this one is other); choose another --out",
    ),
    "another duration": (
        "duration",
        "12",
        "was run with another duration (10.0, now 12.0); choose another --out, or",
    ),
    "another start": ("initial", "paper", "was run with another initial (operating-point, now paper)"),
}


@pytest.mark.parametrize(("key", "value", "message"), FOREIGN.values(), ids=FOREIGN.keys())
def test_the_folder_of_another_campaign_is_refused_and_left_as_it_was(
    world, tmp_path, out, key, value, message
):
    run_campaign(write_campaign(tmp_path), out)
    before = snapshot(out)
    with pytest.raises(InputError) as error:
        run_campaign(write_campaign(tmp_path, **{key: value}), out)
    assert message in str(error.value)
    assert snapshot(out) == before


def test_fresh_does_not_overwrite_the_folder_of_another_campaign(world, tmp_path, out):
    run_campaign(write_campaign(tmp_path), out)
    with pytest.raises(InputError, match="another campaign"):
        run_campaign(write_campaign(tmp_path, name="other"), out, fresh=True)


def test_a_folder_with_other_files_is_refused_and_left_as_it_was(world, campaign, out):
    out.mkdir()
    (out / "thesis.txt").write_text("years of work")
    with pytest.raises(InputError, match="holds files but no run; give --out a new or empty folder"):
        run_campaign(campaign, out)
    assert snapshot(out) == {"thesis.txt": b"years of work"}


def test_a_file_is_no_run_folder(world, campaign, out):
    out.write_text("")
    with pytest.raises(InputError, match="is a file; give --out a folder"):
        run_campaign(campaign, out)


def test_a_second_run_into_the_same_folder_is_refused_while_the_first_one_writes(
    world, campaign, out, monkeypatch
):
    pytest.importorskip("fcntl", reason="locks are those of Unix")
    told = []

    def run_again(self, records):
        with pytest.raises(InputError, match="another run is writing here") as error:
            run_campaign(campaign, out)
        told.append(error)

    monkeypatch.setattr("fatigue_runner.campaign.progress.Progress.advance", run_again)
    assert run_campaign(campaign, out).exit_code == 0
    assert told


REFUSED = {
    "unknown integrator": (
        "rk4, step: 0.1",
        "rk44, step: 0.1",
        "toy.yaml:9: unknown integrator 'rk44'; did you mean 'rk4'?",
    ),
    "unstable step": (
        "[0.05, 0.1]",
        "[0.05, 0.3]",
        "toy.yaml:8: heun at 300 ms is unstable on toy: its stability limit is",
    ),
    "wind outside the table": (
        "[6, 8, 10]",
        "[6, 80]",
        "toy.yaml:6: wind speed 80 m/s is outside the aerodynamic tables",
    ),
    "no wind": ("[6, 8, 10]", "[6, 0]", "toy.yaml:6: wind speed 0 m/s is outside the aerodynamic tables"),
    "missing wind file": (
        "speeds: [6, 8, 10]",
        "type: file\n  files: gone.csv",
        "toy.yaml:7: wind file 'gone.csv' cannot be read (No such file or directory); looked for ",
    ),
}


@pytest.mark.parametrize(("line", "instead", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_what_the_turbine_cannot_do_is_refused_and_nothing_is_written(
    world, tmp_path, out, line, instead, message
):
    with pytest.raises(InputError) as error:
        run_campaign(write_campaign(tmp_path, CAMPAIGN.replace(line, instead)), out)
    assert message in str(error.value)
    assert not out.exists()
    assert world.calls == []


@pytest.mark.parametrize("name", ["mine.yaml", "mine.YAML", "mine.yml", "./mine"])
def test_a_turbine_file_is_looked_for_beside_the_campaign(world, tmp_path, name):
    plan = make_plan(write_campaign(tmp_path, turbine=name))
    assert plan.named.turbine_source == str(tmp_path / name)
    assert make_plan(write_campaign(tmp_path, turbine="mine")).named.turbine_source == "mine"


def test_winds_from_files_run_and_are_named_after_them(world, tmp_path, out):
    times = np.arange(0, 12.5, 0.5)
    for name, mean in (("gust", 8.0), ("calm", 6.0)):
        rows = [f"{t},{mean + np.sin(t)},0.1,0" for t in times]
        (tmp_path / f"{name}.csv").write_text(
            "\n".join(["time,wind_speed,vertical_shear,horizontal_shear", *rows])
        )
    text = CAMPAIGN.replace("speeds: [6, 8, 10]", "type: file\n  files: [gust.csv, calm.csv]")
    results = run_campaign(write_campaign(tmp_path, text), out)
    assert results.rows[0]["case_id"] == "gust_rk7_10ms"
    assert results.rows[0]["wind_source"] == "file"
    assert results.exit_code == 0


def test_a_wind_file_shorter_than_the_campaign_is_refused(world, tmp_path, out):
    rows = [f"{t},8,0,0" for t in (0, 1, 2, 3)]
    (tmp_path / "short.csv").write_text("\n".join(["time,wind_speed,vertical_shear,horizontal_shear", *rows]))
    text = CAMPAIGN.replace("speeds: [6, 8, 10]", "type: file\n  files: short.csv")
    with pytest.raises(InputError, match=r"toy\.yaml:7: the wind .* is 3 s long, the campaign runs 10 s"):
        run_campaign(write_campaign(tmp_path, text), out)


def test_seeds_and_shears_are_in_the_case_names_and_the_table(world, tmp_path, out):
    text = CAMPAIGN.replace("[6, 8, 10]", "12\n  type: turbulent\n  turbulence_class: B\n  seeds: [1, 2]")
    results = run_campaign(write_campaign(tmp_path, text), out)
    assert results.rows[0]["case_id"] == "v12.00_ntmB_s1_rk7_10ms"
    assert results.column("seed")[::4] == [1, 2]
    # NTM class B at 12 m/s: 0.14 (0.75 * 12 + 5.6) / 12 (IEC 61400-1, ed. 3, eq. 11)
    assert results.rows[0]["turbulence_intensity"] == pytest.approx(0.14 * (0.75 * 12 + 5.6) / 12)


def test_a_shear_exponent_becomes_the_linear_shear_of_this_rotor(world, tmp_path, out):
    text = CAMPAIGN.replace("[6, 8, 10]", "8\n  shear_exponent: 0.2\n  harmonics: 1")
    row = run_campaign(write_campaign(tmp_path, text), out).rows[0]
    assert row["vertical_shear"] == pytest.approx(0.2 * 63 / 90)
    assert row["case_id"] == "v08.00_a0.20_rk7_10ms"


def test_dask_without_its_package_is_refused_with_the_pip_command(world, campaign, out):
    import importlib.util

    if importlib.util.find_spec("distributed") is not None:
        pytest.skip("distributed is installed")
    with pytest.raises(InputError, match="pip install distributed"):
        run_campaign(campaign, out, dask="tcp://localhost:8786")
    assert not out.exists()


def _looped(tmp_path):
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    return tmp_path / "a" / "x"


def _below_a_file(tmp_path):
    (tmp_path / "file").write_text("")
    return tmp_path / "file" / "x"


def _dangling(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "nowhere" / "else")
    return tmp_path / "link"


OUTS = {
    "long name": (lambda tmp_path: tmp_path / ("b" * 300), "too long"),
    "long name of two bytes a letter": (lambda tmp_path: tmp_path / ("ж" * 200), "too long"),
    "below a file": (_below_a_file, "is a file, not a folder"),
    "circle": (_looped, "circle|levels of symbolic links"),
    "link to nowhere": (_dangling, "leads nowhere"),
}


@pytest.mark.parametrize(("place", "message"), OUTS.values(), ids=OUTS)
def test_a_run_folder_that_cannot_be_is_refused_before_anything_runs(world, tmp_path, place, message):
    with pytest.raises(InputError, match=message):
        run_campaign(write_campaign(tmp_path), place(tmp_path))
    assert world.calls == []


def test_a_campaign_behind_a_link_finds_what_lies_beside_the_link_and_beside_the_file(world, tmp_path):
    """As annexes and stow make them."""
    (tmp_path / "store").mkdir(), (tmp_path / "project").mkdir()
    wind = "  type: file\n  files: [beside-link.csv, beside-file.csv]"
    path = write_campaign(tmp_path / "store", CAMPAIGN.replace("  speeds: [6, 8, 10]", wind))
    link = tmp_path / "project" / "mine.yaml"
    link.symlink_to(path)
    for folder, name in (("project", "beside-link"), ("store", "beside-file")):
        (tmp_path / folder / f"{name}.csv").write_text("time,wind_speed\n0,8\n10,9\n")
    assert len(run_campaign(link, tmp_path / "run")) == 2 * 4
    (tmp_path / "project" / "beside-link.csv").unlink()
    with pytest.raises(InputError, match=f"looked for {tmp_path}/project/beside-link.csv"):
        run_campaign(link, tmp_path / "other")


def test_a_case_name_that_no_file_can_have_is_refused(world, tmp_path, monkeypatch):
    monkeypatch.setattr("fatigue_runner.campaign.cases.LONGEST_NAME", 20)
    with pytest.raises(InputError, match="name of more than 20 bytes"):
        run_campaign(write_campaign(tmp_path), tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("deaths", [1, 2])
def test_a_worker_that_is_ended_from_outside_is_replaced_once_then_told(world, tmp_path, monkeypatch, deaths):
    from fatigue_runner.campaign import run as module
    from fatigue_runner.campaign.pool import WorkerEndedError

    campaign, folder = write_campaign(tmp_path), tmp_path / "run"
    real, asked = module.run_jobs, []

    def killed(function, jobs, *others):
        asked.append(sum(len(job.cases) for job in jobs))
        if len(asked) > deaths:
            yield from real(function, jobs, *others)
        else:
            yield function(jobs[0])
            raise WorkerEndedError("a worker is gone")

    monkeypatch.setattr("fatigue_runner.campaign.plan.BLOCK_SIZE", 1)
    monkeypatch.setattr(module, "run_jobs", killed)
    if deaths == 1:
        assert len(run_campaign(campaign, folder)) == 12
    else:
        with pytest.raises(
            FatigueRunnerError, match=r"gone, and so.*8 of 12 cases are finished.*--workers"
        ) as told:
            run_campaign(campaign, folder)
        assert told.value.exit_code == 1
        assert run_campaign(campaign, folder).kept == 8
    assert asked[:2] == [12, 8], "what was finished is not asked for again"


@pytest.mark.parametrize("how", ["mark", "semicolons", "tabs in UTF-16"])
def test_a_table_that_went_through_a_spreadsheet_is_the_same_table(world, tmp_path, how):
    folder = tmp_path / "run"
    results = run_campaign(write_campaign(tmp_path), folder)
    before = read_results(folder)
    table = folder / "results.csv"
    rows = list(csv.reader(table.read_text().splitlines()))
    if how == "mark":
        table.write_bytes(b"\xef\xbb\xbf" + table.read_bytes().replace(b"\n", b"\r\n"))
    elif how == "semicolons":  # of a country that writes decimal commas
        table.write_text(
            "\n".join(";".join(c.replace(".", ",") if is_number(c) else c for c in row) for row in rows),
            "utf-8-sig",
        )
    else:
        table.write_text("\n".join("\t".join(row) for row in rows), "utf-16")
    with pytest.warns(FatigueRunnerWarning, match=r"results\.csv is not what the run wrote"):
        assert read_results(folder) == before and len(before) == len(results)


def is_number(cell):
    try:
        return bool(float(cell) + 1)
    except ValueError:
        return False


@pytest.mark.parametrize("diverged_at", [1.0, 2.0, 2.02])
def test_a_case_that_diverges_before_the_counted_time_costs_no_report(monkeypatch, tmp_path, diverged_at):
    world = build_world(monkeypatch)
    world.diverging[("heun", 8.0)] = diverged_at
    results = run_campaign(write_campaign(tmp_path, discard="2"), tmp_path / "run")
    assert results.report_error == "" and len(results.lost) == 2
    page = (tmp_path / "run" / "report.html").read_text()
    assert "Time histories" in page and "x_FA" in page


def test_what_is_finished_of_a_block_is_not_done_again(world, tmp_path, monkeypatch):
    """Ctrl-C once lost all of a block: 285 finished logs."""
    from fatigue_runner.campaign import block

    finish = block._finish
    finished = []

    def interrupted(job, case, *rest):
        if len(finished) == 7:
            raise KeyboardInterrupt
        finished.append(case.id)
        return finish(job, case, *rest)

    monkeypatch.setattr(block, "_finish", interrupted)
    campaign, folder = write_campaign(tmp_path), tmp_path / "run"
    with pytest.raises(CampaignInterrupted, match="7 of 12 cases are finished"):
        run_campaign(campaign, folder)
    assert not (folder / "finished").exists()
    monkeypatch.setattr(block, "_finish", finish)
    again = run_campaign(campaign, folder)
    assert (again.kept, again.simulated) == (7, 5)


def test_what_a_killed_run_had_finished_is_taken_in(world, tmp_path):
    """Its own process had no time to do so; half a line is none."""
    campaign, folder = write_campaign(tmp_path), tmp_path / "run"
    run_campaign(campaign, folder)
    lines = (folder / "cases.jsonl").read_bytes().splitlines(keepends=True)
    (folder / "cases.jsonl").write_bytes(b"".join(lines[:2]))
    (folder / "finished").mkdir()
    (folder / "finished" / "a.jsonl").write_bytes(b"".join(lines[2:8]) + lines[8][:50])
    again = run_campaign(campaign, folder)
    assert again.kept == 8 and not (folder / "finished").exists()


def test_cases_count_one_by_one_while_their_block_runs(tmp_path):
    pieces = Pieces(tmp_path)
    for name in ("a", "b"):
        leave(tmp_path, "block", {"row": {"case_id": name}})
        assert [from_line(line.rstrip())["row"]["case_id"] for line in pieces.new()] == [name]
    assert pieces.new() == []


def test_logs_that_left_the_campaign_are_told(world, tmp_path):
    folder = tmp_path / "run"
    run_campaign(write_campaign(tmp_path), folder)
    plan = make_plan(write_campaign(tmp_path, CAMPAIGN.replace("[6, 8, 10]", "[6, 8]")))
    store = Store(folder, plan.identity)
    told = run._before(plan, store, 0)
    assert len(told) == 1 and told[0].startswith("4 logs (") and "v10.00_" in told[0]


def test_a_large_run_says_what_its_logs_will_take(world, tmp_path):
    big = CAMPAIGN.replace("duration: 10", "duration: 36000").replace(
        "[6, 8, 10]", "{start: 5, stop: 24, count: 100}"
    )
    plan = make_plan(write_campaign(tmp_path, big))
    (tmp_path / "new").mkdir()
    (said,) = run._before(plan, Store(tmp_path / "new", plan.identity), len(plan.cases))
    assert said.startswith("the logs of 400 cases will take about") and "GB are free" in said


def test_the_estimate_of_a_log_is_not_far_off(world, tmp_path):
    results = run_campaign(write_campaign(tmp_path, duration="200"), tmp_path / "run")
    plan = make_plan(write_campaign(tmp_path, duration="200"))
    sizes = [path.stat().st_size for path in (tmp_path / "run" / "logs").glob("*.mcap")]
    assert len(results) == len(sizes) and 0.3 < np.mean(sizes) / plan.log_bytes < 2.0


@pytest.mark.parametrize(("seconds", "text"), [(22.3, "22 s"), (185, "3:05 min"), (3725, "1:02 h")])
def test_times_are_short_enough_to_be_read(seconds, text):
    assert _minutes(seconds) == text
