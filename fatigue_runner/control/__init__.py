"""What steers: controllers as submodels beside the turbine, one a file.

A submodel (`submodel`) declares its states, their rates, its outputs and where it starts; the derivation prints it into the kernels.
"""

from fatigue_runner.control.actuator import actuated
from fatigue_runner.control.baseline import BASELINE
from fatigue_runner.control.submodel import Submodel

# every controller, alone and behind a pitch actuator; each has a generated module of its name
CONTROLLERS = {BASELINE.name: BASELINE}
SUBMODELS = tuple(m for one in CONTROLLERS.values() for m in (one, actuated(one)))

__all__ = ["BASELINE", "CONTROLLERS", "SUBMODELS", "Submodel", "actuated"]
