"""`fatigue-runner version`: what a report of a bug needs to say."""

from __future__ import annotations

import os
import platform
import sys
from importlib import metadata
from pathlib import Path

import typer

from fatigue_runner._version import __version__
from fatigue_runner.terminal import command_group

app = command_group()

COMPUTING = ("numpy", "scipy", "numba", "llvmlite", "joblib")
OTHERS = ("mcap", "matplotlib", "pydantic", "safetensors", "torch", "rerun-sdk", "pyarrow", "distributed")


@app.command()
def version() -> None:
    """Print the version, the code's hash and everything that a report of a bug needs.

    Example:

        fatigue-runner version > about.txt
    """
    for name, value in facts().items():
        typer.echo(f"{name:16}{value}")


def facts() -> dict[str, str]:
    """By name, in the order in which they are printed."""
    from fatigue_runner.campaign.provenance import code_hash
    from fatigue_runner.compiled import cache_folder

    return {
        "fatigue-runner": __version__,
        "code": code_hash(),
        "installed in": str(Path(__file__).parent),
        "python": f"{platform.python_version()} ({sys.executable})",
        "system": platform.platform(),
        "processor": f"{platform.machine()}, {os.cpu_count()} cores",
        **{name: _version_of(name) for name in (*COMPUTING, *OTHERS)},
        "kernel cache": str(cache_folder()),
    }


def _version_of(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return "not installed"
