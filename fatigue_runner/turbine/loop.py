"""The closed loop of a turbine under its controller: its poles above rated wind, and the mode in which speed and pitch swing.

Of the whole model: bending, drivetrain, filter and actuator are in it, linearised in multiblade coordinates (`steady.linearised`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.errors import InputError
from fatigue_runner.turbine.rigid import USUAL_CUT_OUT
from fatigue_runner.turbine.steady import linearised

if TYPE_CHECKING:
    from fatigue_runner.turbine.turbine import Turbine

CHECKED_AT = (0.05, 0.15, 0.35, 0.65, 1.0)  # of the way from rated to cut-out wind
NEUTRAL = 1e-6  # 1/s; the azimuth's free rotation has a pole at 0
SHOWN = 3  # poles in a sentence

_stable: set[str] = set()  # hashes of turbines that were found to be


class Mode(NamedTuple):
    """frequency: undamped, [rad/s]; damping ratio [-]."""

    frequency: float
    damping: float


def winds_above_rated(turbine: Turbine) -> list[float]:
    """Some winds between rated and cut-out [m/s]; none where the turbine does not reach its power."""
    if turbine.controller is None or turbine.control is None:
        return []
    rated, last = turbine.rated_wind, (turbine.operating_wind or (0.0, USUAL_CUT_OUT))[1]
    return (
        [rated + share * (last - rated) for share in CHECKED_AT] if rated is not None and rated < last else []
    )


def poles(turbine: Turbine, wind: float) -> NDArray[np.complex128]:
    """Of the turbine with its controller, linearised at `wind` [m/s], by falling real part [1/s]."""
    values = np.linalg.eigvals(linearised(turbine, wind)).astype(complex)
    return values[np.argsort(-values.real)]


def speed_mode(turbine: Turbine, wind: float) -> Mode | None:
    """The oscillation of rotor speed and pitch: the slowest one in which rotor and generator turn together; None where there is none."""
    values, vectors = np.linalg.eig(linearised(turbine, wind))
    layout, p = turbine.layout, turbine.parameters
    # energies: tower and blades in their modal masses
    mass = np.full(layout.freedoms, p["b_fxfx"] + p["b_fyfy"])
    mass[: layout.blade_sets[0]] = p["t_maa"] + p["n_m"] + p["h_m"] + 3 * p["b_m"]
    mass[layout.rotor :] = 3 * p["b_m2"] + p["h_ixx"], p["g_i"]
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        energy = mass * np.abs(vector[layout.velocities]) ** 2
        rotor, generator = vector[layout.rotor_speed], vector[layout.generator_speed] / turbine.gearbox_ratio
        together = abs(generator - rotor) < 0.5 * abs(rotor)
        if value.imag > 0.02 and together and energy[layout.rotor :].sum() > energy[: layout.rotor].sum():
            found.append(Mode(float(abs(value)), float(-value.real / abs(value))))
    return min(found, default=None)


def check_loop(turbine: Turbine) -> None:
    """Raises InputError, with the poles, where a turbine under its controller is unstable above rated wind."""
    if turbine.hash in _stable:
        return
    for wind in winds_above_rated(turbine):
        try:
            found = poles(turbine, wind)
        except InputError:
            continue  # no operating point: refused where a case asks for that wind
        growing = [pole for pole in found if pole.real > NEUTRAL and pole.imag >= 0]
        if growing:
            raise InputError(
                f"turbine {turbine.name}: under its controller it is unstable at {wind:.3g} m/s: "
                f"{'poles' if len(growing) > 1 else 'a pole'} at {', '.join(map(_written, growing[:SHOWN]))} 1/s; "
                f"{_way_out(turbine)}"
            )
    _stable.add(turbine.hash)


def _written(pole: complex) -> str:
    if pole.imag == 0:
        return f"{pole.real:.3g}"
    return f"{pole.real:.3g} ± {pole.imag:.3g}i ({abs(pole) / (2 * np.pi):.2g} Hz)"


def _way_out(turbine: Turbine) -> str:
    control = turbine.control or {}
    if control.get("tuning") is not None:
        return "in `control: tuning`, change natural_frequency or damping_ratio"
    kp, ki = control.get("proportional_gain"), control.get("integral_gain")
    gains = f"proportional_gain ({kp:.3g} s) and integral_gain ({ki:.3g})" if kp and ki else "the gains"
    slow = ", take a faster `actuator`," if control.get("actuator") else ""
    return f"in `control`, change {gains}{slow} or have them made by `tuning`"
