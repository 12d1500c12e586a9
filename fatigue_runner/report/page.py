"""The report page (placeholder until the sections land)."""

from pathlib import Path


def write_report(run_dir: Path) -> Path:
    """Write `report.html` into `run_dir` and return its path."""
    raise NotImplementedError
