"""The page of licences says what the packages say that are installed here."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tools"))

import licences  # noqa: E402


def test_the_page_of_licences_is_current():
    pytest.importorskip("packaging")
    assert licences.differences() == [], "run `python tools/licences.py`"


def test_every_dependency_of_the_project_is_on_the_page():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"].values()
    named = {
        licences.canonical(licences.Requirement(text).name)
        for texts in (project["dependencies"], *extras)
        for text in texts
    }
    assert named - {project["name"]} <= licences.listed().keys()
    assert not {
        name for name, (licence, _) in licences.listed().items() if licence.startswith(("GPL", "AGPL", "see"))
    }


def test_what_a_licence_is_called():
    assert licences.licence("numpy").startswith("BSD-3-Clause")
    assert licences.licence("pydantic") == "MIT"
