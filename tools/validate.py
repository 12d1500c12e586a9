"""Print the check values of docs/validation.md: what others published or ran, what this model gives, and the difference.

python tools/validate.py            a table in the terminal
python tools/validate.py --markdown the tables of docs/validation.md
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fatigue_runner.integrators import Ensemble, Integrator, simulate
from fatigue_runner.turbine import load_turbine
from fatigue_runner.turbine.aerodynamics import power_coefficient, thrust_coefficient
from fatigue_runner.turbine.beam import blade_modes, tower_modes
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.turbine.finite_elements import blade_beam, clamped_frequencies
from fatigue_runner.turbine.table_builder import turbine_blade
from fatigue_runner.wind import ConstantWind

REPORT = "NREL/TP-500-38060"
OPENFAST = "OpenFAST 5.0"


@dataclass(frozen=True)
class Check:
    """One published value beside ours."""

    section: str
    name: str
    source: str
    published: float
    ours: float
    unit: str

    @property
    def difference(self) -> float:
        return self.ours / self.published - 1


def structure() -> Iterator[Check]:
    data = read_turbine_file("nrel5mw")
    blade, tower = blade_modes(data), tower_modes(data)
    section = "Blade and tower"
    yield Check(section, "blade mass", REPORT, 17740, blade.mass, "kg")
    yield Check(section, "blade first moment about the root", REPORT, 363231, blade.first_moment, "kg·m")
    yield Check(section, "blade second moment about the root", REPORT, 11776047, blade.second_moment, "kg·m²")
    yield Check(section, "tower mass", REPORT, 347460, tower.mass, "kg")
    yield Check(section, "tower centre of mass", REPORT, 38.234, tower.first_moment / tower.mass, "m")
    elements, _ = clamped_frequencies(blade_beam(data), count=2)
    yield Check(
        section,
        "clamped blade, flap: our finite elements",
        "finite elements",
        elements[0],
        blade.flap_frequency,
        "Hz",
    )
    yield Check(
        section,
        "clamped blade, edge: our finite elements",
        "finite elements",
        elements[1],
        blade.edge_frequency,
        "Hz",
    )


def rotor() -> Iterator[Check]:
    blade, _ = turbine_blade(read_turbine_file("t2b1i1cg"))
    ratios = np.array([5.0, 7.0, 7.55, 9.0, 10.0])
    ours = power_coefficient(blade, ratios, np.zeros(5)), thrust_coefficient(blade, ratios, np.zeros(5))
    published = (0.355, 0.480, 0.485, 0.469, 0.443), (0.513, 0.750, 0.788, 0.867, 0.912)
    for label, theirs, mine in zip(("power", "thrust"), published, ours, strict=True):
        for ratio, a, b in zip(ratios, theirs, mine, strict=True):
            name = f"{label} coefficient at tip-speed ratio {ratio:g}"
            yield Check("Rigid rotor, pitch 0, no tilt, no cone", name, OPENFAST, a, float(b), "-")


def operation() -> Iterator[Check]:
    published = {
        "nrel5mw": (9.127, 20.05, 0.197, 3.155, 5692.0, 33269.0),
        "t2b1i1cg": (9.130, 20.06, 0.205, 2.848, 4928.0, 34083.0),
    }
    for name, values in published.items():
        turbine = load_turbine(name)
        start = turbine.operating_point(8.0)[None]
        ensemble = Ensemble(turbine, [ConstantWind(8.0)], start, 300.0, 0.05)
        run = simulate(ensemble, Integrator("dop853", 0.05))[0]
        late = run.time >= 200.0
        mean = {k: v[late].mean() for k, v in run.loads.items()}
        ours = (
            ("rotor speed", run.state[late, 14].mean() * 30 / np.pi, "rpm"),
            ("generator torque", mean["generator_torque"] / 1e3, "kN·m"),
            ("tower top fore-aft", run.state[late, 0].mean(), "m"),
            ("tip out of plane", mean["blade1_tip_out_of_plane"], "m"),
            ("flap root moment", mean["blade1_root_flapwise_moment"] / 1e3, "kN·m"),
            ("tower-base fore-aft moment", mean["tower_base_fore_aft_moment"] / 1e3, "kN·m"),
        )
        for (label, value, unit), theirs in zip(ours, values, strict=True):
            yield Check(f"Means at 8 m/s, {name}", label, OPENFAST, theirs, float(value), unit)


def modes() -> Iterator[Check]:
    published = {
        "tower side-side": (0.3213, 0.54), "tower fore-aft": (0.3349, 6.5), "flap regressing": (0.58, None),
        "flap collective": (0.72, None), "flap progressing": (0.84, None),
        "drivetrain and collective edge 1": (1.744, 5.2), "drivetrain and collective edge 2": (3.802, 5.5),
    }  # fmt: skip
    section = "Modes at 8 m/s, nrel5mw (undamped natural frequency)"
    for name, frequency, damping in load_turbine("nrel5mw").natural_frequencies(8.0):
        theirs, their_damping = published[name]
        yield Check(section, name, OPENFAST, theirs, frequency, "Hz")
        if their_damping:
            yield Check(section, f"{name}: damping ratio", OPENFAST, their_damping, 100 * damping, "%")


WORDS = {
    "RootMyb1": "flap root moment", "RootMxb1": "edge root moment",
    "TwrBsMyt": "tower-base fore-aft moment", "TwrBsMxt": "tower-base side-side moment",
}  # fmt: skip
SPEEDS = (8.0, 18.0)


def openfast_loads() -> Any:
    """The comparison of the tests; None where OpenFAST's results are not here."""
    tests = Path(__file__).resolve().parents[1] / "tests"
    sys.path[:0] = [str(tests / "wind"), str(tests)]
    import openfast_loads as found

    return found if found.DATA.is_dir() else None


def shear() -> Iterator[Check]:
    """Loads in steady power-law shear: all amplitudes that three equal blades have; a tower has only every third."""
    loads = openfast_loads()
    for speed in SPEEDS if loads else ():
        section = f"Steady power-law shear 0.2 at {speed:g} m/s, nrel5mw under control"
        for p in loads.amplitudes(speed):
            if p.theirs > 1e-3 * abs(p.mean) and (p.channel.startswith("Root") or p.what == "3P"):
                yield Check(
                    section, f"{WORDS[p.channel]}, {p.what} amplitude", OPENFAST, p.theirs, p.ours, "kN·m"
                )
        for p in loads.steady_equivalents(speed):
            if (
                p.channel != "TwrBsMxt"
            ):  # OpenFAST's holds the start's side-side swing, which decays in minutes
                name = f"{WORDS[p.channel]}, DEL {p.what}"
                yield Check(section, name, OPENFAST, p.theirs, p.ours, "kN·m")


def turbulence() -> Iterator[tuple[str, ...]]:
    """Damage-equivalent loads in OpenFAST's own fields: OpenFAST's, and ours over it with 1, 3 and 6 harmonics."""
    loads = openfast_loads()
    for speed in SPEEDS if loads else ():
        runs = [list(loads.field_equivalents(speed, harmonics)) for harmonics in (1, 3, 6)]
        for pairs in zip(*runs, strict=True):
            name = f"{speed:g} m/s, {WORDS[pairs[0].channel]}, {pairs[0].what}"
            yield name, f"{pairs[0].theirs:.6g} kN·m", *(f"{p.ratio:.3f}" for p in pairs)
        theirs, ours = loads.rotor_speed(speed, 6)
        told = (f"{mean:.2f}, {deviation:.2f} rpm" for mean, deviation in (theirs, ours))
        yield f"{speed:g} m/s, rotor speed: mean, standard deviation", next(told), "", "", next(told)


def equations() -> Iterator[tuple[str, str, str]]:
    """(check, against what, result) of the equations of motion, with the helpers of the tests."""
    tests = Path(__file__).resolve().parents[1] / "tests"
    sys.path[:0] = [str(tests / "turbine"), str(tests)]
    import cadynturb
    import test_equations as t

    turbine, x = t.free_turbine(), t.violent_states(8)
    model = t.IndependentModel(turbine.parameters)
    expected = np.array([model.accelerations(row) for row in x])
    worst = (np.abs(turbine.rhs(x.T, 8.0)[8:].T - expected) / (1 + np.abs(expected))).max()
    yield "accelerations in violent states", "a second formulation without frames", f"{worst:.0e} relative"
    drift = 0.0
    for run in simulate(Ensemble(turbine, [ConstantWind(8.0)] * 8, x, 100.0, 10.0), Integrator("rk7", 0.005)):
        energy = np.array([model.energy(row) for row in run.state])
        drift = max(drift, np.ptp(energy) / (0.5 * 3.5e7 * run.state[0, 14] ** 2))
    yield (
        "energy over 100 s, nothing damping or driving",
        "conservation",
        f"drift {drift:.0e} of the rotation's",
    )
    if not cadynturb.SHARED.is_dir():
        yield "CADynTurb's states and trajectories", "its reference data", "not here"
        return
    data = cadynturb.load()
    given = {k: v for k, v in cadynturb.tables(data).items() if k in t.kernel.TABLES}
    tables = {"tip_speed_ratio": data["tip_speed_ratio"], "coefficients": given}
    other = load_turbine(
        {"parameters": cadynturb.parameters(data), "tables": tables, "interpolation": "bilinear"}
    )
    reference = np.load(cadynturb.SHARED / "t2b1i1cg_reference.npz")
    states, u, theirs = reference["x"].T, reference["u"].T, reference["xdot"].T
    ours = other.rhs(states, u[4], u[6], u[5])
    ours[15] += (2.332287 * states[15] ** 2 - u[0]) / other.parameters["g_i"]
    rms = 100 * np.sqrt(((ours - theirs)[8:] ** 2).mean(axis=1) / (theirs[8:] ** 2).mean(axis=1))
    yield (
        "accelerations in 400 random states",
        "CADynTurb",
        f"{np.median(rms):.1f} % rms, at most {rms.max():.1f} %",
    )
    winds = [ConstantWind(float(v)) for v in reference["vwind"]]
    ensemble = Ensemble(other, winds, reference["V2"][:, 0], 20.0, 0.05)
    runs = simulate(ensemble, Integrator("rk7", 0.005))
    errors = np.array(
        [
            100 * np.sqrt(((run.state - v) ** 2).mean(axis=0)) / np.ptp(v, axis=0)
            for run, v in zip(runs, reference["V2"], strict=True)
        ]
    )
    result = f"{np.median(errors):.1f} % of each state's range, at most {errors.max():.1f} %"
    yield "trajectories of 20 s at three winds", "CADynTurb", result


def checks() -> list[Check]:
    return [check for part in (structure, rotor, operation, modes, shear) for check in part()]


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--markdown", action="store_true", help="print the tables of docs/validation.md")
    markdown = parser.parse_args().markdown
    section = ""
    for c in checks():
        if c.section != section:
            section = c.section
            head = f"### {section}\n\n| | {c.source} | ours | difference |\n|---|---|---|---|"
            print(f"\n{head if markdown else section}")
        values = f"{c.published:.6g} {c.unit}", f"{c.ours:.6g} {c.unit}", f"{100 * c.difference:+.2f} %"
        if markdown:
            print("| " + " | ".join((c.name, *values)) + " |")
        else:
            print(f"  {c.name:45s}{values[0]:>18s}{values[1]:>18s}{values[2]:>10s}")
    print(
        "\n### Turbulence, OpenFAST's own TurbSim fields, nrel5mw under control\n\n"
        "| damage-equivalent load, 600 s | OpenFAST 5.0 | ours over it, M = 1 | M = 3 | M = 6 |\n|---|---|---|---|---|"
        if markdown
        else "\nTurbulence: OpenFAST's load, ours over it with 1, 3 and 6 harmonics"
    )
    for cells in turbulence():
        print("| " + " | ".join(cells) + " |" if markdown else "  " + "; ".join(cells))
    print(
        "\n## The equations themselves\n\n| check | against | result |\n|---|---|---|"
        if markdown
        else "\nEquations"
    )
    for row in equations():
        print("| " + " | ".join(row) + " |" if markdown else "  " + "; ".join(row))
    return 0


if __name__ == "__main__":
    sys.exit(main())
