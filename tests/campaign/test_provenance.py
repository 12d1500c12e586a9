"""What decides a case's figures is found: a line changed there changes its hash, a line changed elsewhere does not."""

from __future__ import annotations

import inspect
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from campaign_world import build_world, write_campaign

import fatigue_runner
from fatigue_runner import channels, compiled
from fatigue_runner.campaign import cases, provenance
from fatigue_runner.campaign.block import run_block
from fatigue_runner.campaign.evaluate import make_row
from fatigue_runner.campaign.plan import make_plan
from fatigue_runner.campaign.provenance import code_hash, deciding_files, source_hash
from fatigue_runner.corrector import Corrector, features
from fatigue_runner.fatigue import rainflow
from fatigue_runner.inputs.sweep import expand
from fatigue_runner.integrators import Ensemble
from fatigue_runner.integrators.initial import initial_state
from fatigue_runner.logbook import read_log
from fatigue_runner.results.accuracy import compare
from fatigue_runner.trajectory import Trajectory
from fatigue_runner.turbine.generated import kernel, pitched
from fatigue_runner.turbine.tables import AeroTables
from fatigue_runner.wind import StepWind, TurbulentWind, read_wind_file, stack_cells

PACKAGE = Path(fatigue_runner.__file__).parent
DECIDING = [path.relative_to(PACKAGE).as_posix() for path in deciding_files(PACKAGE)]
ALL = sorted(path.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob("*.py"))
# they show, they write a run folder, they prepare training; no figure of a case comes from them
SHOWING = ("report/", "viewer/", "benchmark/", "cli", "campaign/progress.py", "campaign/store.py")


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """The package's sources, to be changed."""
    folder = tmp_path_factory.mktemp("copied") / "fatigue_runner"
    shutil.copytree(
        PACKAGE, folder, ignore=lambda where, names: [n for n in names if Path(n).suffix not in ("", ".py")]
    )
    return folder


class changed:
    """A file with another text, for a while."""

    def __init__(self, path: Path, more: str) -> None:
        self.path, self.more = path, more

    def __enter__(self) -> None:
        self.before = self.path.read_text() if self.path.exists() else None
        self.path.write_text((self.before or "") + self.more)

    def __exit__(self, *error: object) -> None:
        if self.before is None:
            self.path.unlink()
        else:
            self.path.write_text(self.before)


@pytest.mark.parametrize(
    "decides",
    [
        *(compiled.njit, channels.Channel, Trajectory, initial_state, Ensemble, compare, make_row, run_block),
        *(
            kernel.rhs.py_func,
            pitched.rhs.py_func,
            AeroTables,
            TurbulentWind,
            StepWind,
            read_wind_file,
            stack_cells,
        ),
        *(rainflow, features, Corrector, read_log, expand),
    ],
)
def test_where_these_stand_decides(decides):
    file = Path(decides.__file__ if inspect.ismodule(decides) else inspect.getfile(decides))
    assert file.relative_to(PACKAGE).as_posix() in DECIDING


@pytest.mark.parametrize("room", ["wind", "fatigue"])
def test_rooms_that_compute_decide_wholly(room):
    assert {name for name in ALL if name.startswith(f"{room}/")} <= set(DECIDING)


def test_a_line_in_any_file_that_decides_changes_the_hash(copied):
    before = source_hash(copied)
    assert before == source_hash(PACKAGE)
    unseen = []
    for name in DECIDING:
        with changed(copied / name, "\n# another line\n"):
            if source_hash(copied) == before:
                unseen.append(name)
    assert unseen == []


@pytest.mark.parametrize("name", [name for name in ALL if name.startswith(SHOWING)])
def test_what_shows_does_not_decide(copied, name):
    before = source_hash(copied)
    with changed(copied / name, "\n# another line\n"):
        assert source_hash(copied) == before


def test_the_hash_of_a_case_follows_the_code(copied, tmp_path, monkeypatch):
    build_world(monkeypatch)
    monkeypatch.setattr(cases, "code_hash", lambda: source_hash(copied))

    def hashes():
        plan = make_plan(write_campaign(tmp_path))
        return [(case.simulation_hash, case.hash) for case in plan.cases]

    before = hashes()
    with changed(copied / "report" / "page.py", "\n# another line\n"):
        assert hashes() == before
    with changed(copied / "corrector" / "features.py", "\n# another line\n"):
        assert all(a != b and c != d for (a, c), (b, d) in zip(before, hashes(), strict=True))


def test_what_a_deciding_module_imports_anew_decides_too(copied):
    before = source_hash(copied)
    with changed(copied / "fatigue" / "new.py", "FACTOR = 2\n"):
        assert source_hash(copied) == before  # nobody asks for it yet
        call = "\ndef later():\n    from fatigue_runner.fatigue.new import FACTOR\n"
        with changed(copied / "fatigue" / "rainflow.py", call):
            asked = source_hash(copied)
            with changed(copied / "fatigue" / "new.py", "# another line\n"):
                assert source_hash(copied) != asked


def test_an_import_for_type_checking_decides_nothing(copied):
    more = "\nif TYPE_CHECKING:\n    from fatigue_runner.report.page import write_report\n"
    with changed(copied / "fatigue" / "rainflow.py", more):
        assert not [path for path in deciding_files(copied) if "report" in path.parts]


def test_a_new_wind_source_counts_although_nothing_names_it(copied):
    before = source_hash(copied)
    with changed(copied / "wind" / "squall.py", "KIND = 'squall'\n"):
        assert source_hash(copied) != before


@pytest.mark.parametrize("library", ["numpy", "scipy", "numba", "llvmlite"])
def test_another_version_of_what_computes_changes_the_hash(library, monkeypatch):
    before = code_hash.__wrapped__()
    version = provenance.metadata.version
    monkeypatch.setattr(
        provenance.metadata, "version", lambda name: "0.0" if name == library else version(name)
    )
    assert code_hash.__wrapped__() != before


CASE = """
import json, sys
from fatigue_runner.campaign import run_campaign
import fatigue_runner.report
fatigue_runner.report.write_report = lambda folder: None
run_campaign({"name": "a", "duration": 1, "wind": {"type": "turbulent", "speeds": 8, "intensity": 0.1},
    "integrators": [{"method": "rk4", "step": 0.1, "corrector": "rk4-100ms"}],
    "reference": {"method": "rk4", "step": 0.05}, "workers": 1}, sys.argv[1])
print(json.dumps({n: m.__file__ for n, m in sys.modules.items() if n.startswith("fatigue_runner.")}))
"""


def test_what_a_running_case_loads_is_known_to_decide_or_to_keep_the_run_folder(tmp_path):
    ran = subprocess.run(
        [sys.executable, "-c", CASE, str(tmp_path / "out")], capture_output=True, text=True, check=True
    )
    loaded = json.loads(ran.stdout.splitlines()[-1])
    beside = {
        Path(file).relative_to(PACKAGE).as_posix()
        for file in loaded.values()
        if not file.endswith("__init__.py")
    } - set(DECIDING)
    telling = (
        "results/beyond.py",
        "results/relevance.py",
        "results/cells.py",
        "interruption.py",
    )  # sentences about figures, a bound of the reference's error, and what ends a run
    assert {name for name in beside if not name.startswith(("campaign/", "report/", *telling))} == set()
