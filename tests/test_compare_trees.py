"""The tools that compare two trees: what counts as equal, what is told of a difference, how times are put in turns."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from places import ROOT

TOOLS = ROOT / "tools"


@pytest.fixture
def tools(monkeypatch):
    monkeypatch.syspath_prepend(str(TOOLS))
    import bit_figures
    import compare_speed
    import equal_bits

    return bit_figures, equal_bits, compare_speed


def told(bit_figures, folder: Path, name: str, **parts) -> dict:
    """What a tree tells of a figure, its arrays in a file as the tool writes them."""
    arrays = {part: bit_figures.as_array(value) for part, value in parts.items()}
    folder.mkdir(exist_ok=True)
    np.savez(folder / f"{name}.npz", **arrays)
    digests = {part: bit_figures.digest(array) for part, array in arrays.items()}
    return {name: {"name": name, "file": f"{name}.npz", "parts": digests}}


def judged(tools, tmp_path, old: dict, new: dict):
    bit_figures, equal_bits, _ = tools
    folders = {"old": tmp_path / "old", "new": tmp_path / "new"}
    sides = (told(bit_figures, folders[side], "f", **parts) for side, parts in (("old", old), ("new", new)))
    return next(iter(equal_bits.verdicts(*sides, folders)))


def test_equal_bytes_are_equal_nan_included(tools, tmp_path):
    verdict = judged(tools, tmp_path, {"x": np.array([1.0, np.nan])}, {"x": np.array([1.0, np.nan])})
    assert verdict.same is True and not verdict.what


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        (np.array([1.0, 2.0]), np.array([1.0, np.nextafter(2.0, 3)]), "x: 2.2e-16"),
        (np.array([0.0]), np.array([-0.0]), "x: 0.0e+00"),
        (np.array([1.0, np.nan]), np.array([1.0, 2.0]), "x: inf"),
        (np.array([1.0]), np.array([1.0, 2.0]), "x: float64[1] became float64[2]"),
        (np.array([1.0]), np.array([1.0], np.float32), "x: float64[1] became float32[1]"),
        (np.array([1, 2, 4]), np.array([1, 2, 5]), "x: 2.5e-01"),
        ("done", "lost", "x: text"),
    ],
)
def test_a_difference_of_one_bit_shape_or_type_is_told(tools, tmp_path, old, new, what):
    verdict = judged(tools, tmp_path, {"x": old}, {"x": new})
    assert verdict.same is False
    assert verdict.what == what


def test_a_part_that_is_gone_differs_and_one_that_is_new_does_not(tools, tmp_path):
    one, two = {"x": np.ones(2)}, {"x": np.ones(2), "y": np.ones(2)}
    assert judged(tools, tmp_path, one, two).same is True
    gone = judged(tools, tmp_path, two, one)
    assert gone.same is False and gone.what == "y is missing"


def test_figures_that_fail_are_missing_or_new_are_told(tools, tmp_path):
    bit_figures, equal_bits, _ = tools
    folders = {"old": tmp_path / "old", "new": tmp_path / "new"}
    both = {name: told(bit_figures, tmp_path / "old", name, x=np.ones(1))[name] for name in "abcd"}
    failed = {"name": "b", "file": "b.npz", "error": "KeyError: 'x'"}
    new = {"a": both["a"], "b": failed, "d": failed | {"name": "d"}, "e": both["a"] | {"name": "e"}}
    found = list(equal_bits.verdicts(both | {"d": failed | {"name": "d"}}, new, folders))
    assert {v.name: v.same for v in found} == {"a": True, "b": False, "c": False, "d": False, "e": None}
    text = equal_bits.table(found)
    assert text.splitlines()[-1] == "1 figures equal, 3 differ"
    assert "new failed: KeyError: 'x'" in text


def test_times_are_taken_in_turns_and_the_median_ratio_is_marked(tools):
    compare_speed = tools[2]
    asked = []

    def ask(worker, entry):
        asked.append(worker)
        return {"old": 100.0, "new": 104.0 if entry == "slow" else 102.0}[worker]

    found = compare_speed.in_turns("old", "new", ["slow", "fine"], 3, ask)
    assert asked == ["old", "new"] * 2 + ["new", "old"] * 2 + ["old", "new"] * 2
    _, slow, fine = compare_speed.table(found).splitlines()
    assert "1.040" in slow and slow.endswith("SLOWER")
    assert "1.020" in fine and "SLOWER" not in fine


def test_an_unlucky_process_alone_is_not_slower(tools):
    times = [(100.0, 117.0), (100.0, 116.0), (118.0, 101.0)]
    line = tools[2].table({"rk4": times}).splitlines()[1]
    assert "1.160" in line and "1.010" in line and "SLOWER" not in line


@pytest.mark.slow(reason="two processes; the kernels of the commit are compiled where no run did before")
def test_a_figure_of_the_last_commit_is_that_of_the_working_tree():
    if subprocess.run(
        ["git", "-C", str(TOOLS), "rev-parse", "HEAD"], capture_output=True, check=False
    ).returncode:
        pytest.skip("no git checkout")
    command = [
        sys.executable,
        str(TOOLS / "equal_bits.py"),
        "HEAD",
        "--only",
        "turbine nrel5mw: operating points",
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == "1 figures equal, 0 differ"
