"""Wind from full-field files: one reader per format, one common `WindField`, its projection on the rotor.

TurbSim `.bts` (turbsim), TurbSim's Bladed-style `.wnd` with its `.sum` (bladed), HAWC2's Mann boxes (hawc) and
AeroDyn's uniform wind text `.wnd`/`.hh` (uniform) are read to the numbers that OpenFAST's InflowWind reads from
them; `read_wind` tells them apart. `harmonics_of` (projection) gives the blade-effective azimuthal amplitudes
of a field in time, `harmonics_of_uniform` those of a uniform wind. Longitudinal wind only: the turbine model
knows no other turbulence.

No package is needed for that: openfast_io reads `.bts` alone and brings pandas, hipersim and wetb bring HDF5 and
NetCDF for reading floats; none checks what it reads.
"""

from fatigue_runner.wind.fields.field import WindField
from fatigue_runner.wind.fields.formats import read_wind
from fatigue_runner.wind.fields.hawc import MannBox
from fatigue_runner.wind.fields.projection import FieldHarmonics, harmonics_of
from fatigue_runner.wind.fields.uniform import UniformWind, harmonics_of_uniform

__all__ = [
    "FieldHarmonics",
    "MannBox",
    "UniformWind",
    "WindField",
    "harmonics_of",
    "harmonics_of_uniform",
    "read_wind",
]
