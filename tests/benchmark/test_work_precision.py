"""The work-precision benchmark: fair to every method, honest about what diverges, and its answers are those of its points."""

from __future__ import annotations

import json

import numpy as np
import pytest
from places import CORRECTORS
from typer.testing import CliRunner

from fatigue_runner import shipped
from fatigue_runner.benchmark import run
from fatigue_runner.benchmark.commands import app
from fatigue_runner.benchmark.pages import tables, words
from fatigue_runner.benchmark.pages import work_precision as page
from fatigue_runner.benchmark.pages.render import table
from fatigue_runner.benchmark.study import adaptive, answers, integrators, points, work_precision
from fatigue_runner.benchmark.study.cases import SEEDS, Settings, load
from fatigue_runner.campaign.spec import campaign_source
from fatigue_runner.corrector import correctors
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import METHODS, Integrator
from fatigue_runner.results.evaluation_cost import delta_ts

SMALL = {
    "name": "small",
    "duration": 8,
    "output_rate": 50,
    "discard": 1,
    "wind": {"type": "turbulent", "speeds": [7, 9], "intensity": 0.1, "seeds": [9001]},
    "benchmark": {
        "methods": ["heun", "rk4", "etdrk4"],
        "steps": [0.2, 0.15, 0.05, 0.01],
        "correctors": ["rk4-100ms"],
        "tolerances": [1e-3, 1e-6],
        "adaptive_cases": 1,
        "rounds": 1,
    },
}


@pytest.fixture(scope="module")
def result():
    return run.measure(SMALL, workers=1, timed=False)


@pytest.fixture(scope="module")
def timed(result):
    """The same with times that were never measured: a microsecond per evaluation."""
    part = result["cases"][0]
    part["evaluation_times"] = {
        name: {"single": 1e-6, "lane": 1e-7} for name in ("f", *{p.corrector for p in part["points"]} - {""})
    }
    for p in part["points"]:
        if not p.diverged:
            p.wall = {name: p.evaluations_per_second * 1e-6 for name in ("low", "median", "high")}
            p.delta_t = delta_ts(part["evaluation_times"], p.evaluations_per_second, p.step, p.corrector)
    return result


def test_the_shipped_campaign_has_turbulent_and_constant_winds_of_reserved_seeds():
    sets, settings = load(shipped.campaign("work_precision"))
    assert {c.turbulent for c in sets} == {True, False}
    assert {w.parameters["seed"] for c in sets if c.turbulent for w in c.ensemble.winds} <= set(SEEDS)
    assert settings.methods is None and settings.correctors is None  # nothing is left out


def test_no_training_wind_has_a_seed_of_the_benchmarks():
    from fatigue_runner.corrector.train import read_recipe

    found = 0
    for path in CORRECTORS.glob("*.yaml"):
        recipe, _ = read_recipe(path)
        if recipe.family == "affine" and recipe.training.type == "turbulent":
            for section in (recipe.training, recipe.validation):
                assert not {w.parameters["seed"] for w in section.build()} & set(SEEDS)
                found += 1
    assert found


def test_every_registered_method_and_every_shipped_corrector_meets_the_shipped_cases():
    sets, settings = load(shipped.campaign("work_precision"))
    for c in sets:
        work = list(work_precision.jobs(0, c, settings, points.Reference([], [])))
        assert {job.method for job in work if job.method and not job.tolerance} == set(METHODS)
        present = {
            (i.corrector_name, i.corrected_mode) for i in (job.integrator for job in work) if i is not None
        }
        missing = {
            (s.name, mode)
            for s in correctors()
            if s.turbine == c.ensemble.turbine.name and s.turbine_hash == c.ensemble.turbine.hash
            for mode in ("enhanced", "hybrid")
        } - present
        assert not missing


def test_every_method_is_shown_beyond_its_stability_limit():
    c, settings = load({**SMALL, "benchmark": {}})[0][0], Settings()
    for name in METHODS:
        largest = integrators.limit(c, name)
        steps, _ = integrators.rungs(c, settings, name, largest)
        assert max(steps) > largest or largest >= max(settings.ladder)


def test_steps_that_are_left_out_have_a_reason(result):
    c, settings = load(SMALL)[0][0], Settings(most_evaluations=100.0)
    steps, reason = integrators.rungs(c, settings, "heun", 0.03)
    assert min(steps) == 0.02 and "15, 10, 7" in reason and "more than 100 evaluations" in reason
    close = Settings.model_validate({**SMALL["benchmark"], "finest": 1e-2})
    reference = points.make_reference(c)
    found = work_precision.descend(c, close, reference, "rk4")
    assert found["points"][-1].nrmse_max < 1e-2 and "steps below" in found["left_out"][0]


def test_what_a_campaign_lists_runs_beside_the_methods():
    listed = [
        {"method": "rk4", "step": 0.0123},
        {"method": "rk4", "step": 0.1, "corrector": "rk4-100ms", "mode": "enhanced"},
    ]
    c = load({**SMALL, "integrators": listed})[0][0]
    found = integrators.fitting(c, Settings(correctors=[]))[0]
    assert [(i.method, i.step, i.corrector_name, i.corrected_mode) for i in found] == [
        ("rk4", 0.0123, "", ""),
        ("rk4", 0.1, "rk4-100ms", "enhanced"),
    ]


def test_sections_of_cases_go_before_the_top_level():
    sections = [{"name": "short", "duration": 4}, {"name": "other", "turbine": "t2b1i1cg"}]
    sets, _ = load({**SMALL, "cases": sections})
    assert [(c.name, c.duration, c.ensemble.turbine.name) for c in sets] == [
        ("short", 4, "nrel5mw"),
        ("other", 8, "t2b1i1cg"),
    ]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("  finest: -1", "work.yaml:12: benchmark.finest must be above 0; got -1"),
        ("  methods: [rk5]", "work.yaml:12: benchmark.methods: unknown integrator 'rk5'; did you mean"),
        ("  round: 3", "work.yaml:12: unknown key 'round' in benchmark; did you mean 'rounds'?"),
    ],
)
def test_a_wrong_key_is_named_with_its_line(tmp_path, change, said):
    file = tmp_path / "work.yaml"
    file.write_text(
        "name: x\nduration: 8\ncases:\n  - name: a\n    wind:\n      type: constant\n      speeds: 8\n"
        f"  - name: b\n    duration: 4\n    wind: {{type: constant, speeds: 8}}\nbenchmark:\n{change}\n"
    )
    with pytest.raises(InputError, match=r"work\.yaml") as caught:
        load(file)
    assert said in str(caught.value)


def test_a_wrong_key_inside_a_set_of_cases_is_named_with_its_line(tmp_path):
    file = tmp_path / "work.yaml"
    file.write_text(
        "name: x\nduration: 8\ncases:\n  - name: a\n    wind:\n      type: constant\n      sped: 8\n"
    )
    with pytest.raises(InputError, match=r"work\.yaml:7: unknown key 'sped'"):
        load(file)


def test_a_pitch_that_varies_in_time_is_refused():
    with pytest.raises(InputError, match="a benchmark needs one pitch"):
        load({**SMALL, "pitch": {"time": [0, 4, 8], "angle": [0, 1, 2]}})


def test_an_unstable_combination_says_when_it_diverged_and_has_no_errors(result):
    part = result["cases"][0]
    lost = next(p for p in part["points"] if (p.method, p.step) == ("heun", 0.15))
    assert lost.diverged == 2 and 0 < lost.diverged_at < 8
    assert lost.nrmse_max is None and lost.del_error_max is None and not lost.wall
    said = page.section(part)
    assert "Diverged (first time), never on a front: heun 150 ms" in said
    assert "2 diverged, first at" in table(tables.points(part["points"]))


def test_errors_of_the_others_are_complete(result):
    fine = [p for p in result["cases"][0]["points"] if not p.diverged]
    assert {"heun", "rk4", "etdrk4", "rk4 + affine, enhanced", "rk4 + affine, hybrid"} == {
        p.series for p in fine
    }
    for p in fine:
        assert 0 < p.nrmse_max <= p.nrmse_worst and set(p.nrmse.values()) >= {p.nrmse_max}
        assert p.del_error_max == max(p.del_error.values())
        assert len(p.delta_e) == len(p.delta_e_range) == 2
        assert (p.accepted is not None) == (p.kind == "hybrid")
    heun = next(p for p in fine if p.method == "heun")
    # the initial slope is one evaluation more
    assert heun.evaluations_per_second == pytest.approx(200 + 1 / 8)


def test_the_reference_is_measured_against_another_method_and_step(result):
    part = result["cases"][0]
    checks = part["reference"]["agreement"]
    assert {c["method"] for c in checks} == {"dop853", "rk7"} and len({c["step"] for c in checks}) == 2
    # its own error is far below the errors that anybody asks for
    assert max(c["nrmse_worst"] for c in checks) < 1e-7 and max(c["del_error_max"] for c in checks) < 1e-7
    assert "agree with it to an NRMSE of" in words.trust(part)


def test_a_reference_that_diverges_is_refused():
    with pytest.raises(InputError, match="the reference heun at 100 ms diverges"):
        run.measure({**SMALL, "reference": {"method": "heun", "step": 0.1}}, workers=1, timed=False)


def test_adaptive_methods_come_closer_with_their_tolerance(result):
    found = result["cases"][0]["adaptive"]
    for name in adaptive.METHODS:
        loose, tight = (p for p in sorted(found, key=lambda p: -p.step) if p.method == name)
        assert tight.nrmse_max < 0.1 * loose.nrmse_max
        assert tight.evaluations_per_second > loose.evaluations_per_second


def test_timed_runs_are_as_long_as_they_need_to_be():
    c, settings = load(SMALL)[0][0], Settings(timed_evaluations=4000.0)
    assert integrators.timed_duration(c, settings, 20.0) == pytest.approx(8.0)  # never longer than the cases
    long = load({**SMALL, "duration": 100})[0][0]
    assert integrators.timed_duration(long, settings, 100.0) == pytest.approx(40.0)
    assert integrators.timed_duration(long, settings, 1000.0) == pytest.approx(10.0)


def test_times_are_of_every_point_that_did_not_diverge_and_leave_the_errors_alone(result):
    sets, settings = load(SMALL)
    again = json.loads(json.dumps({**result, "cases": [_plain(part) for part in result["cases"]]}))
    parts = work_precision.reused(again, work_precision.identity(sets, settings), "x.json")
    before = [p.nrmse_max for p in parts[0]["points"]]
    work_precision.times(sets, settings, parts, 1, lambda what: None)
    for p in parts[0]["points"]:
        assert bool(p.wall) != bool(p.diverged)
        assert p.diverged or 0 < p.wall["low"] <= p.wall["median"] <= p.wall["high"]
        assert bool(p.delta_t) != bool(p.diverged)
    assert [p.nrmse_max for p in parts[0]["points"]] == before


def _plain(part):
    return {**part, **{key: [p.to_dict() for p in part[key]] for key in ("points", "adaptive")}}


def test_errors_of_another_campaign_are_not_reused(result):
    other, settings = load({**SMALL, "duration": 9})
    with pytest.raises(InputError, match=r"errors\.json holds the errors of another version"):
        work_precision.reused(result, work_precision.identity(other, settings), "errors.json")


def test_the_pages_hold_the_answers_the_tables_and_the_figures(timed, tmp_path):
    whole = {**timed, "rounds": 1, "load_average": 0.0}
    written = page.write(whole, tmp_path, tmp_path / "images").read_text(encoding="utf-8")
    part = timed["cases"][0]
    assert table(tables.verdicts(part, "wall")) in written
    assert table(tables.verdicts(part, "delta_t")) in written
    assert table(tables.evaluations(part["evaluation_times"])) in written
    assert "| NRMSE 1e-03 |" in written
    for line in written.splitlines():
        if line.startswith("!["):
            assert (tmp_path / line.split("(")[1].rstrip(")")).stat().st_size > 5000
    all_points = (tmp_path / "work-precision-tables.md").read_text(encoding="utf-8")
    assert all(p.label in all_points for p in part["points"])
    assert "tower_base_fore_aft_moment" in all_points and "rotor_speed" in all_points


def test_json_holds_every_point_with_plain_values(monkeypatch, tmp_path, timed):
    monkeypatch.setattr(run, "measure", lambda *arguments, **named: timed)
    file = tmp_path / "figures.json"
    done = CliRunner().invoke(app, ["work-precision", "--json", str(file)])
    assert done.exit_code == 0 and "Pareto fronts" in done.output
    found = json.loads(file.read_text())["cases"][0]
    assert len(found["points"]) == len(timed["cases"][0]["points"])
    for p in found["points"]:
        assert (set(p["delta_t"]) == {"single", "lane"}) == bool(p["wall"])
    assert found["summary"]["answers"][0]["target"] == "NRMSE 1e-02"


def test_a_folder_that_cannot_be_written_is_said_in_one_sentence(monkeypatch, tmp_path, timed):
    monkeypatch.setattr(run, "measure", lambda *arguments, **named: timed)
    (tmp_path / "file").write_text("")
    done = CliRunner().invoke(app, ["work-precision", "--out", str(tmp_path / "file")])
    assert isinstance(done.exception, InputError) and "give --out a folder" in str(done.exception)


def test_a_file_that_is_no_earlier_run_is_refused(tmp_path):
    done = CliRunner().invoke(app, ["work-precision", "--reuse", str(tmp_path / "none.json")])
    assert isinstance(done.exception, InputError) and "is not the JSON of an earlier run" in str(
        done.exception
    )


def test_stability_counts_what_diverges_over_seeds_that_are_kept_for_benchmarks():
    from fatigue_runner.benchmark.study import stability

    chosen = [c for c in correctors() if c.name == "rk4-100ms"]
    found = stability.measure(2, 4.0, chosen=chosen)
    row = found["rows"][0]
    assert row["enhanced"]["diverged"] == row["hybrid"]["diverged"] == 0 and row["accepted"] > 0.9
    assert "| rk4-100ms | 5 to 10 | 0 | 0 |" in page.speed("stability", found)
    with pytest.raises(InputError, match="seeds are kept"):
        stability.measure(10_000, 4.0)


def test_operations_are_counted_without_the_index_arithmetic():
    from fatigue_runner.benchmark.speed.kernel import operations

    # counted by hand: about 1,150 packed instructions, most of them fused, and 24 cubics
    assert 1500 < operations() < 2500


def test_an_integrator_with_a_corrector_has_a_curve_of_its_own():
    found = next(c for c in correctors() if c.name == "rk4-100ms")
    assert integrators.series(Integrator("rk4", 0.1)) == "rk4"
    corrected = Integrator("rk4", 0.1, found, "hybrid")
    assert integrators.series(corrected) == "rk4 + affine, hybrid"
    assert integrators.kind(corrected) == "hybrid" and integrators.kind(Integrator("rk4", 0.1)) == "classical"


@pytest.mark.slow(reason="times every kernel in a row of repeats")
def test_the_kernel_benchmark_finds_packed_code_faster_than_scalar_code():
    from fatigue_runner.benchmark.speed import kernel

    found = kernel.measure(repeats=3)
    assert all(r["ratio"] > 1.5 for r in found["cases"] if r["cases"] >= 16)
    assert 0.01 < found["share_of_peak"] < 1.0
    assert np.isfinite([s["over_kernel"] for s in found["whole_steps"]]).all()
    assert 0 < found["varying_pitch"]["median"] < np.inf
    assert 0.5 < found["own_edges"]["ratio"] < 2.0


def test_an_edge_mode_per_blade_costs_less_than_four_tenths_more():
    # counted: the ratio of two times is 1.0 to 1.45 in one process after the other, where memory happens to lie
    from fatigue_runner.benchmark.speed.kernel import operations
    from fatigue_runner.turbine.generated import kernel, t2b2cg_kernel

    assert operations(kernel) < operations(t2b2cg_kernel) < 1.4 * operations(kernel)


@pytest.mark.slow(reason="the whole shipped benchmark: all methods, all correctors, two sets of winds")
def test_the_shipped_benchmark_runs_through_and_places_every_corrector(tmp_path):
    campaign = dict(campaign_source(shipped.campaign("work_precision")).data)
    # a third of the time shows the same
    campaign["cases"] = [{**part, "duration": min(part["duration"], 45)} for part in campaign["cases"]]
    found = run.measure(campaign, rounds=1)
    page.write(found, tmp_path, tmp_path / "images")
    for part in found["cases"]:
        assert {p.method for p in part["points"] if not p.corrected} == set(METHODS)
        assert max(r["nrmse_worst"] for r in part["reference"]["agreement"]) < 1e-5
    assert all(
        a["classical"] and a["corrected"]
        for part in found["cases"]
        for a in part["summary"]["answers"][: 3 if part["cases"] == "turbulent" else 1]
    )
    assert {w.wind for w in answers.in_winds(found["cases"][0])} == {"4", "8", "11.4", "12", "18", "24"}
