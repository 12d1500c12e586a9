"""Cost of one evaluation of the equations of motion: packed over lanes, scalar, and as a share of the machine's peak.

Times are CPU times of one pinned thread: the wall time on an idle machine, and unharmed by what else runs on a busy one.
"""

from __future__ import annotations

import ast
import time
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np

from fatigue_runner.benchmark.speed import machine, right_hand_side
from fatigue_runner.layout import harmonic_channels
from fatigue_runner.turbine.generated import kernel as collective
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.turbine import CONTROLLED

CASES = (1, 8, 16, 64, 256)
STEP_METHODS = ("heun", "rk3", "rk4", "tsit5", "dop853", "ab4", "abm4", "etdrk4", "etdabm3")
OPERATED, HARMONICS = (4.0, 24.0), 3  # m/s and azimuthal harmonics of the winds of a turbine that operates
LOOKUP_OPERATIONS = 6  # of one cubic: three multiplications and three additions


def operations(generated: ModuleType = collective) -> int:
    """Floating-point operations of one evaluation for one case, counted in the kernel's source; a division or root is one."""
    counter = _Operations()
    counter.visit(ast.parse(right_hand_side.source(generated)))
    return counter.count + LOOKUP_OPERATIONS * right_hand_side.look_ups(generated)


class _Operations(ast.NodeVisitor):
    """Counts arithmetic outside of indices."""

    def __init__(self) -> None:
        self.count = 0

    def visit_Subscript(self, node: ast.Subscript) -> None:
        pass

    def visit_BinOp(self, node: ast.BinOp) -> None:
        self.count += 1
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        self.count += 1
        self.generic_visit(node)


def _work(
    run: Callable[..., None],
    turbine: Any,
    cases: int,
    lanes: int,
    pitched: bool = False,
    speeds: tuple[float, float] = (5.0, 10.0),
    harmonics: int = 0,
) -> Callable[[], float]:
    """A piece of work that returns nanoseconds per evaluation and case; one group after the other, as in a simulation.

    pitched: every case has a pitch of its own, 0 to 8 degrees; speeds: slowest and fastest wind [m/s]; harmonics: azimuthal ones,
    0.3 m/s each.
    """
    groups, winds = -(-cases // lanes), np.linspace(*speeds, 16)
    points, signals = [turbine.operating_point(v) for v in winds], harmonic_channels(harmonics)
    x = np.empty((groups, turbine.layout.size, lanes))
    wind = np.zeros((groups, turbine.layout.wind_size(signals), lanes))
    wind[:, turbine.layout.wind_rows(signals)] = 0.3
    pitch = np.zeros((groups, 1, lanes))
    for i in range(groups * lanes):
        x[i // lanes, :, i % lanes] = points[i % 16]
        wind[i // lanes, 0, i % lanes] = winds[i % len(winds)]
        pitch[i // lanes, 0, i % lanes] = np.radians(i % 16 / 2)
    arguments = right_hand_side.arguments(turbine, x[:16], wind[:16], pitch[:16] if pitched else None)
    repeats = max(1, 16000 // groups // max(1, lanes // 2))

    def once() -> float:
        begin = time.thread_time()
        for group in range(groups):
            run(repeats, *arguments[group % 16])
        return (time.thread_time() - begin) / repeats / cases * 1e9

    return once


def one_evaluation(turbine: Any, cases: int = CASES[-1]) -> Callable[[], float]:
    """A piece of work that returns nanoseconds per evaluation and case of the turbine's packed kernel."""
    return _work(right_hand_side.packed_of(turbine), turbine, cases, LANES)


def in_operation(turbine: Any, cases: int = CASES[-1]) -> Callable[[], float]:
    """The same of the turbine under its controller, below and above rated, with azimuthal harmonics."""
    operated = turbine.operated(CONTROLLED)
    run = right_hand_side.packed_of(operated, harmonics=True)
    return _work(run, operated, cases, LANES, speeds=OPERATED, harmonics=HARMONICS)


def peak() -> Callable[[], float]:
    """A piece of work that returns this machine's rate of fused multiply-adds in full vectors [flop/ns]."""
    import numba
    from llvmlite import ir
    from numba.core import cgutils, types
    from numba.extending import intrinsic

    width, chains = machine.describe()["vector_bits"] // 64, 12

    @intrinsic
    def multiply_adds(typing_context: Any, rounds: Any, start: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            vector = ir.VectorType(ir.DoubleType(), width)
            splat = builder.insert_element(ir.Constant(vector, ir.Undefined), args[1], ir.IntType(32)(0))
            zero = ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width)
            factor = builder.shuffle_vector(splat, splat, zero)
            slots = [cgutils.alloca_once_value(builder, factor) for _ in range(chains)]
            with cgutils.for_range(builder, args[0]):
                for slot in slots:
                    product = builder.fmul(builder.load(slot), factor, flags=("contract",))
                    builder.store(builder.fadd(product, factor, flags=("contract",)), slot)
            total = builder.load(slots[0])
            for slot in slots[1:]:
                total = builder.fadd(total, builder.load(slot))
            return builder.extract_element(total, ir.IntType(32)(0))

        return types.float64(types.int64, types.float64), codegen

    @numba.njit(nogil=True)
    def run(rounds: int, start: float) -> float:
        return multiply_adds(rounds, start)  # type: ignore[call-arg]

    run(1, 0.5)

    def once() -> float:
        rounds = 200_000
        begin = time.thread_time()
        run(rounds, 0.5)
        return rounds * chains * width * 2 / ((time.thread_time() - begin) * 1e9)

    return once


def whole_steps(
    turbine: Any,
    method: str,
    step: float = 0.01,
    duration: float = 4.0,
    output_step: float = 0.02,
    harmonics: int = 1,
) -> Callable[[], float]:
    """A whole simulation of 16 turbulent cases with output: nanoseconds per evaluation and case, everything included."""
    from fatigue_runner.integrators import Ensemble, Integrator, simulate
    from fatigue_runner.wind import TurbulentWind

    winds = [
        TurbulentWind(8.0, intensity=0.14, seed=seed, duration=duration, harmonics=harmonics)
        for seed in range(16)
    ]
    initial = np.repeat(turbine.operating_point(8.0)[None], 16, axis=0)
    ensemble, integrator = Ensemble(turbine, winds, initial, duration, output_step), Integrator(method, step)

    def once() -> float:
        block = simulate(ensemble, integrator)
        return sum(t.wall_time for t in block) / sum(t.evaluations for t in block) * 1e9

    return once


def measure(repeats: int = 15, turbine_name: str = "nrel5mw") -> dict[str, Any]:
    """All figures of `fatigue-runner benchmark kernel` as plain values; times in ns per evaluation and case."""
    from fatigue_runner.turbine import load_turbine

    turbine = load_turbine(turbine_name)
    packed, scalar = right_hand_side.packed(), right_hand_side.scalar()
    work = {f"packed {n}": _work(packed, turbine, n, LANES) for n in CASES}
    work |= {f"scalar {n}": _work(scalar, turbine, n, 1) for n in CASES}
    work["own edges"] = one_evaluation(load_turbine("nrel5mw_edges"))
    work["operation"] = in_operation(turbine)
    work["pitched"] = _work(right_hand_side.varying(), turbine, CASES[-1], LANES, pitched=True)
    work |= {f"step {name}": whole_steps(turbine, name) for name in STEP_METHODS}
    work["peak"] = peak()
    with machine.pinned():
        found = machine.interleaved(work, repeats)
    flops, best = operations(), found["packed 256"]["median"]
    rate = found["peak"]["median"]
    rows = [
        {
            "cases": n,
            "packed": found[f"packed {n}"],
            "scalar": found[f"scalar {n}"],
            "ratio": found[f"scalar {n}"]["median"] / found[f"packed {n}"]["median"],
        }
        for n in CASES
    ]
    steps = [
        {
            "method": m,
            "whole_step": found[f"step {m}"],
            "over_kernel": found[f"step {m}"]["median"] / best - 1,
        }
        for m in STEP_METHODS
    ]
    return {
        "machine": machine.describe(),
        "lanes": LANES,
        "turbine": turbine.name,
        "operations_per_evaluation": flops,
        "peak_flop_per_ns": rate,
        "share_of_peak": flops / best / rate,
        "cases": rows,
        "varying_pitch": found["pitched"],
        "operation": {
            "time": found["operation"],
            "ratio": found["operation"]["median"] / best,
            "harmonics": HARMONICS,
        },
        "own_edges": {"time": found["own edges"], "ratio": found["own edges"]["median"] / best},
        "whole_steps": steps,
    }
