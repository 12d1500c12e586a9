"""How the tests run: the whole suite on a few processes, part of it in one; the kernels are compiled once before."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

# Before numpy is loaded: several processes share the cores, and threads of BLAS that wait for each other take ten times as long.
for _library in ("OPENBLAS", "MKL", "OMP"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

# More do not pay: every process loads the kernels anew, and campaigns under test start workers of their own.
MOST_PROCESSES = 4


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """For `-n auto` (pyproject.toml): none for files or names that somebody picked, where starting processes takes longest, and none
    for slow tests: they start workers and viewers themselves, and what lives beside a run gets a core only where one is idle."""
    from joblib import cpu_count

    picked = config.args_source is not config.ArgsSource.TESTPATHS or config.option.keyword
    slow = config.option.markexpr != "not slow"
    return 0 if picked or slow else min(MOST_PROCESSES, cpu_count())


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile what is not in the cache, before several processes do so at the same time."""
    if getattr(session.config.option, "numprocesses", None):
        compile_kernels(session.config.get_terminal_writer().line)


def compile_kernels(say: Callable[[str], None]) -> None:
    """Every method's kernels, in a process of its own; once for each state of the sources, which name the cache's folder."""
    from fatigue_runner.compiled import cache_folder

    done = cache_folder() / "tests-may-begin"
    if done.exists():
        return
    say("compiling the kernels, a minute or two ...")
    code = "from fatigue_runner.integrators import METHODS, warm_up\nfor name in METHODS: warm_up(name)"
    if subprocess.run([sys.executable, "-c", code]).returncode == 0 and done.parent.is_dir():
        done.touch()


@pytest.fixture(scope="session")
def nrel5mw() -> Turbine:
    """The real turbine, with tilt and cone. Tests only read it."""
    return _shipped_turbine("nrel5mw")


@pytest.fixture(scope="session")
def t2b1i1cg() -> Turbine:
    """The paper's turbine, without tilt and cone. Tests only read it."""
    return _shipped_turbine("t2b1i1cg")


def _shipped_turbine(name: str) -> Turbine:
    from fatigue_runner.turbine import load_turbine  # loads the compiler, which many tests do without

    return load_turbine(name)
