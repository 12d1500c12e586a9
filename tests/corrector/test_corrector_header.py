"""A corrector's header is data from a file: what is edited or damaged in it is refused with the key, and nothing else happens."""

from __future__ import annotations

import copy
import json

import pytest
from safetensors import safe_open
from safetensors.numpy import save_file

from fatigue_runner import shipped
from fatigue_runner.corrector import load
from fatigue_runner.corrector.errors import CorrectorError
from fatigue_runner.corrector.header import check_header


@pytest.fixture(scope="module")
def parts():
    with safe_open(shipped.correctors() / "etdabm3-100ms.safetensors", framework="numpy") as file:
        metadata = file.metadata()
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a mapping
    return tensors, metadata["format"], json.loads(metadata["header"])


def written(tmp_path, parts, header, **tensors):
    path = tmp_path / "own.safetensors"
    save_file({**parts[0], **tensors}, path, metadata={"format": parts[1], "header": json.dumps(header)})
    return path


WRONG = {
    "name": ["../../etc", "", 3],
    "family": [None, "no such family/"],
    "method": [5, ""],
    "step": [0, -0.1, "0.1", float("nan"), 1e9],
    "activation": ["tanh", 1],
    "history": [-1, 1.5, 99, True],
    "damping": [-1.0, float("inf")],
    "layers": ["2", -1],
    "wind_range": [[], [5], [9, 5], ["a", "b"]],
    "guard": [None, {}, []],
    "validation": [[], "good"],
    "ahead_atol": [[-1.0], "x"],
    "factors": [{}, 1],
    "operation": ["sailing", 3],
    "bins": [["8"], [8, 8], [9, 8], [-1], [True]],
    "harmonics": ["yes", 1, None],
    "rungs": [{}, [1], [{}], [{"name": "half"}]],
}
CASES = [(key, value) for key, values in WRONG.items() for value in values]


@pytest.mark.parametrize(("key", "value"), CASES, ids=[f"{key}={value!r}" for key, value in CASES])
def test_a_wrong_value_is_refused(tmp_path, parts, key, value):
    header = copy.deepcopy(parts[2]) | {key: value}
    with pytest.raises(CorrectorError, match=r"own\.safetensors"):
        corrector = load(written(tmp_path, parts, header))
        from fatigue_runner.turbine import load_turbine

        corrector.bind(load_turbine("nrel5mw"), "etdabm3", 0.1)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("limit", -1),
        ("substeps", -2),
        ("rtol", [-1.0] * 16),
        ("atol", [0.0] * 16),
        ("norm", "sum"),
        ("quantile", 2),
    ],
)
def test_so_is_one_of_the_guard(tmp_path, parts, key, value):
    header = copy.deepcopy(parts[2])
    header["guard"][key] = value
    with pytest.raises(CorrectorError, match=rf"own\.safetensors.*{key}"):
        load(written(tmp_path, parts, header))


@pytest.mark.parametrize("text", ["", "[]", "{", '{"name": ' + "[" * 100_000])
def test_a_header_that_is_none_is_a_sentence(tmp_path, parts, text):
    path = tmp_path / "own.safetensors"
    save_file(parts[0], path, metadata={"format": parts[1], "header": text})
    with pytest.raises(CorrectorError, match="header"):
        load(path)


@pytest.mark.parametrize(
    ("key", "value"), [("method", "sail"), ("bins", ["8"]), ("step", 0.1), ("guard", {})]
)
def test_a_rung_is_looked_at_as_closely(tmp_path, key, value):
    with safe_open(
        shipped.correctors() / "etdabm3-100ms-operation-ladder.safetensors", framework="numpy"
    ) as file:
        metadata = file.metadata()
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a mapping
    header = json.loads(metadata["header"])
    header["rungs"][0][key] = value
    with pytest.raises(CorrectorError, match=r"own\.safetensors"):
        load(written(tmp_path, (tensors, metadata["format"]), header))
    with pytest.raises(CorrectorError, match="do not fit"):
        load(
            written(
                tmp_path,
                ({k: v for k, v in tensors.items() if "." not in k}, metadata["format"]),
                json.loads(metadata["header"]),
            )
        )


def test_an_array_with_no_number_is_refused(tmp_path, parts):
    name, values = next(iter(parts[0].items()))
    values = values.copy()
    values.flat[0] = float("nan")
    with pytest.raises(CorrectorError, match="a weight is not a finite number"):
        load(written(tmp_path, parts, parts[2], **{name: values}))


def test_every_shipped_header_passes():
    for path in shipped.correctors().glob("*.safetensors"):
        with safe_open(path, framework="numpy") as file:
            check_header(json.loads(file.metadata()["header"]))
