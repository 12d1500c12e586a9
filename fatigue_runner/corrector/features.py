"""What a corrector sees of a step, by name, in the order of the compiled rows (integrators/correction.py, multi_blade_rows.py).

Everything follows from the layout of the state and of the wind.
"""

from __future__ import annotations

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.layout import Layout

STAGE_AWARE, RAW, MULTI_BLADE = "stage-aware", "raw", "multi-blade"

# what the features can be multiplied with, so that the affine map may vary over a revolution and with the wind
FACTORS = ("sin_azimuth", "cos_azimuth", "wind_speed@start", "rotor_speed")
MULTI_BLADE_FACTORS = ("wind_speed@start", "rotor_speed")
# the edge mode and the shaft, and their rates: the largest errors of a run; what a robust fit watches
DRIVE = ("generator_azimuth", "rotor_speed", "generator_speed")

MOST_HISTORY = 4  # steps
_TIMES = ("start", "middle", "end")
MOST_ROWS = 512  # room of the compiled loop for features and their products


def drive(layout: Layout) -> tuple[int, ...]:
    """Rows of the edge modes, the shaft, and their rates in the state, in its order."""
    edges = [name for name in layout.names if "edge" in name]
    return tuple(sorted(layout.row(name) for name in (*edges, *DRIVE)))


def _relative(layout: Layout) -> tuple[str, ...]:
    """Deflections, shaft twist, rates with that of the twist, first-order states."""
    names, n = layout.names, layout.freedoms
    return (*names[: layout.rotor], "shaft_twist", *names[n : 2 * n - 1], "shaft_twist_rate", *names[2 * n :])


def _slopes(layout: Layout) -> tuple[str, ...]:
    """Accelerations with that of the twist, slopes of the first-order states."""
    names, n = layout.names, layout.freedoms
    return tuple(
        f"{name}_derivative" for name in (*names[n : 2 * n - 1], "shaft_twist_rate", *names[2 * n :])
    )


def _winds(layout: Layout) -> tuple[str, ...]:
    return tuple(f"{w.name}@{at}" for at in _TIMES for w in layout.wind)


def stage_aware(layout: Layout, stages: int, history: int = 0) -> tuple[str, ...]:
    """1, the state with the shaft twist for the azimuths, wind at the step's start, middle and end, sine and cosine of the azimuth,
    h times the accelerations of every stage, and those at the start of `history` steps before [SI]."""
    places = (*(f"stage{i + 1}" for i in range(stages)), *(f"step-{i + 1}" for i in range(history)))
    slopes = tuple(f"step*{slope}@{place}" for place in places for slope in _slopes(layout))
    return ("one", *_relative(layout), *_winds(layout), "sin_azimuth", "cos_azimuth", *slopes)


def raw(layout: Layout) -> tuple[str, ...]:
    """1, the state as it is, azimuths included, and the wind speed: what the network of arXiv 2504.05493 sees."""
    return ("one", *layout.names, layout.wind[0].name)


def multi_blade(layout: Layout, past: int) -> tuple[str, ...]:
    """What a step of an exponential Adams method sees: blades by the mean, cosine and sine part over the azimuth; the wind's shears
    times its speed; where the layout has azimuthal harmonics what the blades feel of them; `past` earlier nonlinear parts of the
    accelerations, the newest first, and the one at the step's predicted end."""

    def blades(values: tuple[str, ...]) -> tuple[str, ...]:
        turned = {"blade1": "mean", "blade2": "cosine", "blade3": "sine"}
        parts = (value.partition("_") for value in values)
        return tuple("".join((turned.get(first, first), *rest)) for first, *rest in parts)

    places = (*(f"step-{i}" if i else "start" for i in range(past)), "end")
    parts = tuple(f"nonlinear_{slope}@{place}" for place in places for slope in blades(_slopes(layout)))
    felt = tuple(
        f"{part}_harmonic_wind@{at}"
        for at in _TIMES
        for part in ("mean", "cosine", "sine")
        if layout.harmonics
    )
    return ("one", *blades(_relative(layout)), *_winds(layout), *felt, *parts)


def factor_rows(layout: Layout, factors: tuple[str, ...]) -> tuple[int, ...]:
    """Rows of the stage-aware features that hold the factors. Raises InputError for an unknown one."""
    check_factors(factors)
    return tuple(stage_aware(layout, 0).index(factor) for factor in factors)


def check_factors(factors: tuple[str, ...]) -> None:
    """Raises InputError, with the nearest known one, for a factor that no map has."""
    for factor in factors:
        if factor not in FACTORS:
            raise InputError(f"unknown feature factor {factor!r}{did_you_mean(factor, FACTORS)}")


def multi_blade_factor_rows(layout: Layout, factors: tuple[str, ...]) -> tuple[int, ...]:
    """Rows of the multi-blade features that hold the factors. Raises InputError for one that this kind does not have."""
    check_multi_blade_factors(factors)
    return tuple(multi_blade(layout, 0).index(factor) for factor in factors)


def check_multi_blade_factors(factors: tuple[str, ...]) -> None:
    """As `check_factors`, for maps of exponential methods."""
    for factor in factors:
        if factor not in MULTI_BLADE_FACTORS:
            raise InputError(
                f"feature factor {factor!r} does not exist for exponential methods{did_you_mean(factor, MULTI_BLADE_FACTORS)}"
            )
