"""The rotor as wind and turbine both see it: where the disc is, how large, and where along the blades the wind counts."""

from __future__ import annotations

from dataclasses import dataclass

# what a rotor feels whose blades nobody has given: the square of the radius, within 2 % of the 5 MW's own weight in every load
SQUARE = (tuple(i / 10 for i in range(11)), tuple(0.03 * i * i for i in range(11)))


@dataclass(frozen=True)
class Rotor:
    """radius: R of the tip-speed ratio and the shears, the tips' distance from the shaft; hub_height above the ground; both [m].

    weight: (r/R, density), linear between, of integral one: how much wind at each radius moves the blade's root flap moment.
    apex: of the rotor, downwind of the tower's axis [m]; tilt of the shaft [rad], negative lifts the upwind end; cone of the blades [rad],
    negative turns the tips upwind; tower: (height above ground, diameter) pairs [m], rising; none where nobody gave them.
    yaw, upflow [rad]: how far the wind blows past the nacelle's axis, clockwise seen from above, and upwards.
    """

    radius: float
    hub_height: float
    weight: tuple[tuple[float, ...], tuple[float, ...]] = SQUARE
    apex: float = 0.0
    tilt: float = 0.0
    cone: float = 0.0
    tower: tuple[tuple[float, float], ...] = ()
    yaw: float = 0.0
    upflow: float = 0.0
