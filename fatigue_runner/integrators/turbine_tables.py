"""A turbine in tables: masses, power coefficient, operating points, natural frequencies, and the methods' stability limits on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fatigue_runner.channels import BY_NAME
from fatigue_runner.integrators.methods import METHODS
from fatigue_runner.integrators.stability import stability_limit
from fatigue_runner.turbine import load_turbine
from fatigue_runner.turbine.beam import blade_modes, tower_modes
from fatigue_runner.turbine.file import read_turbine_file

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from fatigue_runner.turbine import Turbine


def print_turbine(name: str, winds: Sequence[float], pitch_deg: float, console: Console) -> None:
    """Masses, power coefficient, operating points, frequencies and stability limits of a turbine.

    name: shipped turbine or path; winds [m/s]; pitch_deg: positive to feather.
    Raises InputError for an unknown turbine, and for a wind or a pitch without steady rotation.
    """
    turbine = load_turbine(name)
    pitch = float(np.deg2rad(pitch_deg))
    console.print(f"[bold]{turbine.name}[/]  {turbine.description}", soft_wrap=True)
    console.print(f"hash {turbine.hash}", soft_wrap=True)
    console.print(_masses(name, turbine))
    console.print(_operating_points(turbine, winds, pitch))
    console.print(_frequencies(turbine, winds, pitch))
    console.print(_stability(turbine))


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
        values = _means_over_a_revolution(turbine, wind, pitch)
        table.add_row(f"{wind:g}", *(f"{values[name] * BY_NAME[name].scale:,.4g}" for name in names))
    table.caption = "means over a revolution, without shear"
    return table


def _means_over_a_revolution(turbine: Turbine, wind: float, pitch: float) -> dict[str, float]:
    azimuths = np.arange(24) * 2 * np.pi / 24
    states = np.array([turbine.operating_point(wind, azimuth=azimuth, pitch=pitch) for azimuth in azimuths])
    signals = np.tile([wind, 0.0, 0.0], (len(azimuths), 1))
    series = dict(zip(turbine.layout.names, states.T, strict=True)) | turbine.loads(states, signals, pitch)
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
