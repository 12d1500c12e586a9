"""The house stays as it was drawn: imports point one way, and heavy libraries stay where they are needed."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import fatigue_runner

PACKAGE = Path(fatigue_runner.__file__).parent

# Plain results, names, errors: everyone may use them, and they use nothing but each other.
FLOOR = {
    "errors",
    "channels",
    "layout",
    "naming",
    "trajectory",
    "compiled",
    "caches",
    "terminal",
    "values",
    "encoded",
    "shipped",
    "rotor",
    "_version",
    "interruption",
    "stopwatch",
    "on_demand",
}

# Which rooms a room may import. A new room is one line here.
MAY_IMPORT = {
    "inputs": set(),
    "control": {"inputs"},
    "turbine": {"inputs", "control"},
    "wind": {"inputs"},
    "fatigue": set(),
    "logbook": set(),
    "results": {"inputs", "fatigue"},
    "integrators": {"turbine", "wind"},
    "corrector": {"inputs", "turbine", "wind", "integrators"},
    "report": {"inputs", "fatigue", "logbook", "results"},
    "calibration": {"inputs", "fatigue", "logbook", "results"},
    "viewer": {"inputs", "logbook", "turbine", "results"},
    "campaign": {
        "inputs",
        "turbine",
        "wind",
        "integrators",
        "corrector",
        "fatigue",
        "logbook",
        "results",
        "report",
    },
    "benchmark": {
        "inputs",
        "turbine",
        "wind",
        "integrators",
        "corrector",
        "fatigue",
        "logbook",
        "results",
        "campaign",
        "report",
        "viewer",
    },
    "api": {"turbine", "wind", "integrators", "corrector", "fatigue", "logbook", "results", "campaign"},
    "cli": None,  # anything: it is the roof
    "__init__": {"api"},
    "__main__": {"cli"},
    "version_command": {"campaign"},
    "logs_command": {"campaign", "logbook"},
}

# A library that only some rooms may load.
ONLY_IN = {
    "ruamel": {"inputs"},  # one reader of YAML
    "torch": {"corrector"},
    "rerun": {"viewer"},
    "sympy": {"turbine"},
    "matplotlib": {"report", "benchmark", "integrators"},
    "mcap": {"logbook", "benchmark"},
    "mcap_protobuf": {"logbook", "benchmark"},
    "joblib": {"campaign", "corrector", "benchmark"},
    "typer": {
        "version_command",
        "logs_command",
        "cli",
        "terminal",
        "logbook",
        "viewer",
        "report",
        "integrators",
        "corrector",
        "calibration",
        "benchmark",
    },
}

MODULES = sorted(PACKAGE.rglob("*.py"))


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports_of(path: Path, for_types: bool = False) -> set[str]:
    """Dotted names of all modules that a file imports, also inside functions; for type checking only where asked."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if not for_types and isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = []
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports hide where they point"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def rooms_imported(path: Path) -> set[str]:
    dotted = [name.split(".") for name in imports_of(path) if name.split(".")[0] == "fatigue_runner"]
    return {parts[1] for parts in dotted if len(parts) > 1 and is_room(parts[1])}


def is_room(name: str) -> bool:
    return (PACKAGE / name).is_dir() or (PACKAGE / f"{name}.py").is_file()


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_room_imports_only_the_rooms_below_it(path):
    room = room_of(path)
    imported = rooms_imported(path) - {room}
    if room in FLOOR:
        assert imported <= FLOOR
        return
    assert room in MAY_IMPORT, f"say in this test what the new room {room!r} may import"
    allowed = MAY_IMPORT[room]
    assert allowed is None or imported <= allowed | FLOOR


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_heavy_libraries_are_imported_in_their_rooms_only(path):
    for name in imports_of(path):
        rooms = ONLY_IN.get(name.split(".")[0])
        assert rooms is None or room_of(path) in rooms, f"{name} belongs into {sorted(rooms or ())}"


def test_what_pydantic_refuses_is_put_into_words_in_one_place():
    assert [p.name for p in MODULES if "pydantic.ValidationError" in imports_of(p)] == ["section.py"]


def test_the_directions_have_no_circle():
    order: list[str] = []
    left = {room: set(below or ()) for room, below in MAY_IMPORT.items() if below is not None}
    left["cli"] = set()
    while left:
        free = [room for room, below in left.items() if below <= set(order)]
        assert free, f"a circle among {sorted(left)}"
        order += free
        left = {room: below for room, below in left.items() if room not in free}


def modules_imported(path: Path) -> set[str]:
    """Modules of the package that a file imports, by their dotted names, those for type checking too."""
    found = set()
    for name in imports_of(path, for_types=True):
        found |= {name, name.rpartition(".")[0]} & NAMES.keys()
    # `from package import module` needs the module, not what else the package offers
    return {name for name in found if not any(other.startswith(f"{name}.") for other in found)}


def dotted(path: Path) -> str:
    return ".".join(("fatigue_runner", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(
        ".__init__"
    )


NAMES = {dotted(path): path for path in MODULES}


@pytest.mark.parametrize("room", sorted({room_of(path) for path in MODULES}))
def test_no_two_modules_import_each_other_directly_or_round_about(room):
    graph = {name: modules_imported(path) - {name} for name, path in NAMES.items() if room_of(path) == room}
    try:
        list(TopologicalSorter({name: below & graph.keys() for name, below in graph.items()}).static_order())
    except CycleError as error:
        pytest.fail(f"{' <- '.join(error.args[1])}: move what both need into a module below")


def test_the_benchmark_tells_what_it_measured_and_measures_on_what_it_timed():
    rooms = ("speed", "study", "pages")
    for path in MODULES:
        part = path.relative_to(PACKAGE).parts
        if part[0] != "benchmark" or part[1] not in rooms:
            continue
        above = rooms[rooms.index(part[1]) + 1 :]
        for name in modules_imported(path):
            parts = name.split(".")
            assert parts[1] != "benchmark" or parts[2] not in (*above, "run", "commands"), f"{path}: {name}"


def loaded_by(statement: str) -> set[str]:
    """Top-level modules that a new interpreter holds after the statement."""
    code = (
        f"{statement}\nimport json, sys\nprint(json.dumps(sorted({{m.split('.')[0] for m in sys.modules}})))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(json.loads(result.stdout.splitlines()[-1]))


HEAVY = {"torch", "rerun", "matplotlib", "numba", "scipy", "sympy", "pyarrow", "jinja2", "optuna"}


def test_importing_the_package_loads_no_library_at_all():
    loaded = loaded_by("import fatigue_runner")
    assert not loaded & (HEAVY | {"numpy", "pydantic", "ruamel", "mcap", "joblib", "typer", "rich"})


def test_the_command_line_starts_without_heavy_libraries():
    assert not loaded_by("import fatigue_runner.cli") & (HEAVY | {"numpy", "pydantic", "mcap", "joblib"})


def test_reading_a_campaign_file_needs_no_compiler_and_no_plots():
    assert not loaded_by("import fatigue_runner.campaign.spec") & (HEAVY - {"scipy"})


def test_the_api_loads_no_training_viewer_or_plots():
    loaded = loaded_by(
        "import fatigue_runner as fr\nfr.run_campaign, fr.simulate, fr.ConstantWind, fr.rainflow"
    )
    assert not loaded & {"torch", "rerun", "matplotlib", "sympy", "optuna"}


def test_every_name_of_the_api_is_there_and_listed():
    for name in fatigue_runner.__all__:
        assert getattr(fatigue_runner, name) is not None
        assert name in dir(fatigue_runner)
    with pytest.raises(AttributeError, match="has no attribute 'simulat'"):
        fatigue_runner.simulat  # noqa: B018
