"""What ran, with which versions, on which machine: the facts that logs and the run folder carry."""

from __future__ import annotations

import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

from fatigue_runner._version import __version__

LIBRARIES = ("numpy", "scipy", "numba")


def about(campaign: str, turbine: Any) -> dict[str, str]:
    """Facts by name, as text: campaign, turbine, turbine_hash, versions, machine."""
    versions = [f"fatigue-runner {__version__}", *(f"{name} {metadata.version(name)}" for name in LIBRARIES)]
    return {
        "campaign": campaign,
        "turbine": turbine.name,
        "turbine_hash": turbine.hash,
        "versions": ", ".join([*versions, f"Python {platform.python_version()}"]),
        "machine": f"{_processor()}, {os.cpu_count()} cores, {platform.system()}",
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    named = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.machine())
