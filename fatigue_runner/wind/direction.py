"""Where a wind blows that is turned against the nacelle."""

from __future__ import annotations

import math

import numpy as np


def directions(yaw: float, upflow: float) -> np.ndarray:
    """(3, 3): a wind's longitudinal, lateral and vertical direction (rows) in the nacelle's x (downwind), y (left), z (up).

    yaw [rad] is positive clockwise seen from above: the wind blows to -y; upflow [rad] upwards. OpenFAST's RotToWind of PropagationDir
    and VFlowAng.
    """
    (cy, sy), (cu, su) = ((math.cos(angle), math.sin(angle)) for angle in (yaw, upflow))
    return np.array([[cu * cy, -cu * sy, su], [sy, cy, 0.0], [-su * cy, su * sy, cu]])
