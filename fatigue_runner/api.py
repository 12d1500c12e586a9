"""What `import fatigue_runner as fr` offers."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fatigue_runner.campaign import run_campaign
from fatigue_runner.errors import FatigueRunnerWarning, InputError, did_you_mean
from fatigue_runner.fatigue import damage_equivalent_load, rainflow
from fatigue_runner.integrators.initial import INITIAL_STATES, initial_state
from fatigue_runner.integrators.pitch import PitchSeries, first_pitch
from fatigue_runner.results.told_life import lifetime
from fatigue_runner.turbine import load_turbine
from fatigue_runner.values import unmasked
from fatigue_runner.wind import (
    ConstantWind,
    FullFieldWind,
    GustWind,
    MisalignedWind,
    SeriesWind,
    StepWind,
    TowerInfluence,
    TurbulentWind,
    WindSource,
)

if TYPE_CHECKING:
    from fatigue_runner.trajectory import Trajectory

__all__ = [
    "ConstantWind",
    "FullFieldWind",
    "GustWind",
    "MisalignedWind",
    "PitchSeries",
    "SeriesWind",
    "StepWind",
    "TowerInfluence",
    "TurbulentWind",
    "correctors",
    "damage_equivalent_load",
    "lifetime",
    "load_turbine",
    "rainflow",
    "run_campaign",
    "section_loads",
    "simulate",
]


MOST_PITCH = math.pi / 2  # feathered


def simulate(
    turbine: Any,
    wind: WindSource | float,
    method: str = "rk4",
    step: float = 0.01,
    duration: float = 60.0,
    initial: str | Any = "operating-point",
    output_step: float | None = None,
    pitch: float | PitchSeries = 0.0,
    corrector: Any = None,
    mode: str = "hybrid",
    operation: str = "fixed",
) -> Trajectory:
    """Simulate one case and return its trajectory.

    turbine: of `load_turbine`, or a name for it; wind: a wind source, or a constant speed [m/s]; step,
    duration [s]; initial: "operating-point", "paper", "paper-spinning" or a state; output_step [s]:
    None samples every step, else the solution is interpolated; pitch [rad]: a number, or a PitchSeries for a
    pitch that varies in time (a campaign file has degrees). A case that diverges ends early, with a warning: see `diverged_at`.
    corrector: a name of `correctors()`, a path or a Corrector; mode: "hybrid", which guards it, or "enhanced".
    operation: "fixed" holds the pitch, "controlled" has the turbine's controller, "torque-law" its torque at fine pitch. Raises InputError
    for an unknown method or turbine, a step that is not positive, a malformed state, a controller that makes the turbine unstable and
    aerodynamic tables that end below the pitch which the wind needs.
    """
    from fatigue_runner.integrators import Ensemble, Integrator
    from fatigue_runner.integrators import simulate as run
    from fatigue_runner.turbine.envelope import check_wind
    from fatigue_runner.turbine.loop import check_loop

    if isinstance(turbine, str):
        turbine = load_turbine(turbine)
    turbine = turbine.operated(operation)
    if operation != "fixed" and (isinstance(pitch, PitchSeries) or pitch):
        raise InputError(
            f"operation {operation!r} makes the pitch itself; give none, or use operation='fixed'"
        )
    if isinstance(pitch, int | float) and abs(pitch) > MOST_PITCH:
        raise InputError(
            f"pitch is in rad: {pitch:g} rad are {math.degrees(pitch):.0f} deg; give math.radians({pitch:g})"
        )
    if isinstance(wind, int | float):
        wind = ConstantWind(float(wind))
    for name, value in (("step", step), ("duration", duration), ("output_step", output_step)):
        if value is not None and not value > 0:
            raise InputError(f"{name} must be above 0 s, got {value!r}")
    if corrector is not None:
        from fatigue_runner.corrector import find

        corrector = find(corrector)
    integrator = Integrator(method, step, corrector, mode)
    wind = wind.on(turbine.rotor)
    check_loop(turbine)
    check_wind(turbine, wind.mean_speed)
    start = _state(turbine, initial, wind, first_pitch(pitch))
    trajectory = run(Ensemble(turbine, [wind], start[None, :], duration, output_step, pitch), integrator)[0]
    if trajectory.diverged_at is not None:
        warnings.warn(
            f"{integrator.label} diverged at {trajectory.diverged_at:.4g} s of {duration:g} s: the trajectory ends there, and "
            "cycles of its loads are no fatigue; take a smaller step",
            FatigueRunnerWarning,
            stacklevel=2,
        )
    return trajectory


def section_loads(
    turbine: Any,
    trajectory: Trajectory,
    tower_heights: Sequence[float] = (),
    blade_radii: Sequence[float] = (),
    root_directions: int = 0,
    operation: str = "fixed",
) -> dict[str, np.ndarray]:
    """Bending moments [N m] of sections along tower and blade 1 in a trajectory, {channel: (n,)}.

    turbine, operation: those of the trajectory, as for `simulate`; tower_heights [m] above the tower's foot: fore-aft and side-side;
    blade_radii [m] from the rotor's apex: flapwise and edgewise; root_directions: moment of the blade's root by direction, as many over
    half a circle. Of a trajectory or of a log that was read.
    Raises InputError for a place off tower or blade, a turbine without blade elements, and another operation's trajectory.
    """
    from fatigue_runner.turbine.section_loads import SectionLoads

    turbine = (load_turbine(turbine) if isinstance(turbine, str) else turbine).operated(operation)
    names = [channel.name for channel in trajectory.states]
    if names != list(turbine.layout.names):
        raise InputError(
            f"the trajectory is not one of turbine {turbine.name} with operation {operation!r}: it has {len(names)} states, "
            f"that has {turbine.layout.size}; give the turbine and the operation that it was simulated with"
        )
    made = SectionLoads.of_turbine(turbine, tower_heights, blade_radii, root_directions)
    loads = trajectory.loads
    return made.of(turbine, trajectory.state, trajectory.wind, loads, loads["blade_pitch"], trajectory.winds)


def correctors() -> list[Any]:
    """The shipped correctors, which print as a table: .name, .turbine, .turbine_hash, .method, .step [s], .validation, ..."""
    from fatigue_runner.corrector import correctors as shipped

    return shipped()


def _state(turbine: Any, initial: Any, wind: WindSource, pitch: float) -> np.ndarray:
    if isinstance(initial, str):
        if initial not in INITIAL_STATES:
            raise InputError(f"unknown initial state {initial!r}{did_you_mean(initial, INITIAL_STATES)}")
        return initial_state(turbine, initial, wind, pitch)
    state, size = np.asarray(unmasked("initial", initial), dtype=np.float64), turbine.layout.size
    if state.shape != (size,) or not np.isfinite(state).all():
        raise InputError(f"initial must be a state of {size} finite numbers, got shape {state.shape}")
    return state
