"""Families and maps are found by themselves: one file adds one. And the shipped recipes give the shipped correctors."""

from __future__ import annotations

import sys
from importlib import import_module

import numpy as np
import pytest
from corrector_example import operating_points, turbine
from places import CORRECTORS
from simulating import simulate_block
from typer.testing import CliRunner

from fatigue_runner.cli import app
from fatigue_runner.corrector import CorrectorError, families, library, load, samples
from fatigue_runner.corrector.maps import MAPS, map_class
from fatigue_runner.corrector.recipe import FAMILIES
from fatigue_runner.corrector.train import read_recipe, train
from fatigue_runner.wind import ConstantWind

# A family in one file: the defect is taken to be the mean of the training set's, with a map and compiled code of its own.
TOY = """
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from pydantic import Field

from fatigue_runner.compiled import INLINE, njit
from fatigue_runner.corrector import samples
from fatigue_runner.corrector.maps import Map
from fatigue_runner.corrector.recipe import GuardRecipe, Learned, Recipe
from fatigue_runner.corrector.threshold import from_training_set
from fatigue_runner.integrators.choice import compiled_for
from fatigue_runner.integrators.correction import correction
from fatigue_runner.layout import T2B1I1CG, Layout
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.model import width
from fatigue_runner.wind import ConstantWind


class MeanDefectData(NamedTuple):
    defect: np.ndarray


@compiled_for(correction, MeanDefectData)
@njit(**INLINE)
def _add_mean(learned, model, x, k, stage_rows, h, start, middle, end, seen, hidden, out):
    for m in range(width(model)):
        out[m] = learned.defect[m]


@dataclass(frozen=True, eq=False)
class MeanDefect(Map):
    kind = "mean-defect"
    methods = "runge-kutta"
    mean: np.ndarray
    layout: Layout = T2B1I1CG

    def data(self, binding, turbine, run):
        return MeanDefectData(np.repeat(self.mean * binding.size, LANES))

    def check(self, method, guard):
        pass

    def sample(self, binding, turbine, winds, runs, per_wind, seed):
        return samples.along(turbine, binding.method, binding.step, winds, runs, per_wind, 0.0, seed)

    def predict(self, sampled, size):
        return np.tile(self.mean * size, (len(sampled.plain), 1))

    def tensors(self):
        return {"mean": self.mean}

    def header(self):
        return {}

    @classmethod
    def read(cls, header, tensors, layout):
        return cls(tensors["mean"], layout)


class MeanRecipe(Recipe):
    methods = MeanDefect.methods
    family: Literal["mean"]
    speeds: list[float] = Field(min_length=1)
    guard: GuardRecipe = GuardRecipe()

    def train(self, turbine, progress):
        winds = [ConstantWind(v) for v in self.speeds]
        runs = samples.references(turbine, winds, self.starts(turbine, winds), 10.0, samples.GRID)
        found = samples.along(turbine, self.method, self.step, winds, runs, 50, 0.0, 0)
        learned = MeanDefect(found.defect.mean(axis=0) / self.bound_to(turbine).size)
        guard = from_training_set(learned, self.bound_to(turbine), turbine, found, **self.guard.threshold)
        return Learned(learned, guard, (min(self.speeds), max(self.speeds)), {"samples": len(found.plain)})

    def judged_under(self):
        return [ConstantWind(7.4)], 5.0
"""
RECIPE = "name: flat\nfamily: mean\nmethod: heun\nstep: 0.02\nspeeds: [7, 8]\n"


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """The toy family's file in a folder that the package looks into.

    What is compiled for it must not stay in the cache: its index would name a module that no other process has.
    """
    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile.save", lambda *_: None)
    (tmp_path / "toy.py").write_text(TOY)
    monkeypatch.setattr(families, "__path__", [*families.__path__, str(tmp_path)])
    families.find_all()
    yield
    del sys.modules[f"{families.__name__}.toy"]
    del FAMILIES["mean", "runge-kutta"], MAPS["mean-defect"]


def test_a_family_in_one_file_is_trained_shown_and_run(toy, tmp_path):
    (tmp_path / "flat.yaml").write_text(RECIPE)
    run = CliRunner().invoke
    ran = run(app, ["train", str(tmp_path / "flat.yaml")])
    assert ran.exit_code == 0, ran.output
    assert "mean-defect" in run(app, ["correctors", "show", "flat", "--folder", str(tmp_path)]).output
    corrector = load(tmp_path / "flat.safetensors")
    assert (corrector.family, corrector.map.kind, corrector.training["samples"]) == (
        "mean",
        "mean-defect",
        100,
    )
    wind = ConstantWind(7.4)
    start = operating_points([wind])
    for mode in ("enhanced", "hybrid"):
        (case,) = simulate_block(turbine(), "heun", 0.02, [wind], start, 0.02, corrector=corrector, mode=mode)
        if mode == "enhanced" or case.accepted[0]:
            pieces = samples.wind_pieces(turbine(), wind, case.time[:1], 0.02)
            step = samples.single_steps(turbine(), "heun", 0.02, start, pieces)
            assert case.state[1] == pytest.approx((step.plain + corrector.predict(step))[0], rel=1e-12)
    assert np.abs(corrector.predict(step)).max() > 1e-9


def test_a_key_that_the_new_family_has_not_is_refused_as_everywhere(toy, tmp_path):
    (tmp_path / "flat.yaml").write_text(RECIPE + "sped: [8]\n")
    with pytest.raises(Exception, match=r"flat.yaml:6: unknown key 'sped'; did you mean 'speeds'"):
        read_recipe(tmp_path / "flat.yaml")


def test_an_artefact_of_a_family_that_is_not_there_says_so():
    with pytest.raises(CorrectorError, match="features 'mean-defect' do not exist"):
        map_class("mean-defect")


def test_every_family_and_kind_has_a_file_of_its_own():
    modules = {schema.__module__ for schema in FAMILIES.values()}
    assert len(modules) == len(FAMILIES) >= 4
    assert {m for m in modules if not m.startswith(families.__name__)} == set()
    assert len({kind.__module__ for kind in MAPS.values()}) == len(MAPS) >= 3
    for name in modules:
        assert import_module(name).__doc__


@pytest.mark.parametrize("path", sorted(CORRECTORS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_shipped_recipe_is_read_and_is_that_of_its_corrector(path):
    recipe, text = read_recipe(path)
    corrector = load(path.with_suffix(".safetensors"))
    assert (recipe.name, recipe.family, recipe.method, recipe.step) == (
        path.stem, corrector.family, corrector.method, corrector.step
    )  # fmt: skip
    assert (recipe.methods, text) == (corrector.map.methods, corrector.recipe)


def test_a_shipped_recipe_gives_the_shipped_corrector():
    """To what another BLAS leaves of nearly collinear features; on one machine to the bit."""
    recipe, text = read_recipe(CORRECTORS / "heun-10ms-t2b1i1cg.yaml")
    shipped, made = library.find(recipe.name), train(recipe, text=text)
    weights = shipped.map.linear
    assert np.abs(made.map.linear - weights).max() < 1e-7 * np.abs(weights).max()
    assert made.guard.limit == pytest.approx(shipped.guard.limit, rel=1e-6)
    assert made.wind_range == shipped.wind_range
    assert made.validation == pytest.approx(shipped.validation, rel=1e-6)
    facts = {key: value for key, value in shipped.training.items() if key != "seconds"}
    assert facts.items() <= made.training.items()


def test_correctors_print_as_a_table_and_each_in_a_line():
    found = library.correctors()
    text = repr(found).splitlines()
    assert text[0].split()[:5] == ["name", "family", "turbine", "operation", "method"]
    (row,) = (line for line in text if line.startswith("rk4-100ms "))
    assert row.split()[:6] == ["rk4-100ms", "affine", "nrel5mw", "fixed", "rk4", "100"]
    assert len(text) == len(found) + 2 and max(map(len, text)) < 120
    assert repr(library.find("rk4-100ms")) == "Corrector('rk4-100ms', affine, nrel5mw, rk4 at 100 ms)"
