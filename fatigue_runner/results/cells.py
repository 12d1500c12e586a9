"""Cells of the results table as values, and values as a person reads them.

A row is a mapping with the columns of `results.csv`; numbers may be numbers or text as the csv module reads
them, and an empty cell is unknown (None), never zero.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from fatigue_runner.naming import integrator_label

Row = Mapping[str, Any]


def number(row: Row, column: str) -> float | None:
    """The cell as a finite float; None where it is absent, empty, NaN or infinite."""
    value = row.get(column)
    if value is None or value == "" or isinstance(value, bool):
        return None
    try:
        result = float(value)
    except (TypeError, ValueError):
        return None
    return result if math.isfinite(result) else None


def truth(row: Row, column: str) -> bool:
    """The cell as a bool: True, 'True', 'true', 1 and '1' are true."""
    return str(row.get(column, "")).strip().lower() in {"true", "1", "1.0"}


def text(row: Row, column: str) -> str:
    """The cell as text; empty where it is absent or None."""
    value = row.get(column)
    return "" if value is None else str(value).strip()


def numbers(rows: Iterable[Row], column: str) -> list[float]:
    """The known numbers of a column."""
    return [value for row in rows if (value := number(row, column)) is not None]


def integrator(row: Row) -> str:
    """The label of a row's integrator."""
    return integrator_label(
        text(row, "method"), number(row, "step"), text(row, "corrector"), text(row, "mode")
    )


def format_percent(value: float) -> str:
    """A relative error as a percentage with two significant digits: 0.01 -> '1 %', 0.00123 -> '0.12 %'."""
    percent = value * 100
    if percent == 0:
        return "0 %"
    if abs(percent) < 1e-3:
        return f"{_power_of_ten(percent)} %"
    digits = max(0, 1 - math.floor(math.log10(abs(percent))))
    shown = f"{percent:.{digits}f}".replace("-", "−")
    return (shown.rstrip("0").rstrip(".") if "." in shown else shown) + " %"


def _power_of_ten(value: float) -> str:
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}".replace("-", "−")


def format_count(value: float) -> str:
    """A cost or a ratio in plain digits, two significant ones below 10: 12345.6 -> '12346'."""
    return f"{value:.0f}" if abs(value) >= 9.95 else f"{value:.2g}"


def format_error(value: float | None) -> str:
    """A normalised error in powers of ten: 0.00123 -> '1.2e−3'; a dash where it is unknown."""
    return "–" if value is None else _power_of_ten(value)
