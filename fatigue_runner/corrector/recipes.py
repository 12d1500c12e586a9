"""Any recipe file: its family decides what reads and trains it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fatigue_runner.corrector.artefact import Corrector, save
from fatigue_runner.errors import InputError, did_you_mean

FAMILIES = ("affine", "affine+net", "mlp")


@dataclass(frozen=True)
class Trained:
    """A corrector and the files that were written."""

    corrector: Corrector
    path: Path
    card: Path


def read(path: Path) -> tuple[str, dict[str, Any], str]:
    """Family, data and text of a recipe file. Raises InputError for one that is no YAML mapping or has no known family."""
    from ruamel.yaml import YAML, YAMLError

    try:
        text = path.read_text(encoding="utf-8")
        data = YAML(typ="safe").load(text)
    except FileNotFoundError:
        near = (
            did_you_mean(str(path), [str(p) for p in path.parent.glob("*.y*ml")])
            if path.parent.is_dir()
            else ""
        )
        raise InputError(f"{path}: no such file{near if '; did' in near else ''}") from None
    except (OSError, UnicodeDecodeError, YAMLError) as error:
        raise InputError(f"{path} cannot be read: {' '.join(str(error).split())}") from None
    if not isinstance(data, dict):
        raise InputError(f"{path} holds no recipe: it must be a mapping with name, family, method and step")
    family = data.get("family")
    if family not in FAMILIES:
        what = "key 'family' is missing" if family is None else f"unknown family {family!r}"
        raise InputError(f"{path}: {what}{did_you_mean(str(family), FAMILIES)}")
    return family, data, text


def train_file(
    path: Path,
    out: Path | None,
    initial_state: Any,
    overrides: dict[str, Any] | None = None,
    say: Callable[[str], None] = lambda what: None,
    progress: Callable[[dict[str, float]], None] | None = None,
    checkpoint: Path | None = None,
) -> Trained:
    """Train what a recipe file says, with `overrides` of its keys; writes NAME.safetensors and NAME.md into `out` (the recipe's
    folder). checkpoint: of a network's training, to stop and go on. Raises InputError for a wrong recipe."""
    from fatigue_runner.corrector.card import card
    from fatigue_runner.turbine import load_turbine

    family, data, text = read(path)
    changed = {key: value for key, value in (overrides or {}).items() if value is not None}
    if changed:
        text += "".join(f"# changed on the command line: {key}: {value}\n" for key, value in changed.items())
    if family == "mlp" and "seed" in changed:
        data["training"] = {**(data.get("training") or {}), "seed": changed.pop("seed")}
    data |= changed
    if family == "mlp":
        from fatigue_runner.corrector.training_recipe import parse_recipe, train_recipe

        mlp = parse_recipe(data, str(path))
        corrector, _ = train_recipe(mlp, load_turbine(mlp.turbine), initial_state, progress, checkpoint, text)
    else:
        from fatigue_runner.corrector.affine import train_affine
        from fatigue_runner.corrector.affine_recipe import parse_affine

        affine = parse_affine(data, str(path))
        corrector = train_affine(affine, load_turbine(affine.turbine), initial_state, say, text, progress)
    folder = out or path.parent
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"{corrector.name}.safetensors"
    save(corrector, target)
    written = folder / f"{corrector.name}.md"
    written.write_text(card(corrector, path), encoding="utf-8")
    return Trained(corrector, target, written)
