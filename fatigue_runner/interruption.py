"""How a command is ended from outside: Ctrl-C, SIGTERM and SIGHUP alike, with one sentence and no traceback."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from fatigue_runner.errors import FatigueRunnerError

ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))

_lost: list[
    int
] = []  # signals whose exception was raised where Python drops exceptions: in a callback, a finaliser


class Ended(KeyboardInterrupt):
    """Ended by a signal, as Ctrl-C does it; `exit_code` is 128 and the signal's number: 130, 143 (SIGTERM), 129 (SIGHUP)."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.exit_code = 128 + number


class Interrupted(FatigueRunnerError):
    """What a command says when it was ended from outside; `exit_code` is 130, 143 or 129."""

    def __init__(self, message: str, exit_code: int = 130) -> None:
        super().__init__(message)
        self.exit_code = exit_code


def exit_code_of(error: KeyboardInterrupt) -> int:
    """What the command line returns for it."""
    return error.exit_code if isinstance(error, Ended) else 128 + signal.SIGINT


@contextmanager
def ended_by_signals(to_the_end: bool = False) -> Iterator[None]:
    """Within it SIGTERM and SIGHUP end the run as Ctrl-C does; a second signal ends the process at once, without more words.

    to_the_end: so does one that comes after it, while the process cleans up, which is worth neither words nor a traceback. A signal that
    is ignored stays ignored (`nohup`). Outside the main thread it does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ended = False

    def end(number: int, frame: FrameType | None) -> None:
        nonlocal ended
        if ended:
            os._exit(128 + number)
        ended = True
        raise Ended(number)

    usual = sys.unraisablehook

    def unraisable(told: Any) -> None:
        if isinstance(told.exc_value, Ended):
            _lost.append(told.exc_value.exit_code - 128)
        else:
            usual(told)

    before = {number: signal.getsignal(number) for number in ENDING}
    heard = [number for number, handler in before.items() if handler is not signal.SIG_IGN]
    for number in heard:
        signal.signal(number, end)
    sys.unraisablehook = unraisable
    try:
        yield
    finally:
        sys.unraisablehook = usual
        ended = to_the_end
        for number in heard if not to_the_end else ():
            signal.signal(number, before[number])


def end_if_asked() -> None:
    """Raise what a signal raised where nobody could hear it. Called where a long run can be left."""
    if _lost:
        raise Ended(_lost.pop())
