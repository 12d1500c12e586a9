"""What comes with the program beside its code: turbines, campaigns and correctors, by name.

Turbines lie in the package. Campaigns and correctors lie at the top of the repository, where people look for them; a wheel
carries them in the package's `data/` (pyproject.toml), so that they are found however the program was installed.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

from fatigue_runner.errors import InputError, did_you_mean


@cache
def turbines() -> Path:
    """The folder of the shipped turbines' YAML files and tables."""
    return _package() / "turbine" / "data"


@cache
def correctors() -> Path:
    """The folder of the shipped correctors, their recipes and cards."""
    return _carried("correctors")


@cache
def campaigns() -> Path:
    """The folder of the shipped campaigns."""
    return _carried("campaigns")


def campaign_names() -> list[str]:
    """The names that `campaign` knows, sorted."""
    return sorted(path.stem for path in campaigns().glob("*.yaml"))


def campaign(name: str) -> Path:
    """The file of a shipped campaign, such as `quickstart`. Raises InputError with the nearest name for an unknown one."""
    known = campaign_names()
    if name not in known:
        raise InputError(
            f"there is no shipped campaign {name!r}{did_you_mean(name, known)} (or give the path of a YAML file)"
        )
    return campaigns() / f"{name}.yaml"


def _carried(name: str) -> Path:
    installed = _package() / "data" / name
    return installed if installed.is_dir() else _package().parent / name


def _package() -> Path:
    return Path(str(files("fatigue_runner")))
