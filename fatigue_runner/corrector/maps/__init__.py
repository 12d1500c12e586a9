"""What is learned of a step: maps from what the step has seen to its defect, one kind a file.

Every module of this folder is imported here, so a new kind is one new file: a subclass of `Map` with a `kind` is found when an
artefact of it is read.
"""

from importlib import import_module
from pkgutil import iter_modules

from fatigue_runner.corrector.maps.map import MAPS, Map, map_class
from fatigue_runner.corrector.maps.multi_blade import MultiBladeMap
from fatigue_runner.corrector.maps.raw import RawNetwork
from fatigue_runner.corrector.maps.stage import StageMap

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")

__all__ = ["MAPS", "Map", "MultiBladeMap", "RawNetwork", "StageMap", "map_class"]
