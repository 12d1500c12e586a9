"""How the tests run: the whole suite on a few processes, with its kernels compiled before and its memory bounded; part of it in one."""

from __future__ import annotations

import ctypes
import gc
import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import kernels
import memory
import pytest

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

# Before numpy is loaded: several processes share the cores, and threads of BLAS that wait for each other take ten times as long.
for _library in ("OPENBLAS", "MKL", "OMP"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

# More do not pay: every process loads the kernels anew, and campaigns under test start workers of their own.
MOST_PROCESSES = 4

TRIM = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None  # glibc's

MEMORY = pytest.StashKey[memory.Watch]()


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """For `-n auto` (pyproject.toml): none for files or names that somebody picked, where starting processes takes longest, and none
    for slow tests: they start workers and viewers themselves, and what lives beside a run gets a core only where one is idle."""
    from joblib import cpu_count

    picked = config.args_source is not config.ArgsSource.TESTPATHS or config.option.keyword
    slow = config.option.markexpr != "not slow"
    return 0 if picked or slow else min(MOST_PROCESSES, cpu_count())


def pytest_sessionstart(session: pytest.Session) -> None:
    """Before several processes run the whole suite: compile what is not in the cache, and look at the memory of all from then on."""
    whole = session.config.args_source is session.config.ArgsSource.TESTPATHS
    if whole and getattr(session.config.option, "numprocesses", None):
        session.config.stash[MEMORY] = memory.Watch()
        compile_kernels(session.config.get_terminal_writer().line)


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """A run that takes too much memory has failed."""
    watch = session.config.stash.get(MEMORY, None)
    if (
        watch is not None
        and watch.stop() > _scaled(session.config, memory.BOUND)
        and session.exitstatus == pytest.ExitCode.OK
    ):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    watch = config.stash.get(MEMORY, None)
    if watch is not None and watch.peak:
        terminalreporter.write_line(f"peak memory of all processes: {watch.peak:.1f} GB")
        if watch.peak > _scaled(config, memory.WANTED):
            for size, command in watch.processes[:8]:
                terminalreporter.write_line(f"{size:6.2f} GB  {command[:120]}")
        if watch.peak > _scaled(config, memory.BOUND):
            terminalreporter.write_line(
                f"FAILED: more than {_scaled(config, memory.BOUND):g} GB: which kernels do tests compile that tests/kernels.py could?",
                red=True,
            )


def _scaled(config: pytest.Config, size: float) -> float:
    """[GB] for two processes, which CI has, or more in proportion."""
    return size * max(2, config.option.numprocesses) / 2


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """After the last test of a file: give back what the program keeps for its next block of cases, 256 MB a process, what the file's
    own caches hold, and what the allocator keeps of both."""
    if nextitem is not None and nextitem.path == item.path:
        return
    arrays = sys.modules.get("fatigue_runner.integrators.memory")
    if arrays is not None:
        arrays._free.clear()
    module = getattr(item, "module", None)
    for value in list(vars(module).values()) if module is not None else ():
        if getattr(value, "__module__", "") == module.__name__ and hasattr(value, "cache_clear"):
            value.cache_clear()
    gc.collect()
    if TRIM is not None:
        TRIM(0)


def compile_kernels(say: Callable[[str], None]) -> None:
    """What most tests need, in processes of its own; once for each Python and each state of the sources, which name the cache's folder."""
    from joblib import cpu_count

    from fatigue_runner.compiled import cache_folder

    digest = hashlib.sha256(Path(kernels.__file__).read_bytes() + sys.version.encode()).hexdigest()
    done = cache_folder() / f"tests-may-begin-{digest[:16]}"
    if done.exists():
        return
    say("compiling the kernels, some minutes, once ...")
    if kernels.compile_all(at_once=min(2, cpu_count())) and done.parent.is_dir():
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
