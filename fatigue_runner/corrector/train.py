"""From a recipe to the artefact: the one reader of recipe files and the one driver of all trainings."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fatigue_runner import shipped
from fatigue_runner.corrector import families  # noqa: F401 - registers the recipes
from fatigue_runner.corrector.artefact import save
from fatigue_runner.corrector.binding import Binding, correctable
from fatigue_runner.corrector.card import card
from fatigue_runner.corrector.corrector import Corrector
from fatigue_runner.corrector.judging import validate
from fatigue_runner.corrector.recipe import FAMILIES, Progress, Recipe
from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.inputs.section import validated
from fatigue_runner.inputs.source import Source, read_mapping
from fatigue_runner.turbine.turbine import FIXED

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine


@dataclass(frozen=True)
class Trained:
    """A corrector and the files that were written."""

    corrector: Corrector
    path: Path
    card: Path


def read_recipe(
    recipe: Path | str | Mapping[str, Any], overrides: Mapping[str, Any] | None = None
) -> tuple[Recipe, str]:
    """The recipe of a YAML file or a mapping, with `overrides` of its keys that are not None, and its text, which says so.

    Raises InputError, with file and line, for what cannot be read and for everything that is wrong.
    """
    if isinstance(recipe, Mapping):
        source = Source("recipe", recipe, what="recipe")
    else:
        source = read_mapping(Path(recipe), "recipe", "name, family, method, step, ...")
    changed = {key: value for key, value in (overrides or {}).items() if value is not None}
    text = source.text + "".join(
        f"# changed on the command line: {key}: {value}\n" for key, value in changed.items()
    )
    schema = _schema(source)
    data = dict(source.data)
    seed = changed.pop("seed", None)
    data |= changed
    if seed is not None:
        *inside, last = schema.seed_key
        section = data
        for key in inside:
            section[key] = section = dict(section.get(key) or {})
        section[last] = seed
    return validated(schema, source, data), text


def _schema(source: Source) -> type[Recipe]:
    """The class that reads the recipe: of its family, for its method."""
    known = sorted({family for family, _ in FAMILIES})
    family = source.data.get("family")
    if family not in known:
        what = "key 'family' is missing" if family is None else f"unknown family {family!r}"
        raise InputError(f"{source.where(('family',))}: {what}{did_you_mean(str(family), known)}")
    classes = {methods: schema for (name, methods), schema in FAMILIES.items() if name == family}
    method = source.data.get("method")
    if method is None:
        return next(iter(classes.values()))
    try:
        methods = correctable(str(method)).family
    except InputError as error:
        raise InputError(f"{source.where(('method',))}: method: {error}") from None
    if methods not in classes:
        others = [name for name, of in FAMILIES if of == methods]
        raise InputError(
            f"{source.where(('family',))}: family {family!r} corrects {' and '.join(classes)} methods, {method} is one of the "
            f"{methods} methods; for those there is {', '.join(others)}"
        )
    return classes[methods]


def train(
    recipe: Recipe, turbine: Turbine | None = None, progress: Progress | None = None, text: str = ""
) -> Corrector:
    """The guarded corrector that a recipe makes, with its figures; turbine: default the recipe's; text: the recipe's file, kept in
    the artefact. Raises InputError for a recipe that asks for what cannot be."""
    begin = time.perf_counter()
    progress = progress or Progress()
    turbine = turbine or recipe.load_turbine()
    learned = recipe.train(turbine, progress)
    binding = Binding.to(turbine, recipe.method, recipe.step)
    corrector = Corrector(
        recipe.name,
        recipe.family,
        binding,
        learned.map,
        learned.guard,
        learned.wind_range,
        recipe=text,
        rungs=learned.rungs,
    )
    progress.say("validation")
    figures = validate(corrector, recipe, turbine)
    facts = {"seconds": round(time.perf_counter() - begin, 1), **learned.facts}
    return replace(corrector, validation=figures, training=facts)


STANDARD_FAMILY, STANDARD_TURBINE = "affine", "nrel5mw"


def standard_recipes(turbine: Turbine | None = None) -> list[Path]:
    """The shipped recipes that are trained anew for every turbine, by name; without ladders, which are several trainings, those of another
    loss and those that see commands, which have a twin and take minutes, and those of a turbine that operates where this one has no
    controller."""
    found = []
    for path in sorted(shipped.correctors().glob("*.yaml")):
        data = read_mapping(path, "recipe", "name, family, ...").data
        if (
            data.get("family") != STANDARD_FAMILY
            or data.get("turbine") != STANDARD_TURBINE
            or "ladder" in data
            or "loss" in data
            or "commands" in data
        ):
            continue
        if turbine is None or turbine.control is not None or data.get("operation", FIXED) == FIXED:
            found.append(path)
    return found


def train_file(
    path: Path,
    out: Path | None = None,
    overrides: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Trained:
    """Train what a recipe file says, with `overrides` of its keys; writes NAME.safetensors and NAME.md into `out` (the recipe's
    folder). Raises InputError for a wrong recipe."""
    recipe, text = read_recipe(path, overrides)
    corrector = train(recipe, progress=progress, text=text)
    folder = out or path.parent
    folder.mkdir(parents=True, exist_ok=True)
    target, written = folder / f"{corrector.name}.safetensors", folder / f"{corrector.name}.md"
    save(corrector, target)
    written.write_text(card(corrector, path), encoding="utf-8")
    return Trained(corrector, target, written)


def tune_file(
    path: Path,
    storage: Path,
    trials: int,
    epochs: int,
    overrides: Mapping[str, Any] | None = None,
    told: Any = None,
) -> tuple[dict[str, Any], bool]:
    """Settings for `training` of the recipe file, its own with the best trial's in them; and whether Ctrl-C ended the search.

    told: gets a `tuning.TrialReport` after each trial. Raises InputError for a recipe of a family that has nothing to tune.
    """
    recipe, _ = read_recipe(path, overrides)
    settings, stopped = recipe.tune(recipe.load_turbine(), trials, epochs, storage, told)
    return dict(settings), stopped
