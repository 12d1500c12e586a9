"""What a corrector's header may hold: types and ranges, so that a file that was edited or damaged is refused with the key, not followed."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from fatigue_runner.corrector.errors import CorrectorError
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.section import problem, validated
from fatigue_runner.inputs.source import Source

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=100)]
MOST_RUNGS = 4
Word = Annotated[str, Field(min_length=1, max_length=100)]


class _Checked(BaseModel):
    model_config = ConfigDict(strict=True, allow_inf_nan=False, extra="allow")


class _Guard(_Checked):
    limit: float = Field(ge=0)
    norm: Word
    kappa: float = Field(ge=1)
    quantile: float = Field(gt=0, le=1)
    atol: list[float]
    rtol: list[Annotated[float, Field(ge=0)]]
    substeps: int = Field(default=0, ge=0, le=10_000)
    low: list[float] = []
    high: list[float] = []
    margin: float | None = Field(default=None, ge=0)


class _Header(_Checked):
    name: Name
    family: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._+-]*$", max_length=100)]
    turbine: Word
    turbine_hash: Word
    method: Word
    step: float = Field(gt=0, le=10)
    kind: Word
    factors: list[Any]
    activation: Literal["identity", "relu", "isru"]
    history: int = Field(ge=0, le=16)
    damping: float = Field(ge=0)
    layers: int = Field(ge=0, le=100)
    wind_range: list[Annotated[float, Field(ge=0)]] = Field(min_length=2, max_length=2)
    validation: dict[str, Any]
    training: dict[str, Any]
    recipe: str
    licence: str
    guard: _Guard
    ahead_atol: list[float] = []
    operation: Literal["fixed", "controlled", "torque-law"] = "fixed"
    bins: list[Annotated[float, Field(ge=0, le=100)]] = []
    harmonics: bool = False
    states: list[Word] | None = None
    wind: list[Word] | None = None
    rungs: list[dict[str, Any]] = Field(default=[], max_length=MOST_RUNGS)

    @model_validator(mode="after")
    def _range_ascends(self) -> _Header:
        if self.wind_range[0] > self.wind_range[1]:
            raise problem("must go from the lower to the higher speed", key="wind_range")
        if sorted(set(self.bins)) != self.bins:
            raise problem("must be mean winds in ascending order", key="bins")
        if (self.states is None) != (self.wind is None):
            raise problem("comes with `wind`, and `wind` with it", key="states")
        return self


def check_header(header: Any) -> None:
    """Raises CorrectorError, with the key, for a header that no training wrote."""
    if not isinstance(header, dict):
        raise CorrectorError(f"the header is no mapping but {header!r:.40}")
    try:
        validated(_Header, Source("the header", header, what="header"))
    except InputError as error:
        raise CorrectorError(str(error).splitlines()[0]) from None
