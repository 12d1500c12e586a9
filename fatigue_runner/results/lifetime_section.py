"""What a campaign says of the life that its cases stand for: the keys under `lifetime`, also those of `fr.lifetime`.

climate          `I`, `II` or `III` (IEC 61400-1, Rayleigh), {weibull: {mean: [m/s], shape: 2}}, which is also how class S is given, or
                 {table: {speeds: [m/s], probabilities: [-]}}, the probability of the wind around each speed
years            of the life (default 20)
n_eq             cycles that the lifetime equivalent loads refer to (default 1e7)
bins             {width: [m/s]}, each wind in the middle of its bin, or {edges: [m/s]}; default: the winds' own spacing
operating_range  [from, to] [m/s]: where the turbine turns; bins that miss part of it are refused (default 3 to 25 m/s under control)
availability     share of the operating time in which the turbine does turn (default 1); the rest is idle, without damage
renormalise      whether the bins' probabilities are scaled to a sum of 1 (default false: they cover what they cover)
confidence       of the interval that the seeds leave (default 0.9)
resamples        of the bootstrap behind it (default 1000)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any

from pydantic import Field, PlainSerializer, PlainValidator, field_validator, model_validator

from fatigue_runner.errors import InputError
from fatigue_runner.fatigue import Climate, TableClimate, WindBins, WindClimate, iec_climate
from fatigue_runner.inputs.section import Section, problem


class Weibull(Section):
    """A Weibull distribution; shape 2 is Rayleigh's."""

    mean: float = Field(gt=0, le=40)
    shape: float = Field(default=2.0, gt=0.5, le=10)

    def climate(self) -> Climate:
        """The distribution."""
        return WindClimate(self.mean, self.shape, f"Weibull, mean {self.mean:g} m/s, shape {self.shape:g}")


class Table(Section):
    """A measured distribution."""

    speeds: list[float]
    probabilities: list[float]

    @model_validator(mode="after")
    def _a_distribution(self) -> Table:
        _said(self.climate)
        return self

    def climate(self) -> Climate:
        """The distribution; raises InputError where it is none."""
        return TableClimate(
            tuple(self.speeds), tuple(self.probabilities), f"a table of {len(self.speeds)} speeds"
        )


class ClimateSection(Section):
    """A climate that is no IEC class."""

    weibull: Weibull | None = None
    table: Table | None = None

    @model_validator(mode="after")
    def _one(self) -> ClimateSection:
        if (self.weibull is None) == (self.table is None):
            raise problem("must be one of `weibull` and `table`")
        return self

    def climate(self) -> Climate:
        """The distribution."""
        found = self.weibull or self.table
        assert found is not None, "checked when read"
        return found.climate()


def _said(make: Callable[[], Any]) -> None:
    """What refuses there becomes a problem of the file."""
    try:
        make()
    except InputError as error:
        raise problem(str(error)) from None


def _climate(value: Any) -> str | ClimateSection:
    if isinstance(value, str):
        _said(lambda: iec_climate(value))
        return value
    if isinstance(value, ClimateSection):
        return value
    if not isinstance(value, dict):
        raise problem(
            f"must be an IEC class (I, II, III), {{weibull: {{mean, shape}}}} or {{table: {{speeds, probabilities}}}}; got {value!r:.60}"
        )
    return ClimateSection.model_validate(value)


def _plain(value: str | ClimateSection) -> Any:
    return value if isinstance(value, str) else value.model_dump(exclude_none=True)


class BinsSection(Section):
    """Wind-speed bins, by their width around the winds or by their edges."""

    width: float | None = Field(default=None, gt=0, le=40)
    edges: list[float] | None = None

    @model_validator(mode="after")
    def _one(self) -> BinsSection:
        if (self.width is None) == (self.edges is None):
            raise problem("need one of `width` and `edges`")
        if self.edges is not None:
            edges = tuple(self.edges)
            _said(lambda: WindBins(edges))
        return self


class LifetimeSection(Section):
    """See the module's text."""

    climate: Annotated[str | ClimateSection, PlainValidator(_climate), PlainSerializer(_plain)]
    years: float = Field(default=20.0, gt=0, le=1000)
    n_eq: float = Field(default=1e7, gt=0)
    bins: BinsSection | None = None
    operating_range: list[float] | None = Field(default=None, min_length=2, max_length=2)
    availability: float = Field(default=1.0, gt=0, le=1)
    renormalise: bool = False
    confidence: float = Field(default=0.9, gt=0, lt=1)
    resamples: int = Field(default=1000, ge=100, le=100_000)

    @field_validator("operating_range")
    @classmethod
    def _a_range(cls, limits: list[float] | None) -> list[float] | None:
        if limits is not None and not 0 <= limits[0] < limits[1]:
            raise problem(f"must be [from, to] in m/s with from below to; got {limits}")
        return limits

    @property
    def distribution(self) -> Climate:
        """The climate."""
        return iec_climate(self.climate) if isinstance(self.climate, str) else self.climate.climate()

    def bins_of(self, speeds: Sequence[float]) -> WindBins:
        """The bins of winds of these mean speeds [m/s].

        Raises InputError where one is empty, where they overlap, or where they miss part of a stated operating range.
        """
        if self.bins is not None and self.bins.edges is not None:
            bins = WindBins(tuple(self.bins.edges))
            bins.check_filled(speeds)
        else:
            bins = WindBins.around(speeds, None if self.bins is None else self.bins.width)
        if self.operating_range is not None:
            check_covered(bins, self.operating_range)
        return bins


def check_covered(bins: WindBins, operating: Sequence[float]) -> None:
    """Refuse bins that miss part of the operating range [m/s]."""
    low, high = operating
    missed = [
        f"{a:g} to {b:g} m/s"
        for a, b in ((low, min(bins.low, high)), (max(bins.high, low), high))
        if b - a > 1e-6
    ]
    if missed:
        raise InputError(
            f"the bins reach from {bins.low:g} to {bins.high:g} m/s and miss {' and '.join(missed)} of the operating range; "
            f"add winds there, or say where the turbine turns: `operating_range: [{bins.low:g}, {bins.high:g}]`"
        )
