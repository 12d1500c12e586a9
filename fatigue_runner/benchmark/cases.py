"""The cases that every integrator of a work-precision benchmark meets, from a campaign file or the built-in ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

# Winds that nothing is tuned on. Seeds from 9000 on are kept for benchmarks: no corrector may be trained on them.
BUILT_IN: tuple[dict[str, Any], ...] = (
    {
        "name": "turbulent",
        "duration": 200,
        "output_rate": 50,
        "wind": {"type": "turbulent", "speeds": [6.3, 7.4, 8.6, 9.7], "turbulence_class": "B", "shear_exponent": 0.2,
                 "seeds": [9001, 9002, 9003, 9004]},
    },
    {
        "name": "constant",
        "duration": 60,
        "output_rate": 50,
        "wind": {"type": "constant", "speeds": {"random": {"count": 16, "low": 5, "high": 10, "seed": 9000}},
                 "vertical_shear": 0.1},
    },
)  # fmt: skip
# What the benchmark needs to know of a campaign is not its integrators: all methods run at the benchmark's steps.
_ANY = {"integrators": [{"method": "rk4", "step": 0.01}]}


@dataclass
class Cases:
    """Winds with everything that integrators share; initial (n, 16), times [s], pitch [rad]."""

    name: str
    turbine: Any
    winds: list[Any]
    initial: np.ndarray
    duration: float
    output_step: float
    pitch: float
    discard: float
    channels: list[str]
    exponents: list[float]
    residue: str
    integrators: list[tuple[str, float]]


def load_cases(campaign: str | Path | Mapping[str, Any]) -> Cases:
    """The cases of a campaign file or mapping; one that has no integrators is fine. Raises InputError with "file:line"."""
    from fatigue_runner.campaign import checks
    from fatigue_runner.campaign.cases import integrations, wind_cases
    from fatigue_runner.campaign.source import read_source
    from fatigue_runner.campaign.spec import parse_campaign

    listed = True
    if isinstance(campaign, Mapping):
        listed, campaign = "integrators" in campaign, {**_ANY, **campaign}
    source = read_source(campaign)
    spec = parse_campaign(source)
    turbine = checks.load_turbine(spec, source)
    checks.check_pitch(spec, turbine, source)
    named = wind_cases(spec.wind, spec.duration, turbine, source)
    winds = checks.build_winds(named, spec, source)
    initial = checks.initial_states(named, winds, spec, turbine, source)
    return Cases(
        spec.name,
        turbine,
        winds,
        np.stack([initial[case.id] for case in named]),
        spec.duration,
        1.0 / spec.output_rate,
        float(np.deg2rad(spec.pitch)),
        spec.discard,
        list(spec.fatigue.channels),
        list(spec.fatigue.wohler_exponents),
        spec.fatigue.residue,
        [(i.method, i.step) for i in integrations(spec, source) if not (i.is_reference or i.corrector)]
        if listed
        else [],
    )
