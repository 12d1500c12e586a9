"""The README does what it says: its commands, its campaign, its Python."""

from __future__ import annotations

import re

import pytest
from places import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    """The fenced blocks of one language, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


def test_the_two_commands_stand_word_for_word_where_ci_reads_them():
    marked = dict(re.findall(r"^<!-- ci: (\w+) -->\n```sh\n(.*?)\n```", README, re.MULTILINE | re.DOTALL))
    assert marked == {
        "run": "pip install -e . && fatigue-runner run campaigns/quickstart.yaml",
        "test": "pip install -c constraints.txt -e '.[dev]' && pytest",
    }


def test_every_file_that_the_readme_links_to_exists():
    linked = [target for target in re.findall(r"\]\(([^)]+)\)", README) if "://" not in target]
    assert linked
    assert [target for target in linked if not (ROOT / target).exists()] == []


def test_the_architecture_table_names_every_package_and_none_that_is_not_there():
    told = set(re.findall(r"^\| `(\w+)/` \|", README, re.MULTILINE))
    packages = {path.parent.name for path in (ROOT / "fatigue_runner").glob("*/__init__.py")}
    folders = {path.name for path in (ROOT / "fatigue_runner").iterdir() if path.is_dir()}
    assert packages <= told <= folders


def test_the_campaign_of_the_readme_is_valid():
    from ruamel.yaml import YAML

    from fatigue_runner.campaign.spec import parse_campaign
    from fatigue_runner.inputs.source import Source

    (text,) = blocks("yaml")
    campaign = parse_campaign(Source("README.md", YAML(typ="safe").load(text)))
    assert campaign.name == "my-sweep" and len(campaign.integrators) == 2


@pytest.mark.slow(reason="runs the quickstart")
def test_the_python_of_the_readme_runs(monkeypatch, tmp_path):
    (code,) = blocks("python")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "campaigns").symlink_to(ROOT / "campaigns")
    names: dict = {}
    exec(compile(code, "README.md", "exec"), names)
    assert names["load"] > 0 and len(names["results"]) > 0


def test_constraints_pin_exact_versions_and_no_local_path():
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    assert "torch==2.13.0" in pins
    assert [pin for pin in pins if not re.fullmatch(r"[A-Za-z0-9_.-]+==[0-9][A-Za-z0-9.]*", pin)] == []
