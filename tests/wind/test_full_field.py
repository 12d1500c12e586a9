"""A file's wind as a source: every format on a turbine's rotor, from the API and from a campaign; what is wrong is told with its place."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from field_files import some_field, write_bladed, write_box, write_bts

from fatigue_runner import cli
from fatigue_runner.errors import InputError
from fatigue_runner.rotor import Rotor
from fatigue_runner.wind import FullFieldWind, make_wind
from fatigue_runner.wind.fields import read_wind
from fatigue_runner.wind.mean_shear import mean_signals
from fatigue_runner.wind.profiles import Logarithmic, PowerLaw, profile_disc_fit

ROTOR = Rotor(20.0, 50.0)
WIDE = {"spacing": (10.0, 10.0), "mean": 9.0, "hub": 50.0}
U = some_field(80, 7, 7)


def bts(folder: Path, name="a.bts", u=U, **options) -> Path:
    return write_bts(folder / name, u, **(WIDE | options))


def uniform(path: Path, *rows: str) -> Path:
    path.write_text("! time speed direction vertical across exponent linear gust upflow\n" + "\n".join(rows))
    return path


@pytest.fixture
def call(tmp_path, monkeypatch, capfd):
    """call(wind, **campaign) -> (exit code, what was printed as an error without the folder) of `fatigue-runner run`."""

    def of(wind: str, turbine: str = "nrel5mw", duration: float = 4.0, step: float = 0.05) -> tuple[int, str]:
        monkeypatch.chdir(tmp_path)
        (tmp_path / "c.yaml").write_text(
            f"name: a\nturbine: {turbine}\nduration: {duration}\nreference: null\nlog: {{enabled: false}}\nworkers: 1\n"
            f"integrators: [{{method: rk4, step: {step}}}]\nwind:\n  type: full-field\n{wind}\n"
        )
        monkeypatch.setattr(sys, "argv", ["fatigue-runner", "run", "c.yaml", "--out", str(tmp_path / "out")])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return ended.value.code, capfd.readouterr().err.replace(f"{tmp_path}/", "")

    return of


# --- what blows ----------------------------------------------------------------------------------------------------------


def test_the_plane_over_the_disc_stands_for_one_harmonic_and_its_mean_for_none(tmp_path):
    path = bts(tmp_path)
    six, one, none = (
        FullFieldWind(path, harmonics=m).on(ROTOR).at(np.arange(0, 10, 0.25)) for m in (6, 1, 0)
    )
    assert six.shape[1] == 15 and one.shape == none.shape == (40, 3)
    for fewer in (one, none):  # projected in single precision
        assert fewer[:, 0] == pytest.approx(six[:, 0], rel=1e-6)
    assert not none[:, 1:].any() and one[:, 1:].std(axis=0).min() > 0.01


def test_the_first_harmonic_is_the_same_whatever_part_of_it_is_linear(tmp_path):
    """The mean's slope acts linear along the blade, the rest all along it; together they are the projection's."""
    wind = FullFieldWind(bts(tmp_path, u=U + np.linspace(-1, 1, 7)), harmonics=3).on(ROTOR)
    signals, found = wind.at(np.arange(0, 10, 0.25)), wind._found.harmonics.sampled(10.0)[0][:40]
    radius = 0.75  # of r^2: int rho^3 / int rho^2
    assert signals[:, 3] + signals[:, 0] * signals[:, 1] * radius == pytest.approx(found[:, 1], abs=2e-3)
    assert signals[:, 4] - signals[:, 0] * signals[:, 2] * radius == pytest.approx(found[:, 2], abs=2e-3)


def test_the_same_field_is_the_same_wind_in_every_format(tmp_path):
    fluctuation = U - 9.0
    (tmp_path / "u.hawc").write_text(
        "begin mann ;\n filename_u u.bin ;\n box_dim_u 80 2.25 ;\n box_dim_v 7 10 ;\n box_dim_w 7 10 ;\n"
    )
    write_box(tmp_path / "u.bin", fluctuation)
    described = FullFieldWind(tmp_path / "u.hawc", mean_speed=9.0)
    given = FullFieldWind(
        tmp_path / "u.bin", mean_speed=9.0, box={"points": (80, 7, 7), "spacing": (2.25, 10.0, 10.0)}
    )
    periodic = FullFieldWind(bts(tmp_path, form=8))
    bladed = FullFieldWind(
        write_bladed(tmp_path / "a.wnd", U, spacing=(10.0, 10.0), periodic=True, hub=50.0, intensity=15.0)
    )
    expected, time = described.on(ROTOR).at(np.arange(0, 20, 0.1)), np.arange(0, 20, 0.1)
    for wind, error in ((given, 0.0), (periodic, 2e-4), (bladed, 2e-3)):
        assert wind.on(ROTOR).at(time) == pytest.approx(expected, abs=error)


@pytest.mark.parametrize(
    ("key", "value", "profile"),
    [("shear_exponent", 0.2, PowerLaw(0.2)), ("roughness_length", 0.03, Logarithmic(0.03))],
)
def test_a_still_box_blows_as_its_mean_profile(tmp_path, key, value, profile):
    write_box(tmp_path / "u.bin", np.zeros((80, 7, 7)) + 1e-6)
    box = {"points": [80, 7, 7], "spacing": [2.25, 10.0, 10.0]}
    wind = FullFieldWind(tmp_path / "u.bin", mean_speed=9.0, box=box, **{key: value}).on(ROTOR)
    steady = mean_signals(profile, 9.0, ROTOR, 6)
    # of the slope, that of the disc and not the blades' part is linear: 3 and 4 have the rest
    assert wind.at([0.0, 7.0])[:, [0, 1, 2]] == pytest.approx(np.tile(steady[:3], (2, 1)), rel=0.02, abs=1e-5)
    assert wind.at([3.0])[0, 5:] == pytest.approx(steady[5:], abs=2e-5)


def test_uniform_wind_is_piecewise_linear_and_its_last_line_holds_on(tmp_path):
    path = uniform(tmp_path / "a.wnd", "0 8 0 0 0 0 0 0", "10 8 0 0 0 0 0 0", "10.5 12 0 0 0.1 0.2 0 0")
    wind = FullFieldWind(path, harmonics=4).on(ROTOR)
    assert wind.length == np.inf and wind.mean_speed == pytest.approx(
        read_wind(path, hub_height=50, rotor_diameter=40).mean_speed
    )
    at = wind.at([0.0, 10.0, 10.25, 10.5, 300.0])
    assert at[:, 0] == pytest.approx([8, 8, 10 - 0.005, 12 - 0.02, 12 - 0.02], abs=0.02)
    assert at[4] == pytest.approx(at[3], abs=1e-9)
    # 0.1 over the diameter to the left: kappa_h = 0.1 R/D; nothing of a linear shear acts along the whole blade
    assert at[4, 2] == pytest.approx(0.05 * 12 / at[4, 0]) and abs(at[4, 4]) < 1e-9
    assert at[4, 5] == pytest.approx(mean_signals(PowerLaw(0.2), 12.0, ROTOR, 4)[5], rel=1e-6)


def test_a_step_in_uniform_wind_is_not_overshot(tmp_path):
    rows = ["0 8 0 0 0 0 0 0", "20 8 0 0 0 0 0 0", "20.05 0.5 0 0 0 0 0 0", "60 0.5 0 0 0 0 0 0"]
    wind = FullFieldWind(uniform(tmp_path / "a.hh", *rows)).on(ROTOR)
    assert wind.at(np.arange(0, 60, 0.005))[:, 0].min() == pytest.approx(0.5) and wind.lowest_speed[0] > 0.49


def test_uniform_wind_from_aside_and_from_below_blows_across_as_inflowwind_has_it(tmp_path):
    """UniformField_GetVel of OpenFAST's IfW_FlowField: first the upflow, then the direction."""
    row = "10 20 2 0 0.2 0 0.5 5"  # speed, direction, vertical, two shears around an exponent, gust, upflow
    wind = FullFieldWind(uniform(tmp_path / "a.hh", f"0 {row}", f"9 {row}"), harmonics=2).on(ROTOR)
    (signals,) = wind.at([5.0])
    assert [c.name for c in wind.channels[3:5]] == ["lateral_wind", "vertical_wind"]
    turned, up = np.radians(20), np.radians(5)
    whole = 0.5 + 10 * profile_disc_fit(PowerLaw(0.2), ROTOR.hub_height, ROTOR.radius)[0]
    level = np.cos(up) * whole - np.sin(up) * 2
    expected = level * np.cos(turned), -level * np.sin(turned), np.sin(up) * whole + np.cos(up) * 2
    assert signals[[0, 3, 4]] == pytest.approx(expected, rel=1e-9)
    assert wind.notes == ()


def test_a_uniform_wind_that_turns_far_is_told_and_one_straight_on_has_no_wind_across(tmp_path):
    wind = FullFieldWind(uniform(tmp_path / "a.hh", "0 10 0 0 0 0 0 0", "9 10 40 0 0 0 0 0"))
    (note,) = wind.on(ROTOR).notes
    assert "turns the wind by up to 40 degrees" in note and "does not follow" in note
    straight = FullFieldWind(uniform(tmp_path / "b.hh", "0 10 0 0 0 0 0 0", "9 10 0 0 0 0 0 0")).on(ROTOR)
    assert "lateral_wind" not in [c.name for c in straight.channels]


def test_a_file_that_was_made_anew_is_read_anew_and_hashed_with_what_lies_beside_it(tmp_path):
    from fatigue_runner.wind.fields.on_rotor import content

    path = write_bladed(tmp_path / "a.wnd", U, spacing=(10.0, 10.0), hub=50.0)
    before, digest = FullFieldWind(path).on(ROTOR).at([2.0]), content(path)
    summary = path.with_suffix(".sum")
    summary.write_text(summary.read_text().replace("F  Clockwise", "T  Clockwise"))
    assert content(path) != digest
    assert not np.array_equal(FullFieldWind(path).on(ROTOR).at([2.0]), before)


def test_a_box_given_as_mapping_or_as_pairs_is_one_parameter(tmp_path):
    pairs = (("points", (80, 7, 7)), ("spacing", (2.25, 10.0, 10.0)))
    write_box(tmp_path / "u.bin", U - 9.0)
    made = make_wind("full-field", path=str(tmp_path / "u.bin"), mean_speed=9.0, box=pairs)
    assert made == FullFieldWind(tmp_path / "u.bin", mean_speed=9.0, box=dict(pairs))
    with pytest.raises(InputError, match="unknown key 'point' of a Mann box; did you mean 'points'"):
        FullFieldWind(tmp_path / "u.bin", mean_speed=9.0, box={"point": 3}).on(ROTOR).at([0.0])


# --- a campaign runs on it, and says what is wrong -------------------------------------------------------------------------

LARGE = {"spacing": (10.0, 10.0), "hub": 90.0, "mean": 9.0}
BIG = some_field(80, 15, 15)


def test_a_campaign_runs_on_a_field(call, tmp_path):
    write_bts(tmp_path / "a.bts", BIG, **LARGE)
    assert call("  files: a.bts\n  mean_speed: 9.0") == (0, "")


def test_a_campaign_runs_on_a_mann_box_and_on_uniform_wind(call, tmp_path):
    write_box(tmp_path / "u.bin", BIG - 9.0)
    uniform(tmp_path / "b.hh", "0 8 0 0 0 0.2 0 0", "2 9 0 0 0 0.2 0 0")
    box = "  mean_speed: 9\n  shear_exponent: 0.1\n  box: {points: [80, 15, 15], spacing: [2.25, 10, 10]}"
    assert call(f"  files: u.bin\n{box}") == (0, "")
    assert call("  files: b.hh\n  harmonics: 2") == (0, "")


def swapped(folder):
    write_bts(folder / "a.bts", BIG, **LARGE, order=">")


def cut(folder):
    path = write_bts(folder / "a.bts", BIG, **LARGE)
    path.write_bytes(path.read_bytes()[:-999])


def with_nan(folder):
    u = BIG.copy()
    u[5, 3, 2] = np.nan
    write_box(folder / "u.bin", u - 9.0)


def still(folder):
    uniform(folder / "a.hh", "0 -8 0 0 0 0 0 0", "9 -8 0 0 0 0 0 0")


def contradicting(folder):
    write_bladed(folder / "a.wnd", BIG, spacing=(10.0, 10.0), hub=90.0, said={"mean": 11.0})


def shifted(folder):
    write_bts(folder / "a.bts", BIG, **(LARGE | {"hub": 80.0}), base=20.0)


def narrow(folder):
    write_bts(folder / "a.bts", some_field(80, 5, 15), **LARGE)


def plain(folder):
    write_bts(folder / "a.bts", BIG, **LARGE)


def nothing(folder):
    (folder / "a.grib").write_bytes(b"GRIB")


def no_lines(folder):
    (folder / "a.hh").write_text("! only words\n")


BOX = "  files: u.bin\n  mean_speed: 9\n  box: {points: [80, 15, 15], spacing: [2.25, 10, 10]}"


@pytest.mark.parametrize(
    ("made", "wind", "message"),
    [
        (nothing, "  files: a.grib", "c.yaml:10: a.grib: unknown wind file format '.grib'"),
        (plain, "  files: b.bts", "c.yaml:10: wind file 'b.bts' cannot be read (No such file or directory)"),
        (cut, "  files: a.bts", "c.yaml:10: a.bts: the header says 80 times"),
        (with_nan, BOX, "c.yaml:10: u.bin: the wind at sample 5"),
        (swapped, "  files: a.bts", "c.yaml:10: a.bts: the bytes of this TurbSim file stand in big-endian order"),
        (still, "  files: a.hh", "c.yaml:10: a.hh: the mean wind speed is -8 m/s; it must be positive"),
        (no_lines, "  files: a.hh", "c.yaml:10: a.hh: no line of numbers"),
        (contradicting, "  files: a.wnd", "c.yaml:10: a.sum:11: the summary says a mean wind speed of 11 m/s, but a.wnd has 9"),
        (shifted, "  files: a.bts", "c.yaml:10: a.bts: the field was made for a hub at 80 m, but the turbine's is at 90"),
        (narrow, "  files: a.bts", "c.yaml:10: a.bts: the grid reaches from 20 to 160 m above ground and -20 to 20 m sideways"),
        (plain, "  files: a.bts\n  mean_speed: 11", "c.yaml:10: a.bts: the field has a mean wind speed of 9 m/s, but 11 m/s is asked"),
        (plain, "  files: a.bts\n  mean_speed: -8", "c.yaml:11: wind.mean_speed must be above 0"),
        (plain, "  files: a.bts\n  harmonics: -1", "c.yaml:11: wind.harmonics must be at least 0"),
        (plain, "  files: a.bts\n  harmonics: 17", "c.yaml:11: wind.harmonics must be at most 16"),
        (plain, "  files: a.bts\n  shear_exponent: 0.2", "c.yaml:10: a.bts: a shear can be given for a Mann box only"),
        (with_nan, "  files: u.bin", "c.yaml:10: u.bin: a Mann box does not say its mean wind speed"),
        (with_nan, "  files: u.bin\n  mean_speed: 9", "c.yaml:10: u.bin: a Mann box does not say its size"),
        (with_nan, BOX.replace("80", "81"), "c.yaml:10: u.bin: a box of 81 x 15 x 15 points has 72900 bytes, but the file has 72000"),
        (with_nan, BOX.replace("[80, 15, 15]", "[80, 15]"), "c.yaml:12: wind.box.points must hold at least 3"),
        (with_nan, BOX.replace("[80,", "[-80,"), "c.yaml:12: wind.box.points: must be three positive numbers"),
        (with_nan, BOX.replace("points", "point"), "c.yaml:12: unknown key 'point' in wind.box; did you mean 'points'?"),
        (plain, "  files: a.bts\n  roughness_length: 0.1\n  shear_exponent: 0.2", "c.yaml:11: wind.roughness_length: stands beside"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_file_is_told_with_the_campaigns_line(call, tmp_path, made, wind, message):
    made(tmp_path)
    code, told = call(wind)
    assert code == 2 and told.count("\n") == 1
    assert told.removeprefix("error: ").startswith(message)


def test_a_field_shorter_than_the_run_is_refused(call, tmp_path):
    plain(tmp_path)
    code, told = call("  files: a.bts", duration=40)
    assert code == 2
    assert "c.yaml:10: the wind field-a is 10.6667 s long" in told and "the campaign runs 40 s" in told


def test_a_step_too_long_for_the_harmonics_is_refused_with_the_integrators_line(call, tmp_path):
    plain(tmp_path)
    code, told = call("  files: a.bts\n  harmonics: 16", step=0.2)
    assert code == 2
    assert (
        told.startswith("error: c.yaml:7: wind field-a has 16 azimuthal harmonics")
        and "a step of at most" in told
    )
