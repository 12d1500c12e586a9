"""How often which wind blows: climates as distributions of the ten-minute mean speed, and the bins that share them out."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from fatigue_runner.errors import did_you_mean
from fatigue_runner.fatigue.checks import FatigueInputError, non_negative, positive

# Reference wind speed V_ref [m/s]; source: IEC 61400-1:2019, table 1. Class S is the designer's: it has no value here.
IEC_REFERENCE_SPEED = {"I": 50.0, "II": 42.5, "III": 37.5}
SAME = 1e-9  # relative; edges and spacings that agree to this are the same


class Climate(Protocol):
    """A distribution of the ten-minute mean wind speed at hub height."""

    @property
    def name(self) -> str:
        """In words, for tables and reports."""

    def exceedance(self, speed: Any) -> np.ndarray:
        """Probability that the wind speed [m/s] is exceeded, 1 - CDF; same shape as `speed`."""


@dataclass(frozen=True)
class WindClimate:
    """Weibull distribution by its mean [m/s] and shape (2 is Rayleigh)."""

    mean_speed: float
    shape: float = 2.0
    name: str = "Weibull"

    def __post_init__(self) -> None:
        positive("the mean wind speed", self.mean_speed)
        positive("the Weibull shape", self.shape)

    @property
    def scale(self) -> float:
        """Weibull scale [m/s], from the mean."""
        return self.mean_speed / math.gamma(1.0 + 1.0 / self.shape)

    def exceedance(self, speed: Any) -> np.ndarray:
        """Probability that the wind speed [m/s] is exceeded, 1 - CDF; same shape as `speed`."""
        return np.exp(-((np.maximum(np.asarray(speed, dtype=np.float64), 0.0) / self.scale) ** self.shape))


@dataclass(frozen=True)
class TableClimate:
    """A measured climate: the probability of the wind around each speed [m/s], uniform between the middles of neighbours.

    speeds rise; the first and the last class reach as far out as in. The probabilities may leave a rest to 1 (calms, gaps of
    the measurement): wind outside of the table has none.
    """

    speeds: tuple[float, ...]
    probabilities: tuple[float, ...]
    name: str = "measured"

    def __post_init__(self) -> None:
        v, p = (
            non_negative("speeds of a climate", self.speeds),
            non_negative("probabilities", self.probabilities),
        )
        if v.shape != p.shape or v.size < 2:
            raise FatigueInputError(
                f"a table of a climate needs two speeds or more and a probability for each, got {v.size} and {p.size}"
            )
        if (np.diff(v) <= 0.0).any():
            raise FatigueInputError(
                f"the speeds of a climate must rise; {v[int(np.argmin(np.diff(v))) + 1]:g} m/s does not"
            )
        if p.sum() > 1.0 + SAME:
            raise FatigueInputError(f"the probabilities of a climate sum to {p.sum():g}, more than 1")

    @cached_property
    def _edges(self) -> np.ndarray:
        v = np.asarray(self.speeds)
        middles = 0.5 * (v[1:] + v[:-1])
        return np.array([max(0.0, 2.0 * v[0] - middles[0]), *middles, 2.0 * v[-1] - middles[-1]])

    def exceedance(self, speed: Any) -> np.ndarray:
        """Probability that the wind speed [m/s] is exceeded; at 0 m/s the sum of the table."""
        below = np.concatenate([[0.0], np.cumsum(self.probabilities)])
        return np.asarray(below[-1] - np.interp(np.asarray(speed, dtype=np.float64), self._edges, below))


def iec_climate(wind_class: str) -> WindClimate:
    """Rayleigh climate of an IEC class, V_ave = 0.2 V_ref. Source: IEC 61400-1:2019, 6.3.2.1."""
    if wind_class == "S":
        raise FatigueInputError(
            "IEC class S has the climate that its designer states; give the mean and the shape of a Weibull distribution"
        )
    if wind_class not in IEC_REFERENCE_SPEED:
        raise FatigueInputError(
            f"unknown IEC wind class {wind_class!r}{did_you_mean(wind_class, IEC_REFERENCE_SPEED)}"
        )
    return WindClimate(0.2 * IEC_REFERENCE_SPEED[wind_class], name=f"IEC class {wind_class}")


@dataclass(frozen=True)
class WindBins:
    """Wind-speed bins that follow on each other: `edges` (n + 1,) [m/s], rising; a bin holds its lower edge."""

    edges: tuple[float, ...]

    def __post_init__(self) -> None:
        edges = non_negative("edges of wind bins", self.edges)
        if edges.size < 2 or (np.diff(edges) <= 0.0).any():
            raise FatigueInputError(
                f"the edges of wind bins must rise, two or more of them, got {list(self.edges)}"
            )

    @classmethod
    def around(cls, speeds: Sequence[float], width: float | None = None) -> WindBins:
        """Bins of one width [m/s] with a wind in the middle of each; without a width that of the winds' spacing.

        Raises FatigueInputError where bins would overlap, or where the winds leave one empty.
        """
        found = sorted({float(v) for v in speeds})
        if width is None:
            if len(found) < 2:
                raise FatigueInputError(
                    f"one wind speed ({found[0]:g} m/s) does not say how wide its bin is; give `bins: {{width: 2}}`"
                    if found
                    else "there is no wind"
                )
            width = min(b - a for a, b in itertools.pairwise(found))
        half = 0.5 * positive("the bin width", width)
        for low, high in itertools.pairwise(found):
            if high - low < width * (1.0 - SAME):
                raise FatigueInputError(
                    f"bins of {width:g} m/s overlap: winds of {low:g} and {high:g} m/s are {high - low:g} m/s apart; "
                    "take a smaller width, or give the bins by their `edges`"
                )
            if high - low > width * (1.0 + SAME):
                raise FatigueInputError(
                    f"there is no wind for {low + half:g} to {high - half:g} m/s between the bins of {width:g} m/s around {low:g} and "
                    f"{high:g} m/s; add a wind at {low + width:g} m/s, or give the bins by their `edges`"
                )
        if found[0] - half < -SAME:
            raise FatigueInputError(
                f"the bin around {found[0]:g} m/s reaches below 0 m/s; give the bins by their `edges`"
            )
        return cls((max(found[0] - half, 0.0), *(v + half for v in found)))

    @property
    def low(self) -> float:
        return self.edges[0]

    @property
    def high(self) -> float:
        return self.edges[-1]

    def __len__(self) -> int:
        return len(self.edges) - 1

    def places(self, speeds: Sequence[float]) -> list[int]:
        """The bin of every wind speed; the last edge belongs to the last bin. Raises FatigueInputError outside of all."""
        found = []
        for v in speeds:
            if not self.low * (1 - SAME) <= v <= self.high * (1 + SAME):
                raise FatigueInputError(
                    f"the wind of {v:g} m/s lies outside the bins from {self.low:g} to {self.high:g} m/s; remove it or widen them"
                )
            found.append(min(int(np.searchsorted(self.edges, v, side="right")) - 1, len(self) - 1))
        return found

    def check_filled(self, speeds: Sequence[float]) -> None:
        """Refuse bins without a wind."""
        filled = set(self.places(speeds))
        for i in range(len(self)):
            if i not in filled:
                raise FatigueInputError(
                    f"the bin from {self.edges[i]:g} to {self.edges[i + 1]:g} m/s has no wind; "
                    "add one there or join it with its neighbour"
                )

    def probabilities(self, climate: Climate) -> np.ndarray:
        """Probability of each bin (n,), from the distribution function; their sum is what they cover, not 1."""
        return -np.diff(climate.exceedance(np.asarray(self.edges)))


def bin_probabilities(climate: Climate, centres: Any, width: float) -> np.ndarray:
    """Probability of each wind-speed bin (n,), from the distribution function, not from the density.

    centres: (n,) [m/s], each bin reaching `width`/2 to both sides; their sum is what they cover, not 1.
    Raises FatigueInputError for bins that overlap, since their wind would count twice.
    """
    v, half = np.atleast_1d(non_negative("bin centres", centres)), 0.5 * positive("the bin width", width)
    gaps = np.diff(np.sort(v))
    if (gaps < 2.0 * half * (1.0 - SAME)).any():
        raise FatigueInputError(
            f"bins of width {width:g} m/s overlap: two centres are {gaps.min():g} m/s apart"
        )
    return climate.exceedance(v - half) - climate.exceedance(v + half)
