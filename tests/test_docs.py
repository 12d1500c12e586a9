"""The documentation holds together: every link leads somewhere, every page is in the menu, every decision in the index."""

from __future__ import annotations

import re
import sys
import typing

import pytest
from places import ROOT

sys.path.insert(0, str(ROOT / "tools"))
docs_site = pytest.importorskip("docs_site", reason="the site needs the extra `docs`")

DOCS = ROOT / "docs"
PAGES = {place: ROOT / name for name, place in docs_site.PAGES.items()}
PAGES |= {path.relative_to(DOCS).as_posix(): path for path in sorted(DOCS.rglob("*.md"))}
DECISIONS = sorted((DOCS / "decisions").glob("[0-9]*.md"))


@pytest.mark.parametrize("page", PAGES)
def test_every_link_leads_to_a_file(page):
    linked = [link for _, link, _ in docs_site.links(PAGES[page].read_text(encoding="utf-8"))]
    assert [link for link in linked if not (ROOT / docs_site.resolved(page, link)).is_file()] == []


def test_every_page_is_in_the_menu():
    menu = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").split("\nnav:")[1].split("\nvalidation:")[0]
    assert sorted([*re.findall(r"[\w./-]+\.md", menu), *docs_site.decisions()]) == sorted(PAGES), (
        "list the page in mkdocs.yml"
    )


def test_decisions_are_numbered_without_gaps_and_all_in_the_index():
    assert [int(path.name[:4]) for path in DECISIONS] == list(range(1, len(DECISIONS) + 1))
    index = (DOCS / "decisions" / "index.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| \[(\d+)\]\((.+?)\) \| \S", index, re.MULTILINE) == [
        (str(number), path.name) for number, path in enumerate(DECISIONS, 1)
    ], "every record needs its line in docs/decisions/index.md"


def test_links_of_the_repository_become_links_of_the_site():
    text = "[a](../fatigue_runner/errors.py) [b](logs.md#speed) [c](../README.md) [d](https://x.org/a.md) [e](../gone.py)"
    assert docs_site.rewritten("correctors.md", text) == (
        "[a](repository/fatigue_runner/errors.py) [b](logs.md#speed) [c](index.md) [d](https://x.org/a.md) [e](../gone.py)"
    )
    assert (
        docs_site.rewritten("decisions/index.md", "[a](../../CONTRIBUTING.md)") == "[a](../CONTRIBUTING.md)"
    )
    assert docs_site.rewritten("CONTRIBUTING.md", "[a](docs/logs.md)\n```\n[b](docs/logs.md)\n```") == (
        "[a](logs.md)\n```\n[b](docs/logs.md)\n```"
    )


def test_every_key_of_every_type_of_wind_stands_on_its_page():
    from fatigue_runner.wind.section import SECTIONS, WindSection

    page = (DOCS / "wind.md").read_text(encoding="utf-8")
    common = set(WindSection.model_fields)
    assert common <= set(re.findall(r"`(\w+)`", page))
    for kind, section in SECTIONS.items():
        (table,) = re.findall(rf"^\| `{kind}` \|.*\n((?:\|.*\n)+)", page, re.MULTILINE)
        told = set(re.findall(r"`(\w+)`", table))
        missing = set(section.model_fields) - common - told
        assert not missing, f"docs/wind.md does not tell of {', '.join(sorted(missing))} of {kind} wind"


def test_every_key_of_a_campaign_and_every_column_of_the_table_stand_on_their_page():
    from fatigue_runner.campaign.loads_section import LoadsSection
    from fatigue_runner.campaign.spec import Campaign, Fatigue, IntegratorSection, Log
    from fatigue_runner.results.columns import CASE

    told = set(re.findall(r"`([\w.]+)`", (DOCS / "campaign.md").read_text(encoding="utf-8")))
    keys = {*Campaign.model_fields, *IntegratorSection.model_fields}
    keys |= {f"fatigue.{key}" for key in Fatigue.model_fields} | {f"log.{key}" for key in Log.model_fields}
    keys |= {column.name for column in CASE} | {f"loads.{key}" for key in LoadsSection.model_fields}
    assert not keys - told, f"docs/campaign.md does not tell of {', '.join(sorted(keys - told))}"


def test_the_page_of_channels_is_what_the_program_says():
    from fatigue_runner.channels import LOADS, OPENFAST, STATES, WIND_SIGNALS, channel_name

    page = (DOCS / "channels.md").read_text(encoding="utf-8")
    names = {
        c.name: [n for n, ours in OPENFAST.items() if ours == c.name]
        for c in (*LOADS, *STATES, *WIND_SIGNALS)
    }
    named = [c for c in (*STATES, *WIND_SIGNALS) if names[c.name]]
    rows = [
        f"| `{c.name}` | {c.unit} | {c.label} | {', '.join(f'`{n}`' for n in names[c.name]) or '-'} |"
        for c in (*LOADS, *named)
    ]
    assert re.findall(r"^\| `\w+` \| [^|]+ \| [^|]+ \| [^|]+ \|$", page, re.MULTILINE) == rows
    assert all(channel_name(n.upper()) == c for c, found in names.items() for n in found)


def test_every_key_of_a_recipe_stands_on_its_page():
    from pydantic import BaseModel

    from fatigue_runner.corrector import families  # noqa: F401  (fills the register)
    from fatigue_runner.corrector.recipe import FAMILIES, GuardRecipe, Spread, Winds

    def keys(section: type[BaseModel]) -> set[str]:
        nested = {
            part
            for field in section.model_fields.values()
            for part in (field.annotation, *typing.get_args(field.annotation))
            if isinstance(part, type) and issubclass(part, BaseModel)
        }
        return set(section.model_fields).union(*map(keys, nested))

    assert FAMILIES, "every family is found"
    every = set().union(*map(keys, (*FAMILIES.values(), Winds, Spread, GuardRecipe)))
    told = set(re.findall(r"`(\w+)`", (DOCS / "recipes.md").read_text(encoding="utf-8")))
    assert {"samples", "kappa", "hidden", "rounds", "margin"} <= every
    assert not every - told, f"docs/recipes.md does not tell of {', '.join(sorted(every - told))}"


def test_the_readme_s_answer_is_part_of_the_table_that_it_leads_to():
    readme = (ROOT / "README.md").read_text(encoding="utf-8").split("## Which integrator?")[1].split("## ")[0]
    answer = re.findall(r"^\| (`.+? ms) \| (\d+) \| ([^|]+?) \|$", readme, re.MULTILINE)
    page = (DOCS / "integrators.md").read_text(encoding="utf-8").replace("**", "")
    assert len(answer) == 6
    for row in answer:
        assert "| " + " | ".join(row) + " |" in page


def test_the_campaign_behind_the_answer_is_valid():
    from ruamel.yaml import YAML

    from fatigue_runner.campaign.spec import parse_campaign
    from fatigue_runner.inputs.source import Source

    page = (DOCS / "integrators.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    campaign = parse_campaign(Source("integrators.md", YAML(typ="safe").load(text)))
    found = {(i.method, i.corrector) for i in campaign.integrators}
    told = set(re.findall(r"^\| \**`(\w+)` [\d.]+ ms", page, re.MULTILINE))
    assert {method for method, _ in found} == told


@pytest.mark.parametrize("page", PAGES)
def test_files_that_a_page_cites_are_in_the_repository(page):
    """In backticks, with a folder of the repository before them."""
    text = re.sub(r"```.*?```", "", PAGES[page].read_text(encoding="utf-8"), flags=re.DOTALL)
    folders = "fatigue_runner|tests|tools|docs|campaigns|correctors|examples|benchmark|prototypes"
    cited = re.findall(rf"`(?:\.\./)*((?:{folders})/[\w./-]+\.\w+)`", text)
    assert [name for name in cited if not (ROOT / name).is_file()] == []


def test_the_logs_that_help_texts_name_are_those_of_the_quickstart():
    from fatigue_runner.campaign.spec import campaign_source, parse_campaign
    from fatigue_runner.inputs.source import Place
    from fatigue_runner.inputs.sweep import expand
    from fatigue_runner.naming import integrator_id, joined
    from fatigue_runner.rotor import Rotor
    from fatigue_runner.wind.section import Site

    source = campaign_source("quickstart")
    campaign = parse_campaign(source)
    winds = campaign.wind.realisations(Site(Rotor(63.0, 90.0), campaign.duration, Place(source, ("wind",))))
    steps = [(item.method, step) for item in campaign.integrators for step, _ in expand(item.step)]
    logs = {joined(wind.id, integrator_id(*step)) for wind in winds for step in steps}
    for room in ("viewer", "logbook"):
        text = (ROOT / "fatigue_runner" / room / "commands.py").read_text(encoding="utf-8")
        named = re.findall(r"runs/quickstart/logs/(\S+)\.mcap", text)
        assert named and set(named) <= logs


@pytest.mark.parametrize("page", PAGES)
def test_no_page_holds_two_versions_of_a_paragraph(page):
    assert not re.search(r"^(<{7} |>{7} )", PAGES[page].read_text(encoding="utf-8"), re.M)
