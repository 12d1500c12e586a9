"""The one training loop of networks: AdamW, mini-batches, a falling learning rate, checkpoints."""

from __future__ import annotations

import copy
import hashlib
import io
import json
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from fatigue_runner.corrector.network.model import layers_of, network
from fatigue_runner.corrector.network.pairs import Pairs, Scaling, fold
from fatigue_runner.corrector.network.settings import NetworkSettings
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.files import write_atomically

Array = NDArray[np.float64]
Progress = Callable[[dict[str, float]], None]

Loss = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]

SAVE_EVERY = 20.0  # s between checkpoints: a kill costs no more than this


def mean_squares(result: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    return torch.nn.functional.mse_loss(result, target)


@dataclass(frozen=True)
class Problem:
    """What a network is to learn, in the units in which it is trained: samples, others that judge it, and the loss of (result, target).

    from_zero: the network begins as the map that is zero everywhere, which counts as epoch 0; else with random layers.
    """

    train: Pairs
    validation: Pairs
    loss: Loss = mean_squares
    from_zero: bool = False


@dataclass
class History:
    """What happened, one entry per epoch: losses, learning rate; best epoch (from 1; 0 where none beat the start)."""

    train: list[float] = field(default_factory=list)
    validation: list[float] = field(default_factory=list)
    rate: list[float] = field(default_factory=list)
    seconds: float = 0.0
    best_epoch: int = 0
    best: float = float("inf")
    start: float = float("nan")  # loss before the first epoch, of a network that begins at zero
    stopped: bool = False
    device: str = "cpu"


def train(
    problem: Problem,
    settings: NetworkSettings,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
) -> tuple[tuple[Array, ...], History]:
    """Layers (outputs, 1 + inputs) with the lowest validation loss, in the problem's units, and the history.

    Ctrl-C ends the training and keeps the best so far. `checkpoint`: a file to go on from, written every 20 s and at the end; going on
    gives the same bits as never having stopped. `progress` gets epoch, epochs, train, validation, best, rate after every epoch. On a
    CUDA device where there is one. Raises InputError for a checkpoint of other samples or settings.
    """
    if checkpoint is not None:
        make_folder(checkpoint.parent)
    with _reproducible(settings):
        run = _Run(problem, settings)
        if checkpoint is not None and checkpoint.exists():
            run.restore(checkpoint)
        _loop(run, settings, progress, checkpoint)
    if run.best_state is None:
        raise InputError("training ended before its first epoch; nothing was learned")
    return layers_of(run.best_state), run.history


def train_scaled(
    train_pairs: Pairs,
    validation: Pairs,
    settings: NetworkSettings,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
) -> tuple[tuple[Array, ...], History]:
    """As `train`, with the mean squares of values that are scaled to [-1, 1] on the training set; the scaling is folded into the layers."""
    inputs, outputs = Scaling.fitted(train_pairs.inputs), Scaling.fitted(train_pairs.targets)
    scaled, judged = (
        Pairs(inputs.scale(p.inputs), outputs.scale(p.targets)) for p in (train_pairs, validation)
    )
    layers, history = train(Problem(scaled, judged), settings, progress, checkpoint)
    return fold(layers, inputs, outputs), history


def _loop(run: _Run, settings: NetworkSettings, progress: Progress | None, checkpoint: Path | None) -> None:
    saved = time.monotonic()
    whole = run.snapshot()
    try:
        while len(run.history.train) < settings.epochs and not run.exhausted():
            run.epoch()
            whole = run.snapshot()
            if progress is not None:
                progress(run.report())
            if checkpoint is not None and time.monotonic() - saved > SAVE_EVERY:
                _write(whole, checkpoint)
                saved = time.monotonic()
    except KeyboardInterrupt:
        run.history.stopped = True
    if checkpoint is not None:
        # of the last whole epoch: half an epoch could not be gone on from with the same bits
        _write(whole, checkpoint)


def _device() -> torch.device:
    """A CUDA device where there is one, the processor elsewhere."""
    if not torch.cuda.is_available():
        return torch.device("cpu")
    # cuBLAS gives the same bits twice only with this, read when it starts
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    return torch.device("cuda")


class _Run:
    """A training under way: all that a checkpoint holds, and the scaled samples."""

    def __init__(self, problem: Problem, settings: NetworkSettings) -> None:
        self.settings, self.loss = settings, problem.loss
        self.device = _device()
        kind = torch.float32 if settings.precision == "float32" else torch.float64
        self.samples, self.judged = (
            tuple(torch.as_tensor(v, dtype=kind, device=self.device) for v in (p.inputs, p.targets))
            for p in (problem.train, problem.validation)
        )
        inputs, outputs = problem.train.inputs.shape[1], problem.train.targets.shape[1]
        self.model = network(inputs, outputs, settings).to(self.device, kind)
        self.history = History(device=str(self.device))
        self.best_state: dict[str, torch.Tensor] | None = None
        if problem.from_zero:
            for parameter in self.model[-1].parameters():
                torch.nn.init.zeros_(parameter)
            self.history.start = self._judge()
            self._keep_if_best(self.history.start)
        self.optimizer = torch.optim.AdamW(
            self.model.parameters(), settings.learning_rate, weight_decay=settings.weight_decay, fused=True
        )
        self.scheduler = _scheduler(self.optimizer, settings)
        self.order = torch.Generator().manual_seed(settings.seed)
        self.fingerprint = fingerprint(problem.train, problem.validation, settings)

    @property
    def rate(self) -> float:
        return float(self.optimizer.param_groups[0]["lr"])

    def exhausted(self) -> bool:
        """The plateau scheduler has nothing left to lower."""
        return self.settings.scheduler == "plateau" and self.rate <= self.settings.smallest_rate

    def epoch(self) -> None:
        """One pass over the samples in a new order, the validation loss, and a step of the scheduler."""
        begin, rate = time.monotonic(), self.rate
        inputs: Any
        targets: Any  # PyTorch's own hints have holes
        inputs, targets = self.samples
        order = torch.randperm(len(inputs), generator=self.order).to(self.device)
        total = torch.zeros((), device=self.device, dtype=torch.float64)
        batches = zip(
            inputs[order].split(self.settings.batch), targets[order].split(self.settings.batch), strict=True
        )
        for x, y in batches:
            self.optimizer.zero_grad()
            loss: Any = self.loss(self.model(x), y)
            loss.backward()
            self.optimizer.step()
            total += loss.detach() * len(x)
        judged, history = self._judge(), self.history
        history.train.append(float(total) / len(inputs))
        history.validation.append(judged)
        history.rate.append(rate)
        self._keep_if_best(judged)
        if self.settings.scheduler == "plateau":
            self.scheduler.step(judged)
        else:
            self.scheduler.step()
        history.seconds += time.monotonic() - begin

    def _judge(self) -> float:
        """Loss of the validation samples."""
        with torch.no_grad():
            return float(self.loss(self.model(self.judged[0]), self.judged[1]))

    def _keep_if_best(self, judged: float) -> None:
        if judged < self.history.best:
            self.history.best, self.history.best_epoch = judged, len(self.history.train)
            self.best_state = {k: v.detach().clone() for k, v in self.model.state_dict().items()}

    def report(self) -> dict[str, float]:
        h = self.history
        return {
            "epoch": len(h.train), "epochs": self.settings.epochs, "train": h.train[-1], "validation": h.validation[-1],
            "best": h.best, "rate": self.rate,
        }  # fmt: skip

    def snapshot(self) -> dict[str, Any]:
        """All of the state after a whole epoch, independent of what happens next."""
        return {
            "fingerprint": self.fingerprint,
            "model": copy.deepcopy(self.model.state_dict()),
            "optimizer": copy.deepcopy(self.optimizer.state_dict()),
            "scheduler": self.scheduler.state_dict(),
            "order": self.order.get_state(),
            "best_state": self.best_state,
            "history": asdict(self.history),
        }

    def restore(self, path: Path) -> None:
        """Go on from a checkpoint. Raises InputError where it is damaged or of another training."""
        try:
            found = torch.load(path, weights_only=True, map_location=self.device)
            fingerprint = found["fingerprint"]
        except Exception as error:
            raise InputError(
                f"{path} is no whole checkpoint ({type(error).__name__}); delete it to train from the start"
            ) from None
        if fingerprint != self.fingerprint:
            raise InputError(
                f"{path} is the checkpoint of other samples or settings; delete it to train from the start"
            )
        self.model.load_state_dict(found["model"])
        self.optimizer.load_state_dict(found["optimizer"])
        self.scheduler.load_state_dict(found["scheduler"])
        self.order.set_state(found["order"].cpu())
        self.best_state, self.history = found["best_state"], History(**found["history"])
        self.history.stopped, self.history.device = False, str(self.device)


def _scheduler(optimizer: torch.optim.Optimizer, settings: NetworkSettings) -> Any:
    s = settings
    if s.scheduler == "plateau":
        return torch.optim.lr_scheduler.ReduceLROnPlateau(
            optimizer, factor=s.factor, patience=s.patience, min_lr=s.smallest_rate, threshold=1e-3
        )
    if s.scheduler == "cosine":
        return torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, s.epochs, eta_min=s.smallest_rate)
    return torch.optim.lr_scheduler.ExponentialLR(
        optimizer, (s.smallest_rate / s.learning_rate) ** (1 / s.epochs)
    )


def fingerprint(train: Pairs, validation: Pairs, settings: NetworkSettings) -> str:
    """Hash of the samples and of every setting that a resumed training may not change."""
    free = {"threads"} | ({"epochs"} if settings.scheduler == "plateau" else set())
    digest = hashlib.sha256(json.dumps(settings.model_dump(exclude=free)).encode())
    for values in (train.inputs, train.targets, validation.inputs, validation.targets):
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()


def make_folder(path: Path) -> None:
    """The folder, before the work whose result it takes. Raises InputError where it cannot be made."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{path} cannot be made a folder ({error.strerror}); name another with --out"
        ) from None


def _write(state: dict[str, Any], path: Path) -> None:
    content = io.BytesIO()
    torch.save(state, content)
    write_atomically(path, content.getvalue())


@contextmanager
def _reproducible(settings: NetworkSettings) -> Iterator[None]:
    """The seed's random numbers, deterministic kernels and the stated threads inside; the caller's own outside."""
    threads, strict = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    with torch.random.fork_rng():
        torch.manual_seed(settings.seed)
        torch.use_deterministic_algorithms(True, warn_only=True)
        if settings.threads:
            torch.set_num_threads(settings.threads)
        try:
            yield
        finally:
            torch.set_num_threads(threads)
            torch.use_deterministic_algorithms(strict)
