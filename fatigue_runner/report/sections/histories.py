"""Time histories at three winds: tower-top fore-aft x_FA, and the distance from the reference."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fatigue_runner.channels import STATE_NAMES
from fatigue_runner.report.blocks import Figure, Paragraph, Section
from fatigue_runner.report.rundata import Run, WindCase
from fatigue_runner.report.selection import left_out, shown_integrators, shown_winds
from fatigue_runner.report.style import INK, Look, draw_legend, looks, new_figure, styled, to_svg
from fatigue_runner.results.cells import number, text
from fatigue_runner.results.ranking import MethodSummary

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ORDER = 30
STATE = "tower_fore_aft"
WINDOW = 60.0  # s; more than a minute on a third of a page is a black band
# s, about a period of the tower: a running maximum of the distance, since its zero crossings say nothing.
ENVELOPE = 3.0


def build(run: Run) -> Section:
    """x_FA(t) and its distance from the reference, a column per wind; a sentence where there are no logs."""
    title = "Time histories of the tower top"
    winds = [wind for wind in shown_winds(run) if _series(run, wind, run.reference) is not None]
    if not winds or run.reference is None:
        why = (
            "the campaign has no reference"
            if run.reference is None
            else "the run folder has no readable logs of the tower's motion"
        )
        return Section(title, [Paragraph(f"Not drawn: {why}.")])
    shown = shown_integrators(run)
    caption = (
        f"Tower-top fore-aft displacement x_FA at {len(winds)} winds of the campaign (above), and its "
        f"distance from the reference {run.reference.label} (below; running maximum over {ENVELOPE:g} s). "
        f"A curve that ends in × diverged there{window_words(run)}." + left_out(run, shown)
    )
    return Section(
        title,
        [Figure(_draw(run, winds, shown), caption, "Time histories of tower-top fore-aft displacement")],
    )


def window_words(run: Run) -> str:
    """How much of the time is shown, where it is not all."""
    begin = float(run.setting("discard", 0.0))
    counted = float(run.setting("duration", WINDOW)) - begin
    return f"; the first {WINDOW:g} s of the {counted:g} s that count are shown" if counted > WINDOW else ""


def _series(run: Run, wind: WindCase, summary: MethodSummary | None) -> tuple[np.ndarray, np.ndarray] | None:
    row = wind.row_of(summary) if summary else None
    log = run.log(text(row, "case_id")) if row is not None else None
    if log is None or len(log.time) < 2:
        return None
    start = min(float(run.setting("discard", 0.0)), float(log.time[-1]))
    inside = (log.time >= start) & (log.time <= start + WINDOW)
    if inside.sum() < 2:  # it diverged before or as the counted time began
        return None
    values = np.asarray(log.state)[inside, STATE_NAMES.index(STATE)] if len(log.state) else np.full(2, np.nan)
    return (np.asarray(log.time)[inside], values) if np.isfinite(values).all() else None


def _draw(run: Run, winds: list[WindCase], shown: list[MethodSummary]) -> str:
    with styled():
        figure = new_figure(4.3)
        above, below = figure.subplots(2, len(winds), sharex=True, squeeze=False, height_ratios=(1.15, 1))
        look = looks(run.summaries)
        for column, wind in enumerate(winds):
            _draw_wind(run, wind, shown, look, above[column], below[column])
            below[column].tick_params(labelleft=column == 0)
            below[column].set_xlabel("time [s]")
        _same_limits(below)
        above[0].set_ylabel("$x_\\mathrm{FA}$ [m]")
        below[0].set_ylabel("distance from reference [m]")
        draw_legend(figure, [*([run.reference] if run.reference else []), *shown], look)
        return to_svg(figure)


def _draw_wind(
    run: Run,
    wind: WindCase,
    shown: list[MethodSummary],
    look: dict[MethodSummary, Look],
    above: Axes,
    below: Axes,
) -> None:
    reference = _series(run, wind, run.reference)
    assert reference is not None
    seed = text(wind.rows[0], "seed")
    above.set_title(f"{wind.speed:.3g} m/s" + (f", seed {seed}" if seed else ""))
    for summary in shown:
        series = _series(run, wind, summary)
        if series is None:
            continue
        above.plot(*series, linewidth=1.0, **look[summary].curve())
        below.semilogy(*_envelope(series, reference), linewidth=1.0, **look[summary].curve())
        row = wind.row_of(summary)
        if row is not None and number(row, "diverged_at") is not None:
            above.plot(series[0][-1], series[1][-1], marker="x", color=look[summary].colour)
    above.plot(*reference, color=INK, linewidth=0.7)
    above.set_ylim(*_limits(reference[1]))
    below.grid(axis="y")


def _same_limits(row: Sequence[Axes]) -> None:
    limits = [axes.get_ylim() for axes in row if axes.has_data()]
    for axes in row if limits else ():
        axes.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))


def _limits(values: np.ndarray) -> tuple[float, float]:
    """Limits by the reference alone, and not narrower than a steady value deserves.

    A diverging curve may leave the axes, not flatten everything else; rounding must not fill them.
    """
    low, high = float(values.min()), float(values.max())
    span = max(high - low, 2e-3 * max(abs(low), abs(high)), 1e-6)
    middle = 0.5 * (low + high)
    return middle - 0.58 * span, middle + 0.58 * span


def _envelope(
    series: tuple[np.ndarray, np.ndarray], reference: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Running maximum of |series - reference| over ENVELOPE seconds, without zeros (no logarithm)."""
    count = min(series[0].size, reference[0].size)
    times, distance = series[0][:count], np.abs(series[1][:count] - reference[1][:count])
    half = max(1, round(0.5 * ENVELOPE / max(float(times[1] - times[0]), 1e-9)))
    padded = np.pad(distance, half, constant_values=0.0)
    largest = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1).max(axis=1)
    every = max(1, half // 4)
    keep = (np.isfinite(largest) & (largest > 0))[::every]
    return times[::every][keep], largest[::every][keep]
