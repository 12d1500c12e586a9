"""What the compile wrapper promises: strict arithmetic by default, and a cache that follows every compiled source."""

from __future__ import annotations

import subprocess
import sys

import numpy as np

from fatigue_runner.compiled import FAST, cache_folder, njit


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


def test_an_unwritable_cache_folder_only_costs_a_warning(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("a file where the cache folder should be")
    code = (
        "import warnings\n"
        "with warnings.catch_warnings(record=True) as seen:\n"
        "    warnings.simplefilter('always')\n"
        "    from fatigue_runner.compiled import njit\n"
        "    double = njit()(lambda x: 2 * x)\n"
        "    assert double(2) == 4\n"
        "assert any('cannot be written' in str(w.message) for w in seen), seen\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env={
            "NUMBA_CACHE_DIR": str(blocked),
            "PATH": "/usr/bin:/bin",
            "PYTHONPATH": ":".join(p for p in sys.path if p),
        },
    )
    assert done.returncode == 0, done.stderr


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
