"""What a figure was measured on, and how to measure on it: one pinned thread, interleaved repeats."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np


def describe() -> dict[str, Any]:
    """Processor, vector width, versions: plain values for tables and JSON."""
    import llvmlite.binding as llvm
    import numba
    import scipy

    features = llvm.get_host_cpu_features()
    vector = 512 if features.get("avx512f") else 256 if features.get("avx2") else 128
    return {
        "processor": _processor(),
        "llvm_cpu": llvm.get_host_cpu_name(),
        "vector_bits": vector,
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numba": numba.__version__,
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "date": time.strftime("%Y-%m-%d"),
    }


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"


@contextmanager
def pinned() -> Iterator[None]:
    """This process on one core, where the system can do that, with time loops timed in CPU time.

    The loops neither wait nor use threads: their CPU time is the wall time of an idle machine, and a busy one does not disturb it
    as much.
    """
    before = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
    if before:
        os.sched_setaffinity(0, {max(before)})
    try:
        with _loops_timed_by(time.thread_time):
            yield
    finally:
        if before:
            os.sched_setaffinity(0, before)


@contextmanager
def _loops_timed_by(clock: Callable[[], float]) -> Iterator[None]:
    """`Trajectory.wall_time` by another clock [s]."""
    from fatigue_runner.integrators import block

    usual, block.clock = block.clock, clock
    try:
        yield
    finally:
        block.clock = usual


def spread(values: Any) -> dict[str, float]:
    """median, and the quartiles as low and high."""
    low, median, high = np.quantile(np.asarray(values, float), (0.25, 0.5, 0.75))
    return {"median": float(median), "low": float(low), "high": float(high)}


def interleaved(work: Mapping[str, Callable[[], float]], repeats: int) -> dict[str, dict[str, float]]:
    """Each piece of work once per round, so that a slow minute of the machine meets all of them; spread of what they return."""
    found: dict[str, list[float]] = {name: [] for name in work}
    for piece in work.values():
        piece()  # warm: caches, branch predictors
    for _ in range(repeats):
        for name, piece in work.items():
            found[name].append(piece())
    return {name: spread(values) for name, values in found.items()}
