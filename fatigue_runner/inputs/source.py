"""A file as plain data that remembers on which line each value stood."""

from __future__ import annotations

import datetime
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from fatigue_runner.encoded import decoded
from fatigue_runner.errors import InputError

# Aliases (`&a`, `*a`) can nest into each other and grow without bound from a few bytes of text.
MAX_VALUES = 100_000
MAX_DEPTH = 32
_PLAIN = (bool, int, float, str, datetime.date, type(None))
_PLAIN_KEYS = "a key is a name here, not a mapping or a list"
_TAG = re.compile(r"(?:^|[\s\[{,:-])(![^\s,\]}]*)")
# a quoted text or a comment, in which brackets mean nothing; else a bracket or the end of a line
_BRACKETS = re.compile(r"\"(?:[^\"\\]|\\.)*\"|'[^'\n]*'|(?<!\S)#[^\n]*|[\[\]{}\n]")


@dataclass(frozen=True)
class Place:
    """A section of a source, as what reads the section sees it."""

    source: Source
    path: tuple[str | int, ...] = ()

    def where(self, *key: str | int) -> str:
        """The place of a key below the section, as a user reads it: `campaigns/sweep.yaml:14`."""
        return self.source.where((*self.path, *key))

    def file(self, name: str) -> Path:
        """The file that a value names."""
        return self.source.file(name)


class Source:
    """Plain `data` (dicts, lists, numbers, text) of a file, and `where(path)`: "file:line" of a value.

    what: what the file is, as its messages call it: a campaign, a recipe.
    """

    def __init__(
        self, name: str, data: Any, text: str = "", folder: Path | None = None, what: str = "file"
    ) -> None:
        self.name, self.what = name, what
        self.text = text
        self._text_lines = text.split("\n")
        self.folder = folder or Path.cwd()
        self._lines: dict[tuple[str | int, ...], int] = {(): 1}
        self._names: dict[tuple[str | int, ...], str] = {}  # of places in another file, see `over`
        self._values = 0
        self.data = self._plain(data, ())

    def line(self, path: tuple[str | int, ...]) -> int | None:
        """Line (from 1) of the value at `path`, or of the nearest enclosing one; None where there is no file.

        Elements of `path` that are not in the file (defaults, a single value where a list may stand) are
        skipped.
        """
        return self._lines[self._known(path)] if self.text else None

    def where(self, path: tuple[str | int, ...] = ()) -> str:
        """The place as a user reads it: `campaigns/sweep.yaml:14`; `mine.yaml:4 over base.yaml:14` of an entry of the base whose
        section this file changes, so that either may be what is wrong."""
        line, known = self.line(path), self._known(path)
        if line is None:
            return self.name
        if known not in self._names:
            return f"{self.name}:{line}"
        beside = [at for at in self._lines if at[:-1] == known[:-1] and len(at) > 1 and at not in self._names]
        below = f"{self._names[known]}:{line}"
        return f"{self.name}:{self._lines[beside[0]]} over {below}" if beside else below

    def _known(self, path: tuple[str | int, ...]) -> tuple[str | int, ...]:
        known: tuple[str | int, ...] = ()
        for key in path:
            for spelling in (key, f"{key}s"):  # `steps` may stand for `step`
                if (*known, spelling) in self._lines:
                    known = (*known, spelling)
                    break
        return known

    def file(self, name: str) -> Path:
        """The file that a value names; relative paths start at the source's folder, or where it is a link at that of the file it leads
        to, if the file is there only."""
        path = Path(name).expanduser()
        beside = self.folder / path  # the path itself where that is absolute
        behind = (self.folder / Path(self.name).name).resolve().parent / path
        return behind if os.path.exists(behind) and not os.path.exists(beside) else beside

    def section(self, path: tuple[str | int, ...], without: Sequence[str] = ()) -> Source:
        """The mapping at `path` laid over the top level, less the top level's keys `without`: one campaign of a file that
        holds several. Places stay those of the file."""
        own = self.data
        for key in path:
            own = own[key]
        own = {key: value for key, value in own.items() if path or key not in without}
        shared = {key: value for key, value in self.data.items() if key not in (*without, *own)}
        out = Source(self.name, {**shared, **own}, self.text, self.folder, self.what)
        out._lines = {
            place: line for place, line in self._lines.items() if place[:1] in {(key,) for key in shared}
        }
        depth = len(path)
        out._lines |= {place[depth:]: line for place, line in self._lines.items() if place[:depth] == path}
        out._lines.setdefault((), 1)
        return out

    def over(self, base: Source) -> Source:
        """The mapping laid over another source's, mappings key by key, all else replaced. Places stay those of the files."""
        out = Source(self.name, _laid(self.data, base.data), self.text, self.folder, self.what)
        out._lines = {**base._lines, **self._lines}
        out._names = {place: base._names.get(place, base.name) for place in base._lines}
        out._names = {
            place: name for place, name in out._names.items() if place not in self._lines
        } | self._names
        return out

    def _plain(self, node: Any, path: tuple[str | int, ...]) -> Any:
        self._values += 1
        if self._values > MAX_VALUES or len(path) > MAX_DEPTH:
            raise InputError(
                f"{self.where(path[:1])}: too many or too deeply nested values; aliases (`*a`) multiply"
            )
        if isinstance(node, Mapping):
            return {str(key): self._child(node, key, str(key), value, path) for key, value in node.items()}
        if isinstance(node, list | tuple):
            return [self._child(node, i, i, value, path) for i, value in enumerate(node)]
        if isinstance(node, os.PathLike):
            return os.fspath(node)
        if hasattr(node, "tolist"):  # numbers and arrays of a mapping that was computed
            return self._plain(node.tolist(), path)
        for plain in (bool, int, float, str):  # ruamel's scalars are subclasses that carry their formatting
            if isinstance(node, plain):
                return plain(node)
        if self.text and not isinstance(node, _PLAIN):
            tag = getattr(getattr(node, "tag", None), "value", None) or type(node).__name__
            raise InputError(f"{self.where(path)}: the tag {tag} means nothing here; remove it")
        return node

    def _child(self, node: Any, key: Any, name: str | int, value: Any, path: tuple[str | int, ...]) -> Any:
        positions = getattr(getattr(node, "lc", None), "data", None) or {}
        if key in positions:
            self._lines[(*path, name)] = positions[key][0] + 1
            self._refuse_look_alike(key, value, positions[key], (*path, name))
        return self._plain(value, (*path, name))

    def _refuse_look_alike(
        self, key: Any, value: Any, at: Sequence[int], path: tuple[str | int, ...]
    ) -> None:
        """Raises InputError for what YAML reads otherwise than it was meant: `1_0.3` as 10.3, and in braces `{step: 0,02}` as a
        step of 0 and a key 02. at: line and column of the key and of the value."""
        lines = self._text_lines
        line, column = at[-2], at[-1]
        found = re.match(r"[-+.\w]+", lines[line][column:]) if line < len(lines) else None
        if found and "_" in found[0] and isinstance(value, int | float) and not isinstance(value, bool):
            raise InputError(f"{self.where(path)}: {found[0]} is no number here; write it without `_`")
        before = lines[at[0]][: at[1]] if at[0] < len(lines) else ""
        comma = re.search(r"([-+]?\d+),$", before)
        if value is None and comma and isinstance(key, int | float):
            digits = re.match(r"\w*", lines[at[0]][at[1] :])
            meant = f"{comma[1]},{digits[0] if digits else ''}"
            raise InputError(
                f"{self.where(path)}: {meant} is two entries to YAML; write the number with a decimal point, {meant.replace(',', '.')}"
            )


def _laid(over: Mapping[str, Any], base: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, value in over.items():
        both = isinstance(value, Mapping) and isinstance(base.get(key), Mapping)
        merged[key] = _laid(value, base[key]) if both else value
    return merged


def read_mapping(path: Path, what: str, keys: str) -> Source:
    """Read a YAML file that holds a mapping: `what` it is and its first `keys` stand in the messages.

    YAML 1.2: `1e7` is a number, duplicate keys are refused. Raises InputError for a missing or unreadable file and for text that is
    not YAML, with its line.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file{_nearby(path)}") from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder; give the {what}'s YAML file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from None
    source = parse_mapping(decoded(data, path, f"a {what} in YAML"), path, what, keys)
    _refuse_another_kind(source)
    return source


# What only one kind of file has at its top, and which command takes it.
_KINDS = {
    "campaign": ("integrators", "`fatigue-runner run`"),
    "turbine": ("blade", "`turbine:` of a campaign, `fatigue-runner turbine`"),
    "recipe": ("family", "`fatigue-runner train`"),
    "polar file": ("airfoils", "`aerodynamics: airfoils:` of a turbine"),
}


def _refuse_another_kind(source: Source) -> None:
    """A turbine that is given as a campaign has many unknown keys; what is wrong is one thing."""
    own = _KINDS.get(source.what)
    if own is None or own[0] in source.data:
        return
    for kind, (key, place) in _KINDS.items():
        if key in source.data:
            raise InputError(f"{source.name}: this is a {kind}, not a {source.what}; it is for {place}")


def parse_mapping(text: str, path: Path, what: str, keys: str) -> Source:
    """The mapping in a YAML text from `path`. Raises InputError as `read_mapping`."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError
    from ruamel.yaml.reader import ReaderError

    _refuse_endless(text, path, what)
    try:
        reader = YAML(typ="rt")
        reader.Constructor = _constructor()
        data = reader.load(_with_spaces(text, path))
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{path}:{mark.line + 1}" if mark else str(path)
        tagged = mark is not None and _TAG.search(text.split("\n")[mark.line])
        raise InputError(
            f"{place}: {_yaml_problem(error)}{'; remove the tag (`!...`)' if tagged else ''}"
        ) from None
    except ReaderError as error:
        line = text[: int(error.position)].count("\n") + 1
        raise InputError(
            f"{path}:{line}: not valid YAML: the control character U+{ord(text[int(error.position)]):04X} stands there; remove it"
        ) from None
    except YAMLError as error:
        raise InputError(f"{path}: not valid YAML: {' '.join(str(error).split())}") from None
    except (ValueError, TypeError, AttributeError, KeyError) as error:  # of a value whose tag does not fit it
        raise InputError(
            f"{_first_tag(text, path)}: a tag (`!!...`) does not fit its value, {' '.join(str(error).split())}; remove the tag"
        ) from None
    except RecursionError:
        raise InputError(f"{path}:{_deep(text)}: not a {what}: its values nest too deeply") from None
    if not isinstance(data, Mapping):
        raise InputError(f"{path}:1: a {what} is a mapping of keys ({keys})")
    return Source(str(path), data, text, path.absolute().parent, what)


@cache
def _constructor() -> type:
    """The parser's own, but keys are plain values: one that is a mapping would be hashed, and of one in another in another for hours."""
    from ruamel.yaml import RoundTripConstructor
    from ruamel.yaml.constructor import ConstructorError
    from ruamel.yaml.nodes import ScalarNode

    class PlainKeys(RoundTripConstructor):
        def construct_mapping(self, node: Any, maptyp: Any, deep: bool = False) -> Any:  # type: ignore[override]
            for key, _ in node.value:
                if not isinstance(key, ScalarNode):
                    raise ConstructorError(None, None, _PLAIN_KEYS, key.start_mark)
            return super().construct_mapping(node, maptyp, deep)

    return PlainKeys


def _refuse_endless(text: str, path: Path, what: str) -> None:
    """Raises InputError, with the line, for more values than a person writes, and for more brackets in each other: the parser would
    take minutes for them."""
    count = text.count(",") + text.count("\n")
    if count > MAX_VALUES:
        lines = text.split("\n")
        longest = max(range(len(lines)), key=lambda i: len(lines[i]))
        raise InputError(
            f"{path}:{longest + 1}: about {count:,} values, and a {what} holds {MAX_VALUES:,} at most; a sweep can be written as "
            "{start, stop, count}, long series belong in files of their own"
        )
    line, depth = _deepest(text)
    if depth > 4 * MAX_DEPTH:  # far more than are allowed, since quotes are not always what they look like
        raise InputError(f"{path}:{line}: not a {what}: its brackets nest too deeply")


def _deepest(text: str) -> tuple[int, int]:
    """The line on which most brackets are open in each other, and how many."""
    line, depth, found = 1, 0, (1, 0)
    for sign in _BRACKETS.finditer(text):
        line += sign[0].count("\n")
        depth = max(0, depth + (sign[0] in "[{") - (sign[0] in "]}"))
        found = max(found, (line, depth), key=lambda place: place[1])
    return found


def _deep(text: str) -> int:
    """The line to look at where values nest too deeply: of the brackets, or where there are none of the deepest indentation."""
    line, depth = _deepest(text)
    lines = text.split("\n")
    return line if depth > MAX_DEPTH else 1 + max(range(len(lines)), key=lambda i: _indent(lines[i]))


def _indent(line: str) -> int:
    """Columns before a line's first value; `- - a` is two lists."""
    return len(line) - len(line.lstrip(" -?"))


def _first_tag(text: str, path: Path) -> str:
    """The place of the first tag in a text that could not be read."""
    for number, line in enumerate(text.split("\n"), start=1):
        if _TAG.search(line.split("#")[0]):
            return f"{path}:{number}"
    return str(path)


def _with_spaces(text: str, path: Path) -> str:
    """The text with a space for every tab that stands behind something: YAML takes it for one (1.2.2, 6.6), the parser does not.

    Raises InputError for a line that is indented with a tab, which YAML does not allow.
    """
    if "\t" not in text:
        return text
    lines = text.split("\n")
    for number, line in enumerate(lines, start=1):
        indent = line[: len(line) - len(line.lstrip())]
        if "\t" in indent and line.strip() and not line.lstrip().startswith("#"):
            raise InputError(
                f"{path}:{number}: the line is indented with a tab; YAML takes spaces only, so use these"
            )
    return "\n".join(line.replace("\t", " ") for line in lines)


def _yaml_problem(error: Any) -> str:
    """One sentence for a YAML error."""
    from ruamel.yaml.constructor import DuplicateKeyError

    problem = str(error.problem or error.context or "not valid YAML").strip()
    if isinstance(error, DuplicateKeyError):
        key = problem.split('"')[1] if '"' in problem else "?"
        if key.isdigit():  # {start: 3,5, stop: 4,5}: twice a key 5
            return f"key {key!r} is given twice in one section; write numbers with a decimal point, not with a comma"
        return f"key {key!r} is given twice in one section; keep one of the two"
    return problem if problem == _PLAIN_KEYS else f"not valid YAML: {problem}"


def _nearby(path: Path) -> str:
    """The YAML files that stand where the missing one was looked for."""
    folder = path.parent
    names = sorted(str(folder / p.name) for p in folder.glob("*.y*ml")) if folder.is_dir() else []
    if not names:
        return ""
    from fatigue_runner.errors import did_you_mean

    return did_you_mean(str(path), names)
