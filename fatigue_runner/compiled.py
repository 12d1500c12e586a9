"""numba with a cache that is keyed by the sources of all compiled functions.

numba's own cache looks at the file of a function only: it would go on running a stepping loop with an old kernel inlined after
the kernel has changed. Here every change of any file that compiles something gets a cache folder of its own.
"""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core import config as numba_config
from numba.core.caching import IndexDataCacheFile

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

_KEPT = 8  # cache folders of earlier versions that stay


@cache
def cache_folder() -> Path:
    """The folder of compiled kernels: under NUMBA_CACHE_DIR where that is set, else the user's cache folder."""
    digest = hashlib.sha256(numba.__version__.encode())
    package = Path(__file__).parent
    for path in sorted(package.rglob("*.py")):
        source = path.read_bytes()
        if b"fatigue_runner.compiled" in source:
            digest.update(source)
    base = config.CACHE_DIR or os.path.join(
        os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "fatigue-runner"
    )
    _prune(Path(base))
    return Path(base) / f"kernels-{digest.hexdigest()[:16]}"


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
    """What is in the cache. One that names a module which is no longer there is empty: a family of somebody's own, say, in a
    file outside of the package, would else keep every other from being loaded."""

    def _load_index(self) -> Any:
        load: Any = super()._load_index
        try:
            return load()
        except (ImportError, AttributeError):
            return {}


def njit(**options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """`numba.njit(cache=True, **options)` with the keyed cache; without a writable one it warns and compiles every time.

    Strict arithmetic unless `options` say otherwise: left open, numba would compile a function with the flags of its caller, and a
    check for NaN called from a FAST loop would be deleted.
    """
    options = {"fastmath": False, **options}

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(cache_folder())
        try:
            made: Any = numba.njit(cache=True, **options)(function)
            index = getattr(getattr(made, "_cache", None), "_cache_file", None)
            if index is not None:  # numba may be told not to compile at all
                index.__class__ = _Index
            return made
        except (RuntimeError, OSError):
            _warn_once()
            return numba.njit(**options)(function)
        finally:
            config.CACHE_DIR = before

    return decorate


@cache
def _warn_once() -> None:
    warnings.warn(
        f"the kernel cache {cache_folder()} cannot be written: kernels are compiled anew in every process (seconds); "
        "set NUMBA_CACHE_DIR to a writable folder",
        stacklevel=3,
    )
