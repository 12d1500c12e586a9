"""A wind around another one: what the turbine and its place make of any wind that blows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fatigue_runner.wind.source import WindSource


@dataclass(frozen=True)
class WindAround(WindSource):
    """Base of the winds that change another one, `wind`: as that one where they do not say otherwise."""

    wind: WindSource

    @property
    def harmonics(self) -> int:
        return self.wind.harmonics

    @property
    def mean_speed(self) -> float:
        return self.wind.mean_speed

    @property
    def axial_speed(self) -> float:
        return self.wind.axial_speed

    @property
    def parameters(self) -> dict[str, Any]:
        return self.wind.parameters

    @property
    def label(self) -> dict[str, Any]:
        return {**self.wind.label, "harmonics": self.harmonics, **self.parameters}

    @property
    def description(self) -> str:
        return self.wind.description

    @property
    def strength(self) -> str:
        return self.wind.strength

    @property
    def notes(self) -> tuple[str, ...]:
        return self.wind.notes

    @property
    def cell_key(self) -> float | None:
        return self.wind.cell_key

    @property
    def length(self) -> float:
        return self.wind.length

    @property
    def _settled(self) -> float:
        return self.wind._settled
