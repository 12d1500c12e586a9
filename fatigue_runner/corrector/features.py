"""What a corrector sees of a step, by name, in the order of the compiled rows (integrators/correction.py), and where it stands.

The one place of this room that knows which rows of a state are what.
"""

from __future__ import annotations

from fatigue_runner.channels import STATE_NAMES, WIND_NAMES
from fatigue_runner.errors import InputError, did_you_mean

STATES = len(STATE_NAMES)
FREEDOMS = STATES // 2  # coordinates; the row of a coordinate's rate is this much further on
ROTOR, GENERATOR = (STATE_NAMES.index(f"{part}_azimuth") for part in ("rotor", "generator"))
ROTOR_SPEED, GENERATOR_SPEED = FREEDOMS + ROTOR, FREEDOMS + GENERATOR
FLAP = STATE_NAMES.index("blade1_flap")  # the first of three blades in a row
# first rows of three blades in a row: in the state, in relative coordinates, among accelerations
STATE_BLADES, RELATIVE_BLADES, PART_BLADES = (FLAP, FREEDOMS + FLAP), (FLAP, FREEDOMS - 1 + FLAP), (FLAP,)
# the edge mode and the shaft, and their rates: the largest errors of a run; what a robust fit watches
DRIVE = tuple(
    STATE_NAMES.index(name)
    for name in ("edge", "generator_azimuth", "edge_velocity", "rotor_speed", "generator_speed")
)

_DEFLECTIONS = STATE_NAMES[:ROTOR]
_RATES = (*STATE_NAMES[FREEDOMS:GENERATOR_SPEED], "shaft_twist_rate")

STAGE_AWARE, RAW, MULTI_BLADE = "stage-aware", "raw", "multi-blade"

# what the features can be multiplied with, so that the affine map may vary over a revolution and with the wind
FACTORS = ("sin_azimuth", "cos_azimuth", "wind_speed@start", "rotor_speed")
MULTI_BLADE_FACTORS = ("wind_speed@start", "rotor_speed")

MOST_HISTORY = 4  # steps
MOST_ROWS = 512  # room of the compiled loop for features and their products


def _winds() -> tuple[str, ...]:
    return tuple(f"{w}@{at}" for at in ("start", "middle", "end") for w in WIND_NAMES)


def stage_aware(stages: int, history: int = 0) -> tuple[str, ...]:
    """1, deflections and velocities with the shaft twist for the azimuths, wind at the step's start, middle and end, sine and cosine
    of the azimuth, h times the accelerations of every stage, and those at the start of `history` steps before [SI]."""
    accelerations = tuple(f"step*{r}_derivative@stage{i + 1}" for i in range(stages) for r in _RATES)
    accelerations += tuple(f"step*{r}_derivative@step-{i + 1}" for i in range(history) for r in _RATES)
    return (
        "one",
        *_DEFLECTIONS,
        "shaft_twist",
        *_RATES,
        *_winds(),
        "sin_azimuth",
        "cos_azimuth",
        *accelerations,
    )


def raw() -> tuple[str, ...]:
    """1, the state as it is, azimuths included, and the wind speed: what the network of arXiv 2504.05493 sees."""
    return ("one", *STATE_NAMES, WIND_NAMES[0])


def multi_blade(past: int) -> tuple[str, ...]:
    """What a step of an exponential Adams method sees, in the order of its compiled rows (integrators/exponential_adams.py).

    Blades by the mean, cosine and sine part over the azimuth; the wind's shears times its speed; `past` earlier nonlinear parts of the
    accelerations, the newest first, and the one at the predicted end of the step.
    """

    def blades(values: tuple[str, ...]) -> tuple[str, ...]:
        turned = {"1": "mean", "2": "cosine", "3": "sine"}
        return tuple(f"{turned[v[5]]}{v[6:]}" if v.startswith("blade") else v for v in values)

    parts = tuple(
        f"nonlinear_{r}_derivative@{at}"
        for at in (*(f"step-{i}" if i else "start" for i in range(past)), "end")
        for r in blades(_RATES)
    )
    return ("one", *blades(_DEFLECTIONS), "shaft_twist", *blades(_RATES), *_winds(), *parts)


def with_factors(names: tuple[str, ...], factors: tuple[str, ...]) -> tuple[str, ...]:
    """For each factor, all names times it are appended."""
    return (*names, *(f"{n}*{f}" for f in factors for n in names))


def factor_rows(factors: tuple[str, ...]) -> tuple[int, ...]:
    """Rows of the stage-aware features that hold the factors. Raises InputError for an unknown one."""
    return _rows_of(factors, FACTORS, stage_aware(0), "unknown feature factor {!r}")


def multi_blade_factors(factors: tuple[str, ...]) -> tuple[int, ...]:
    """Rows of the multi-blade features that hold the factors. Raises InputError for one that this kind does not have."""
    unknown = "feature factor {!r} does not exist for exponential methods"
    return _rows_of(factors, MULTI_BLADE_FACTORS, multi_blade(0), unknown)


def _rows_of(
    factors: tuple[str, ...], known: tuple[str, ...], names: tuple[str, ...], unknown: str
) -> tuple[int, ...]:
    for factor in factors:
        if factor not in known:
            raise InputError(unknown.format(factor) + did_you_mean(factor, known))
    return tuple(names.index(factor) for factor in factors)
