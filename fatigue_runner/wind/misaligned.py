"""Wind from aside and from below: any wind, turned against the nacelle as a whole."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.layout import ACROSS, HARMONICS, Channel
from fatigue_runner.rotor import Rotor
from fatigue_runner.wind.around import WindAround
from fatigue_runner.wind.checks import number
from fatigue_runner.wind.constant import ConstantWind
from fatigue_runner.wind.direction import directions
from fatigue_runner.wind.section import STEEPEST

TOLD = math.radians(30.0)  # up to here the wake's lean has been held against measurements


@dataclass(frozen=True)
class MisalignedWind(WindAround):
    """`wind` that blows by `yaw_misalignment` [rad] past the nacelle's axis and by `upflow` [rad] upwards.

    Positive misalignment turns the wind clockwise, seen from above: it then blows to the right of who looks downwind (OpenFAST's
    PropagationDir); positive upflow is upwards (VFlowAng). The nacelle does not turn, so that fore-aft and side-side stay along and
    across its axis. All of the wind turns, its profile and its turbulence too: `wind_speed`, shears and harmonics are the part along the
    nacelle's axis, and what blows across acts on the blades as one wind over the whole rotor. Full fields turn with their Taylor
    planes.

    Raises InputError for angles beyond 45 degrees.
    """

    kind = "misaligned"

    yaw_misalignment: float = 0.0
    upflow: float = 0.0

    def __post_init__(self) -> None:
        most = math.radians(STEEPEST)
        hint = f"angles are in radians, such as math.radians(8), and up to {STEEPEST:g} degrees"
        for name in ("yaw_misalignment", "upflow"):
            what = f"misaligned wind: {name}"
            value = number(what, getattr(self, name), at_least=-most, at_most=most, unit=" rad", hint=hint)
            object.__setattr__(self, name, value)
        if isinstance(self.wind, MisalignedWind):
            raise InputError("misaligned wind: it is turned twice; give both angles once")

    @classmethod
    def example(cls) -> MisalignedWind:
        return cls(ConstantWind(8.0, 0.14), math.radians(8.0), math.radians(5.0))

    def on(self, rotor: Rotor) -> Self:
        turned = replace(rotor, yaw=self.yaw_misalignment, upflow=self.upflow)
        return replace(self, wind=self.wind.on(turned))

    @property
    def _directions(self) -> np.ndarray:
        return directions(self.yaw_misalignment, self.upflow)

    @property
    def channels(self) -> tuple[Channel, ...]:
        own = [c for c in self.wind.channels if c not in ACROSS]
        place = next((i for i, c in enumerate(own) if c in HARMONICS), len(own))
        return (*own[:place], *ACROSS, *own[place:])

    @property
    def name(self) -> str:
        angles = {"yaw": self.yaw_misalignment, "up": self.upflow}
        return "-".join([self.wind.name, *(f"{k}{math.degrees(x):.3g}" for k, x in angles.items() if x)])

    @property
    def axial_speed(self) -> float:
        return self.wind.axial_speed * float(self._directions[0, 0])

    @property
    def parameters(self) -> dict[str, Any]:
        angles = {"yaw_misalignment_deg": self.yaw_misalignment, "upflow_deg": self.upflow}
        return {**self.wind.parameters, **{k: round(math.degrees(x), 9) for k, x in angles.items()}}

    @property
    def description(self) -> str:
        yaw, up = (f"{math.degrees(x):.3g}\u00a0degrees" for x in (self.yaw_misalignment, self.upflow))
        turned = [f"{yaw} of yaw misalignment"] * bool(self.yaw_misalignment) + [f"{up} of upflow"] * bool(
            self.upflow
        )
        return ", ".join([self.wind.description, *turned])

    @property
    def left_out(self) -> str:
        return self.wind.left_out

    @property
    def notes(self) -> tuple[str, ...]:
        steepest = max(abs(self.yaw_misalignment), abs(self.upflow))
        if steepest <= TOLD:
            return self.wind.notes
        return (
            *self.wind.notes,
            f"the wind comes {math.degrees(steepest):.3g} degrees off the nacelle's axis: beyond some {math.degrees(TOLD):.0f} the leaning "
            "wake of the model (Pitt and Peters, linear) is extrapolated.",
        )

    def _cells(self, n_cells: int) -> np.ndarray:
        inner, there = self.wind._cells(n_cells), {c: i for i, c in enumerate(self.wind.channels)}
        out = np.zeros((len(inner), inner.shape[1], self.signals))
        along = self._directions[0, 0]
        for row, channel in enumerate(self.channels):
            if channel in there:
                # shears are shares of the wind, which all its parts have in common
                out[:, :, row] = inner[:, :, there[channel]] * (along if channel.unit == "m/s" else 1.0)
        vector = [inner[:, :, there[c]] if c in there else 0.0 for c in (self.channels[0], *ACROSS)]
        for row, axis in ((0, 0), *((self.channels.index(c), i + 1) for i, c in enumerate(ACROSS))):
            out[:, :, row] = sum(part * to[axis] for part, to in zip(vector, self._directions, strict=True))
        return out
