"""How the turbine operated, from the results table: whether the controller's pitch was faster than its limit."""

from __future__ import annotations

from collections.abc import Sequence

from fatigue_runner.layout import DEGREES
from fatigue_runner.results.cells import Row, number, numbers


def pitch_rate_sentences(rows: Sequence[Row]) -> list[str]:
    """One sentence where the limit of the pitch rate would have acted; none where it never would, or nobody pitches."""
    beyond = [(row, seconds) for row in rows if (seconds := number(row, "pitch_rate_limited_time"))]
    if not beyond:
        return []
    speeds = sorted({speed for row, _ in beyond if (speed := number(row, "wind_speed")) is not None})
    at = f", at mean winds from {speeds[0]:.3g} to {speeds[-1]:.3g} m/s" if speeds else ""
    worst = max(seconds for _, seconds in beyond)
    fastest = DEGREES * max(numbers([row for row, _ in beyond], "pitch_rate_max"), default=0.0)
    return [
        f"In {len(beyond)} of {len(rows)} cases the controller turned the blades faster than its limit (up to {fastest:.3g} deg/s, for up "
        f"to {worst:.3g} s{at}). The limit does not act in the simulation: a turbine would pitch later and run faster there."
    ]
