"""From a trajectory's arrays to the columns of the log's topics."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from fatigue_runner import channels
from fatigue_runner.errors import did_you_mean
from fatigue_runner.logbook.errors import LogError
from fatigue_runner.logbook.schema import Topic, select_topics
from fatigue_runner.trajectory import Trajectory

# Status fields that every trajectory has, and those that only some runs know.
STATUS_ARRAYS = ("accepted", "discrepancy", "threshold", "local_error")
EXTRA_STATUS = ("reference_error", "clamped_lookups")


def _table(values: np.ndarray, names: Sequence[str], what: str, rows: int) -> dict[str, np.ndarray]:
    """Columns of a (rows, k) array by name, k <= len(names)."""
    values = np.asarray(values, float)
    if not values.size:
        return {}
    if values.ndim != 2 or len(values) != rows or values.shape[1] > len(names):
        raise LogError(
            f"the {what} to log has shape {values.shape}; it must be ({rows}, {len(names)} or fewer)"
        )
    return dict(zip(names, values.T, strict=False))


def _wind(block: Trajectory, rows: int) -> dict[str, np.ndarray]:
    """Columns of the wind by name; a pair's sine is never without its cosine."""
    names = [c.name for c in (block.wind_signals or (*channels.WIND_SIGNALS, *channels.WIND_HARMONICS))]
    found = _table(block.wind, names, "wind", rows)
    if sum(c.name in found for c in channels.WIND_HARMONICS) % 2:
        raise LogError(
            f"the wind to log has {len(found)} columns; it must be 3 + 2 M for M azimuthal harmonics"
        )
    return found


def _control(block: Trajectory, rows: int) -> dict[str, np.ndarray]:
    """What is seen of a controller; its states stand among the states."""
    found = {
        c.name: np.asarray(block.control[c.name], float)
        for c in block.control_signals
        if c.name in block.control
    }
    for name, values in found.items():
        if values.shape != (rows,):
            raise LogError(f"signal {name} to log has shape {values.shape}; it must be ({rows},)")
    return found


def _status(
    block: Trajectory, extra: Mapping[str, np.ndarray | None], rows: int, first_row: int
) -> dict[str, np.ndarray]:
    """Status columns of length `rows`; entry k belongs to the interval that ends at time k of the block."""
    known = {name: getattr(block, name) for name in STATUS_ARRAYS}
    known |= {name: values for name, values in extra.items() if values is not None}
    # A lone first row is the initial state: nothing tells yet whether a status will follow, so it may.
    if not any(np.size(v) for v in known.values()) and not (first_row == 0 and rows == 1):
        return {}
    intervals = rows - 1 if first_row == 0 else rows
    found = {}
    for name, values in known.items():
        column = np.asarray(values, dict(accepted=bool, clamped_lookups=np.uint32).get(name, float))
        if column.shape == (0,):
            column = np.full(intervals, name == "accepted" or np.nan, column.dtype)
        if column.shape != (intervals,):
            raise LogError(
                f"{name} to log has shape {column.shape}; it must be ({intervals},), one entry per interval"
            )
        # Row 0 ends no interval; its place is not written.
        found[name] = np.concatenate([np.zeros(rows - intervals, column.dtype), column])
    return found


def columns(
    block: Trajectory, extra: Mapping[str, np.ndarray | None] | None = None, first_row: int = 0
) -> dict[str, dict[str, np.ndarray]]:
    """Topic key -> field name -> (n,) column of a block whose first row is row `first_row` of the log.

    extra: the columns of `EXTRA_STATUS`, one entry per interval, or None where unknown. Topics of which the
    block has nothing are absent. Raises LogError for arrays that do not fit each other or a load that has
    no number.
    """
    time = np.asarray(block.time, float)
    if time.ndim != 1:
        raise LogError(f"the times to log have shape {time.shape}; they must be (n,)")
    rows = len(time)
    loads = {}
    for name, values in block.loads.items():
        if name not in channels.LOAD_NAMES and not channels.placed(name):
            raise LogError(f"unknown load channel {name!r}{did_you_mean(name, channels.LOAD_NAMES)}")
        if np.shape(values) != (rows,):
            raise LogError(f"load {name} to log has shape {np.shape(values)}; it must be ({rows},)")
        loads[name] = values
    found = {
        "status": _status(block, extra or {}, rows, first_row),
        "state": _table(block.state, [c.name for c in block.states], "state", rows),
        "loads": loads,
        "wind": _wind(block, rows),
        "control": _control(block, rows),
    }
    return {key: {"time": time, **fields} for key, fields in found.items() if fields}


def topics_of(
    available: Mapping[str, Mapping[str, np.ndarray]],
    keys: Iterable[str] | None,
    names: Iterable[str] | None,
    run: Trajectory,
    precision: str = "float64",
) -> tuple[Topic, ...]:
    """The topics, in row order and with the fields that are available, that a log keeps.

    keys: topics asked for, None for what is there; names: channels asked for, None for all (status is not a
    matter of channels); run: whose states and wind signals they are; precision: of their numbers.
    Raises LogError for a topic or channel that
    is asked for and not there.
    """
    kept = [t for t in select_topics(keys) if keys is not None or t.key in available]
    if names is not None:
        names = list(names)
        there = [n for key, fields in available.items() if key != "status" for n in fields if n != "time"]
        for name in names:
            if name not in there:
                raise LogError(
                    f"cannot log channel {name!r}, the run does not have it{did_you_mean(name, there)}"
                )
    own = {"state": run.states, "wind": run.winds, "control": run.control_signals}
    sections = [channels.BY_NAME[name] for name in run.loads if channels.placed(name)]
    found = []
    for t in kept:
        if t.key not in available:
            raise LogError(f"cannot log topic {t.key!r}: the run has no {t.key}; leave it out of the topics")
        fields = set(available[t.key])
        if names is not None and t.key != "status":
            fields &= set(names)
        if fields - {"time"}:
            whole = t.with_sections(sections) if t.key == "loads" else t.of(own[t.key]) if t.key in own else t
            found.append(whole.only(fields).at(precision))
    if [t.key for t in found] == ["status"]:
        raise LogError(
            "cannot log the status alone: it has no row for the first time; add state, loads or wind"
        )
    return tuple(found)
