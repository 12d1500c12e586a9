"""How integrators and winds are called: ids in file names and case ids, labels where a person reads. One place for all."""

from __future__ import annotations

import hashlib


def integrator_id(method: str, step: float, corrector: str = "", mode: str = "") -> str:
    """`heun_10ms`, `rk7_0.1ms`, `heun_10ms_hybrid_heun-10ms`; step [s], corrector: its name."""
    return joined(f"{method}_{step * 1e3:.9g}ms", mode if corrector else "", corrector)


def integrator_label(method: str, step: float | None, corrector: str = "", mode: str = "") -> str:
    """`heun 10 ms`; with a corrector whose name says as much `heun-10ms, hybrid`, else `heun 10 ms + my-net, hybrid`.

    step [s]; None where a table does not say.
    """
    base = method if step is None else f"{method} {step_label(step)}"
    if not corrector:
        return base
    told = step is not None and f"{method}-{step * 1e3:g}ms" in corrector
    return ", ".join(part for part in (corrector if told else f"{base} + {corrector}", mode) if part)


def step_label(step: float) -> str:
    """A step [s] as a person reads it: 0.02 -> `20 ms`."""
    return f"{step * 1e3:g} ms"


# What a corrector's family is called where a person reads: both are networks, the second one the paper's own.
FAMILIES = {"mlp": "network", "paper": "network"}


def integrator_series(method: str, family: str = "", mode: str = "") -> str:
    """What integrators at any step have in common: `heun`, `heun + network, hybrid`; family: that of the corrector."""
    return f"{method} + {FAMILIES.get(family, family)}, {mode}" if family else method


def joined(*parts: str) -> str:
    """An id of the parts that are not empty."""
    return "_".join(part for part in parts if part)


def speed_id(speed: float) -> str:
    """`v08.00`, `v07.1234`: sorted by name is sorted by speed [m/s] for the usual two digits."""
    text = f"{speed:05.2f}" if round(speed, 2) == speed else f"{speed:.9g}"
    return "v" + (text if speed >= 10 or text.startswith("0") else f"0{text}")


def value_id(value: float) -> str:
    """`0.14`, `0.123457`: two digits where these say all."""
    return f"{value:.2f}" if round(value, 2) == value else f"{value:.6g}"


LONGEST_NAME = 255  # bytes of a file's name that most file systems take
LONGEST = 80  # bytes of a file's name in an id: an integrator and an ending follow


def file_id(stem: str) -> str:
    """What a file's name (without its ending) is in an id: other signs than letters, digits, `.` and `-` become `-`; a name of more
    than LONGEST bytes is cut, and eight hex digits of all of it keep it apart from others that begin alike."""
    found = "".join(c if c.isalnum() or c in ".-" else "-" for c in stem)
    if len(found.encode()) <= LONGEST:
        return found
    digest = hashlib.sha256(stem.encode()).hexdigest()[:8]
    return f"{found.encode()[: LONGEST - 9].decode(errors='ignore')}-{digest}"
