"""The cost and the errors of arXiv:2504.05493 where a campaign asks for them: delta_e over delta_t, acceptance over wind."""

from __future__ import annotations

from statistics import median
from typing import TYPE_CHECKING

from fatigue_runner.report.blocks import Block, Column, Figure, Paragraph, Section, Table, TableRow
from fatigue_runner.report.rundata import Run
from fatigue_runner.report.style import Look, draw_legend, looks, new_figure, plain_logarithm, styled, to_svg
from fatigue_runner.results.cells import Row, format_error, format_percent, number, numbers, text
from fatigue_runner.results.evaluation_cost import KINDS, F, delta_ts
from fatigue_runner.results.ranking import MethodSummary, integrator_key

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ORDER = 52
SHOWN = "lane"  # the kind that is drawn
ERRORS = {"delta_e_range": r"$\delta_{e,\mathrm{range}}$", "delta_e": r"$\delta_e$"}
HYBRID = "hybrid"


def build(run: Run) -> Section | None:
    """None where the evaluations were not timed."""
    if F not in run.evaluation_times:
        return None
    costs = {
        s: delta_ts(run.evaluation_times, s.evaluations_per_second, s.step, s.corrector)
        for s in run.integrators
        if s.evaluations_per_second is not None and s.step is not None
    }
    blocks: list[Block] = [
        Paragraph(
            "δt = (n_RK time(f) + n_N time(N)) / h: processor time of the evaluations alone, of the equations of motion (f) and of a "
            "learned correction (N), per simulated second. What a step does beside them is in the measured time only."
        ),
        _evaluations(run),
        _table(run, costs),
    ]
    drawn = [s for s in costs if costs[s] and numbers(_rows(run, s), "delta_e_range")]
    if drawn:
        caption = (
            "Error over δt (compiled, per case of many): boxes from quartile to quartile over the winds with the median, whiskers to the "
            "least and the largest. Left the mean square of error over range, right of error over value, which zero crossings rule."
        )
        blocks.append(Figure(_boxes(run, drawn, costs), caption, "Box plots of delta_e over delta_t"))
    guarded = [s for s in run.integrators if s.mode == HYBRID and numbers(_rows(run, s), "acceptance_rate")]
    if guarded:
        caption = "Share of the steps that a guard left to the learned correction, over wind speed; the others are the fallback's."
        blocks.append(Figure(_acceptance(run, guarded), caption, "Acceptance rate over wind speed"))
    return Section("Cost in evaluations (δt)", blocks)


def _rows(run: Run, summary: MethodSummary) -> list[Row]:
    return [row for row in run.rows if integrator_key(row) == summary.key and text(row, "status") == "done"]


def _evaluations(run: Run) -> Table:
    of_f = run.evaluation_times[F]
    rows = []
    for name, own in run.evaluation_times.items():
        ratio = "–" if name == F else f"{own[SHOWN] / of_f[SHOWN]:.2g}"
        who = "f" if name == F else f"N of {name}"
        rows.append(TableRow([who, *(f"{own[kind] * 1e9:,.0f}" for kind in KINDS), ratio]))
    columns = [
        Column("One evaluation", number=False),
        *(Column(words[:1].upper() + words[1:], "ns") for words in KINDS.values()),
        Column("time(N) / time(f)"),
    ]
    caption = "Medians, measured before the cases ran. One case alone takes a whole group of lanes."
    return Table(columns, rows, caption)


def _table(run: Run, costs: dict[MethodSummary, dict[str, float]]) -> Table:
    columns = [
        Column("Integrator", number=False),
        Column("f", "per s"),
        *(Column("δt", f"µs/s, {words}") for words in KINDS.values()),
        Column("Time", "µs/s, measured"),
        Column("δe,range", "median"),
        Column("δe,range", "worst"),
        Column("δe", "median"),
        Column("Accepted", "mean"),
        Column("DEL error", "worst"),
    ]
    rows = []
    for s, cost in costs.items():
        own = _rows(run, s)
        ranged, plain, accepted = (numbers(own, c) for c in ("delta_e_range", "delta_e", "acceptance_rate"))
        time = s.wall_time_per_second
        rows.append(
            TableRow(
                [
                    s.label, f"{s.evaluations_per_second:.0f}", *(_microseconds(cost.get(kind)) for kind in KINDS),
                    _microseconds(time), *(format_error(f(ranged) if ranged else None) for f in (median, max)),
                    format_error(median(plain) if plain else None),
                    f"{sum(accepted) / len(accepted) * 100:.1f} %" if accepted and s.mode == HYBRID else "–",
                    "–" if s.worst_del_error is None else format_percent(s.worst_del_error.size),
                ]
            )
        )  # fmt: skip
    return Table(columns, rows, "Errors against the reference, over all winds.")


def _microseconds(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value * 1e6:,.0f}" if value >= 1e-4 else f"{value * 1e6:.3g}"


def _boxes(run: Run, drawn: list[MethodSummary], costs: dict[MethodSummary, dict[str, float]]) -> str:
    with styled():
        figure = new_figure(4.2)
        look = looks(run.summaries)
        for axes, (column, label) in zip(figure.subplots(1, 2), ERRORS.items(), strict=True):
            for s in drawn:
                values = [v for v in numbers(_rows(run, s), column) if v > 0]
                if values:
                    _box(axes, values, costs[s][SHOWN] * 1e6, look[s])
            axes.set(xscale="log", yscale="log", xlabel="δt [µs per simulated second]", ylabel=label)
            axes.grid(axis="y")
            axes.autoscale_view()
            axes.margins(x=0.08)
            plain_logarithm(axes.xaxis)
        draw_legend(figure, drawn, look, dots=True)
        return to_svg(figure)


def _box(axes: Axes, values: list[float], at: float, look: Look) -> None:
    drawn = axes.boxplot(
        [values], positions=[at], widths=[0.12 * at], patch_artist=True, whis=(0, 100), manage_ticks=False,
        medianprops={"color": look.colour, "linewidth": 1.4}, whiskerprops={"color": look.colour}, capprops={"color": look.colour},
    )  # fmt: skip
    for patch in drawn["boxes"]:
        patch.set(facecolor=look.colour + "33", edgecolor=look.colour, linestyle=look.line)


def _acceptance(run: Run, guarded: list[MethodSummary]) -> str:
    with styled():
        figure = new_figure(2.8)
        axes, look = figure.subplots(), looks(run.summaries)
        for s in guarded:
            found = [(number(row, "wind_speed"), number(row, "acceptance_rate")) for row in _rows(run, s)]
            axes.plot(
                *zip(*sorted(p for p in found if None not in p), strict=True),
                **{**look[s].dots(), "markersize": 3},
            )
        axes.set(xlabel="hub-height wind speed [m/s]", ylabel="steps accepted", ylim=(-0.03, 1.03))
        axes.grid(axis="y")
        draw_legend(figure, guarded, look, dots=True)
        return to_svg(figure)
