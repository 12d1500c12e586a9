"""The benchmark of the logs compares like with like."""

from __future__ import annotations

import pytest
from logbook_example import differing

from fatigue_runner.benchmark.pages import tables
from fatigue_runner.benchmark.speed import logs
from fatigue_runner.logbook import read_log, write_log


@pytest.mark.parametrize("name", list(logs.OTHER_WRITERS))
def test_every_other_writer_writes_the_same_rows(tmp_path, name):
    ours = write_log(tmp_path / "ours.mcap", logs.sample(50), topics=logs.TOPICS)
    try:
        write = logs.OTHER_WRITERS[name](logs._messages(ours))
    except ImportError as error:
        pytest.skip(f"{error.name} is not installed")
    write(tmp_path / "other.mcap")
    assert differing(read_log(tmp_path / "other.mcap"), read_log(ours)) == []


def test_benchmark_gives_ratios_to_the_library_of_the_same_run():
    result = logs.measure(rows=100, repeats=1)
    for kind, base in (("writers", logs.BASE_WRITER), ("readers", logs.BASE_READER)):
        assert result[kind][base]["ratio"] == 1.0
        rate = result[kind]["fatigue-runner, zstd"]["per_second"]
        assert result[kind]["fatigue-runner, zstd"]["ratio"] == rate / result[kind][base]["per_second"]
    assert result["bytes_per_row"] > 8 * 38, "39 noisy float64 do not compress away"
    assert tables.logs(result).row_count == 2 + len(result["writers"]) + len(result["readers"])
