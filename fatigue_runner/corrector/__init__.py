"""What is learned: features of a step, samples of its defect, fits and networks, the guarded artefact and where it is found."""

from fatigue_runner.corrector.artefact import Corrector, CorrectorError, Guard, load, save
from fatigue_runner.corrector.library import correctors, find

__all__ = ["Corrector", "CorrectorError", "Guard", "correctors", "find", "load", "save"]
