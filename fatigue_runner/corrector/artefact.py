"""A trained corrector: weights and a header that binds them to turbine, method and step; safetensors, never pickle."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.corrector import features as feature_names
from fatigue_runner.errors import InputError

if TYPE_CHECKING:
    from fatigue_runner.corrector.samples import Samples
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

FORMAT = "fatigue-runner corrector 1"
ACTIVATIONS = ("identity", "relu", "isru")
NORMS = ("max", "rms")


class CorrectorError(InputError):
    """A corrector file that cannot be used, or not here."""


@dataclass(frozen=True)
class Guard:
    """The hybrid's acceptance test: |fallback - corrected| in units of atol + max(|x|, |fallback|) rtol is at most `limit`.

    limit = kappa * (largest, or the stated quantile, over the training set); atol, rtol (16,). `substeps`: 0 for a method of the
    next order that shares the stages, else the fallback is that many smaller steps of the method itself.
    low, high: bounds of the features behind the leading 1, without factors; a step whose features leave them is refused, whatever its
    distance. Empty: no bounds. They are the extent of the training and validation samples, and `margin` times it on both sides.
    """

    limit: float
    norm: str
    kappa: float
    quantile: float
    atol: tuple[float, ...]
    rtol: tuple[float, ...]
    substeps: int = 0
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()
    margin: float | None = None

    def __post_init__(self) -> None:
        if len(self.low) != len(self.high) or not all(
            a <= b for a, b in zip(self.low, self.high, strict=True)
        ):
            raise CorrectorError("guard: low and high need a number per feature each, low at most at high")
        if self.norm not in NORMS:
            raise CorrectorError(f"guard: norm must be one of {', '.join(NORMS)}, got {self.norm!r}")
        if not all(a > 0 for a in self.atol) or len(self.atol) != 16 or len(self.rtol) != 16:
            raise CorrectorError(
                "guard: atol needs 16 positive numbers: with 0 a state that crosses zero refuses every step"
            )
        if not (self.kappa >= 1 and self.limit >= 0 and 0 < self.quantile <= 1):
            raise CorrectorError(
                "guard: kappa must be at least 1, limit not negative, quantile above 0 and at most 1"
            )


@dataclass(frozen=True)
class Corrector:
    """N(x, p) of x+ = eta_h(x) + h^(p+1) N, for one turbine, method and step [s].

    linear (16, k) or None acts on `features.names(kind, stages, factors, history)`; layers: (outputs, inputs + 1) matrices, the
    bias first, on the same features without factors; their sum is h^(p+1) N divided by h^(p+1). An exponential Adams method has a
    `predictor` (16, k) beside, in the same units, on the rows that are known before the evaluation of the step;
    `damping` [1/s] is added to the generator's in its linear part; `ahead_atol` (16,) is the guard's atol for the predictor's result.
    """

    name: str
    family: str
    method: str
    step: float
    turbine: str
    turbine_hash: str
    kind: str
    factors: tuple[str, ...]
    linear: Array | None
    layers: tuple[Array, ...]
    activation: str
    guard: Guard
    validation: Mapping[str, float] = field(default_factory=dict)
    wind_range: tuple[float, float] = (0.0, 0.0)
    training: Mapping[str, Any] = field(default_factory=dict)
    recipe: str = ""
    licence: str = "Apache-2.0"
    history: int = 0
    predictor: Array | None = None
    damping: float = 0.0
    ahead_atol: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        self._check_kind()
        weights = [w for w in (self.linear, *self.layers, self.predictor) if w is not None]
        if not all(np.isfinite(w).all() for w in weights):
            raise CorrectorError(f"corrector {self.name}: a weight is not a finite number; train it anew")

    @property
    def order(self) -> int:
        from fatigue_runner.integrators import method

        return method(self.method).order

    @property
    def past(self) -> int:
        """Earlier nonlinear parts that an exponential Adams method's corrector sees; 0 for a Runge-Kutta method's."""
        from fatigue_runner.integrators import method

        return max(getattr(method(self.method), "past", 0), self.history) if self.predictor is not None else 0

    def _check_kind(self) -> None:
        from fatigue_runner.corrector.samples import base_method
        from fatigue_runner.integrators.exponential_adams import ExponentialAdams

        exponential = isinstance(base_method(self.method), ExponentialAdams)
        if exponential != (self.kind == feature_names.MULTI_BLADE) or exponential == (self.predictor is None):
            raise CorrectorError(
                f"corrector {self.name}: features {self.kind!r} do not exist for {self.method}, or its predictor is missing or too many"
            )
        if exponential:
            self._check_matrices()
        else:
            self._check_shapes()

    def _check_matrices(self) -> None:
        from fatigue_runner.integrators.exponential_adams import MOST_PAST, PARTS, base_rows

        feature_names.multi_blade_factors(self.factors)
        if self.guard.low:
            raise CorrectorError(f"corrector {self.name}: one of an exponential method has no bounds")
        if len(self.ahead_atol) != 16 or not all(a > 0 for a in self.ahead_atol):
            raise CorrectorError(
                f"corrector {self.name}: ahead_atol needs 16 positive numbers, to guard the predictor"
            )
        if not 0 <= self.damping < 100:
            raise CorrectorError(
                f"corrector {self.name}: the generator's damping must be a number from 0 to 100 1/s"
            )
        if not 0 <= self.history <= MOST_PAST or self.layers or self.linear is None or self.predictor is None:
            raise CorrectorError(
                f"corrector {self.name}: one of an exponential method is two matrices that look back {MOST_PAST} steps at most"
            )
        rows = base_rows(self.past)
        wanted = (16, rows - PARTS), (16, rows * (1 + len(self.factors)))
        if (self.predictor.shape, self.linear.shape) != wanted:
            raise CorrectorError(
                f"corrector {self.name}: weights of shape {self.predictor.shape} and {self.linear.shape} do not fit {self.method}'s "
                f"features, which need {wanted[0]} and {wanted[1]}"
            )

    def matrices(self) -> tuple[Array, Array, tuple[int, ...]]:
        """Learned parts of an exponential Adams method's predictor and corrector, scaled to the defect, and the rows of its factors."""
        assert self.predictor is not None and self.linear is not None
        size = self.step ** (self.order + 1)
        return self.predictor * size, self.linear * size, feature_names.multi_blade_factors(self.factors)

    def _check_shapes(self) -> None:
        from fatigue_runner.corrector.samples import tableau

        feature_names.factor_rows(self.factors)
        if self.kind not in feature_names.KINDS or (self.kind == feature_names.RAW and self.factors):
            raise CorrectorError(
                f"corrector {self.name}: features {self.kind!r} with factors {self.factors} do not exist"
            )
        stages = tableau(self.method).evaluations_per_step
        if not 0 <= self.history <= feature_names.MOST_HISTORY or (
            self.kind == feature_names.RAW and self.history
        ):
            raise CorrectorError(
                f"corrector {self.name}: features {self.kind!r} that look back {self.history} steps do not exist"
            )
        if self.history and not self.guard.substeps:
            raise CorrectorError(
                f"corrector {self.name}: one that looks back starts with substeps; its guard must have them"
            )
        base = len(feature_names.names(self.kind, stages, (), self.history))
        if base * (1 + len(self.factors)) > feature_names.MOST_ROWS:
            raise CorrectorError(
                f"corrector {self.name}: {base * (1 + len(self.factors))} features are more than {feature_names.MOST_ROWS}"
            )
        if self.guard.low and len(self.guard.low) != base - 1:
            raise CorrectorError(
                f"corrector {self.name}: its guard bounds {len(self.guard.low)} features, there are {base - 1}"
            )
        if self.linear is None and not self.layers:
            raise CorrectorError(f"corrector {self.name}: it has neither a linear part nor layers")
        if self.linear is not None and self.linear.shape != (16, base * (1 + len(self.factors))):
            raise CorrectorError(
                f"corrector {self.name}: linear weights of shape {self.linear.shape} do not fit {self.method}'s features"
            )
        width = base - 1
        for number, layer in enumerate(self.layers, start=1):
            if layer.ndim != 2 or layer.shape[1] != width + 1 or layer.shape[0] > 500:
                raise CorrectorError(
                    f"corrector {self.name}: layer {number} has shape {layer.shape}, it needs {width + 1} inputs"
                )
            width = layer.shape[0]
        if self.layers and width != 16:
            raise CorrectorError(f"corrector {self.name}: the last layer has {width} outputs instead of 16")

    def bind(self, turbine: Turbine, method: str, step: float) -> None:
        """Raises CorrectorError unless the corrector was trained for this turbine, method and step."""
        if turbine.hash != self.turbine_hash:
            raise CorrectorError(
                f"corrector {self.name} was trained for turbine {self.turbine} ({self.turbine_hash[:12]}), this is {turbine.name} "
                f"({turbine.hash[:12]}); train one with `fatigue-runner train`"
            )
        if method != self.method:
            raise CorrectorError(
                f"corrector {self.name} was trained for {self.method}, the campaign uses {method}; use `method: {self.method}` or train one"
            )
        if abs(step - self.step) > 1e-9 * self.step:
            raise CorrectorError(
                f"corrector {self.name} was trained for step {self.step:g} s, the campaign uses {step:g} s; "
                f"train one with `fatigue-runner train RECIPE --step {step:g}`"
            )

    def predict(self, samples: Samples) -> Array:
        """Defects (n, 16) [state units] of samples, as the kernel computes them."""
        out = np.zeros((len(samples.plain), 16))
        if self.linear is not None:
            out += samples.features(self.kind, self.factors) @ self.linear.T
        if self.layers:
            value = samples.features(self.kind)[:, 1:]
            for number, layer in enumerate(self.layers):
                value = layer[:, 0] + value @ layer[:, 1:].T
                if number < len(self.layers) - 1:
                    value = (
                        np.maximum(value, 0) if self.activation == "relu" else value / np.sqrt(1 + value**2)
                    )
            out += value
        return out * self.step ** (self.order + 1)

    def kernel_network(self, ratio: float) -> tuple[Any, ...]:
        """`network` of integrators.correction.correction: weights scaled to the defect, in the order that the kernel reads."""
        from fatigue_runner.integrators.correction import IDENTITY, ISRU, RELU, pack

        size = self.step ** (self.order + 1)
        linear = np.zeros(0) if self.linear is None else pack(self.linear * size)[0]
        packed, sizes = [], [0]
        for number, layer in enumerate(self.layers):
            last = number == len(self.layers) - 1
            # rows of ones: first among the features, last among hidden values
            weights = layer if number == 0 else np.concatenate([layer[:, 1:], layer[:, :1]], axis=1)
            packed.append(pack(weights * size if last else weights)[0])
            sizes.append(layer.shape[0])
        net = np.concatenate(packed) if packed else np.zeros(0)
        kind = {"identity": IDENTITY, "relu": RELU, "isru": ISRU}[self.activation]
        factors = np.array(feature_names.factor_rows(self.factors), dtype=np.int64)
        return (
            self.kind == feature_names.RAW,
            ratio,
            self.history,
            factors,
            linear,
            net,
            np.array(sizes),
            kind,
        )


def save(corrector: Corrector, path: Path) -> None:
    """Write the safetensors file atomically."""
    from safetensors.numpy import save as to_bytes

    tensors = {f"layer{i}": np.ascontiguousarray(w) for i, w in enumerate(corrector.layers)}
    if corrector.linear is not None:
        tensors["linear"] = np.ascontiguousarray(corrector.linear)
    if corrector.predictor is not None:
        tensors["predictor"] = np.ascontiguousarray(corrector.predictor)
    header = _header(corrector)
    data = to_bytes(tensors, metadata={"format": FORMAT, "header": json.dumps(header)})
    part = path.with_name(path.name + ".part")
    part.write_bytes(data)
    part.replace(path)


def _header(corrector: Corrector) -> dict[str, Any]:
    skip = {"linear", "predictor", "layers", "guard"}
    out = {k: getattr(corrector, k) for k in corrector.__dataclass_fields__ if k not in skip}
    out["guard"] = asdict(corrector.guard)
    out["layers"] = len(corrector.layers)
    return out


def load(path: Path | str) -> Corrector:
    """Read a corrector. Raises CorrectorError for a file that is cut, of another kind, or incomplete."""
    from safetensors import SafetensorError, safe_open

    path = Path(path)
    if not path.is_file():
        raise CorrectorError(f"there is no corrector file {path}")
    try:
        with safe_open(path, framework="numpy") as f:
            metadata = f.metadata() or {}
            tensors = {k: f.get_tensor(k) for k in f.keys()}  # noqa: SIM118 - not a mapping
    except (SafetensorError, OSError, ValueError) as error:
        raise CorrectorError(
            f"{path} is not a whole safetensors file ({error}); copy or train it anew"
        ) from None
    if metadata.get("format") != FORMAT:
        raise CorrectorError(
            f"{path} is no corrector of this program (format {metadata.get('format')!r}, expected {FORMAT!r})"
        )
    try:
        header = json.loads(metadata["header"])
        count = header.pop("layers")
        guard: dict[str, Any] = {
            k: tuple(v) if isinstance(v, list) else v for k, v in header["guard"].items()
        }
        header["guard"] = Guard(**guard)
        header["wind_range"], header["factors"] = tuple(header["wind_range"]), tuple(header["factors"])
        header["ahead_atol"] = tuple(header.get("ahead_atol", ()))
        layers = tuple(tensors[f"layer{i}"].astype(float) for i in range(count))
        linear, predictor = (
            tensors[key].astype(float) if key in tensors else None for key in ("linear", "predictor")
        )
        return Corrector(linear=linear, predictor=predictor, layers=layers, **header)
    except (KeyError, TypeError, json.JSONDecodeError) as error:
        raise CorrectorError(f"{path}: the header is incomplete ({error}); train it anew") from None
