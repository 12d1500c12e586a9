"""The case that is shown while a campaign runs: its log as it grows, at a pace."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np

from fatigue_runner.errors import FatigueRunnerError
from fatigue_runner.logbook import Log, LogTail
from fatigue_runner.viewer.cases import Viewed, as_viewed


class Player:
    """The shown case: follows its log while that is written, and says which rows are due.

    pace: multiple of real time, None for as fast as it is there.
    """

    def __init__(self, path: Path, pace: float | None) -> None:
        self.path, self.pace = path, pace
        self.viewed: Viewed | None = None
        self.sent = 0
        self.ended = False
        self.trouble = ""
        self._tail: LogTail | None = None
        self._began = 0.0

    def read(self, now: float) -> bool:
        """Take in what was added to the log; True when the case is seen for the first time."""
        if self.ended:
            return False
        if self._tail is None:
            try:
                self._tail = LogTail(self.path)
            except FatigueRunnerError:
                return False
        block = self._tail.poll()
        self.ended = self._tail.ended
        if block is None or not len(block.time):
            return False
        if self.viewed is None:
            self.viewed, self._began = as_viewed([(self.path, block)])[0], now
            return True
        self.viewed.log = extended(self.viewed.log, block)
        return False

    def due(self, now: float) -> int:
        """Number of rows that should be on the screen."""
        if self.viewed is None:
            return 0
        time_ = self.viewed.log.time
        if self.pace is None:
            return len(time_)
        return int(np.searchsorted(time_, time_[0] + self.pace * (now - self._began), side="right"))

    @property
    def has_more(self) -> bool:
        """Whether rows are there that were not sent; once the run is over no more come, also to a log that was cut off."""
        return self.viewed is not None and self.sent < len(self.viewed.log.time)


def extended(log: Log, block: Log) -> Log:
    """`log` with the rows of the block that follows it."""
    for field in fields(log):
        held, new = getattr(log, field.name), getattr(block, field.name)
        if isinstance(held, np.ndarray):
            setattr(log, field.name, np.concatenate([held, new]))
        elif field.name in ("loads", "control"):
            setattr(log, field.name, {name: np.concatenate([held[name], new[name]]) for name in held})
    return log
