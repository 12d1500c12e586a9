"""What a deck has and the model leaves out, each with what that means for fatigue."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from fatigue_runner.turbine.deck.files import Deck


@dataclass(frozen=True)
class Omission:
    """what: of the deck, with its value; means: for fatigue loads."""

    what: str
    means: str


LEAST_PITCH = 0.05  # deg, that is worth a word

# Degrees of freedom of ElastoDyn that the model has not, by their keys.
_FREEDOMS = {
    "FlapDOF2": (
        "second flapwise blade mode",
        "flap loads near its frequency are not there; the deflection under load is that of one mode",
    ),
    "TwFADOF2": (
        "second fore-aft tower mode",
        "it moves the tower's middle and top: accelerations there, hardly the moment at the base",
    ),
    "TwSSDOF2": (
        "second side-side tower mode",
        "it moves the tower's middle and top: accelerations there, hardly the moment at the base",
    ),
    "YawDOF": (
        "yaw",
        "the nacelle does not turn: yaw-bearing loads are not there, tower torsion is not there",
    ),
    "PitchDOF": (
        "pitch as a degree of freedom",
        "the blades' pitch follows its command at once; pitch-bearing loads are not there",
    ),
    "PtfmSgDOF": ("platform surge", "the foot of the tower stands still"),
    "PtfmSwDOF": ("platform sway", "the foot of the tower stands still"),
    "PtfmRDOF": ("platform roll", "a soft foundation lowers the tower's frequencies; here it is clamped"),
    "PtfmPDOF": ("platform pitch", "a soft foundation lowers the tower's frequencies; here it is clamped"),
}


def omissions(deck: Deck, data: Mapping[str, Any]) -> list[Omission]:
    """In the order of the deck: structure, support, aerodynamics, control. data: the turbine's mapping."""
    return [*_structure(deck), *_support(deck, data), *_aerodynamics(deck), *_control(deck, data)]


def _structure(deck: Deck) -> Iterator[Omission]:
    elasto, main = deck.elasto, deck.main
    for key, (name, means) in _FREEDOMS.items():
        if elasto.flag(key, default=False):
            yield Omission(f"{name} ({key} is on)", means)
    off = [
        key
        for key in ("FlapDOF1", "EdgeDOF", "DrTrDOF", "GenDOF", "TwFADOF1", "TwSSDOF1")
        if not elasto.flag(key, default=True)
    ]
    if off:
        yield Omission(
            f"switches of somebody's run: {', '.join(off)} off",
            "the model always has these degrees of freedom; a comparison with this deck's own run needs them on",
        )
    if main.switch("CompElast") == 2:
        yield Omission(
            "BeamDyn's blades (CompElast 2)",
            "taken are ElastoDyn's blades of the same deck, which have no torsion and bend in one flap and one edge mode",
        )
    else:
        yield Omission(
            "blade torsion",
            "sections keep their angle under load; the longer and softer the blade, the more that moves flap loads and stability",
        )
    if deck.other_blades:
        names = ", ".join(sorted({file.path.name for file in deck.other_blades}))
        yield Omission(
            f"blades that differ ({names})",
            "all three blades are blade 1: loads of an imbalance at 1P are not there",
        )
    if elasto.flag("Furling", default=False):
        yield Omission(
            "furling", "the rotor does not turn out of the wind; loads above the furling wind are too large"
        )
    for kind, place in (("B", "blades"), ("N", "nacelle"), ("T", "tower"), ("S", "substructure")):
        if deck.servo is not None and deck.servo.number(f"Num{kind}StC", default=0) > 0:
            yield Omission(
                f"structural control in the {place} (Num{kind}StC)",
                "a damper's effect on the loads is not there: they are too large",
            )


def _support(deck: Deck, data: Mapping[str, Any]) -> Iterator[Omission]:
    main, foot = deck.main, data["geometry"]["tower_base_height"]
    if main.switch("CompSub", default=0) or main.switch("CompSoil", default=0):
        yield Omission(
            f"the substructure (CompSub {main.switch('CompSub', default=0)})",
            f"the tower is clamped at {foot:g} m: its frequencies are higher than on its foundation, which the "
            f"deck has; where 1P or 3P come "
            "near the real ones, the tower's DEL is another",
        )
    if main.switch("CompHydro", default=0):
        yield Omission(
            "waves and current (CompHydro)",
            "loads from waves are not there, offshore a large part of the tower's fatigue",
        )
    if main.switch("CompIce", default=0):
        yield Omission("ice (CompIce)", "loads from ice are not there")
    mass = deck.elasto.number("PtfmMass", default=0.0)
    if mass:
        yield Omission(
            f"platform mass of {mass:g} kg (PtfmMass)", "it stands still below the clamped foot: no effect"
        )


def _aerodynamics(deck: Deck) -> Iterator[Omission]:
    aero = deck.aero
    wake = aero.switch("Wake_Mod", "WakeMod", default=1)
    if wake == 0:
        yield Omission(
            "a rotor without induction (Wake_Mod 0)",
            "the model's tables have induction; they are not this run's loads",
        )
    elif wake == 3:
        yield Omission(
            "the free-vortex wake, OLAF (Wake_Mod 3)",
            "the tables are of blade elements in momentum balance with the wake at once, without its memory",
        )
    if wake == 2 or (aero.switch("DBEMT_Mod", default=0) > 0 and aero.has("Wake_Mod")):
        yield Omission(
            "dynamic inflow (DBEMT)",
            "induction follows wind and pitch at once: loads after gusts and pitch steps overshoot less than they should",
        )
    unsteady = (
        aero.switch("UA_Mod", default=0) > 0
        if aero.has("UA_Mod")
        else aero.switch("AFAeroMod", default=1) == 2
    )
    if unsteady:
        yield Omission(
            "dynamic stall and unsteady airfoil aerodynamics",
            "polars are quasi-steady: with dynamic stall and wake OpenFAST has 4 % more flap DEL on the 5-MW at "
            "8 m/s; more where blades stall",
        )
    if aero.switch("TwrPotent", default=0) or aero.switch("TwrShadow", default=0):
        yield Omission(
            "the tower's influence on the wind (TwrPotent, TwrShadow)",
            "off by default: a campaign switches it on with `wind: {tower_influence: true}` (docs/wind.md), 3P loads depend on it",
        )
    if aero.flag("TwrAero", default=False):
        yield Omission(
            "drag of the tower (TwrAero)",
            "a load of the tower base that follows the wind's square, none that comes with the rotor",
        )
    if aero.flag("NacelleDrag", default=False):
        yield Omission("drag of the nacelle (NacelleDrag)", "a small mean load of the tower base")
    if aero.flag("AIDrag", default=False) or aero.flag("TIDrag", default=False):
        yield Omission(
            "drag in the induction (AIDrag, TIDrag)",
            "0.2 % of the thrust and 0.1 % of the tip deflection on the IEA-3.4 at 8 m/s, more where blades stall",
        )
    for key, what in (("TipLoss", "tip"), ("HubLoss", "hub"), ("TanInd", "tangential induction")):
        if not aero.flag(key, default=True):
            loss = what if key == "TanInd" else f"{what} loss"
            yield Omission(
                f"{loss} is off ({key} False)",
                "the model's tables have it: power and thrust are lower than in this deck's own run",
            )
    if aero.flag("UseBlCm", default=False):
        yield Omission(
            "the airfoils' pitching moment (UseBlCm)",
            "it twists the blade, which is rigid in torsion here: below 0.1 % of the means on the IEA-3.4",
        )
    if aero.flag("TFinAero", default=False):
        yield Omission("the tail fin", "the nacelle does not yaw")
    if aero.flag("Buoyancy", default=False):
        yield Omission("buoyancy", "in air it is nothing")


def _control(deck: Deck, data: Mapping[str, Any]) -> Iterator[Omission]:
    servo, discon = deck.servo, deck.discon
    if servo is None:
        yield Omission("no ServoDyn (CompServo 0)", "the deck has no controller; see the torque law above")
        return
    pitch, mode = deck.elasto.number("BlPitch(1)", default=0.0), servo.switch("PCMode", default=0)
    if mode == 0 and abs(pitch) >= LEAST_PITCH:
        yield Omission(
            f"the pitch at which the blades stand (PCMode 0, BlPitch(1) {pitch:g} deg)",
            f"nothing here turns them by itself: `pitch: {pitch:g}` in a campaign with `operation: fixed`, or loads are those of 0 deg",
        )
    if data.get("control") is None:
        yield Omission(
            f"the pitch controller (PCMode {mode})",
            "there is none that this program can read: only `operation: fixed` works, loads above rated need a `control` section",
        )
    if servo.switch("YCMode", default=0):
        yield Omission(
            "yaw control (YCMode)",
            "the rotor always faces the mean wind; loads from yaw errors are not there",
        )
    if discon is None:
        return
    for key, what, means in (
        (
            "IPC_ControlMode",
            "individual pitch control",
            "it takes 1P out of the flap loads: here they stay, too large",
        ),
        (
            "PS_Mode",
            "pitch saturation, peak shaving",
            "thrust near rated is not cut: tower and flap loads there are too large",
        ),
        ("TD_Mode", "the tower damper", "fore-aft loads above rated are too large by what it damps"),
        ("Fl_Mode", "floating feedback", "of a floating turbine; none here"),
        (
            "SS_Mode",
            "the set-point smoother",
            "between the regions torque and pitch act together more than ROSCO's do",
        ),
        ("PA_Mode", "the pitch actuator", "the pitch follows its command at once"),
        ("F_NotchType", "notch filters", "excitation of a mode through the controller is not notched out"),
        ("Flp_Mode", "trailing-edge flaps", "their relief is not there"),
        ("PRC_Mode", "derating", "the turbine runs at its rated power"),
        (
            "TRA_Mode",
            "tower resonance avoidance",
            "rotor speeds at which 3P meets the tower are not jumped over",
        ),
    ):
        if discon.has(key) and discon.number(key) > 0:
            yield Omission(f"{what} ({key} {discon.number(key):g})", means)
