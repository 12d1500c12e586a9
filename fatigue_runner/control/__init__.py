"""What steers: controllers as submodels beside the turbine, one a file.

A submodel (`submodel`) declares its states, their rates, its outputs and where it starts; the derivation prints it into the kernels.
"""

from fatigue_runner.control.baseline import BASELINE
from fatigue_runner.control.submodel import Submodel

__all__ = ["BASELINE", "Submodel"]
