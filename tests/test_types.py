"""Type checking is strict, but for a list of older modules that may only shrink."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from fnmatch import fnmatchcase

import pytest
from places import ROOT

PROJECT = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
MARK = "# Not strict yet"
OVERRIDES = tomllib.loads(PROJECT[PROJECT.index(MARK) :])["tool"]["mypy"]["overrides"][0]
LISTED: list[str] = OVERRIDES["module"]


def module_of(path: str) -> str:
    return path.removeprefix("tools/").removesuffix(".py").removesuffix("/__init__").replace("/", ".")


MODULES = {
    module_of(path.relative_to(ROOT).as_posix())
    for folder in ("fatigue_runner", "tools")
    for path in (ROOT / folder).rglob("*.py")
}


def test_types_are_checked_strictly_and_the_public_api_is_not_on_the_list():
    assert tomllib.loads(PROJECT)["tool"]["mypy"]["strict"] is True
    for name in ("fatigue_runner", "fatigue_runner.api", "fatigue_runner.errors"):
        assert not [pattern for pattern in LISTED if fnmatchcase(name, pattern)]


@pytest.mark.parametrize("pattern", LISTED)
def test_a_listed_module_is_there(pattern):
    assert [name for name in MODULES if fnmatchcase(name, pattern)], (
        f"{pattern}: take it off the list in pyproject.toml"
    )


@pytest.mark.slow(reason="checks the types of the whole program anew")
def test_a_listed_module_is_not_strict_yet(tmp_path):
    strict = tmp_path / "pyproject.toml"
    strict.write_text(PROJECT[: PROJECT.index(MARK)])
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--config-file",
        str(strict),
        "--cache-dir",
        str(tmp_path / "cache"),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode in (0, 1), done.stderr
    wrong = {module_of(path) for path in re.findall(r"^(\S+\.py):\d+: error", done.stdout, re.MULTILINE)}
    for pattern in LISTED:
        assert [name for name in wrong if fnmatchcase(name, pattern)], (
            f"{pattern} is strict now: take it off the list"
        )
