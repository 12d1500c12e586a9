"""`fatigue-runner train`: a corrector from its recipe, with a line of progress."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fatigue_runner.errors import InputError
from fatigue_runner.terminal import command_group, console, writable_folder

if TYPE_CHECKING:
    from rich.console import Console

app = command_group()


@app.command()
def train(
    recipe: Annotated[
        Path | None,
        typer.Argument(
            metavar="[RECIPE]", help="The recipe's YAML file; none with --turbine trains the standard set."
        ),
    ] = None,
    turbine: Annotated[
        str | None,
        typer.Option("--turbine", "-t", help="Another turbine than the recipe's: a name or a YAML."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="Folder of the result; default: the recipe's.",
            show_default=False,
            callback=lambda path: writable_folder(path, "--out"),
        ),
    ] = None,
    step: Annotated[float | None, typer.Option("--step", help="Another step [s] than the recipe's.")] = None,
    seed: Annotated[int | None, typer.Option("--seed", help="Another seed than the recipe's.")] = None,
    name: Annotated[str | None, typer.Option("--name", help="Another name than the recipe's.")] = None,
    tune: Annotated[
        int, typer.Option("--tune", min=0, help="Networks: first search with this many Optuna trials.")
    ] = 0,
    tune_epochs: Annotated[int, typer.Option("--tune-epochs", min=1, help="Epochs of a trial.")] = 100,
) -> None:
    """Train a corrector: NAME.safetensors and its card NAME.md beside the recipe.

    Affine ones take seconds. A network's training can be stopped with Ctrl-C: the same command goes on.

    Examples:

        fatigue-runner train correctors/rk4-100ms.yaml

        fatigue-runner train correctors/rk4-100ms.yaml --step 0.08 --name rk4-80ms --out runs

        fatigue-runner train --turbine my-turbine.yaml
    """
    to = console()
    if recipe is None:
        if turbine is None:
            raise InputError("give a recipe, or --turbine FILE for the standard set of a turbine")
        if step is not None or name is not None or tune:
            raise InputError("--step, --name and --tune are of one recipe; give it, or leave them out")
        raise typer.Exit(_train_standard_set(turbine, out, seed, to))
    overrides: dict[str, Any] = {"step": step, "seed": seed, "name": name, "turbine": turbine}
    if tune:
        settings = _tune(recipe, out, overrides, tune, tune_epochs, to)
        if settings is None:
            raise typer.Exit(130)
        overrides |= {"training": settings, "seed": None}
    _train(recipe, out, overrides, to)


def _train_standard_set(turbine: str, out: Path | None, seed: int | None, console: Console) -> int:
    """Train the shipped recipes of the affine family for a turbine, NAME-TURBINE beside its file; the exit code: 1 where some cannot be."""
    from fatigue_runner.corrector.train import standard_recipes
    from fatigue_runner.turbine import load_turbine

    found = load_turbine(turbine)
    folder = out or (Path(turbine).parent if Path(turbine).suffix else Path()) / "correctors"
    failed = []
    for recipe in standard_recipes(found):
        name = f"{recipe.stem}-{found.name}"
        console.print(f"[bold]{name}[/]")
        try:
            _train(recipe, folder, {"name": name, "turbine": turbine, "seed": seed}, console)
        except InputError as error:
            failed.append(name)
            console.print(f"left out: {error}", soft_wrap=True)
    if failed:
        console.print(f"not trained: {', '.join(failed)}", soft_wrap=True)
    console.print(f"use one as `corrector: {folder}/NAME.safetensors` in a campaign", soft_wrap=True)
    return 1 if failed else 0


def _train(recipe: Path, out: Path | None, overrides: dict[str, Any], console: Console) -> None:
    """Train a recipe with a line of progress; a network's training can be stopped and goes on from its checkpoint."""
    from fatigue_runner.corrector.card import validation_rows
    from fatigue_runner.corrector.recipe import Progress
    from fatigue_runner.corrector.train import train_file

    with console.status("making the samples") as status:

        def epoch(at: dict[str, float]) -> None:
            status.update(
                f"epoch {at['epoch']:.0f}/{at['epochs']:.0f}: validation {at['validation']:.3e}, best {at['best']:.3e} (Ctrl-C ends)"
            )

        checkpoint = (out or recipe.parent) / f".{overrides.get('name') or recipe.stem}.checkpoint"
        made = train_file(recipe, out, overrides, Progress(status.update, epoch, checkpoint))
    if checkpoint.exists():
        console.print("stopped: the best so far is written, the same command goes on")
    for label, value in validation_rows(made.corrector)[:7]:
        console.print(f"{label}: {value}")
    console.print(f"corrector: {made.path}\ncard: {made.card}")


def _tune(
    recipe: Path,
    out: Path | None,
    overrides: dict[str, Any],
    trials: int,
    epochs: int,
    console: Console,
) -> dict[str, Any] | None:
    """Search for a network's settings, a line per trial; None where Ctrl-C ended it: the same command goes on."""
    from fatigue_runner.corrector.train import tune_file

    def trial(report: Any) -> None:
        value = "-" if report.value is None else f"{report.value:.3e}"
        settings = ", ".join(
            f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in report.settings.items()
        )
        console.print(f"trial {report.number}: {report.state}, validation {value}; {settings}")

    storage = (out or recipe.parent) / f".{overrides.get('name') or recipe.stem}.tuning.db"
    with console.status(f"{trials} trials of {epochs} epochs (Ctrl-C ends, the same command goes on)"):
        settings, stopped = tune_file(recipe, storage, trials, epochs, overrides, trial)
    console.print("best: " + ", ".join(f"{k}: {v}" for k, v in settings.items()))
    return None if stopped else settings
