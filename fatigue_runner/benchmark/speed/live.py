"""What it costs a campaign to be watched: the same campaign without and with `--live`, in turn, in one run.

Both cores are busy all the time, which is the worst that can happen: what the bridge and the viewer take is taken from the workers.
The viewer opens while the campaign is read and shows its first picture in the middle of it; a campaign of minutes loses a smaller
share.

In each round every situation runs once. Clocks are compared with the mean of the two unwatched runs of the same round; how far those
two lie apart is the machine's own unrest, and on a shared one that is more than what is to be measured. So the verdict rests on what
Linux counts: for how long the run's processes were ready and waited for a core, all together, beyond what they wait unwatched. In
the worst case the run is slower by all of that.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
import statistics
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fatigue_runner.campaign import run_campaign
from fatigue_runner.errors import FatigueRunnerError
from fatigue_runner.viewer import window
from fatigue_runner.viewer.live import Look, Watcher
from fatigue_runner.viewer.priority import cpu_of_group, processes, ticks_of_processes

ALONE = "not watched"
AGAIN = "not watched, again"
SITUATIONS = (ALONE, AGAIN, "viewer open", "viewer absent", "viewer stopped", "viewer killed")
# What is done to the viewer while the campaign runs.
_SIGNALS = {"viewer stopped": "SIGSTOP", "viewer killed": "SIGKILL"}
_START_SECONDS = 30.0
_UNREST = 0.05  # share of the machine that other programs may take
_TRIES = 4


def campaign(duration: float, workers: int) -> dict[str, Any]:
    """Turbulent winds with three integrators and their reference: as a design load case, but shorter."""
    return {
        "name": "live-benchmark",
        "turbine": "nrel5mw",
        "duration": duration,
        "workers": workers,
        "wind": {
            "type": "turbulent",
            "speeds": {"start": 6, "stop": 11, "count": 16},
            "intensity": 0.14,
            "seeds": workers,
        },
        "integrators": [{"method": "heun", "step": [0.01, 0.02]}, {"method": "rk4", "step": 0.02}],
        "reference": {"method": "rk7", "step": 0.005},
    }


def viewer_arguments() -> list[str]:
    """Of the viewer that is opened here: a window where there is a display, else one that draws without, else a server."""
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        return []
    with window.viewer("--headless", "--port", str(window.free_port())) as process:
        time.sleep(3.0)
        return ["--headless"] if process.poll() is None else ["--serve-grpc"]


def measure(
    rounds: int = 5,
    duration: float = 120.0,
    workers: int | None = None,
    say: Callable[[str], Any] = lambda text: None,
) -> dict[str, Any]:
    """Wall time of the campaign in every situation of `SITUATIONS`, in turn.

    duration [s]: simulated, per case; workers: processes, default as many as cores. Returns {"cores", "workers", "rounds",
    "rerun", "viewer", "disturbed", "slower", "situations": {name: {"seconds", "waits": [...], "ratio", "lowest",
    "highest", "waited", "slower", "cpu", "watching"}}}: ratio, waited [s], cpu [s] of the run's processes and the share of all cores
    that bridge and viewer took (watching) are medians over the rounds; slower is the waiting beyond that of unwatched runs over their
    wall time; disturbed counts runs that other programs disturbed at every try.
    Raises InputError where Rerun is not installed.
    """
    window.require_rerun()
    cores = os.cpu_count() or 1
    workers = workers or cores
    spec, viewer = campaign(duration, workers), viewer_arguments()
    say("warming up")
    warm = _run(spec, ALONE, Look(), 0.0).wall  # compiles and loads kernels, starts the workers
    alone = _run(spec, ALONE, Look(), 0.0).wall
    say(f"{warm:.1f} s cold, {alone:.1f} s warm; {rounds} rounds of {len(SITUATIONS)} runs")
    runs: dict[str, list[_Run]] = {name: [] for name in SITUATIONS}
    for number in range(rounds):
        # another order in each round: what ran just before must not always be the same
        for name in random.Random(number).sample(SITUATIONS, len(SITUATIONS)):
            runs[name].append(_undisturbed(spec, name, Look(viewer=viewer), alone / 3))
        say(f"round {number + 1}: " + ", ".join(f"{name} {runs[name][-1].wall:.2f} s" for name in SITUATIONS))
    base = [(a.wall + b.wall) / 2 for a, b in zip(runs[ALONE], runs[AGAIN], strict=True)]
    situations = {name: _figures(found, base, cores) for name, found in runs.items()}
    unwatched = statistics.median(run.waited for name in (ALONE, AGAIN) for run in runs[name])
    for figures in situations.values():
        figures["slower"] = (figures["waited"] - unwatched) / statistics.median(base)
    watched = [figures for name, figures in situations.items() if name.startswith("viewer")]
    return {
        "cores": cores,
        "workers": workers,
        "rounds": rounds,
        "rerun": version("rerun-sdk"),
        "viewer": {"--headless": "drawing, without a screen", "--serve-grpc": "server only"}.get(
            "".join(viewer), "window"
        ),
        "disturbed": sum(run.others > _UNREST for found in runs.values() for run in found),
        # where nobody counts the waiting, the clock has to do
        "slower": max(f["slower"] if unwatched else f["ratio"] - 1.0 for f in watched),
        "situations": situations,
    }


@dataclass
class _Run:
    """Wall time; CPU time of bridge and viewer, and of the run's processes, within it; time for which those waited [s]; share of the
    machine that other programs took."""

    wall: float
    watching: float
    cpu: float
    waited: float
    others: float


def _figures(runs: list[_Run], base: list[float], cores: int) -> dict[str, Any]:
    ratios = [run.wall / alone for run, alone in zip(runs, base, strict=True)]
    return {
        "seconds": [run.wall for run in runs],
        "waits": [run.waited for run in runs],
        "ratio": statistics.median(ratios),
        "lowest": min(ratios),
        "highest": max(ratios),
        "waited": statistics.median(run.waited for run in runs),
        "cpu": statistics.median(run.cpu for run in runs),
        "watching": statistics.median(run.watching / (run.wall * cores) for run in runs),
    }


def _undisturbed(spec: dict[str, Any], name: str, look: Look, after: float) -> _Run:
    """A run beside which nothing else went on, or the least disturbed of a few."""
    tries: list[_Run] = []
    while len(tries) < _TRIES:
        tries.append(_run(spec, name, look, after))
        if tries[-1].others <= _UNREST:
            break
    return min(tries, key=lambda run: run.others)


def _run(spec: dict[str, Any], name: str, look: Look, after: float) -> _Run:
    """One run in one situation; after [s]: when something happens to the viewer."""
    with tempfile.TemporaryDirectory() as folder, _situation(name, look.viewer, after) as (port, groups):
        own, all_before = os.getpgid(0), ticks_of_processes()
        cpu, waited, begin = _cpu(own), _waited_of_group(own), time.perf_counter()
        watcher = None
        if name.startswith("viewer"):
            watcher = Watcher(replace(look, port=port))
            if watcher.bridge is not None:
                groups.append(watcher.bridge.process.pid)
        before = sum(map(_cpu, groups))
        results = run_campaign(spec, Path(folder) / "run", watch=watcher)
        wall = time.perf_counter() - begin
        used = sum(map(_cpu, groups)) - before
        cpu, waited = _cpu(own) - cpu, _waited_of_group(own) - waited
        outside = {
            pid: ticks for pid, (ticks, group) in ticks_of_processes().items() if group not in {own, *groups}
        }
        others = sum(ticks - all_before.get(pid, (0, 0))[0] for pid, ticks in outside.items())
        if watcher is not None and watcher.bridge is not None:
            watcher.__exit__(None, None, None)
            _end_group(watcher.bridge.process)
        if results.exit_code:
            raise FatigueRunnerError("the campaign of this benchmark did not run to its end")
        share = others / os.sysconf("SC_CLK_TCK") / (wall * (os.cpu_count() or 1))
        return _Run(wall, max(used, 0.0), cpu, waited, share)


@contextmanager
def _situation(name: str, viewer: list[str], after: float) -> Iterator[tuple[int | None, list[int]]]:
    """(port of the viewer, None for one that the bridge opens; process groups that watch)."""
    if name not in _SIGNALS:
        yield (window.free_port() if name == "viewer absent" else None), []
        return
    port = window.free_port()
    with window.viewer(*viewer, "--port", str(port)) as process:
        _wait_for(port)
        # a viewer of the user's own that begins to stand still, or is gone, in the middle of the run
        timer = threading.Timer(after, process.send_signal, [getattr(signal, _SIGNALS[name])])
        timer.start()
        try:
            yield port, [process.pid]
        finally:
            timer.cancel()
            with contextlib.suppress(OSError):
                process.kill()  # which also ends one that was stopped


def _wait_for(port: int) -> None:
    import socket

    until = time.monotonic() + _START_SECONDS
    while time.monotonic() < until:
        with contextlib.suppress(OSError), socket.create_connection((window.HOST, port), timeout=1.0):
            return
        time.sleep(0.05)
    raise FatigueRunnerError("the viewer does not start here; see `fatigue-runner view`")


def _end_group(process: Any) -> None:
    """End the bridge and the viewer that it opened."""
    with contextlib.suppress(OSError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _cpu(group: int) -> float:
    return cpu_of_group(group) or 0.0


def _waited_of_group(group: int) -> float:
    """Time for which the threads of a group's processes were ready to run and waited for a core [s]."""
    total = 0
    for folder, fields in processes():
        if int(fields[2]) != group:
            continue
        with contextlib.suppress(OSError):
            total += sum(int(path.read_text().split()[1]) for path in folder.glob("task/*/schedstat"))
    return total / 1e9
