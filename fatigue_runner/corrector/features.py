"""What a corrector sees of a step, by name, in the order of the compiled rows (integrators/correction.py)."""

from __future__ import annotations

from fatigue_runner.channels import STATE_NAMES

_DEFLECTIONS = STATE_NAMES[:6]
_RATES = (*STATE_NAMES[8:15], "shaft_twist_rate")
_WIND = ("wind_speed", "vertical_shear", "horizontal_shear")

STAGE_AWARE, RAW = "stage-aware", "raw"
KINDS = (STAGE_AWARE, RAW)


def stage_aware(stages: int) -> tuple[str, ...]:
    """1, deflections and velocities with the shaft twist for the azimuths, wind at the step's start, middle and end, sine and cosine
    of the azimuth, and h times the accelerations of every stage [SI]."""
    wind = tuple(f"{w}@{at}" for at in ("start", "middle", "end") for w in _WIND)
    accelerations = tuple(f"step*{r}_derivative@stage{i + 1}" for i in range(stages) for r in _RATES)
    return ("one", *_DEFLECTIONS, "shaft_twist", *_RATES, *wind, "sin_azimuth", "cos_azimuth", *accelerations)


def raw() -> tuple[str, ...]:
    """1, the state as it is, azimuths included, and the wind speed: what the network of arXiv 2504.05493 sees."""
    return ("one", *STATE_NAMES, "wind_speed")


def names(kind: str, stages: int, products: bool = False) -> tuple[str, ...]:
    """Feature names; `products` appends all of them times the sine and times the cosine of the azimuth."""
    base = raw() if kind == RAW else stage_aware(stages)
    if not products:
        return base
    return (*base, *(f"{n}*sin_azimuth" for n in base), *(f"{n}*cos_azimuth" for n in base))
