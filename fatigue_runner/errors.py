"""The program's errors: one base class; each message says what was wrong, where, and what would be right."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class FatigueRunnerError(Exception):
    """Base of every error that a user can meet; `exit_code` is what the command line returns."""

    exit_code = 1


class InputError(FatigueRunnerError):
    """The input was wrong: a campaign, a turbine, a name, a path. Nothing has been written."""

    exit_code = 2


class FatigueRunnerWarning(UserWarning):
    """What a user should know of a figure or a run that goes on all the same."""


_LISTED = 60  # names of a sentence; cases of a campaign may be thousands


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`; did you mean 'x'?` for the nearest known word, else the list of what is known."""
    known = list(known)
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    if near:
        return f"; did you mean {near[0]!r}?"
    more = f", ... ({len(known):,} in all)" if len(known) > _LISTED else ""
    return f"; known: {', '.join(known[:_LISTED])}{more}"
