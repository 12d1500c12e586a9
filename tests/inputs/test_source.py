"""A file is read with its lines, laid over another without losing either's places, and written whole or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from fatigue_runner.errors import InputError
from fatigue_runner.inputs.files import to_yaml, write_atomically
from fatigue_runner.inputs.source import Place, Source, parse_mapping, read_mapping


def parse(text: str, name: str = "a.yaml") -> Source:
    return parse_mapping(text, Path(name), "thing", "a, b")


def test_a_value_knows_its_line_and_what_is_not_there_that_of_its_section():
    source = parse("a: 1\nb:\n  c:\n    - 2\n    - 3\n")
    assert source.where(("b", "c", 1)) == "a.yaml:5"
    assert source.where(("b", "d")) == "a.yaml:2"
    assert source.where(("e",)) == "a.yaml:1"
    assert Place(source, ("b",)).where("c") == "a.yaml:3"


def test_what_is_laid_over_merges_mappings_replaces_the_rest_and_keeps_both_places():
    base = parse("a: 1\nb: {c: 2, d: [1, 2, 3]}\ne: {f: 1}\n", "base.yaml")
    over = parse("x: 0\nb:\n  d: [9]\ne: 5\n").over(base)
    assert over.data == {"a": 1, "b": {"c": 2, "d": [9]}, "e": 5, "x": 0}
    assert over.where(("b", "d")) == "a.yaml:3"
    assert over.where(("b", "c")) == "base.yaml:2"
    assert over.where(("a",)) == "base.yaml:1"
    assert over.where(("b", "new")) == "a.yaml:2"
    third = parse("a: 2\n", "third.yaml").over(over)
    assert [third.where((key,)) for key in ("a", "x", "b")] == ["third.yaml:1", "a.yaml:1", "a.yaml:2"]
    assert third.where(("b", "c")) == "base.yaml:2"


def test_a_computed_mapping_becomes_plain_values():
    data = Source(
        "thing", {"a": np.float64(1.5), "b": np.arange(3), "c": Path("x") / "y", "d": (True, None)}
    ).data
    assert data == {"a": 1.5, "b": [0, 1, 2], "c": str(Path("x/y")), "d": [True, None]}
    assert type(data["a"]) is float and type(data["d"][0]) is bool


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("- 1\n", "a.yaml:1: a thing is a mapping of keys (a, b)"),
        ("a: [1\n", "a.yaml:2: not valid YAML"),
        ("a: 1\na: 2\n", "a.yaml:2: key 'a' is given twice"),
        ("a: " + "[" * 500, "a.yaml: not a thing: its brackets nest too deeply"),
    ],
)
def test_a_text_that_is_no_mapping_is_refused_as_what_it_should_be(text, message):
    with pytest.raises(InputError) as caught:
        parse(text)
    assert str(caught.value).startswith(message)


def test_a_folder_in_place_of_a_file_is_told_as_one(tmp_path):
    with pytest.raises(InputError, match="is a folder; give the thing's YAML file"):
        read_mapping(tmp_path, "thing", "a")


def test_what_is_written_as_yaml_is_read_as_it_was(tmp_path):
    data = {"b": 1e-7, "a": [1, 2.5, "no", None, True], "c": {"d": "1_0", "e": ""}}
    text = to_yaml("A thing.", data)
    assert text.startswith("# A thing.\nb: 1e-07\n")
    assert YAML(typ="safe", pure=True).load(text) == data
    assert parse(text).data == data


def test_a_file_is_whole_or_as_it_was(tmp_path):
    path = tmp_path / "a.txt"
    write_atomically(path, b"old")
    with pytest.raises(TypeError):
        write_atomically(path, "no bytes")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
