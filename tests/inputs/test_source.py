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
    assert over.where(("b", "c")) == "a.yaml:3 over base.yaml:2", "one of the two files is wrong"
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
        ("a: 1\nb: " + "[" * 500, "a.yaml:2: not a thing: its brackets nest too deeply"),
        (
            "a:\n" + "\n".join(" " * i + "a:" for i in range(1, 400)),
            "a.yaml:400: not a thing: its values nest too deeply",
        ),
        ("a: 1\nb: x\x07y", "a.yaml:2: not valid YAML: the control character U+0007 stands there; remove it"),
        ("a: 1\nb: " + "{" * 30 + "}" * 30, "a.yaml:2: a key is a name here, not a mapping or a list"),
        ("a: [1, {? [b] : 1}]", "a.yaml:1: a key is a name here"),
        ("a: &x {b: 1}\n*x : 2", "a.yaml:1: a key is a name here"),
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


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32"])
def test_a_file_is_read_in_every_encoding_that_yaml_knows(tmp_path, encoding):
    """Windows' shells write UTF-16; YAML 1.2.2, 5.2."""
    path = tmp_path / "a.yaml"
    path.write_bytes("a: 1  # Wöhler\nb: ä\n".encode(encoding))
    assert read_mapping(path, "thing", "a, b").data == {"a": 1, "b": "ä"}


def test_another_encoding_is_told_with_line_and_way_out(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_bytes("a: 1\nb: Wöhler\n".encode("latin-1"))
    with pytest.raises(InputError, match=r"a.yaml:2: .*byte 0xf6.*save it as UTF-8"):
        read_mapping(path, "thing", "a, b")


def test_a_git_lfs_pointer_is_told_as_one(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")
    with pytest.raises(InputError, match=r"Git LFS pointer.*git lfs pull"):
        read_mapping(path, "thing", "a, b")


def test_a_tab_behind_something_is_a_space_and_one_before_it_is_told():
    """YAML 1.2.2, 6.6: the parser alone refuses the first, and calls the second no valid YAML."""
    source = parse("a: 1\t\nb:\t2\t# s\n\t\n\t# note\nc: [1,\t2]\r\nd:\n  e: 3\t\n")
    assert source.data == {"a": 1, "b": 2, "c": [1, 2], "d": {"e": 3}}
    assert source.where(("d", "e")) == "a.yaml:7"
    with pytest.raises(InputError, match=r"a.yaml:3: .* indented with a tab.*spaces"):
        parse("a: 1\nb:\n\tc: 2\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [{b: rk4, c: 0,02}]\n", r"a.yaml:1: 0,02 is two entries.*0\.02"),
        ("a:\n  - {c: 0,02, b: rk4}\n", r"a.yaml:2: 0,02 is two entries.*0\.02"),
        ("a: 1\nb: {start: 3,5, stop: 4,5}\n", r"a.yaml:2: .*decimal point, not with a comma"),
        ("a: 1_0.3\n", r"a.yaml:1: 1_0\.3 is no number"),
        ("a: {b: [1, 2_0]}\n", r"a.yaml:1: 2_0 is no number"),
    ],
)
def test_what_yaml_takes_for_another_number_is_refused(text, message):
    with pytest.raises(InputError, match=message):
        parse(text)


def test_texts_with_commas_and_underscores_stay_texts():
    assert parse("a: 1_0.x\nb: '1_0'\nc: v1_2\nd: {e: '0,02', f: }\n").data == {
        "a": "1_0.x", "b": "1_0", "c": "v1_2", "d": {"e": "0,02", "f": None}
    }  # fmt: skip


KINDS = {
    "campaign": "name: a\nintegrators: []\n",
    "turbine": "name: a\nblade: {}\n",
    "recipe": "name: a\nfamily: affine\n",
    "polar file": "airfoils: {}\n",
}


@pytest.mark.parametrize("asked", KINDS)
@pytest.mark.parametrize("given", KINDS)
def test_a_file_of_another_kind_is_told_as_what_it_is(tmp_path, asked, given):
    (tmp_path / "a.yaml").write_text(KINDS[given])
    if asked == given:
        assert read_mapping(tmp_path / "a.yaml", asked, "").data
        return
    with pytest.raises(InputError, match=f"a.yaml: this is a {given}, not a {asked}; it is for `"):
        read_mapping(tmp_path / "a.yaml", asked, "")
