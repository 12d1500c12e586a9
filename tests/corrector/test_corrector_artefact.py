"""A corrector's file: what goes in comes out; what is damaged, incomplete or of another kind is refused in one sentence."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from corrector_example import network, trained, turbine

from fatigue_runner.corrector import CorrectorError, Guard, library, load, save


def written(tmp_path, corrector=None):
    path = tmp_path / "example.safetensors"
    save(corrector or trained(history=0), path)
    return path


@pytest.mark.parametrize(
    "corrector", [trained(), trained(factors=("sin_azimuth",)), trained("rk4", 0.1, history=1), network(True)]
)
def test_a_file_gives_back_the_corrector_bit_by_bit(tmp_path, corrector):
    corrector = replace(
        corrector, validation={"nrmse": 1e-5}, training={"seed": 3, "samples": 10}, recipe="name: x\n"
    )
    back = load(written(tmp_path, corrector))
    for field in corrector.__dataclass_fields__:
        if field != "map":
            assert getattr(back, field) == getattr(corrector, field)
    assert type(back.map) is type(corrector.map)
    assert back.map.header() == corrector.map.header()
    arrays, again = corrector.map.tensors(), back.map.tensors()
    assert list(arrays) == list(again)
    assert all(np.array_equal(a, b) for a, b in zip(arrays.values(), again.values(), strict=True))


def test_a_truncated_file_is_refused_wherever_it_is_cut(tmp_path):
    path = written(tmp_path)
    whole = path.read_bytes()
    for cut in (0, 4, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:cut])
        with pytest.raises(CorrectorError, match="not a whole safetensors file"):
            load(path)


def test_a_file_that_is_not_there_or_no_corrector_is_refused(tmp_path):
    from safetensors.numpy import save_file

    with pytest.raises(CorrectorError, match="there is no corrector file"):
        load(tmp_path / "none.safetensors")
    save_file({"a": np.zeros(2)}, tmp_path / "other.safetensors")
    with pytest.raises(CorrectorError, match="is no corrector of this program"):
        load(tmp_path / "other.safetensors")


def rewritten(path, change):
    """The file with its header changed by `change(header, tensors)`."""
    from safetensors import safe_open
    from safetensors.numpy import save_file

    with safe_open(path, framework="numpy") as f:
        metadata = f.metadata()
        tensors = {k: f.get_tensor(k) for k in f.keys()}  # noqa: SIM118
    header = json.loads(metadata["header"])
    change(header, tensors)
    save_file(tensors, path, metadata={**metadata, "header": json.dumps(header)})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda h, t: h.pop("turbine_hash"), "the header: key 'turbine_hash' is missing"),
        (lambda h, t: h.pop("guard"), "the header: key 'guard' is missing"),
        (lambda h, t: h["guard"].pop("atol"), "key 'atol' is missing in guard"),
        (lambda h, t: h.update(layers=1), "header and arrays do not fit"),
        (lambda h, t: t["linear"].__setitem__((3, 4), np.nan), "a weight is not a finite number"),
        (lambda h, t: t["linear"].__setitem__((3, 4), np.inf), "a weight is not a finite number"),
        (lambda h, t: t.update(linear=t["linear"][:, :-1].copy()), "do not fit heun's features"),
        (
            lambda h, t: h.update(factors=["sin_azimut"]),
            "unknown feature factor 'sin_azimut'; did you mean 'sin_azimuth'",
        ),
        (lambda h, t: h.update(kind="rawer"), "do not exist"),
        (lambda h, t: h["guard"].update(atol=[0.0] * 16), "atol needs positive numbers"),
        (lambda h, t: h["guard"].update(norm="euclid"), "norm must be one of max, rms"),
        (lambda h, t: h["guard"].update(kappa=0.5), "kappa must be at least 1"),
        (lambda h, t: h.update(history=9), "look back 9 steps do not exist"),
        (lambda h, t: h.update(method="ab4"), "Runge-Kutta and exponential Adams methods"),
        (lambda h, t: h.update(method="hein"), "unknown integrator 'hein'; did you mean 'heun'"),
    ],
)
def test_a_damaged_header_or_weight_is_refused_with_what_is_wrong(tmp_path, change, words):
    path = written(tmp_path)
    rewritten(path, change)
    with pytest.raises(Exception, match=words) as caught:
        load(path)
    assert isinstance(caught.value, CorrectorError) or "InputError" in type(caught.value).__name__
    assert "\n" not in str(caught.value)


def test_a_flipped_bit_in_a_weight_is_noticed(tmp_path):
    path = written(tmp_path)
    whole = path.read_bytes()
    path.write_bytes(whole[:-2] + bytes([whole[-2] ^ 4]) + whole[-1:])
    with pytest.raises(CorrectorError, match="is damaged: header and arrays are not those that were saved"):
        load(path)


def test_shipped_correctors_have_a_checksum():
    from safetensors import safe_open

    from fatigue_runner import shipped

    for path in shipped.correctors().glob("*.safetensors"):
        with safe_open(path, framework="numpy") as file:
            assert "crc32" in file.metadata(), path


def test_an_array_that_the_header_does_not_name_is_refused(tmp_path):
    path = written(tmp_path)
    rewritten(path, lambda h, t: t.update({"rung1.linear": np.zeros(2)}))
    with pytest.raises(CorrectorError, match=r"the header does not name the arrays rung1\.linear"):
        load(path)


def test_a_guard_needs_an_absolute_tolerance_for_every_state():
    short = Guard(1.0, "max", 1.0, 1.0, (1.0,) * 15, (0.0,) * 16, 2)
    with pytest.raises(CorrectorError, match="its guard's atol needs a number for each of 16 states, got 15"):
        replace(trained(), guard=short)


def test_a_name_finds_the_file_of_the_given_folder_and_an_unknown_one_the_nearest(tmp_path):
    written(tmp_path)
    assert library.find("example", [tmp_path]).map.linear.shape == (16, 43)
    assert library.find(str(tmp_path / "example.safetensors")).name == "example"
    with pytest.raises(CorrectorError, match="there is no corrector 'exampel'; did you mean 'example'"):
        library.find("exampel", [tmp_path])
    assert "example" in [c.name for c in library.correctors([tmp_path])]


def test_every_shipped_corrector_fits_its_turbine():
    from fatigue_runner.turbine import load_turbine

    for corrector in library.correctors():
        there = load_turbine(corrector.turbine).operated(corrector.binding.operation)
        corrector.bind(there, corrector.method, corrector.step)
        assert corrector.validation
        assert corrector.recipe


def test_a_name_of_another_turbine_is_refused():
    with pytest.raises(CorrectorError, match="was trained for turbine other"):
        binding = replace(trained().binding, turbine="other", turbine_hash="0" * 64)
        replace(trained(), binding=binding).bind(turbine(), "heun", 0.02)


def test_a_git_lfs_pointer_is_told_as_one(tmp_path):
    path = tmp_path / "a.safetensors"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 12345\n")
    with pytest.raises(CorrectorError, match="Git LFS pointer"):
        load(path)
