"""What the paper's network costs next to one evaluation of f: 17-111-111-111-16, ReLU, as matrix products."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from fatigue_runner.benchmark.speed import kernel, machine

SIZES = (17, 111, 111, 111, 16)  # arXiv:2504.05493
SAMPLES = (1, 16, 64, 256, 1024)


def _work(samples: int, kind: Any) -> Callable[[], float]:
    rng = np.random.Generator(np.random.PCG64(0))
    layers = [rng.standard_normal((a, b)).astype(kind) for a, b in pairwise(SIZES)]
    biases = [np.zeros(b, kind) for b in SIZES[1:]]
    x = rng.standard_normal((samples, SIZES[0])).astype(kind)
    buffers = [np.empty((samples, b), kind) for b in SIZES[1:]]
    repeats = max(3, 2000 // samples)

    def once() -> float:
        begin = time.thread_time()
        for _ in range(repeats):
            y = x
            for weights, bias, out in zip(layers, biases, buffers, strict=True):
                np.matmul(y, weights, out=out)
                out += bias
                if out is not buffers[-1]:
                    np.maximum(out, 0, out=out)
                y = out
        return (time.thread_time() - begin) / repeats / samples * 1e9

    return once


def measure(repeats: int = 9) -> dict[str, Any]:
    """ns per sample by precision and samples per product, and the evaluations of f that they would buy."""
    from fatigue_runner.turbine import load_turbine

    work: dict[str, Callable[[], float]] = {
        f"{name} {n}": _work(n, kind)
        for name, kind in (("f32", np.float32), ("f64", np.float64))
        for n in SAMPLES
    }
    work["f"] = kernel.one_evaluation(load_turbine("nrel5mw"))
    with machine.pinned():
        found = machine.interleaved(work, repeats)
    f = found["f"]["median"]
    rows = [
        {
            "precision": name,
            "samples": n,
            "time": found[f"{name} {n}"],
            "evaluations": found[f"{name} {n}"]["median"] / f,
        }
        for name in ("f32", "f64")
        for n in SAMPLES
    ]
    multiplications = sum(a * b for a, b in pairwise(SIZES))
    return {"sizes": SIZES, "multiply_adds": multiplications, "evaluation": found["f"], "rows": rows}


def measure_with_one_thread(repeats: int = 9) -> dict[str, Any]:
    """`measure` in a process of its own whose BLAS has one thread: that is settled when NumPy is imported."""
    one = {name: "1" for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")}
    done = subprocess.run(
        [sys.executable, "-m", "fatigue_runner.benchmark.speed.network", str(repeats)],
        env={**os.environ, **one, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]))))
