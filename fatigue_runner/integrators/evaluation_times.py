"""What one evaluation costs in processor time: of the equations of motion (f), and of a learned correction (N).

Cost is counted in these in arXiv:2504.05493 (`results.evaluation_cost`). Each is timed for one case alone, which takes a whole group of
lanes here, and per case where all lanes are filled. Inputs are those of an ensemble's cases at their start; a correction's features
belong to it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fatigue_runner.compiled import LEAN, njit
from fatigue_runner.integrators.block import make_block
from fatigue_runner.integrators.choice import compiled_for
from fatigue_runner.integrators.contract import Lanes
from fatigue_runner.integrators.corrected import CorrectedArrays
from fatigue_runner.integrators.correction import correction
from fatigue_runner.integrators.ensemble import Ensemble, Integrator
from fatigue_runner.integrators.exponential_steps import ExponentialAdamsArrays, learned_products
from fatigue_runner.integrators.pitch import PitchSeries
from fatigue_runner.integrators.signals import PitchCells, Signals, signals_at
from fatigue_runner.integrators.step_ladder import LadderArrays
from fatigue_runner.integrators.stepper import Ring, room
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.lanes import aligned, counters, to_groups
from fatigue_runner.turbine.model import rhs
from fatigue_runner.wind import stack_cells

GROUPS = 16  # of lanes that are evaluated one after the other, as in a block
ROUNDS = 51
LASTING = 5e-4  # s that a timed piece takes at least, far above the clock's grain
SHORT = 1.0  # s of wind, so that no long series is unpacked

F = "f"  # its name beside those of correctors
SINGLE, LANE = "single", "lane"

Pieces = dict[str, Callable[[], float]]

_correction: Any = correction  # untyped compiled code


class _Ready(NamedTuple):
    """A group of lanes as the compiled code takes it."""

    method: Any
    model: Any
    step: float
    signals: Signals
    ring: Ring
    data: Any


def learned(method: Any, model: Any, h: float, signals: Signals, data: Any, ring: Ring) -> None:
    """The learned part of one step from ring.current. Stub; see `choice`."""
    raise NotImplementedError("compiled code only")


@compiled_for(learned, CorrectedArrays)
@njit(**LEAN)
def _of_stages(method: Any, model: Any, h: float, signals: Signals, data: Any, ring: Ring) -> None:
    own = method.room
    _correction(
        method.learned, model, ring.current, ring.k, method.stage_rows, h, own.start, own.middle, signals.p, own.seen, own.hidden,
        own.defect,
    )  # fmt: skip


@compiled_for(learned, LadderArrays)
@compiled_for(learned, ExponentialAdamsArrays)
@njit(**LEAN)
def _of_earlier_values(method: Any, model: Any, h: float, signals: Signals, data: Any, ring: Ring) -> None:
    learned_products(model, method, h, signals, data, ring)


@njit(**LEAN)
def _evaluate(repeats: int, model: Any, signals: Signals, ring: Ring, data: Any) -> None:
    for _ in range(repeats):
        ring.current[0] += 1e-12  # another input, so that nothing may be kept from one evaluation to the next
        rhs(model, ring.current, signals.p, signals.u, ring.slope, 0, data)


@njit(**LEAN)
def _correct(
    repeats: int, method: Any, model: Any, h: float, signals: Signals, data: Any, ring: Ring
) -> None:
    for _ in range(repeats):
        ring.current[0] += 1e-12
        learned(method, model, h, signals, data, ring)


@njit(**LEAN)
def _fill(model: Any, signals: Signals, ring: Ring, data: Any) -> None:
    """All slopes of the ring are that of its state under the signals at time 0."""
    signals_at(model, 0.0, signals)
    rhs(model, ring.current, signals.p, signals.u, ring.slope, 0, data)
    for i in range(ring.k.shape[0]):
        for m in range(len(ring.slope)):
            ring.k[i, m] = ring.slope[m]


def evaluation_times(
    ensemble: Ensemble, integrators: Sequence[Integrator] = (), rounds: int = ROUNDS
) -> dict[str, dict[str, float]]:
    """{`f` or the name of a corrector: {`single`, `lane`: seconds of one evaluation}}, medians of rounds in which each takes its turn.

    single: for one case alone; lane: per case of many. Raises what preparing the integrators raises.
    """
    work: dict[tuple[str, str], Callable[[], float]] = {}
    found = {F: _of_f(ensemble)}
    for i in integrators:
        if i.corrector is not None and i.corrector_name not in found:
            found[i.corrector_name] = _of_correction(ensemble, i)
    for name, pieces in found.items():
        work |= {(name, kind): piece for kind, piece in pieces.items()}
    times: Mapping[tuple[str, str], list[float]] = {key: [] for key in work}
    for _ in range(rounds):
        for key, piece in work.items():
            times[key].append(piece())
    return {
        name: {kind: float(np.median(times[name, kind])) for kind in pieces} for name, pieces in found.items()
    }


def _of_f(ensemble: Ensemble) -> Pieces:
    groups = _groups(ensemble, Integrator("heun", min(0.01, ensemble.duration)))

    def run(repeats: int, group: _Ready) -> None:
        _evaluate(repeats, group.model, group.signals, group.ring, group.data)

    return _pieces(run, groups)


def _of_correction(ensemble: Ensemble, integrator: Integrator) -> Pieces:
    groups = _groups(ensemble, integrator)

    def run(repeats: int, group: _Ready) -> None:
        _correct(repeats, group.method, group.model, group.step, group.signals, group.data, group.ring)

    return _pieces(run, groups)


def _pieces(run: Callable[[int, _Ready], None], groups: Sequence[_Ready]) -> Pieces:
    """Timed pieces of work that return seconds per evaluation: of one group again and again, and of a case where all take turns."""
    for group in groups:
        run(1, group)  # compiled, or loaded
    repeats = 8
    while True:
        begin = time.perf_counter()
        run(repeats, groups[0])
        if time.perf_counter() - begin > LASTING:
            break
        repeats *= 2

    def timed(chosen: Sequence[_Ready], each: int) -> float:
        begin = time.thread_time()
        for group in chosen:
            run(each, group)
        return (time.thread_time() - begin) / (each * len(chosen))

    few = max(1, repeats // len(groups))
    return {SINGLE: lambda: timed(groups[:1], repeats), LANE: lambda: timed(groups, few) / LANES}


def _groups(ensemble: Ensemble, integrator: Integrator) -> list[_Ready]:
    """Full groups of lanes of an ensemble's cases, again and again the same where there are few, ready to step."""
    e = ensemble
    chosen = e.groups()[0]
    numbers = [chosen[i % len(chosen)] for i in range(GROUPS * LANES)]
    winds, layout = [e.winds[i] for i in numbers], e.turbine.layout
    duration = min(e.duration, SHORT)
    short = replace(e, duration=duration)
    block = make_block(
        e.turbine, integrator.found, min(integrator.step, duration), duration, None, e.pitch, integrator.corrector, integrator.mode,
        layout.beyond(winds[0].channels),
    )  # fmt: skip
    layout, control = block.data.model.layout, None
    if isinstance(e.pitch, PitchSeries):
        control = PitchCells(*e.pitch.cells(e.turbine.pitch_range, block.steps * block.step))
    cell_duration, cells = stack_cells(winds, float(block.plan.time[-1]), layout)
    states = to_groups(np.ascontiguousarray(short.initial[numbers].T))
    blown = to_groups(cells.reshape(-1, len(winds))).reshape(len(states), len(cells), 4, -1)
    out = []
    for number, (x, own) in enumerate(zip(states, blown, strict=True)):
        p, u = np.zeros(own.shape[2]), np.zeros(len(layout.control) * LANES)
        signals = Signals(cell_duration, aligned(own), True, control, aligned(p), aligned(u))
        here = winds[number * LANES : (number + 1) * LANES]
        lanes = Lanes(x, signals, tuple(wind.mean_speed for wind in here))
        method = block.prepared.arrays(lanes, aligned)
        ring = room(x, block.prepared.slopes, 1 << (layout.size - 1).bit_length(), aligned)
        ready = _Ready(
            method, block.data.model, block.step, signals, ring, block.data.arrays(aligned(counters()))
        )
        _fill(ready.model, signals, ring, ready.data)
        out.append(ready)
    return out
