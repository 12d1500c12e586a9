"""`import_deck`: an OpenFAST deck as a turbine file, its airfoils and its aerodynamic tables, written side by side."""

from __future__ import annotations

import os
import re
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.inputs.files import write_atomically
from fatigue_runner.inputs.section import validated
from fatigue_runner.inputs.source import parse_mapping
from fatigue_runner.turbine.aerodynamics import LOAD_NAMES, blade_aerodynamics, power_coefficient, rotor_loads
from fatigue_runner.turbine.beam import INTEGRAND_NAMES, blade_modes
from fatigue_runner.turbine.deck.convert import ORIGINS, Converted, converted
from fatigue_runner.turbine.deck.files import Deck, read_deck
from fatigue_runner.turbine.deck.omissions import Omission, omissions
from fatigue_runner.turbine.deck.written import airfoils_text, turbine_text
from fatigue_runner.turbine.file import AirfoilFile, check_turbine
from fatigue_runner.turbine.finite_elements import blade_beam, first_mode
from fatigue_runner.turbine.table_builder import (
    PITCH_DEG,
    TIP_SPEED_RATIO,
    best_weight,
    build_tables,
    inputs_hash,
    table_names,
    write_tables,
)

OWN_EDGES = "t2b2cg"  # each blade with an edge mode of its own, as the decks have; `model: t2b1i1cg` in the file has one for all
POOR_MODE = 0.02  # a polynomial's frequency off its own beam's
TYPICAL_WIND = 8.0  # m/s: the mean at most sites, below rated of all turbines, where loads grow with the wind


@dataclass(frozen=True)
class Imported:
    """What was written, and what a person should know: decisions on the way, and what the model leaves out of the deck."""

    turbine: Path
    airfoils: Path
    tables: Path
    notes: tuple[str, ...]
    omissions: tuple[Omission, ...]


def import_deck(
    deck: Path,
    out: Path | None = None,
    overwrite: bool = False,
    say: Callable[[str], None] = lambda text: None,
) -> Imported:
    """Write the turbine of an OpenFAST deck (its `.fst`) to `out` (default: the deck's name in this folder), with its airfoils and
    tables beside it. Raises InputError for a deck that cannot be read, and for files that are there already; nothing is written then.
    """
    if out is None and not deck.is_file():
        read_deck(deck)  # says what is wrong: a folder, no such file
    if deck.suffix.lower() in (".yaml", ".yml"):
        raise InputError(f"{deck} is a YAML file; a deck is named by its .fst file")
    target = out or Path(f"{deck.stem}.yaml")
    if target.suffix.lower() not in (".yaml", ".yml"):
        raise InputError(f"--out {target} must end in .yaml")
    files = {"airfoils": f"{target.stem}_airfoils.yaml", "tables": f"{target.stem}_aero.npz"}
    paths = {key: target.with_name(name) for key, name in files.items()}
    if not overwrite:
        for path in (target, *paths.values()):
            if path.exists():
                raise InputError(f"{path} is there already; give another --out, or --overwrite to replace it")
    say("reading the deck")
    read = read_deck(deck)
    made = converted(read, target.stem)
    data = _with_origin(made, read, deck, files)
    head = f"Imported from {deck.name} by `fatigue-runner turbine import`; its numbers may be changed here."
    polars = airfoils_text(made.airfoils, [f"Airfoil polars of {target.name}, imported from {deck.name}."])
    # what is written is what tables are made from, digit by digit
    airfoils = parse_mapping(polars, paths["airfoils"], "polar file", "airfoils")
    rows = validated(AirfoilFile, airfoils).airfoils
    checked, left_out = _checked(data, target, read), tuple(omissions(read, data))
    notes = list(made.notes)
    _tell_modes(checked, notes)
    if "prebend" in data["aerodynamics"]["stations"]["columns"]:
        data["aerodynamics"]["deflection"] = round(_deflection(checked, rows), 3)
        checked = _checked(data, target, read)
        notes.append(
            f"the blade is prebent so that the wind straightens it: its tables are made with the tip "
            f"{data['aerodynamics']['deflection']:g} m "
            f"downwind, as it bends at {TYPICAL_WIND:g} m/s"
        )
    blade = blade_aerodynamics(checked, {"airfoils": rows}, blade_modes(checked))
    skewed = data["aerodynamics"]["skewed_wake"]
    coefficients = build_tables(
        blade, skewed, told=lambda share: say(f"making the aerodynamic tables: {share:.0%}")
    )
    if not made.law:
        data["generator"] = _optimal(data, coefficients, notes)
    text = turbine_text(data, [head, *_wrapped(notes)])
    checked = check_turbine(parse_mapping(text, target, "turbine", "name, blade, tower, ..."))
    target.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(paths["airfoils"], polars.encode())
    part = paths["tables"].with_suffix(".part.npz")
    write_tables(
        part, coefficients, inputs_hash(checked, {"airfoils": rows}), best_weight(blade, coefficients)
    )
    part.replace(paths["tables"])
    write_atomically(target, text.encode())
    return Imported(target, paths["airfoils"], paths["tables"], tuple(notes), left_out)


def _deflection(checked: dict[str, Any], airfoils: dict[str, Any]) -> float:
    """Steady flapwise deflection of the tip [m] at the typical wind, where the rotor takes most power, of the unloaded blade's loads."""
    modes = blade_modes(checked)
    blade = blade_aerodynamics(checked, {"airfoils": airfoils}, modes)
    ratios = np.linspace(6.0, 11.0, 21)
    best = float(ratios[np.argmax(power_coefficient(blade, ratios, 0.0))])
    load = float(rotor_loads(blade, best, 0.0)[LOAD_NAMES.index("flap")])
    radius = blade.rotor_radius
    force = load * checked["environment"]["air_density"] * np.pi * radius**2 * TYPICAL_WIND**2 / 6
    speed, place = best * TYPICAL_WIND / radius, {name: i for i, name in enumerate(INTEGRAND_NAMES)}
    stretched, coned = (modes.integrals[place["r"], place[name]] for name in ("S_ff", "phi_x"))
    force -= speed**2 * np.sin(blade.cone) * np.cos(blade.cone) * coned
    return float(force / (modes.flap_stiffness + speed**2 * stretched) * modes.flap_tip[0])


def _tell_modes(checked: dict[str, Any], notes: list[str]) -> None:
    """Where a deck's mode polynomial is not that of its own beam: the deck's is taken, as OpenFAST does."""
    blade, beam = blade_modes(checked), blade_beam(checked)
    for name, plane, own in (("flap", 0, blade.flap_frequency), ("edge", 1, blade.edge_frequency)):
        true = first_mode(beam, plane)[0]
        if abs(own / true - 1) > POOR_MODE:
            notes.append(
                f"the deck's {name} mode bends the clamped blade at {own:.3f} Hz, the beam of its own table at {true:.3f} Hz: "
                "the deck's is taken, as OpenFAST does; "
                f"without `{name}_mode` in the file the beam's is"
            )


def _with_origin(made: Converted, read: Deck, deck: Path, files: dict[str, str]) -> dict[str, Any]:
    """The mapping with the names of its files, and which deck it is from."""
    data = dict(made.data)
    data = {"name": data.pop("name"), "model": OWN_EDGES, **data}
    data["aerodynamics"] = {**files, **data["aerodynamics"]}
    root = deck.resolve().parent
    hashes = {
        os.path.relpath(file.path.resolve(), root).replace(os.sep, "/"): file.sha256 for file in read.files
    }
    data["deck"] = {"file": str(deck), "sha256": hashes}
    return data


def _checked(data: dict[str, Any], target: Path, read: Deck) -> dict[str, Any]:
    """The mapping as its file will be read; a torque law that is not known yet is any. Raises InputError with the deck's own lines, since
    the file is not there."""
    known = data if data["generator"] else {**data, "generator": {"law": "optimal", "optimal_gain": 1.0}}
    try:
        return check_turbine(
            parse_mapping(turbine_text(known, ()), target, "turbine", "name, blade, tower, ...")
        )
    except InputError as error:
        raise InputError(_told_of_the_deck(str(error), target, read)) from None


def _told_of_the_deck(text: str, target: Path, read: Deck) -> str:
    """What is wrong with a file that would have been written, with the place of the deck that says it."""

    def place(found: re.Match[str]) -> str:
        name = found[1]
        key = ORIGINS.get(name)
        file = next((f for f in read.files if key and f.has(key)), None)
        if key is None or file is None:
            return f"{read.main.path}: the deck makes no turbine: {name}"
        return f"{file.where(key)}: {key} makes no turbine: {name}"

    return re.sub(rf"{re.escape(str(target))}(?::\d+)?: ([\w.]*)", place, text)


def _optimal(data: dict[str, Any], coefficients: Any, notes: list[str]) -> dict[str, Any]:
    """The torque law of a deck that tells none: k omega^2 through the largest power coefficient at zero pitch."""
    column = int(np.argmin(np.abs(PITCH_DEG)))
    power = (
        TIP_SPEED_RATIO
        * coefficients[table_names(data["aerodynamics"]["skewed_wake"]).index("torque"), :, column]
    )
    best = int(np.argmax(power))
    geometry, drive = data["geometry"], data["drivetrain"]
    radius = geometry["tip_radius"] * np.cos(np.radians(geometry["precone_deg"]))
    gain = (
        data["environment"]["air_density"]
        * np.pi
        * radius**5
        * power[best]
        / (2 * TIP_SPEED_RATIO[best] ** 3)
    )
    gain *= drive["gearbox_efficiency"] / drive["gearbox_ratio"] ** 3
    notes.append(
        "the deck tells no torque law (its controller is a library without an input that can be read): the torque is k omega^2 through the "
        f"tables' largest power coefficient at zero pitch, {power[best]:.3f} at tip-speed ratio {TIP_SPEED_RATIO[best]:.2f}; there is no "
        "rated power and no controller. Put `generator` and `control` into the file for operation above rated (docs/turbines.md)"
    )
    return {"law": "optimal", "optimal_gain": float(gain)}


def _wrapped(notes: list[str]) -> list[str]:
    """Notes as lines of comment."""
    lines = ["", "Decided on the way:"] if notes else []
    for note in notes:
        lines += textwrap.wrap(note, 118, initial_indent="- ", subsequent_indent="  ")
    return lines
