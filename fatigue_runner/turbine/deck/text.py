"""An OpenFAST input file as people have them: values found by their keys, each with its line.

OpenFAST itself counts lines, so that a file of another version is nonsense to it. The keys beside the values change little over the
versions: what is read here is found by them. Lines in between, their order, comments and blank lines do not matter.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fatigue_runner.errors import InputError, did_you_mean

_TOKEN = re.compile(r"""@?"[^"]*"|@?'[^']*'|,|[^\s,]+""")
_NUMBER = re.compile(r"^[+-]?(\d+\.?\d*|\.\d+)([eEdDqQ][+-]?\d+|[+-]\d+)?$")
_REPEAT = re.compile(r"^(\d+)\*(.+)$")
_TRUE, _FALSE = {"true", "t", ".true.", ".t."}, {"false", "f", ".false.", ".f."}
_COMMENT = ("!", "#", "%")
_RULES = ("---", "===")
_LFS = "version https://git-lfs"


def number(text: str) -> float | None:
    """A number as Fortran writes it (`1.0D+03`, `1.`, `.5`, `1.0-3`), or None."""
    if not _NUMBER.match(text):
        return None
    plain = re.sub(r"[dDqQ]", "e", text)
    if "e" not in plain.lower():
        plain = re.sub(r"(?<=[\d.])([+-]\d+)$", r"e\1", plain)  # an exponent without its letter
    return float(plain)


def spelled(key: str) -> str:
    """A key without what versions write differently: `BldFile(1)` is `BldFile1`."""
    return re.sub(r"[^a-z0-9_]", "", key.lower())


@dataclass(frozen=True)
class Entry:
    """One line: its number (from 1), the values that it begins with, and the key behind them."""

    line: int
    values: tuple[str, ...]
    key: str


@dataclass(frozen=True)
class Table:
    """Rows of numbers (texts where they are none) by column; line: of each row."""

    header: int
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]


@dataclass(frozen=True)
class DeckFile:
    """A file of a deck. name: as messages call it; what: "an ElastoDyn file"; sha256: of its bytes."""

    path: Path
    what: str
    sha256: str
    lines: tuple[str, ...]
    entries: dict[str, list[Entry]] = field(repr=False)

    @property
    def title(self) -> str:
        """What the file calls itself, "" where it has no such line."""
        return _title(self.lines)[0]

    def where(self, key: str | None = None) -> str:
        """`path:line` of a key, or the path."""
        found = self.entries.get(spelled(key)) if key is not None else None
        return f"{self.path}:{found[0].line}" if found else str(self.path)

    def has(self, *keys: str) -> bool:
        """Whether one of the keys is there."""
        return any(spelled(key) in self.entries for key in keys)

    def entry(self, *keys: str) -> Entry:
        """The first line with one of the keys, which are spellings of one. Raises InputError where there is none."""
        for key in keys:
            if spelled(key) in self.entries:
                return self.entries[spelled(key)][0]
        known = [entries[0].key for entries in self.entries.values()]
        near = did_you_mean(keys[0], known)
        raise InputError(
            f"{self.path}: the key {keys[0]} is missing, {self.what} has it"
            f"{near if near.startswith('; did you') else ''}"
        )

    def number(self, *keys: str, default: float | None = None) -> float:
        """The number of a key; `default` where the key is missing or says "default". Raises InputError for anything else."""
        if default is not None and not self.has(*keys):
            return default
        entry = self.entry(*keys)
        text = entry.values[0].strip("\"'") if entry.values else ""
        if default is not None and text.lower() == "default":
            return default
        return self.number_of(entry, keys[0])

    def all(self, *keys: str) -> list[Entry]:
        """Every line with one of the keys, which are spellings of one, in the order of the file."""
        found = [entry for key in keys for entry in self.entries.get(spelled(key), ())]
        return sorted(found, key=lambda entry: entry.line)

    def number_of(self, entry: Entry, key: str) -> float:
        """The number that a line begins with; key: as it is called in messages."""
        value = number(entry.values[0]) if entry.values else None
        if value is None:
            text = entry.values[0].strip("\"'") if entry.values else ""
            raise InputError(f"{self.path}:{entry.line}: {key} must be a number; got {text!r:.40}")
        return value

    def numbers(self, *keys: str) -> list[float]:
        """All numbers before a key."""
        entry = self.entry(*keys)
        values = [number(text) for text in entry.values]
        for text, value in zip(entry.values, values, strict=True):
            if value is None:
                raise InputError(f"{self.path}:{entry.line}: {keys[0]} must be numbers; got {text!r:.40}")
        return [value for value in values if value is not None]

    def count(self, *keys: str) -> int:
        """A whole number of things, at least 0."""
        value = self.number(*keys)
        if value != int(value) or value < 0:
            raise InputError(f"{self.where(keys[0])}: {keys[0]} must be a whole number; got {value:g}")
        return int(value)

    def flag(self, *keys: str, default: bool | None = None) -> bool:
        """True or False, in Fortran's spellings; `default` where the key is missing or says "default"."""
        if default is not None and not self.has(*keys):
            return default
        entry = self.entry(*keys)
        word = entry.values[0].strip("\"'").lower() if entry.values else ""
        if word in _TRUE | _FALSE:
            return word in _TRUE
        if default is not None and word == "default":
            return default
        value = number(word)
        if value is not None:
            return value != 0
        raise InputError(f"{self.path}:{entry.line}: {keys[0]} must be True or False; got {word!r:.40}")

    def switch(self, *keys: str, default: int | None = None) -> int:
        """The number of a key that some versions write as True or False: 1 or 0; `default` as for a number."""
        if self.has(*keys):
            entry = self.entry(*keys)
            word = entry.values[0].strip("\"'").lower() if entry.values else ""
            if word in _TRUE | _FALSE:
                return int(word in _TRUE)
        return int(self.number(*keys, default=default))

    def text(self, *keys: str, default: str | None = None) -> str:
        """The text of a key, without its quotes."""
        if default is not None and not self.has(*keys):
            return default
        entry = self.entry(*keys)
        return entry.values[0].strip("\"'").strip() if entry.values else ""

    def texts(self, count: int, *keys: str) -> list[tuple[int, str]]:
        """`count` texts, the first beside the key and one a line below it, each with its line."""
        first = self.entry(*keys)
        out = [(first.line, text.strip("\"'").strip()) for text in first.values]
        line = first.line
        while len(out) < count:
            line += 1
            if line > len(self.lines):
                raise InputError(
                    f"{self.path}:{first.line}: {keys[0]} must be {count} names, one a line; the file ends after {len(out)}"
                )
            entry = _entry(line, self.lines[line - 1])
            if entry is None:
                continue
            if entry.values[0].startswith(_RULES):
                raise InputError(
                    f"{self.path}:{line}: {keys[0]} must be {count} names, one a line; here are {len(out)}"
                )
            out.append((line, entry.values[0].strip("\"'").strip()))
        return out[:count]

    def table(self, needed: Sequence[str], *count_keys: str) -> Table:
        """The rows below a count, with the names of the columns that stand above them.

        needed: names of columns that must be there. Raises InputError where rows or columns are missing.
        """
        entry, count = self.entry(*count_keys), self.count(*count_keys)
        wanted = [spelled(name) for name in needed]
        header, names = self._header(entry.line, wanted)
        missing = [name for name in needed if spelled(name) not in names]
        if missing:
            raise InputError(
                f"{self.path}:{header}: the table of {count_keys[0]} needs the columns {', '.join(needed)}; "
                f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"
            )
        first = header + 1
        while first <= len(self.lines) and not _begins_with_number(self.lines[first - 1]):
            if self.lines[first - 1].lstrip().startswith(_RULES):
                break
            first += 1
        lines, rows = self.rows(first, count, 1 + max(names.index(name) for name in wanted), count_keys[0])
        return Table(header, names, rows, lines)

    def _header(self, after: int, wanted: Sequence[str]) -> tuple[int, tuple[str, ...]]:
        """The line below `after` with the columns' names, and the names; the nearest one where none has all."""
        best: tuple[int, tuple[str, ...]] = (after, ())
        most = 0
        for line in range(after + 1, len(self.lines) + 1):
            names = tuple(spelled(token) for token in _row(self.lines[line - 1].lstrip("!# \t")))
            found = sum(name in names for name in wanted)
            if found > most:
                best, most = (line, names), found
            if found == len(wanted):
                break
        return best

    def rows(
        self, first: int, count: int, width: int, what: str
    ) -> tuple[tuple[int, ...], tuple[tuple[str, ...], ...]]:
        """`count` rows of at least `width` values from the line `first` on, blank and comment lines left out; and their lines."""
        lines: list[int] = []
        rows: list[tuple[str, ...]] = []
        line = first
        while len(rows) < count:
            if line > len(self.lines):
                raise InputError(
                    f"{self.path}:{len(self.lines)}: {what} says {count} rows, the file ends after {len(rows)}"
                )
            text = self.lines[line - 1]
            line += 1
            if not text.strip() or text.lstrip().startswith(_COMMENT):
                continue
            row = _row(text)
            if number(row[0]) is None:
                raise InputError(
                    f"{self.path}:{line - 1}: {what} says {count} rows, here ends the table after {len(rows)}; got {text.strip()!r:.40}"
                )
            if len(row) < width:
                raise InputError(
                    f"{self.path}:{line - 1}: row {len(rows) + 1} of {what} needs {width} values; got {text.strip()!r:.40}"
                )
            rows.append(tuple(row))
            lines.append(line - 1)
        return tuple(lines), tuple(rows)

    def column(self, table: Table, name: str) -> list[float]:
        """A column of a table as numbers."""
        place = table.columns.index(spelled(name))
        values = []
        for line, row in zip(table.lines, table.rows, strict=True):
            value = number(row[place])
            if value is None:
                raise InputError(f"{self.path}:{line}: {name} must be a number; got {row[place]!r:.40}")
            values.append(value)
        return values


def read_deck_file(path: Path, what: str) -> DeckFile:
    """A file of a deck; UTF-8 or Latin-1, any line ends. Raises InputError for one that is no text."""
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    if b"\0" in raw:
        raise InputError(f"{path}: is no text file, {what} is one")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    if text.startswith(_LFS):
        raise InputError(f"{path}:1: is a pointer of Git LFS, not the file; fetch it with `git lfs pull`")
    lines = tuple(re.split(r"\r\n|\r|\n", text))
    entries: dict[str, list[Entry]] = {}
    for entry in _entries(lines):
        entries.setdefault(spelled(entry.key), []).append(entry)
    entries.pop("", None)
    return DeckFile(path, what, hashlib.sha256(raw).hexdigest(), lines, entries)


def _title(lines: Sequence[str]) -> tuple[str, int]:
    """What a module's file calls itself, in the line below its ruled title, where any key may stand; and the lines up to there."""
    written = [n for n, text in enumerate(lines) if text.strip() and not text.lstrip().startswith(_COMMENT)]
    if len(written) < 2 or not lines[written[0]].lstrip().startswith(_RULES):
        return "", 0
    return lines[written[1]].strip(), written[1] + 1


def _entries(lines: Sequence[str]) -> Iterable[Entry]:
    begin = _title(lines)[1]
    for place, text in enumerate(lines[begin:], start=begin + 1):
        entry = None if text.lstrip().startswith(_RULES) else _entry(place, text)
        if entry is not None:
            yield entry


def _entry(line: int, text: str) -> Entry | None:
    """Values, then a key; `!` before the key is ROSCO's. None for a blank line and a comment."""
    if not text.strip() or text.lstrip().startswith(_COMMENT):
        return None
    tokens = [token for token in _TOKEN.findall(text) if token.strip("!")]
    values: list[str] = []
    comma = True  # the first is a value, whatever it is
    for place, token in enumerate(tokens):
        if token == ",":
            comma = True
            continue
        token = token.lstrip("!") if place else token
        repeated = _REPEAT.match(token)
        if repeated and number(repeated[2]) is not None:
            values += [repeated[2]] * int(repeated[1])
        elif comma or number(token) is not None or token[0] in "\"'":
            values.append(token)
        else:
            return Entry(line, tuple(values), token)
        comma = False
    return Entry(line, tuple(values), "")


def _row(text: str) -> list[str]:
    return [token for token in _TOKEN.findall(text) if token != ","]


def _begins_with_number(text: str) -> bool:
    row = _row(text)
    return bool(row) and number(row[0]) is not None
