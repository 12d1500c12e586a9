"""Run a block of cases that share turbine, method, step and pitch: winds in, trajectories out."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.errors import InputError
from fatigue_runner.integrators.methods import method as find_method
from fatigue_runner.integrators.output import OutputPlan, plan_output
from fatigue_runner.trajectory import Trajectory

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]


def simulate_block(
    turbine: Turbine,
    method: str,
    step: float,
    winds: Sequence[Any],
    initial: Array,
    duration: float,
    output_step: float | None = None,
    pitch: float = 0.0,
) -> list[Trajectory]:
    """Simulate n cases in lockstep, SIMD across cases; a case's result does not depend on the others.

    step, duration, output_step [s] (None: output at every step); winds: n wind sources; initial (n, 16); pitch [rad].
    The last step ends at or after `duration`. Raises InputError for impossible numbers.
    """
    tableau = find_method(method)
    for name, value in (("step", step), ("duration", duration), ("output step", output_step)):
        if value is not None and not (value > 0 and np.isfinite(value)):
            raise InputError(f"{name} must be a positive number of seconds, got {value}")
    initial = np.asarray(initial, float)
    if initial.shape != (len(winds), 16):
        raise InputError(
            f"initial must have shape ({len(winds)}, 16), one state per wind, got {initial.shape}"
        )
    steps = int(np.ceil(duration / step - 1e-9))
    plan = plan_output(duration, step, steps, output_step, tableau.order)
    return _run(turbine, tableau, step, steps, winds, initial, plan, pitch)


def _run(turbine, tableau, step, steps, winds, initial, plan: OutputPlan, pitch) -> list[Trajectory]:
    from fatigue_runner.integrators.stepping import runge_kutta
    from fatigue_runner.turbine.generated.kernel import LANES
    from fatigue_runner.turbine.lanes import to_groups, work_space
    from fatigue_runner.wind import stack_cells

    data = turbine.kernel_data(pitch)
    cell_duration, cells = stack_cells(winds, float(plan.time[-1]))
    changing = bool(np.any(cells[:, 1:])) or len(cells) > 1
    groups = to_groups(np.ascontiguousarray(initial.T))
    # one group's cells: (n_cells, 4, 3 * LANES)
    blocks = to_groups(cells.reshape(-1, len(winds))).reshape(len(groups), len(cells), 4, -1)
    out: list[Trajectory] = []
    method_data = (*tableau.arrays(), tableau.first_same_as_last)
    plan_data = (plan.step, plan.exact, plan.position, plan.velocity)
    for group, (x, wind_cells) in enumerate(zip(groups, blocks, strict=True)):
        scratch, row, clamped = work_space()
        model = (data.tables, data.cells, data.constants, scratch, row)
        rows = np.empty((len(plan.time), 16 * LANES))
        errors = np.full((len(plan.time) - 1, LANES), np.nan)
        diverged_at = np.full(LANES, -1.0)
        wind_data = (cell_duration, np.ascontiguousarray(wind_cells), changing)
        start = time.perf_counter()
        runge_kutta(
            x.copy(),
            method_data,
            step,
            steps,
            wind_data,
            model,
            plan_data,
            rows,
            errors,
            diverged_at,
            clamped,
        )
        wall = time.perf_counter() - start
        lanes = min(LANES, len(winds) - group * LANES)
        states = np.ascontiguousarray(rows.reshape(-1, 16, LANES).transpose(2, 0, 1)[:lanes])
        for lane in range(lanes):
            out.append(
                _trajectory(
                    turbine, winds[group * LANES + lane], states[lane], errors[:, lane], plan.time, pitch,
                    float(diverged_at[lane]), wall / lanes, steps, tableau.evaluations_per_step * steps + 1,
                    int(clamped[lane]),
                )
            )  # fmt: skip
    return out


def _trajectory(
    turbine, wind, state, error, time_points, pitch, diverged_at, wall, steps, evaluations, clamped
) -> Trajectory:
    n = len(time_points)
    if diverged_at >= 0:
        n = max(int(np.searchsorted(time_points, diverged_at)), 1)
    # copies: a slice would keep the whole block's memory alive
    time_points, state, error = time_points[:n].copy(), state[:n].copy(), error[: n - 1].copy()
    signals = wind.at(time_points)
    return Trajectory(
        time=time_points,
        state=state,
        wind=signals,
        loads=turbine.loads(state, signals, pitch),
        accepted=np.ones(n - 1, bool),
        discrepancy=np.full(n - 1, np.nan),
        threshold=np.full(n - 1, np.nan),
        local_error=error,
        steps=steps,
        evaluations=evaluations,
        clamped_lookups=clamped,
        wall_time=wall,
        diverged_at=diverged_at if diverged_at >= 0 else None,
    )


def warm_up() -> None:
    """Compile the kernels, or load them from the cache, before workers need them."""
    from fatigue_runner.turbine import load_turbine
    from fatigue_runner.wind import ConstantWind

    simulate_block(load_turbine("nrel5mw"), "heun", 0.01, [ConstantWind(8.0)], np.zeros((1, 16)) + 1e-3, 0.02)
