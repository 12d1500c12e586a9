"""What is too big for one campaign, said before anything is built: cases, steps and samples of a case, memory of a block."""

from __future__ import annotations

import itertools
import os
from collections.abc import Sequence

from fatigue_runner.campaign.integration import Integration
from fatigue_runner.campaign.spec import Campaign
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.source import Source
from fatigue_runner.wind.section import Realisation, Site

MOST_CASES = 100_000  # of one campaign: its plan and results stay in memory
MOST_STEPS = 1e9  # of one case: hours of a core
# memory of a block [bytes] per sample: of the case that is evaluated, and of every case in it, its reference included (measured; 16
# states, 3 signals)
SAMPLE, SAMPLE_OF_CASE = 600, 420
WANTED = 7e8  # bytes of a worker beside the program itself: longer cases come in smaller blocks


def check_steps(campaign: Campaign, integrations: Sequence[Integration], source: Source) -> None:
    """Raises InputError, with the line, for a step so short that a case would never end."""
    for integration in integrations:
        steps = campaign.duration / integration.step
        if steps > MOST_STEPS:
            raise InputError(
                f"{source.where((*integration.path, 'step'))}: {integration.step:g} s makes {steps:.2g} steps of {campaign.duration:g} s, "
                f"and at most {MOST_STEPS:.0e} are run; use a larger step or a shorter duration"
            )


def check_memory(campaign: Campaign, source: Source) -> None:
    """Raises InputError, with the line, for cases so long that the workers would not find room for one each."""
    samples = campaign.duration * campaign.output_rate
    need, have = samples * (SAMPLE + SAMPLE_OF_CASE), _memory()
    if have is not None and need > 0.8 * have:
        raise InputError(
            f"{source.where(('duration',))}: {campaign.duration:g} s at {campaign.output_rate:g} Hz is {samples:.3g} samples of a case, "
            f"which need about {need / 1e9:.3g} GB of memory in a worker, and this machine has {have / 1e9:.3g} GB; split the case, or use "
            "a smaller output_rate"
        )


def winds_in_memory(samples: float) -> int:
    """How many winds of so many samples a block may have to stay within `WANTED`; at least one."""
    return max(1, int((WANTED / samples - SAMPLE) / SAMPLE_OF_CASE))


def realisations(campaign: Campaign, site: Site, integrations: int, source: Source) -> list[Realisation]:
    """The winds by name, before one of them is made. Raises InputError, with the line, where they make too many cases."""
    most = MOST_CASES // integrations
    found = list(itertools.islice(campaign.wind.winds(site), most + 1))
    if len(found) > most:
        raise InputError(
            f"{source.where(('wind',))}: more than {most:,} winds with {integrations} integrators each (the reference counts) are more "
            f"than the {MOST_CASES:,} cases that one campaign can have; shorten a sweep, or split the campaign"
        )
    return found


def _memory() -> float | None:
    """Of the machine, or of the container that this process lives in [bytes]; None where the system does not say."""
    try:
        installed = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (ValueError, OSError, AttributeError):
        return None
    try:
        with open("/sys/fs/cgroup/memory.max") as file:
            return min(installed, float(file.read()))
    except (OSError, ValueError):  # none, or "max"
        return installed
