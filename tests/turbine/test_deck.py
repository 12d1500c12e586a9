"""An OpenFAST deck becomes a turbine file, whoever wrote it and for which version; what cannot is refused with file and line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import small_deck as small

from fatigue_runner.errors import InputError
from fatigue_runner.turbine import load_turbine
from fatigue_runner.turbine.deck.convert import converted
from fatigue_runner.turbine.deck.files import read_deck
from fatigue_runner.turbine.deck.importing import import_deck
from fatigue_runner.turbine.deck.omissions import omissions
from fatigue_runner.turbine.deck.text import number, read_deck_file


def made(folder: Path, version: int = 5, **files: str):
    return converted(read_deck(small.write(folder, version, **files)), "small")


def refusal(folder: Path, version: int = 5, **files: str) -> str:
    with pytest.raises(InputError) as caught:
        import_deck(small.write(folder, version, **files), folder / "mine.yaml")
    assert caught.value.exit_code == 2
    told = str(caught.value)
    assert "\n" not in told
    return told.replace(f"{folder}/", "")


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return made(tmp_path_factory.mktemp("plain")).data


def test_numbers_are_read_as_fortran_writes_them():
    written = {
        "1.0D+03": 1000.0,
        "1.": 1.0,
        ".5": 0.5,
        "-2.5d-1": -0.25,
        "1.5+3": 1500.0,
        "1E+12": 1e12,
        "7": 7.0,
    }
    assert {text: number(text) for text in written} == written
    assert [number(text) for text in ("1.0.0", "ten", "1e", "", "0x10", "nan", "-")] == [None] * 7


def test_a_deck_of_openfast_3_is_the_same_turbine_as_one_of_openfast_5(tmp_path, plain):
    assert made(tmp_path, version=3).data == plain


def test_what_stands_where(plain):
    assert plain["geometry"]["tip_radius"] == 32.0
    assert plain["environment"] == {
        "air_density": 1.2,
        "gravity": 9.81,
    }  # density: AeroDyn says "default", the .fst says it
    assert plain["nacelle"]["yaw_bearing_mass"] == 1000.0
    assert plain["drivetrain"]["gearbox_efficiency"] == 0.95
    assert plain["blade"]["stations"]["rows"][2] == [
        0.5,
        5.0,
        165.0,
        pytest.approx(2e9 * 0.501**2 + 1e6),
        pytest.approx(4e9 * 0.501**2 + 5e6),
    ]
    assert plain["blade"]["flap_damping_ratio"] == 0.01
    assert plain["tower"]["diameters"] == [[0.0, 4.0], [60.0, 2.5]]
    assert [row[3] for row in plain["aerodynamics"]["stations"]["rows"]] == [
        "round",
        "round",
        "thin",
        "thin",
        "thin",
        "thin",
    ]


def damaged(folder: Path, change) -> Path:
    """A deck whose files went through somebody's hands: change(text) -> bytes."""
    path = small.write(folder)
    for file in (p for p in folder.rglob("*") if p.is_file()):
        file.write_bytes(change(file.read_text()))
    return path


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n").encode(),
        lambda text: b"\xef\xbb\xbf" + text.encode(),
        lambda text: text.replace("what it is", "Gr\xf6\xdfe").encode("latin-1"),
        lambda text: text.replace("  ", "\t").encode(),
        lambda text: text.replace("\n", "\n\n! a line that another version has\n").replace("Cd Cm\n\n! a line", "Cd Cm\n! a line").encode(),
        lambda text: text.replace("- what it is", "what it is").encode(),
        lambda text: text.replace("True ", "T ").replace("False ", ".FALSE. ").encode(),
        lambda text: text.replace('"Airfoils/', '".\\Airfoils\\').encode(),
        lambda text: text.replace('"small_blade.dat"', "SMALL_Blade.dat").encode(),
        lambda text: text.replace('"small_tower.dat"', '"C:\\decks\\small_tower.dat"').encode(),
        lambda text: text.replace("E+00", "D+00").replace("32.0 ", "32. ").encode(),
    ],
    ids=["windows", "byte order mark", "latin-1", "tabs", "lines of other versions", "no dash", "flags", "backslashes", "upper case",
         "path of another machine", "fortran"],
)  # fmt: skip
def test_whatever_hands_a_deck_went_through_it_is_the_same_turbine(tmp_path, plain, change):
    path = damaged(tmp_path, change)
    assert converted(read_deck(path), "small").data == plain


def test_names_with_spaces_are_read_in_quotes(tmp_path, plain):
    path = small.write(tmp_path, fst=small.fst(5, EDFile='"the turbine.dat"'))
    (tmp_path / "small_ElastoDyn.dat").rename(tmp_path / "the turbine.dat")
    assert converted(read_deck(path), "small").data == plain


# what is changed in the deck, and what is said
REFUSED = {
    "two blades": ({"ElastoDyn": small.elastodyn(5, NumBl=2)}, "small_ElastoDyn.dat:13: the turbine has two blades; the model's equations"),
    "vertical axis": ({"ElastoDyn": small.elastodyn(5, ShftTilt=90.0)}, "a shaft tilt of 90 deg is a vertical axis"),
    "moored": ({"fst": small.fst(5, CompMooring=3)}, "small.fst:13: the turbine floats"),
    "floating": (
        {"fst": small.fst(5, CompHydro=1), "ElastoDyn": small.elastodyn(5, PtfmHvDOF="True")},
        "small_ElastoDyn.dat:11: the turbine floats",
    ),
    "under water": ({"fst": small.fst(5, MHK=1)}, "small.fst:14: the turbine runs under water"),
    "no aerodynamics": ({"fst": small.fst(5, CompAero=0)}, "small.fst:9: the deck has no aerodynamics (CompAero 0)"),
    "AeroDyn 14": ({"fst": small.fst(5, CompAero=1)}, "CompAero 1 is AeroDyn 14 or a disc"),
    "a sub-file that is not there": (
        {"ElastoDyn": small.elastodyn(5, TwrFile='"../towers/tall.dat"')},
        "small_ElastoDyn.dat:42: TwrFile names ../towers/tall.dat, which is not there; put the file at",
    ),
    "no sub-file": ({"fst": small.fst(5, AeroFile='"unused"')}, "small.fst:19: AeroFile names no file"),
    "text for a number": ({"ElastoDyn": small.elastodyn(5, TipRad="large")}, "ElastoDyn.dat:14: TipRad must be a number; got 'large'"),
    "a key that is not there": (
        {"ElastoDyn": small.elastodyn(5).replace("GBRatio", "GBRatoi")},
        "small_ElastoDyn.dat: the key GBRatio is missing, an ElastoDyn file has it; did you mean 'GBRatoi'?",
    ),
    "fewer rows than said": (
        {"blade": small.blade(5, NBlInpSt=6)},
        "small_blade.dat:19: NBlInpSt says 6 rows, here ends the table after 5",
    ),
    "a damaged number in a table": (
        {"tower": small.tower().replace("5.0000000E-01", "5.0000000E-O1")},
        "NTwInpSt says 3 rows, here ends the table after 1; got '5.0000000E-O1",
    ),
    "stations that fall": ({"tower": small.tower().replace(" 5.0000000E-01", " 1.5000000E+00")}, "rise from row to row; got 1 after 1.5"),
    "a blade of another length": (
        {"AeroBlade": small.aero_blade(BlSpn=lambda a: 25.0 * a)},
        "BlSpn must run from 0 to the blade's length, TipRad - HubRad = 30 m",
    ),
    "a polar of a wing": (
        {"thin": small.airfoil(True).replace("-180.00", "-25.00").replace("-90.00", "-22.00")},
        "Airfoils/thin.dat:12: the polar reaches from -25 to 180 deg",
    ),
    "a polar in radians": (
        {"thin": "\n".join(
            f"{np.radians(float(line.split()[0]))} {' '.join(line.split()[1:])}" if line[:2] == "  " else line
            for line in small.airfoil(True).split("\n")
        )},
        "they are in radians, give degrees",
    ),
    "tables of falling Reynolds number": (
        {"AeroDyn": small.aerodyn(5, AFTabMod=2), "thin": small.airfoil(True, (0.5, 0.0, 1.0))},
        "Airfoils/thin.dat:22: Re must rise from table to table",
    ),
    "fewer tables than said": (
        {"thin": small.airfoil(True).replace("1 NumTabs", "2 NumTabs")},
        "Airfoils/thin.dat:5: NumTabs says 2 tables, the file has 1",
    ),
    "a number that no turbine has": (
        {"ElastoDyn": small.elastodyn(5, NacMass=0.0)},
        "small_ElastoDyn.dat:32: NacMass makes no turbine: nacelle.mass must be above 0; got 0.0",
    ),
    "an airfoil that is not named": ({"AeroDyn": small.aerodyn(5, NumAFfiles=1)}, "BlAFID 2 is no airfoil"),
    "mode that does not reach 1": ({"blade": small.blade(5).replace("0.9 ", "9.0 ")}, "coefficients BldFl1Sh(2) to (6) must add up to 1"),
    "not text": ({"blade": "binary\0"}, "small_blade.dat: is no text file"),
    "a pointer": ({"blade": "version https://git-lfs.github.com/spec/v1\n"}, "small_blade.dat:1: is a pointer of Git LFS"),
}  # fmt: skip


@pytest.mark.parametrize(("files", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_no_turbine_of_this_kind_is_refused_with_its_place(tmp_path, files, message):
    assert message in refusal(tmp_path, **files)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("driver.dvr", "----- AeroDyn Driver Input File ----\nx\n", "input of a driver of one module"),
        (
            "old.fst",
            "--- FAST INPUT FILE ---\nx\n3 NumBl - blades\n'a.ipt' ADFile - x\n",
            "is of FAST 7 or older",
        ),
        ("other.fst", "name: nrel5mw\n", "is no OpenFAST .fst file, the key EDFile is missing"),
    ],
)
def test_what_is_no_deck_is_called_what_it_is(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        read_deck(tmp_path / name)


def test_a_folder_and_a_missing_file_are_told_with_the_deck_that_is_there(tmp_path):
    path = small.write(tmp_path)
    with pytest.raises(InputError, match=f"is a folder, .*; give {path}"):
        read_deck(tmp_path)
    with pytest.raises(InputError, match="no such file; did you mean"):
        read_deck(tmp_path / "smal.fst")


def test_placeholders_and_initial_values_are_not_the_turbine(plain):
    assert plain["generator"]["optimal_gain"] == 0.12  # of the DISCON.IN; ServoDyn's 99999.0 stands for none
    assert "fine_pitch_deg" in plain["control"] and plain["control"]["fine_pitch_deg"] == 0.0  # not BlPitch


def test_a_torque_law_of_servodyn_is_per_rpm_squared_and_has_constant_torque(tmp_path):
    servo = small.servodyn(
        VSContrl=1, PCMode=0, VS_Rgn2K=0.0013, VS_RtGnSp=1900.0, VS_RtTq=5000.0, VS_SlPc=10.0
    )
    data = made(tmp_path, ServoDyn=servo).data
    assert data["generator"]["optimal_gain"] == pytest.approx(0.0013 * (30 / np.pi) ** 2)
    assert data["generator"]["regions"]["rated_torque"] == 5000.0
    assert data["control"] is None


def test_roscos_gains_are_those_of_the_baseline_where_they_have_its_form(plain):
    control = plain["control"]
    assert control["proportional_gain"] == pytest.approx(0.02, rel=1e-3)
    assert control["integral_gain"] == pytest.approx(0.008, rel=1e-3)
    assert control["gain_schedule_pitch_deg"] == pytest.approx(np.degrees(0.15), rel=5e-3)
    assert control["rated_speed_rpm"] == pytest.approx(200 * 30 / np.pi)
    assert plain["generator"]["regions"]["rated_mechanical_power"] == pytest.approx(5000 * 200.0)


@pytest.mark.parametrize(("mode", "constant", "key"), [(0, None, "rated_torque"), (1, None, "rated_mechanical_power"),
                                                       (2, 0, "rated_torque"), (2, 1, "rated_mechanical_power")])  # fmt: skip
def test_roscos_torque_above_rated_is_its_version_s(tmp_path, mode, constant, key):
    change = {"VS_ControlMode": mode} | ({} if constant is None else {"VS_ConstPower": constant})
    assert key in made(tmp_path, DISCON=small.discon(**change)).data["generator"]["regions"]


def test_a_stiff_shaft_is_rigid_and_one_without_stiffness_too(tmp_path):
    for stiffness in (1.0e12, 0.0):
        result = made(tmp_path, ElastoDyn=small.elastodyn(5, GBRatio=1.0, GenIner=4e5, DTTorSpr=stiffness))
        assert result.data["drivetrain"]["shaft"] == "rigid"
        assert any("DTTorSpr" in note for note in result.notes)


def test_prebend_is_kept_and_an_aerodynamic_centre_s_offset_is_not(tmp_path, plain):
    bent = made(
        tmp_path, AeroBlade=small.aero_blade(BlCrvAC=lambda a: -2.0 * a**2, BlCrvAng=lambda a: -7.6 * a)
    ).data
    stations = bent["aerodynamics"]["stations"]
    assert stations["columns"] == ["span", "chord", "twist_deg", "airfoil", "prebend", "cant_deg"]
    assert stations["rows"][-1][4:] == [-2.0, -7.6]
    offset = made(tmp_path, AeroBlade=small.aero_blade(BlCrvAC=lambda a: -0.1))
    assert offset.data == plain
    assert any("prebend of AeroDyn's blade, up to 0.1 m, is left out" in note for note in offset.notes)


def lift_at(result, station: int, angle: float) -> float:
    name = result.data["aerodynamics"]["stations"]["rows"][station][3]
    points = np.array(result.airfoils[name])
    return float(np.interp(angle, points[:, 0], points[:, 1]))


def test_of_several_tables_the_first_is_taken_where_the_deck_says_so(tmp_path, plain):
    result = made(tmp_path, AeroDyn=small.aerodyn(5, AFTabMod=1), thin=small.airfoil(True, (9.0, 0.0, 2.0)))
    assert result.data == plain and lift_at(result, 3, 8.0) == 1.2
    assert not any("table" in note for note in result.notes)


def test_tables_of_reynolds_numbers_are_interpolated_at_each_station_s_own_in_operation(tmp_path):
    """By the logarithm, as AeroDyn does; 200 rad/s over the gearbox is the rated rotor speed."""
    aero = small.aerodyn(5, AFTabMod=2, KinVisc=1.5e-5)
    result = made(tmp_path, AeroDyn=aero, thin=small.airfoil(True, (1.5, 0.0, 1.1), (7.5, 0.0, 1.6)))
    span, chord = 30.0 * 0.6, 2.4 - 1.6 * 0.6
    reynolds = np.hypot(200 / 80 * (2 + span), 8.0) * chord / 1.5e-5
    share = np.log(reynolds / 1.5e6) / np.log(7.5 / 1.5)
    assert 0 < share < 1
    assert lift_at(result, 3, 8.0) == pytest.approx(1.2 * (1.1 + 0.5 * share), rel=1e-4)
    rows = result.data["aerodynamics"]["stations"]["rows"]
    assert rows[0][3] == "round" and len({row[3] for row in rows[2:]}) > 2
    assert any("the rated rotor speed, 23.9 rpm" in note for note in result.notes)
    # beyond the tables the last one holds
    outside = made(tmp_path, AeroDyn=aero, thin=small.airfoil(True, (0.8, 0.0, 1.5)))
    assert lift_at(outside, 3, 8.0) == pytest.approx(1.8)


def test_tables_of_a_user_s_property_are_taken_at_zero(tmp_path):
    aero = small.aerodyn(5, AFTabMod=3)
    thin = small.airfoil(True, (0.75, 10.0, 3.0)).replace("\n0 Ctrl", "\n-5 Ctrl")
    result = made(tmp_path, AeroDyn=aero, thin=thin)
    assert lift_at(result, 3, 8.0) == pytest.approx(1.2 * (1 + 2 / 3), rel=1e-4)
    assert any("AFTabMod 3" in note for note in result.notes)


def test_a_polar_of_one_row_holds_at_any_angle_as_in_aerodyn(tmp_path, plain):
    text = small.airfoil(False)
    rows = [line for line in text.split("\n") if line.startswith("  ")]
    short = text.replace("\n".join(rows), rows[4]).replace(f"{len(rows)} NumAlf", "1 NumAlf")
    result = made(tmp_path, round=short)
    assert result.data == plain
    assert result.airfoils["round"] == [[-180.0, 0.0, 0.5], [0.0, 0.0, 0.5], [180.0, 0.0, 0.5]]


def test_a_member_of_one_station_is_uniform(tmp_path):
    text = "\n".join(
        line for line in small.tower(NTwInpSt=1).split("\n") if not line.startswith((" 5.0", " 1.0"))
    )
    rows = made(tmp_path, tower=text).data["tower"]["stations"]["rows"]
    assert rows == [[0.0, 3000.0, 6e10, 6e10], [1.0, 3000.0, 6e10, 6e10]]


def test_a_torque_that_steps_to_its_rated_value_becomes_a_ramp(tmp_path):
    servo = small.servodyn(
        VSContrl=1, PCMode=0, VS_Rgn2K=0.0013, VS_RtGnSp=1900.0, VS_RtTq=5000.0, VS_SlPc=9.9999e-6
    )
    result = made(tmp_path, ServoDyn=servo)
    assert result.data["generator"]["regions"]["slip_percent"] == 2.0
    assert any("VS_SlPc 9.9999e-06 %" in note for note in result.notes)


def test_a_file_of_a_deck_that_was_moved_is_pointed_at(tmp_path):
    path = small.write(tmp_path / "runs" / "one", fst=small.fst(5, EDFile='"../../../base/the.dat"'))
    (tmp_path / "base").mkdir()
    (tmp_path / "base" / "the.dat").write_text(small.elastodyn(5))
    with pytest.raises(InputError, match=rf"which is not there; .* \(there is {tmp_path}/base/the.dat\)"):
        read_deck(path)


def test_modes_that_a_deck_does_not_have_follow_from_its_stiffness(tmp_path):
    result = made(tmp_path, blade=small.blade(5, modes=False))
    assert result.data["blade"]["flap_mode"] is None
    assert any("follows from mass and stiffness" in note for note in result.notes)


def test_two_stations_at_one_place_are_a_step(tmp_path):
    text = small.tower(NTwInpSt=4).replace(
        " 1.0000000E+00", " 5.0000000E-01  1000.0  2e10  2e10\n 1.0000000E+00"
    )
    rows = made(tmp_path, tower=text).data["tower"]["stations"]["rows"]
    assert [round(row[0], 4) for row in rows] == [0.0, 0.5, 0.5, 1.0]
    assert rows[1][0] < rows[2][0]


def test_what_the_model_leaves_out_of_a_deck_is_told_with_what_it_means(tmp_path):
    deck = read_deck(small.write(tmp_path, 3, fst=small.fst(3, CompSub=1, CompHydro=1)))
    told = {o.what: o.means for o in omissions(deck, converted(deck, "small").data)}
    for what in (
        "FlapDOF2",
        "DrTrDOF off",
        "CompSub 1",
        "CompHydro",
        "dynamic stall",
        "TwrPotent",
        "TwrAero",
        "AIDrag",
        "PS_Mode",
    ):
        assert any(what in text for text in told), what
    assert not any("yaw (YawDOF" in text for text in told)
    assert all(len(means) > 20 for means in told.values())


@pytest.fixture(scope="module")
def imported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("imported")
    deck = small.write(folder / "deck", AeroBlade=small.aero_blade(BlCrvAC=lambda a: -1.0 * a**2))
    return folder, deck, import_deck(deck, folder / "mine.yaml")


def test_an_imported_turbine_runs_from_its_file_alone(imported):
    from fatigue_runner.api import simulate

    _, _, made = imported
    turbine = load_turbine(made.turbine)
    for wind, operation in ((7.0, "fixed"), (14.0, "controlled")):
        run = simulate(turbine, wind, step=0.02, duration=5.0, operation=operation)
        assert run.diverged_at is None
        assert (
            np.ptp(run.state[:, turbine.layout.rotor_speed]) < 0.02 * run.state[0, turbine.layout.rotor_speed]
        )


def test_the_file_tells_its_deck_and_what_was_decided(imported):
    from fatigue_runner.turbine.file import read_turbine_file

    _folder, deck, made = imported
    data = read_turbine_file(str(made.turbine))
    assert (
        data["deck"]["sha256"]["small_blade.dat"]
        == read_deck_file(deck.parent / "small_blade.dat", "x").sha256
    )
    assert len(data["deck"]["sha256"]) == 11
    assert data["aerodynamics"]["deflection"] > 0
    assert "Decided on the way" in made.turbine.read_text()


def test_nothing_is_overwritten_unless_it_is_asked_for(imported):
    _folder, deck, made = imported
    before = made.turbine.read_bytes()
    with pytest.raises(InputError, match="is there already; give another --out, or --overwrite"):
        import_deck(deck, made.turbine)
    assert made.turbine.read_bytes() == before


@pytest.mark.slow(reason="makes aerodynamic tables")
def test_a_machine_of_some_kilowatts_has_the_steady_rotation_of_a_large_one(tmp_path):
    """The deck at a quarter of its size: in every wind it turns at the same tip-speed ratio but for gravity. A search that starts from a
    large machine's deflections ends in some winds at a third of that, where its blades are stalled."""
    s = 0.25
    lengths = {"TipRad": 32.0, "HubRad": 2.0, "OverHang": -3.5, "NacCMxn": 1.0, "NacCMyn": -0.1, "NacCMzn": 1.0, "Twr2Shft": 1.5,
               "TowerHt": 60.0}  # fmt: skip
    others = {"HubMass": 9e3 * s**3, "NacMass": 4e4 * s**3, "YawBrMass": 1e3 * s**3, "HubIner": 2e4 * s**5, "GenIner": 60 * s**5,
              "NacYIner": 4e5 * s**5, "DTTorSpr": 1e8 * s**3, "DTTorDmp": 1e6 * s**4}  # fmt: skip
    deck = small.write(
        tmp_path / "deck",
        ElastoDyn=small.elastodyn(5, **{name: s * value for name, value in lengths.items()}, **others),
        blade=small.blade(5, AdjBlMs=s**2, AdjFlSt=s**4, AdjEdSt=s**4),
        tower=small.tower(AdjTwMa=s**2, AdjFASt=s**4, AdjSSSt=s**4),
        AeroBlade=small.aero_blade(BlSpn=lambda a: 30 * s * a, BlChord=lambda a: s * (2.4 - 1.6 * a)),
        ServoDyn=small.servodyn(VSContrl=0, PCMode=0),
    )
    turbine = load_turbine(import_deck(deck, tmp_path / "mine.yaml").turbine)
    winds = np.array([5.0, 6.0, 8.0, 10.0, 12.0])
    speeds = [turbine.operating_point(v)[turbine.layout.rotor_speed] for v in winds]
    ratios = np.array(speeds) * turbine.rotor.radius / winds
    assert np.ptp(ratios) < 0.01 * ratios.mean() and ratios.mean() > 6
