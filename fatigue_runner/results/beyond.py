"""What left the range in which the model holds, from the results table: the aerodynamic tables, the rotor's speed."""

from __future__ import annotations

from collections.abc import Sequence

from fatigue_runner.layout import RPM
from fatigue_runner.results.cells import Row, format_percent, number

MOST = 1.2  # rotor speed over rated; a real turbine shuts down before


def beyond(rows: Sequence[Row], rated: float | None) -> list[str]:
    """A sentence for each way in which cases left the model's range; rated: rotor speed [rad/s], None where it is unknown."""
    return [*left_tables(rows), *overspeed(rows, rated)]


def left_tables(rows: Sequence[Row]) -> list[str]:
    """Where the aerodynamic tables were left: how many cases, how much of the worst one."""
    clamped = [(row, count) for row in rows if (count := number(row, "clamped_lookups"))]
    if not clamped:
        return []
    shares = [count / n for row, count in clamped if (n := number(row, "evaluations"))]
    worst = f", up to {format_percent(min(max(shares), 1.0))} of a case's evaluations" if shares else ""
    return [
        f"{len(clamped)} of {len(rows)} cases left the range of the aerodynamic tables ({sum(n for _, n in clamped):.0f} look-ups in "
        f"all{worst}{_winds([row for row, _ in clamped])}). Outside it the nearest tabulated value is taken: the loads there are not "
        "those of the turbine."
    ]


def overspeed(rows: Sequence[Row], rated: float | None) -> list[str]:
    """Where the rotor turned faster than MOST times its rated speed [rad/s]."""
    if rated is None:
        return []
    fast = [
        (row, speed)
        for row in rows
        if (speed := number(row, "max_rotor_speed")) is not None and speed > MOST * rated
    ]
    if not fast:
        return []
    return [
        f"In {len(fast)} of {len(rows)} cases the rotor turned faster than {MOST:g} times its rated {RPM * rated:.3g} rpm, up to "
        f"{RPM * max(speed for _, speed in fast):.3g} rpm{_winds([row for row, _ in fast])}: outside the model's use, a turbine would "
        "have pitched or stopped. `operation: controlled` has a controller."
    ]


def no_pitch_control(rated: float | None) -> str:
    """What a run with a fixed pitch is; rated: rotor speed [rad/s]."""
    held = "" if rated is None else f"; rated is {RPM * rated:.3g} rpm"
    return f"The pitch is fixed (`operation: fixed`): no controller limits the rotor's speed{held}."


def _winds(rows: Sequence[Row]) -> str:
    speeds = sorted({speed for row in rows if (speed := number(row, "wind_speed")) is not None})
    if not speeds:
        return ""
    return (
        f", at mean winds from {speeds[0]:.3g} to {speeds[-1]:.3g} m/s"
        if len(speeds) > 1
        else f", at {speeds[0]:.3g} m/s"
    )
