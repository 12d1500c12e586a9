"""What every wind source is: the base class and the register of kinds.

A new source is one file of this folder. In it stand

- a frozen dataclass derived from `WindSource` with a `kind`: its fields are the parameters of `make_wind(kind, ...)`, checked when it
  is made (`checks`), and it gives the abstract members below: a name, a mean speed, and cubics on uniform cells (`cells`);
- `on(rotor)`, where it depends on the turbine's size (`Rotor`: radius, hub height): the source with what was left open filled in
  from the turbine that it blows on. Whoever simulates calls it; a size that was given stays;
- for campaigns a `section.WindSection` with the same `kind`, which is what the file's `wind: type:` says: its keys as typed fields
  (`inputs.sweep.Sweep` for numbers that may be swept; a field without default must be given), its own checks, and `realisations(site)`,
  which gives a `Realisation` for every wind that the section means: id of its case, parameters as plain values, the keys it came from.

    class GustSection(WindSection):
        \"\"\"speeds   hub-height speeds before the gust [m/s]; a sweep\"\"\"
        kind = "gust"
        speeds: Sweep

        def realisations(self, site):
            for speed, piece in expand(self.speeds):
                yield Realisation(f"{speed_id(speed)}_gust", self.kind, (("speed", speed),), ("speeds", piece), speed)

Nothing else needs to know: `SOURCES`, campaigns, their errors with file and line, case ids, hashes and the contract tests find it.
"""

from __future__ import annotations

import inspect
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import cache, cached_property
from typing import Any, ClassVar, Self

import numpy as np

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.layout import WIND, Channel, harmonic_channels
from fatigue_runner.rotor import Rotor
from fatigue_runner.wind.cells import ROUNDING, cell_count, evaluate, minimum
from fatigue_runner.wind.checks import number
from fatigue_runner.wind.words import told_left_out

# kind -> what makes a source of its parameters; filled as the modules of this folder are imported.
SOURCES: dict[str, Callable[..., WindSource]] = {}


class WindSource(ABC):
    """Wind of one case in time: speed v [m/s], vertical and horizontal shear [-] (`channels.WIND_SIGNALS`), azimuthal harmonics [m/s].

    The local wind on the disc is v (1 + vertical_shear z/R + horizontal_shear y/R); a blade at azimuth psi feels
    sum c_m cos(m psi) + s_m sin(m psi) more. A subclass sets `kind`,
    gives the abstract members below, and `length` where the source has an end.
    """

    kind: ClassVar[str]

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "kind" in cls.__dict__:
            SOURCES[cls.kind] = cls

    def on(self, rotor: Rotor) -> Self:
        """The source as it blows on this rotor; itself where that makes no difference."""
        return self

    @property
    @abstractmethod
    def name(self) -> str:
        """Short, and fit for a file name; `label` has every parameter."""

    @property
    @abstractmethod
    def mean_speed(self) -> float:
        """Mean hub-height wind speed [m/s]; the speed at the start is `at(0)`."""

    @property
    def axial_speed(self) -> float:
        """Its part along the nacelle's axis [m/s], in which a run starts."""
        return self.mean_speed

    @property
    @abstractmethod
    def parameters(self) -> dict[str, Any]:
        """Plain values that describe the source, by the names of the results table where it has one."""

    @property
    @abstractmethod
    def cell_key(self) -> float | None:
        """Cell duration [s], None for constant signals. Winds with equal keys (or None) can share a block."""

    @property
    def harmonics(self) -> int:
        """M: azimuthal harmonics that the blades feel. 1: the two linear shears among the three signals; 0: not even these."""
        return 1

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The signals: three, signals of its own that the turbine's layout knows, and c_1, s_1, c_2, ... [m/s] of M > 1 harmonics
        (`wind.azimuth`), which act all along the blade."""
        return (*WIND, *harmonic_channels(self.harmonics))

    @property
    def signals(self) -> int:
        """Their number."""
        return len(self.channels)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences that whoever uses this wind should know."""
        return ()

    @property
    def description(self) -> str:
        """What blows, in words that hold for every seed and speed."""
        return f"{self.kind} wind"

    @property
    def strength(self) -> str:
        """What a point, the rotor's mean and a blade have of its turbulence, in words; empty for a wind without any."""
        return ""

    @property
    def left_out(self) -> str:
        """What it lacks of a wind over a rotor, in words."""
        return told_left_out(self.harmonics)

    @property
    def length(self) -> float:
        """Time [s] for which the source says something; infinite where the last value holds on."""
        return math.inf

    @abstractmethod
    def _cells(self, n_cells: int) -> np.ndarray:
        """The first n_cells cells, (n_cells, 4, n_signals); one cell where `cell_key` is None."""

    @property
    def label(self) -> dict[str, Any]:
        """The parameters that describe the source, for tables and logs; `wind_source` is its kind."""
        return {
            "wind_source": self.kind,
            "wind_speed": self.mean_speed,
            "harmonics": self.harmonics,
            **self.parameters,
        }

    def cells(self, duration: float) -> tuple[float, np.ndarray]:
        """(cell_duration [s], coefficients (n_cells, 4, n_signals)) for the time from 0 to `duration` [s].

        Raises InputError where the source is shorter than `duration`: it never repeats itself silently.
        """
        duration = number("duration", duration, above=0.0, unit=" s")
        self._refuse_beyond(duration)
        if self.cell_key is None:
            return max(duration, 1.0), self._cells(1)
        return self.cell_key, self._cells(cell_count(duration, self.cell_key))

    def at(self, time: Any) -> np.ndarray:
        """Signals (n, n_signals) at `time` (n,) [s]. Raises InputError outside the source's length."""
        time = np.atleast_1d(np.asarray(time, float))
        if not len(time):
            return np.empty((0, self.signals))
        if not (time.min() >= 0.0 and np.isfinite(time.max())):
            raise InputError(f"wind {self.name} has no value before 0 s or at a time that is not finite")
        self._refuse_beyond(time.max())
        # The cell that begins at the last time counts too: a step may fall on it.
        cell_duration = self.cell_key or max(float(time.max()), 1.0)
        n_cells = int(time.max() / cell_duration + ROUNDING) + 1 if self.cell_key else 1
        return evaluate(cell_duration, self._cells(n_cells), time)

    def _refuse_beyond(self, duration: float) -> None:
        if duration > self.length * (1 + ROUNDING):
            raise InputError(
                f"wind {self.name} is {self.length:g} s long but the run needs {duration:g} s; "
                f"make the wind at least {duration:g} s long or the run shorter"
            )

    @cached_property
    def lowest_speed(self) -> tuple[float, float]:
        """(least wind speed [m/s], its time [s]) over the source's length, between the samples too."""
        cell_duration, coefficients = self.cells(self.length if math.isfinite(self.length) else self._settled)
        return minimum(cell_duration, coefficients[:, :, 0])

    @property
    def _settled(self) -> float:
        """Time [s] after which a source without an end says nothing new."""
        return 1.0


def make_wind(kind: str, **parameters: Any) -> WindSource:
    """The wind source of that kind ('constant', 'turbulent', 'file', ...) with its parameters by name.

    Raises InputError, with the nearest known name, for an unknown kind or parameter and for a missing one.
    """
    if not isinstance(kind, str) or kind not in SOURCES:
        raise InputError(f"unknown wind source {kind!r}{did_you_mean(str(kind), SOURCES)}")
    known = _parameters(SOURCES[kind])
    for key in parameters:
        if key not in known:
            raise InputError(f"unknown parameter {key!r} of {kind} wind{did_you_mean(key, known)}")
    for key, parameter in known.items():
        if parameter.default is parameter.empty and key not in parameters:
            raise InputError(f"{kind} wind needs {key!r}; give it a value")
    return SOURCES[kind](**parameters)


@cache
def _parameters(source: type[WindSource]) -> Mapping[str, inspect.Parameter]:
    """By name; a campaign makes thousands of winds of one kind."""
    return inspect.signature(source).parameters
