"""Readers of full-field wind files, on small files of every format; what is wrong is said in one sentence."""

from __future__ import annotations

import numpy as np
import pytest
from field_files import some_field, write_bladed, write_box, write_bts
from hypothesis import given
from hypothesis import strategies as st

from fatigue_runner.errors import InputError
from fatigue_runner.wind.fields import MannBox, UniformWind, WindField, read_wind
from fatigue_runner.wind.fields.bladed import read_bladed
from fatigue_runner.wind.fields.hawc import read_hawc
from fatigue_runner.wind.fields.turbsim import read_turbsim
from fatigue_runner.wind.fields.uniform import read_uniform
from fatigue_runner.wind.profiles import Logarithmic, PowerLaw

U = some_field()
Y = np.arange(-3, 4) * 10.0
Z = 50.0 + (np.arange(6) - 2.5) * 12.0


def refusal(call, *arguments, **options) -> str:
    """The message of an InputError: one line, ending with the way out."""
    with pytest.raises(InputError) as error:
        call(*arguments, **options)
    message = str(error.value)
    assert "\n" not in message and "; " in message
    return message


# --- TurbSim -----------------------------------------------------------------------------------------------------------


def test_a_bts_file_gives_back_the_field_it_was_written_from(tmp_path):
    found = read_turbsim(write_bts(tmp_path / "a.bts", U))
    assert np.abs(found.u - U).max() < 1e-4  # a 2-byte integer is 0.00013 m/s here
    assert found.y == pytest.approx(Y) and found.z == pytest.approx(Z)
    assert (found.time_step, found.mean_speed, found.reference_height) == (0.25, 9.0, 50.0)
    assert not found.periodic and found.length == 39 * 0.25 and found.notes == ()


def test_tower_points_of_a_bts_file_are_passed_over(tmp_path):
    found = read_turbsim(write_bts(tmp_path / "a.bts", U, tower=4))
    assert np.abs(found.u - U).max() < 1e-4


def test_a_field_starts_half_its_width_downwind_of_the_tower_and_a_periodic_one_at_the_tower(tmp_path):
    once = read_turbsim(write_bts(tmp_path / "a.bts", U))
    again = read_turbsim(write_bts(tmp_path / "b.bts", U, form=8))
    assert once.delay(-5.0) == pytest.approx((30 + 5) / 9)
    assert again.delay(-5.0) == pytest.approx(5 / 9)
    assert again.periodic and again.length == 40 * 0.25


@pytest.mark.parametrize("cut", [-1, -100, -5000, 9])
def test_a_bts_file_of_another_length_than_its_header_says_is_refused(tmp_path, cut):
    path = write_bts(tmp_path / "a.bts", U)
    data = path.read_bytes()
    path.write_bytes(data[:cut] if cut < 0 else data + bytes(cut))
    assert "the header says 40 times of 7 x 6 points" in refusal(read_turbsim, path)


def test_a_bts_file_that_ends_in_its_header_is_refused(tmp_path):
    path = write_bts(tmp_path / "a.bts", U)
    path.write_bytes(path.read_bytes()[:40])
    assert "ends within its header, after 40 bytes" in refusal(read_turbsim, path)


def test_a_big_endian_file_is_told_apart_from_rubbish(tmp_path):
    assert "big-endian" in refusal(read_turbsim, write_bts(tmp_path / "a.bts", U, order=">"))
    assert "big-endian" in refusal(read_bladed, write_bladed(tmp_path / "a.wnd", U, order=">"))
    (tmp_path / "b.bts").write_bytes(bytes(range(200)))
    assert "not a TurbSim .bts file" in refusal(read_turbsim, tmp_path / "b.bts")


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"mean": -9.0}, "the mean wind speed is -9 m/s but must be positive"),
        ({"mean": 0.0}, "the mean wind speed is 0 m/s but must be positive"),
        ({"time_step": 0.0}, "the time step is 0 s but must be positive"),
        ({"mean": 18.0}, "says a mean wind of 18 m/s at 50 m but its field has 9 m/s there"),
        ({"mean": float("nan")}, "the mean wind speed is nan m/s"),
        ({"slope": float("nan")}, "is nan; make the file anew"),
        ({"slope": 0.0}, "the header makes no sense"),
        ({"spacing": (10.0, -12.0)}, "the header makes no sense"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_a_bts_file_with_senseless_numbers_is_refused(tmp_path, options, complaint):
    assert complaint in refusal(read_turbsim, write_bts(tmp_path / "a.bts", U, **options))


def test_a_mean_that_is_a_little_off_is_told(tmp_path):
    found = read_turbsim(write_bts(tmp_path / "a.bts", U, mean=9.5))
    (note,) = found.notes
    assert "mean wind of 9.5 m/s" in note and "has 9 m/s" in note


# --- Bladed ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spectrum", [1, 2, 3, 4, 5, 7, 8, -1, -3])
def test_every_bladed_header_gives_back_the_field_it_was_written_from(tmp_path, spectrum):
    found = read_bladed(write_bladed(tmp_path / "a.wnd", U, spectrum=spectrum))
    assert np.abs(found.u - U).max() < 1e-3  # a thousandth of the standard deviation
    assert found.y == pytest.approx(Y) and found.z == pytest.approx(Z)
    assert found.time_step == pytest.approx(0.25, rel=1e-3)  # the old header has whole millimetres
    assert (found.mean_speed, found.reference_height, found.upstream) == (9.0, 50.0, 30.0)


def test_an_odd_number_of_times_is_read_whole_though_the_header_counts_pairs(tmp_path):
    assert len(read_bladed(write_bladed(tmp_path / "a.wnd", U[:39])).u) == 39


def test_the_summary_says_periodic_and_clockwise_and_how_far_the_grid_is_off_the_hub(tmp_path):
    path = write_bladed(tmp_path / "a.wnd", U, clockwise=True, periodic=True, offset=2.0)
    found = read_bladed(path)
    assert np.abs(found.u - U).max() < 1e-3
    assert found.periodic and found.upstream == 0.0
    assert found.z == pytest.approx(Z - 2.0)


@pytest.mark.parametrize(
    ("said", "complaint"),
    [
        ({"mean": 9.2}, "a mean wind speed of 9.2 m/s, but a.wnd has 9 m/s"),
        ({"intensity": 16.0}, "a turbulence intensity of 16 %, but a.wnd has 15 %"),
        ({"hub": 60.0}, "a hub height of 60 m, but a.wnd has 50 m"),
        ({"ny": 9}, "number of points across of 9, but a.wnd has 7"),
        ({"nz": 9}, "number of points upwards of 9, but a.wnd has 6"),
        ({"step": 0.5}, "a time step of 0.5 s, but a.wnd has 0.25 s"),
    ],
)
def test_a_summary_that_contradicts_its_binary_is_refused_with_file_and_line(tmp_path, said, complaint):
    path = write_bladed(tmp_path / "a.wnd", U, said=said)
    message = refusal(read_bladed, path)
    assert complaint in message and f"{path.with_suffix('.sum')}:" in message and "made together" in message


def test_a_missing_or_incomplete_summary_is_refused(tmp_path):
    path = write_bladed(tmp_path / "a.wnd", U)
    summary = path.with_suffix(".sum")
    lines = summary.read_text().splitlines()
    summary.write_text("\n".join(line for line in lines if "TI(u)" not in line))
    assert "no line says 'TI(u)'" in refusal(read_bladed, path)
    summary.write_text("\n".join(line.replace("9.0000", "nine") for line in lines))
    assert f"{summary}:11: a number was expected, got 'nine m/s'" in refusal(read_bladed, path)
    summary.unlink()
    assert "stands in a.sum, which is missing" in refusal(read_bladed, path)


def test_a_bladed_binary_that_was_cut_off_is_refused(tmp_path):
    path = write_bladed(tmp_path / "a.wnd", U)
    path.write_bytes(path.read_bytes()[:-3])
    assert "the header says 40 or 41 times" in refusal(read_bladed, path)
    path.write_bytes(path.read_bytes()[:-3000])
    assert "the file holds" in refusal(read_bladed, path)


# --- HAWC2 -------------------------------------------------------------------------------------------------------------

FLUCTUATION = some_field(mean=0.0)
BOX = MannBox(9.0, 50.0, points=(40, 7, 6), spacing=(2.25, 10.0, 12.0))


def test_a_mann_box_as_it_is_gets_its_mean_wind(tmp_path):
    found = read_hawc(write_box(tmp_path / "u.bin", FLUCTUATION), BOX)
    assert np.abs(found.u - 9.0 - FLUCTUATION).max() < 1e-5
    assert found.time_step == 0.25 and found.periodic and found.length == 10.0
    assert found.y == pytest.approx(Y) and found.z == pytest.approx(Z)


def test_a_mann_box_is_scaled_as_openfast_does(tmp_path):
    path = write_box(tmp_path / "u.bin", FLUCTUATION + 0.5)  # each point's own mean goes away first
    by_factor = read_hawc(path, MannBox(9.0, 50.0, BOX.points, BOX.spacing, scale=2.0)).u
    assert np.abs(by_factor - 9.0 - 2 * FLUCTUATION).max() < 1e-5
    to_sigma = read_hawc(path, MannBox(9.0, 50.0, BOX.points, BOX.spacing, sigma=1.5)).u
    assert to_sigma[:, 3, 2].std() == pytest.approx(1.5, rel=1e-5)


@pytest.mark.parametrize("profile", [PowerLaw(0.2), Logarithmic(0.03)])
def test_a_mann_box_gets_the_mean_profile_around_its_middle(tmp_path, profile):
    path = write_box(tmp_path / "u.bin", FLUCTUATION)
    found = read_hawc(path, MannBox(9.0, 50.0, BOX.points, BOX.spacing, profile=profile))
    assert found.u.mean(axis=(0, 1)) == pytest.approx(9.0 * profile.factor(Z, 50.0), rel=1e-5)


def test_a_hawc_file_or_an_htc_says_the_sizes(tmp_path):
    write_box(tmp_path / "small-u.bin", FLUCTUATION)
    lines = ["; made for a test", "begin mann;", "  filename_u small-u.bin ;", "  filename_v v.bin ;"]
    lines += ["box_dim_u 40 2.25 ;", "box_dim_v 7 10.0;", "box_dim_w 6 12.0 ; comment", "end mann;"]
    described = tmp_path / "small.hawc"
    described.write_text("\n".join(lines))
    found = read_wind(described, hub_height=50, rotor_diameter=60, box=MannBox(9.0, 50.0))
    assert isinstance(found, WindField) and np.abs(found.u - 9.0 - FLUCTUATION).max() < 1e-5
    other = MannBox(9.0, 50.0, points=(20, 7, 6))
    assert "but (20, 7, 6) are asked for" in refusal(read_hawc, described, other)
    described.write_text("\n".join(lines[:5]))
    assert "no line says box_dim_v" in refusal(read_hawc, described, MannBox(9.0, 50.0))
    described.write_text("\n".join([*lines, "box_dim_u many 2.0;"]))
    assert "a number of points and a spacing" in refusal(read_hawc, described, MannBox(9.0, 50.0))


def test_a_mann_box_of_other_size_order_or_with_nan_is_refused(tmp_path):
    path = write_box(tmp_path / "u.bin", FLUCTUATION)
    assert "has 6400 bytes, but the file has 6720" in refusal(
        read_hawc, path, MannBox(9.0, 50.0, points=(40, 8, 5), spacing=(1.0, 1.0, 1.0))
    )
    assert "does not say its size" in refusal(read_hawc, path, MannBox(9.0, 50.0))
    assert "big-endian" in refusal(read_hawc, write_box(path, FLUCTUATION, order=">"), BOX)
    broken = FLUCTUATION.copy()
    broken[7, 2, 3] = np.nan
    assert "sample 7, y -10 m, z 56 m is nan" in refusal(read_hawc, write_box(path, broken), BOX)
    still = MannBox(9.0, 50.0, BOX.points, BOX.spacing, sigma=1.0)
    assert "has no turbulence" in refusal(read_hawc, write_box(path, 0 * FLUCTUATION), still)
    low = MannBox(9.0, 25.0, BOX.points, BOX.spacing)
    assert "reaches into the ground" in refusal(read_hawc, path, low)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"mean_speed": 0.0}, "mean_speed must be a number above 0 m/s"),
        ({"reference_height": -1.0}, "reference_height must be a number above 0 m"),
        ({"points": (4, 5)}, "points must be three positive numbers"),
        ({"spacing": (1.0, 0.0, 1.0)}, "spacing must be three positive numbers"),
        ({"scale": 1.0, "sigma": 1.0}, "a scale or a sigma, not both"),
        ({"sigma": -1.0}, "sigma must be a number at least 0"),
    ],
)
def test_a_mann_box_described_wrongly_is_refused(options, complaint):
    with pytest.raises(InputError, match=complaint):
        MannBox(**{"mean_speed": 9.0, "reference_height": 50.0} | options)


# --- uniform wind ------------------------------------------------------------------------------------------------------

LINES = """! a comment
!  Time  Speed Dir Vert HShr VShr LnShr Gust
  0.0    8.0   350  0.5  0.1  0.2  0.05  0.0
  1.0,  10.0,  10,  0.5, 0.1, 0.2, 0.05, 1.0   # commas, too
  2.0   10.0   10   0.5  0.1  0.2  0.05  1.0
"""


def uniform(tmp_path, text=LINES, name="a.wnd"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_uniform_wind_is_that_of_its_formula(tmp_path):
    wind = read_uniform(uniform(tmp_path), 90.0, 126.0)
    y, z = 20.0, 120.0
    start = 8.0 * ((z / 90) ** 0.2 + (0.1 * y * np.cos(np.radians(350)) + 0.05 * (z - 90)) / 126)
    end = 10.0 * ((z / 90) ** 0.2 + (0.1 * y * np.cos(np.radians(10)) + 0.05 * (z - 90)) / 126) + 1
    found = wind.longitudinal(np.array([-1.0, 0.0, 2.0, 9.0]), 0.0, y, z)
    first, last = start * np.cos(np.radians(350)), end * np.cos(np.radians(10))
    assert found == pytest.approx([first, first, last, last])


def test_uniform_wind_turns_through_north_and_not_all_the_way_round(tmp_path):
    wind = read_uniform(uniform(tmp_path), 90.0, 126.0)
    assert wind.at(np.array([0.5]))[0, 1] % (2 * np.pi) == pytest.approx(0.0, abs=1e-9)


def test_upflow_is_a_ninth_column(tmp_path):
    text = "0 8 0 1.0 0 0 0 0 10\n1 8 0 1.0 0 0 0 0 10\n"
    wind = read_uniform(uniform(tmp_path, text), 90.0, 126.0)
    expected = 8 * np.cos(np.radians(10)) - 1 * np.sin(np.radians(10))
    assert wind.longitudinal(np.array([0.5]), 0.0, 0.0, 50.0) == pytest.approx(expected)


def test_the_mean_of_uniform_wind_is_weighted_by_time(tmp_path):
    assert read_uniform(uniform(tmp_path), 90.0, 126.0).mean_speed == pytest.approx((9.5 + 11.0) / 2)
    assert read_uniform(uniform(tmp_path, "0 8 0 0 0 0 0 0"), 90.0, 126.0).mean_speed == 8.0


def test_a_late_beginning_of_uniform_wind_is_told(tmp_path):
    wind = read_uniform(uniform(tmp_path, "5 8 0 0 0 0 0 0\n6 8 0 0 0 0 0 0"), 90.0, 126.0)
    assert "begins at 5 s" in wind.notes[0]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (LINES.replace("10.0   10", "10.O   10"), ":5: the horizontal speed is '10.O'"),
        (LINES.replace("2.0   10.0", "2.0   nan"), ":5: the horizontal speed is nan"),
        (LINES.replace("  2.0", "  0.5"), ":5: time 0.5 s is not after 1 s"),
        (LINES + "3.0 8.0 0 0\n", ":6: 4 numbers"),
        (LINES.replace("0.2  0.05  0.0", "2.0  0.05  0.0"), ":3: the power-law exponent is 2"),
        ("0 -8 0 0 0 0 0 0\n", "the mean wind speed is -8 m/s"),
        ("! nothing\n", "no line of numbers"),
    ],
)
def test_uniform_wind_that_cannot_be_is_refused_with_its_line(tmp_path, text, complaint):
    with pytest.raises(InputError) as error:
        read_uniform(uniform(tmp_path, text), 90.0, 126.0)
    assert complaint in str(error.value) and str(tmp_path / "a.wnd") in str(error.value)


@given(
    st.lists(
        st.tuples(
            st.floats(0.1, 50), *[st.floats(-50, 50)] * 2, *[st.floats(-0.9, 0.9)] * 3, st.floats(0, 9)
        ),
        min_size=1,
        max_size=8,
    )
)
def test_uniform_wind_reads_whatever_numbers_are_written(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("uniform") / "a.hh"
    path.write_text("\n".join(" ".join(map(repr, (float(i), *row))) for i, row in enumerate(rows)))
    wind = read_uniform(path, 90.0, 126.0)
    expected = np.array(rows)
    assert wind.values[:, [0, 2, 3, 4, 5, 6]] == pytest.approx(expected[:, [0, 2, 3, 4, 5, 6]])
    assert np.degrees(wind.values[:, 1]) == pytest.approx(expected[:, 1])  # no turn of 180 degrees or more


# --- telling them apart ------------------------------------------------------------------------------------------------


def read(path, **options):
    return read_wind(path, hub_height=50.0, rotor_diameter=60.0, **options)


def test_formats_are_told_by_ending_and_a_wnd_by_its_bytes(tmp_path):
    assert isinstance(read(write_bts(tmp_path / "A.BTS", U)), WindField)
    assert isinstance(read(write_bladed(tmp_path / "a.wnd", U)), WindField)
    assert isinstance(read(write_box(tmp_path / "u.bin", FLUCTUATION), box=BOX), WindField)
    assert isinstance(read(uniform(tmp_path, name="b.wnd")), UniformWind)
    assert isinstance(read(uniform(tmp_path, name="b.hh")), UniformWind)


def test_what_is_no_wind_file_is_refused(tmp_path):
    path = tmp_path / "a.bts"
    assert "no such wind file" in refusal(read, path)
    path.write_bytes(b"")
    assert "is empty" in refusal(read, path)
    path.write_bytes(b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")
    assert "Git LFS pointer" in refusal(read, path)
    assert "unknown wind file format '.btz'; did you mean '.bts'?" in refusal(read, tmp_path / "a.btz")
    (tmp_path / "b.bts").mkdir()
    assert "cannot be read" in refusal(read, tmp_path / "b.bts")
    (tmp_path / "c.hh").write_bytes(b"1 2\0 3")
    assert "text file was expected" in refusal(read, tmp_path / "c.hh")


def test_a_mann_box_needs_its_description_and_others_need_none(tmp_path):
    assert "needs its mean wind speed" in refusal(read, write_box(tmp_path / "u.bin", FLUCTUATION))
    assert "leave out those of a Mann box" in refusal(read, write_bts(tmp_path / "a.bts", U), box=BOX)


def test_another_mean_than_the_file_has_is_refused(tmp_path):
    path = write_bts(tmp_path / "a.bts", U)
    assert read(path, mean_speed=9.05).mean_speed == 9.0
    assert "has a mean wind speed of 9 m/s, but 10 m/s is asked for" in refusal(read, path, mean_speed=10.0)


def test_a_grid_of_one_line_is_no_field(tmp_path):
    assert "40 times on 1 x 6 points" in refusal(read, write_bts(tmp_path / "a.bts", U[:, 3:4]))
