"""The only door to parallelism: joblib, on the cores of this machine (loky) or on a dask cluster."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from multiprocessing import resource_tracker
from typing import Any, TypeVar

from fatigue_runner.errors import FatigueRunnerError, FatigueRunnerWarning
from fatigue_runner.interruption import ENDING

T = TypeVar("T")
J = TypeVar("J")

_told: set[str] = set()  # what workers have warned of

FRAMES = 20  # of a traceback that are told
WATCH = 0.5  # s between two looks of a worker for its parent


class WorkerEndedError(FatigueRunnerError):
    """A worker is gone; what it was doing must be done again."""


def run_jobs(
    function: Callable[[J], T], jobs: Sequence[J], workers: int, dask: str | None = None
) -> Iterator[T]:
    """`function(job)` of all jobs, in the order in which they finish.

    workers: processes on this machine; 1 runs in this one. dask: address of a scheduler, `tcp://host:8786`,
    instead. Closing the iterator, or an exception in its consumer, stops the jobs that have not started.
    """
    if dask is None and min(workers, len(jobs)) <= 1:
        for job in jobs:
            yield beside(lambda job=job: function(job))  # type: ignore[misc]
        return
    yield from _run_in_processes(function, jobs, min(workers, len(jobs)), dask)


def elsewhere(function: Callable[[J], T], job: J, workers: int) -> T:
    """`function(job)` in one of this machine's `workers`, so that what it loads does not stay in this process; what it warns of is told
    here. Of one worker, which is this process, it is `beside`. A worker that is ended from outside is replaced once."""
    if workers <= 1:
        return beside(lambda: function(job))
    try:
        try:
            ((result, said),) = _relay(function, job, workers)
        except WorkerEndedError as first:
            warnings.warn(
                f"{first}; what it was doing is tried once more", FatigueRunnerWarning, stacklevel=2
            )
            try:
                ((result, said),) = _relay(function, job, workers)
            except WorkerEndedError:
                raise WorkerEndedError(f"{first}, and so did the one that tried it again") from None
    except KeyboardInterrupt:
        dismiss_workers()
        raise
    for sentence in said:
        if sentence not in _told:  # by another worker
            _told.add(sentence)
            warnings.warn(sentence, FatigueRunnerWarning, stacklevel=2)
    return result


def _relay(function: Callable[[J], T], job: J, workers: int) -> Iterator[tuple[T, list[str]]]:
    return _run_in_processes(_relayed, [(function, job, _folder())], workers, None)


def _folder() -> str:
    """Where this process stands; empty where that is gone."""
    try:
        return os.getcwd()
    except OSError:
        return ""


def _relayed(work: tuple[Callable[[J], T], J, str]) -> tuple[T, list[str]]:
    """In a worker: what a function returns, and the warnings of this program that it gave."""
    from fatigue_runner import compiled

    function, job, folder = work
    if folder:  # a worker may be older than the folder that this process has gone to since
        os.chdir(folder)
    with warnings.catch_warnings(record=True) as caught, compiled.telling():
        warnings.simplefilter("always", FatigueRunnerWarning)
        result = function(job)
    return result, [str(one.message) for one in caught if issubclass(one.category, FatigueRunnerWarning)]


def _run_in_processes(
    function: Callable[[J], T], jobs: Sequence[J], workers: int, dask: str | None
) -> Iterator[T]:
    import joblib

    with _backend(joblib, workers, dask), cluster_errors(dask):
        parallel = joblib.Parallel(batch_size=1, return_as="generator_unordered")
        with _born_deaf():
            guarded = _guarded if dask is None else _told_in_words
            results = parallel(joblib.delayed(guarded)(function, job) for job in jobs)
        try:
            yield from results
        except BrokenExecutor as error:  # of loky: TerminatedWorkerError
            raise WorkerEndedError(
                "a worker process was ended from outside, most likely by the system for want of memory"
            ) from error
        finally:
            with suppress(Exception) if dask is not None else nullcontext():
                results.close()


@contextmanager
def cluster_errors(dask: str | None) -> Iterator[None]:
    """Raises WorkerEndedError for what a dask cluster says of itself, not of a job."""
    try:
        yield
    except Exception as error:
        if dask is None or not _of_the_cluster(error):
            raise
        raise WorkerEndedError(
            f"the dask scheduler at {dask} or its workers are lost ({type(error).__name__})"
        ) from error


def _of_the_cluster(error: Exception) -> bool:
    """Whether it says that scheduler or workers cannot be reached, not that a job failed."""
    ours = type(error).__module__.partition(".")[0] in ("distributed", "tornado")
    return ours or isinstance(error, CancelledError | TimeoutError | ConnectionError)


def _backend(joblib: Any, workers: int, dask: str | None) -> AbstractContextManager[Any]:
    if dask is not None:
        return joblib.parallel_config("dask")
    # One thread per worker: the kernels are single-threaded, and BLAS must not take the other workers' cores.
    return joblib.parallel_config(
        "loky", n_jobs=workers, inner_max_num_threads=1, initializer=_end_with_parent, initargs=(os.getpid(),)
    )


@contextmanager
def _born_deaf() -> Iterator[None]:
    """Processes that start within it never hear the signals that end a run: those reach every process of a terminal, and it is this
    process that acts on them, from the first moment on."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # starting it unblocks SIGINT and SIGTERM (CPython 3.11), and else the first worker would do that
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with_parent(parent: int) -> None:
    """In a worker: end when the process that started it is gone, whatever ended that. The kernels let other threads run."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(WATCH)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def dismiss_workers() -> None:
    """End this machine's workers at once: they are not asked any more, and an interrupted process must not wait for them at its end."""
    from joblib.externals.loky import get_reusable_executor

    get_reusable_executor(reuse=True).shutdown(wait=False, kill_workers=True)


def _guarded(function: Callable[[J], T], job: J) -> T:
    """Ctrl-C reaches every process of the terminal: the parent acts on it, a worker (of dask, say) must not die midway."""
    in_worker = multiprocessing.parent_process() is not None
    if in_worker and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    return function(job)


def _told_in_words(function: Callable[[J], T], job: J) -> T:
    """On a cluster: an error that was not foreseen becomes one of text, since what cannot be pickled never arrives, and the client of
    joblib would wait for it for ever (seen: RecursionError, whose traceback is too deep)."""
    try:
        return _guarded(function, job)
    except FatigueRunnerError:
        raise
    except Exception as error:
        said = "".join(traceback.format_exception(error, limit=-FRAMES))
    raise RuntimeError(f"a worker of the cluster failed:\n{said}")


def beside(work: Callable[[], T]) -> T:
    """`work()` in a thread of its own, so that Ctrl-C ends the wait for it even while a kernel runs; then the work is given up."""
    result: list[T] = []
    failure: list[BaseException] = []

    def run() -> None:
        try:
            result.append(work())
        except BaseException as error:
            failure.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        while thread.is_alive():
            thread.join(0.2)
    except BaseException:
        # raised in the thread as soon as its kernel returns: nothing is written after the run has ended
        ctypes.pythonapi.PyThreadState_SetAsyncExc(
            ctypes.c_ulong(thread.ident or 0), ctypes.py_object(SystemExit)
        )
        raise
    if failure:
        raise failure[0]
    return result[0]
