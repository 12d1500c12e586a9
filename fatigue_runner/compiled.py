"""numba with a cache that is keyed by the sources of all compiled functions.

numba's own cache looks at the file of a function only: it would go on running a stepping loop with an old kernel inlined after
the kernel has changed, or with a constant that another module no longer has. Here every change of a file that compiles something, or
that such a file imports, gets a cache folder of its own. Where that folder cannot be written, nothing is cached: numba would else write
beside the sources, keyed by one file alone.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import pickle
import re
import tempfile
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core import config as numba_config
from numba.core.caching import IndexDataCacheFile

from fatigue_runner.caches import cache_base
from fatigue_runner.errors import FatigueRunnerWarning

# `nnan` lets LLVM assume that there is no NaN: no divergence check may stand in a function compiled with it.
# Without `reassoc`: with it LLVM sorts sums anew each time that it optimises a function, so that a kernel gives other bits when
# it was compiled in this process than when it came from the cache, and a resumed campaign other bits than its first half.
_FLAGS = {"nnan", "ninf", "nsz", "arcp", "contract", "afn"}
FAST: dict[str, Any] = {"fastmath": _FLAGS, "error_model": "numpy", "boundscheck": False, "nogil": True}
# Without counting references, which is atomic and waits for all stores: six arrays passed on cost a third of an evaluation
# (measured). For functions that neither make an array nor keep one.
LEAN: dict[str, Any] = {**FAST, "_nrt": False}

# For short functions of many arrays: each array is seven words to pass. Not for loops that LLVM is to vectorise: with the caller's
# code around them it does not (seen: Adams methods at twice the time).
INLINE: dict[str, Any] = {**LEAN, "forceinline": True}

config: Any = numba_config  # its attributes are set at import, which no type checker sees

_tells: list[bool] = []  # whether this process is a worker that speaks for all
_KEPT = 8  # cache folders of earlier versions that stay
_IMPORT = re.compile(
    rb"^(?:from (fatigue_runner[\w.]*) import (\([^)]*\)|[^\n(]*)|import (fatigue_runner[\w.]*))", re.M
)


@cache
def cache_folder() -> Path:
    """The folder of compiled kernels: under NUMBA_CACHE_DIR where that is set, else the user's cache folder."""
    digest = hashlib.sha256(numba.__version__.encode())
    for path in compiled_sources(Path(__file__).parent):
        digest.update(path.read_bytes())
    base = cache_base()
    _prune(base)
    return base / f"kernels-{digest.hexdigest()[:16]}"


def compiled_sources(package: Path) -> list[Path]:
    """The files of a package's folder that compile something, and all that they import from it: numba freezes the constants that a
    function uses, wherever they stand."""
    modules = {
        ".".join((package.name, *path.relative_to(package).with_suffix("").parts)).removesuffix(
            ".__init__"
        ): path
        for path in package.rglob("*.py")
    }
    texts = {name: path.read_bytes() for name, path in modules.items()}
    left = [name for name, text in texts.items() if b"fatigue_runner.compiled" in text]
    found: set[str] = set()
    while left:
        name = left.pop()
        if name in found or name not in texts:
            continue
        found.add(name)
        for module, names, plain in _IMPORT.findall(texts[name]):
            above = (module or plain).decode()
            inner = {f"{above}.{word}" for word in re.findall(r"\w+", names.decode())} & texts.keys()
            left += inner or {above} - {package.name}  # the package itself only hands names on
    return sorted(modules[name] for name in found)


@cache
def _writable() -> bool:
    """Whether kernels can be kept in the cache's folder."""
    try:
        cache_folder().mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=cache_folder()).close()
    except OSError:
        return False
    return True


def _prune(base: Path) -> None:
    """Drop the oldest folders, so that the cache does not grow with every version."""
    import shutil

    try:
        folders = sorted(base.glob("kernels-*"), key=lambda p: p.stat().st_mtime)
    except OSError:
        return
    for folder in folders[:-_KEPT]:
        shutil.rmtree(folder, ignore_errors=True)


class _Index(IndexDataCacheFile):
    """What is in the cache; each file ends with a checksum, since machine code with a flipped bit is not run but made again.

    An index that is damaged, or names a module which is no longer there, is empty: a family of somebody's own, say, in a file outside
    of the package, would else keep every other from being loaded.
    """

    def _dump(self, obj: Any) -> bytes:
        pickled: Any = super()._dump
        data: bytes = pickled(obj)
        return data + zlib.crc32(data).to_bytes(4, "little")

    def _load_index(self) -> Any:
        load: Any = super()._load_index
        try:
            with open(self._index_path, "rb") as file:
                pickle.load(file)  # numba's version
                _refuse_damaged(file.read())
            return load()
        except Exception:  # unpickling damaged bytes raises anything
            return {}

    def _load_data(self, name: str) -> Any:
        load: Any = super()._load_data
        path: Any = self._data_path
        _refuse_damaged(Path(path(name)).read_bytes())
        return load(name)

    def save(self, key: Any, data: Any) -> None:
        keep: Any = super().save
        try:
            keep(key, data)
        except OSError:  # the disk is full: the kernel runs all the same
            _warn_once()


def _refuse_damaged(data: bytes) -> None:
    """Raises OSError, which numba takes for a file that is not there."""
    if zlib.crc32(data[:-4]).to_bytes(4, "little") != data[-4:]:
        raise OSError("damaged")


def njit(**options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """`numba.njit(cache=True, **options)` with the keyed cache; without a writable one it warns and compiles every time.

    Strict arithmetic unless `options` say otherwise: left open, numba would compile a function with the flags of its caller, and a
    check for NaN called from a FAST loop would be deleted.
    """
    options = {"fastmath": False, **options}

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        made = _cached(function, options) if _writable() else None
        if made is None:
            _warn_once()
            return numba.njit(**options)(function)
        return made

    return decorate


def _cached(function: Callable[..., Any], options: dict[str, Any]) -> Callable[..., Any] | None:
    """The function with the keyed cache; None where numba would put its kernels elsewhere."""
    before = config.CACHE_DIR
    config.CACHE_DIR = str(cache_folder())
    try:
        made: Any = numba.njit(cache=True, **options)(function)
    except (RuntimeError, OSError):  # numba found no place at all
        return None
    finally:
        config.CACHE_DIR = before
    index = getattr(getattr(made, "_cache", None), "_cache_file", None)
    if index is not None:  # numba may be told not to compile at all
        if not Path(made._cache.cache_path).is_relative_to(cache_folder()):
            return None
        index.__class__ = _Index
    return made


@contextmanager
def telling() -> Iterator[None]:
    """Within it a worker warns, too: for a process that has its kernels compiled there."""
    _tells.append(True)
    try:
        if not _writable():
            _warn_once()
        yield
    finally:
        _tells.pop()


def _warn_once() -> None:
    if multiprocessing.parent_process() is None or _tells:
        _warn()  # of workers one tells it for all


@cache
def _warn() -> None:
    warnings.warn(
        f"the kernel cache {cache_folder()} cannot be written: kernels are compiled anew in every process (seconds); "
        "set NUMBA_CACHE_DIR to a writable folder",
        FatigueRunnerWarning,
        stacklevel=5,
    )
