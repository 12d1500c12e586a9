"""The file of a calibration: which of our cases belongs to which series of the other program.

name        of the calibration and its file
run         our run folder, with logs, from this file's folder
method      of the integrator that is taken, where the run has several (a label of its report, `rk4 50 ms`)
start       [s] left out at the start of both (default: what the campaign discards)
channels    those that are corrected (default: flapwise and edgewise root moment, tower base both ways; OpenFAST's names, too)
wohler_exponents  over which the loads must agree (default: the campaign's)
blocks      pieces that each run is cut into; one is left out at a time to judge (default 2)
series      list of {case, file, use}: a case's id or the beginning of it (its wind), the other program's output, and `train` (default) or
            `judge`, which is left out of the fit
"""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from fatigue_runner.channels import FATIGUE_CHANNELS, LOAD_NAMES, channel_name
from fatigue_runner.errors import did_you_mean
from fatigue_runner.inputs.section import Section, problem

MOST_EXPONENT = 40.0


def _named(name: str) -> str:
    if not re.fullmatch(r"[\w.-]{1,80}", name):
        raise problem("may hold letters, digits, `.`, `_` and `-` only, at most 80")
    return name


class SeriesSection(Section):
    """One run of the other program."""

    case: str = Field(min_length=1)
    file: str = Field(min_length=1)
    use: Literal["train", "judge"] = "train"


class CalibrationSection(Section):
    """See the module."""

    name: Annotated[str, AfterValidator(_named)]
    run: str = Field(min_length=1)
    method: str = ""
    start: float | None = Field(default=None, ge=0)
    channels: list[str] = Field(default=list(FATIGUE_CHANNELS), min_length=1)
    wohler_exponents: list[Annotated[float, Field(gt=0, le=MOST_EXPONENT)]] | None = Field(
        default=None, min_length=1
    )
    blocks: int = Field(default=2, ge=1, le=20)
    series: list[SeriesSection] = Field(min_length=1)

    @model_validator(mode="after")
    def _channels_are_loads(self) -> CalibrationSection:
        for name in self.channels:
            if channel_name(name) not in LOAD_NAMES:
                raise problem(f"{name!r} is no load{did_you_mean(name, LOAD_NAMES)}", key="channels")
        if not any(s.use == "train" for s in self.series):
            raise problem("no series is for training; leave `use` out of some", key="series")
        return self
