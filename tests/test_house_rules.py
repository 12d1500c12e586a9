"""Rules of the house that a reader of one file cannot see: whose words and numbers may stand where."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import fatigue_runner

PACKAGE = Path(fatigue_runner.__file__).parent
MODULES = {path.relative_to(PACKAGE).as_posix(): path for path in sorted(PACKAGE.rglob("*.py"))}
TREES = {
    name: ast.parse(path.read_text(encoding="utf-8"))
    for name, path in MODULES.items()
    if "generated" not in path.parts
}

# --- fatigue, logs, reports and pictures are made from plain data

PLAIN = ("fatigue", "logbook", "report", "results", "viewer")
SIMULATION = {"integrators", "wind", "control", "corrector", "campaign", "benchmark"}
ITS_OBJECTS = {
    "turbine",
    "wind",
    "winds",
    "corrector",
    "integrator",
    "ensemble",
    "campaign",
    "plan",
    "case",
    "cases",
    "job",
    "block",
}


def names_of(room: str) -> list[str]:
    return [name for name in TREES if name.startswith(f"{room}/")]


def imported(tree: ast.AST) -> Iterator[str]:
    """Modules that a file imports, for type checking too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def of_any_type(tree: ast.AST) -> Iterator[str]:
    """`function(parameter)` of parameters that could be anything, named as an object of the simulation."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            for given in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs):
                hint = "Any" if given.annotation is None else ast.unparse(given.annotation)
                if given.arg in ITS_OBJECTS and hint.removesuffix(" | None") in (
                    "Any",
                    "object",
                    "list[Any]",
                    "Sequence[Any]",
                ):
                    yield f"{node.name}({given.arg})"


@pytest.mark.parametrize("room", PLAIN)
def test_what_looks_at_results_takes_no_object_of_the_simulation(room):
    for name in names_of(room):
        rooms = {
            module.split(".")[1] for module in imported(TREES[name]) if module.startswith("fatigue_runner.")
        }
        assert not rooms & SIMULATION, f"{name} names a type of {sorted(rooms & SIMULATION)}"
        assert list(of_any_type(TREES[name])) == [], (
            f"{name}: say what is taken, by a type of this room or a plain one"
        )


def test_a_parameter_of_any_type_is_seen():
    tree = ast.parse("def draw(turbine: Any, wind, n: Any, case: str, *, plan: Any | None = None): ...")
    assert list(of_any_type(tree)) == ["draw(turbine)", "draw(wind)", "draw(plan)"]
