"""Operating curves: what a turbine does in steady wind under its controller, as figures and as a drawing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.channels import BY_NAME
from fatigue_runner.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

# the panels of the drawing: those of one panel share an axis
PANELS = (
    ("rotor_speed",),
    ("blade_pitch",),
    ("generator_power",),
    ("generator_torque",),
    ("rotor_thrust",),
    ("blade1_tip_out_of_plane", "tower_fore_aft"),
    ("blade1_root_flapwise_moment", "blade1_root_edgewise_moment"),
    ("tower_base_fore_aft_moment", "tower_base_side_side_moment"),
)
CHANNELS = tuple(name for panel in PANELS for name in panel)
_INK, _QUIET, _COLOURS = "#1a1a1a", "#6b6b6b", ("#0072B2", "#D55E00")


def revolution(turbine: Turbine, wind: float, pitch: float = 0.0) -> dict[str, float]:
    """Means of states and loads over a revolution in steady, uniform wind [m/s] (SI); pitch [rad] where nobody steers.

    Raises InputError where the turbine has no steady rotation.
    """
    states = turbine.revolution(wind, pitch)
    signals = np.tile([wind, 0.0, 0.0], (len(states), 1))
    series = dict(zip(turbine.layout.names, states.T, strict=True)) | turbine.loads(states, signals, pitch)
    return {name: float(np.mean(values)) for name, values in series.items()}


def winds_of(turbine: Turbine) -> list[float]:
    """Whole m/s from cut-in to cut-out, and rated wind among them."""
    first, last = turbine.operating_wind or (3.0, 25.0)
    whole = set(np.arange(np.ceil(first), last + 1e-9).tolist())
    return sorted(whole | ({round(turbine.rated_wind, 1)} if turbine.rated_wind else set()))


def operating_curves(turbine: Turbine, winds: Sequence[float]) -> dict[str, Array]:
    """{channel: (n,)} of `CHANNELS` over winds [m/s], SI; NaN where there is no steady rotation."""
    rows = []
    for wind in winds:
        try:
            rows.append(revolution(turbine, wind))
        except InputError:
            rows.append({})
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in CHANNELS}


def draw(name: str, winds: Sequence[float], curves: Mapping[str, Array], file: Path) -> None:
    """The curves in panels, into a file of the type that its name says. Raises InputError where it cannot be written."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 8.4), layout="constrained")
    figure.suptitle(
        f"{name} in operation: steady, uniform wind, means over a revolution", fontsize=10, x=0.02, ha="left"
    )
    for axes, panel in zip(figure.subplots(4, 2, sharex=True).ravel(), PANELS, strict=True):
        _panel(axes, winds, panel, curves)
    for axes in figure.axes[-2:]:
        axes.set_xlabel("wind [m/s]", fontsize=8)
    try:
        figure.savefig(file, dpi=150)
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: cannot be written: {error}") from None


def _panel(axes: Axes, winds: Sequence[float], panel: Sequence[str], curves: Mapping[str, Array]) -> None:
    channels = [BY_NAME[name] for name in panel]
    for channel, colour in zip(channels, _COLOURS, strict=False):
        values = curves[channel.name] * channel.scale
        axes.plot(winds, values, color=colour, linewidth=1.2, marker=".", markersize=3, label=channel.label)
    if len(channels) > 1:
        axes.legend(frameon=False, fontsize=7.5)
    label = channels[0].label if len(channels) == 1 else ""
    axes.set_title(f"{label} [{channels[0].read_unit}]".strip(), fontsize=8, loc="left", color=_INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=7.5, color=_QUIET)
    axes.grid(axis="y", linewidth=0.4, color="#d5d5d5")
    axes.margins(y=0.12 if len(channels) == 1 else 0.3)
