"""A turbine file means what it says; what is wrong in it is refused with file, line and the way out, its base included."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from places import TURBINE_DATA

from fatigue_runner.errors import InputError
from fatigue_runner.turbine import load_turbine
from fatigue_runner.turbine.file import read_turbine_file

HEAD = "name: mine\nbase: nrel5mw\n"


def refusal(folder: Path, text: str, head: str = HEAD) -> str:
    path = folder / "mine.yaml"
    path.write_text(head + text)
    with pytest.raises(InputError) as caught:
        load_turbine(str(path))
    assert caught.value.exit_code == 2
    return str(caught.value).replace(f"{folder}/", "")


# what stands below the two lines of HEAD, and what is said
REFUSED = {
    "unknown key of the controller": (
        "control:\n  integral_gian: 0.1",
        "mine.yaml:4: unknown key 'integral_gian' in control; did you mean 'integral_gain'?",
    ),
    "another controller": ("control: {controller: basline}", "mine.yaml:3: control.controller: 'basline' is not known; did you mean 'base"),
    "negative gain": ("control:\n  proportional_gain: -0.1", "mine.yaml:4: control.proportional_gain must be above 0; got -0.1"),
    "gain that is taken away": (
        "control:\n  integral_gain: null",
        "mine.yaml:4: control.integral_gain: is missing; give it, or `tuning`, from which all gains follow",
    ),
    "speeds that fall": ("control:\n  region_2_speed_rpm: 600", "mine.yaml:4: control.region_2_speed_rpm: speeds must rise"),
    "half an actuator": ("control:\n  actuator: {damping_ratio: 0.7}", "mine.yaml:4: key 'natural_frequency' is missing in control.act"),
    "an actuator that drives itself": (
        "control:\n  actuator: {natural_frequency: 6, damping_ratio: -1}",
        "mine.yaml:4: control.actuator.damping_ratio must be above 0; got -1",
    ),
    "a wake of no kind": ("control:\n  tuning: {wake: frosen}", "mine.yaml:4: control.tuning.wake: 'frosen' is not known; did"),
    "unknown section": ("towr: {mass_factor: 2}", "mine.yaml:3: unknown key 'towr'; did you mean 'tower'?"),
    "unknown key": (
        "tower:\n  mas_factor: 2",
        "mine.yaml:4: unknown key 'mas_factor' in tower; did you mean 'mass_factor'?",
    ),
    "two blades": (
        "geometry: {blades: 2}",
        "mine.yaml:3: geometry.blades: must be 3, the model's equations are those of a three-bladed rotor; got 2",
    ),
    "text for a number": ("hub: {mass: heavy}", "mine.yaml:3: hub.mass must be a number; got 'heavy'"),
    "true for a number": ("hub: {mass: true}", "mine.yaml:3: hub.mass must be a number; got True"),
    "negative mass": ("hub:\n  mass: -1", "mine.yaml:4: hub.mass must be above 0; got -1"),
    "negative factor": ("blade:\n  mass_factor: -1.0", "mine.yaml:4: blade.mass_factor must be above 0"),
    "no number": ("environment: {air_density: .nan}", "environment.air_density must be a finite number"),
    "number for a section": ("hub: 3", "mine.yaml:3: hub: must be a section with the keys mass, inertia"),
    "no torque law": ("generator: {law: optimum}", "'optimum' is not known; did you mean 'optimal'?"),
    "short vector": ("nacelle: {centre_of_mass: [1, 2]}", "must hold at least 3 value(s); got [1, 2]"),
    "more than all": ("drivetrain: {gearbox_efficiency: 2}", "gearbox_efficiency must be at most 1; got 2"),
    "impossible inertia": ("nacelle: {mass: 1e9}", "mine.yaml:3: nacelle: yaw_inertia 2.60789e+06 kg.m2 is about the yaw axis"),
    "hub beyond the tip": ("geometry:\n  tip_radius: 1", "mine.yaml:3: geometry: hub_radius 1.5 m must be below tip_radius 1 m"),
    "mode that does not reach 1": ("blade: {flap_mode: [0.1, 0.2]}", "mine.yaml:3: blade.flap_mode: the coefficients must add up to 1"),
    "stations without a column": (
        "tower:\n  stations:\n    columns: [height_fraction]\n    rows: [[0], [1]]",
        "mine.yaml:4: tower.stations: column 'mass_density' is missing",
    ),
    "stations with another column": (
        "tower: {stations: {columns: [height_fracton], rows: [[0], [1]]}}",
        "unknown column 'height_fracton'; did you mean 'height_fraction'?",
    ),
    "text in a row": (
        "aerodynamics: {stations: {columns: [span, chord, twist_deg, airfoil], rows: [[0, 3, 1, a], [1, wide, 1, a]]}}",
        "chord of row 2 must be a number; got 'wide'",
    ),
    "a row too short": (
        "aerodynamics: {stations: {columns: [span, chord, twist_deg, airfoil], rows: [[0, 3, 1, a], [1, 2, 1]]}}",
        "row 2 has 3 values for the 4 columns",
    ),
    "stations that do not rise": (
        "tower:\n  stations:\n    columns: [height_fraction, mass_density, fore_aft_stiffness, side_side_stiffness]\n"
        "    rows: [[0, 1, 1, 1], [0.5, 1, 1, 1]]",
        "tower.stations: height_fraction must rise from 0 to 1",
    ),
    "unknown interpolation": ("aerodynamics: {interpolation: cubc}", "'cubc' is not known; did you mean 'cubic'?"),
    "a key twice": ("base: t2b1i1cg", "mine.yaml:3: key 'base' is given twice"),
    "no slip": ("generator: {regions: {slip_percent: 1e-30}}", "mine.yaml:3: generator.regions.slip_percent must be at least 0.01"),
    "text with a unit": ("hub: {mass: 56 t}", "mine.yaml:3: hub.mass must be a number; got '56 t'"),
    "a list for a number": ("hub: {mass: [1, 2]}", "mine.yaml:3: hub.mass must be a number; got [1, 2]"),
    "nothing for a number": ("hub:\n  mass:", "mine.yaml:4: hub.mass must be a number; got None"),
    "infinite": ("hub: {mass: .inf}", "mine.yaml:3: hub.mass must be a finite number"),
    "a decimal comma": ("hub: {mass: '1,5'}", "mine.yaml:3: hub.mass must be a number; got '1,5'"),
    "a key twice in a section": ("hub:\n  mass: 1\n  mass: 2", "mine.yaml:5: key 'mass' is given twice in one section"),
    "indented with a tab": ("hub:\n\tmass: 1", "mine.yaml:4: the line is indented with a tab"),
    "heights in metres": (
        "tower:\n  stations:\n    columns: [height_fraction, mass_density, fore_aft_stiffness, side_side_stiffness]\n"
        "    rows: [[0, 5000, 6e11, 6e11], [87.6, 2500, 1e11, 1e11]]",
        "mine.yaml:4: tower.stations: height_fraction must rise from 0 to 1",
    ),
    "rows that are no rows": ("blade: {stations: {rows: [1]}}", "mine.yaml:3: blade.stations.rows[0] must be a list; got 1"),
    "no stations": ("blade: {stations: [[0, 1]]}", "mine.yaml:3: blade.stations: must be a section with the keys columns, rows"),
    "a number for a key": ("hub:\n  5: 3", "mine.yaml:4: unknown key '5' in hub; known: mass, inertia, centre_of_mass"),
    "entries that contradict the base's": (
        "geometry: {tip_radius: 95}",
        "mine.yaml:3 over {base}:24: the tower is too short: the hub is 90 m above ground and the blades reach 95 m down",
    ),
    "airfoils that are not there": ("aerodynamics:\n  airfoils: no.yaml", "airfoil file no.yaml does not exist"),
    "tables that are not there": ("aerodynamics: {tables: no.npz}", "aerodynamic tables no.npz do not exist (aerodynamics: tables names"),
    "broken yaml": ("hub: {mass: 1", "not valid YAML"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_wrong_is_refused_with_its_place_and_the_way_out(tmp_path, text, message):
    told = refusal(tmp_path, text)
    assert message.replace("{base}", str(TURBINE_DATA / "nrel5mw.yaml")) in told
    assert told.startswith("mine.yaml") or "does not exist" in told or "do not exist" in told
    assert "\n" not in told


@pytest.mark.parametrize(
    ("name", "held", "cause"),
    [
        ("text", b"hello", "it is cut off, or another file"),
        ("empty", b"", "it is cut off, or another file"),
        ("half", None, "it is cut off, or another file"),
        ("other", {"a": np.ones(3)}, "it has no names"),
        (
            "pointer",
            b"version https://git-lfs.github.com/spec/v1\noid sha256:a\nsize 3\n",
            "this is a Git LFS pointer",
        ),
    ],
)
def test_a_file_that_holds_no_tables_is_told_with_the_way_out(tmp_path, name, held, cause):
    path = tmp_path / "t.npz"
    if isinstance(held, dict):
        np.savez(path, **held)
    else:
        whole = (TURBINE_DATA / "nrel5mw_aero.npz").read_bytes()
        path.write_bytes(whole[: len(whole) // 2] if held is None else held)
    told = refusal(tmp_path, "aerodynamics: {tables: t.npz}")
    assert told.startswith("t.npz") and cause in told and "\n" not in told


def test_what_a_base_has_may_be_taken_away(tmp_path):
    (tmp_path / "mine.yaml").write_text(HEAD + "tower: {diameters: null}\naerodynamics: {airfoils: null}\n")
    assert load_turbine(str(tmp_path / "mine.yaml")).tower == ()


@pytest.mark.parametrize("name", ["a/b", "a\\b", '"a\\nb"', "5", "''", "[a]"])
def test_a_name_that_files_cannot_have_is_refused(tmp_path, name):
    assert refusal(tmp_path, "", head=f"name: {name}\nbase: nrel5mw\n").startswith("mine.yaml:1: name")


def test_without_a_base_every_missing_part_is_named(tmp_path):
    told = refusal(tmp_path, "hub: {mass: 1}\n", head="name: mine\n")
    assert "mine.yaml:2: key 'inertia' is missing in hub" in told
    assert "mine.yaml:1: key 'blade' is missing" in told


def test_what_is_wrong_in_the_base_is_told_with_the_bases_line(tmp_path):
    (tmp_path / "heavy.yaml").write_text("name: heavy\nbase: nrel5mw\nhub:\n  mas: 3\n")
    told = refusal(tmp_path, "tower: {mass_factor: 2}", head="name: mine\nbase: heavy.yaml\n")
    assert told == "heavy.yaml:4: unknown key 'mas' in hub; did you mean 'mass'?"


def test_a_base_in_a_file_is_found_beside_it_from_any_folder(tmp_path, monkeypatch):
    (tmp_path / "heavy.yaml").write_text("name: heavy\nbase: nrel5mw\nhub: {mass: 60000}\n")
    (tmp_path / "mine.yaml").write_text("name: mine\nbase: heavy.yaml\nnacelle: {mass: 250000}\n")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    parameters = load_turbine("../mine.yaml").parameters
    assert (parameters["h_m"], parameters["n_m"]) == (60000.0, 250000.0)


def test_turbines_that_build_on_each_other_are_refused(tmp_path):
    (tmp_path / "other.yaml").write_text("name: other\nbase: mine.yaml\n")
    told = refusal(tmp_path, "", head="name: mine\nbase: other.yaml\n")
    assert told == "other.yaml:2: base 'mine.yaml' leads back to this file; name another turbine"


def test_an_unknown_base_is_refused_with_its_line_and_the_nearest_name(tmp_path):
    told = refusal(tmp_path, "", head="name: mine\nbase: nrel5m\n")
    assert told.startswith("mine.yaml:2: there is no turbine 'nrel5m'; did you mean 'nrel5mw'")


def test_a_mapping_is_checked_as_a_file():
    data = read_turbine_file("nrel5mw")
    with pytest.raises(InputError, match=r"turbine: unknown key 'towr'; did you mean 'tower'"):
        load_turbine(data | {"towr": {}})
    with pytest.raises(InputError, match=r"turbine: hub.mass must be above 0; got -3"):
        load_turbine(data | {"hub": data["hub"] | {"mass": -3}})


@pytest.mark.parametrize("path", sorted(TURBINE_DATA.glob("*.yaml")), ids=lambda path: path.stem)
def test_what_is_shipped_is_valid_and_read_as_it_stands(path):
    from ruamel.yaml import YAML

    if path.stem.endswith("airfoils"):
        return
    raw = YAML(typ="safe", pure=True).load(path.read_text())
    read = read_turbine_file(path.stem)
    assert read["blade"]["stations"] == read_turbine_file("nrel5mw")["blade"]["stations"]
    assert all(read[key] == raw[key] for key in ("name", "description"))


def test_a_file_without_airfoils_cannot_make_tables(tmp_path):
    from fatigue_runner.turbine.table_builder import make_tables

    data = read_turbine_file("nrel5mw")
    lines = [
        f"{key}: {value!r}"
        for key, value in data.items()
        if key not in ("aerodynamics", "description", "source")
    ]
    path = tmp_path / "mine.yaml"
    path.write_text("\n".join([*lines, "aerodynamics: {tables: mine.npz}"]))
    with pytest.raises(InputError, match="tables are made from `aerodynamics: airfoils:`"):
        make_tables(str(path))
