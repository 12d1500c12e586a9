"""`fatigue-runner calibrate fit | apply`."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Annotated, Any

import typer

from fatigue_runner.terminal import command_group, console, writable_file

app = command_group(
    "Learn from another program's output series what our loads lack, so that damage-equivalent loads meet its own."
)
COLUMNS = (
    *("case_id", "wind_speed", "channel", "wohler_exponent", "del", "del_calibrated", "low", "high"),
    "extrapolates",
)
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Replace a file that is there and holds something else.")
]


@app.command()
def fit(
    file: Annotated[
        Path, typer.Argument(metavar="CALIBRATION.yaml", help="Which case belongs to which series.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="File to write; default: NAME.calibration.json here.",
            show_default=False,
            callback=lambda path: writable_file(path, "--out"),
        ),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Fit the corrections, and judge them on what was left out.

    Run the same winds here first, then name for each case the other program's output (CSV, OpenFAST's .out, .npz) in a file:

        name: richer
        run: runs/same-winds
        series:
          - {case: v08.00_s1, file: theirs/wind8.csv}
          - {case: v18.00_s1, file: theirs/wind18.csv}
          - {case: v12.00_s1, file: theirs/wind12.csv, use: judge}

    Examples:

        fatigue-runner calibrate fit calibration.yaml

        fatigue-runner calibrate fit calibration.yaml --out richer.json
    """
    from fatigue_runner.calibration.calibration import calibrate

    found, judged = calibrate(file)
    path = out or Path(f"{found.name}.calibration.json")
    to = console()
    for table in tables(found, judged):
        to.print(table)
        to.print()
    to.print(verdict(judged), highlight=False)
    found.write(path, overwrite)
    typer.echo(f"calibration: {path}")


@app.command()
def apply(
    calibration: Annotated[Path, typer.Argument(help="What `calibrate fit` wrote.")],
    run: Annotated[Path, typer.Argument(help="Run folder with logs, of the same turbine.")],
    method: Annotated[
        str, typer.Option("--method", "-m", help="Integrator, where the run has several (`rk4 50 ms`).")
    ] = "",
    overwrite: Overwrite = False,
) -> None:
    """Correct the loads of a run, each with its uncertainty; writes `calibrated.csv` into its folder.

    Example:

        fatigue-runner calibrate apply richer.calibration.json runs/dlc12
    """
    from fatigue_runner.calibration.calibration import Calibration, corrected
    from fatigue_runner.calibration.runs import RunFolder
    from fatigue_runner.inputs.files import write_new

    made = Calibration.read(calibration)
    found = corrected(made, RunFolder.read(run), method)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for c in found:
        for i, m in enumerate(made.exponents):
            values = c.plain[i], c.corrected[i], *c.interval[:, i]
            writer.writerow(
                [c.case, f"{c.wind:g}", c.channel, f"{m:g}", *(f"{v:.6g}" for v in values), c.extrapolates]
            )
    path = run / "calibrated.csv"
    write_new(path, text.getvalue().encode(), overwrite)
    console().print(applied(found))
    outside = sorted({c.case for c in found if c.extrapolates})
    if outside:
        typer.echo(
            f"{len(outside)} of {len({c.case for c in found})} cases lie outside of what {made.name} was made from, where nothing says how "
            f"good it is ({', '.join(outside[:3])}{', ...' if len(outside) > 3 else ''}; the column `extrapolates` says in what)"
        )
    typer.echo(f"table: {path}")


def _table(title: str, heads: list[str], rows: list[list[str]], caption: str = "") -> Any:
    from rich.table import Table

    made = Table(
        title=title,
        title_justify="left",
        box=None,
        pad_edge=False,
        header_style="bold",
        caption=caption,
        caption_justify="left",
    )
    for i, head in enumerate(heads):
        made.add_column(head, justify="left" if i < 2 else "right")
    for row in rows:
        made.add_row(*row)
    return made


def tables(found: Any, judged: list[Any]) -> list[Any]:
    """What was fitted, and how every run is met."""
    forms = []
    for name, c in found.corrections.items():
        errors = found.block_errors[name]
        forms.append([name, str(c.form), _percent(errors["none"]), _percent(errors[str(c.form)])])
    made = [
        _table(
            f"Corrections of {found.name}, from {len(found.runs)} runs",
            ["channel", "correction", "error without", "with"],
            forms,
            "Errors: root mean square over exponents and blocks, each block left out of the fit that corrects it.",
        )
    ]
    rows = []
    for j in judged:
        left = "–" if j.left_out is None else _largest(j.left_out)
        rows.append(
            [
                j.channel,
                j.case,
                f"{j.wind:.3g}",
                j.use,
                _largest(j.plain),
                _largest(j.corrected),
                left,
                "yes" if j.extrapolates else "",
            ]
        )
    heads = ["channel", "run", "wind", "use", "DEL error", "corrected", "left out", "extrapolates"]
    caption = (
        "Of the worst Wöhler exponent. Left out: by a fit without this run; whether that extrapolates to it."
    )
    return [*made, _table("Damage-equivalent loads against the other program's", heads, rows, caption)]


def verdict(judged: list[Any]) -> str:
    """Which channels meet the other program within the aim on runs that the fit did not see, inside and outside of its winds."""
    from fatigue_runner.calibration.calibration import AIM

    said = []
    for words, outside in (("within the winds that the fit saw", False), ("where it extrapolates", True)):
        own = [j for j in judged if j.left_out is not None and bool(j.extrapolates) is outside]
        worst = {j.channel: 0.0 for j in own}
        for j in own:
            worst[j.channel] = max(worst[j.channel], float(abs(j.left_out).max()))
        if not worst:
            said.append(f"No run that was left out lies {words}.")
            continue
        parts = []
        for what, chosen in (
            (f"at most {AIM * 100:g} %", [n for n in worst if worst[n] <= AIM]),
            ("more", [n for n in worst if worst[n] > AIM]),
        ):
            if chosen:
                parts.append(f"{what}: {', '.join(f'{name} ({_percent(worst[name])})' for name in chosen)}")
        said.append(f"Largest DEL error of runs that were left out, {words}: {'; '.join(parts)}.")
    return "\n".join(said)


def applied(found: list[Any]) -> Any:
    """By channel: the factor on the loads and how sure it is."""
    rows = []
    for name in dict.fromkeys(c.channel for c in found):
        own = [c for c in found if c.channel == name]
        factors = [f for c in own for f in c.corrected / c.plain]
        unsure = [u for c in own for u in (c.interval[1] - c.interval[0]) / 2 / c.corrected]
        rows.append([name, f"{len(own)}", f"{min(factors):.3f} to {max(factors):.3f}", _percent(max(unsure))])
    caption = "Uncertainty: half of the 90 % interval that the fit leaves (its blocks drawn anew), the largest; the seeds come on top."
    return _table("Corrected loads", ["channel", "cases", "factor on the DEL", "uncertainty"], rows, caption)


def _percent(value: float) -> str:
    return f"{value * 100:.2g} %"


def _largest(errors: Any) -> str:
    at = max(range(len(errors)), key=lambda i: abs(errors[i]))
    return f"{errors[at] * 100:+.2g} %"
