"""`fatigue-runner benchmark`: kernel, work-precision, paper, stability, wind, campaign, logs, live."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import is_dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from fatigue_runner.terminal import command_group, console, writable_file, writable_folder

app = command_group(
    "Measure the kernel, every integrator's error over cost, the paper's experiment, the logs; each in one run."
)

Json = Annotated[
    Path | None,
    typer.Option(
        "--json",
        metavar="FILE",
        help="Write all figures as JSON.",
        show_default=False,
        callback=lambda path: writable_file(path, "--json"),
    ),
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


def _read(path: Path) -> Any:
    from fatigue_runner.errors import InputError

    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path} is not the JSON of an earlier run ({error})") from None


def _written(write: Callable[..., Path], folder: Path, *arguments: Any) -> Path:
    """What `write` returns. Raises InputError where `folder` cannot be written."""
    from fatigue_runner.errors import InputError

    try:
        return write(*arguments)
    except OSError as error:
        raise InputError(
            f"{folder} cannot be written ({error.strerror}); give --out another folder"
        ) from None


def _say(what: str) -> None:
    typer.echo(what, err=True)


@app.command()
def kernel(
    repeats: Annotated[int, typer.Option("--repeats", min=3, help="Interleaved repeats.")] = 15,
    json: Json = None,
) -> None:
    """Cost of one evaluation of the equations of motion: packed, scalar, share of the peak; and of the paper's network.

    Example:

        fatigue-runner benchmark kernel --json kernel.json
    """
    from fatigue_runner.benchmark.pages.work_precision import speed
    from fatigue_runner.benchmark.speed import kernel as measured
    from fatigue_runner.benchmark.speed import network

    result = measured.measure(repeats)
    result["network"] = network.measure_with_one_thread(max(3, repeats // 2))
    typer.echo(f"{speed('kernel', result)}\n\n{speed('network', result['network'])}")
    _write(result, json)


@app.command(name="work-precision")
def work_precision(
    campaign: Annotated[
        Path | None,
        typer.Argument(
            metavar="[CAMPAIGN]", help="Campaign file; default: the shipped campaigns/work_precision.yaml."
        ),
    ] = None,
    rounds: Annotated[
        int | None,
        typer.Option("--rounds", min=1, help="Interleaved timing rounds; default as the file says."),
    ] = None,
    workers: Annotated[
        int,
        typer.Option("--workers", "-w", min=1, help="Processes for the errors; times are measured in one."),
    ] = 2,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="Folder for the pages `work-precision*.md` and their figures.",
            show_default=False,
            callback=lambda path: writable_folder(path, "--out"),
        ),
    ] = None,
    json: Json = None,
    errors_only: Annotated[
        bool,
        typer.Option("--errors-only", help="Leave the times out; `--reuse` of the JSON adds them later."),
    ] = False,
    reuse: Annotated[
        Path | None,
        typer.Option(
            "--reuse",
            metavar="FILE",
            help="JSON of an earlier run: keep its errors, measure the times.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Error over cost of every integrator and every corrector on the same unseen winds; which one is cheapest, in words.

    All registered methods and all shipped correctors run, and what the campaign lists beside them.

    Examples:

        fatigue-runner benchmark work-precision --out docs

        fatigue-runner benchmark work-precision campaigns/quickstart.yaml --out work --json work.json

        fatigue-runner benchmark work-precision --errors-only --json errors.json

        fatigue-runner benchmark work-precision --reuse errors.json --out docs
    """
    from fatigue_runner.benchmark.pages import work_precision as page
    from fatigue_runner.benchmark.run import measure

    earlier = None if reuse is None else (_read(reuse), str(reuse))
    result = measure(
        campaign, rounds=rounds, workers=workers, timed=not errors_only, earlier=earlier, say=_say
    )
    for part in result["cases"]:
        typer.echo(page.section(part) + "\n")
    if out is not None:
        typer.echo(f"page: {_written(page.write, out, result, out, out / 'images')}")
    _write(result, json)


@app.command()
def paper(
    correctors: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[CORRECTOR]...",
            help="Names or paths; default: every shipped one for the paper's turbine.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="Folder for the page and its figures.",
            show_default=False,
            callback=lambda path: writable_folder(path, "--out"),
        ),
    ] = None,
    json: Json = None,
) -> None:
    """The experiment of arXiv:2504.05493 anew: its methods and network on 200 winds in range and 200 beyond, as box plots.

    Example:

        fatigue-runner benchmark paper --out docs
    """
    from fatigue_runner.benchmark.pages import paper as page
    from fatigue_runner.benchmark.study import paper as measured

    results = measured.both(correctors or None, _say)
    for result in results:
        typer.echo(page.section(result) + "\n")
    typer.echo("\n".join(f"- {claim}" for claim in measured.claims(*results)))
    if out is not None:
        typer.echo(f"page: {_written(page.write, out, *results, out)}")
    _write([measured.to_json(r) for r in results], json)


@app.command()
def stability(
    seeds: Annotated[int, typer.Option("--seeds", min=1, help="Unseen turbulent winds.")] = 100,
    duration: Annotated[float, typer.Option("--duration", min=1.0, help="Length of each [s].")] = 600.0,
    json: Json = None,
) -> None:
    """Every shipped corrector over many unseen winds: what diverges, enhanced and hybrid, and how often the hybrid accepts.

    Example:

        fatigue-runner benchmark stability
    """
    from fatigue_runner.benchmark.pages.work_precision import speed
    from fatigue_runner.benchmark.study import stability as measured

    result = measured.measure(seeds, duration, _say)
    typer.echo(speed("stability", result))
    _write(result, json)


@app.command()
def wind(
    repeats: Annotated[int, typer.Option("--repeats", min=1, help="Interleaved repeats of the runs.")] = 5,
    json: Json = None,
) -> None:
    """What wind costs on one core: 66 ten-minute series, a full field on the rotor, evaluations with 1, 3 and 6 azimuthal harmonics.

    Example:

        fatigue-runner benchmark wind --json wind.json
    """
    from fatigue_runner.benchmark.pages import tables
    from fatigue_runner.benchmark.speed import wind as measured

    result = measured.measure(repeats)
    console().print(tables.wind(result))
    _write(result, json)


@app.command()
def campaign(
    duration: Annotated[
        float, typer.Option("--duration", min=20.0, help="Simulated seconds per case.")
    ] = 600.0,
    seeds: Annotated[int, typer.Option("--seeds", min=1, help="Winds at each of ten speeds.")] = 16,
    repeats: Annotated[int, typer.Option("--repeats", min=1, help="Runs of every situation, in turn.")] = 3,
    json: Json = None,
) -> None:
    """Where a campaign's time goes: wind, integration, loads, counting, ..., logging; in one process and in two, with logs and without.

    Example:

        fatigue-runner benchmark campaign --json campaign.json
    """
    from fatigue_runner.benchmark.pages import tables
    from fatigue_runner.benchmark.speed import campaign as measured

    result = measured.measure(duration, seeds, repeats, say=_say)
    console(120).print(tables.campaign(result))
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
    from fatigue_runner.benchmark.pages import tables
    from fatigue_runner.benchmark.speed import logs as measured

    result = measured.measure(rows, repeats)
    console().print(tables.logs(result))
    _write(result, json)


@app.command()
def live(
    rounds: Annotated[int, typer.Option("--rounds", min=1, help="Runs of every situation, in turn.")] = 5,
    duration: Annotated[float, typer.Option("--duration", min=1, help="Simulated seconds per case.")] = 120.0,
    json: Json = None,
) -> None:
    """What it costs a campaign to be watched: viewer open, absent, stopped, killed, beside the same campaign unwatched.

    Example:

        fatigue-runner benchmark live --json live.json
    """
    from fatigue_runner.benchmark.pages import tables
    from fatigue_runner.benchmark.speed import live as measured

    result = measured.measure(rounds, duration, say=_say)
    console(110).print(tables.live(result))
    _write(result, json)
