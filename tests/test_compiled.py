"""What the compile wrapper promises: strict arithmetic by default, and a cache that follows every compiled source."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile

from fatigue_runner import compiled
from fatigue_runner.compiled import FAST, cache_folder, compiled_sources, njit
from fatigue_runner.errors import FatigueRunnerWarning


def test_a_nan_check_called_from_a_fast_loop_is_kept(tmp_path, monkeypatch):
    @njit()
    def good(x):
        return abs(x) < 1.0

    @njit(**FAST)
    def count(values):
        total = 0
        for i in range(len(values)):
            total += 1 if good(values[i] * 2.0) else 0
        return total

    assert count(np.array([0.1, np.nan, 0.2, np.inf])) == 2


def test_the_cache_folder_is_named_by_the_sources_of_compiled_functions(tmp_path, monkeypatch):
    assert cache_folder().name.startswith("kernels-")
    # the same in another process, so that a second start finds it
    code = "from fatigue_runner.compiled import cache_folder; print(cache_folder().name)"
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert other.stdout.strip() == cache_folder().name


def test_the_cache_follows_what_compiled_functions_import():
    """numba freezes the constants that a function uses: one of `layout` must not outlive a change of that file."""
    package = Path(compiled.__file__).parent
    names = {path.relative_to(package).as_posix() for path in compiled_sources(package)}
    assert {"turbine/generated/kernel.py", "integrators/stepping.py", "fatigue/kernel.py"} <= names
    assert {"layout.py", "integrators/multi_blade.py", "control/baseline.py"} <= names
    assert not names & {
        "cli.py",
        "report/page.py",
        "campaign/run.py",
    }  # an edit there costs no minute of compiling


def test_an_import_of_a_compiled_file_is_found_through_others(tmp_path):
    package = tmp_path / "fatigue_runner"
    (package / "room").mkdir(parents=True)
    (package / "loop.py").write_text(
        "from fatigue_runner.compiled import njit\nfrom fatigue_runner.room import (\n    one,\n)\n"
    )
    (package / "room" / "one.py").write_text("from fatigue_runner.widths import WIDTH\n")
    (package / "widths.py").write_text("WIDTH = 3\n")
    (package / "unused.py").write_text("from fatigue_runner.loop import step\n")
    assert [path.name for path in compiled_sources(package)] == ["loop.py", "one.py", "widths.py"]


# where the folder of kernels cannot be: below a file by its own variable, and a home that leads nowhere
UNWRITABLE = {"variable": {"NUMBA_CACHE_DIR": "{file}"}, "home": {"HOME": "{file}/home"}}


@pytest.mark.parametrize("environment", UNWRITABLE.values(), ids=UNWRITABLE)
def test_an_unwritable_cache_folder_costs_a_warning_and_leaves_no_kernel_anywhere(tmp_path, environment):
    """numba alone would write into `__pycache__` beside the source, and run what it finds there after the equations have changed."""
    blocked = tmp_path / "file"
    blocked.write_text("a file where the cache folder should be")
    (tmp_path / "own.py").write_text(
        "from fatigue_runner.compiled import njit\n"
        "@njit()\n"
        "def double(x):\n"
        "    return 2 * x\n"
        "assert double(2) == 4\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", "import own"],
        capture_output=True,
        text=True,
        env={
            "PATH": "/usr/bin:/bin",
            "PYTHONPATH": ":".join([str(tmp_path), *filter(None, sys.path)]),
            **{name: value.format(file=blocked) for name, value in environment.items()},
        },
    )
    assert done.returncode == 0, done.stderr
    assert "cannot be written" in done.stderr and "NUMBA_CACHE_DIR" in done.stderr
    assert not [*tmp_path.rglob("*.nbi"), *tmp_path.rglob("*.nbc")]


def test_a_full_disk_does_not_end_a_kernel(tmp_path, monkeypatch):
    """What numba cannot keep is compiled again next time."""

    def full(*args):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(IndexDataCacheFile, "save", full)
    compiled._warn.cache_clear()

    @njit()
    def triple(x):
        return 3 * x

    with pytest.warns(FatigueRunnerWarning, match="kernel cache"):
        assert triple(2) == 6


def test_a_cache_that_names_a_module_which_is_gone_is_made_anew(tmp_path):
    """Types of arguments stand in the cache's index: a NamedTuple of a file that somebody has removed."""
    (tmp_path / "main.py").write_text(
        "import sys\n"
        "from fatigue_runner.compiled import njit\n"
        "@njit()\n"
        "def first(values):\n"
        "    return values[0]\n"
        "if sys.argv[1:] == ['own']:\n"
        "    from own import Pair\n"
        "    assert first(Pair(1.0, 2.0)) == 1.0\n"
        "assert first((3, 4)) == 3\n"
    )
    (tmp_path / "own.py").write_text(
        "from typing import NamedTuple\nclass Pair(NamedTuple):\n    a: float\n    b: float\n"
    )
    environment = {
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "PATH": "/usr/bin:/bin",
        "PYTHONPATH": ":".join(p for p in sys.path if p),
    }
    for argument in ("own", "none", "none"):
        done = subprocess.run(
            [sys.executable, str(tmp_path / "main.py"), argument],
            capture_output=True,
            text=True,
            env=environment,
        )
        assert done.returncode == 0, done.stderr
        (tmp_path / "own.py").unlink(missing_ok=True)


def test_a_damaged_kernel_in_the_cache_is_not_run_but_made_anew(tmp_path):
    """Numbers from machine code with a flipped bit are wrong in silence, or end the process."""
    (tmp_path / "made.py").write_text(
        "from fatigue_runner.compiled import njit\n\n\n@njit()\ndef twice(x):\n    return 2.0 * x\n"
    )
    code = "import made; print(made.twice(21.0), dict(made.twice.stats.cache_hits) != {})"
    environment = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "PYTHONPATH": os.pathsep.join([str(tmp_path), str(Path(compiled.__file__).parents[1])]),
    }

    def run() -> str:
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment)
        assert not done.stderr, done.stderr
        return done.stdout.strip()

    assert (run(), run()) == ("42.0 False", "42.0 True")
    for kind in ("*.nbc", "*.nbi"):
        for place in (0.02, 0.5, 0.98):
            (file,) = (tmp_path / "cache").rglob(kind)
            whole = file.read_bytes()
            at = int(place * len(whole))
            file.write_bytes(whole[:at] + bytes([whole[at] ^ 16]) + whole[at + 1 :])
            assert run() == "42.0 False", (kind, place)
            file.write_bytes(file.read_bytes()[:20])
            assert run() == "42.0 False", (kind, "cut")
