"""What wears: rainflow counting (ASTM E1049), damage-equivalent loads, Miner damage on S-N curves, lifetime.

Pure functions over arrays; nothing here knows the simulation. A series is counted once (`rainflow`), every
Wöhler exponent is evaluated on the same ranges (`equivalent_load`), and a NaN or a constant is a stated
condition (`channel_fatigue`), never a number.
"""

from fatigue_runner.fatigue.checks import FatigueInputError
from fatigue_runner.fatigue.climate import (
    Climate,
    TableClimate,
    WindBins,
    WindClimate,
    bin_probabilities,
    iec_climate,
)
from fatigue_runner.fatigue.damage import (
    ChannelFatigue,
    channel_fatigue,
    count_channels,
    damage_equivalent_load,
    damage_ratio,
    equivalent_load,
    goodman,
    load_error,
    miner_damage,
    short_term_cycles,
)
from fatigue_runner.fatigue.lifetime import (
    LifetimeLoad,
    case_probabilities,
    lifetime_equivalent_load,
)
from fatigue_runner.fatigue.rainflow import rainflow
from fatigue_runner.fatigue.sn_curves import SN_CURVES, SNCurve, sn_curve
from fatigue_runner.fatigue.spectra import (
    exceedance,
    extremes,
    level_crossings,
    load_duration,
    markov_matrix,
    spectrum,
)

__all__ = [
    "SN_CURVES",
    "ChannelFatigue",
    "Climate",
    "FatigueInputError",
    "LifetimeLoad",
    "SNCurve",
    "TableClimate",
    "WindBins",
    "WindClimate",
    "bin_probabilities",
    "case_probabilities",
    "channel_fatigue",
    "count_channels",
    "damage_equivalent_load",
    "damage_ratio",
    "equivalent_load",
    "exceedance",
    "extremes",
    "goodman",
    "iec_climate",
    "level_crossings",
    "lifetime_equivalent_load",
    "load_duration",
    "load_error",
    "markov_matrix",
    "miner_damage",
    "rainflow",
    "short_term_cycles",
    "sn_curve",
    "spectrum",
]
