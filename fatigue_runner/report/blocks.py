"""What a section of the report is made of: plain data that the page template knows how to draw.

Text is plain text: the template escapes it. A section says what is to be told and never writes HTML.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar


@dataclass(frozen=True)
class Paragraph:
    """One paragraph; `strong` for a statement that a hurried reader must not miss."""

    kind: ClassVar[str] = "paragraph"
    text: str
    strong: bool = False


@dataclass(frozen=True)
class Warnings:
    """Statements that limit how far the result can be trusted."""

    kind: ClassVar[str] = "warnings"
    items: Sequence[str]


@dataclass(frozen=True)
class Figure:
    """A picture with its caption; `svg` is a whole SVG document, `alt` says in words what it shows."""

    kind: ClassVar[str] = "figure"
    svg: str
    caption: str
    alt: str


@dataclass(frozen=True)
class Column:
    """A table's column: its head, the unit below it, whether its cells are numbers (set flush right), whether they are words that need
    room, and whether a reader may pick one of its values and see those rows alone.
    """

    head: str
    unit: str = ""
    number: bool = True
    wide: bool = False
    pick: bool = False


@dataclass(frozen=True)
class TableRow:
    """The cells of one row; `mark` is 'good', 'bad' or 'quiet' and sets its look."""

    cells: Sequence[str]
    mark: str = ""


@dataclass(frozen=True)
class Table:
    """A table with its caption; every row has one cell per column."""

    kind: ClassVar[str] = "table"
    columns: Sequence[Column]
    rows: Sequence[TableRow]
    caption: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row.cells) != len(self.columns):
                raise ValueError(
                    f"a row has {len(row.cells)} cells, the table {len(self.columns)} columns: {row.cells}"
                )


@dataclass(frozen=True)
class Definitions:
    """Terms and what they mean here."""

    kind: ClassVar[str] = "definitions"
    items: Sequence[tuple[str, str]]


Block = Paragraph | Warnings | Figure | Table | Definitions


@dataclass(frozen=True)
class Section:
    """One heading of the report and what stands under it."""

    title: str
    blocks: Sequence[Block] = field(default_factory=tuple)
