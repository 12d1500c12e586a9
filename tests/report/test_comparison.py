"""One page of two runs: what differs, life beside life, load beside load."""

from __future__ import annotations

import pytest
from report_example import CAMPAIGN, example_rows, write_run

from fatigue_runner.cli import main
from fatigue_runner.errors import InputError
from fatigue_runner.report.comparison import render_comparison, write_comparison
from fatigue_runner.report.rundata import load_run

LIFE = {"climate": "II", "bins": {"edges": [4.5, 5.5, 6.5, 7.5, 8.5, 9.5, 10.5]}}


def run_of(folder, factor=1.0, **campaign):
    rows = example_rows(seeds=("1", "2", "3"), diverging=False)
    for row in rows:
        for name in row:
            if name.startswith("del_tower_base_fore_aft") and row[name] != "":
                row[name] = row[name] * factor
    write_run(folder, rows, CAMPAIGN | {"lifetime": LIFE} | campaign)
    return folder


def test_a_change_is_told_in_words_and_beside_what_the_seeds_leave(tmp_path):
    a, b = run_of(tmp_path / "a"), run_of(tmp_path / "b", factor=1.5, name="stiff", turbine="stiff.yaml")
    page = render_comparison(load_run(a), load_run(b))
    assert "tower-base fore-aft moment" in page and "by 50 %" in page
    assert "5 of 20 change by more than what the seeds of both leave" in page
    assert "<td>turbine</td>" in page and "stiff.yaml" in page
    assert (
        page.count("1.5000") == 3 and page.count("1.0000") >= 9
    )  # mean, smallest, largest ratio of each channel


def test_two_runs_of_one_campaign_are_called_by_their_folders(tmp_path, monkeypatch, capsys):
    a, b = run_of(tmp_path / "a"), run_of(tmp_path / "b")
    monkeypatch.setattr(
        "sys.argv", ["fatigue-runner", "compare", str(a), str(b), "--out", str(tmp_path / "page.html")]
    )
    with pytest.raises(SystemExit, match="0"):
        main()
    page = (tmp_path / "page.html").read_text()
    assert "No setting differs." in page and str(a) in page and "0 of 20 change by more" in page


def test_a_run_beside_itself_and_a_folder_without_results_are_refused(tmp_path):
    a = run_of(tmp_path / "a")
    with pytest.raises(InputError, match="compared with itself"):
        write_comparison(a, a, tmp_path / "page.html")
    with pytest.raises(InputError, match="holds no"):
        write_comparison(a, tmp_path, tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()
