"""The first screen: the turbine large, beside it what an engineer looks at first; everything else a tab away."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from fatigue_runner import channels
from fatigue_runner.viewer.cases import Viewed
from fatigue_runner.viewer.inflow import BLADE_WIND, SPAN
from fatigue_runner.viewer.recording import SCALE_BOUNDS, TIMELINE, logarithm, series
from fatigue_runner.viewer.styles import SOLVER_SERIES, read_unit, short_label

LONGEST_WHOLE = 180.0  # s; oscillations of a longer log would be a solid band
_BACKGROUND = [24, 28, 36]


def first_screen(cases: Sequence[Viewed], playing: bool = True) -> rrb.Blueprint:
    """Scene, main plots and the tabs of the rest, for what these cases hold."""
    tabs = [overview(cases), _all_loads(cases), _all_states(cases)]
    solver = _solver_plots(cases)
    if solver:
        tabs.append(rrb.Vertical(*solver, name="Solver"))
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.TimePanel(
            state="collapsed",
            timeline=TIMELINE,
            play_state="playing" if playing else "paused",
            loop_mode="all",
        ),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def live_screen(cases: Sequence[Viewed], pace: float | None) -> rrb.Blueprint:
    """The campaign as it fills, beside the case that is shown; only the campaign before there is one.

    pace: the case comes in at its pace, and the time cursor follows; None: it is played again and again.
    """
    campaign = [
        rrb.TextDocumentView(origin="campaign/cases", name="Campaign"),
        rrb.Spatial2DView(origin="campaign/chart", name="DEL over wind speed", background=_BACKGROUND),
    ]
    if not cases:
        screen: rrb.Container = rrb.Horizontal(*campaign, column_shares=[2, 3])
    else:
        paced = pace is not None
        plots = [_plot(name, cases, paths, live=paced, width=290.0) for name, paths in _live_plots(cases)]
        screen = rrb.Horizontal(
            rrb.Vertical(scene_view(cases), scales_view(), rrb.Horizontal(*plots), row_shares=[6, 1.2, 3]),
            rrb.Vertical(*campaign),
            column_shares=[3, 2],
        )
    return rrb.Blueprint(
        screen,
        rrb.TimePanel(
            state="collapsed",
            timeline=TIMELINE,
            play_state="following" if pace is not None else "playing",
            loop_mode="all",
        ),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def _live_plots(cases: Sequence[Viewed]) -> list[tuple[str, list[str]]]:
    """Titles, and paths of the curves."""
    plots = [
        _flap_plot(cases),
        (_TOWER, ["load/tower_base_fore_aft_moment"]),
    ]
    return [*plots, (_WIND, _WIND_PATHS)] if len(cases[0].log.wind) else plots


def shown_live(case: Viewed) -> set[str]:
    """The curves of the live screen; the others are not forwarded while the campaign runs."""
    return {path for _, paths in _live_plots([case]) for path in paths}


def _flap_plot(cases: Sequence[Viewed]) -> tuple[str, list[str]]:
    return "Blade root flapwise moment [MN·m]", _blades("load", "root_flapwise_moment", cases)


_TOWER = "Tower-base fore-aft moment [MN·m]"
_WIND = f"Wind at the blades ({SPAN:g} R) [m/s]"
_WIND_PATHS = [*(f"wind/{channel.name}" for channel in BLADE_WIND), "wind/wind_speed"]


def overview(cases: Sequence[Viewed]) -> rrb.Container:
    """Scene and the few plots that say how the run goes: beside one turbine, below a row of them."""
    flap, tower = _flap_plot(cases), (_TOWER, ["load/tower_base_fore_aft_moment"])
    plots: list[rrb.View] = [_plot(name, cases, paths) for name, paths in (flap, tower)]
    if len(cases) == 1:
        solver, shares = _solver_plots(cases)[:3], [3.0, 3.0]
        if cases[0].log.control:
            paths = ["state/rotor_speed", "load/blade_pitch"]
            plots.append(_plot("Rotor speed [rpm] and blade pitch [deg]", cases, paths))
            shares.append(2.4)
        plots += solver
        shares += [1.6 if place == 0 and cases[0].is_guarded else 2.4 for place in range(len(solver))]
        while len(plots) < 4:
            plots.append(_more_plots(cases)[len(plots) - 2])
            shares.append(2.4)
        beside: rrb.Container = rrb.Vertical(*plots, row_shares=shares)
        scene: rrb.Container | rrb.View = scene_view(cases)
        if len(cases[0].log.wind):
            scene = rrb.Vertical(scene, scales_view(), _wind_plot(cases), row_shares=[10, 1.7, 3.8])
        else:
            scene = rrb.Vertical(scene, scales_view(), row_shares=[10, 1.5])
        return rrb.Horizontal(scene, beside, column_shares=[3, 2], name="Turbine")
    # Curves of good integrators lie on each other; their errors do not.
    if any(_has(case, "reference_error") for case in cases):
        plots.append(_error_plot(cases))
    plots += [*_guard_plots(cases)[:1], *_more_plots(cases)][: 4 - len(plots)]
    rows = [rrb.Horizontal(*plots[i : i + 2]) for i in (0, 2)]
    return rrb.Vertical(scene_view(cases), scales_view(), *rows, row_shares=[5, 1.2, 3, 3], name="Turbines")


def _more_plots(cases: Sequence[Viewed]) -> list[rrb.TimeSeriesView]:
    """What fills the first screen where the solver has little to tell."""
    rotor = _plot("Rotor speed [rpm]", cases, ["state/rotor_speed"])
    torque = _plot("Low-speed shaft torque [MN·m]", cases, ["load/low_speed_shaft_torque"])
    return [rotor, torque] if len(cases) == 1 else [_wind_plot(cases), rotor]


def _wind_plot(cases: Sequence[Viewed]) -> rrb.TimeSeriesView:
    """The wind of the first case's blades, each at its own azimuth, and of the rotor; other integrators have the same wind."""
    return _plot(_WIND, cases[:1], _WIND_PATHS)


def scene_view(cases: Sequence[Viewed]) -> rrb.Spatial3DView:
    """The turbines from upwind and from the side, so that bending out of the rotor plane is seen."""
    shape = cases[0].geometry
    middle = sum(case.offset for case in cases) / len(cases)
    if len(cases) == 1:
        target, away, aside = [0.0, 10.0, 0.78 * shape.hub_height], 3.2 * shape.radius, 0.62
    else:
        away, aside = shape.radius * (1.9 + 0.55 * (len(cases) - 1)), 0.18
        target = [0.0, middle + 20.0, 0.80 * shape.hub_height]
    eye = [-away * (1 - aside**2) ** 0.5, target[1] - 10.0 + aside * away, 0.75 * shape.hub_height]
    return rrb.Spatial3DView(
        origin="scene",
        name="Turbine" if len(cases) == 1 else "Turbines",
        background=_BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=True, spacing=20.0, color=[70, 80, 95, 90]),
        eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=[0.0, 0.0, 1.0]),
    )


def _whole(cases: Sequence[Viewed]) -> bool:
    """Whether a plot shows all of the logs."""
    return _last(cases) <= LONGEST_WHOLE


def _last(cases: Sequence[Viewed]) -> float:
    return max(float(case.log.time[-1]) for case in cases)


def scales_view() -> rrb.Spatial2DView:
    """What the colours of blades and wind mean."""
    x, y = SCALE_BOUNDS
    return rrb.Spatial2DView(
        origin="scales",
        name="Colours",
        background=_BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=x, y_range=y),
    )


def _time_axis(cases: Sequence[Viewed], live: bool, room: float) -> rrb.TimeAxis:
    """A short log whole, of a long one a minute around the cursor, of one that is being played the last seconds; room: share of the
    width that stays free to the right of what is there, for the legend."""
    if live:
        ends = [rr.TimeRangeBoundary.cursor_relative(seconds=t) for t in (-30.0, 30.0 * room / (1 - room))]
    elif _whole(cases):
        ends = [rr.TimeRangeBoundary.absolute(seconds=t) for t in (0.0, _last(cases) / (1 - room))]
    else:
        ends = [rr.TimeRangeBoundary.cursor_relative(seconds=t) for t in (-30.0, 30.0)]
    return rrb.TimeAxis(view_range=rr.TimeRange(*ends))


def _plot(
    name: str,
    cases: Sequence[Viewed],
    paths: Sequence[str],
    live: bool = False,
    width: float = 580.0,
) -> rrb.TimeSeriesView:
    """Curves with a title. One needs no legend; that of several stands where no curve is: to the right of the log's end, or above the
    curves where the log has no end on the screen. width: of the plot on a full screen [pixels]."""
    labels = [_label(case, path, cases) for path in paths for case in cases]
    several = len(labels) > 1
    # curves below each other end at the same place, with a legend or without
    letters = max(map(len, labels)) if several else 0
    letters = letters if live or len(cases) > 1 else max(len("discrepancy"), letters)
    room = 0.0 if live and not several else min(0.45, (42.0 + 7.0 * letters) / width)
    top = 0.0 if live or _whole(cases) or not several else min(0.6, 0.125 * len(labels))
    return rrb.TimeSeriesView(
        origin="/",
        name=name,
        contents=[f"/plots/{path}/{case.key}" for path in paths for case in cases],
        axis_x=_time_axis(cases, live, room),
        axis_y=_with_room_above(cases, paths, top),
        plot_legend=rrb.PlotLegend(visible=several, corner=rrb.Corner2D.RightTop),
    )


def _label(case: Viewed, path: str, cases: Sequence[Viewed]) -> str:
    """As long as what the legend will say."""
    channel = channels.BY_NAME.get(path.rpartition("/")[2])
    return case.label if len(cases) > 1 else short_label(channel.label if channel else "blade 1")


def _with_room_above(cases: Sequence[Viewed], paths: Sequence[str], share: float) -> rrb.ScalarAxis | None:
    """The range of all curves with a share of the height free above them; None: as they are."""
    if not share:
        return None
    known = []
    for case in cases:
        held = series(case, np.arange(len(case.log.time)))
        held |= {f"solver/{name}": logarithm(getattr(case.log, name)) for name in SOLVER_SERIES}
        found = [held[path] for path in paths if path in held]
        known += [v[np.isfinite(v)] for v in found if np.isfinite(v).any()]
    if not known:
        return None
    low, high = min(v.min() for v in known), max(v.max() for v in known)
    edge = 0.04 * (high - low)
    return rrb.ScalarAxis(range=(low - edge, high + edge + (high - low) * share / (1 - share)))


def _blades(group: str, what: str, cases: Sequence[Viewed]) -> list[str]:
    """All three blades of one case, blade 1 of several."""
    return [f"{group}/blade{i}_{what}" for i in ((1,) if len(cases) > 1 else (1, 2, 3))]


def _solver_plots(cases: Sequence[Viewed]) -> list[rrb.View]:
    """Only those for which a case holds figures."""
    plots: list[rrb.View] = _guard_plots(cases)
    if any(_has(case, "reference_error") for case in cases):
        plots.append(_error_plot(cases))
    holding = [case for case in cases if _has(case, "local_error")]
    if holding:
        plots.append(_plot("log10 of the local error estimate", holding, ["solver/local_error"]))
    return plots


def _guard_plots(cases: Sequence[Viewed]) -> list[rrb.View]:
    """Where the corrector was trusted, and by what margin, of the hybrid integrators."""
    guarded = [case for case in cases if case.is_guarded]
    if not guarded:
        return []
    trust = rrb.StateTimelineView(
        origin="/trust",
        name="Corrector trusted, or fallen back",
        contents=[f"/trust/{case.key}" for case in guarded],
    )
    return [trust, _plot(_MARGIN, guarded, ["solver/discrepancy", "solver/threshold"])]


_MARGIN = "log10 of the corrector's discrepancy; it is trusted below the threshold"


def _error_plot(cases: Sequence[Viewed]) -> rrb.TimeSeriesView:
    holding = [case for case in cases if _has(case, "reference_error")]
    return _plot(
        "log10 of the error against the reference, in ranges of the state",
        holding,
        ["solver/reference_error"],
    )


def _has(case: Viewed, name: str) -> bool:
    values = getattr(case.log, name)
    return bool((values > 0).any())


def _all_loads(cases: Sequence[Viewed]) -> rrb.Grid:
    held = [name for name in channels.LOAD_NAMES if any(name in case.log.loads for case in cases)]
    groups: dict[str, list[str]] = {}
    for name in held:
        if len(cases) > 1 and name.startswith(("blade2", "blade3")):
            continue
        label = f"{_blade_free(channels.BY_NAME[name].label, len(cases) == 1)} [{read_unit(name)[0]}]"
        groups.setdefault(label, []).append(f"load/{name}")
    return rrb.Grid(*(_plot(label, cases, paths) for label, paths in groups.items()), name="Loads")


def _all_states(cases: Sequence[Viewed]) -> rrb.Grid:
    groups: dict[str, list[str]] = {}
    for channel in dict.fromkeys(channel for case in cases for channel in case.log.states):
        if len(cases) > 1 and channel.name.startswith(("blade2", "blade3")):
            continue
        label = f"{_blade_free(channel.label, len(cases) == 1)} [{channel.read_unit}]"
        groups.setdefault(label, []).append(f"state/{channel.name}")
    for channel in dict.fromkeys(channel for case in cases for channel in case.log.control_signals):
        groups[f"{channel.label} [{channel.read_unit}]"] = [f"control/{channel.name}"]
    views = [_plot(label, cases, paths) for label, paths in groups.items()]
    return rrb.Grid(*views, *_all_wind(cases), name="States and wind")


def _all_wind(cases: Sequence[Viewed]) -> list[rrb.TimeSeriesView]:
    """The rotor's signals, each blade's own wind, and the harmonics' amplitudes."""
    winds = dict.fromkeys(channel for case in cases for channel in case.log.winds)
    rotor = [c for c in winds if c not in channels.WIND_HARMONICS]
    views = [_plot(f"{c.label} [{c.read_unit}]", cases, [f"wind/{c.name}"]) for c in rotor]
    views.append(_wind_plot(cases))
    for word, begin in (("cosine", "wind_cos_"), ("sine", "wind_sin_")):
        paths = [f"wind/{c.name}" for c in winds if c in channels.WIND_HARMONICS and c.name.startswith(begin)]
        if paths:
            views.append(_plot(f"Azimuthal harmonics of the wind, {word} [m/s]", cases[:1], paths))
    return views


def _blade_free(label: str, together: bool) -> str:
    """The same label for all blades, where they share a plot."""
    for blade in ("blade 1 ", "blade 2 ", "blade 3 ") if together else ():
        label = label.replace(blade, "blades: ")
    return label
