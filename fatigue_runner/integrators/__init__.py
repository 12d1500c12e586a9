"""How time passes: Butcher tableaux, compiled stepping of lanes, dense output, stability limits."""

from fatigue_runner.integrators.block import simulate_block, warm_up
from fatigue_runner.integrators.ensemble import ENHANCED, HYBRID, MODES, Ensemble, Integrator, simulate
from fatigue_runner.integrators.methods import METHODS, method
from fatigue_runner.integrators.stability import stability_limit

__all__ = [
    "ENHANCED",
    "HYBRID",
    "METHODS",
    "MODES",
    "Ensemble",
    "Integrator",
    "method",
    "simulate",
    "simulate_block",
    "stability_limit",
    "warm_up",
]
