"""docs/wind.md does what it says: its Python runs, its keys are those of the sections, its signals those of the layout."""

from __future__ import annotations

import re

import numpy as np
import pytest
from field_files import some_field, write_bts
from places import ROOT

from fatigue_runner.layout import ACROSS, WIND
from fatigue_runner.wind.section import SECTIONS, WindSection

PAGE = (ROOT / "docs" / "wind.md").read_text(encoding="utf-8")


def test_the_python_of_the_page_runs_as_it_stands(tmp_path, monkeypatch, capsys):
    (code,) = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    monkeypatch.chdir(tmp_path)
    write_bts(tmp_path / "field.bts", some_field(200, 15, 15), spacing=(10.0, 10.0), mean=9.0, hub=90.0)
    names: dict = {}
    exec(compile(code, "docs/wind.md", "exec"), names)
    turbine, trajectory = names["turbine"], names["trajectory"]
    assert trajectory.wind.shape == (12001, 15) and np.isfinite(trajectory.state).all()
    assert names["field"].on(turbine.rotor).signals == 15
    assert names["aside"].on(turbine.rotor).signals == names["shear"].signals + len(ACROSS)
    assert "azimuthal harmonics above 6" in capsys.readouterr().out


@pytest.mark.parametrize("kind", ["constant", "turbulent", "gust", "full-field", "file"])
def test_every_key_of_a_section_has_its_row(kind):
    table = PAGE.split(f"| `{kind}` |")[1].split("\n\n")[0]
    told = set(re.findall(r"`(\w+)`", re.sub(r"^\|[^|]*\|$", "", table)))
    assert set(SECTIONS[kind].model_fields) - set(WindSection.model_fields) <= told


def test_the_keys_of_all_sections_and_the_signals_are_told():
    for key in {*WindSection.model_fields, *(c.name for c in (*WIND, *ACROSS))}:
        assert f"`{key}`" in PAGE
