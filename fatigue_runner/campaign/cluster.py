"""A dask cluster that runs the blocks: what it is sent before they start, and how it is told from one that is lost.

joblib hands the blocks over (`pool`); here are the inputs, which travel by content (`parcel`), and the kernels, which one worker of every
machine compiles before any case is timed.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any, Self

from fatigue_runner.campaign.block import Job, run_block, warm_up
from fatigue_runner.campaign.parcel import Parcel, here, throw_away, unpack
from fatigue_runner.campaign.pool import cluster_errors
from fatigue_runner.errors import InputError

WAIT = 10.0  # s for an answer of the scheduler
WORKERS = 60.0  # s for the first worker: a batch system starts them


class Cluster:
    """Raises InputError where no scheduler answers at `address`, `tcp://host:8786`, or without the package."""

    def __init__(self, address: str) -> None:
        try:
            import distributed
        except ImportError:
            raise InputError("--dask needs the package `distributed`: pip install distributed") from None
        logging.getLogger("distributed").setLevel(
            logging.CRITICAL
        )  # what it has to say is said in a sentence
        try:
            self._client: Any = distributed.Client(address, timeout=WAIT, set_as_default=True)
        except (OSError, ValueError) as error:
            raise InputError(
                f"no dask scheduler answers at {address} ({error}); start one with `dask scheduler`"
            ) from None
        self.address = address
        try:
            self._client.wait_for_workers(1, timeout=WORKERS)
        except TimeoutError:
            raise InputError(
                f"the dask scheduler at {address} has no workers; start some with `dask worker {address} --nthreads 1`"
            ) from None

    @contextmanager
    def prepared(self, parcel: Parcel, sample: Job) -> Iterator[Callable[[Job], Any]]:
        """What runs a job on a worker. Before: the parcel is on every machine, also on those that come later, and one worker of each has
        compiled what the sample needs."""
        from distributed.diagnostics.plugin import WorkerPlugin

        plugin = _unpacking(WorkerPlugin, parcel)
        on_worker = partial(_run_here, parcel.name, parcel.places)
        try:
            with cluster_errors(self.address):
                self._client.register_plugin(plugin, name=parcel.name)
                warm = partial(_warm_here, parcel.name, parcel.places)
                self._client.gather([
                    self._client.submit(warm, sample, workers=[worker], pure=False)
                    for worker in self._one_of_every_machine()
                ])  # fmt: skip
            yield on_worker
        finally:
            with suppress(Exception):  # a scheduler that is lost has been told of already
                self._client.unregister_worker_plugin(parcel.name)
                self._client.run(throw_away, parcel.name, on_error="ignore")

    @property
    def workers(self) -> int:
        """How many there are now."""
        return len(self._client.ncores())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """Leave the cluster to others."""
        with suppress(Exception):
            self._client.close(timeout=2.0)

    def _one_of_every_machine(self) -> Iterable[str]:
        return {address.rpartition(":")[0]: address for address in self._client.ncores()}.values()


def _unpacking(base: Any, parcel: Parcel) -> Any:
    class Unpacking(base):  # type: ignore[misc]
        """Runs when a worker starts or joins."""

        def setup(self, worker: Any) -> None:
            unpack(parcel.name, parcel.files)

    return Unpacking()


def _run_here(name: str, places: dict[str, str], job: Job) -> Any:
    return run_block(here(job, name, places))


def _warm_here(name: str, places: dict[str, str], job: Job) -> None:
    warm_up(here(job, name, places))
