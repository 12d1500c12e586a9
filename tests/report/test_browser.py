"""The page in a browser: nothing fetched, nothing wider than the window, tables that can be sorted, filtered and printed."""

from __future__ import annotations

import html
import json
import os
import re
import subprocess

import pytest
from report_example import CAMPAIGN, example_rows, write_run

from fatigue_runner.errors import FatigueRunnerError, InputError
from fatigue_runner.report import pdf, rundata, write_report
from fatigue_runner.report.sections import load_table


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rundata, "_read_log", lambda path: None)
        return write_report(write_run(tmp_path_factory.mktemp("run"), example_rows(), CAMPAIGN))


@pytest.fixture(scope="module")
def chromium():
    try:
        program = pdf.find_chromium()
    except InputError as error:
        pytest.skip(str(error))
    return [program, "--headless", "--disable-gpu", *(["--no-sandbox"] if os.geteuid() == 0 else [])]


# in the page: what is found wrong, as JSON in the document
PROBE = """
const frame = document.querySelector("iframe");
frame.onload = () => {
  const page = frame.contentDocument, found = {};
  found.wider = page.documentElement.scrollWidth - page.documentElement.clientWidth;
  const table = [...page.querySelectorAll("table[data-name]")].find((t) => t.querySelector("th[data-pick]"));
  const column = [...table.tHead.rows[0].cells].findIndex((c) => c.textContent.includes("rk7"));
  const cells = () => [...table.tBodies[0].rows].map((r) => Number(r.cells[column].textContent.replace(/,/g, "")));
  const head = table.tHead.rows[0].cells[column];
  head.querySelector("button").click();
  found.up = cells();
  head.querySelector("button").click();
  found.down = cells();
  found.sorted = head.getAttribute("aria-sort");
  const pick = table.parentElement.previousElementSibling.querySelectorAll("select")[1];
  pick.value = "10";
  pick.dispatchEvent(new Event("change"));
  found.shown = [...table.tBodies[0].rows].filter((r) => r.offsetParent).map((r) => r.cells[1].textContent);
  found.buttons = [...page.querySelectorAll(".tools button")].length;
  found.broken = [...page.querySelectorAll('a[href^="#"]')].filter((a) => !page.getElementById(a.hash.slice(1))).length;
  document.querySelector("pre").textContent = JSON.stringify(found);
};
"""


@pytest.mark.parametrize("width", [1280, 390])
def test_the_page_fits_the_window_and_its_tables_sort_and_filter(page, chromium, tmp_path, width):
    framed = html.escape(page.read_text(encoding="utf-8"), quote=True)
    probe = tmp_path / "probe.html"
    probe.write_text(
        f'<!doctype html><meta charset="utf-8"><pre></pre><iframe style="width:{width}px;height:900px;border:0" srcdoc="{framed}"></iframe>'
        f"<script>{PROBE}</script>"
    )
    command = [
        *chromium,
        "--enable-logging=stderr",
        f"--user-data-dir={tmp_path}/profile",
        "--window-size=1400,1000",
    ]
    ran = subprocess.run(
        [*command, "--virtual-time-budget=4000", "--dump-dom", probe.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert "CONSOLE" not in ran.stderr, "\n".join(
        line for line in ran.stderr.splitlines() if "CONSOLE" in line
    )
    found = json.loads(html.unescape(re.search(r"<pre>(.*?)</pre>", ran.stdout, re.DOTALL)[1]))
    assert found["wider"] <= 0
    assert (
        found["up"] == sorted(found["up"]) and found["down"] == found["up"][::-1] and len(found["up"]) == 20
    )
    assert found["sorted"] == "descending" and set(found["shown"]) == {"10"} and len(found["shown"]) == 4
    assert found["buttons"] >= 4 and found["broken"] == 0


def test_the_page_prints_as_pdf_where_a_browser_is(page, chromium):
    made = pdf.write_pdf(page)
    assert (
        made.name == "report.pdf" and made.read_bytes().startswith(b"%PDF") and made.stat().st_size > 20_000
    )


def test_without_a_browser_a_pdf_is_refused_with_the_way_out(monkeypatch):
    monkeypatch.setattr(pdf.shutil, "which", lambda name: None)
    monkeypatch.delenv(pdf.VARIABLE, raising=False)
    with pytest.raises(
        InputError,
        match="no Chromium or Chrome is installed; install one, name it in FATIGUE_RUNNER_CHROMIUM",
    ):
        pdf.find_chromium()
    monkeypatch.setenv(pdf.VARIABLE, "/nowhere")
    with pytest.raises(InputError, match="FATIGUE_RUNNER_CHROMIUM is '/nowhere', which is no program"):
        pdf.find_chromium()


def test_a_browser_that_prints_nothing_keeps_the_older_pdf(page, monkeypatch, tmp_path):
    broken = tmp_path / "chromium"
    broken.write_text("#!/bin/sh\necho 'no display' >&2\nexit 3\n")
    broken.chmod(0o755)
    monkeypatch.setenv(pdf.VARIABLE, str(broken))
    older = page.with_suffix(".pdf")
    before = older.read_bytes() if older.exists() else None
    with pytest.raises(FatigueRunnerError, match=r"made no PDF of .*: no display"):
        pdf.write_pdf(page)
    assert (older.read_bytes() if older.exists() else None) == before


def test_nothing_is_fetched_and_nothing_is_wider_than_its_page_by_its_style(page):
    text = page.read_text(encoding="utf-8")
    assert not re.findall(r"""(?:src|href)=["'](?!data:)[^"'#]""", text) and "@import" not in text
    assert not re.search(
        r"\bfetch\(|XMLHttpRequest|https?://(?!www\.w3\.org)", re.sub(r"base64,[A-Za-z0-9+/=]+", "", text)
    )
    style = re.search(r"<style>(.*?)</style>", text, re.DOTALL)[1]
    for rule in (
        ".wide { overflow-x: auto",
        "figure img { display: block; width: 100%",
        "@page { size: A4",
        ".tools { display: none",
    ):
        assert rule in style, rule
    # every table lies in a box that scrolls
    assert text.count("<table") == text.count('<div class="wide"><table')
    assert not re.search(r"(?<!max-)(?<!min-)width: \d{3,}px", style)


def test_the_loads_stand_as_numbers_for_every_channel_exponent_and_integrator(page):
    run = rundata.load_run(page.parent)
    (table,) = load_table.build(run).blocks
    assert [c.head for c in table.columns][:4] == ["Channel", "m", "Unit", "rk7 1 ms"] and len(
        table.rows
    ) == 4 * 5
    loads = [float(row["del_tower_base_fore_aft_moment_m4"]) for row in run.rows if row["method"] == "rk7"]
    mean = (sum(load**4 for load in loads) / len(loads)) ** 0.25 * 1e-3
    found = [row.cells for row in table.rows if row.cells[:2] == ["tower-base fore-aft moment", "4"]]
    assert found[0][2:4] == ["kN·m", f"{mean:,.1f}"]
