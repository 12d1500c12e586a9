"""The sections of the report, one file each.

A section is a module here with an integer `ORDER` (its place on the page) and a function
`build(run) -> Section | None` (None: nothing to tell for this run). Adding a section is adding a file.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable

from fatigue_runner.report.blocks import Section
from fatigue_runner.report.rundata import Run


def builders() -> list[Callable[[Run], Section | None]]:
    """The `build` functions of all modules of this package, in the order of the page."""
    modules = [importlib.import_module(f"{__name__}.{info.name}") for info in pkgutil.iter_modules(__path__)]
    return [module.build for module in sorted(modules, key=lambda module: (module.ORDER, module.__name__))]
