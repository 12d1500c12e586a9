"""The search for training settings: it goes on where it stopped and judges by the validation samples."""

from __future__ import annotations

import numpy as np
import pytest

from fatigue_runner.corrector.network.pairs import Pairs
from fatigue_runner.corrector.network.settings import NetworkSettings
from fatigue_runner.errors import InputError

pytest.importorskip("torch", reason="training needs the extra `train`")
pytest.importorskip("optuna", reason="tuning needs the extra `train`")

from fatigue_runner.corrector.network.training import train_scaled
from fatigue_runner.corrector.network.tuning import tune


def problem(n: int, seed: int) -> Pairs:
    x = np.random.Generator(np.random.PCG64(seed)).uniform(-1, 1, (n, 2))
    return Pairs(x, np.stack([x[:, 0], x[:, 0] * x[:, 1]], axis=1))


TRAIN, VALIDATION = problem(256, 0), problem(64, 1)
BASE = NetworkSettings(hidden=(8,), epochs=50, weight_decay=0.0)


def test_the_best_of_the_trials_by_validation_loss_is_taken_and_its_loss_is_that_of_its_settings(tmp_path):
    tuned = tune(TRAIN, VALIDATION, BASE, trials=4, epochs=3, storage=tmp_path / "new" / "study.db")
    assert len(tuned.trials) == 4 and not tuned.stopped
    best = min((t for t in tuned.trials if t.state == "complete"), key=lambda t: t.value)
    assert {k: getattr(tuned.settings, k) for k in best.settings} == best.settings
    _, history = train_scaled(TRAIN, VALIDATION, tuned.settings.but(epochs=3))
    assert history.best == best.value
    assert tuned.settings.epochs == 50


def test_a_stopped_search_goes_on_with_the_trials_that_are_left(tmp_path, monkeypatch):
    path = tmp_path / "study.db"
    tune(TRAIN, VALIDATION, BASE, trials=1, epochs=2, storage=path)

    def interrupted(self):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("fatigue_runner.corrector.network.training._Run.report", interrupted)
        stopped = tune(TRAIN, VALIDATION, BASE, trials=3, epochs=2, storage=path)
    assert stopped.stopped and [t.state for t in stopped.trials] == ["complete", "failed"]
    seen = []
    tuned = tune(TRAIN, VALIDATION, BASE, trials=3, epochs=2, storage=path, progress=seen.append)
    assert len(seen) == 2 and [t.state for t in tuned.trials] == [
        "complete",
        "failed",
        "complete",
        "complete",
    ]
    rates = [t.settings["learning_rate"] for t in tuned.trials]
    assert len(set(rates)) == 4


def test_other_samples_in_the_same_file_are_another_search(tmp_path):
    path = tmp_path / "study.db"
    tune(TRAIN, VALIDATION, BASE, trials=2, epochs=1, storage=path)
    assert len(tune(problem(100, 7), VALIDATION, BASE, trials=1, epochs=1, storage=path).trials) == 1


def test_a_file_that_is_no_study_and_a_search_of_nothing_are_refused(tmp_path):
    path = tmp_path / "study.db"
    path.write_text("no database, but long enough to look like one: " * 50)
    with pytest.raises(InputError, match=r"study\.db cannot hold a study"):
        tune(TRAIN, VALIDATION, BASE, trials=1, epochs=1, storage=path)
    with pytest.raises(InputError, match="at least one trial"):
        tune(TRAIN, VALIDATION, BASE, trials=0, epochs=1, storage=tmp_path / "other.db")
