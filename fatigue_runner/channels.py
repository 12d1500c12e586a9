"""The names, units and labels of states, wind signals and load channels, as used in tables, logs and API.

Moments are about the blade-root and tower-base axes as OpenFAST's RootMyb/RootMxb and TwrBsMyt/TwrBsMxt, signs included.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from fatigue_runner.layout import ACROSS, DEGREES, HARMONICS, SEEN_OF_CONTROL, T2B1I1CG, T2B2CG
from fatigue_runner.layout import Channel as Channel

STATES = T2B1I1CG.states
GROWING = tuple(
    c.name for c in STATES[T2B1I1CG.rotor : T2B1I1CG.freedoms]
)  # azimuths, which have no extremes
WIND_SIGNALS = T2B1I1CG.wind
WIND_ACROSS = ACROSS  # what a wind has beside them that does not blow straight on
WIND_HARMONICS = HARMONICS  # and one of more than one harmonic

_BY_EQUATIONS = (
    Channel("tower_base_fore_aft_moment", "N.m", "tower-base fore-aft moment", "kN·m", 1e-3),
    Channel("tower_base_side_side_moment", "N.m", "tower-base side-side moment", "kN·m", 1e-3),
    Channel("blade1_root_flapwise_moment", "N.m", "blade 1 root flapwise moment", "kN·m", 1e-3),
    Channel("blade2_root_flapwise_moment", "N.m", "blade 2 root flapwise moment", "kN·m", 1e-3),
    Channel("blade3_root_flapwise_moment", "N.m", "blade 3 root flapwise moment", "kN·m", 1e-3),
    Channel("blade1_root_edgewise_moment", "N.m", "blade 1 root edgewise moment", "kN·m", 1e-3),
    Channel("blade2_root_edgewise_moment", "N.m", "blade 2 root edgewise moment", "kN·m", 1e-3),
    Channel("blade3_root_edgewise_moment", "N.m", "blade 3 root edgewise moment", "kN·m", 1e-3),
    Channel("low_speed_shaft_torque", "N.m", "low-speed shaft torque", "kN·m", 1e-3),
    Channel("rotor_thrust", "N", "rotor thrust (aerodynamic)", "kN", 1e-3),
    Channel("generator_torque", "N.m", "generator torque (high-speed side)", "kN·m", 1e-3),
    Channel("blade1_tip_out_of_plane", "m", "blade 1 tip out-of-plane deflection", "m"),
    Channel("blade2_tip_out_of_plane", "m", "blade 2 tip out-of-plane deflection", "m"),
    Channel("blade3_tip_out_of_plane", "m", "blade 3 tip out-of-plane deflection", "m"),
    Channel("blade1_tip_in_plane", "m", "blade 1 tip in-plane deflection", "m"),
    Channel("blade2_tip_in_plane", "m", "blade 2 tip in-plane deflection", "m"),
    Channel("blade3_tip_in_plane", "m", "blade 3 tip in-plane deflection", "m"),
    Channel("tower_top_fore_aft_acceleration", "m/s2", "tower-top fore-aft acceleration", "m/s²"),
    Channel("tower_top_side_side_acceleration", "m/s2", "tower-top side-side acceleration", "m/s²"),
)

# What follows of them and of who steers (OpenFAST's GenPwr and BldPitch1)
_BY_OPERATION = (
    Channel("generator_power", "W", "generator power (electrical)", "kW", 1e-3),
    Channel("blade_pitch", "rad", "blade pitch", "deg", DEGREES),
)

LOADS = (*_BY_EQUATIONS, *_BY_OPERATION)
EQUATION_LOADS = tuple(c.name for c in _BY_EQUATIONS)
# OpenFAST's names of the same quantities, which are understood wherever a channel is named; the first of a quantity is told in tables
OPENFAST = {
    "TwrBsMyt": "tower_base_fore_aft_moment", "TwrBsMxt": "tower_base_side_side_moment",
    **{f"RootMyb{b}": f"blade{b}_root_flapwise_moment" for b in (1, 2, 3)},
    **{f"RootMxb{b}": f"blade{b}_root_edgewise_moment" for b in (1, 2, 3)},
    **{f"RootMFlp{b}": f"blade{b}_root_flapwise_moment" for b in (1, 2, 3)},
    **{f"RootMEdg{b}": f"blade{b}_root_edgewise_moment" for b in (1, 2, 3)},
    "RotTorq": "low_speed_shaft_torque", "LSShftTq": "low_speed_shaft_torque", "LSShftMxa": "low_speed_shaft_torque",
    "RtAeroFxh": "rotor_thrust", "GenTq": "generator_torque", "GenPwr": "generator_power",
    **{f"OoPDefl{b}": f"blade{b}_tip_out_of_plane" for b in (1, 2, 3)},
    **{f"TipDxc{b}": f"blade{b}_tip_out_of_plane" for b in (1, 2, 3)},
    **{f"IPDefl{b}": f"blade{b}_tip_in_plane" for b in (1, 2, 3)},
    **{f"TipDyc{b}": f"blade{b}_tip_in_plane" for b in (1, 2, 3)},
    **{f"BldPitch{b}": "blade_pitch" for b in (1, 2, 3)},
    "YawBrTAxp": "tower_top_fore_aft_acceleration", "YawBrTAyp": "tower_top_side_side_acceleration",
    "TTDspFA": "tower_fore_aft", "YawBrTDxt": "tower_fore_aft", "TTDspSS": "tower_side_side", "YawBrTDyt": "tower_side_side",
    "RotSpeed": "rotor_speed", "GenSpeed": "generator_speed", "HSShftV": "generator_speed",
    "Azimuth": "rotor_azimuth", "RtVAvgxh": "wind_speed",
}  # fmt: skip
_LOWER = {name.lower(): ours for name, ours in OPENFAST.items()}


# --- loads of sections, where a campaign asks for them: named by their place ---


def _moment(name: str, label: str) -> Channel:
    return Channel(name, "N.m", label, "kN·m", 1e-3)


def fore_aft_at(height: float) -> Channel:
    """Bending moment of the tower at a height above its foot [m]."""
    return _moment(f"tower_{height:g}m_fore_aft_moment", f"tower fore-aft moment at {height:g} m")


def side_side_at(height: float) -> Channel:
    """The same, side-side."""
    return _moment(f"tower_{height:g}m_side_side_moment", f"tower side-side moment at {height:g} m")


def flapwise_at(radius: float) -> Channel:
    """Bending moment of blade 1 at a distance from the rotor's apex [m]."""
    return _moment(f"blade1_{radius:g}m_flapwise_moment", f"blade 1 flapwise moment at {radius:g} m")


def edgewise_at(radius: float) -> Channel:
    """The same, edgewise."""
    return _moment(f"blade1_{radius:g}m_edgewise_moment", f"blade 1 edgewise moment at {radius:g} m")


def towards(angle: float) -> Channel:
    """Bending moment of blade 1's root by direction [deg]: 0 flapwise, 90 edgewise, and turning with the pitch as they do."""
    return _moment(f"blade1_root_moment_{angle:g}deg", f"blade 1 root moment at {angle:g}°")


def sections(heights: Iterable[float], radii: Iterable[float], directions: int) -> tuple[Channel, ...]:
    """All loads of sections at heights and radii [m], and of the root in `directions` over half a circle: a bending moment the other
    way has the same ranges."""
    return (
        *(at(h) for h in heights for at in (fore_aft_at, side_side_at)),
        *(at(r) for r in radii for at in (flapwise_at, edgewise_at)),
        *(towards(i * 180.0 / directions) for i in range(directions)),
    )


_PLACED = {
    re.compile(rf"^{pattern}$"): make
    for pattern, make in {
        r"tower_([\d.e+-]+)m_fore_aft_moment": fore_aft_at,
        r"tower_([\d.e+-]+)m_side_side_moment": side_side_at,
        r"blade1_([\d.e+-]+)m_flapwise_moment": flapwise_at,
        r"blade1_([\d.e+-]+)m_edgewise_moment": edgewise_at,
        r"blade1_root_moment_([\d.]+)deg": towards,
    }.items()
}
_GAUGES = {
    re.compile(rf"^{pattern}$", re.IGNORECASE): make
    for pattern, make in {
        r"TwHt(\d)MLyt": fore_aft_at, r"TwHt(\d)MLxt": side_side_at, r"Spn(\d)MLyb1": flapwise_at, r"Spn(\d)MLxb1": edgewise_at,
    }.items()
}  # fmt: skip


class Placed(NamedTuple):
    """A load of a section: its channel, where it is [m, or deg of a direction], and what all along a beam have in common."""

    channel: Channel
    at: float
    kind: Callable[[float], Channel]


def placed(name: str) -> Placed | None:
    """The load of a section of this name; None for any other channel."""
    for pattern, make in _PLACED.items():
        if (found := pattern.match(name)) and (number := _number(found[1])) is not None:
            channel = make(number)
            return Placed(channel, number, make) if channel.name == name else None
    return None


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def of_section(name: str) -> bool:
    """Whether a name is that of a section's load, by this program's or by OpenFAST's gauge."""
    return placed(name) is not None or any(pattern.match(name) for pattern in _GAUGES)


def channel_name(name: str, there: Iterable[str] = ()) -> str:
    """This program's name of a channel that may be called by OpenFAST's, in upper or lower case; any other name as it is.

    there: the channels among which it is looked for; OpenFAST's gauges (`TwHt1MLyt`, `Spn2MLxb1`) are the first, second, ... of the
    sections there, from tower foot or blade root on.
    """
    for pattern, make in _GAUGES.items():
        if gauge := pattern.match(name):
            found = sorted((p.at, p.channel.name) for n in there if (p := placed(n)) and p.kind is make)
            number = int(gauge[1])
            return found[number - 1][1] if 0 < number <= len(found) else name
    return _LOWER.get(name.lower(), name)


STATE_NAMES = tuple(c.name for c in STATES)
WIND_NAMES = tuple(c.name for c in WIND_SIGNALS)
LOAD_NAMES = tuple(c.name for c in LOADS)

# The channels whose fatigue is reported, unless a campaign names others.
FATIGUE_CHANNELS = (
    "blade1_root_flapwise_moment",
    "blade1_root_edgewise_moment",
    "tower_base_fore_aft_moment",
    "tower_base_side_side_moment",
)

_OF_WIND = (*WIND_SIGNALS, *WIND_ACROSS, *WIND_HARMONICS)


class _Known(dict[str, Channel]):
    """Channels by name: those that every turbine has, and any load of a section."""

    def __missing__(self, name: str) -> Channel:
        found = placed(name)
        if found is None:
            raise KeyError(name)
        return found.channel

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or (isinstance(name, str) and placed(name) is not None)

    def get(self, name: str, default: Any = None) -> Any:
        try:
            return self[name]
        except KeyError:
            return default


BY_NAME = _Known((c.name, c) for c in (*STATES, *T2B2CG.states, *_OF_WIND, *LOADS, *SEEN_OF_CONTROL))


def wind_channels(columns: int) -> tuple[Channel, ...]:
    """The signals of a wind (n, columns), columns = 3 + 2 M: speed and shears, then the harmonics' pairs c_1, s_1, c_2, ..."""
    return (*WIND_SIGNALS, *WIND_HARMONICS)[:columns]
