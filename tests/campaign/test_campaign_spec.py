"""A campaign file means what it says; what is wrong in it is refused with file, line and the way out."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fatigue_runner.campaign.spec import Campaign, campaign_source, parse_campaign
from fatigue_runner.channels import BY_NAME, OPENFAST
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.sweep import Random, Range, expand

MINIMAL = """\
name: sweep
duration: 60
wind:
  speeds: 8
integrators:
  - {method: heun, step: 0.01}
"""

# Six lines that mean 200,000 values.
ALIASES = "k0: &k0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"k{i}: &k{i} [{', '.join([f'*k{i - 1}'] * 10)}]\n" for i in range(1, 6)
)


def parse(folder: Path, text: str) -> Campaign:
    path = folder / "sweep.yaml"
    path.write_text(text)
    return parse_campaign(campaign_source(path))


def refusal(folder: Path, text: str) -> str:
    """The message without the folder, so that it reads `sweep.yaml:4: ...`."""
    with pytest.raises(InputError) as caught:
        parse(folder, text)
    assert caught.value.exit_code == 2
    return str(caught.value).replace(f"{folder}/", "")


def values(pieces) -> list[float]:
    return [value for value, _ in expand(pieces)]


def test_a_minimal_campaign_has_the_stated_defaults(tmp_path):
    campaign = parse(tmp_path, MINIMAL)
    assert (campaign.turbine, campaign.output_rate, campaign.initial) == ("nrel5mw", 50, "operating-point")
    assert (campaign.workers, campaign.discard, campaign.pitch) == (2, 0, 0)
    assert campaign.reference is not None and campaign.reference.method == "rk7"
    assert campaign.reference.step == 0.001
    assert campaign.fatigue.wohler_exponents == [3, 4, 5, 10, 12]
    assert campaign.fatigue.residue == "half"
    assert campaign.log.enabled


def test_exponent_notation_is_a_number_as_in_yaml_1_2(tmp_path):
    assert parse(tmp_path, MINIMAL.replace("60", "6e1")).duration == 60.0
    assert parse(tmp_path, MINIMAL.replace("0.01", "1e-2")).integrators[0].step == [0.01]


def test_step_may_be_a_number_or_a_list_and_spelled_steps(tmp_path):
    one = parse(tmp_path, MINIMAL)
    listed = parse(tmp_path, MINIMAL.replace("step: 0.01", "steps: [0.01, 0.02]"))
    assert one.integrators[0].step == [0.01]
    assert listed.integrators[0].step == [0.01, 0.02]


# What is written in place of `line`, and the message.
REFUSED = {
    "unknown key": (
        "  speeds: 8",
        "  sped: 8",
        "sweep.yaml:4: unknown key 'sped' in wind; did you mean 'speeds'?",
    ),
    "unknown key at the top": (
        "duration: 60",
        "duratoin: 60",
        "unknown key 'duratoin'; did you mean 'duration'?",
    ),
    "unknown key in a list": (
        "step: 0.01",
        "stap: 0.01",
        "sweep.yaml:6: unknown key 'stap' in integrators[0]",
    ),
    "missing key": ("name: sweep\n", "", "sweep.yaml:1: key 'name' is missing"),
    "missing section": ("wind:\n  speeds: 8\n", "", "key 'wind' is missing"),
    "no speeds": ("  speeds: 8", "  type: constant", "sweep.yaml:3: wind: needs the key 'speeds'"),
    "duplicate key": ("duration: 60", "duration: 60\nname: b", "sweep.yaml:3: key 'name' is given twice"),
    "negative step": (
        "step: 0.01",
        "step: -0.01",
        "sweep.yaml:6: integrators[0].step: must be above 0 s; got -0.01",
    ),
    "zero step": ("step: 0.01", "step: [0.01, 0]", "must be above 0 s; got 0"),
    "zero reference step": (
        "name:",
        "reference: {step: 0}\nname:",
        "sweep.yaml:1: reference.step must be above 0",
    ),
    "step as text": (
        "step: 0.01",
        "step: 10ms",
        "sweep.yaml:6: integrators[0].step must be a number; got '10ms'",
    ),
    "step is true": ("step: 0.01", "step: true", "integrators[0].step must be a number; got True"),
    "step is not a number": ("step: 0.01", "step: .nan", "must be a finite number"),
    "step longer than the case": (
        "step: 0.01",
        "step: 61",
        "step 61 s of heun is longer than the whole case",
    ),
    "empty sweep": ("speeds: 8", "speeds: []", "sweep.yaml:4: wind.speeds: is an empty sweep"),
    "backward range": (
        "speeds: 8",
        "speeds: {start: 9, stop: 8, step: 1}",
        "so the sweep is empty; swap them",
    ),
    "range without spacing": ("speeds: 8", "speeds: {start: 7, stop: 8}", "give either `step` or `count`"),
    "range of zero step": (
        "speeds: 8",
        "speeds: {start: 7, stop: 8, step: 0}",
        "wind.speeds.step must be above 0",
    ),
    "huge range": ("speeds: 8", "speeds: {start: 1, stop: 9, step: 1e-9}", "holds more than 100000 values"),
    "crowded random": (
        "speeds: 8",
        "speeds: {random: {count: 9, low: 8, high: 8, seed: 1}}",
        "sweep.yaml:4: wind.speeds.random: 9 different values",
    ),
    "no integrators": ("  - {method: heun, step: 0.01}", "  []", "integrators: is an empty sweep"),
    "integrator twice": (
        "step: 0.01}",
        "step: 0.01}\n  - {method: heun, step: [0.02, 0.01]}",
        "heun at 10 ms is integrators[1] and also integrators[0]; remove one",
    ),
    "reference as integrator": (
        "{method: heun, step: 0.01}",
        "{method: rk7, step: 0.001}",
        "and also the reference",
    ),
    "unknown channel": (
        "name:",
        "fatigue: {channels: [rotor_trust]}\nname:",
        "'rotor_trust' is no load channel; did you mean 'rotor_thrust'?",
    ),
    "unknown residue": (
        "name:",
        "fatigue: {residue: halff}\nname:",
        "'halff' is not known; did you mean 'half'?",
    ),
    "unknown initial": (
        "name:",
        "initial: operating\nname:",
        "initial: 'operating' is not known; did you mean 'operating-point'?",
    ),
    "short state": ("name:", "initial: [0, 0]\nname:", "or 16 finite numbers: tower_fore_aft, "),
    "zero workers": ("name:", "workers: 0\nname:", "sweep.yaml:1: workers must be at least 1; got 0"),
    "fractional samples": (
        "duration: 60",
        "duration: 60.01",
        "3000.5 output intervals; it must be a whole number",
    ),
    "all discarded": ("name:", "discard: 60\nname:", "discard: 60 s leaves nothing of the 60 s"),
    "name with a slash": ("name: sweep", "name: ../sweep", "sweep.yaml:1: name "),
    "seeds of constant wind": (
        "speeds: 8",
        "speeds: 8\n  seeds: 3",
        "sweep.yaml:5: wind.seeds: means nothing",
    ),
    "turbulence of no strength": ("speeds: 8", "speeds: 8\n  type: turbulent", "needs either `intensity`"),
    "two shears": (
        "speeds: 8",
        "speeds: 8\n  vertical_shear: 0.1\n  shear_exponent: 0.2",
        "sweep.yaml:6: wind.shear_exponent: stands beside vertical_shear",
    ),
    "no mapping": (
        "  - {method: heun, step: 0.01}",
        "  - heun",
        "integrators[0]: must be a section with the keys",
    ),
    "list for a file": (MINIMAL, "- 1\n", "sweep.yaml:1: a campaign is a mapping of keys"),
    "empty file": (MINIMAL, "", "sweep.yaml:1: a campaign is a mapping of keys"),
    "broken yaml": ("speeds: 8", "speeds: [8", "sweep.yaml:5: not valid YAML"),
    "multiplying aliases": (MINIMAL, ALIASES, "sweep.yaml:5: too many or too deeply nested values"),
}


@pytest.mark.parametrize(("line", "instead", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_wrong_is_refused_with_its_place_and_the_way_out(tmp_path, line, instead, message):
    assert line in MINIMAL
    told = refusal(tmp_path, MINIMAL.replace(line, instead, 1))
    assert message in told
    assert told.startswith("sweep.yaml:")
    assert "\n" not in told


def test_all_problems_are_told_at_once_in_the_order_of_the_file(tmp_path):
    told = refusal(
        tmp_path, MINIMAL.replace("60", "-1").replace("0.01", "0").replace("speeds: 8", "speds: 8")
    )
    assert [line.split(" ")[0] for line in told.splitlines()] == [
        "sweep.yaml:2:",
        "sweep.yaml:4:",
        "sweep.yaml:6:",
    ]


def test_a_missing_file_names_the_nearest_one(tmp_path):
    (tmp_path / "sweep.yaml").write_text(MINIMAL)
    with pytest.raises(InputError, match=r"sweeep\.yaml: no such file; did you mean .*sweep\.yaml"):
        campaign_source(tmp_path / "sweeep.yaml")


def test_a_folder_is_no_campaign(tmp_path):
    with pytest.raises(InputError, match="is a folder"):
        campaign_source(tmp_path)


def test_brackets_without_end_are_no_campaign(tmp_path):
    assert "nest too deeply" in refusal(tmp_path, "a: " + "[" * 400 + "]" * 400)


def test_a_mapping_needs_no_file_and_its_errors_name_the_key():
    with pytest.raises(InputError, match="campaign: unknown key 'sped' in wind; did you mean 'speeds'"):
        parse_campaign(campaign_source({"name": "a", "duration": 1, "wind": {"sped": 8}, "integrators": []}))


def test_a_range_holds_both_ends():
    assert values([Range(start=5.0, stop=10.0, step=2.5)]) == [5.0, 7.5, 10.0]
    assert values([Range(start=5.0, stop=10.0, count=3)]) == [5.0, 7.5, 10.0]
    assert values([Range(start=8.0, stop=8.0, count=1)]) == [8.0]


def test_a_range_is_free_of_rounding():
    assert values([Range(start=5.0, stop=5.5, step=0.1)]) == [5.0, 5.1, 5.2, 5.3, 5.4, 5.5]


def test_a_value_in_two_pieces_comes_once():
    assert values([8.0, Range(start=7.0, stop=9.0, step=1.0)]) == [8.0, 7.0, 9.0]


def test_random_speeds_are_these_on_every_machine():
    # Random(1).random() gives 0.13436, 0.84743, 0.76377 in every version (docs.python.org, random).
    speeds = values([Random.model_validate({"random": {"count": 3, "low": 5.0, "high": 10.0, "seed": 1}})])
    assert speeds == [5.6718, 8.8189, 9.2372]


def test_the_paper_mixture_of_speeds_can_be_written(tmp_path):
    text = MINIMAL.replace(
        "  speeds: 8",
        "  speeds:\n    - random: {count: 150, low: 5, high: 10, seed: 1}\n"
        "    - random: {count: 50, low: 10, high: 20, seed: 2}",
    )
    speeds = values(parse(tmp_path, text).wind.speeds)
    assert len(speeds) == len(set(speeds)) == 200
    assert sum(speed <= 10 for speed in speeds) == 150
    assert max(speeds) > 15


def test_a_count_of_seeds_is_numbers_that_no_other_speed_has_and_a_list_is_as_it_stands(tmp_path):
    turbulent = "  type: turbulent\n  speeds: [8, 10]\n  intensity: 0.1\n  seeds: "
    wind = parse(tmp_path, MINIMAL.replace("  speeds: 8", f"{turbulent}3")).wind
    assert wind.seeds_at(8.0) == [800001, 800002, 800003] and wind.seeds_at(6.0)[0] == 600001
    speeds = [
        8,
        8.0001,
        8.0002,
        8.00005,
        8.123456789,
        80.001,
        0.8,
        11.1,
        *values([Range(start=3, stop=25, count=300)]),
    ]
    speeds += values([Random(random={"count": 500, "low": 5, "high": 10, "seed": 1})])
    seeds = [seed for speed in dict.fromkeys(speeds) for seed in wind.seeds_at(speed)]
    assert len(set(seeds)) == len(seeds) and max(seeds) < 2**63
    assert parse(tmp_path, MINIMAL.replace("  speeds: 8", f"{turbulent}[7, 1]")).wind.seeds_at(8.0) == [7, 1]
    said = refusal(tmp_path, MINIMAL.replace("  speeds: 8", f"{turbulent}[7, 1, 7]"))
    assert "seed 7 stands twice; the same wind would count twice: remove one" in said


@pytest.mark.parametrize("given", ["none", "None", "null", "~"])
def test_no_reference_is_none_or_null(tmp_path, given):
    assert parse(tmp_path, f"{MINIMAL}reference: {given}\n").reference is None


def test_a_wohler_exponent_given_twice_is_one(tmp_path):
    campaign = parse(tmp_path, MINIMAL + "fatigue: {wohler_exponents: [4, 4.0, 10]}\n")
    assert campaign.fatigue.wohler_exponents == [4.0, 10.0]


def test_wohler_exponents_that_print_alike_are_refused(tmp_path):
    """They would have one column of the table."""
    said = refusal(tmp_path, MINIMAL + "fatigue:\n  wohler_exponents: [4, 4.00000001]\n")
    assert said.startswith("sweep.yaml:8: fatigue.wohler_exponents") and "m4" in said


@given(
    start=st.floats(-50, 50),
    length=st.floats(0, 50),
    step=st.floats(0.01, 10),
)
def test_a_range_by_step_is_even_and_within_its_ends(start, length, step):
    found = values([Range(start=start, stop=start + length, step=step)])
    assert len(found) == math.floor(length / step + 1e-9) + 1 or math.isclose(
        length / step % 1, 0, abs_tol=1e-6
    )
    for i, value in enumerate(found):
        assert math.isclose(value, start + i * step, rel_tol=1e-9, abs_tol=1e-9)
    assert found[-1] <= start + length + 1e-6 * max(1.0, abs(start + length))


@given(st.lists(st.floats(0.1, 40), min_size=1, max_size=8))
def test_a_list_is_taken_in_its_order(speeds):
    assert values(speeds) == list(dict.fromkeys(speeds))


@given(text=st.text(max_size=200))
def test_no_text_ends_in_anything_but_a_campaign_or_an_input_error(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("any") / "any.yaml"
    path.write_text(text, encoding="utf-8", errors="surrogateescape")
    try:
        parse_campaign(campaign_source(path))
    except InputError as error:
        assert str(error).startswith(str(path))


def test_openfast_s_names_of_channels_are_understood(tmp_path):
    text = (
        MINIMAL
        + "fatigue: {channels: [RootMyb1, TwrBsMyt, rootmxb2, rotor_thrust]}\nlog: {channels: [GenTq, rotor_speed]}\n"
    )
    campaign = parse(tmp_path, text)
    assert campaign.fatigue.channels == [
        "blade1_root_flapwise_moment", "tower_base_fore_aft_moment", "blade2_root_edgewise_moment", "rotor_thrust"
    ]  # fmt: skip
    assert campaign.log.channels == ["generator_torque", "rotor_speed"]
    assert set(OPENFAST.values()) <= set(BY_NAME)


def test_sections_are_counted_and_logged_where_loads_asks_for_them(tmp_path):
    text = (
        MINIMAL
        + "loads: {tower_heights: {start: 0, stop: 40, step: 20}, blade_radii: [30, 1.5], root_directions: 2}\n"
    )
    campaign = parse(tmp_path, text + "log: {channels: [TwHt2MLyt, Spn1MLxb1, blade1_root_moment_90deg]}\n")
    assert campaign.logged == [
        "tower_20m_fore_aft_moment",
        "blade1_1.5m_edgewise_moment",
        "blade1_root_moment_90deg",
    ]
    assert campaign.counted[:4] == campaign.fatigue.channels and len(campaign.counted) == 4 + 6 + 4 + 2
    for wrong, said in {
        "log: {channels: [TwHt4MLyt]}": "log: 'TwHt4MLyt' is a section that `loads` does not ask for; add it there",
        "fatigue: {channels: [tower_20m_fore_aft_moment]}": "is counted where `loads` asks for its section; leave it out here",
    }.items():
        with pytest.raises(InputError, match=re.escape(said)):
            parse(tmp_path, text + wrong + "\n")
    with pytest.raises(InputError, match="two places differ in digits that no name shows"):
        parse(tmp_path, MINIMAL + "loads: {tower_heights: [20, 20.000001]}\n")
