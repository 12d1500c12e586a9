"""The hybrid's acceptance test as data: what may be accepted, and what is taken instead."""

from __future__ import annotations

from dataclasses import dataclass

from fatigue_runner.corrector.errors import CorrectorError

NORMS = ("max", "rms")


@dataclass(frozen=True)
class Guard:
    """|fallback - corrected| in units of atol + max(|x|, |fallback|) rtol is at most `limit`, else the fallback is taken.

    limit = kappa * (largest, or the stated quantile, over the training set); atol, rtol (states,). `substeps`: 0 for a method of the
    next order that shares the stages, else the fallback is that many smaller steps of the method itself.
    low, high: bounds of the features behind the leading 1, without factors; a step whose features leave them is refused, whatever its
    distance. Empty: no bounds. They are the extent of the training and validation samples, and `margin` times it on both sides.
    ahead_atol (states,): atol of the distance from what an exponential Adams method has predicted, in the units of the same limit; empty
    for other methods.
    Its steps that are refused are made anew in `substeps` of RK4.
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
    ahead_atol: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len(self.low) != len(self.high) or not all(
            a <= b for a, b in zip(self.low, self.high, strict=True)
        ):
            raise CorrectorError("guard: low and high need a number per feature each, low at most at high")
        if self.norm not in NORMS:
            raise CorrectorError(f"guard: norm must be one of {', '.join(NORMS)}, got {self.norm!r}")
        if not all(a > 0 for a in (*self.atol, *self.ahead_atol)):
            raise CorrectorError(
                "guard: atol needs positive numbers: with 0 a state that crosses zero refuses every step"
            )
        if not (self.kappa >= 1 and self.limit >= 0 and 0 < self.quantile <= 1):
            raise CorrectorError(
                "guard: kappa must be at least 1, limit not negative, quantile above 0 and at most 1"
            )

    def check(self, states: int, predicts: bool) -> None:
        """Raises CorrectorError unless there is a unit for each of so many states, and for their prediction where there is one."""
        if predicts and not self.substeps:
            raise CorrectorError("its guard needs substeps for the steps that it refuses; train it anew")
        for name, values in (("atol", self.atol), ("rtol", self.rtol)):
            if len(values) != states:
                raise CorrectorError(
                    f"its guard's {name} needs a number for each of {states} states, got {len(values)}"
                )
        if len(self.ahead_atol) != (states if predicts else 0):
            what = (
                f"a number for each of {states} states"
                if predicts
                else "to be empty, the method predicts nothing"
            )
            raise CorrectorError(f"its guard's ahead_atol needs {what}")


def open_guard(states: int, norm: str = "max", substeps: int = 2) -> Guard:
    """For a corrector whose threshold is still to be found: nothing would be accepted."""
    return Guard(0.0, norm, 1.0, 1.0, (1.0,) * states, (0.0,) * states, substeps)
