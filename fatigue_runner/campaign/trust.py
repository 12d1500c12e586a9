"""How far a campaign's reference can be trusted: measured against itself at another step and against another method of high order.

On a few of the campaign's winds and a minute of each at most, before the cases run; the answer goes into run.json, the report and
every log. It is not the error of the reference but a bound for it: at twice the step a method of order 7 errs 128 times as much.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fatigue_runner.campaign.evaluate import Evaluated, evaluate
from fatigue_runner.campaign.resolve import Resolved
from fatigue_runner.errors import FatigueRunnerError

WINDS = 4
LONGEST = 60.0  # s that are counted
EVALUATIONS = 4e5  # of one run and case: half a second of one core for a full vector

# facts: in words, and the numbers for who compares them
SENTENCE, NRMSE, DEL_ERROR = "reference_agreement", "reference_nrmse", "reference_del_error"


def reference_facts(resolved: Resolved, earlier: Mapping[str, Any]) -> dict[str, str]:
    """Facts by name, empty where there is no reference or where it cannot be checked.

    earlier: the run.json of a run that goes on; its facts are kept where winds and reference are the same.
    """
    reference = resolved.campaign.reference
    if reference is None:
        return {}
    mine = resolved.campaign.model_dump()
    theirs, facts = earlier.get("campaign", {}), earlier.get("facts", {})
    if SENTENCE in facts and all(
        theirs.get(k) == mine[k] for k in ("wind", "reference", "fatigue", "discard")
    ):
        return {name: facts[name] for name in (SENTENCE, NRMSE, DEL_ERROR) if name in facts}
    try:
        return _measure(resolved)
    except FatigueRunnerError:
        return {}  # what is wrong with the reference shows when its cases run


def _measure(resolved: Resolved) -> dict[str, str]:
    from fatigue_runner.integrators import method, stability_limit

    reference = resolved.campaign.reference
    assert reference is not None
    name, step = reference.method, reference.step
    other = "rk7" if name == "dop853" else "dop853"
    # twice the step costs half; where that is not stable, half of it
    second = 2 * step if 2 * step < 0.5 * stability_limit(resolved.turbine, name) else step / 2
    smallest, most = min(step, second), max(method(m).evaluations_per_step for m in (name, other))
    output = 1.0 / resolved.campaign.output_rate
    length = min(LONGEST, max(EVALUATIONS * smallest / most, 20 * output))
    outputs = int(min(resolved.campaign.discard + length, resolved.campaign.duration) / output + 1e-9)
    block = _Block(resolved, outputs * output)
    exact = block.run(name, step)
    nrmse, loads = 0.0, 0.0
    for m, h in ((name, second), (other, step)):
        found = [_distance(a, b) for a, b in zip(block.run(m, h), exact, strict=True)]
        nrmse, loads = max(nrmse, *(f[0] for f in found)), max(loads, *(f[1] for f in found))
    sentence = (
        f"{name} at {second * 1e3:g} ms and {other} at {step * 1e3:g} ms agree with {name} at {step * 1e3:g} ms to an NRMSE of "
        f"{nrmse:.0e} (worst state) and a DEL error of {loads:.0e}, over {outputs * output:g} s of {len(exact)} of the winds"
    )
    return {SENTENCE: sentence, NRMSE: f"{nrmse:.3e}", DEL_ERROR: f"{loads:.3e}"}


class _Block:
    """The first winds of the campaign that can share a block, spread over it; `run` evaluates them up to `duration` [s]."""

    def __init__(self, resolved: Resolved, duration: float) -> None:
        winds = resolved.winds
        alike = [wind for wind in winds if wind.source.cell_key == winds[0].source.cell_key]
        self.ensemble = resolved.ensemble(alike[:: max(1, len(alike) // WINDS)][:WINDS], duration)
        self.campaign = resolved.campaign

    def run(self, method: str, step: float) -> list[Evaluated]:
        from fatigue_runner.integrators import Integrator, simulate

        runs = simulate(self.ensemble, Integrator(method, step))
        lost = [r.diverged_at for r in runs if r.diverged_at is not None]
        if lost:
            raise FatigueRunnerError(f"{method} at {step:g} s diverges at {min(lost):g} s")
        return [evaluate(r, self.campaign) for r in runs]


def _distance(test: Evaluated, reference: Evaluated) -> tuple[float, float]:
    """NRMSE of the worst state, largest DEL error."""
    from fatigue_runner.fatigue import load_error
    from fatigue_runner.results.accuracy import compare
    from fatigue_runner.results.relevance import governing, relevant

    means = {name: float(series.mean()) for name, series in reference.trajectory.loads.items()}
    worst = 0.0
    for (channel, m), load in test.loads.items():
        exact = reference.loads[channel, m]
        error = load_error(load, exact)
        if error is not None:
            same = {name: [mean, reference.loads.get((name, m))] for name, mean in means.items()}
            worst = max(worst, abs(relevant(error, exact, governing(channel, same))))
    return compare(test.trajectory, reference.trajectory).nrmse_max, worst
