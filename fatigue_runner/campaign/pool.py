"""The only door to parallelism: joblib, on the cores of this machine (loky) or on a dask cluster."""

from __future__ import annotations

import multiprocessing
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import AbstractContextManager
from typing import Any, TypeVar

from fatigue_runner.errors import FatigueRunnerError, InputError

T = TypeVar("T")
J = TypeVar("J")


class WorkerEndedError(FatigueRunnerError):
    """A worker is gone; what it was doing must be done again."""


def connect(dask: str) -> None:
    """Connect to a dask scheduler, `tcp://host:8786`. Raises InputError where none answers, or without the package."""
    try:
        import distributed
    except ImportError:
        raise InputError("--dask needs the package `distributed`: pip install distributed") from None
    try:
        distributed.Client(dask, timeout=10, set_as_default=True)
    except (OSError, ValueError) as error:
        raise InputError(
            f"no dask scheduler answers at {dask} ({error}); start one with `dask scheduler`"
        ) from None


def run_jobs(
    function: Callable[[J], T], jobs: Sequence[J], workers: int, dask: str | None = None
) -> Iterator[T]:
    """`function(job)` of all jobs, in the order in which they finish.

    workers: processes on this machine; 1 runs in this one. dask: address of a scheduler, `tcp://host:8786`,
    instead. Closing the iterator, or an exception in its consumer, stops the jobs that have not started.
    """
    import joblib

    if dask is None:
        workers = min(workers, max(len(jobs), 1))
    with _backend(joblib, workers, dask):
        parallel = joblib.Parallel(batch_size=1, return_as="generator_unordered")
        results = parallel(joblib.delayed(_guarded)(function, job) for job in jobs)
        try:
            yield from results
        except BrokenExecutor as error:  # of loky: TerminatedWorkerError
            raise WorkerEndedError(
                "a worker process was ended from outside, most likely by the system for want of memory"
            ) from error
        finally:
            results.close()


def _backend(joblib: Any, workers: int, dask: str | None) -> AbstractContextManager[Any]:
    if dask is not None:
        return joblib.parallel_config("dask")
    if workers == 1:
        return joblib.parallel_config("sequential", n_jobs=1)
    # One thread per worker: the kernels are single-threaded, and BLAS must not take the other workers' cores.
    return joblib.parallel_config("loky", n_jobs=workers, inner_max_num_threads=1)


def _guarded(function: Callable[[J], T], job: J) -> T:
    """Ctrl-C reaches every process of the terminal: the parent acts on it, a worker must not die midway."""
    in_worker = multiprocessing.parent_process() is not None
    if in_worker and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    return function(job)
