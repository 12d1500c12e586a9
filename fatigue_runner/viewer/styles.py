"""How series look in the plots: names, colours, units."""

from __future__ import annotations

import rerun as rr

from fatigue_runner import channels
from fatigue_runner.viewer import colours
from fatigue_runner.viewer.cases import Viewed
from fatigue_runner.viewer.inflow import BLADE_WIND

TRUSTED, FALLEN_BACK = "trusted", "fallen back"
SOLVER_SERIES = ("discrepancy", "threshold", "local_error", "reference_error")


def read_unit(name: str) -> tuple[str, float]:
    """Unit in which a load is drawn, and the factor to it: MN·m for moments, else as `channels` says."""
    if name.endswith("moment") or name == "low_speed_shaft_torque":
        return "MN·m", 1e-6
    channel = channels.BY_NAME.get(name)
    return (channel.read_unit, channel.scale) if channel else ("", 1.0)


def set_style(recording: rr.RecordingStream, case: Viewed, several: bool) -> None:
    """Names and colours of all series of a case: by integrator where there are several, else by blade."""
    groups = [("state", c) for c in case.log.states]
    groups += [("wind", c) for c in (*case.log.winds, *BLADE_WIND)]
    groups += [("load", channels.BY_NAME[n]) for n in case.log.loads if n in channels.BY_NAME]
    for group, channel in groups:
        blade = next((i for i in (1, 2, 3) if channel.name.startswith(f"blade{i}")), None)
        colour, name = case.colour, case.label
        # the wind at the blades is told of one case, the others have the same
        if not several or channel in BLADE_WIND:
            name = short_label(channel.label)
            # the pitch shares a plot with the rotor's speed
            other = 1 if channel.name == "blade_pitch" else 0
            colour = colours.BLADES[blade - 1] if blade else colours.INTEGRATORS[other]
        if group == "wind" and blade is None and not several:
            colour = _signal_colour(channel.name)
        style = rr.SeriesLines(names=name, colors=colour, widths=1.6 if not case.is_reference else 2.6)
        recording.log(f"plots/{group}/{channel.name}/{case.key}", style, static=True)
    # what shares no plot with another series of the same case needs no more than the case's name
    for name, what, alone, colour in (
        ("discrepancy", "discrepancy", False, case.colour), ("threshold", "threshold", False, colours.REJECTED),
        ("local_error", "local error estimate", True, case.colour), ("reference_error", "error", True, case.colour),
    ):  # fmt: skip
        recording.log(
            f"plots/solver/{name}/{case.key}",
            rr.SeriesLines(names=_name(case, what, several, alone), colors=colour, widths=1.6),
            static=True,
        )
    if case.is_guarded:
        recording.log(
            f"trust/{case.key}",
            rr.StateConfiguration(values=[TRUSTED, FALLEN_BACK], colors=[colours.ACCEPTED, colours.REJECTED]),
            static=True,
        )


def short_label(label: str) -> str:
    """Of one of several series that share a plot with a title: `blade 1` of `blade 1 root flapwise moment`."""
    blade = next((name for name in ("blade 1", "blade 2", "blade 3") if name in label), None)
    return blade or label.replace("wind speed, mean over the rotor", "rotor mean")


def _signal_colour(name: str) -> tuple[int, int, int]:
    """The rotor's signals as the reference; harmonics, whose amplitudes share a plot, one after another."""
    harmonics = [c.name for c in channels.WIND_HARMONICS]
    if name not in harmonics:
        return colours.REFERENCE
    return colours.INTEGRATORS[harmonics.index(name) // 2 % len(colours.INTEGRATORS)]


def _name(case: Viewed, what: str, several: bool, alone: bool) -> str:
    if not several:
        return what
    return case.label if alone else f"{case.label}: {what}"
