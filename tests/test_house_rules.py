"""Rules of the house that a reader of one file cannot see: whose words and numbers may stand where."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import fatigue_runner
from fatigue_runner.integrators import METHODS, method

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


# --- a state's row is known to layout.py alone

# 16 states, 8 positions; the rows of the azimuths (6, 7) and of the speeds (14, 15) of rotor and generator.
ROWS = {6, 7, 14, 15, 16}
WIDTHS = {14, 15, 16}
SIZED = {"arange", "empty", "eye", "full", "ones", "range", "reshape", "repeat", "tile", "zeros"}

# Such numbers that are no state's: {file: (what they are, expressions)}. One that is gone must be taken off.
NO_STATES = {
    "benchmark/speed/kernel.py": (
        "so many points and groups are evaluated in turns",
        {
            *(
                "arguments[group % 16]",
                "np.repeat(turbine.operating_point(8.0)[None], 16, axis=0)",
                "pitch[:16]",
            ),
            *("points[i % 16]", "range(16)", "wind[:16]", "x[:16]"),
        },
    ),
    "corrector/train_command.py": ("lines of a card", {"validation_rows(made.corrector)[:7]"}),
    "integrators/output.py": ("numbers of the interpolant", {"first[i, 6 - len(x):]"}),
    "integrators/stepping.py": (
        "numbers of the interpolant",
        {"rows[0, 6]", "rows[0, 7]", "w[line, 6]", "w[line, 7]", "weights[0, 6]", "weights[0, 7]"},
    ),
    "wind/fields/uniform.py": ("columns of the file", {"self.values[:, 6]", "values[:, [1, 7]]"}),
}


def row_like(tree: ast.AST) -> Iterator[str]:
    """Expressions that index an array with a number of ROWS, or size, compare or stride one with a number of WIDTHS."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript):
            if (
                not re.search("digest|hash|fingerprint", ast.unparse(node.value))
                and numbers(node.slice) & ROWS
            ):
                yield ast.unparse(node)
        elif isinstance(node, ast.Call):
            name = ast.unparse(node.func).rpartition(".")[2]
            if name in SIZED and any(numbers(given) & WIDTHS for given in node.args):
                yield ast.unparse(node)
        elif isinstance(node, ast.Compare):
            sides = (node.left, *node.comparators)
            if any("shape" in ast.unparse(side) for side in sides) and any(
                numbers(side) & WIDTHS for side in sides
            ):
                yield ast.unparse(node)
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            sides = (node.left, node.right)
            if any(ast.unparse(side) == "LANES" for side in sides) and any(
                numbers(side) & WIDTHS for side in sides
            ):
                yield ast.unparse(node)


def numbers(node: ast.AST) -> set[int]:
    """Whole numbers in an expression, but not those inside of another subscript or call."""
    if isinstance(node, ast.Constant):
        return {node.value} if type(node.value) is int else set()
    if isinstance(node, ast.Subscript | ast.Call):
        return set()
    return set().union(*(numbers(child) for child in ast.iter_child_nodes(node)))


def test_no_state_has_a_number_outside_of_the_layout():
    found = {(name, text) for name, tree in TREES.items() if name != "layout.py" for text in row_like(tree)}
    listed = {(name, text) for name, (_, texts) in NO_STATES.items() for text in texts}
    assert sorted(found - listed) == [], "ask the layout for the row or the width (layout.py)"
    assert sorted(listed - found) == [], "gone: take it off the list"


def test_a_row_or_a_width_is_seen():
    code = "x[6]; x[:, 8:14]; np.zeros((16, n)); x.shape != (n, 16); m in range(8 * LANES, 16 * LANES); digest.hexdigest()[:16]; f(16)"
    seen = list(row_like(ast.parse(code)))
    assert (
        "x[6]" in seen
        and "x[:, 8:14]" in seen
        and "np.zeros((16, n))" in seen
        and "x.shape != (n, 16)" in seen
    )
    assert "16 * LANES" in seen and not any("hexdigest" in text or text == "f(16)" for text in seen)


# --- a method is asked for what it does, not for what it is

# isinstance on types of methods outside of the file that makes them: (file, expression): why.
STILL_ASKED: dict[tuple[str, str], str] = {}


def methods_types() -> dict[str, str]:
    """{name of a method's type: the file that it stands in}."""
    types = {type(method(name)) for name in METHODS}
    return {one.__name__: Path(inspect.getfile(one)).relative_to(PACKAGE).as_posix() for one in types}


def types_asked_for(tree: ast.AST) -> Iterator[tuple[str, set[str]]]:
    """(expression, names of the types) of every isinstance, every class pattern of a match and every `type(x) is`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "isinstance":
            yield ast.unparse(node), words(node.args[1])
        elif isinstance(node, ast.MatchClass):
            yield ast.unparse(node), words(node.cls)
        elif isinstance(node, ast.Compare) and ast.unparse(node.left).startswith("type("):
            yield ast.unparse(node), set().union(*map(words, node.comparators))


def words(node: ast.AST) -> set[str]:
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)} | {
        part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute)
    }


def test_a_methods_type_is_asked_for_in_its_own_file_only():
    homes = methods_types()
    found = {
        (name, text)
        for name, tree in TREES.items()
        for text, asked in types_asked_for(tree)
        if any(homes[one] != name for one in asked & homes.keys())
    }
    assert sorted(found - STILL_ASKED.keys()) == [], (
        "give the method a property that says it (integrators/contract.py)"
    )
    assert sorted(STILL_ASKED.keys() - found) == [], "gone: take it off the list"
