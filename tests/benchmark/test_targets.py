"""The developers' targets are judged from the figures that the benchmarks write."""

from __future__ import annotations

import json
import sys

from benchmark_points import point, result
from places import ROOT

sys.path.insert(0, str(ROOT / "tools"))
import targets


def learned(step, cost, error, **others):
    return point("rk4 + affine, enhanced", step, cost, error, "enhanced", **others)


def test_targets_say_reached_or_missed():
    plain = [point("a", 0.1, 40, 1e-2), point("a", 0.05, 400, 1e-5)]
    good = result([*plain, learned(0.1, 20, 5e-5)])
    found = targets.of_integrators(good)
    # at 1e-3 the classical curve costs 40 * 10^(1/3), at 1e-4 40 * 10^(2/3)
    assert [round(float(t.found.split(" ")[0]), 2) for t in found[:2]] == [4.31, 9.28]
    # and 40 where its larger step already has the loads to 1 %: 2 times, no moonshot
    assert all(t.reached for t in found) and "moonshot" in found[1].found and "moonshot" not in found[2].found
    bad = targets.of_integrators(result([*plain, learned(0.1, 90, 5e-5)]))
    assert [t.reached for t in bad] == [False, True, False, False, False]
    assert str(bad[0]).startswith("**missed**: 2 times less evaluations")
    operated = targets.of_integrators(result([*plain, learned(0.1, 20, 5e-5)], operation="controlled"))
    assert [t.asked.split(" than")[0] for t in operated[::4]] == [
        "1.5 times less time",
        "2 times less evaluations",
        "DEL error at most 0.1 % on every channel with 30 evaluations per simulated second",
    ]


def test_the_papers_target_is_judged_on_the_papers_turbine_only():
    p = point("heun + affine, enhanced", 0.01, 200, 1e-6, "enhanced", delta_e_range=[1e-11, 1e-12, 1e-9])
    assert targets.of_integrators(result([p], turbulent=False)) == []
    judged = targets.of_integrators(result([p], turbulent=False) | {"turbine": "t2b1i1cg"})
    assert [t.reached for t in judged] == [True] and "1.0e-11" in judged[0].found


def test_figures_as_the_commands_write_them_are_judged_and_a_missed_target_is_exit_code_1(
    tmp_path, monkeypatch, capsys
):
    plain = [point("a", 0.1, 40, 1e-2), point("a", 0.05, 400, 1e-5)]
    part = result([*plain, learned(0.1, 20, 5e-5)])
    part["points"] = [p.to_dict() for p in part["points"]]
    rates = {"fatigue-runner, zstd": {"per_second": 499_999.0, "ratio": 9.0}}
    written = {
        "work.json": {"identity": "x", "cases": [part]},
        "logs.json": {
            "writers": rates,
            "readers": {"fatigue-runner, zstd": {"per_second": 5e5, "ratio": 9.0}},
        },
        "live.json": {"situations": {}, "slower": 0.21},
        "kernel.json": {"cases": [], "whole_steps": []},
    }
    for name, figures in written.items():
        (tmp_path / name).write_text(json.dumps(figures))

    def judge(name: str) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["targets.py", str(tmp_path / name)])
        return targets.main(), capsys.readouterr().out

    code, out = judge("work.json")
    assert code == 0 and out.count("- reached:") == 5
    code, out = judge("logs.json")
    assert code == 1 and "**missed**: 500,000 rows per second written: 499,999" in out
    assert "reached: 500,000 rows per second read: 500,000" in out
    code, out = judge("live.json")
    assert (
        code == 1
        and "**missed**: a watched campaign waits for at most 0.2 of a core: 0.21 (more than unwatched)"
        in out
    )
    assert judge("kernel.json")[0] == 0
