"""The base of every section of a file, and pydantic's errors in the words of who wrote the file."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Any, ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.inputs.source import Source

M = TypeVar("M", bound=BaseModel)

# Tags of pydantic's unions start with this, so that they cannot be taken for keys of the file.
TAG = "~"

_WORDS = {
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "string_type": "must be text",
    "bool_type": "must be true or false",
    "list_type": "must be a list",
    "finite_number": "must be a finite number",
    "greater_than": "must be above {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be below {lt:g}",
    "less_than_equal": "must be at most {le:g}",
    "too_short": "must hold at least {min_length} value(s)",
    "too_long": "must hold at most {max_length} values",
    "string_too_short": "must not be empty",
}


def problem(message: str, key: str | None = None, **more: Any) -> PydanticCustomError:
    """An error inside a validator: one sentence; `key` is the key of the section that it is about."""
    return PydanticCustomError("problem", "{sentence}", {"sentence": message, "key": key, **more})


def known_name(name: Any, names: Collection[str], spelled: str | None = None, key: str | None = None) -> str:
    """The name if it is one of `names`, else the problem with the nearest one; spelled: as the nearest is looked for."""
    if not isinstance(name, str) or name not in names:
        near = did_you_mean(str(name) if spelled is None else spelled, names)
        raise problem(f"{name!r} is not known{near}", key=key)
    return name


class Section(BaseModel):
    """A mapping of a file: unknown keys are refused, text is no number, values do not change."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)
    synonyms: ClassVar[dict[str, str]] = {}

    @model_validator(mode="before")
    @classmethod
    def _only_known_keys(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            raise problem(f"must be a section with the keys {', '.join(cls.model_fields)}; got {data!r:.60}")
        for key in data:
            if key not in cls.model_fields and key not in cls.synonyms:
                raise cls.unknown(key)
            if cls.synonyms.get(key) in data:
                raise problem(f"says the same as {cls.synonyms[key]!r}; keep one of the two", key=key)
        cls.check_complete(data)
        return {cls.synonyms.get(key, key): value for key, value in data.items()}

    @classmethod
    def unknown(cls, key: str) -> PydanticCustomError:
        """The error for a key that the section has not."""
        return problem(did_you_mean(key, cls.model_fields), key=key, unknown=True)

    @classmethod
    def check_complete(cls, data: dict[str, Any]) -> None:
        """Where a section says in words of its own what is missing."""


def validated(model: type[M], source: Source, data: Any = None) -> M:
    """The data of a source as a section; raises InputError with one sentence and "file:line" per problem.

    data: what is checked in place of the source's own, where values were laid over it.
    """
    try:
        return model.model_validate(source.data if data is None else data)
    except ValidationError as error:
        raise input_error(error, source) from None


def input_error(error: ValidationError, source: Source) -> InputError:
    """All problems of a file, one sentence each in the order of the file, as the error a user reads."""
    found: dict[str, int] = {}
    for item in error.errors(include_url=False):
        path = tuple(part for part in item["loc"] if not str(part).startswith(TAG))
        context = item.get("ctx", {})
        if context.get("key") is not None:
            path = (*path, context["key"])
        sentence = _sentence(item, path, source)
        sentence += _decimal_point(item.get("input"))
        found.setdefault(f"{source.where(path)}: {sentence}", source.line(path) or 0)
    return InputError("\n".join(sorted(found, key=lambda text: found[text])))


def _sentence(item: Any, path: tuple[Any, ...], source: Source) -> str:
    context = item.get("ctx", {})
    if context.get("unknown"):
        return f"unknown key {path[-1]!r}{_inside(path[:-1], source)}{item['msg']}"
    if item["type"] == "missing":
        return f"key {path[-1]!r} is missing{_inside(path[:-1], source)}"
    name = key_name(path, source) or f"the {source.what}"
    if item["type"] == "problem":
        return f"{name}: {item['msg']}"
    if item["type"] == "literal_error":
        known = [word.strip(" '") for word in context["expected"].replace(" or ", ",").split(",")]
        return f"{name}: {item['input']!r} is not known{did_you_mean(str(item['input']), known)}"
    words = _WORDS.get(item["type"])
    what = words.format(**context) if words else item["msg"][:1].lower() + item["msg"][1:]
    return f"{name} {what}; got {item['input']!r:.60}"


def _decimal_point(value: Any) -> str:
    """The way out for a number that is text because of its comma."""
    if not isinstance(value, str) or not re.fullmatch(r"[-+]?[\d.]*,\d+([eE][-+]?\d+)?", value.strip()):
        return ""
    whole, _, part = value.strip().rpartition(",")
    return f"; write it with a decimal point: {whole.replace('.', '')}.{part}"


def key_name(path: tuple[Any, ...], source: Source) -> str:
    """A path as a person reads it: `wind.speeds`, `integrators[2].step`, without what the file has not."""
    name, node = "", source.data
    for part in path:
        if isinstance(part, int):
            if not isinstance(node, list):
                continue
            name += f"[{part}]"
            node = node[part] if part < len(node) else None
        else:
            name += f".{part}" if name else str(part)
            node = node.get(part) if isinstance(node, dict) else None
    return name


def _inside(path: tuple[Any, ...], source: Source) -> str:
    name = key_name(path, source)
    return f" in {name}" if name else ""
