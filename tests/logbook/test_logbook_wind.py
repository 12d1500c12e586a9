"""A log holds the wind's azimuthal harmonics, as many as its wind has, and a wind without them has the log that it always had."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from logbook_example import RUN, differing, example, same_bits
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from typer.testing import CliRunner

from fatigue_runner import channels
from fatigue_runner.layout import MOST_HARMONICS
from fatigue_runner.logbook import (
    LogError,
    LogTail,
    LogWriter,
    check,
    export,
    read_log,
    recover,
    summarise,
    write_log,
)
from fatigue_runner.logbook.commands import app
from fatigue_runner.logbook.schema import TOPICS, fields_in
from fatigue_runner.logbook.summary import what_ran
from fatigue_runner.trajectory import Trajectory


def with_harmonics(harmonics: int, rows: int = 400) -> Trajectory:
    """The example in a wind of that many harmonics, of which none is like another."""
    rng = np.random.default_rng(harmonics)
    run = example(rows)
    return replace(run, wind=np.concatenate([run.wind, rng.normal(size=(rows, 2 * harmonics))], axis=1))


def declared(path: Path) -> list[str]:
    """Names of the fields that a log's schema of the wind declares."""
    with open(path, "rb") as stream:
        schemas = make_reader(stream).get_summary().schemas.values()
    (wind,) = (schema for schema in schemas if schema.name == "fatigue_runner.Wind")
    return [field.name for field in fields_in(wind.data, wind.name)]


@pytest.mark.parametrize("harmonics", [2, 3, 6, MOST_HARMONICS])
def test_the_amplitudes_come_back_to_the_bit_under_names_of_their_own(tmp_path, harmonics):
    run = with_harmonics(harmonics)
    path = write_log(tmp_path / "a.mcap", run, RUN)
    assert check(path).complete
    log = read_log(path)
    assert differing(log, run) == [] and log.wind.shape == (400, 3 + 2 * harmonics)
    with open(path, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        messages = [decoded for *_, decoded in reader.iter_decoded_messages(topics="/wind")]
    for place, m in enumerate(range(1, harmonics + 1)):
        assert [getattr(d, f"wind_cos_{m}") for d in messages] == run.wind[:, 3 + 2 * place].tolist()
        assert [getattr(d, f"wind_sin_{m}") for d in messages] == run.wind[:, 4 + 2 * place].tolist()
    assert log.units[f"wind_sin_{harmonics}"] == "m/s"


def test_a_schema_lists_the_signals_of_its_own_log_and_no_others(tmp_path):
    fields = ["time", "wind_speed", "vertical_shear", "horizontal_shear"]
    assert declared(write_log(tmp_path / "none.mcap", example())) == fields
    pairs = ["wind_cos_1", "wind_sin_1", "wind_cos_2", "wind_sin_2"]
    assert declared(write_log(tmp_path / "two.mcap", with_harmonics(2))) == fields + pairs
    assert declared(write_log(tmp_path / "empty.mcap", example(0))) == fields


def test_the_numbers_of_the_harmonics_never_change():
    numbers = {f.name: f.number for f in TOPICS["wind"].fields}
    assert numbers["wind_cos_1"] == 101 and numbers["wind_sin_1"] == 102
    assert all(numbers[f"wind_cos_{m}"] == 99 + 2 * m for m in range(1, 17))
    assert all(numbers[f"wind_sin_{m}"] == 100 + 2 * m for m in range(1, 17))


def test_a_signal_of_the_equations_own_stands_before_the_harmonics_and_has_its_name_and_unit(tmp_path):
    gust = channels.Channel("gust", "m/s", "gust", "m/s")
    signals = (*channels.WIND_SIGNALS, gust, *channels.WIND_HARMONICS[:4])
    wind = np.concatenate([example().wind, np.random.default_rng(3).normal(size=(400, 5))], axis=1)
    run = replace(example(), wind=wind, wind_signals=signals)
    path = write_log(tmp_path / "a.mcap", run, RUN)
    log = read_log(path)
    assert differing(log, run) == [] and [c.name for c in log.winds] == [c.name for c in signals]
    assert log.winds[3].unit == "m/s" and check(path).complete
    assert declared(path) == ["time", *(c.name for c in signals)]
    assert export(path, ["gust"], tmp_path / "a.csv") == ["time", "gust"]


@pytest.mark.parametrize(("columns", "words"), [(4, "3 \\+ 2 M"), (40, "35 or fewer")])
def test_a_wind_that_is_no_whole_number_of_pairs_or_too_many_is_refused(tmp_path, columns, words):
    with pytest.raises(LogError, match=words):
        write_log(tmp_path / "a.mcap", replace(example(), wind=np.ones((400, columns))))


def test_a_log_that_keeps_some_channels_has_the_columns_up_to_its_highest_harmonic(tmp_path):
    run = with_harmonics(6)
    log = read_log(write_log(tmp_path / "a.mcap", run, channels=["wind_speed", "wind_sin_3", "rotor_thrust"]))
    assert log.wind.shape == (400, 9)
    assert same_bits(log.wind[:, [0, 8]], np.ascontiguousarray(run.wind[:, [0, 8]]))
    assert np.isnan(log.wind[:, 1:8]).all()
    with pytest.raises(LogError, match="cannot log channel 'wind_cos_7', the run does not have it"):
        write_log(tmp_path / "b.mcap", run, channels=["wind_cos_7"])


def test_a_log_that_is_followed_while_it_is_written_has_them_in_every_block(tmp_path):
    run, found = with_harmonics(3, 90), []
    with LogWriter(tmp_path / "a.mcap", run=RUN) as log:
        for start in range(0, 90, 30):
            rows = slice(start, start + 30)
            status = slice(max(start - 1, 0), start + 29)
            names = ("accepted", "discrepancy", "threshold", "local_error")
            log.append(
                replace(
                    run, time=run.time[rows], state=run.state[rows], wind=run.wind[rows],
                    loads={name: values[rows] for name, values in run.loads.items()},
                    **{name: getattr(run, name)[status] for name in names},
                )
            )  # fmt: skip
            log.flush()
            if start == 0:
                tail = LogTail(tmp_path / "a.mcap")
            found.append(tail.poll().wind)
    tail.close()
    assert same_bits(np.concatenate(found), run.wind)


def test_what_a_cut_leaves_is_recovered_with_them(tmp_path):
    run = with_harmonics(6, 3000)
    path = write_log(tmp_path / "a.mcap", run, RUN, compression="none")
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    done = recover(path)
    assert 0 < done.rows < 3000 and check(path).ok
    assert differing(read_log(path), run, done.rows) == []


def test_export_and_info_name_them(tmp_path):
    run = with_harmonics(2)
    path = write_log(tmp_path / "a.mcap", run, RUN)
    names = export(path, ["wind_*"], tmp_path / "wind.csv")
    assert names == ["time", "wind_speed", "wind_cos_1", "wind_sin_1", "wind_cos_2", "wind_sin_2"]
    with open(tmp_path / "wind.csv", newline="") as file:
        values = [float(row["wind_sin_2"]) for row in csv.DictReader(file)]
    assert values == run.wind[:, 6].tolist()
    (extreme,) = (e for e in summarise(path).extremes if e.name == "wind_cos_1")
    assert extreme.maximum == run.wind[:, 3].max() and extreme.unit == "m/s"


def test_the_names_of_a_wind_s_columns_are_those_of_the_layout():
    assert [c.name for c in channels.wind_channels(3)] == list(channels.WIND_NAMES)
    names = [c.name for c in channels.wind_channels(3 + 2 * MOST_HARMONICS)]
    assert names[3:7] == ["wind_cos_1", "wind_sin_1", "wind_cos_2", "wind_sin_2"]
    assert set(names) <= set(channels.BY_NAME)


def test_info_says_how_strong_the_wind_is_where_and_shows_its_amplitudes_when_all_is_asked_for(tmp_path):
    run = RUN | {
        "step": "0.1", "turbine": "nrel5mw", "wind_source": "turbulent", "turbulence_intensity": "0.14", "harmonics": "2",
        "wind_strength": "standard deviation 1.12 m/s at a point; the mean over the rotor keeps 0.62 m/s",
        "wind_left_out": "lateral and vertical turbulence; azimuthal harmonics above 2",
    }  # fmt: skip
    path = write_log(tmp_path / "a.mcap", with_harmonics(2), run)
    text = CliRunner().invoke(app, ["info", str(path)]).output
    assert "of 8.25 m/s, intensity 0.14 at a point, 2 azimuthal harmonics" in text
    assert run["wind_strength"] in text and run["wind_left_out"] in text
    assert "wind_speed" in text and "wind_cos_2" not in text and "and 4 amplitudes" in text
    text = CliRunner().invoke(app, ["info", "--all", str(path)]).output
    assert "wind_cos_2" in text and "and 4 amplitudes" not in text


def test_the_sentence_on_what_ran_says_where_the_wind_came_from_and_whether_the_tower_counted():
    run = {
        "method": "rk4",
        "step": "0.05",
        "turbine": "nrel5mw",
        "wind_source": "constant",
        "wind_speed": "8.0",
    }
    assert what_ran(run) == "rk4 at 50 ms, on nrel5mw in constant wind of 8 m/s"
    turned = run | {"yaw_misalignment_deg": "-8.0", "upflow_deg": "0.0", "tower_influence": "True"}
    assert what_ran(turned).endswith("of 8 m/s, yaw misalignment -8 degrees, tower influence")
