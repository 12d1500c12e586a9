"""Which cases keep a log. A case is made again to the bit in milliseconds, so that its log can be written whenever it is wanted."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag

from fatigue_runner.inputs.section import TAG, Section, problem
from fatigue_runner.inputs.sweep import check_not_empty

MANY = 400  # cases whose logs are all kept where a campaign does not say
FEW = 20  # of more cases than that

Where = Literal["diverged", "rejected"]


class KeptLogs(Section):
    """Of which cases: the `worst` so many by their errors, a `sample` of so many, or those `where` something happened."""

    worst: int | None = Field(default=None, gt=0)
    sample: int | None = Field(default=None, gt=0)
    where: Annotated[list[Where], BeforeValidator(check_not_empty)] | None = None

    @classmethod
    def check_complete(cls, data: dict[str, Any]) -> None:
        if sum(value is not None for value in data.values()) != 1 and data.keys() <= cls.model_fields.keys():
            raise problem("give exactly one of worst, sample and where")


ALL: Literal["all"] = "all"
NONE: Literal["none"] = "none"
Kept = Annotated[
    Annotated[Literal["all", "none"], Tag(f"{TAG}word")] | Annotated[KeptLogs, Tag(f"{TAG}which")],
    Discriminator(lambda value: f"{TAG}which" if isinstance(value, dict | KeptLogs) else f"{TAG}word"),
]


def chosen(kept: Kept | None, cases: int, watched: bool = False) -> Kept:
    """What holds for a campaign of so many cases that says `kept`, or nothing; watched: whether somebody wants to see them run."""
    if kept is not None:
        return kept
    return ALL if cases <= MANY else KeptLogs(sample=FEW) if watched else KeptLogs(worst=FEW)


def at_once(kept: Kept, cases: Sequence[str]) -> set[str]:
    """Those of the cases, by their ids, whose logs are written as they run."""
    if isinstance(kept, str):
        return set(cases) if kept == ALL else set()
    if kept.sample is None:
        return set()
    # one every so many, from the first winds to the last
    count = min(kept.sample, len(cases))
    return {cases[(2 * i + 1) * len(cases) // (2 * count)] for i in range(count)}


def afterwards(kept: Kept, rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """Cases, by their ids, whose logs are written when all have run: what they are worth is known then."""
    if isinstance(kept, str) or kept.sample is not None:
        return []
    # row by row: those of a large campaign are not all in memory
    ran = (row for row in rows if row["status"] != "failed")
    if kept.where is not None:
        return [row["case_id"] for row in ran if _happened(row) & set(kept.where)]
    errors = sorted(((_error(row), row["case_id"]) for row in ran), reverse=True)
    return [name for error, name in errors[: kept.worst] if error > 0.0]


def _happened(row: Mapping[str, Any]) -> set[str]:
    accepted = row["acceptance_rate"]
    rejected = {"rejected"} if accepted is not None and accepted < 1.0 else set()
    return rejected | ({"diverged"} if row["status"] == "diverged" else set())


def _error(row: Mapping[str, Any]) -> float:
    """The largest error of a damage-equivalent load, then of the states; a case that diverged is worse than any; 0 where nothing is
    known."""
    if row["status"] == "diverged":
        return math.inf
    loads = [abs(value) for name, value in row.items() if name.startswith("del_error_") and value is not None]
    return max(loads, default=row.get("nrmse_max") or 0.0)
