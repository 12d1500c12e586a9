"""What a person sees while a campaign runs: a bar with cases done, rate and time left, from the start."""

from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console


class Progress:
    """A progress bar on `console`; with None it does nothing."""

    def __init__(self, console: Console | None) -> None:
        self._bar: Any = None
        self._task: Any = None
        self._console = console

    def __enter__(self) -> Progress:
        if self._console is not None:
            self._bar = _bar(self._console)
            self._task = self._bar.add_task("starting", total=None)
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def say(self, what: str) -> None:
        """What is going on now."""
        if self._bar is not None:
            self._bar.update(self._task, description=what)
            if not self._bar.console.is_terminal:
                self._bar.console.print(f"{what} ...")

    def note(self, what: str) -> None:
        """A sentence that stays above the bar."""
        if self._bar is not None:
            self._bar.console.print(f"note: {what}", markup=False)

    def begin(self, total: int, kept: int) -> None:
        """The number of cases, and how many of them an earlier run had finished."""
        if self._bar is not None:
            self._bar.reset(self._task, total=total, completed=kept)
            if kept:
                self._bar.console.print(
                    f"{kept} of {total} cases are finished from an earlier run and are kept"
                )

    def advance(self, cases: int) -> None:
        """So many cases came in."""
        if self._bar is not None and cases:
            self._bar.advance(self._task, cases)


def _bar(console: Console) -> Any:
    from rich import progress

    class Rate(progress.ProgressColumn):
        def render(self, task: progress.Task) -> str:
            return f"{task.speed:.3g} cases/s" if task.speed else ""

    class Times(progress.ProgressColumn):
        def render(self, task: progress.Task) -> str:
            left = task.time_remaining
            gone = f"{_minutes(task.elapsed or 0.0)} so far"
            return gone if left is None or task.finished else f"{gone}, about {_minutes(left)} left"

    return progress.Progress(
        progress.SpinnerColumn(),
        progress.TextColumn("{task.description}"),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        Rate(),
        Times(),
        console=console,
        transient=True,
    )


def _minutes(seconds: float) -> str:
    """`22 s`, `3:05 min`, `1:02 h`: as short as it can be read."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    return (
        f"{whole // 60}:{whole % 60:02} min" if whole < 3600 else f"{whole // 3600}:{whole % 3600 // 60:02} h"
    )
