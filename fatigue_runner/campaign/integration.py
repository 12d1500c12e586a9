"""An integrator of a campaign: plain values that name it, and the integrator itself, made once in every process."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fatigue_runner.errors import FatigueRunnerError
from fatigue_runner.naming import integrator_id

if TYPE_CHECKING:
    from fatigue_runner.integrators import Integrator


@dataclass(frozen=True)
class Integration:
    """A method at a step [s], with a corrector's name, mode, file and the hash of that file where it has one.

    path: the keys of the campaign file that it came from.
    """

    method: str
    step: float
    is_reference: bool = False
    path: tuple[str | int, ...] = ()
    corrector: str = ""
    mode: str = ""
    file: str = ""
    digest: str = ""

    @property
    def id(self) -> str:
        """`heun_10ms`, `rk7_0.1ms`, `heun_10ms_hybrid_heun-10ms`."""
        return integrator_id(self.method, self.step, self.corrector, self.mode)

    @property
    def identity(self) -> list[Any]:
        """What decides the integrator, as plain values to be hashed."""
        return [self.method, self.step, self.mode, self.digest]

    def build(self) -> Integrator:
        """The integrator. Raises InputError for what it refuses, FatigueRunnerError where the corrector's file has changed."""
        from fatigue_runner.integrators import ENHANCED, Integrator

        corrector = load_corrector(self.file, self.digest) if self.file else None
        return Integrator(self.method, self.step, corrector, self.mode or ENHANCED)


@functools.lru_cache(maxsize=64)
def load_corrector(file: str, digest: str) -> Any:
    """The corrector, read once per process; refused where its file is not the one that the cases were made for."""
    from fatigue_runner.corrector import load

    try:
        found = file_hash(file)
    except OSError as error:
        raise FatigueRunnerError(
            f"corrector {file} has gone while the campaign ran ({error.strerror}); bring it back, and run it again"
        ) from None
    if found != digest:
        raise FatigueRunnerError(f"corrector {file} changed while the campaign ran; run it again")
    return load(file)


def file_hash(file: str | Path) -> str:
    """SHA-256 of a file's content."""
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()
