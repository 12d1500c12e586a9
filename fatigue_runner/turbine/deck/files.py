"""Which files make a deck, found from its `.fst`; and which decks hold no turbine of this model's kind."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.turbine.deck.text import DeckFile, read_deck_file

NOTHING = {"", "none", "unused", "default", "n/a"}

LEVELS = 4  # of folders above a file, where one that it names may lie
STEEPEST_SHAFT = 45.0  # deg; beyond it the axis is called vertical


@dataclass(frozen=True)
class Deck:
    """The files of one deck that say what the turbine is.

    blade and tower are ElastoDyn's, aero_blade AeroDyn's; airfoils: in AeroDyn's order; servo, discon and inflow: None where the deck
    has none or it is not there; missing: what the deck names, and nothing of the turbine stands in.
    """

    main: DeckFile
    elasto: DeckFile
    blade: DeckFile
    tower: DeckFile
    aero: DeckFile
    aero_blade: DeckFile
    airfoils: tuple[DeckFile, ...]
    servo: DeckFile | None = None
    discon: DeckFile | None = None
    inflow: DeckFile | None = None
    other_blades: tuple[
        DeckFile, ...
    ] = ()  # ElastoDyn's and AeroDyn's of blades 2 and 3, where they differ from blade 1
    missing: tuple[str, ...] = field(default=())

    @property
    def files(self) -> tuple[DeckFile, ...]:
        """Every file that was read, the `.fst` first."""
        named = (self.main, self.elasto, self.blade, self.tower, self.aero, self.aero_blade, *self.airfoils)
        return (
            *named,
            *(file for file in (self.servo, self.discon, self.inflow) if file),
            *self.other_blades,
        )


def read_deck(path: Path) -> Deck:
    """All files of the deck. Raises InputError, one sentence with file and line, for a sub-file that is not there, and for a deck
    whose turbine these equations are not those of: two blades, floating, a vertical axis, under water."""
    main = _main(path)
    elasto = _sub_file(main, "EDFile", "an ElastoDyn file")
    _refuse_other_kinds(main, elasto)
    blades = _blades(elasto, ("BldFile(1)", "BldFile1", "BldFile"), "BldFile", "an ElastoDyn blade file")
    tower = _sub_file(elasto, "TwrFile", "an ElastoDyn tower file")
    aero = _sub_file(main, "AeroFile", "an AeroDyn file")
    if not aero.has("NumAFfiles"):
        raise InputError(
            f"{main.where('AeroFile')}: {aero.path.name} is not of AeroDyn 15 or later, it has no NumAFfiles; "
            "convert the deck to a newer OpenFAST"
        )
    aero_blades = _blades(aero, ("ADBlFile(1)", "ADBlFile1", "ADBlFile"), "ADBlFile", "an AeroDyn blade file")
    count = aero.count("NumAFfiles")
    airfoils = tuple(
        read_deck_file(_located(aero, line, "AFNames", name), "an airfoil file")
        for line, name in aero.texts(count, "AFNames")
    )
    missing: list[str] = []
    servo = _sub_file(main, "ServoFile", "a ServoDyn file") if main.switch("CompServo", default=1) else None
    discon = None
    if servo is not None and servo.has("DLL_InFile") and _uses_library(servo):
        discon = _optional(servo, "DLL_InFile", "a controller's input file", missing)
    inflow = _optional(main, "InflowFile", "an InflowWind file", missing)
    return Deck(
        main,
        elasto,
        blades[0],
        tower,
        aero,
        aero_blades[0],
        airfoils,
        servo,
        discon,
        inflow,
        (*blades[1:], *aero_blades[1:]),
        tuple(missing),
    )


def _main(path: Path) -> DeckFile:
    if path.is_dir():
        found = sorted(path.glob("*.fst"))
        hint = f"; give {found[0]}" if found else ""
        raise InputError(f"{path} is a folder, a deck is named by its .fst file{hint}")
    if not path.exists():
        near = sorted(str(p) for p in path.parent.glob("*.fst")) if path.parent.is_dir() else []
        raise InputError(f"{path}: no such file{did_you_mean(str(path), near) if near else ''}")
    main = read_deck_file(path, "an OpenFAST .fst file")
    head = " ".join(main.lines[:2]).lower()
    if "driver" in head and not main.has("EDFile"):
        raise InputError(
            f"{path}:1: is the input of a driver of one module; give the .fst file of a whole turbine"
        )
    if not main.has("EDFile"):
        if main.has("ADFile", "NumBl"):
            raise InputError(
                f"{path}:1: is of FAST 7 or older; convert it to OpenFAST first (OpenFAST's matlab-toolbox does)"
            )
        raise InputError(
            f"{path}:1: is no OpenFAST .fst file, the key EDFile is missing; give the file that OpenFAST is called with"
        )
    return main


def _refuse_other_kinds(main: DeckFile, elasto: DeckFile) -> None:
    """One sentence for a turbine that the model's equations are not those of."""
    if main.switch("MHK", default=0) != 0:
        raise InputError(f"{main.where('MHK')}: the turbine runs under water; this model is of wind turbines")
    if main.number("NRotors", default=1) != 1:
        raise InputError(f"{main.where('NRotors')}: the deck has several rotors, this model has one")
    if main.switch("CompElast") == 3:
        raise InputError(
            f"{main.where('CompElast')}: the deck is of simplified ElastoDyn, which has no flexible blades or tower; "
            "a deck with ElastoDyn's blade and tower files is needed"
        )
    blades = elasto.count("NumBl")
    if blades != 3:
        words = {1: "one blade", 2: "two blades"}.get(blades, f"{blades} blades")
        raise InputError(
            f"{elasto.where('NumBl')}: the turbine has {words}; the model's equations are those of a three-bladed rotor"
        )
    tilt = elasto.number("ShftTilt")
    if abs(tilt) > STEEPEST_SHAFT:
        raise InputError(
            f"{elasto.where('ShftTilt')}: a shaft tilt of {tilt:g} deg is a vertical axis; the model is of horizontal-axis turbines"
        )
    floats = _floating(main, elasto)
    if floats:
        raise InputError(
            f"{floats}: the turbine floats; the model's tower is clamped at its foot, it has no platform motion"
        )
    aero = main.switch("CompAero")
    text = (main.path.parent / _plain(main.text("AeroFile"))).name
    if aero == 0:
        raise InputError(
            f"{main.where('CompAero')}: the deck has no aerodynamics (CompAero 0); blade geometry and polars come from AeroDyn's files, "
            "switch it on and name them"
        )
    if aero == 1 and text.lower() not in NOTHING:
        raise InputError(
            f"{main.where('CompAero')}: CompAero 1 is AeroDyn 14 or a disc; blade geometry and polars come from AeroDyn 15 (CompAero 2)"
        )


def _floating(main: DeckFile, elasto: DeckFile) -> str:
    """The place that says that the turbine floats, or nothing. Platform freedoms alone say nothing: they are on for SubDyn, too."""
    if main.switch("CompMooring", default=0) != 0:
        return main.where("CompMooring")
    hydro = main.switch("CompHydro", default=0) != 0
    if hydro and main.switch("CompSub", default=0) == 0 and elasto.flag("PtfmHvDOF", default=False):
        return elasto.where("PtfmHvDOF")
    return ""


def _uses_library(servo: DeckFile) -> bool:
    return 5 in (servo.switch("VSContrl", default=0), servo.switch("PCMode", default=0))


def _blades(file: DeckFile, spellings: tuple[str, ...], key: str, what: str) -> list[DeckFile]:
    """The file of blade 1, and those of blades 2 and 3 that are others."""
    first = _sub_file(file, spellings, what)
    out = [first]
    for number in (2, 3):
        name = f"{key}({number})"
        if file.has(name) and _plain(file.text(name)).lower() not in NOTHING:
            other = _sub_file(file, name, what)
            if other.sha256 != first.sha256 and all(other.path != known.path for known in out):
                out.append(other)
    return out


def _sub_file(file: DeckFile, keys: str | tuple[str, ...], what: str) -> DeckFile:
    keys = (keys,) if isinstance(keys, str) else keys
    entry, name = file.entry(*keys), file.text(*keys)
    return read_deck_file(_located(file, entry.line, entry.key, name), what)


def _optional(file: DeckFile, key: str, what: str, missing: list[str]) -> DeckFile | None:
    """A file that the turbine can do without; what is named and not there is said."""
    if not file.has(key) or _plain(file.text(key)).lower() in NOTHING:
        return None
    try:
        return _sub_file(file, key, what)
    except InputError:
        missing.append(f"{file.text(key)} ({key}, {file.where(key)})")
        return None


def _plain(name: str) -> str:
    return name.strip("\"' ").replace("\\", "/")


def _located(file: DeckFile, line: int, key: str, name: str) -> Path:
    """The file that a line names: Windows' separators and other cases of letters are forgiven. Raises InputError with the line."""
    plain = _plain(name)
    where = f"{file.path}:{line}"
    if plain.lower() in NOTHING:
        raise InputError(f"{where}: {key} names no file ({name!r}); it is needed")
    path = Path(plain)
    found = path if path.is_absolute() else file.path.parent / path
    if found.is_file():
        return found
    relaxed = _whatever_case(found)
    if relaxed is not None:
        return relaxed
    # an absolute path of another machine: the file often lies beside
    own = len(plain) > 1 and plain[1] == ":"
    beside = file.path.parent / plain.rsplit("/", 1)[-1]
    if (path.is_absolute() or own) and beside.is_file():
        return beside
    if found.is_dir():
        raise InputError(f"{where}: {key} names a folder, {found}; a file is needed")
    near = _nearby(file.path, plain)
    raise InputError(
        f"{where}: {key} names {plain}, which is not there; put the file at {found}, or correct the line"
        f"{f' (there is {near})' if near else ''}"
    )


def _nearby(asking: Path, plain: str) -> Path | None:
    """A file of that name in the deck's folder or above, as where a deck was moved a folder up or down."""
    tail = re.sub(r"^(\.*/)+", "", plain)
    folders = asking.resolve().parents[:LEVELS]
    return next((path for folder in folders if (path := folder / tail).is_file()), None)


def _whatever_case(path: Path) -> Path | None:
    """The file whose path differs in upper and lower case only, as Windows would find it."""
    folder = path.parent if path.parent.is_dir() else None
    if folder is None:
        parent = _whatever_case(path.parent) if path.parent != path else None
        folder = parent if parent is not None and parent.is_dir() else None
    if folder is None:
        return None
    if (folder / path.name).exists():
        return folder / path.name
    return next((p for p in sorted(folder.iterdir()) if p.name.lower() == path.name.lower()), None)
