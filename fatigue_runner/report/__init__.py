"""What is told: the ranking of the integrators, the figures, and the HTML page of a run folder.

`ranking` answers "which integrator is good enough and what does it cost" from the rows of `results.csv`;
`write_report` puts that answer, its figures and its definitions on one page. Nothing here runs a simulation.
"""

from __future__ import annotations

from pathlib import Path


def write_report(run_dir: str | Path) -> Path:
    """Write `report.html` into a run folder and return its path.

    run_dir: folder with `results.csv`, `campaign.yaml` and `logs/*.mcap`; logs may be missing, then so
    are the time histories. Raises InputError where the folder holds no results.
    """
    from fatigue_runner.report import page  # matplotlib and jinja2 are loaded only when a report is made

    return page.write_report(Path(run_dir))


__all__ = ["write_report"]
