"""Search for batch size, learning rate and scheduler with Optuna: resumable, judged by the validation winds alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fatigue_runner.corrector.network.pairs import Pairs
from fatigue_runner.corrector.network.settings import SCHEDULERS, NetworkSettings
from fatigue_runner.errors import InputError

BATCHES = (64, 128, 256, 512, 1024)
RATES = (3e-4, 1e-2)
FACTORS = (0.2, 0.7)


@dataclass(frozen=True)
class TrialReport:
    """One trial as it ended: state is complete, pruned or failed; value the best validation loss, None where there is none."""

    number: int
    state: str
    value: float | None
    settings: dict[str, Any]


@dataclass(frozen=True)
class Tuned:
    """The base settings with the best trial's batch, rates and scheduler in them; all trials of the study; stopped by Ctrl-C?"""

    settings: NetworkSettings
    trials: tuple[TrialReport, ...]
    stopped: bool


def tune(
    train: Pairs,
    validation: Pairs,
    base: NetworkSettings,
    trials: int,
    epochs: int,
    storage: Path,
    progress: Callable[[TrialReport], None] | None = None,
) -> Tuned:
    """Bring the study in `storage` (SQLite) to `trials` trials of `epochs` epochs each, and take the best.

    Every trial trains from base.seed; one that is worse than the median of the others at the same epoch ends early. A study
    belongs to its samples and base settings: the same file serves several. Called again it goes on where it stopped; Ctrl-C
    keeps what is finished. Raises InputError without Optuna, for a file that is no study, and where no trial has finished.
    """
    from fatigue_runner.corrector.network.training import make_folder

    try:
        import optuna
    except ImportError:
        raise InputError("tuning needs Optuna; install it with `pip install fatigue-runner[train]`") from None
    if trials < 1 or epochs < 1:
        raise InputError(f"tuning needs at least one trial of one epoch, got {trials} of {epochs}")
    make_folder(storage.parent)
    study = _study(optuna, train, validation, base.but(epochs=epochs), storage)
    stopped = False
    while not stopped and _finished(study) < trials:
        trial = study.ask()
        stopped = _one(optuna, study, trial, train, validation, base.but(epochs=epochs))
        if progress is not None:
            progress(_report(study.trials[trial.number]))
    done = [t for t in study.trials if t.state.name == "COMPLETE"]
    if not done:
        raise InputError(f"no trial of {storage} has finished; run the tuning again to go on")
    settings = base.but(**study.best_trial.user_attrs["settings"])
    return Tuned(settings, tuple(_report(t) for t in study.trials), stopped)


def _study(optuna: Any, train: Pairs, validation: Pairs, settings: NetworkSettings, storage: Path) -> Any:
    from sqlalchemy.exc import SQLAlchemyError

    from fatigue_runner.corrector.network.training import fingerprint

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    try:
        study = optuna.create_study(
            study_name=f"mlp-{fingerprint(train, validation, settings)[:16]}",
            storage=f"sqlite:///{storage.resolve()}",
            load_if_exists=True,
            pruner=optuna.pruners.MedianPruner(
                n_startup_trials=4, n_warmup_steps=max(settings.epochs // 4, 1)
            ),
        )
    except SQLAlchemyError as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{storage} cannot hold a study ({reason}); name another file") from None
    # a resumed study must not draw the trials again that it began with
    study.sampler = optuna.samplers.TPESampler(seed=settings.seed + len(study.trials))
    return study


def _finished(study: Any) -> int:
    return sum(t.state.name in ("COMPLETE", "PRUNED") for t in study.trials)


def _suggest(trial: Any, epochs: int, smallest_rate: float) -> dict[str, Any]:
    """The settings that a trial tries."""
    rate = trial.suggest_float("learning_rate", *RATES, log=True)
    found = {
        "batch": trial.suggest_categorical("batch", BATCHES),
        "learning_rate": rate,
        "smallest_rate": min(rate, smallest_rate),
        "scheduler": trial.suggest_categorical("scheduler", SCHEDULERS),
    }
    if found["scheduler"] == "plateau":
        found["factor"] = trial.suggest_float("factor", *FACTORS)
        found["patience"] = trial.suggest_int("patience", max(epochs // 40, 1), max(epochs // 4, 1))
    return found


class _Pruned(Exception):
    """Leaves the training of a trial that is not worth going on with."""


def _one(optuna: Any, study: Any, trial: Any, train: Pairs, validation: Pairs, base: NetworkSettings) -> bool:
    """Run one trial; True where Ctrl-C ended it."""
    from fatigue_runner.corrector.network.training import train_scaled

    chosen = _suggest(trial, base.epochs, base.smallest_rate)
    trial.set_user_attr("settings", chosen)

    def watch(row: dict[str, float]) -> None:
        trial.report(row["best"], int(row["epoch"]))
        if trial.should_prune():
            raise _Pruned

    states = optuna.trial.TrialState
    try:
        _, history = train_scaled(train, validation, base.but(**chosen), watch)
    except _Pruned:
        study.tell(trial, state=states.PRUNED)
        return False
    except BaseException:
        study.tell(trial, state=states.FAIL)
        raise
    if history.stopped:
        study.tell(trial, state=states.FAIL)
        return True
    study.tell(trial, history.best)
    return False


def _report(trial: Any) -> TrialReport:
    names = {"COMPLETE": "complete", "PRUNED": "pruned"}
    values = list(trial.intermediate_values.values())
    value = trial.value if trial.value is not None else values[-1] if values else None
    return TrialReport(
        trial.number, names.get(trial.state.name, "failed"), value, trial.user_attrs.get("settings", {})
    )
