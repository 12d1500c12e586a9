"""Wind sources: the contract that every source keeps, steps, splines, files, and the cells of a block."""

import pickle
import re
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from fatigue_runner.errors import InputError
from fatigue_runner.wind import (
    SOURCES,
    ConstantWind,
    SeriesWind,
    StepWind,
    TurbulentWind,
    make_wind,
    read_wind_file,
    stack_cells,
)
from fatigue_runner.wind.cells import minimum
from fatigue_runner.wind.series import periodic_cubics

KINDS = {kind: source for kind, source in SOURCES.items() if hasattr(source, "example")}
every_source = pytest.mark.parametrize("kind", KINDS)

# The contract


def test_the_folder_registers_its_sources():
    assert {"constant", "steps", "series", "turbulent", "file"} <= set(SOURCES)


@every_source
def test_signals_are_the_cells_cubics(kind):
    source = KINDS[kind].example()
    h, c = source.cells(10.0)
    assert c.shape[1:] == (4, source.signals) and np.isfinite(c).all()
    assert len(c) * h >= 10.0 > (len(c) - 1) * h
    for t in (0.0, 0.37, 4.99, 9.81):
        i = min(int(t / h), len(c) - 1)
        u = t - i * h
        assert source.at(t)[0] == pytest.approx(((c[i, 3] * u + c[i, 2]) * u + c[i, 1]) * u + c[i, 0])


@every_source
def test_a_shorter_run_sees_the_same_bits(kind):
    source = KINDS[kind].example()
    short, whole = source.cells(5.0)[1], source.cells(10.0)[1]
    assert np.array_equal(short, whole[: len(short)])


@every_source
def test_the_cell_key_says_which_sources_share_a_grid(kind):
    source = KINDS[kind].example()
    h, c = source.cells(10.0)
    assert source.cell_key == (h if len(c) > 1 else None)
    assert hash(source.cell_key) == hash(pickle.loads(pickle.dumps(source)).cell_key)


@every_source
def test_a_worker_gets_the_same_wind(kind):
    source = KINDS[kind].example()
    assert np.array_equal(pickle.loads(pickle.dumps(source)).cells(10.0)[1], source.cells(10.0)[1])


@every_source
def test_label_and_name_are_fit_for_tables_and_files(kind):
    source = KINDS[kind].example()
    # of a wind around another one the table says what blows
    assert source.label["wind_source"] == getattr(source, "wind", source).kind
    assert source.label["wind_speed"] == source.mean_speed
    assert {"vertical_shear", "horizontal_shear"} <= set(source.label)
    assert all(isinstance(value, str | int | float | bool | None) for value in source.label.values())
    assert re.fullmatch(r"[\w.+-]+", source.name)


@every_source
def test_the_lowest_speed_is_that_of_the_series(kind):
    source = KINDS[kind].example()
    time = np.linspace(0, min(source.length, 60.0), 20001)
    lowest, when = source.lowest_speed
    assert lowest == pytest.approx(source.at(time)[:, 0].min(), abs=1e-5)
    assert source.at(min(when, source.length))[0, 0] == pytest.approx(lowest)


@every_source
def test_times_before_zero_and_durations_of_zero_are_refused(kind):
    source = KINDS[kind].example()
    with pytest.raises(InputError, match="before 0 s"):
        source.at([1.0, -0.1])
    with pytest.raises(InputError, match="duration must be a number above 0 s"):
        source.cells(0.0)
    assert source.at([]).shape == (0, source.signals)


def test_importing_the_winds_does_not_import_scipy():
    code = "import sys, fatigue_runner.wind; print([m for m in sys.modules if m.split('.')[0] == 'scipy'])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


# By kind and parameters


def test_a_wind_is_made_from_its_kind_and_parameters():
    assert make_wind("constant", speed=8, vertical_shear=0.1) == ConstantWind(8.0, 0.1)
    assert make_wind("turbulent", mean=8.0, intensity=0.1, seed=2) == TurbulentWind(8.0, 0.1, seed=2)


@pytest.mark.parametrize(
    ("kind", "parameters", "message"),
    [
        ("turbulence", {}, "unknown wind source 'turbulence'; did you mean 'turbulent'"),
        (["constant"], {}, "unknown wind source"),
        ("constant", {"sped": 8.0}, "unknown parameter 'sped' of constant wind; did you mean 'speed'"),
        ("turbulent", {"intensity": 0.1}, "turbulent wind needs 'mean'"),
        ("file", {}, "file wind needs 'path'"),
    ],
)
def test_an_unknown_kind_or_parameter_is_refused_with_the_nearest(kind, parameters, message):
    with pytest.raises(InputError, match=message):
        make_wind(kind, **parameters)


# Constant and stepwise


def test_constant_wind_is_constant():
    signals = ConstantWind(8.0, 0.14, -0.05).at([0.0, 3.0, 1e4])
    assert np.array_equal(signals, np.tile([8.0, 0.14, -0.05], (3, 1)))


@pytest.mark.parametrize("speed", [0.0, -8.0, float("nan"), float("inf"), "fast", True, None])
def test_constant_wind_refuses_a_speed_that_is_not_positive(speed):
    with pytest.raises(InputError, match="speed must be a number above 0 m/s"):
        ConstantWind(speed)


def test_constant_wind_refuses_a_shear_that_is_not_finite():
    with pytest.raises(
        InputError, match="vertical_shear must be a number at least -1 and at most 1, got nan"
    ):
        ConstantWind(8.0, float("nan"))


def test_a_step_holds_until_the_next_and_the_last_for_ever():
    source = StepWind([0.0, 0.3, 1.2], [8.0, 10.0, 6.0])
    assert source.cell_key == 0.3
    assert source.at([0.0, 0.29, 0.3, 1.1, 1.2, 500.0])[:, 0].tolist() == [8.0, 8.0, 10.0, 10.0, 6.0, 6.0]


def test_a_single_step_is_constant_wind():
    source = StepWind([0.0], [[8.0, 0.1, 0.2]])
    assert source.cell_key is None
    assert np.array_equal(source.cells(20.0)[1], ConstantWind(8.0, 0.1, 0.2).cells(20.0)[1])


@settings(deadline=None)
@given(
    st.lists(st.integers(1, 400), min_size=1, max_size=6),
    st.integers(1, 50),
    st.lists(st.floats(0.5, 30.0), min_size=7, max_size=7),
)
def test_cells_reproduce_every_step_exactly(increments, grid, speeds):
    times = np.concatenate([[0], np.cumsum(increments)]) * grid / 1000  # multiples of `grid` milliseconds
    source = StepWind(times, speeds[: len(times)])
    assert source.cell_key * 1000 % grid == pytest.approx(0, abs=1e-6) or len(increments) == 1
    assert source.at(times)[:, 0].tolist() == speeds[: len(times)]
    before = times[1:] - 1e-4
    assert source.at(before)[:, 0].tolist() == speeds[: len(times) - 1]


@pytest.mark.parametrize(
    ("times", "values", "message"),
    [
        ([0.0, 5.0, 3.0], [8.0, 9.0, 10.0], r"time 2 \(3 s\) is not after time 1 \(5 s\); sort them"),
        ([0.0, 5.0, 5.0], [8.0, 9.0, 10.0], "times must rise"),
        ([1.0, 5.0], [8.0, 9.0], "first time is 1 s; it must be 0"),
        ([0.0, 1 / 3], [8.0, 9.0], "not a whole number of milliseconds.*to 0.333 s"),
        ([0.0, float("nan")], [8.0, 9.0], "time 1 is nan"),
        ([0.0, "soon"], [8.0, 9.0], "times must be numbers"),
        ([], [], "values have shape"),
        ([0.0, 1.0], [8.0], "2 times but 1 values"),
        ([0.0, 1.0], [8.0, -1.0], "wind_speed of sample 1 is -1 m/s"),
        ([0.0, 1.0], [[8.0, 0.0, 0.0], [9.0, float("nan"), 0.0]], "vertical_shear of sample 1 is nan"),
        ([0.0, 1.0], [[8.0, 0.0], [9.0, 0.0]], r"shape \(2, 2\); give one row per sample"),
        ([0.0, 1.0], [[8.0], [9.0, 0.0]], "values must be numbers"),
    ],
)
def test_wrong_steps_are_refused_with_their_place(times, values, message):
    with pytest.raises(InputError, match=message):
        StepWind(times, values)


# Smooth series


def test_a_series_passes_through_its_samples_and_reproduces_a_cubic():
    def cubic(t):
        return np.stack([8 + 0.1 * t - 0.02 * t**2 + 0.001 * t**3, 0.1 + 0 * t, 0.005 * t**3], axis=1)

    source = SeriesWind(0.5, cubic(np.arange(12) * 0.5))
    fine = np.linspace(0, 5.5, 111)
    assert source.at(fine) == pytest.approx(cubic(fine), abs=1e-12)


@pytest.mark.parametrize("samples", [2, 3, 4])
def test_a_few_samples_already_make_a_series(samples):
    source = SeriesWind(1.0, 8.0 + np.arange(samples))
    assert source.at([0.5, samples - 1.0])[:, 0] == pytest.approx([8.5, 7.0 + samples])


def test_the_error_of_a_sampled_sine_falls_with_the_fourth_power_of_the_time_step():
    steps, fine, errors = [0.2, 0.1, 0.05, 0.025], np.linspace(0, 12, 5001), []
    for step in steps:
        source = SeriesWind(step, 8 + np.sin(np.arange(round(12 / step) + 1) * step))
        errors.append(abs(source.at(fine)[:, 0] - 8 - np.sin(fine)).max())
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(4.0, abs=0.15)


def test_a_series_has_no_kink_at_its_samples():
    h, c = SeriesWind.example().cells(12.0)
    slope = (3 * c[:-1, 3] * h + 2 * c[:-1, 2]) * h + c[:-1, 1]
    assert slope == pytest.approx(c[1:, 1], abs=1e-12)
    assert 6 * c[:-1, 3] * h + 2 * c[:-1, 2] == pytest.approx(2 * c[1:, 2], abs=1e-12)


@pytest.mark.parametrize("n", [4, 9, 50])
def test_the_periodic_spline_is_scipys(n):
    samples = np.random.default_rng(0).random((n, 2))
    closed = np.concatenate([samples, samples[:1]])
    expected = CubicSpline(np.arange(n + 1) * 0.2, closed, bc_type="periodic").c[::-1].transpose(1, 0, 2)
    assert periodic_cubics(samples, 0.2) == pytest.approx(expected, abs=1e-9)


@given(st.lists(st.tuples(*[st.floats(-5, 5)] * 4), min_size=1, max_size=5), st.floats(0.1, 3.0))
def test_the_minimum_of_cubics_is_exact(cubics, h):
    c = np.array(cubics)
    lowest, when = minimum(h, c)
    u = np.linspace(0, h, 1001)[:, None]
    dense = ((c[:, 3] * u + c[:, 2]) * u + c[:, 1]) * u + c[:, 0]
    assert lowest <= dense.min() + 1e-9
    assert lowest >= dense.min() - 5 * (1 + h) * 3 * (h / 1000) ** 2 - 1e-9
    assert 0 <= when <= len(c) * h * (1 + 1e-12)


def test_a_spline_that_swings_below_zero_between_its_samples_is_refused():
    with pytest.raises(
        InputError, match=r"falls to -\d\.\d\d m/s at 2\.\d s.*spread the jump over several samples"
    ):
        SeriesWind(1.0, [9.0, 9.0, 0.1, 0.1, 9.0, 9.0])


def test_a_run_beyond_the_last_sample_is_refused():
    source = SeriesWind(0.1, np.full(101, 8.0))
    assert len(source.cells(10.0)[1]) == 100
    with pytest.raises(InputError, match=r"is 10 s long but the run needs 10\.5 s"):
        source.cells(10.5)


@pytest.mark.parametrize(
    ("time_step", "values", "message"),
    [
        (0.0, [8.0, 9.0], "time_step must be a number above 0 s"),
        (0.1, [8.0], "one sample"),
        (0.1, [8.0, float("nan")], "wind_speed of sample 1 is nan"),
        (0.1, [8.0, 0.0], "wind_speed of sample 1 is 0 m/s"),
    ],
)
def test_wrong_samples_are_refused_with_their_place(time_step, values, message):
    with pytest.raises(InputError, match=message):
        SeriesWind(time_step, values)


# From a file

HEADER = "time,wind_speed,vertical_shear,horizontal_shear\n"


def written(tmp_path, text, name="gust.csv", **options):
    path = tmp_path / name
    path.write_text(text, **({"encoding": "utf-8"} | options))
    return path


def test_a_file_gives_its_samples_back(tmp_path):
    rows = [(0.1 * i, 8 + 0.3 * np.sin(i), 0.14, 0.001 * i) for i in range(300)]
    text = HEADER + "".join(",".join(f"{x:.10g}" for x in row) + "\n" for row in rows)
    source = read_wind_file(written(tmp_path, text))
    assert source.time_step == 0.1
    assert source.name.startswith("series-gust-")
    samples = source.at(np.arange(300) * 0.1)
    assert samples == pytest.approx(np.array(rows)[:, 1:], abs=1e-8)


def test_a_file_may_order_its_columns_and_come_from_a_spreadsheet(tmp_path):
    text = "wind_speed, time, horizontal_shear, vertical_shear\r\n8,0,0.1,0.2\r\n\r\n9,0.5,0.3,0.4\r\n,,,\r\n"
    source = read_wind_file(written(tmp_path, text, encoding="utf-8-sig", newline=""))
    assert source.values.tolist() == [[8.0, 0.2, 0.1], [9.0, 0.4, 0.3]]


def test_the_same_samples_make_the_same_wind_as_the_file(tmp_path):
    source = make_wind("file", path=written(tmp_path, HEADER + "0,8,0.1,0\n0.5,9,0.1,0\n1,8,0.1,0\n"))
    same = SeriesWind(0.5, [[8, 0.1, 0], [9, 0.1, 0], [8, 0.1, 0]])
    assert np.array_equal(source.cells(1.0)[1], same.cells(1.0)[1])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"gust\.csv: the wind file is empty"),
        ("0,8,0,0\n1,8,0,0\n", r"gust\.csv:1: unknown column '0'"),
        ("time,speed,vertical_shear,horizontal_shear\n", r"gust\.csv:1: unknown column 'speed'.*wind_speed"),
        ("time,vertical_shear\n0,0\n", r"gust\.csv:1: column 'wind_speed' is missing"),
        (
            HEADER + '0,8,0,0\n1,"8,5",0,0\n',
            r"gust\.csv:3: wind_speed is '8,5'; write it with a decimal point",
        ),
        (HEADER + "0,8,0,0\n1,8,5,0,0\n", r"gust\.csv:3: 5 fields, the header has 4.*decimal point"),
        (
            "time,time,wind_speed,vertical_shear,horizontal_shear\n",
            r"gust\.csv:1: column 'time' appears twice",
        ),
        (HEADER, "0 samples after the header"),
        (HEADER + "0,8,0,0\n1,8,x,0\n", r"gust\.csv:3: vertical_shear is 'x'; give a number"),
        (HEADER + "0,8,0,0\n\n1,nan,0,0\n", r"gust\.csv:4: wind_speed is nan"),
        (HEADER + "0,8,0,0\n1,-2,0,0\n", r"gust\.csv:3: wind_speed is -2 m/s"),
        (HEADER + "0,8,0,0\n1,8,0\n", r"gust\.csv:3: 3 fields, the header has 4"),
        (
            "time;wind_speed\n0;8\n",
            r"gust\.csv:1: the columns are separated by semicolons; separate them by commas",
        ),
        ("time\twind_speed\n0\t8\n", r"gust\.csv:1: the columns are separated by tabs"),
        (HEADER + "0,8,0,0\n1,1_0.3,0,0\n", r"gust\.csv:3: wind_speed is '1_0\.3'; give a number"),
        (
            HEADER + "0,8,0,0\n1,8,0,270\n",
            r"gust\.csv:3: horizontal_shear is 270; a linear shear beyond 1 blows",
        ),
        (
            HEADER + "0,8,0,0\n0.0063,8,0,0\n0.0126,8,0,0\n0.0193,8,0,0\n",
            r"gust\.csv:5: the time step changes here to 0\.0067 s",
        ),
        (HEADER + "0;8;0;0\n", r"gust\.csv:2: 1 fields.*separate them by commas"),
        (HEADER + "5,8,0,0\n6,8,0,0\n", r"gust\.csv:2: the first time is 5 s; it must be 0"),
        (HEADER + "0,8,0,0\n2,8,0,0\n1,8,0,0\n", r"gust\.csv:4: time 1 s is not after 2 s"),
        (HEADER + "0,8,0,0\n1,8,0,0\n2,8,0,0\n4,8,0,0\n", r"gust\.csv:5: the time step changes here to 2 s"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read_wind_file(written(tmp_path, text))


@pytest.mark.parametrize(
    ("step", "digits"),
    [(0.00625, 4), (1 / 3, 2), (0.05, 2), (1 / 60, 4), (0.1, 12), (1 / 16, 2), (1 / 64, 3), (1 / 128, 3)],
)
def test_times_that_were_rounded_when_they_were_written_are_those_of_a_uniform_step(tmp_path, step, digits):
    rows = "".join(f"{step * i:.{digits}f},8,0,0\n" for i in range(1000))
    found = read_wind_file(written(tmp_path, HEADER + rows)).time_step
    # a thousand rounded times know their step to a thousandth of the rounding
    assert found == pytest.approx(step, abs=1e-3 * 10.0**-digits)
    if step in (0.00625, 0.05, 0.1):
        assert found == step


@pytest.mark.parametrize("step", [0.01, 0.05, 1 / 3])
def test_times_of_single_precision_are_those_of_a_uniform_step(tmp_path, step):
    """Written with all digits of a double: at 600 s they are up to 3e-5 s off."""
    rows = "".join(f"{float(np.float32(step * i))!r},8,0,0\n" for i in range(round(600 / step)))
    assert read_wind_file(written(tmp_path, HEADER + rows)).time_step == pytest.approx(step, rel=1e-7)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-8-sig"])
def test_shears_that_a_file_has_not_are_zero(tmp_path, encoding):
    source = read_wind_file(written(tmp_path, "time,wind_speed\n0,8\n0.5,9\n", encoding=encoding))
    assert source.values.tolist() == [[8.0, 0.0, 0.0], [9.0, 0.0, 0.0]]


def test_a_text_that_is_no_utf_8_is_told_with_its_line(tmp_path):
    with pytest.raises(InputError, match=r"gust\.csv:2: .*save it as UTF-8"):
        read_wind_file(written(tmp_path, "time,wind_speed\n0,8\xe4\n", encoding="latin-1"))


MASKED = np.ma.array([8.0, 9.0, 8.0], mask=[False, True, False])


@pytest.mark.parametrize(
    "make",
    [
        lambda: SeriesWind(0.5, MASKED),
        lambda: StepWind([0.0, 1.0, 2.0], MASKED),
        lambda: StepWind(MASKED - 8, [8.0, 9.0, 8.0]),
    ],
)
def test_a_masked_sample_is_refused_and_what_lies_below_the_mask_does_not_blow(make):
    with pytest.raises(InputError, match="masked at index 1"):
        make()


def test_a_missing_or_binary_file_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.csv: no such wind file"):
        read_wind_file(tmp_path / "nowhere.csv")
    (tmp_path / "field.bts").write_bytes(bytes([7, 0, 255, 254]))
    with pytest.raises(
        InputError, match=r"field\.bts: this is binary.*a wind field.*give it as `type: full-field`"
    ):
        read_wind_file(tmp_path / "field.bts")
    with pytest.raises(InputError, match="cannot be read"):
        read_wind_file(tmp_path)


def test_a_file_whose_spline_stops_the_wind_is_refused_by_name(tmp_path):
    text = HEADER + "".join(f"{i},{v},0,0\n" for i, v in enumerate([9, 9, 0.1, 0.1, 9, 9]))
    with pytest.raises(InputError, match=r"gust\.csv: .*falls to"):
        read_wind_file(written(tmp_path, text))


# The cells of a block


def test_a_wind_has_the_same_bits_in_every_block():
    turbulent = [TurbulentWind(9.0, 0.1, seed=s, duration=20.0, harmonics=1) for s in (1, 2)]
    h, stacked = stack_cells([turbulent[0], ConstantWind(8.0, 0.1), turbulent[1]], 20.0)
    assert h == 0.2 and stacked.shape == (100, 4, 3, 3)
    for lane, source in ((0, turbulent[0]), (2, turbulent[1])):
        assert np.array_equal(stacked[..., lane], source.cells(20.0)[1])
        assert np.array_equal(stacked[..., lane], stack_cells([source], 20.0)[1][..., 0])
    assert np.array_equal(stacked[:, 0, :, 1], np.tile([8.0, 0.1, 0.0], (100, 1)))
    assert not stacked[:, 1:, :, 1].any()


@pytest.mark.parametrize(("duration", "cell"), [(600.0, 600.0), (0.5, 1.0)])
def test_a_block_of_constant_winds_has_one_cell(duration, cell):
    h, stacked = stack_cells([ConstantWind(8.0), StepWind([0.0], [9.0])], duration)
    assert h == cell and stacked.shape == (1, 4, 3, 2)
    assert stacked[0, 0, 0].tolist() == [8.0, 9.0]


def test_winds_with_different_grids_are_sent_to_blocks_of_their_own():
    winds = [StepWind([0.0, 1.0], [8.0, 9.0]), StepWind([0.0, 0.5], [8.0, 9.0]), ConstantWind(8.0)]
    with pytest.raises(InputError, match=r"different cell durations \(0.5 s, 1 s\).*group by cell_key"):
        stack_cells(winds, 10.0)


def test_an_empty_block_and_a_wind_that_is_too_short_are_refused():
    with pytest.raises(InputError, match="at least one wind"):
        stack_cells([], 10.0)
    with pytest.raises(InputError, match="is 20 s long but the run needs 30 s"):
        stack_cells([ConstantWind(8.0), TurbulentWind(9.0, 0.1, duration=20.0)], 30.0)
