"""What is learned: maps from what a step has seen to its defect, the guard, the artefact bound to turbine, method and step, and where it
is found; and how all of that is trained."""

from fatigue_runner.corrector.artefact import load, save
from fatigue_runner.corrector.corrector import Corrector
from fatigue_runner.corrector.errors import CorrectorError
from fatigue_runner.corrector.guard import Guard
from fatigue_runner.corrector.library import correctors, find

__all__ = ["Corrector", "CorrectorError", "Guard", "correctors", "find", "load", "save"]
