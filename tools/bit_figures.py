"""The figures that `equal_bits.py` compares, from the package that is imported: `python tools/bit_figures.py TREE OUT PATTERN`.

A figure is a name and a function that returns {part: array or text}. Only names that outlive a rebuilt inside are used, so that the
file runs on old and new trees alike. One line of JSON per figure on the standard output, its arrays in OUT.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import sys
import time
from collections.abc import Callable, Iterator
from fnmatch import fnmatchcase
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from revisions import check_import

import fatigue_runner as fr

Parts = dict[str, Any]
Figure = tuple[str, Callable[[], Parts]]

# about half the stability limit on nrel5mw [s]; a method that is not listed takes the smallest
STEPS = {
    **{"euler": 0.002, "heun": 0.015, "rk3": 0.04, "heun-richardson": 0.05, "bs32": 0.04, "rk4": 0.06},
    **{"dp5": 0.05, "tsit5": 0.05, "rk7": 0.1, "dop853": 0.12, "ab4": 0.008, "abm4": 0.018},
    **{"etdrk4": 0.1, "etdabm3": 0.05, "etdabm4": 0.05},
}
STATUS = ("time", "state", "wind", "accepted", "discrepancy", "threshold", "local_error")
COUNTS = ("steps", "evaluations", "clamped_lookups", "diverged_at")
# what only names a row, and what a clock says
NOT_FIGURES = {"case_id", "wind_source", "method", "corrector", "mode", "error_message"}
NOT_FIGURES |= {"wall_time", "evaluations_per_second"}


@cache
def turbine(name: str = "nrel5mw") -> Any:
    return fr.load_turbine(name)


# the wind that older trees have: its mean and linear shears
LINEAR: dict[str, Any] = (
    {"harmonics": 1} if "harmonics" in inspect.signature(fr.TurbulentWind).parameters else {}
)


def turbulent(duration: float, seed: int = 1, mean: float = 8.0) -> Any:
    # with the sizes that older trees assume for every turbine
    sizes: Any = {"rotor_radius": 63.0, "hub_height": 90.0, **LINEAR}
    return fr.TurbulentWind(mean, intensity=0.14, seed=seed, duration=duration, **sizes)


def trajectory_parts(trajectory: Any, prefix: str = "") -> Parts:
    """All figures of a trajectory or log; None, of a case that did not diverge, as NaN."""
    parts = {name: getattr(trajectory, name) for name in (*STATUS, *COUNTS)}
    parts["diverged_at"] = np.nan if parts["diverged_at"] is None else parts["diverged_at"]
    parts |= {f"loads {name}": values for name, values in trajectory.loads.items()}
    return {prefix + name: values for name, values in parts.items()}


def simulated(name: str = "nrel5mw", wind: Any = 8.0, must_diverge: bool = False, **options: Any) -> Parts:
    trajectory = fr.simulate(turbine(name), wind, **options)
    if (trajectory.diverged_at is not None) != must_diverge:
        raise AssertionError(f"diverged at {trajectory.diverged_at}: the figure does not show what it should")
    return trajectory_parts(trajectory)


def turbine_figures() -> Iterator[Figure]:
    def right_hand_side(name: str) -> Parts:
        rng, model = np.random.Generator(np.random.PCG64(1)), turbine(name)
        x = model.operating_point(8.0)[:, None] + rng.normal(0, 0.1, (16, 1003))
        signals = rng.uniform([5, -0.3, -0.3], [12, 0.3, 0.3], (1003, 3))
        angles = rng.uniform(-0.05, 0.3, 1003)
        parts: Parts = {}
        for what, pitch in (("pitch 0", 0.0), ("pitch 0.07", 0.07), ("own pitch", angles)):
            parts[f"rhs, {what}"] = model.rhs(x, *signals.T, pitch=pitch)
            loads = model.loads(x.T, signals, pitch)
            parts |= {f"{channel}, {what}": values for channel, values in loads.items()}
        return parts

    def modes(name: str) -> Parts:
        found = turbine(name).natural_frequencies(8.0)
        return {"names": ",".join(f[0] for f in found), "values": np.array([f[1:] for f in found])}

    def points(name: str) -> Parts:
        at: list[dict[str, float]] = [{"wind": v} for v in (5.0, 8.0, 10.5)]
        at += [{"wind": 8.0, "vertical_shear": 0.1, "horizontal_shear": -0.1, "azimuth": 1.0}]
        at += [{"wind": 9.0, "pitch": 0.05}]
        return {str(point): turbine(name).operating_point(**point) for point in at}

    for name in ("nrel5mw", "t2b1i1cg"):
        yield f"turbine {name}: hash", partial(lambda n: {"hash": turbine(n).hash}, name)
        yield f"turbine {name}: natural frequencies", partial(modes, name)
        yield f"turbine {name}: operating points", partial(points, name)
        yield f"turbine {name}: right-hand side and loads of random states", partial(right_hand_side, name)


def method_figures() -> Iterator[Figure]:
    from fatigue_runner.integrators import METHODS

    time_points = np.linspace(0, 22, 45)
    swing = fr.PitchSeries(time_points, np.radians(4.0 + 3.0 * np.sin(0.8 * time_points)))
    for method in METHODS:
        step = STEPS.get(method, min(STEPS.values()))
        own = partial(simulated, method=method, step=step)
        turbulence = turbulent(21.0)  # the last step ends beyond the 20 s
        yield f"method {method}: every step", partial(own, wind=turbulence, duration=20.0)
        yield f"method {method}: 50 Hz", partial(own, wind=turbulence, duration=20.0, output_step=0.02)
        yield f"method {method}: three steps", partial(own, wind=turbulence, duration=3 * step)
        sheared = fr.ConstantWind(8.0, 0.14, -0.05)
        fixed = partial(own, wind=sheared, duration=10.0, output_step=0.02, pitch=0.03)
        yield f"method {method}: constant wind, shears, pitch", fixed
        if not method.startswith("etd"):  # made for one pitch
            varying = partial(own, wind=turbulence, duration=20.0, output_step=0.02, pitch=swing)
            yield f"method {method}: varying pitch", varying


def case_figures() -> Iterator[Figure]:
    for initial in ("paper", "paper-spinning"):
        for method, step in (("heun", 0.01), ("rk3", 0.01), ("abm4", 0.01), ("rk7", 0.02)):
            run = partial(simulated, "t2b1i1cg", initial=initial, method=method, step=step, duration=20.0)
            # the paper's literal state winds the shaft up so far that no method survives a step
            run = partial(run, must_diverge=initial == "paper")
            yield f"case t2b1i1cg, {initial}: {method}", run
    rk4 = partial(simulated, method="rk4", step=0.03, duration=12.0, output_step=0.02)
    time_points = np.arange(30) * 0.5
    signals = [8 + np.sin(time_points), 0.1 + 0.05 * np.cos(time_points), 0.1 * np.sin(2 * time_points)]
    yield "case wind series", partial(rk4, wind=fr.SeriesWind(0.5, np.stack(signals, axis=1)))
    steps = fr.StepWind([0.0, 3.0, 6.0], [[8.0, 0.1, 0.0], [10.0, 0.2, 0.1], [7.0, 0.0, -0.1]])
    yield "case wind steps", partial(rk4, wind=steps)
    yield "case start from a state", partial(rk4, wind=9.0, initial=np.linspace(0.0, 1.5, 16))
    for method, step in (("heun", 0.06), ("rk4", 0.16), ("abm4", 0.06)):
        run = partial(simulated, wind=turbulent(60.0), method=method, step=step, duration=60.0)
        for what, output in (("every step", None), ("50 Hz", 0.02)):
            yield f"case diverges: {method}, {what}", partial(run, must_diverge=True, output_step=output)
    wound_up = partial(simulated, wind=8.0, initial="paper", duration=2.0, must_diverge=True)
    yield "case diverges: etdabm3", partial(wound_up, method="etdabm3", step=0.05)
    corrected = partial(wound_up, method="rk4", step=0.1, corrector="rk4-100ms")
    for mode in ("enhanced", "hybrid"):
        yield f"case diverges: rk4-100ms, {mode}", partial(corrected, mode=mode)


def corrector_figures() -> Iterator[Figure]:
    for corrector in fr.correctors():
        for mode in ("enhanced", "hybrid"):
            options = {
                "method": corrector.method,
                "step": corrector.step,
                "corrector": corrector,
                "mode": mode,
            }
            run = partial(simulated, corrector.turbine, turbulent(30.0), duration=30.0, **options)
            yield f"corrector {corrector.name}: {mode}, every step", run
            yield f"corrector {corrector.name}: {mode}, 50 Hz", partial(run, output_step=0.02)


def fatigue_figures() -> Iterator[Figure]:
    series = np.cumsum(np.random.Generator(np.random.PCG64(2)).normal(size=20_000))

    def counted() -> Parts:
        ranges, means, counts = fr.rainflow(series)
        loads = [fr.damage_equivalent_load(series, m=m, n_eq=600.0) for m in (3, 4, 5, 10, 12)]
        return {"ranges": ranges, "means": means, "counts": counts, "loads": np.array(loads)}

    def damage() -> Parts:
        from fatigue_runner.fatigue import SN_CURVES, goodman, miner_damage

        ranges, means, counts = fr.rainflow(series)
        parts: Parts = {name: miner_damage(ranges, counts, name) for name in SN_CURVES}
        return parts | {"goodman": goodman(ranges, means, 1e4)}

    def lifetime() -> Parts:
        from fatigue_runner.fatigue import bin_probabilities, iec_climate

        return {
            name: bin_probabilities(iec_climate(name), np.arange(4.0, 25.0), 1.0)
            for name in ("I", "II", "III")
        }

    yield "fatigue: cycles and equivalent loads", counted
    yield "fatigue: damage", damage
    yield "fatigue: bin probabilities", lifetime


CORRECTED = [
    {"method": name.split("-")[0], "step": 0.1, "corrector": name, "mode": mode}
    for name in ("rk4-100ms", "etdabm3-100ms")
    for mode in ("enhanced", "hybrid")
]
COMMON = {"duration": 20, "reference": {"method": "rk7", "step": 0.01}}
# 12 winds each: the second group of lanes is padded
CAMPAIGNS: dict[str, dict[str, Any]] = {
    "turbulent": {
        "wind": {
            "type": "turbulent",
            "speeds": [6, 8, 10],
            "seeds": [1, 2, 3, 4],
            "intensity": 0.14,
            **LINEAR,
        },
        "integrators": [{"method": m, "step": STEPS[m]} for m in ("heun", "rk4", "abm4", "etdrk4")]
        + CORRECTED,
        "discard": 2,
    },
    "constant, some diverge": {  # just below the linear limit, which is not enough in the stronger winds
        "wind": {"speeds": {"start": 8, "stop": 14, "count": 12}, "vertical_shear": 0.1},
        "initial": "paper-spinning",
        "integrators": [{"method": "rk4", "step": [0.02, 0.122]}, {"method": "rk3", "step": 0.05}],
    },
    "varying pitch": {
        "wind": {"speeds": {"start": 6, "stop": 11, "count": 12}},
        "integrators": [{"method": "rk4", "step": 0.05}, {"method": "ab4", "step": 0.01}],
        "pitch": {"time": [0, 5, 10, 15, 20], "angle": [0, 2, 4, 1, 3]},
    },
    "from files": {
        "wind": {"type": "file", "files": [f"wind{i}.csv" for i in range(12)]},
        "integrators": [{"method": "tsit5", "step": 0.05}, *CORRECTED],
    },
}


def campaign(name: str, folder: Path) -> Parts:
    """Results, but for names and clocks, and the samples in the logs of the first wind and of a padded lane's neighbour."""
    from fatigue_runner.logbook import read_log

    folder.mkdir()
    time_points = np.arange(43) * 0.5
    for i in range(12):
        speed = 7.5 + 0.1 * i + np.sin(0.7 * time_points + i)
        columns = [time_points, speed, np.full(43, 0.1), 0.05 * np.cos(time_points)]
        header = "time,wind_speed,vertical_shear,horizontal_shear"
        np.savetxt(
            folder / f"wind{i}.csv",
            np.stack(columns, 1),
            fmt="%.6f",
            delimiter=",",
            header=header,
            comments="",
        )
    file = folder / "campaign.yaml"
    file.write_text(json.dumps({"name": "bits", **COMMON, **CAMPAIGNS[name]}))
    results = fr.run_campaign(file, out=folder / "out", workers=1)
    parts = {
        f"column {key}": _column([row[key] for row in results.rows])
        for key in results.columns
        if key not in NOT_FIGURES
    }
    for number, row in enumerate(results.rows):
        if number % 12 in (0, 11):
            log = read_log(folder / "out" / "logs" / f"{row['case_id']}.mcap")
            parts |= trajectory_parts(log, f"log {number} ")
            parts[f"log {number} reference_error"] = log.reference_error
    return parts


def _column(values: list[Any]) -> Any:
    if any(isinstance(value, str) for value in values):
        return ",".join(map(str, values))
    return np.array([np.nan if value is None else value for value in values], float)


def figures(out: Path) -> Iterator[Figure]:
    yield from turbine_figures()
    yield from fatigue_figures()
    yield from method_figures()
    yield from case_figures()
    yield from corrector_figures()
    for number, name in enumerate(CAMPAIGNS):
        yield f"campaign {name}", partial(campaign, name, out / f"campaign{number}")


def as_array(value: Any) -> np.ndarray:
    """A part as an array: texts as their bytes."""
    return np.frombuffer(value.encode(), np.uint8) if isinstance(value, str) else np.ascontiguousarray(value)


def digest(array: np.ndarray) -> str:
    """SHA-256 of type, shape and raw bytes."""
    return hashlib.sha256(f"{array.dtype.str}{array.shape}".encode() + array.tobytes()).hexdigest()


def main(tree: str, out: Path, pattern: str) -> None:
    """Make the figures whose names match and tell of each: digests, or the error."""
    check_import(tree)
    for number, (name, make) in enumerate(figures(out)):
        if not fnmatchcase(name, f"*{pattern}*"):
            continue
        began = time.perf_counter()
        line: dict[str, Any] = {"name": name, "file": f"{number}.npz"}
        try:
            arrays: dict[str, Any] = {part: as_array(value) for part, value in make().items()}
            np.savez(out / line["file"], **arrays)
            line["parts"] = {part: digest(array) for part, array in arrays.items()}
        except Exception as error:  # one figure's trouble must not hide the others
            line["error"] = f"{type(error).__name__}: {error}"
        line["seconds"] = time.perf_counter() - began
        print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), sys.argv[3])
