"""The names, units and labels of states, wind signals and load channels, as used in tables, logs and API.

Moments are about the blade-root and tower-base axes as OpenFAST's RootMyb/RootMxb and TwrBsMyt/TwrBsMxt, signs included.
"""

from __future__ import annotations

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
# OpenFAST's names of the same quantities, which are understood wherever a channel is named.
OPENFAST = {
    "TwrBsMyt": "tower_base_fore_aft_moment", "TwrBsMxt": "tower_base_side_side_moment",
    **{f"RootMyb{b}": f"blade{b}_root_flapwise_moment" for b in (1, 2, 3)},
    **{f"RootMxb{b}": f"blade{b}_root_edgewise_moment" for b in (1, 2, 3)},
    "LSShftMxa": "low_speed_shaft_torque", "RtAeroFxh": "rotor_thrust", "GenTq": "generator_torque",
    **{f"OoPDefl{b}": f"blade{b}_tip_out_of_plane" for b in (1, 2, 3)},
    **{f"IPDefl{b}": f"blade{b}_tip_in_plane" for b in (1, 2, 3)},
}  # fmt: skip
_LOWER = {name.lower(): ours for name, ours in OPENFAST.items()}


def channel_name(name: str) -> str:
    """This program's name of a channel that may be called by OpenFAST's, in upper or lower case; any other name as it is."""
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
BY_NAME = {c.name: c for c in (*STATES, *T2B2CG.states, *_OF_WIND, *LOADS, *SEEN_OF_CONTROL)}


def wind_channels(columns: int) -> tuple[Channel, ...]:
    """The signals of a wind (n, columns), columns = 3 + 2 M: speed and shears, then the harmonics' pairs c_1, s_1, c_2, ..."""
    return (*WIND_SIGNALS, *WIND_HARMONICS)[:columns]


def wind_names(columns: int) -> tuple[str, ...]:
    """Their names."""
    return tuple(c.name for c in wind_channels(columns))
