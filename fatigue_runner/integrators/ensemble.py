"""The two nouns of a simulation: who integrates (`Integrator`), and what is integrated (`Ensemble`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.integrators.block import Block, make_block, run_block
from fatigue_runner.integrators.contract import Method
from fatigue_runner.integrators.methods import METHODS
from fatigue_runner.integrators.methods import method as find_method
from fatigue_runner.integrators.pitch import PitchSeries
from fatigue_runner.integrators.wind_steps import refuse_unresolved
from fatigue_runner.naming import integrator_id, integrator_label

if TYPE_CHECKING:
    from fatigue_runner.integrators.protocol import StepCorrector
    from fatigue_runner.trajectory import Trajectory
    from fatigue_runner.turbine import Turbine
    from fatigue_runner.wind import WindSource

Array = NDArray[np.float64]

ENHANCED, HYBRID = "enhanced", "hybrid"
MODES = (ENHANCED, HYBRID)


@dataclass(frozen=True)
class Integrator:
    """A method at a step [s], alone or with a learned corrector in a mode: `enhanced`, or `hybrid`, which guards it.

    Raises InputError for an unknown method or mode and for a step that is not positive.
    """

    method: str
    step: float
    corrector: StepCorrector | None = None
    mode: str = ENHANCED

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f"unknown method {self.method!r}{did_you_mean(self.method, METHODS)}")
        if not (self.step > 0 and np.isfinite(self.step)):
            raise InputError(f"step must be a positive number of seconds, got {self.step!r}")
        if self.mode not in MODES:
            raise InputError(f"unknown mode {self.mode!r}{did_you_mean(self.mode, MODES)}")

    @property
    def found(self) -> Method:
        """The method itself."""
        return find_method(self.method)

    @property
    def corrector_name(self) -> str:
        """Empty where there is none."""
        return "" if self.corrector is None else str(self.corrector.name)

    @property
    def corrected_mode(self) -> str:
        """The mode; empty without a corrector, where it means nothing."""
        return "" if self.corrector is None else self.mode

    @property
    def id(self) -> str:
        """Fit for a file name: `heun_10ms_hybrid_heun-10ms`."""
        return integrator_id(self.method, self.step, self.corrector_name, self.corrected_mode)

    @property
    def label(self) -> str:
        """As a person reads it: `heun 10 ms`, `heun-10ms, hybrid`."""
        return integrator_label(self.method, self.step, self.corrector_name, self.corrected_mode)


@dataclass(frozen=True, eq=False)
class Ensemble:
    """Cases of one turbine that share duration and output: n winds, each with its state at t = 0.

    initial (n, size of the turbine's layout); duration, output_step [s] (None: output at every step); pitch [rad]: a number or a
    PitchSeries, the same for all; load_type: of the kernel's load channels, float32 for half the memory. Winds need not share a time
    grid: `simulate` groups them. A wind that depends on the turbine's size
    is made for this one.
    Raises InputError where the shapes do not fit.
    """

    turbine: Turbine
    winds: Sequence[WindSource]
    initial: Array
    duration: float
    output_step: float | None = None
    pitch: float | PitchSeries = 0.0
    load_type: DTypeLike = np.float64

    def __post_init__(self) -> None:
        object.__setattr__(self, "winds", [wind.on(self.turbine.rotor) for wind in self.winds])

    def __len__(self) -> int:
        return len(self.winds)

    def part(self, chosen: Sequence[int]) -> Ensemble:
        """The cases of these numbers."""
        return replace(self, winds=[self.winds[i] for i in chosen], initial=self.initial[list(chosen)])

    def groups(self) -> list[list[int]]:
        """Numbers of the cases that may advance together: those whose winds share a time grid and have as many signals."""
        by_key: dict[Any, list[int]] = {}
        for i, wind in enumerate(self.winds):
            by_key.setdefault((wind.cell_key, self.turbine.layout.wind_size(wind.channels)), []).append(i)
        return list(by_key.values())


def simulate(ensemble: Ensemble, integrator: Integrator) -> list[Trajectory]:
    """One trajectory per case, in the order of the winds; a case's result does not depend on the others.

    The last step ends at or after the duration. Raises InputError for impossible numbers, for a corrector that does not fit and for a
    step that is too long for the harmonics of a wind.
    """
    e, found = ensemble, integrator.found
    shape = (len(e), e.turbine.layout.size)
    initial = np.asarray(e.initial, float)
    if initial.shape != shape:
        raise InputError(f"initial must have shape {shape}, one state per wind, got {initial.shape}")
    for wind, state in zip(e.winds, initial, strict=True):
        refuse_unresolved(e.turbine, wind, state, integrator.step)
    blocks: dict[bool, Block] = {}
    out: list[Any] = [None] * len(e)
    for chosen in e.groups():
        winds = [e.winds[i] for i in chosen]
        harmonics = e.turbine.layout.beyond(winds[0].channels)
        if harmonics not in blocks:
            blocks[harmonics] = make_block(
                e.turbine, found, integrator.step, e.duration, e.output_step, e.pitch, integrator.corrector, integrator.mode, harmonics,
                e.load_type,
            )  # fmt: skip
        runs = run_block(blocks[harmonics], winds, initial[chosen])
        for i, trajectory in zip(chosen, runs, strict=True):
            out[i] = trajectory
    return out


def warm_up(method: str = "heun") -> None:
    """Compile the kernels that `method` needs, or load them from the cache, before workers need them."""
    from fatigue_runner.turbine import load_turbine
    from fatigue_runner.wind import ConstantWind

    turbine = load_turbine("nrel5mw")
    initial = np.zeros((1, turbine.layout.size)) + 1e-3
    simulate(Ensemble(turbine, [ConstantWind(8.0)], initial, 0.02), Integrator(method, 0.01))
