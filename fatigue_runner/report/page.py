"""The page: all sections through one template, self-contained (figures and style inside, nothing fetched)."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from fatigue_runner.errors import InputError
from fatigue_runner.inputs.files import write_atomically
from fatigue_runner.report.blocks import Column, Section
from fatigue_runner.report.rundata import Run, load_run


def write_report(run_dir: Path) -> Path:
    """Write `report.html` into `run_dir` and return its path; only a whole new one replaces an older."""
    html = render(load_run(run_dir))
    target = run_dir / "report.html"
    try:
        write_atomically(target, html.encode())
    except OSError as error:
        raise InputError(
            f"{target} cannot be written: {error.strerror}; make room there, or make the folder writable"
        ) from None
    return target


def render(run: Run) -> str:
    """The report of a run as one HTML document."""
    from fatigue_runner.report.sections import builders

    return render_sections(run, [section for build in builders() if (section := build(run)) is not None])


class Headed(Protocol):
    """What a page's head says."""

    @property
    def name(self) -> str: ...

    @property
    def facts(self) -> list[tuple[str, str]]: ...


def render_sections(run: Headed, sections: Sequence[Section]) -> str:
    """Sections under a head as one HTML document."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("fatigue_runner.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"data_uri": _data_uri, "slug": _slug, "classes": _classes}
    script = (Path(__file__).parent / "page.js").read_text(encoding="utf-8")
    return environment.get_template("page.html").render(run=run, sections=sections, script=script)


def _slug(title: str) -> str:
    """A title as part of a file's name."""
    return "-".join(re.findall(r"[a-z0-9]+", title.lower()))


def _classes(column: Column) -> str:
    return " ".join(name for name in ("number", "wide") if getattr(column, name))


def _data_uri(svg: str) -> str:
    """An SVG document as an image address: its identifiers cannot meet those of another figure."""
    return "data:image/svg+xml;base64," + base64.b64encode(svg.encode()).decode()
