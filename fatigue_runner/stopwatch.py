"""Where a process spends its time: named stages, each without those inside of it. `benchmark campaign` reads it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager

_spent: dict[str, float] = {}
clock = time.perf_counter


class _Open(threading.local):
    """Of every stage that runs in a thread, the time of the stages inside of it [s]."""

    def __init__(self) -> None:
        self.inside: list[float] = []


_open = _Open()


@contextmanager
def stage(name: str) -> Iterator[None]:
    """The block's time counts as `name`; a microsecond, so nothing that is done for every sample."""
    begin = clock()
    _open.inside.append(0.0)
    try:
        yield
    finally:
        took = clock() - begin
        _spent[name] = _spent.get(name, 0.0) + took - _open.inside.pop()
        if _open.inside:
            _open.inside[-1] += took


def taken(stages: Collection[str]) -> dict[str, float]:
    """Seconds of each of these stages since it was last asked for."""
    return {name: _spent.pop(name, 0.0) for name in stages}


@contextmanager
def counting(other: Callable[[], float]) -> Iterator[None]:
    """Within the block, time is that of another clock."""
    global clock
    before, clock = clock, other
    try:
        yield
    finally:
        clock = before
