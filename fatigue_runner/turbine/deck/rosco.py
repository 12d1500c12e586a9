"""Who steers the deck's turbine, as far as the torque law and the baseline controller hold it: ROSCO's "
"DISCON.IN, or ServoDyn's simple law."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees, pi
from typing import Any

import numpy as np

from fatigue_runner.turbine.deck.files import Deck
from fatigue_runner.turbine.deck.text import DeckFile

PLACEHOLDER = 9999.0  # and above, and 0: a number that stands for none
RPM = pi / 30
LEAST_SLIP, USUAL_SLIP = 2.0, 10.0  # percent

# The reference turbine's smooth corners over its rated torque and speed (data/nrel5mw.yaml); another turbine's are the same share.
_BLEND, _CONTROL_BLEND = 900.0 / 43093.55, 300.0 / 43093.55
_UNWIND_BLEND = 0.2 / 122.91
_PITCHES = np.geomspace(0.01, 10.0, 600)  # where the gain schedule's pitch_K is looked for [rad]


@dataclass(frozen=True)
class Steering:
    """Sections `generator` (empty where the deck tells no torque law) and `control` (None where it tells no controller)."""

    generator: dict[str, Any]
    control: dict[str, Any] | None


def steering(deck: Deck, drivetrain: dict[str, Any], notes: list[str]) -> Steering:
    """From the deck's ROSCO input where its controller is ROSCO's, else from ServoDyn's simple law; what was decided goes to `notes`."""
    if deck.discon is not None and _of_rosco(deck.discon):
        return _rosco(deck.discon, notes)
    if deck.servo is not None and deck.servo.switch("VSContrl", default=0) == 1:
        found = _simple(deck.servo, notes)
        if found is not None:
            return found
    return Steering({}, None)


def rated_rotor_speed(deck: Deck) -> float | None:
    """[rad/s] of the rotor, from the same places as the torque law; None where the deck tells none."""
    ratio = deck.elasto.number("GBRatio")
    if deck.discon is not None and _of_rosco(deck.discon):
        return deck.discon.number("PC_RefSpd") / ratio
    if deck.servo is not None and deck.servo.switch("VSContrl", default=0) == 1:
        speed = deck.servo.number("VS_RtGnSp")
        if 0 < speed < PLACEHOLDER:
            return speed * RPM / ratio
    return None


def _of_rosco(discon: DeckFile) -> bool:
    return discon.has("VS_Rgn2K", "PC_RefSpd", "VS_RtPwr")


def _simple(servo: DeckFile, notes: list[str]) -> Steering | None:
    """ServoDyn's own law (VSContrl 1): k n^2, a ramp, constant torque; its k is per rpm^2."""
    gain = servo.number("VS_Rgn2K")
    if not 0 < gain < PLACEHOLDER:
        return None
    speed, torque = servo.number("VS_RtGnSp"), servo.number("VS_RtTq")
    generator: dict[str, Any] = {
        "law": "optimal",
        "optimal_gain": gain / RPM**2,
        "efficiency": _efficiency(servo),
    }
    if not _reached(speed, torque, gain):
        notes.append(
            f"the rated speed {speed:g} rpm ({servo.where('VS_RtGnSp')}) stands for none: the torque is k n^2 "
            f"at every speed, there is no rated power"
        )
        return Steering(generator, None)
    generator |= {
        "law": "regions",
        "regions": {
            "region_3_speed_rpm": speed,
            "slip_percent": _slip(servo, notes),
            "rated_torque": torque,
            "blend_torque": round(_BLEND * torque, 6),
        },
    }
    return Steering(generator, None)


def _slip(servo: DeckFile, notes: list[str]) -> float:
    """VS_SlPc; the vanishing ones of decks that mean no ramp make the torque a step, which no step in time follows."""
    value = servo.number("VS_SlPc")
    if value >= PLACEHOLDER:
        return USUAL_SLIP
    if value < LEAST_SLIP:
        notes.append(
            f"VS_SlPc {value:g} % ({servo.where('VS_SlPc')}) is a step of the torque to its rated value: it is a ramp over "
            f"{LEAST_SLIP:g} % of the speed here, which steps in time can follow"
        )
        return LEAST_SLIP
    return value


def _reached(speed: float, torque: float, gain: float) -> bool:
    """Whether a turbine gets to this rated speed: a torque far from k n^2 there is a placeholder, as is the speed itself."""
    return 0 < speed < PLACEHOLDER and 0.1 < torque / (gain * speed**2) < 10


def _efficiency(servo: DeckFile) -> float:
    value = servo.number("GenEff", default=100.0) / 100
    return value if 0 < value <= 1 else 1.0


def _rosco(discon: DeckFile, notes: list[str]) -> Steering:
    gain, rated = discon.number("VS_Rgn2K"), discon.number("PC_RefSpd")  # N.m/(rad/s)^2 and rad/s
    efficiency = discon.number("VS_GenEff", default=100.0) / 100
    torque = discon.number("VS_RtTq", default=0.0)
    power = torque * rated if torque else discon.number("VS_RtPwr") / efficiency
    torque = power / rated
    mode = int(discon.number("VS_ControlMode", default=1))
    # 0 and 2: constant torque above rated; 1 and 3: constant power. ROSCO 2.9 has a switch of its own.
    constant_power = mode in (1, 3)
    if discon.has("VS_ConstPower"):
        constant_power = discon.number("VS_ConstPower") == 1
    if mode in (2, 3):
        notes.append(
            f"ROSCO follows the tip-speed ratio with a PI law (VS_ControlMode {mode}); here region 2 is k n^2 with its VS_Rgn2K"
        )
    regions: dict[str, Any] = {
        "region_3_speed_rpm": round(0.99 * rated / RPM, 6),
        "slip_percent": USUAL_SLIP,
        "blend_torque": round(_BLEND * torque, 6),
    }
    regions["rated_mechanical_power" if constant_power else "rated_torque"] = (
        power if constant_power else torque
    )
    generator = {
        "law": "regions",
        "optimal_gain": gain,
        "regions": regions,
        "efficiency": efficiency if 0 < efficiency <= 1 else 1.0,
    }
    return Steering(generator, _control(discon, rated, torque, notes))


def _control(discon: DeckFile, rated: float, torque: float, notes: list[str]) -> dict[str, Any] | None:
    """The baseline controller that comes nearest to ROSCO's."""
    if discon.number("PC_ControlMode", default=1) == 0:
        notes.append("ROSCO's pitch is off (PC_ControlMode 0): no controller")
        return None
    fitted = _gains(discon, notes)
    if fitted is None:
        return None
    proportional, integral, schedule = fitted
    least = discon.number("VS_MinOMSpd", default=0.0)
    if not 0.1 * rated < least < 0.95 * rated:
        if least:
            notes.append(
                f"VS_MinOMSpd {least:g} rad/s ({discon.where('VS_MinOMSpd')}) is no speed between cut-in and rated: half of rated is taken"
            )
        least = 0.5 * rated
    region_2 = min(1.1 * least, 0.5 * (least + rated))
    most = discon.number("VS_MaxTq", default=1.1 * torque)
    control = {
        "rated_speed_rpm": rated / RPM,
        "proportional_gain": proportional,
        "integral_gain": integral,
        "gain_schedule_pitch_deg": degrees(schedule),
        "filter_frequency_hz": discon.number("F_LPFCornerFreq") / (2 * pi),
        "cut_in_speed_rpm": least / RPM,
        "region_2_speed_rpm": region_2 / RPM,
        "largest_torque": max(most, torque),
        "fine_pitch_deg": degrees(discon.number("PC_FinePit", default=0.0)),
        "region_3_pitch_deg": max(degrees(discon.number("PC_Switch", default=pi / 180)), 0.1),
        "unwind_blend": _UNWIND_BLEND * rated,
        "torque_blend": _CONTROL_BLEND * torque,
        "pitch_rate_limit_deg": degrees(discon.number("PC_MaxRat", default=8 * pi / 180)) or 8.0,
    }
    if discon.number("F_LPFType", default=1) == 2:
        notes.append(
            "ROSCO's low-pass of the generator speed is of second order (F_LPFType 2): here it is of first order, with the same corner"
        )
    return {key: float(f"{value:.9g}") for key, value in control.items()}


def _gains(discon: DeckFile, notes: list[str]) -> tuple[float, float, float] | None:
    """K_P [s], K_I [-] at zero pitch and the pitch [rad] at which they are halved, nearest to ROSCO's tables of gains.

    ROSCO's are negative (its error is reference minus speed) and free functions of the pitch; the baseline's are K / (1 + pitch /
    pitch_K), both with one pitch_K. It is taken from K_I, which alone holds the speed.
    """
    pitch = np.array(discon.numbers("PC_GS_angles"))
    kp, ki = (-np.array(discon.numbers(f"PC_GS_{n}")) for n in ("KP", "KI"))
    if not (len(pitch) == len(kp) == len(ki)) or not np.any(ki > 0):
        notes.append(
            f"the gains of {discon.path.name} make no PI controller ({discon.where('PC_GS_KI')}): no controller"
        )
        return None
    # Least squares: for a given pitch_K the amplitude is linear
    shapes = 1 / (1 + pitch / _PITCHES[:, None])
    amplitudes = shapes @ ki / (shapes**2).sum(axis=1)
    best = int(np.argmin(((amplitudes[:, None] * shapes - ki) ** 2).sum(axis=1)))
    schedule, integral, shape = float(_PITCHES[best]), float(amplitudes[best]), shapes[best]
    proportional = float(kp @ shape / (shape @ shape))
    if not proportional > 0:
        proportional = float(max(kp.max(), 1e-9))
    off = {
        name: float(np.abs(k * shape - table).max() / np.abs(table).max())
        for name, k, table in (("K_P", proportional, kp), ("K_I", integral, ki))
    }
    worst = ", ".join(f"{name} by up to {100 * value:.0f} % of its largest" for name, value in off.items())
    sign = "; ROSCO's K_P changes its sign over the pitch, the baseline's cannot" if np.any(kp < 0) else ""
    notes.append(
        f"pitch gains K / (1 + pitch / pitch_K) are fitted to ROSCO's {len(pitch)} gains and miss {worst}{sign}"
    )
    return proportional, integral, schedule
