"""The results table: its columns, the rows as Python values, and the files they are written to."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fatigue_runner.channels import LOAD_NAMES, STATE_NAMES
from fatigue_runner.inputs.files import write_atomically

_CASE = (
    *(
        "case_id",
        "wind_source",
        "wind_speed",
        "vertical_shear",
        "horizontal_shear",
        "turbulence_intensity",
        "seed",
    ),
    *("pitch_deg", "method", "step", "corrector", "mode", "is_reference"),
    *("status", "diverged_at", "error_message", "duration", "steps", "evaluations", "evaluations_per_second"),
    *("wall_time", "clamped_lookups", "acceptance_rate", "trained_from", "trained_to"),
    *("nrmse_max", "nrmse_mean", "delta_e", "delta_e_range", "delta_t"),
)
_TEXT = {"case_id", "wind_source", "method", "corrector", "mode", "status", "error_message"}
_WHOLE = {"seed", "steps", "evaluations", "clamped_lookups"}


def fatigue_keys(channels: Sequence[str], exponents: Sequence[float]) -> list[tuple[str, float, str]]:
    """(channel, exponent, suffix of its columns): `blade1_root_flapwise_moment_m10`."""
    return [(channel, m, f"{channel}_m{m:g}") for channel in channels for m in exponents]


def columns(channels: Sequence[str], exponents: Sequence[float]) -> list[str]:
    """All columns of the results table in their order, for these fatigue channels and Wöhler exponents."""
    fatigue = [
        f"{figure}_{suffix}"
        for _, _, suffix in fatigue_keys(channels, exponents)
        for figure in ("del", "del_error", "damage_ratio")
    ]
    statistics = [f"{figure}_{channel}" for channel in LOAD_NAMES for figure in ("mean", "min", "max")]
    return [*_CASE, *(f"nrmse_{state}" for state in STATE_NAMES), *fatigue, *statistics]


def known(value: Any) -> Any:
    """A cell's value as plain Python; None for what is unknown: NaN and infinity are no figures."""
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


@dataclass
class Results:
    """The outcome of a campaign: one row per case, in the order of the campaign.

    rows: dicts with every column, None where a figure is unknown; out: the run folder; `simulated` and `kept`
    count the cases that ran now and those that an earlier run had finished.
    """

    out: Path
    columns: list[str]
    rows: list[dict[str, Any]]
    simulated: int = 0
    kept: int = 0
    wall_time: float = 0.0
    report_error: str = ""

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return iter(self.rows)

    def column(self, name: str) -> list[Any]:
        """One column, in row order."""
        return [row[name] for row in self.rows]

    def where(self, **conditions: Any) -> list[dict[str, Any]]:
        """The rows whose columns have these values: `results.where(method="heun", step=0.01)`."""
        return [row for row in self.rows if all(row[key] == value for key, value in conditions.items())]

    @property
    def lost(self) -> list[dict[str, Any]]:
        """The rows of the cases that diverged or failed."""
        return [row for row in self.rows if row["status"] != "done"]

    @property
    def exit_code(self) -> int:
        """0 where every case is done, 1 where some diverged or failed, or the report did."""
        return 1 if self.lost or self.report_error else 0

    def write(self) -> None:
        """Write `results.csv`, and `results.parquet` where pyarrow is installed, into the run folder."""
        text = io.StringIO()
        writer = csv.DictWriter(text, self.columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(self.rows)  # None becomes an empty cell
        write_atomically(self.out / "results.csv", text.getvalue().encode())
        self._write_parquet()

    def _write_parquet(self) -> None:
        try:
            import pyarrow as pa
            import pyarrow.parquet as pq
        except ImportError:
            return

        def kind(name: str) -> Any:
            if name in _TEXT:
                return pa.string()
            return pa.bool_() if name == "is_reference" else pa.int64() if name in _WHOLE else pa.float64()

        schema = pa.schema([(name, kind(name)) for name in self.columns])
        buffer = io.BytesIO()
        pq.write_table(pa.Table.from_pylist(self.rows, schema=schema), buffer)
        write_atomically(self.out / "results.parquet", buffer.getvalue())
