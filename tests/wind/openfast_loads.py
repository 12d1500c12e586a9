"""Loads of the NREL 5 MW beside OpenFAST's with the same degrees of freedom, controller and wind; for tests and `tools/validate.py`.

OpenFAST's results lie beside the checkout (`places.SHARED`): steady power-law shear of exponent 0.2, and ten minutes (60 to 660 s) in
TurbSim fields. Both programs run with the report's controller, which below 9 m/s is the torque law with its region 1.5.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from places import SHARED

from fatigue_runner.fatigue import damage_equivalent_load
from fatigue_runner.integrators import Ensemble, Integrator, simulate
from fatigue_runner.trajectory import Trajectory
from fatigue_runner.turbine import load_turbine
from fatigue_runner.turbine.turbine import CONTROLLED, Turbine
from fatigue_runner.wind import ConstantWind, FullFieldWind, WindSource

DATA = SHARED / "openfast_operation"
CHANNELS = {
    "RootMyb1": "blade1_root_flapwise_moment",
    "RootMxb1": "blade1_root_edgewise_moment",
    "TwrBsMyt": "tower_base_fore_aft_moment",
    "TwrBsMxt": "tower_base_side_side_moment",
}
ORDERS = (1, 2, 3)
EXPONENTS = (4, 10)
SHEAR = 0.2
SETTLED, COUNTED = 400.0, 200.0  # s of a steady run: left out, then counted
BEGIN, END = 60.0, 660.0  # s of the fields that are counted


@dataclass(frozen=True)
class Pair:
    """One figure of a channel: OpenFAST's and ours, in kN m; `mean` of the channel beside it."""

    channel: str
    what: str
    theirs: float
    ours: float
    mean: float

    @property
    def ratio(self) -> float:
        return self.ours / self.theirs


def rows(name: str, **wanted: str) -> dict[str, dict[str, str]]:
    """Rows of a table of OpenFAST's results by their channel."""
    with (DATA / name).open(newline="") as file:
        found = [row for row in csv.DictReader(file) if wanted.items() <= row.items()]
    return {row["channel"]: row for row in found}


def turbine(operation: str = CONTROLLED) -> Turbine:
    return load_turbine("nrel5mw").operated(operation)


@lru_cache(maxsize=8)
def steady(speed: float) -> Trajectory:
    """A run in steady shear."""
    wind = ConstantWind(speed, shear_exponent=SHEAR)
    return run(wind, speed, SETTLED + COUNTED, CONTROLLED)


@lru_cache(maxsize=16)
def in_field(
    speed: float, harmonics: int, operation: str = CONTROLLED, machine: Turbine | None = None
) -> Trajectory:
    """A run in OpenFAST's own field; machine: another turbine than `turbine(operation)`."""
    wind = FullFieldWind(DATA / f"ntmB_U{speed:02.0f}_s1.bts", harmonics=harmonics)
    return run(wind, speed, END, operation, machine)


def run(
    wind: WindSource, speed: float, duration: float, operation: str, machine: Turbine | None = None
) -> Trajectory:
    machine = machine or turbine(operation)
    start = machine.operating_point(speed, 0.14)[None]
    return simulate(Ensemble(machine, [wind], start, duration, 0.05), Integrator("rk4", 0.025))[0]


def amplitudes(speed: float) -> Iterator[Pair]:
    """Amplitudes of the loads at one, two and three times the rotor's azimuth in steady shear."""
    found, table = steady(speed), rows("shear_harmonics.csv", wind_mps=f"{speed:g}")
    late = found.time >= SETTLED
    azimuth = found.state[late, load_turbine("nrel5mw").layout.rotor]
    waves = [wave(n * azimuth) for n in range(1, 7) for wave in (np.cos, np.sin)]
    basis = np.stack([np.ones(late.sum()), *waves], axis=1)
    for channel, name in CHANNELS.items():
        fit = np.linalg.lstsq(basis, found.loads[name][late] / 1e3, rcond=None)[0]
        for n in ORDERS:
            ours, theirs = float(np.hypot(*fit[2 * n - 1 : 2 * n + 1])), float(table[channel][f"amp_{n}P"])
            yield Pair(channel, f"{n}P", theirs, ours, float(table[channel]["mean"]))


def steady_equivalents(speed: float) -> Iterator[Pair]:
    """Damage-equivalent loads in steady shear."""
    yield from _equivalents(steady(speed), SETTLED, COUNTED, rows("shear_del.csv", wind_mps=f"{speed:g}"))


def field_equivalents(
    speed: float, harmonics: int, operation: str = CONTROLLED, machine: Turbine | None = None
) -> Iterator[Pair]:
    """Damage-equivalent loads in a field."""
    table = rows("turb_del.csv", case=f"turb_U{speed:04.1f}_s1", config="qs")
    yield from _equivalents(in_field(speed, harmonics, operation, machine), BEGIN, END - BEGIN, table)


def _equivalents(
    found: Trajectory, begin: float, seconds: float, table: dict[str, dict[str, str]]
) -> Iterator[Pair]:
    counted = (found.time >= begin) & (found.time < begin + seconds)
    for channel, name in CHANNELS.items():
        for m in EXPONENTS:
            ours = damage_equivalent_load(found.loads[name][counted] / 1e3, m, seconds)
            row = table[channel]
            yield Pair(channel, f"m={m}", float(row[f"DEL_m{m}"]), float(ours), float(row["mean"]))


def rotor_speed(speed: float, harmonics: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """Mean and standard deviation of the rotor speed in a field [rpm]: OpenFAST's, ours."""
    found = in_field(speed, harmonics)
    ours = found.state[found.time >= BEGIN, load_turbine("nrel5mw").layout.rotor_speed] * 30 / np.pi
    row = rows("turb_del.csv", case=f"turb_U{speed:04.1f}_s1", config="qs")["RotSpeed"]
    return (float(row["mean"]), float(row["std"])), (float(ours.mean()), float(ours.std()))
