"""Tables of the command line: the outcome of a campaign, and what a turbine is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from fatigue_runner.campaign import Results


def print_results(results: Results, console: Console) -> None:
    """Which integrator is good enough and what it costs, as a table and in words."""
    from rich.markup import escape

    from fatigue_runner.report.ranking import answer, rank, unseen_winds

    summaries = rank(results.rows)
    console.print()
    console.print(_table(results, summaries, console))
    for sentence in [*answer(summaries), *unseen_winds(summaries)]:
        console.print(escape(sentence))
    for row in results.lost[:10]:
        when = (
            f"at {row['diverged_at']:.4g} s" if row["status"] == "diverged" else f": {row['error_message']}"
        )
        console.print(f"[red]{row['status']}[/] {escape(row['case_id'])} {escape(when)}", soft_wrap=True)
    if len(results.lost) > 10:
        console.print(f"... and {len(results.lost) - 10} more; see the column `status` of results.csv")
    console.print(
        f"{len(results)} cases, {results.simulated} of them simulated now, in {results.wall_time:.1f} s; "
        f"table: {escape(str(results.out / 'results.csv'))}",
        soft_wrap=True,
    )
    if results.report_error:
        console.print(f"[red]no report:[/] {escape(results.report_error)}", soft_wrap=True)
        console.print(
            f"`fatigue-runner report {escape(str(results.out))} --debug` tries again", soft_wrap=True
        )
    else:
        console.print(f"report: {escape(str(results.out / 'report.html'))}", soft_wrap=True)


def _table(results: Results, summaries: Any, console: Console) -> Any:
    """Integrators, cheapest first; a narrow terminal gets one column for the worst of all channels."""
    from rich import box
    from rich.table import Table

    from fatigue_runner.channels import BY_NAME
    from fatigue_runner.report.ranking import fatigue_columns

    fatigue = fatigue_columns(results.rows)
    channels = list(dict.fromkeys(channel for channel, _, _ in fatigue))
    labels = {channel: BY_NAME[channel].label.removesuffix(" moment") for channel in channels}
    groups = {label.replace("blade ", "blade\u00a0"): [channel] for channel, label in labels.items()}
    longest = max((len(summary.label) for summary in summaries), default=0)
    if 46 + max(20, longest) + 12 * len(groups) > console.width:
        groups = {"DEL error": channels}
    table = Table(
        box=box.SIMPLE_HEAD, title="Integrators, cheapest first; DEL errors in %", title_justify="left"
    )
    # a long name may wrap, a figure must not
    table.add_column("integrator", vertical="bottom", min_width=min(longest, 24))
    for heading in ("evals per s", "wall ms per s", "NRMSE median", "NRMSE worst"):
        table.add_column(heading.replace(" ", "\n"), justify="right", no_wrap=True)
    for heading in groups:
        table.add_column(heading.replace(" ", "\n"), justify="right", no_wrap=True)
    table.add_column("DEL\nerror", no_wrap=True)
    for summary in summaries:
        wall_time = summary.wall_time_per_second
        table.add_row(
            summary.label,
            _figure(summary.evaluations_per_second, "{:.0f}"),
            _figure(None if wall_time is None else wall_time * 1e3, "{:.3g}"),
            _figure(summary.nrmse_median, "{:.1e}"),
            _figure(summary.nrmse_worst, "{:.1e}"),
            *(_worst_error(results, summary, fatigue, group) for group in groups.values()),
            _verdict(summary),
        )
    table.caption = (
        "evaluations and wall time per simulated second; DEL errors: worst over winds and exponents"
    )
    table.caption_justify = "left"
    return table


def _worst_error(results: Results, summary: Any, fatigue: Any, channels: list[str]) -> str:
    from fatigue_runner.report.cells import numbers
    from fatigue_runner.report.ranking import integrator_key

    rows = [row for row in results.rows if integrator_key(row) == summary.key and row["status"] == "done"]
    columns = [f"del_error_{suffix}" for channel, _, suffix in fatigue if channel in channels]
    errors = [100 * abs(error) for column in columns for error in numbers(rows, column)]
    if not errors:
        return ""
    return f"{max(errors):.2g}" if max(errors) >= 1e-3 else "< 0.001"


def _figure(value: float | None, form: str) -> str:
    return "" if value is None else form.format(value)


def _verdict(summary: Any) -> str:
    from fatigue_runner.report.cells import format_percent
    from fatigue_runner.report.ranking import LEVELS

    if not summary.complete:
        return f"[red]{summary.cases - summary.done} of {summary.cases} lost[/]"
    if summary.is_reference:
        return "reference"
    if summary.worst_del_error is None:
        return "not compared"
    met = [level for level in LEVELS if summary.worst_del_error.size <= level]
    return f"[green]≤ {format_percent(min(met))}[/]" if met else f"> {format_percent(max(LEVELS))}"


def print_turbine(name: str, winds: Sequence[float], pitch_deg: float, console: Console) -> None:
    """Masses, power coefficient, operating points, frequencies and stability limits of a turbine.

    name: shipped turbine or path; winds [m/s]; pitch_deg: positive to feather.
    Raises InputError for an unknown turbine, and for a wind or a pitch without steady rotation.
    """
    from fatigue_runner.turbine import load_turbine

    turbine = load_turbine(name)
    pitch = float(np.deg2rad(pitch_deg))
    console.print(f"[bold]{turbine.name}[/]  {turbine.description}", soft_wrap=True)
    console.print(f"hash {turbine.hash}", soft_wrap=True)
    console.print(_masses(name, turbine))
    console.print(_operating_points(turbine, winds, pitch))
    console.print(_frequencies(turbine, winds, pitch))
    console.print(_stability(turbine))


def _plain_table(title: str, *headings: str) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, title=title, title_justify="left")
    table.add_column(headings[0])
    for heading in headings[1:]:
        table.add_column(heading.replace(" (", "\n("), justify="right")
    return table


def _masses(name: str, turbine: Any) -> Table:
    from fatigue_runner.turbine.beam import blade_modes, tower_modes
    from fatigue_runner.turbine.parameters import read_turbine_file

    data = read_turbine_file(name)
    blade, tower = blade_modes(data), tower_modes(data)
    # P = Omega Q and c_torque is Q over rho/2 A V^2 R (all blades), hence C_p = lambda c_torque.
    power = turbine.tables.tip_speed_ratio[:, None] * turbine.tables.coefficients["torque"]
    i, j = np.unravel_index(np.argmax(power), power.shape)
    table = _plain_table("Check values", "", "value", "unit")
    for what, value, unit in (
        ("blade mass", f"{blade.mass:,.0f}", "kg"),
        ("blade first moment about its root", f"{blade.first_moment:,.0f}", "kg·m"),
        ("blade second moment about its root", f"{blade.second_moment:,.0f}", "kg·m²"),
        ("tower mass", f"{tower.mass:,.0f}", "kg"),
        ("tower centre of mass above its base", f"{tower.first_moment / tower.mass:.3f}", "m"),
        ("largest power coefficient of the tables", f"{power[i, j]:.4f}", "-"),
        ("... at tip-speed ratio", f"{turbine.tables.tip_speed_ratio[i]:.2f}", "-"),
        ("... at pitch", f"{np.rad2deg(turbine.tables.pitch[j]):.1f}", "deg"),
    ):
        table.add_row(what, value, unit)
    return table


def _operating_points(turbine: Any, winds: Sequence[float], pitch: float) -> Table:
    from fatigue_runner.channels import BY_NAME

    names = (
        *("rotor_speed", "generator_torque", "tower_fore_aft", "blade1_tip_out_of_plane"),
        *("blade1_root_flapwise_moment", "tower_base_fore_aft_moment", "rotor_thrust"),
    )
    headings = [f"{BY_NAME[name].label}, {BY_NAME[name].read_unit}" for name in names]
    table = _plain_table("Operating points", "wind, m/s", *headings)
    for wind in winds:
        values = _means_over_a_revolution(turbine, wind, pitch)
        table.add_row(f"{wind:g}", *(f"{values[name] * BY_NAME[name].scale:,.4g}" for name in names))
    table.caption = "means over a revolution, without shear"
    return table


def _means_over_a_revolution(turbine: Any, wind: float, pitch: float) -> dict[str, float]:
    from fatigue_runner.channels import STATE_NAMES

    azimuths = np.arange(24) * 2 * np.pi / 24
    states = np.array([turbine.operating_point(wind, azimuth=azimuth, pitch=pitch) for azimuth in azimuths])
    signals = np.tile([wind, 0.0, 0.0], (len(azimuths), 1))
    series = dict(zip(STATE_NAMES, states.T, strict=True)) | turbine.loads(states, signals, pitch)
    return {name: float(np.mean(values)) for name, values in series.items()}


def _frequencies(turbine: Any, winds: Sequence[float], pitch: float) -> Table:
    modes = [turbine.natural_frequencies(wind, pitch) for wind in winds]
    table = _plain_table("Natural frequencies", "mode", *(f"{wind:g} m/s" for wind in winds))
    for mode, _, _ in modes[0]:
        found = [next((m for m in at_wind if m[0] == mode), None) for at_wind in modes]
        table.add_row(mode, *("" if m is None else f"{m[1]:.4f} Hz ({100 * m[2]:.2f} %)" for m in found))
    table.caption = "damping ratio in parentheses; of the spinning turbine at its operating point"
    return table


def _stability(turbine: Any) -> Table:
    from fatigue_runner.integrators import METHODS, stability_limit

    table = _plain_table("Stability limits", "method", "largest step, ms")
    for method in METHODS:
        table.add_row(method, f"{1e3 * stability_limit(turbine, method):.3g}")
    table.caption = "linearised at 8 m/s"
    return table


def train_with_progress(
    recipe: Any, out: Any, initial_state: Any, overrides: dict[str, Any], console: Console
) -> None:
    """Train a recipe with a line of progress; a network's training can be stopped and goes on from its checkpoint."""
    from fatigue_runner.corrector.card import validation_rows
    from fatigue_runner.corrector.recipes import train_file

    with console.status("making the samples") as status:

        def epoch(at: dict[str, float]) -> None:
            status.update(
                f"epoch {at['epoch']:.0f}/{at['epochs']:.0f}: validation {at['validation']:.3e}, best {at['best']:.3e} (Ctrl-C ends)"
            )

        checkpoint = (out or recipe.parent) / f".{overrides.get('name') or recipe.stem}.checkpoint"
        made = train_file(recipe, out, initial_state, overrides, status.update, epoch, checkpoint)
    if checkpoint.exists():
        epochs = made.corrector.training["epochs"]
        console.print(f"stopped after {epochs} epochs: the best so far is written, the same command goes on")
    for label, value in validation_rows(made.corrector)[:7]:
        console.print(f"{label}: {value}")
    console.print(f"corrector: {made.path}\ncard: {made.card}")


def tune_with_progress(
    recipe: Any,
    out: Any,
    initial_state: Any,
    overrides: dict[str, Any],
    trials: int,
    epochs: int,
    console: Console,
) -> dict[str, Any] | None:
    """Search for a network's settings, a line per trial; None where Ctrl-C ended it: the same command goes on."""
    from fatigue_runner.corrector.training_recipe import tune_file

    def trial(report: Any) -> None:
        value = "-" if report.value is None else f"{report.value:.3e}"
        settings = ", ".join(
            f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in report.settings.items()
        )
        console.print(f"trial {report.number}: {report.state}, validation {value}; {settings}")

    storage = (out or recipe.parent) / f".{overrides.get('name') or recipe.stem}.tuning.db"
    with console.status(f"{trials} trials of {epochs} epochs (Ctrl-C ends, the same command goes on)"):
        settings, stopped = tune_file(recipe, storage, initial_state, trials, epochs, overrides, trial)
    console.print("best: " + ", ".join(f"{k}: {v}" for k, v in settings.items()))
    return None if stopped else settings
