"""The templates of this folder, filled: Markdown for the terminal and for docs/."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from jinja2 import Environment


class Table(NamedTuple):
    """Headings, and rows of as many cells."""

    head: Sequence[str]
    rows: Sequence[Sequence[Any]]


def markdown(template: str, **values: Any) -> str:
    """A template (`cases`) with its values, without a newline at the end."""
    return _environment().get_template(f"{template}.md.jinja").render(**values).rstrip("\n")


def table(given: Table) -> str:
    """A Markdown table."""
    return "\n".join([_line(given.head), "|" + "---|" * len(given.head), *map(_line, given.rows)])


def _line(cells: Iterable[Any]) -> str:
    return "| " + " | ".join(map(str, cells)) + " |"


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    made = Environment(
        loader=PackageLoader("fatigue_runner.benchmark.pages"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )  # no HTML, so nothing is escaped
    made.filters["table"] = table
    return made
