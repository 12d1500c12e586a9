"""A turbine in tables: masses, power coefficient, operating points, natural frequencies, and the methods' stability limits on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fatigue_runner.channels import BY_NAME
from fatigue_runner.errors import InputError
from fatigue_runner.integrators.methods import METHODS
from fatigue_runner.integrators.operating_curves import CHANNELS, draw, operating_curves, revolution, winds_of
from fatigue_runner.integrators.stability import stability_limit
from fatigue_runner.turbine import load_turbine
from fatigue_runner.turbine.beam import blade_modes, tower_modes
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.turbine.loop import check_loop, speed_mode
from fatigue_runner.turbine.turbine import CONTROLLED, FIXED

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from fatigue_runner.turbine import Turbine
    from fatigue_runner.turbine.deck.importing import Imported


def print_turbine(
    name: str, winds: Sequence[float], pitch_deg: float, console: Console, plot: Path | None = None
) -> None:
    """Masses, power coefficient, operating points, frequencies and stability limits of a turbine, and how it operates under its controller.

    name: shipped turbine or path; winds [m/s]; pitch_deg: positive to feather; plot: a file for the operating curves.
    Raises InputError for an unknown turbine, for a wind or a pitch without steady rotation, for a controller that makes the turbine
    unstable, and for a plot of a turbine that has none.
    """
    turbine = load_turbine(name)
    pitch = float(np.deg2rad(pitch_deg))
    console.print(f"[bold]{turbine.name}[/]  {turbine.description}", soft_wrap=True)
    console.print(f"hash {turbine.hash}", soft_wrap=True)
    console.print(_masses(name, turbine))
    console.print(_operating_points(turbine, winds, pitch))
    console.print(_frequencies(turbine, winds, pitch))
    console.print(_stability(turbine))
    if turbine.control is not None:
        _print_operation(turbine.operated(CONTROLLED), console, plot)
    elif plot is not None:
        raise InputError(
            f"turbine {turbine.name} has no `control` section, so that there are no operating curves; leave --plot out"
        )


def _print_operation(turbine: Turbine, console: Console, plot: Path | None) -> None:
    """Gains, operating points and the speed loop; the drawing where a file for it is given."""
    check_loop(turbine)
    winds = winds_of(turbine)
    curves = operating_curves(turbine, winds)
    console.print(_operation(turbine, winds, curves))
    if plot is not None:
        draw(turbine.name, winds, curves, plot)
        console.print(f"wrote {plot}", soft_wrap=True)


def _operation(turbine: Turbine, winds: Sequence[float], curves: Mapping[str, Any]) -> Table:
    names = [name for name in CHANNELS if name not in _NOT_PRINTED]
    headings = [f"{_SHORT.get(name, BY_NAME[name].label)}, {BY_NAME[name].read_unit}" for name in names]
    table = _plain_table("Operation under the controller", "wind, m/s", *headings, "speed loop, Hz (damping)")
    for place, wind in enumerate(winds):
        values = [_figure(curves[name][place] * BY_NAME[name].scale) for name in names]
        mode = speed_mode(turbine, wind) if turbine.rated_wind and wind > turbine.rated_wind else None
        told = "" if mode is None else f"{mode.frequency / (2 * np.pi):.3f} ({mode.damping:.2f})"
        table.add_row(f"{wind:g}", *values, told)
    control = turbine.control or {}
    gains = ", ".join(f"{key} {control[key]:.5g}" for key in _GAINS if control.get(key) is not None)
    source = "from `tuning`" if control.get("tuning") else "as the file gives them"
    table.caption = f"means over a revolution, uniform wind; gains {source}: {gains}"
    return table


def _figure(value: float) -> str:
    """Four digits, none of a power of ten; what is nothing beside its range is nothing."""
    if not np.isfinite(value):
        return "-"
    return f"{value:,.0f}" if abs(value) >= 1e3 else f"{value:.4g}" if abs(value) >= 1e-3 else "0"


_NOT_PRINTED = ("blade1_root_edgewise_moment", "tower_base_side_side_moment", "tower_fore_aft")
_SHORT = {
    "generator_power": "power",
    "generator_torque": "generator torque",
    "rotor_thrust": "thrust",
    "blade1_tip_out_of_plane": "tip out of plane",
    "blade1_root_flapwise_moment": "root flapwise moment",
    "tower_base_fore_aft_moment": "tower-base fore-aft moment",
}
_GAINS = ("proportional_gain", "integral_gain", "gain_schedule_pitch_deg")


CURVE = (4.0, 6.0, 8.0, 10.0, 12.0, 15.0, 20.0, 25.0)  # m/s


# m/s; the tips of large turbines reach 70 to 105 at rated speed
FASTEST_TIPS = 110.0


def print_imported(made: Imported, console: Console) -> None:
    """A turbine that was imported from a deck: its masses, modes and operating curve, what was decided, what "
    "is left out, what comes next."""
    from rich.markup import escape

    name = str(made.turbine)
    turbine = load_turbine(name)
    console.print(f"[bold]{escape(turbine.name)}[/]  {escape(turbine.description)}", soft_wrap=True)
    console.print(_masses(name, turbine))
    curve = _curve(turbine)
    console.print(curve)
    winds = [wind for wind in (6.0, 8.0, 10.0) if _steady(turbine, wind)]
    if winds:
        console.print(_frequencies(turbine, winds, 0.0))
    if made.notes:
        console.print("[bold]Decided on the way[/]")
        for note in made.notes:
            console.print(f"- {escape(note)}", soft_wrap=True)
        console.print()
    table = _plain_table("The deck has, the model leaves out", "what", "what that means for fatigue")
    table.columns[1].justify = "left"
    for omission in made.omissions:
        table.add_row(escape(omission.what), escape(omission.means))
    console.print(table)
    for path in (made.turbine, made.airfoils, made.tables):
        console.print(f"wrote {escape(str(path))}", soft_wrap=True)
    console.print(
        f"next: `turbine: {escape(name)}` in a campaign; `fatigue-runner train --turbine {escape(name)}` for its correctors",
        soft_wrap=True,
    )


def _steady(turbine: Turbine, wind: float) -> bool:
    try:
        turbine.operating_point(wind)
    except InputError:
        return False
    return True


def _curve(turbine: Turbine) -> Table:
    """Steady operation over the wind, under the controller where there is one."""
    mode = CONTROLLED if turbine.control is not None else FIXED
    operated = turbine.operated(mode)
    names = (
        "rotor_speed",
        "generator_torque",
        "rotor_thrust",
        "blade1_root_flapwise_moment",
        "tower_base_fore_aft_moment",
    )
    headings = [f"{BY_NAME[name].label}, {BY_NAME[name].read_unit}" for name in names]
    table = _plain_table("Operating curve", "wind, m/s", "pitch, deg", "generator power, kW", *headings)
    for wind in CURVE:
        try:
            values = _means_over_a_revolution(operated, wind, 0.0)
        except InputError:
            table.add_row(f"{wind:g}", *["-"] * (2 + len(names)))
            continue
        if mode == FIXED and values["rotor_speed"] * turbine.rotor_radius > FASTEST_TIPS:
            break
        power = values["generator_torque"] * values["generator_speed"] / 1e3
        pitch = np.degrees(values.get("pitch", 0.0))
        table.add_row(
            f"{wind:g}",
            f"{pitch:.2f}",
            f"{power:,.0f}",
            *(f"{values[name] * BY_NAME[name].scale:,.4g}" for name in names),
        )
    table.caption = (
        "under its controller"
        if mode == CONTROLLED
        else f"at zero pitch: there is no controller, so nothing holds speed and power, which grow beyond what the machine is rated for; "
        f"left out where the tips are faster than {FASTEST_TIPS:g} m/s; -: no steady rotation; a section `control` gives the rest "
        "(docs/turbines.md)"
    )
    return table


def _plain_table(title: str, *headings: str) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, title=title, title_justify="left")
    table.add_column(headings[0])
    for heading in headings[1:]:
        table.add_column(heading.replace(" (", "\n("), justify="right")
    return table


def _masses(name: str, turbine: Turbine) -> Table:
    data = read_turbine_file(name)
    blade, tower = blade_modes(data), tower_modes(data)
    # P = Omega Q and c_torque is Q over rho/2 A V^2 R (all blades), hence C_p = lambda c_torque.
    power = turbine.tables.tip_speed_ratio[:, None] * turbine.tables.coefficients["torque"]
    i, j = np.unravel_index(np.argmax(power), power.shape)
    table = _plain_table("Check values", "", "value", "unit")
    for what, value, unit in (
        ("blade mass", f"{blade.mass:,.0f}", "kg"),
        ("blade first moment about its root", f"{blade.first_moment:,.0f}", "kg·m"),
        ("blade second moment about its root", f"{blade.second_moment:,.0f}", "kg·m²"),
        ("tower mass", f"{tower.mass:,.0f}", "kg"),
        ("tower centre of mass above its base", f"{tower.first_moment / tower.mass:.3f}", "m"),
        ("largest power coefficient of the tables", f"{power[i, j]:.4f}", "-"),
        ("... at tip-speed ratio", f"{turbine.tables.tip_speed_ratio[i]:.2f}", "-"),
        ("... at pitch", f"{np.rad2deg(turbine.tables.pitch[j]):.1f}", "deg"),
    ):
        table.add_row(what, value, unit)
    return table


def _operating_points(turbine: Turbine, winds: Sequence[float], pitch: float) -> Table:
    names = (
        *("rotor_speed", "generator_torque", "tower_fore_aft", "blade1_tip_out_of_plane"),
        *("blade1_root_flapwise_moment", "tower_base_fore_aft_moment", "rotor_thrust"),
    )
    headings = [f"{BY_NAME[name].label}, {BY_NAME[name].read_unit}" for name in names]
    table = _plain_table("Operating points", "wind, m/s", *headings)
    for wind in winds:
        values = revolution(turbine, wind, pitch)
        table.add_row(f"{wind:g}", *(_figure(values[name] * BY_NAME[name].scale) for name in names))
    table.caption = "means over a revolution, without shear"
    return table


def _means_over_a_revolution(turbine: Turbine, wind: float, pitch: float) -> dict[str, float]:
    azimuths = np.arange(24) * 2 * np.pi / 24
    states = np.array([turbine.operating_point(wind, azimuth=azimuth, pitch=pitch) for azimuth in azimuths])
    signals = np.tile([wind, 0.0, 0.0], (len(azimuths), 1))
    series = dict(zip(turbine.layout.names, states.T, strict=True)) | turbine.loads(states, signals, pitch)
    series |= {"pitch": turbine.commanded(states).get("pitch", np.full(len(azimuths), pitch))}
    return {name: float(np.mean(values)) for name, values in series.items()}


def _frequencies(turbine: Turbine, winds: Sequence[float], pitch: float) -> Table:
    modes = [turbine.natural_frequencies(wind, pitch) for wind in winds]
    table = _plain_table("Natural frequencies", "mode", *(f"{wind:g} m/s" for wind in winds))
    for mode, _, _ in modes[0]:
        found = [next((m for m in at_wind if m[0] == mode), None) for at_wind in modes]
        table.add_row(mode, *("" if m is None else f"{m[1]:.4f} Hz ({100 * m[2]:.2f} %)" for m in found))
    table.caption = "damping ratio in parentheses; of the spinning turbine at its operating point"
    return table


def _stability(turbine: Turbine) -> Table:
    table = _plain_table("Stability limits", "method", "largest step, ms")
    for method in METHODS:
        table.add_row(method, f"{1e3 * stability_limit(turbine, method):.3g}")
    table.caption = "linearised at 8 m/s"
    return table
