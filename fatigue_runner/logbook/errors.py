"""The one error of the logbook: a log that cannot be written, or not read without a wrong number."""

from __future__ import annotations

from fatigue_runner.errors import InputError


class LogError(InputError):
    """A log or an argument about one was wrong; the message names it and the way out (exit code 2)."""
