"""A calibration: corrections of several load channels for one turbine, how they are made, judged, kept and used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.calibration.fit import DEGREES, NOTHING, Block, Correction, Fit, Form, fit, loads
from fatigue_runner.calibration.runs import Ran, RunFolder
from fatigue_runner.calibration.section import MOST_EXPONENT, CalibrationSection
from fatigue_runner.calibration.series import Series, read_series
from fatigue_runner.channels import LOAD_NAMES, channel_name
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.checked_json import from_checked, to_checked
from fatigue_runner.inputs.files import write_new
from fatigue_runner.inputs.section import validated
from fatigue_runner.inputs.source import read_mapping

Array = NDArray[np.float64]
KIND, VERSION = "fatigue-runner calibration", 1
AIM = 0.02  # of a damage-equivalent load
INTERVAL = (0.05, 0.95)  # of the resampled fits
RESAMPLED = 40  # of them that an interval is made of


@dataclass(frozen=True)
class Judged:
    """One run and channel: relative DEL errors (exponents,) as they are, corrected, and corrected by a fit without the run (None: it is
    the only one of the training); use: `train` or `judge`; extrapolates: what of the run lies outside of what that fit was made from,
    in words, or empty."""

    case: str
    wind: float
    channel: str
    use: str
    plain: Array
    corrected: Array
    left_out: Array | None
    extrapolates: str


@dataclass(frozen=True, eq=False)
class Calibration:
    """Corrections by channel for one turbine; runs: names of those that were learned from; fits: what else is known from the fitting."""

    name: str
    turbine: str
    turbine_hash: str
    exponents: tuple[float, ...]
    corrections: dict[str, Correction]
    runs: tuple[str, ...]
    block_errors: dict[str, dict[str, float]] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        return {
            "kind": KIND,
            "version": VERSION,
            "name": self.name,
            "turbine": self.turbine,
            "turbine_hash": self.turbine_hash,
            "wohler_exponents": self.exponents,
            "runs": self.runs,
            "channels": {
                name: {
                    "degree": c.form.degree,
                    "shaped": c.form.shaped,
                    "coefficients": c.coefficients.tolist(),
                    "resampled": c.resampled.tolist(),
                    "winds": c.winds,
                    "standard_deviations": c.spreads,
                    "errors_on_blocks_left_out": self.block_errors.get(name, {}),
                }
                for name, c in self.corrections.items()
            },
        }

    def write(self, path: Path, overwrite: bool = True) -> None:
        """Raises InputError where it cannot be written, or holds something else already and is not to be overwritten."""
        write_new(path, to_checked(self.to_json()), overwrite)

    @classmethod
    def read(cls, path: Path) -> Calibration:
        """Raises InputError for a file that is no calibration."""
        try:
            data = from_checked(path.read_bytes())
            if data["kind"] != KIND or data["version"] != VERSION:
                raise ValueError("of another kind or version")
            corrections = {name: _correction(name, c) for name, c in data["channels"].items()}
            errors = {name: dict(c["errors_on_blocks_left_out"]) for name, c in data["channels"].items()}
            exponents = tuple(float(m) for m in data["wohler_exponents"])
            if not corrections or not exponents or not all(0 < m <= MOST_EXPONENT for m in exponents):
                raise ValueError("without a channel or a Wöhler exponent")
            name, turbine, turbine_hash = (str(data[key]) for key in ("name", "turbine", "turbine_hash"))
            return cls(
                name, turbine, turbine_hash, exponents, corrections, tuple(map(str, data["runs"])), errors
            )
        except OSError as error:
            raise InputError(f"{path} cannot be read ({error.strerror})") from None
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(
                f"{path} is no calibration ({error}); make one with `fatigue-runner calibrate fit`"
            ) from None

    def refuse_another(self, run: RunFolder) -> None:
        """Raises InputError unless a run is of the turbine that this was made for."""
        if run.turbine_hash != self.turbine_hash:
            raise InputError(
                f"{run.folder} was run with another turbine ({run.turbine}, hash {run.turbine_hash[:12]}) than {self.name} was made for "
                f"({self.turbine}, {self.turbine_hash[:12]}); calibrate for it"
            )


def _correction(name: str, c: dict[str, Any]) -> Correction:
    """Of a file. Raises ValueError for what no fit writes."""
    if name not in LOAD_NAMES:
        raise ValueError(f"{name!r} is no load")
    form = Form(int(c["degree"]), bool(c["shaped"]))
    if form.degree not in (NOTHING, *DEGREES):
        raise ValueError(f"{name} has the degree {form.degree}")
    width = form.degree + 1
    own = np.array(c["coefficients"], float).reshape(3, width)
    drawn = np.array(c["resampled"], float).reshape(len(c["resampled"]), 3, width)
    (first, last), (low, high) = np.array([c["winds"], c["standard_deviations"]], float).tolist()
    if not len(drawn):
        raise ValueError(f"{name} has no resampled fits, of which its interval is made")
    if not (np.isfinite(own).all() and np.isfinite(drawn).all() and 0 < first <= last and 0 < low <= high):
        raise ValueError(f"{name} has figures that no fit makes")
    return Correction(form, own, drawn, (first, last), (low, high))


def calibrate(path: Path) -> tuple[Calibration, list[Judged]]:
    """What a calibration's file asks for: the corrections, and every run judged. Raises InputError with "file:line" for what is wrong."""
    source = read_mapping(path, "calibration", "name, run, series, ...")
    spec = validated(CalibrationSection, source)
    run = RunFolder.read(source.file(spec.run))
    channels = [channel_name(name) for name in spec.channels]
    exponents = tuple(spec.wohler_exponents or run.exponents)
    start, rows = run.discard if spec.start is None else spec.start, run.chosen(spec.method)
    pairs = []
    for number, entry in enumerate(spec.series):
        try:
            ours = run.load(run.case(rows, entry.case), channels, start)
            theirs = read_series(source.file(entry.file))
            pairs.append((entry, *together(ours, theirs, channels, start)))
        except InputError as error:
            raise InputError(f"{source.where(('series', number))}: {error}") from None
    train = [(ours, theirs) for entry, ours, theirs in pairs if entry.use == "train"]
    fits = {c: fit([b for o, t in train for b in blocks(o, t, c, spec.blocks)], exponents) for c in channels}
    found = Calibration(
        spec.name, run.turbine, run.turbine_hash, exponents, {c: f.correction for c, f in fits.items()},
        tuple(o.case for o, _ in train), {c: {str(form): e for form, e in f.tried.items()} for c, f in fits.items()},
    )  # fmt: skip
    judged = [
        judge(ours, theirs, c, entry.use, exponents, fits[c])
        for c in channels
        for entry, ours, theirs in pairs
    ]
    return found, judged


def together(ours: Ran, theirs: Series, channels: Sequence[str], start: float) -> tuple[Ran, Ran]:
    """Both programs' loads over the time that both have from `start` [s] on, each at its own rate. Raises InputError where that is less
    than a minute."""
    end = min(ours.time[-1], theirs.time[-1])
    if end - start < 60.0:
        raise InputError(
            f"{theirs.path} and {ours.case} share {max(0.0, end - start):.3g} s from {start:g} s on; a minute is the least"
        )
    out = []
    for time, found in ((ours.time, ours.loads), (theirs.time, {c: theirs.channel(c) for c in channels})):
        kept = (time >= start - 1e-9) & (time <= end + 1e-9)
        values = {c: np.ascontiguousarray(found[c][kept]) for c in channels}
        for channel, series in values.items():
            if not np.isfinite(series).all() or not np.ptp(series):
                raise InputError(f"{theirs.path}: {channel} holds no numbers or does not move")
        out.append(Ran(ours.case, ours.wind, time[kept], values))
    return out[0], out[1]


def blocks(ours: Ran, theirs: Ran, channel: str, count: int) -> list[Block]:
    """A run cut into `count` pieces of one length."""
    pieces = zip(*(np.array_split(r.loads[channel], count) for r in (ours, theirs)), strict=True)
    return [Block(ours.case, ours.wind, ours.seconds / count, x, y) for x, y in pieces]


def judge(ours: Ran, theirs: Ran, channel: str, use: str, exponents: Sequence[float], fitted: Fit) -> Judged:
    """The errors of a run's loads."""
    x, y, c = ours.loads[channel], theirs.loads[channel], fitted.correction
    exact = loads(y, exponents, theirs.seconds)
    plain, corrected = (loads(s, exponents, ours.seconds) / exact - 1 for s in (x, c.apply(x, ours.wind)))
    without = fitted.without.get(ours.case) if use == "train" else c
    if without is None:
        return Judged(ours.case, ours.wind, channel, use, plain, corrected, None, "")
    left_out = loads(without.apply(x, ours.wind), exponents, ours.seconds) / exact - 1
    outside = without.extrapolates(ours.wind, float(x.std()))
    return Judged(ours.case, ours.wind, channel, use, plain, corrected, left_out, outside)


@dataclass(frozen=True)
class Corrected:
    """One channel of one case: loads (exponents,) as they are, corrected, and the interval of the resampled fits (2, exponents)."""

    case: str
    wind: float
    channel: str
    plain: Array
    corrected: Array
    interval: Array
    extrapolates: str


def corrected(calibration: Calibration, run: RunFolder, method: str = "") -> list[Corrected]:
    """The loads of a run with the corrections. Raises InputError for a run of another turbine."""
    calibration.refuse_another(run)
    out = []
    for row in run.chosen(method):
        ran = run.load(row, list(calibration.corrections), run.discard)
        for channel, c in calibration.corrections.items():
            x = ran.loads[channel]
            count = [
                loads(c.apply(x, ran.wind, number), calibration.exponents, ran.seconds)
                for number in (None, *range(min(RESAMPLED, len(c.resampled))))
            ]
            out.append(
                Corrected(
                    ran.case, ran.wind, channel, loads(x, calibration.exponents, ran.seconds), count[0],
                    np.quantile(count[1:], INTERVAL, axis=0), c.extrapolates(ran.wind, float(x.std())),
                )
            )  # fmt: skip
    return out
