"""What turns: parameters, beam modes, aerodynamics, equations of motion, loads.

Data flow: data/*.yaml -> beam.py and aerodynamics.py -> parameters.py, tables.py -> Turbine -> generated/kernel.py, which
tools/generate_kernel.py prints from equations.py, or generated/pitched.py (pitching.py) where the pitch varies in time; lane_code.py
makes vector instructions of them, model.py picks one.
"""

from fatigue_runner.turbine.turbine import Turbine, load_turbine

__all__ = ["Turbine", "load_turbine"]
