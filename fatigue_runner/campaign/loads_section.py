"""What a campaign looks at beside base and root: the keys of `loads`, off unless they are given.

tower_heights     bending moments of the tower at these heights above its foot [m], fore-aft and side-side: a sweep
blade_radii       bending moments of blade 1 at these distances from the rotor's apex [m], flapwise and edgewise: a sweep
root_directions   bending moment of blade 1's root by direction, as many over half a circle (12: every 15 degrees); the other half has
                  the same ranges

Each is a channel of its own in results.csv, logs and report, counted with the exponents of `fatigue`; see docs/channels.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from fatigue_runner.channels import Channel, sections
from fatigue_runner.inputs.section import Section
from fatigue_runner.inputs.sweep import Sweep, expand

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine
    from fatigue_runner.turbine.section_loads import SectionLoads


class LoadsSection(Section):
    """See the module's text."""

    tower_heights: Sweep | None = None
    blade_radii: Sweep | None = None
    root_directions: int = Field(default=0, ge=0, le=72)

    @property
    def places(self) -> tuple[list[float], list[float], int]:
        """Heights and radii [m], each once and in order, and the number of directions."""
        heights, radii = (
            sorted({value for value, _ in expand(sweep)}) if sweep is not None else []
            for sweep in (self.tower_heights, self.blade_radii)
        )
        return heights, radii, self.root_directions

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What they are called."""
        return sections(*self.places)

    def of(self, turbine: Turbine) -> SectionLoads | None:
        """What makes them on a turbine; None where none are asked for. Raises InputError for a place that it does not have."""
        from fatigue_runner.turbine.section_loads import SectionLoads

        return SectionLoads.of_turbine(turbine, *self.places) if self.channels else None
