"""A corrector's file: safetensors, never pickle: the map's arrays and a JSON header with all the rest.

The header is flat and its keys are the same for every map: those that a map does not know have the value that means nothing. `states`
and `wind` name what the map sees, where that is more than the turbine's own states and the wind's first three signals. A checksum of
header and arrays stands beside them: a weight with a flipped bit is a weight, and nothing else would tell.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner.corrector.binding import Binding
from fatigue_runner.corrector.corrector import Corrector
from fatigue_runner.corrector.errors import CorrectorError
from fatigue_runner.corrector.guard import Guard
from fatigue_runner.corrector.header import check_header
from fatigue_runner.corrector.maps import MAPS, map_class
from fatigue_runner.encoded import refuse_pointer
from fatigue_runner.errors import InputError
from fatigue_runner.layout import FAMILIES, T2B1I1CG, Channel, FirstOrder, Layout, family_of
from fatigue_runner.turbine.turbine import FIXED

FORMAT = "fatigue-runner corrector 1"
_FACTS = ("wind_range", "validation", "training", "recipe", "licence")
_BOUND = ("turbine", "turbine_hash", "method", "step")
_NOTHING: dict[str, Any] = {
    "factors": (),
    "activation": "identity",
    "history": 0,
    "damping": 0.0,
    "layers": 0,
}


def save(corrector: Corrector, path: Path) -> None:
    """Write the file atomically."""
    from safetensors.numpy import save as to_bytes

    from fatigue_runner.inputs.files import write_atomically

    header = _header(corrector)
    tensors = {**corrector.map.tensors()}
    if corrector.rungs:
        header["rungs"] = [_header(rung) for rung in corrector.rungs]
        for number, rung in enumerate(corrector.rungs, start=1):
            tensors |= {_of_rung(number, name): weights for name, weights in rung.map.tensors().items()}
    tensors = {name: np.ascontiguousarray(array) for name, array in tensors.items()}
    text = json.dumps(header)
    metadata = {"format": FORMAT, "header": text, "crc32": _checksum(text, tensors)}
    write_atomically(path, to_bytes(tensors, metadata=metadata))


def _checksum(header: str, tensors: Mapping[str, np.ndarray]) -> str:
    crc = zlib.crc32(header.encode())
    for name, array in sorted(tensors.items()):
        crc = zlib.crc32(f"{name} {array.dtype.str} {array.shape}".encode(), crc)
        crc = zlib.crc32(array.tobytes(), crc)
    return f"{crc:08x}"


def _of_rung(number: int, name: str) -> str:
    return f"rung{number}.{name}"


def _header(corrector: Corrector) -> dict[str, Any]:
    signals = _signals(corrector.map.layout)
    guard = asdict(corrector.guard)
    ahead_atol = guard.pop("ahead_atol")
    return {
        "name": corrector.name,
        "family": corrector.family,
        **asdict(corrector.binding),
        "kind": corrector.map.kind,
        **_NOTHING,
        **corrector.map.header(),
        **{fact: getattr(corrector, fact) for fact in _FACTS},
        "guard": guard,
        "ahead_atol": ahead_atol,
        **(signals if signals != _signals(T2B1I1CG) else {}),
    }


def _signals(layout: Layout) -> dict[str, list[str]]:
    return {"states": list(layout.names), "wind": [channel.name for channel in layout.wind]}


def _layout(header: dict[str, Any]) -> Layout:
    """The layout whose names the header has. Raises CorrectorError for other equations than this program's."""
    if "states" not in header:
        return T2B1I1CG
    states, wind = header["states"], header["wind"]
    layout = FAMILIES[family_of(states) or "t2b1i1cg"]
    own, blown = _signals(layout).values()
    if states[: len(own)] != own or wind[: len(blown)] != blown:
        raise CorrectorError(f"corrector {header['name']} is for other states or winds than this program has")
    return layout.extended(
        first_order=tuple(FirstOrder(Channel(name, "", name, "")) for name in states[len(own) :]),
        wind=tuple(Channel(name, "", name, "") for name in wind[len(blown) :]),
    )


def _tuples(value: Any) -> Any:
    return tuple(_tuples(v) for v in value) if isinstance(value, list) else value


def load(path: Path | str) -> Corrector:
    """Read a corrector. Raises CorrectorError for a file that is cut, of another kind, or incomplete."""
    from safetensors import SafetensorError, safe_open

    path = Path(path)
    if not path.is_file():
        raise CorrectorError(f"there is no corrector file {path}")
    with path.open("rb") as file:
        refuse_pointer(file.read(64), path, "the corrector", CorrectorError)
    try:
        with safe_open(path, framework="numpy") as f:
            metadata = f.metadata() or {}
            stored = {k: f.get_tensor(k) for k in f.keys()}  # noqa: SIM118 - not a mapping
        tensors = {name: array.astype(float) for name, array in stored.items()}
    except (SafetensorError, OSError, ValueError) as error:
        raise CorrectorError(
            f"{path} is not a whole safetensors file ({error}); copy or train it anew"
        ) from None
    if metadata.get("format") != FORMAT:
        raise CorrectorError(
            f"{path} is no corrector of this program (format {metadata.get('format')!r}, expected {FORMAT!r})"
        )
    try:
        header = json.loads(metadata["header"])
    except (KeyError, ValueError, RecursionError) as error:
        raise CorrectorError(f"{path}: the header cannot be read ({error}); train it anew") from None
    try:
        check_header(header)
        rungs = []
        for number, below in enumerate(header.get("rungs", ()), start=1):
            check_header(below)
            first = _of_rung(number, "")
            own = {k.removeprefix(first): v for k, v in tensors.items() if k.startswith(first)}
            rungs.append(_corrector(below, own))
        found = _corrector(header, tensors, tuple(rungs))
        _refuse_more(found, tensors)
    except InputError as error:
        raise CorrectorError(f"{path}: {error}; copy or train it anew") from None
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise CorrectorError(f"{path}: header and arrays do not fit ({error}); train it anew") from None
    if metadata.get("crc32") not in (None, _checksum(metadata["header"], stored)):
        raise CorrectorError(
            f"{path} is damaged: header and arrays are not those that were saved; copy or train it anew"
        )
    return found


def _refuse_more(corrector: Corrector, tensors: Mapping[str, Any]) -> None:
    """Raises CorrectorError for arrays that the header does not name: somebody meant them to count."""
    known = set(corrector.map.tensors())
    for number, rung in enumerate(corrector.rungs, start=1):
        known |= {_of_rung(number, name) for name in rung.map.tensors()}
    if more := sorted(tensors.keys() - known):
        raise CorrectorError(f"the header does not name the arrays {', '.join(more[:4])}")


def _corrector(
    header: dict[str, Any], tensors: dict[str, Any], rungs: tuple[Corrector, ...] = ()
) -> Corrector:
    if header["kind"] not in MAPS:
        from fatigue_runner.corrector import families  # noqa: F401 - a family may bring a map of its own
    guard: dict[str, Any] = {k: _tuples(v) for k, v in header["guard"].items()}
    try:
        kind = map_class(header["kind"])
    except CorrectorError as error:
        raise CorrectorError(f"corrector {header['name']}: {error}") from None
    facts = {fact: header[fact] for fact in _FACTS}
    return Corrector(
        header["name"],
        header["family"],
        Binding(operation=header.get("operation", FIXED), **{key: header[key] for key in _BOUND}),
        kind.read(header, tensors, _layout(header)),
        Guard(**guard, ahead_atol=tuple(header.get("ahead_atol", ()))),
        **{**facts, "wind_range": tuple(facts["wind_range"])},
        rungs=rungs,
    )
