"""What a corrector sees of a step, by name, in the order of the compiled rows (integrators/correction.py)."""

from __future__ import annotations

from fatigue_runner.channels import STATE_NAMES
from fatigue_runner.errors import InputError, did_you_mean

_DEFLECTIONS = STATE_NAMES[:6]
_RATES = (*STATE_NAMES[8:15], "shaft_twist_rate")
_WIND = ("wind_speed", "vertical_shear", "horizontal_shear")

STAGE_AWARE, RAW = "stage-aware", "raw"
KINDS = (STAGE_AWARE, RAW)


def stage_aware(stages: int, history: int = 0) -> tuple[str, ...]:
    """1, deflections and velocities with the shaft twist for the azimuths, wind at the step's start, middle and end, sine and cosine
    of the azimuth, h times the accelerations of every stage, and those at the start of `history` steps before [SI]."""
    wind = tuple(f"{w}@{at}" for at in ("start", "middle", "end") for w in _WIND)
    accelerations = tuple(f"step*{r}_derivative@stage{i + 1}" for i in range(stages) for r in _RATES)
    accelerations += tuple(f"step*{r}_derivative@step-{i + 1}" for i in range(history) for r in _RATES)
    return ("one", *_DEFLECTIONS, "shaft_twist", *_RATES, *wind, "sin_azimuth", "cos_azimuth", *accelerations)


def raw() -> tuple[str, ...]:
    """1, the state as it is, azimuths included, and the wind speed: what the network of arXiv 2504.05493 sees."""
    return ("one", *STATE_NAMES, "wind_speed")


# what the features can be multiplied with, so that the affine map may vary over a revolution and with the wind
FACTORS = ("sin_azimuth", "cos_azimuth", "wind_speed@start", "rotor_speed")


MOST_HISTORY = 4  # steps
MOST_ROWS = 512  # room of the compiled loop for features and their products


def names(kind: str, stages: int, factors: tuple[str, ...] = (), history: int = 0) -> tuple[str, ...]:
    """Feature names; for each factor, all of them times it are appended."""
    base = raw() if kind == RAW else stage_aware(stages, history)
    return (*base, *(f"{n}*{f}" for f in factors for n in base))


def factor_rows(factors: tuple[str, ...]) -> tuple[int, ...]:
    """Rows of the stage-aware features that hold the factors. Raises InputError for an unknown one."""
    base = stage_aware(0)
    for factor in factors:
        if factor not in FACTORS:
            raise InputError(f"unknown feature factor {factor!r}{did_you_mean(factor, FACTORS)}")
    return tuple(base.index(f) for f in factors)
