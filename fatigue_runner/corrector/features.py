"""What a corrector sees of a step, by name, in the order of the compiled rows (integrators/correction.py)."""

from __future__ import annotations

from fatigue_runner.channels import STATE_NAMES
from fatigue_runner.errors import InputError, did_you_mean

_DEFLECTIONS = STATE_NAMES[:6]
_RATES = (*STATE_NAMES[8:15], "shaft_twist_rate")
_WIND = ("wind_speed", "vertical_shear", "horizontal_shear")

STAGE_AWARE, RAW, MULTI_BLADE = "stage-aware", "raw", "multi-blade"
KINDS = (STAGE_AWARE, RAW, MULTI_BLADE)


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


def multi_blade(past: int) -> tuple[str, ...]:
    """What a step of an exponential Adams method sees, in the order of its compiled rows (integrators/exponential_adams.py).

    Blades by the mean, cosine and sine part over the azimuth; the wind's shears times its speed; `past` earlier nonlinear parts of the
    accelerations, the newest first, and the one at the predicted end of the step.
    """

    def blades(values: tuple[str, ...]) -> tuple[str, ...]:
        turned = {"1": "mean", "2": "cosine", "3": "sine"}
        return tuple(f"{turned[v[5]]}{v[6:]}" if v.startswith("blade") else v for v in values)

    wind = tuple(f"{w}@{at}" for at in ("start", "middle", "end") for w in _WIND)
    parts = tuple(
        f"nonlinear_{r}_derivative@{at}"
        for at in (*(f"step-{i}" if i else "start" for i in range(past)), "end")
        for r in blades(_RATES)
    )
    return ("one", *blades(_DEFLECTIONS), "shaft_twist", *blades(_RATES), *wind, *parts)


def multi_blade_factors(factors: tuple[str, ...]) -> tuple[int, ...]:
    """Rows of the multi-blade features that hold the factors. Raises InputError for one that this kind does not have."""
    rows = {"wind_speed@start": 16, "rotor_speed": 14}
    for factor in factors:
        if factor not in rows:
            raise InputError(
                f"feature factor {factor!r} does not exist for exponential methods{did_you_mean(factor, rows)}"
            )
    return tuple(rows[f] for f in factors)


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
