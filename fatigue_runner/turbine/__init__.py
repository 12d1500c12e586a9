"""What turns: parameters, beam modes, aerodynamics, equations of motion, loads.

Data flow: data/*.yaml -> beam.py and aerodynamics.py -> parameters.py, tables.py -> Turbine -> generated/kernel.py, which
tools/generate_kernel.py prints from derivation/, or generated/pitched.py where the pitch varies in time; lane_code.py makes vector
instructions of them, and a token of model.py tells compiled code which one it runs.
"""

from fatigue_runner.turbine.turbine import Turbine, load_turbine

__all__ = ["Turbine", "load_turbine"]
