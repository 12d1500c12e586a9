"""`fatigue-runner benchmark`: kernel, work-precision, logs."""

from __future__ import annotations

import json
from dataclasses import is_dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    help="Measure the kernel, every integrator's error over cost, the logs; each in one run.",
)

Json = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Write all figures as JSON.", show_default=False)
]


def _plain(value: Any) -> Any:
    return value.to_dict() if is_dataclass(value) and hasattr(value, "to_dict") else str(value)


def _write(result: Any, path: Path | None) -> None:
    if path is None:
        return
    from fatigue_runner.errors import InputError

    try:
        path.write_text(json.dumps(result, indent=1, default=_plain), encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}); give --json another path") from None
    typer.echo(f"figures: {path}")


@app.command()
def kernel(
    repeats: Annotated[int, typer.Option("--repeats", min=3, help="Interleaved repeats.")] = 15,
    json: Json = None,
) -> None:
    """Cost of one evaluation of the equations of motion: packed, scalar, share of the peak; and of the paper's network.

    Example:

        fatigue-runner benchmark kernel --json kernel.json
    """
    from fatigue_runner.benchmark import kernel as measured
    from fatigue_runner.benchmark import network, text

    result = measured.measure(repeats)
    result["network"] = network.measure_with_one_thread(max(3, repeats // 2))
    typer.echo("\n".join([*text.kernel(result), "", *text.network(result["network"])]))
    _write(result, json)


@app.command(name="work-precision")
def work_precision(
    campaigns: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[CAMPAIGN]...", help="Campaign files whose winds to use; default: built-in cases."
        ),
    ] = None,
    repeats: Annotated[int, typer.Option("--repeats", min=1, help="Interleaved timing rounds.")] = 5,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Folder for the figures and the page `work-precision.md`.", show_default=False
        ),
    ] = None,
    json: Json = None,
) -> None:
    """Error over cost of every integrator at many steps on the same cases; the cheapest one for an accuracy, in words.

    All registered methods run, and what the campaign lists beside them.

    Examples:

        fatigue-runner benchmark work-precision

        fatigue-runner benchmark work-precision campaigns/quickstart.yaml --out work --json work.json
    """
    from fatigue_runner.benchmark import page, text

    result = page.measure(list(campaigns or []), repeats, lambda what: typer.echo(what, err=True))
    for part in result["cases"]:
        typer.echo("\n".join(text.cases(part)) + "\n")
    if out is not None:
        typer.echo(f"page: {page.write(result, out, out / 'images')}")
    _write(result, json)


@app.command()
def logs(
    rows: Annotated[int, typer.Option("--rows", min=1000, help="Rows per log.")] = 60_000,
    repeats: Annotated[int, typer.Option("--repeats", min=1)] = 3,
    json: Json = None,
) -> None:
    """How fast logs are written and read, beside other writers in the same run.

    Example:

        fatigue-runner benchmark logs
    """
    from rich.console import Console

    from fatigue_runner.benchmark import logs as measured

    result = measured.benchmark_logs(rows, repeats)
    Console().print(measured.table(result))
    _write(result, json)
