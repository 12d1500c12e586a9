"""From cycles to figures: damage-equivalent loads, Miner damage, mean-stress correction, load errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fatigue_runner.fatigue.checks import (
    FatigueInputError,
    cycles_of,
    first_not_finite,
    non_negative,
    positive,
)
from fatigue_runner.fatigue.rainflow import rainflow, residue_count
from fatigue_runner.fatigue.sn_curves import SNCurve, sn_curve
from fatigue_runner.values import unmasked

# A channel whose values agree to this fraction of their magnitude is constant: the rest is rounding.
CONSTANT_TO = 1e-10


def equivalent_load(ranges: Any, counts: Any, m: Any, n_eq: float) -> Any:
    """Constant load range that does the same damage in `n_eq` cycles: (Σ n Sᵐ / n_eq)^(1/m).

    ranges, counts: (n,) load ranges [unit of the channel] and their cycle counts. m: one Wöhler exponent,
    which gives a float, or several, which give an array (len(m),), all on the same cycles. No cycles give 0.
    Raises FatigueInputError for NaN or negative ranges or counts, and for m or n_eq not above zero.
    Source: IEC TS 61400-13, annex on equivalent loads; power sum, so bins combine as Σ n Sᵐ.
    """
    r, n = cycles_of(ranges, counts)
    equivalent_cycles = positive("n_eq", n_eq)
    exponents = [positive("the Wöhler exponent m", e) for e in np.atleast_1d(np.asarray(m, dtype=np.float64))]
    largest = float(r.max(initial=0.0))
    if largest == 0.0:
        loads = np.zeros(len(exponents))
    else:
        relative = r / largest  # so that no power overflows, whatever the unit and the exponent
        sums = np.array([n @ relative**e for e in exponents])
        loads = largest * (sums / equivalent_cycles) ** (1.0 / np.array(exponents))
    return float(loads[0]) if np.ndim(m) == 0 else loads


def damage_equivalent_load(
    series: Any, m: Any, n_eq: float, residue: str = "half", ultimate: float | None = None
) -> Any:
    """Damage-equivalent load range of a load series, for one Wöhler exponent (a float) or several (an array).

    series: (n,) load [unit of the channel]; n_eq: equivalent cycles (`short_term_cycles(duration)` for the
    1-Hz load). The series is counted once (ASTM E1049) whatever the number of exponents. `ultimate` asks for
    Goodman's correction with that strength. A constant series has DEL 0.
    Raises FatigueInputError for NaN or infinity, naming the index. Source: see `equivalent_load`.
    """
    ranges, means, counts = rainflow(series, residue)
    if ultimate is not None:
        ranges = goodman(ranges, means, ultimate)
    return equivalent_load(ranges, counts, m, n_eq)


def short_term_cycles(duration: float, frequency: float = 1.0) -> float:
    """`frequency` [Hz] x `duration` [s]: the n_eq that makes DELs of unequal durations comparable."""
    return positive("frequency", frequency) * positive("duration", duration)


def goodman(ranges: Any, means: Any, ultimate: float, fixed_mean: float = 0.0) -> np.ndarray:
    """Ranges that do the same damage at `fixed_mean`: S (S_u - S_f) / (S_u - S_m).

    ranges, means: (n,) and ultimate strength S_u in one unit. Tension is positive and compression earns
    credit; where the sign is a mere axis convention, pass the magnitudes of the means, as MLife does.
    Raises FatigueInputError when a mean reaches the ultimate strength (a static failure, not fatigue).
    Source: Goodman (1899); with a fixed mean as in MLife's theory manual (NREL, 2012).
    """
    strength = positive("the ultimate strength", ultimate)
    s = non_negative("load ranges", ranges)
    mean = np.asarray(unmasked("the means", means, FatigueInputError), dtype=np.float64)
    if not (mean < strength).all() or not fixed_mean < strength:
        raise FatigueInputError(
            f"a mean of {np.max(mean, initial=fixed_mean):g} reaches the ultimate strength {strength:g}: "
            "static failure, Goodman's correction does not apply; check the unit of `ultimate`"
        )
    return s * (strength - fixed_mean) / (strength - mean)


def miner_damage(ranges: Any, counts: Any, curve: SNCurve | str, scale: float = 1.0) -> float:
    """Miner's sum Σ n / N(scale · S); 1 is failure.

    ranges, counts: (n,) ranges and cycle counts; curve: an S-N curve or its name in `SN_CURVES`; scale:
    stress [unit of the curve] per unit of range, e.g. 1e-6 / section modulus [m³] from N·m to MPa.
    Raises FatigueInputError for NaN or negative ranges and unknown curves.
    Source: Palmgren (1924), Miner (1945).
    """
    r, n = cycles_of(ranges, counts)
    known = sn_curve(curve) if isinstance(curve, str) else curve
    return float(np.sum(n / known.cycles_to_failure(positive("scale", scale) * r)))


def damage_ratio(load: float | None, reference: float | None, m: float) -> float | None:
    """Damage over the reference's damage, (DEL/DEL_ref)ᵐ; None without a DEL or with a reference of 0."""
    if load is None or not reference:
        return None
    with np.errstate(over="ignore"):  # a load near divergence: infinitely worse is the answer
        return float(np.float64(load / reference) ** m)


def load_error(load: float | None, reference: float | None) -> float | None:
    """Relative error of a DEL, DEL/DEL_ref - 1, m times this in damage; None as for `damage_ratio`."""
    return None if load is None or not reference else float(load / reference - 1.0)


@dataclass(frozen=True)
class ChannelFatigue:
    """What one channel of one case wore; `condition` says why there is no figure, None where there is one.

    cycles: sum of the counts; largest_range [unit of the channel]; loads {Wöhler exponent: short-term (1-Hz)
    DEL}, empty under a condition, so that a table shows nothing there rather than 0.
    """

    condition: str | None
    cycles: float = 0.0
    largest_range: float = 0.0
    loads: dict[float, float] = field(default_factory=dict)

    def load(self, m: float) -> float | None:
        """DEL for the exponent `m`, None under a condition."""
        return self.loads[m] if self.condition is None else None


def channel_fatigue(
    series: Any, exponents: Sequence[float], duration: float, residue: str = "half"
) -> ChannelFatigue:
    """Count a channel once and evaluate every exponent; a NaN or a constant gives a condition, not a number.

    series: (n,) [unit of the channel]; duration [s] sets n_eq at 1 Hz. Raises FatigueInputError for bad
    exponents or duration only.
    """
    return count_channels({"": series}, exponents, duration, residue)[""]


def count_channels(
    loads: Mapping[str, Any], exponents: Sequence[float], duration: float, residue: str = "half"
) -> dict[str, ChannelFatigue]:
    """What every channel of a case wore, in one compiled call: each is counted once, all exponents on the same cycles.

    loads {channel: (n,)}, of one length; duration [s] sets n_eq at 1 Hz. A channel that is not finite, too short or constant has a
    condition. Raises FatigueInputError for bad exponents, duration or residue only.
    """
    n_eq = short_term_cycles(duration)
    wanted = np.array([positive("the Wöhler exponent m", m) for m in exponents])
    share = residue_count(residue)
    found: dict[str, ChannelFatigue] = {}
    block = {}
    for name, series in loads.items():
        values = np.ascontiguousarray(np.ma.filled(np.ma.asarray(series, dtype=np.float64), np.nan))
        condition = channel_condition(values)
        if condition is None:
            block[name] = values
        else:
            found[name] = ChannelFatigue(condition)
    if block:
        from fatigue_runner.fatigue import (
            kernel,
        )  # numba takes long to import, and a campaign's worker has it anyway

        sums, largest, total = kernel.channel_sums(np.stack(list(block.values())), wanted, share)
        equivalent = largest[:, None] * (sums / n_eq) ** (1.0 / wanted)
        for i, name in enumerate(block):
            by_exponent = {float(m): float(load) for m, load in zip(exponents, equivalent[i], strict=True)}
            found[name] = ChannelFatigue(None, float(total[i]), float(largest[i]), by_exponent)
    return {name: found[name] for name in loads}


def channel_condition(values: np.ndarray) -> str | None:
    """Why a channel (n,) has no fatigue, in words: not finite, too short, constant; None when it has."""
    index = first_not_finite(values)
    if index is not None:
        return f"not finite from sample {index} of {values.size}"
    if values.size < 3:
        return f"only {values.size} samples"
    low, high = float(values.min()), float(values.max())
    if high / 2.0 - low / 2.0 > np.finfo(np.float64).max / 2.0:
        return "range beyond the largest number"
    return "constant" if high - low <= CONSTANT_TO * max(abs(low), abs(high)) else None
