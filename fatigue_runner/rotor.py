"""The rotor as wind and turbine both see it: where the disc is and how large."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rotor:
    """radius: R of the tip-speed ratio and the shears, the tips' distance from the shaft; hub_height above the ground; both [m]."""

    radius: float
    hub_height: float
