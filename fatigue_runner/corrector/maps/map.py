"""What every map is: the base class and the register of kinds."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.corrector.errors import CorrectorError
from fatigue_runner.errors import did_you_mean

if TYPE_CHECKING:
    from fatigue_runner.corrector.binding import Binding
    from fatigue_runner.corrector.guard import Guard
    from fatigue_runner.integrators.contract import Method
    from fatigue_runner.layout import Layout
    from fatigue_runner.trajectory import Trajectory
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

# kind -> its class; filled as the modules of this folder, and families with maps of their own, are imported
MAPS: dict[str, type[Map]] = {}


def place(bins: Sequence[float], speed: float) -> int:
    """Number of the bin nearest to a mean wind speed [m/s]; 0 where there are none."""
    return int(np.argmin(np.abs(np.array(bins) - speed))) if bins else 0


class Run(NamedTuple):
    """For which runs a map is made ready: pitch [rad], mean wind speed [m/s], whether the equations take azimuthal harmonics."""

    pitch: float = 0.0
    speed: float = 0.0
    harmonics: bool = False


class Sampled(Protocol):
    """n sampled steps as a kind of map sees them: beside what is its own, the plain results (n, states) and what they lack."""

    plain: Array

    @property
    def defect(self) -> Array: ...


class Map(ABC):
    """N of x+ = eta_h(x) + h^(p+1) N for one family of methods.

    A subclass is a frozen dataclass of arrays and names. It sets `kind`, the name in artefacts, and `methods`, the family of the methods
    that it is for (`Method.family`), and gives the abstract members below. `check` refuses what does not fit together; its sentences
    begin behind "corrector NAME: ". The compiled loop and `predict` must give the same defects: a test compares them step by step.
    """

    kind: ClassVar[str]
    methods: ClassVar[str]

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "kind" in cls.__dict__:
            MAPS[cls.kind] = cls

    @property
    @abstractmethod
    def layout(self) -> Layout:
        """The states and signals that it sees and gives."""

    # --- what the integrators ask, see integrators/protocol.py ---

    @property
    def history(self) -> int:
        return 0

    @property
    def past(self) -> int:
        return 0

    @property
    def damping(self) -> float:
        return 0.0

    @property
    def commands(self) -> bool:
        """Whether it sees what a controller commands within a step."""
        return False

    @property
    def bins(self) -> tuple[float, ...]:
        """Mean winds [m/s] for each of which there is a map; none: one for all."""
        return ()

    def bin_of(self, speed: float) -> int:
        """Number of the bin whose wind is nearest to a mean wind speed [m/s]."""
        return place(self.bins, speed)

    @abstractmethod
    def data(self, binding: Binding, turbine: Turbine, run: Run) -> NamedTuple:
        """The arrays that the compiled loop reads, scaled to the defect."""

    # --- its consistency ---

    @abstractmethod
    def check(self, method: Method, guard: Guard) -> None:
        """Raises CorrectorError where shapes, names or the guard do not fit the map and the method."""

    # --- its samples ---

    @abstractmethod
    def sample(
        self,
        binding: Binding,
        turbine: Turbine,
        winds: Sequence[Any],
        runs: Sequence[Trajectory],
        per_wind: int,
        seed: int,
    ) -> Sampled:
        """Steps from random places of accurate trajectories `runs` under `winds`; see `samples.output_step` for their sampling."""

    @abstractmethod
    def predict(self, sampled: Any, size: float) -> Array:
        """(n, states) defects of sampled steps, as the compiled loop computes them; size: h^(p+1)."""

    def reference_step(self, step: float) -> float:
        """Sampling [s] of the trajectories that `sample` needs for steps of `step` [s]."""
        return step

    # --- its file ---

    @abstractmethod
    def tensors(self) -> dict[str, Array]:
        """Arrays by their names in the artefact."""

    @abstractmethod
    def header(self) -> dict[str, Any]:
        """What the artefact's header says beside them: plain values."""

    @classmethod
    @abstractmethod
    def read(cls, header: Mapping[str, Any], tensors: Mapping[str, Array], layout: Layout) -> Self:
        """The map of a file. Raises KeyError for what is missing."""

    @property
    def sees(self) -> str:
        """What it sees, in words."""
        return self.kind

    def _sees_more(self, factors: Sequence[str]) -> str:
        """The same for a map that multiplies what it sees with `factors` and looks back."""
        by = f" x (1, {', '.join(factors)})" if factors else ""
        if self.bins:
            by += f", {len(self.bins)} maps for mean winds of {self.bins[0]:g} to {self.bins[-1]:g} m/s"
        looks = f", looks back {self.history} step(s)" if self.history else ""
        return self.kind + by + looks


def map_class(kind: str) -> type[Map]:
    """The class of this kind. Raises CorrectorError with the nearest known one."""
    if kind not in MAPS:
        raise CorrectorError(f"features {kind!r} do not exist{did_you_mean(kind, MAPS)}")
    return MAPS[kind]
