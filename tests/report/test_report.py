"""The report says what the results say, on one page that needs nothing from outside."""

from __future__ import annotations

import base64
import json
import re
from html.parser import HTMLParser

import pytest
from report_example import CAMPAIGN, case_row, example_log, example_rows, write_run

from fatigue_runner.errors import FatigueRunnerError, FatigueRunnerWarning, InputError
from fatigue_runner.report import rundata, sections, write_report
from fatigue_runner.report.blocks import Column, Figure, Paragraph, Table, TableRow
from fatigue_runner.report.rundata import load_run
from fatigue_runner.report.sections import del_over_wind, limits
from fatigue_runner.report.selection import left_out, shown_integrators, shown_winds
from fatigue_runner.report.style import COLOURS, looks
from fatigue_runner.results.life_words import customary_exponent


class Page(HTMLParser):
    """The text of a page, the addresses that it asks for, and whether its tags close."""

    VOID = frozenset({"meta", "img", "br", "link", "hr"})

    def __init__(self, html: str) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.tables: list[list[list[str]]] = []
        self.words: list[str] = []
        self._open: list[str] = []
        self.feed(html)
        assert self._open == []

    def handle_starttag(self, tag, attrs):
        self.addresses += [value for name, value in attrs if name in {"src", "href", "data", "action"}]
        if tag not in self.VOID:
            self._open.append(tag)
        if tag == "table":
            self.tables.append([])
        if tag == "tr":
            self.tables[-1].append([])
        if tag in {"td", "th"}:
            self.tables[-1][-1].append("")

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        if {"style", "script"} & set(self._open):
            return
        self.words.append(data.strip())
        if {"td", "th"} & set(self._open):
            self.tables[-1][-1][-1] += data.strip()

    @property
    def text(self) -> str:
        return " ".join(word for word in self.words if word)


@pytest.fixture
def logs(monkeypatch):
    """Logs for whatever run is read, without files."""

    def add(rows):
        known = {row["case_id"]: row for row in rows}
        monkeypatch.setattr(rundata, "_read_log", lambda path: example_log(known[path.stem]))

    return add


@pytest.fixture(scope="module")
def rows():
    return example_rows()


@pytest.fixture(scope="module")
def folder(rows, tmp_path_factory):
    """The example's run folder with its report; tests only read it."""
    folder = write_run(tmp_path_factory.mktemp("example") / "run", rows)
    known = {row["case_id"]: row for row in rows}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rundata, "_read_log", lambda path: example_log(known[path.stem]))
        write_report(folder)
    return folder


@pytest.fixture(scope="module")
def page(folder) -> Page:
    return Page((folder / "report.html").read_text(encoding="utf-8"))


def build(name, run):
    """One section of the report, by the name of its module."""
    return next(f(run) for f in sections.builders() if f.__module__.endswith(f".{name}"))


def told(*blocks) -> str:
    """The text of some blocks."""
    found = []
    for block in blocks:
        if isinstance(block, Paragraph):
            found.append(block.text)
        elif isinstance(block, Figure):
            found.append(block.caption)
        elif isinstance(block, Table):
            found += [block.caption, *(cell for row in block.rows for cell in row.cells)]
        else:
            found += [" ".join(item) if isinstance(item, tuple) else item for item in block.items]
    return " ".join(found)


def section_text(name, folder) -> str:
    """The text of one section of a run folder's report."""
    section = build(name, load_run(folder))
    return "" if section is None else told(*section.blocks)


def test_the_page_has_every_section_and_asks_the_network_for_nothing(page):
    assert len(page.addresses) == 3
    assert all(address.startswith("data:image/svg+xml;base64,") for address in page.addresses)
    svgs = [base64.b64decode(address.split(",")[1]).decode() for address in page.addresses]
    assert not any(re.search(r'(href|src)="(?!#)', svg) for svg in svgs)
    for heading in (
        "Which integrator",
        "Time histories",
        "over wind speed",
        "over cost",
        "Cases",
        "Definitions",
    ):
        assert heading in page.text


def test_the_answer_stands_before_everything_else(page):
    answer = page.text.index("Cheapest within 1 % DEL error: rk3 20 ms, 150 evaluations per simulated second")
    limits_at = page.text.index("What limits")
    assert answer < limits_at < page.text.index("Damage-equivalent loads over wind speed")


def test_the_first_table_has_one_row_per_integrator_with_cost_and_verdict(page):
    cells = {row[0]: row for row in page.tables[0][1:]}
    assert len(cells) == 10
    assert cells["rk3 20 ms ●"][1:3] == ["150", "2"] and cells["rk3 20 ms ●"][-1] == "within 1 %"
    assert cells["heun 40 ms"][-1] == "diverged in 1 of 6"
    assert cells["rk7 1 ms (reference)"][-1] == "reference"


def test_a_diverged_case_is_listed_with_its_time_and_counted_as_lost(page):
    assert "heun 40 ms: 1 of 6 cases did not finish (17 %); no damage is counted for them" in page.text
    listed = next(table for table in page.tables if "Reason" in table[0])
    assert listed[1:] == [
        ["10", "0.1 / 0", "–", "heun 40 ms", "diverged", "31.4", "rotor speed left ±10 rad/s"]
    ]


def test_lost_cases_are_told_as_their_share():
    assert limits.lost_share([{"status": "done"}, {"status": "diverged"}]) == 0.5
    assert limits.lost_share([]) == 0.0


def test_the_definitions_carry_the_settings_of_the_run(tmp_path, rows):
    campaign = {**CAMPAIGN, "discard": 10.0, "fatigue": {"residue": "full"}}
    text = section_text("definitions", write_run(tmp_path / "run", rows, campaign))
    assert "N_eq = 1 Hz × counted duration = 50 cycles" in text
    assert "counted as full cycles" in text and "the first 10 s are discarded" in text
    assert "m = 3, 4, 5, 10, 12" in text


def test_the_resolved_settings_of_the_run_are_preferred_to_the_campaign_as_given(tmp_path, rows):
    folder = write_run(tmp_path / "run", rows)
    facts = {
        "turbine": "t2b1i1cg",
        "turbine_hash": "f" * 64,
        "versions": "fatigue-runner 9.9",
        "machine": "abacus",
    }
    (folder / "run.json").write_text(
        json.dumps({"facts": facts, "campaign": {**CAMPAIGN, "name": "resolved"}})
    )
    found = dict(load_run(folder).facts)
    assert found["Campaign"] == "resolved" and found["Cases"] == "6 winds × 10 integrators = 60"
    assert found["Turbine"] == "t2b1i1cg" and found["Turbine hash"] == "f" * 16
    assert found["Versions"] == "fatigue-runner 9.9" and found["Machine"] == "abacus"


def test_clamped_look_ups_are_a_warning_with_their_winds(tmp_path, rows):
    changed = [{**row, "clamped_lookups": 7 if row["wind_speed"] > 8 else 0} for row in rows]
    text = section_text("limits", write_run(tmp_path / "run", changed))
    assert "20 of 60 cases left the range of the aerodynamic tables (140 look-ups in all" in text
    assert "at mean winds from 9 to 10 m/s" in text


def test_winds_outside_a_correctors_training_stand_in_the_verdict_and_before_the_figures(tmp_path, rows):
    known = {
        "corrector": "rk4-20ms",
        "mode": "hybrid",
        "acceptance_rate": 0.5,
        "trained_from": 4.2,
        "trained_to": 8.4,
    }
    changed = [
        {**row, **(known if row["method"] == "rk4" and row["step"] == 0.02 else dict.fromkeys(known, ""))}
        for row in rows
    ]
    folder = write_run(tmp_path / "run", changed)
    assert "rk4-20ms, hybrid: 2 of 6 winds lie outside the 4.2 to 8.4 m/s" in section_text("limits", folder)
    answer = section_text("answer", folder)
    assert answer.count("1 % *") == 1 and "* Some winds lie outside" in answer
    assert " *" not in section_text("answer", write_run(tmp_path / "plain", rows))


def test_text_of_the_user_cannot_become_markup(tmp_path):
    row = {**case_row(8, "rk4", 0.02), "status": "failed", "error_message": "<b>&"}
    folder = write_run(tmp_path / "run", [row], {**CAMPAIGN, "name": "<script>alert(1)</script>"})
    html = write_report(folder).read_text(encoding="utf-8")
    assert html.count("<script") == 1 and "<script>alert" not in html and "<b>" not in html
    assert "Fatigue report: <script>alert(1)</script>" in Page(html).text and "<b>&" in Page(html).text


def test_a_run_without_logs_says_why_it_has_no_time_histories(folder):
    assert (
        section_text("histories", folder)
        == "Not drawn: the run folder has no readable logs of the tower's motion."
    )


def test_an_unreadable_log_leaves_out_its_curve_and_nothing_else(tmp_path, rows, monkeypatch):
    from fatigue_runner import logbook

    folder = write_run(tmp_path / "run", rows)
    (folder / "logs").mkdir()
    (folder / "logs" / f"{rows[0]['case_id']}.mcap").write_bytes(b"\x89MCAP0\r\ncut")

    def refuse(path):
        raise FatigueRunnerError(f"{path} is cut off")

    monkeypatch.setattr(logbook, "read_log", refuse, raising=False)
    with pytest.warns(FatigueRunnerWarning, match="the page goes without a log: .* is cut off"):
        assert "no readable logs" in section_text("histories", folder)


def test_without_a_reference_the_report_says_so_and_draws_no_error(tmp_path):
    rows = [
        {**r, **{key: "" for key in r if key.startswith(("del_error", "nrmse"))}}
        for r in example_rows(diverging=False)
        if not r["is_reference"]
    ]
    folder = write_run(tmp_path / "run", rows)
    assert "No integrator can be judged: no reference was run." in section_text("answer", folder)
    assert section_text("error_over_cost", folder).startswith("Not drawn")
    assert section_text("histories", folder) == "Not drawn: the campaign has no reference."
    assert "Reference None was run." in section_text("definitions", folder)


def test_seeds_of_one_wind_make_a_report_with_their_scatter(tmp_path):
    rows = example_rows(speeds=(8, 10), seeds=(1, 2, 3, 4), steps=(0.02,), diverging=False)
    html = write_report(write_run(tmp_path / "run", rows)).read_text(encoding="utf-8")
    assert len(Page(html).addresses) == 2 and "between seeds" in html


def test_the_same_run_gives_the_same_bytes(folder, rows, logs):
    logs(rows)
    before = (folder / "report.html").read_bytes()
    assert write_report(folder).read_bytes() == before
    assert not list(folder.glob("*.part"))


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("results.csv", None, "holds no results.csv; give the output folder"),
        ("results.csv", "", "has no cases"),
        ("results.csv", "a,b\n1,2\n", "lacks the column 'case_id'"),
        ("results.csv", "case_id\n\udce9".encode("utf-8", "surrogateescape"), "save it as UTF-8"),
        ("run.json", "{", "run.json is damaged; delete it"),
        ("run.json", "[]", "run.json is damaged; delete it"),
        ("campaign.yaml", "a: [", "campaign.yaml:1: not valid YAML"),
        ("campaign.yaml", "- 1", "campaign.yaml:1: a campaign is a mapping"),
    ],
)
def test_a_folder_that_is_no_run_is_refused_in_one_sentence(tmp_path, rows, name, content, words):
    folder = write_run(tmp_path / "run", rows[:2])
    target = folder / name
    if content is None:
        target.unlink()
    else:
        target.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=re.escape(words)) as caught:
        write_report(folder)
    assert "\n" not in str(caught.value)
    assert not (folder / "report.html").exists()


def test_every_module_of_the_sections_folder_is_on_the_page_in_the_order_of_its_number():
    found = [f.__module__.rsplit(".", 1)[1] for f in sections.builders()]
    assert found[:2] == ["life", "answer"] and found[-1] == "definitions"
    assert set(found) >= {"limits", "histories", "del_over_wind", "error_over_cost", "channels", "cases"}


def test_every_figure_has_a_caption_and_words_for_who_cannot_see_it(folder):
    html = (folder / "report.html").read_text(encoding="utf-8")
    alts, captions = re.findall(r'alt="([^"]*)"', html), re.findall(r"<figcaption>(.*?)</figcaption>", html)
    assert len(alts) == len(captions) == 3
    assert all(alts) and all(caption.endswith(".") for caption in captions)


def test_a_table_with_a_missing_cell_is_refused_when_made():
    with pytest.raises(ValueError, match="1 cells, the table 2 columns"):
        Table([Column("a"), Column("b")], [TableRow(["1"])])


def test_blade_channels_are_shown_at_the_exponent_of_composite_and_towers_at_that_of_steel():
    assert customary_exponent("blade1_root_flapwise_moment", [3, 4, 5, 10, 12]) == 10
    assert customary_exponent("tower_base_fore_aft_moment", [3, 4, 5, 10, 12]) == 4
    assert customary_exponent("tower_base_fore_aft_moment", [8]) == 8


def test_seeds_of_one_wind_are_averaged_by_damage_and_not_by_load():
    cases = [{"wind_speed": 8, "d": 1.0}, {"wind_speed": 8, "d": 3.0}]
    speeds, means = del_over_wind._power_means(cases, "d", 4, 1.0)
    assert speeds == [8.0] and means == pytest.approx([((1 + 81) / 2) ** 0.25])


def test_scatter_between_seeds_is_not_claimed_where_the_wind_differs_too():
    seeds = [
        {"wind_speed": "8", "horizontal_shear": "0", "turbulence_intensity": "0.1", "seed": s, "d": s}
        for s in (1, 2, 3)
    ]
    assert del_over_wind._seed_scatter(seeds, "d") == [(8.0, pytest.approx((2 / 3) ** 0.5 / 2))]
    seeds[0]["turbulence_intensity"] = "0.2"
    assert del_over_wind._seed_scatter(seeds, "d") == []


def test_the_winds_of_the_time_histories_are_the_slowest_a_middle_and_the_fastest(folder):
    run = load_run(folder)
    assert [wind.speed for wind in shown_winds(run)] == [5.0, 7.0, 10.0]


def test_a_crowded_figure_keeps_the_recommended_integrators_and_says_what_it_leaves_out(folder):
    run = load_run(folder)
    shown = [s.label for s in shown_integrators(run)]
    assert len(shown) == 5 and {"rk3 20 ms", "rk3 10 ms"} <= set(shown)
    assert left_out(run, shown_integrators(run)).startswith(" 4 of the 9 integrators are left out here")
    assert left_out(run, run.integrators) == ""


def test_methods_differ_in_colour_and_steps_in_line(folder):
    run = load_run(folder)
    look = looks(run.summaries)
    assert len({(x.colour, str(x.line)) for x in look.values()}) == len(look)
    by_method = {s.method: look[s].colour for s in run.integrators}
    assert len(set(by_method.values())) == 3 and set(by_method.values()) <= set(COLOURS)


def test_a_finished_campaign_says_that_nothing_is_lost(tmp_path):
    run = load_run(write_run(tmp_path / "run", example_rows(diverging=False)))
    first = build("cases", run).blocks[0]
    assert isinstance(first, Paragraph) and first.text == "All 60 cases finished."


def test_labels_avoid_each_other_where_points_are_close_and_stay_in_place_where_they_are_not():
    from fatigue_runner.report.labels import PLACES, Label, draw_labels, overlap
    from fatigue_runner.report.style import new_figure, styled

    with styled():
        axes = new_figure(3).subplots()
        axes.set(xlim=(0, 1), ylim=(0, 1))
        points = [(0.1, 0.1), (0.5, 0.5), (0.515, 0.5)]
        draw_labels(axes, [Label(point, "rk4 20 ms", "black") for point in points])
        figure = axes.get_figure()
        figure.draw_without_rendering()
        boxes = [text.get_window_extent().extents for text in axes.texts]
    assert axes.texts[0].xyann == PLACES[0][:2]
    assert not any(overlap(a, b) for i, a in enumerate(boxes) for b in boxes[:i])
