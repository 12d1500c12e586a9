"""What comes with the program is found by name, in a checkout and from an installed wheel, in any folder."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
from pathlib import Path
from zipfile import ZipFile

import pytest
from places import CAMPAIGNS, CORRECTORS, ROOT, TURBINE_DATA

import fatigue_runner
from fatigue_runner import shipped
from fatigue_runner.campaign.spec import campaign_source
from fatigue_runner.errors import InputError


def test_a_checkout_ships_the_folders_at_its_top():
    assert (shipped.campaigns(), shipped.correctors()) == (CAMPAIGNS, CORRECTORS)
    assert shipped.turbines() == TURBINE_DATA


def test_a_bare_name_is_a_shipped_campaign_unless_a_file_is_called_so(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert campaign_source("quickstart").data["name"] == "quickstart"
    (tmp_path / "quickstart").write_text("name: mine\n")
    assert campaign_source("quickstart").data["name"] == "mine"


def test_an_unknown_name_is_told_the_nearest(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="no shipped campaign 'quikstart'; did you mean 'quickstart'"):
        campaign_source("quikstart")


def test_the_version_stands_in_one_place():
    assert fatigue_runner.__version__ == fatigue_runner._version.__version__
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["tool"]["hatch"]["version"]["path"] == "fatigue_runner/_version.py"
    said = [
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "fatigue_runner").rglob("*.py")
        if f'"{fatigue_runner.__version__}"' in path.read_text(encoding="utf-8")
    ]
    assert said == ["fatigue_runner/_version.py"]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation"]
    subprocess.run([*build, "-w", str(folder), str(ROOT)], check=True)
    (made,) = folder.glob("*.whl")
    return made


def test_a_source_distribution_carries_all_that_the_project_is_made_and_tested_of(tmp_path):
    pytest.importorskip("hatchling", reason="hatchling is not installed")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(tmp_path)], cwd=ROOT, check=True
    )
    (made,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(made) as archive:
        carried = {name.partition("/")[2] for name in archive.getnames()}
    kept = {
        path.relative_to(ROOT).as_posix()
        for folder in ("fatigue_runner", "campaigns", "correctors", "tests", "tools", "docs", ".ci")
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    top = {
        "pyproject.toml",
        "README.md",
        "LICENSE",
        "CHANGELOG.md",
        "CITATION.cff",
        "constraints.txt",
        "PKG-INFO",
    }
    assert kept | top <= carried
    assert not {name for name in carried if name.startswith(("runs/", "site/", ".git/", "dist/"))}


@pytest.mark.slow(reason="builds a wheel")
def test_a_wheel_carries_every_file_of_the_package_and_no_test(wheel):
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "fatigue_runner", "campaigns", "correctors"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout.split()  # fmt: skip
    outside = ("campaigns/", "correctors/")
    expected = {f"fatigue_runner/data/{name}" if name.startswith(outside) else name for name in listed}
    carried = {name for name in ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert carried == expected


@pytest.mark.slow(reason="builds a wheel, makes an environment and runs the quickstart in it")
def test_an_installed_wheel_runs_the_quickstart_by_name_from_an_empty_folder(wheel, tmp_path):
    home = tmp_path / "venv"
    venv.create(home, with_pip=True)
    python = home / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "-q", "--no-deps", wheel], check=True)
    # the libraries are those of this environment: a path file of another environment does not make its own path files count,
    # so that the checkout stays out of reach
    purelib = subprocess.run(
        [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
        capture_output=True, text=True, check=True,
    ).stdout.strip()  # fmt: skip
    (Path(purelib) / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n")
    empty = tmp_path / "empty"
    empty.mkdir()
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}

    def call(*arguments: str) -> str:
        done = subprocess.run(
            [home / "bin" / arguments[0], *arguments[1:]],
            cwd=empty, env=environment, capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    assert call("python", "-c", "import fatigue_runner as f; print(f.__file__)").startswith(purelib)
    assert "etdabm3-100ms" in call("fatigue-runner", "correctors", "list")
    call("fatigue-runner", "run", "quickstart")
    assert (empty / "runs" / "quickstart" / "report.html").is_file()
