"""What blows: the wind signals of one case as functions of time, for the rotor as a whole.

A wind source gives the signals of `channels.WIND_SIGNALS` (speed, vertical and horizontal linear shear) as
cubic polynomials on uniform time cells, which is what the kernels evaluate at the stage times: constant,
stepwise, a smooth series through samples (also from a file), and IEC Kaimal turbulence projected on the rotor
disc. Every module of this folder is imported here, so a new source is one new file: a subclass of
`WindSource` with a `kind` is found by `make_wind` and by the tests.
"""

from importlib import import_module
from pkgutil import iter_modules

from fatigue_runner.wind.constant import ConstantWind
from fatigue_runner.wind.from_file import read_wind_file
from fatigue_runner.wind.full_field import FullFieldWind
from fatigue_runner.wind.gust import GustWind
from fatigue_runner.wind.misaligned import MisalignedWind
from fatigue_runner.wind.series import SeriesWind
from fatigue_runner.wind.source import SOURCES, WindSource, make_wind
from fatigue_runner.wind.stack import stack_cells
from fatigue_runner.wind.steps import StepWind
from fatigue_runner.wind.tower import TowerInfluence
from fatigue_runner.wind.turbulence import TurbulentWind

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")

__all__ = [
    "SOURCES",
    "ConstantWind",
    "FullFieldWind",
    "GustWind",
    "MisalignedWind",
    "SeriesWind",
    "StepWind",
    "TowerInfluence",
    "TurbulentWind",
    "WindSource",
    "make_wind",
    "read_wind_file",
    "stack_cells",
]
