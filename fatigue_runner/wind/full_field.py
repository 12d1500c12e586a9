"""Wind of a full-field file (TurbSim, Bladed, Mann box) or of a uniform wind file, projected on the turbine's rotor."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, Field

from fatigue_runner.errors import InputError
from fatigue_runner.inputs.source import Place
from fatigue_runner.inputs.sweep import as_list, check_not_empty
from fatigue_runner.layout import WIND
from fatigue_runner.naming import file_id
from fatigue_runner.rotor import Rotor
from fatigue_runner.wind.azimuthal_spectrum import DEFAULT_HARMONICS
from fatigue_runner.wind.checks import refuse_standstill
from fatigue_runner.wind.fields import FieldHarmonics, UniformWind, WindField, harmonics_of, read_wind
from fatigue_runner.wind.mean_shear import NO_TURBINE, checked_harmonics, radial_rule
from fatigue_runner.wind.section import Realisation, Site, WindSection
from fatigue_runner.wind.source import WindSource
from fatigue_runner.wind.words import told_strength


@dataclass(frozen=True, init=False)
class FullFieldWind(WindSource):
    """The longitudinal wind of a file as the blades feel it: `harmonics` azimuthal amplitudes in time, on the turbine's rotor.

    `.bts` (TurbSim), full-field `.wnd` with its `.sum` beside it, HAWC2 boxes; Taylor's hypothesis with OpenFAST's time origin
    (`wind.fields.projection`), the rotor plane at the apex, leaning with the shaft's tilt. mean_speed [m/s] where the file does not say
    it. Raises InputError, when it is first asked for its wind, for a file that cannot be read or does not cover the rotor.
    """

    kind = "full-field"

    path: str
    order: int
    mean_wind: float | None
    rotor: Rotor | None

    def __init__(
        self,
        path: str | Path,
        harmonics: int = DEFAULT_HARMONICS,
        mean_speed: float | None = None,
        rotor: Rotor | None = None,
    ) -> None:
        put = object.__setattr__
        put(self, "path", str(path))
        put(self, "order", checked_harmonics("full-field wind", harmonics))
        put(self, "mean_wind", mean_speed)
        put(self, "rotor", rotor)
        if self.order < 2:
            raise InputError("full-field wind: give 2 harmonics or more; 6 hold 98 % of every load range")

    def on(self, rotor: Rotor) -> Self:
        if self.rotor is not None:
            return self
        return type(self)(self.path, self.order, self.mean_wind, rotor)

    @property
    def harmonics(self) -> int:
        return self.order

    @property
    def name(self) -> str:
        return f"field-{Path(self.path).stem}"

    @property
    def mean_speed(self) -> float:
        return self._projected.mean_speed

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know of the file."""
        return self._projected.notes

    @property
    def parameters(self) -> dict[str, Any]:
        signals = self._signals
        return {
            "vertical_shear": float(signals[:, 1].mean()),
            "horizontal_shear": float(signals[:, 2].mean()),
            "turbulence_intensity": self._projected.hub_intensity,
            "wind_file": Path(self.path).name,
        }

    @property
    def description(self) -> str:
        return "the longitudinal wind of a full-field file, carried past the rotor as it is (Taylor's hypothesis)"

    @property
    def strength(self) -> str:
        variances = self._signals.var(axis=0)
        rotor, blade = variances[0], variances[0] + variances[len(WIND) :].sum() / 2
        point = self._projected.hub_intensity * self.mean_speed
        return told_strength(self.mean_speed, point, float(rotor**0.5), float(blade**0.5), self.order)

    @property
    def cell_key(self) -> float:
        return self._projected.time_step

    @property
    def length(self) -> float:
        return self._projected.end

    @property
    def _projected(self) -> FieldHarmonics:
        stamp = _stamp(self.path)
        return _projected(self.path, stamp, self.order, self.mean_wind, self.rotor or NO_TURBINE)

    @cached_property
    def _signals(self) -> np.ndarray:
        """Signals (n, 3 + 2 M) at the samples from run time 0."""
        found = self._projected
        amplitudes, disc = found.sampled(found.end)
        mean_radius = radial_rule(self.rotor or NO_TURBINE)[2]
        out = np.zeros((len(disc), self.signals))
        mean = disc[:, 1:].mean(axis=0)
        out[:, 0], out[:, 1:3] = disc[:, 0], mean / disc[:, :1]
        out[:, len(WIND) :] = amplitudes[:, 1:]
        # the mean's first harmonic is in the linear shears; kappa_h enters with -sin(psi)
        out[:, len(WIND)] -= mean[0] * mean_radius
        out[:, len(WIND) + 1] += mean[1] * mean_radius
        return out

    @cached_property
    def _coefficients(self) -> np.ndarray:
        from scipy.interpolate import CubicSpline  # slower to import than all of wind

        step = self._projected.time_step
        spline = CubicSpline(np.arange(len(self._signals)) * step, self._signals)
        cells = np.ascontiguousarray(spline.c[::-1].transpose(1, 0, 2))
        refuse_standstill(self.name, step, cells, "the field is too turbulent for its mean wind")
        return cells

    def _cells(self, n_cells: int) -> np.ndarray:
        return self._coefficients[:n_cells]


def _stamp(path: str) -> tuple[int, int]:
    """What changes when the file does; raises InputError where there is none."""
    try:
        found = Path(path).stat()
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); check the path of the wind file"
        ) from None
    return found.st_mtime_ns, found.st_size


@lru_cache(maxsize=32)
def _projected(
    path: str, stamp: tuple[int, int], harmonics: int, mean_speed: float | None, rotor: Rotor
) -> FieldHarmonics:
    """A field on a rotor: read once however many integrators it meets."""
    found: WindField | UniformWind = read_wind(
        Path(path), hub_height=rotor.hub_height, rotor_diameter=2 * rotor.radius, mean_speed=mean_speed
    )
    if isinstance(found, UniformWind):
        raise InputError(
            f"{path} is a uniform wind file, no field; give it as `wind: type: file`, or its field as .bts, .wnd with .sum or a Mann box"
        )
    radii, shares, _ = radial_rule(rotor)
    return harmonics_of(
        found, rotor.hub_height, rotor.radius, radii, shares, harmonics, x=rotor.apex, tilt=rotor.tilt
    )


class FullFieldSection(WindSection):
    """One wind per file.

    files        one path or a list, relative to the campaign file: `.bts`, full-field `.wnd` with its `.sum` beside it
    harmonics    azimuthal harmonics that the blades feel (default 6)
    """

    kind = "full-field"

    files: Annotated[list[str], BeforeValidator(check_not_empty), BeforeValidator(as_list)]
    harmonics: int = Field(default=DEFAULT_HARMONICS, ge=2, le=16)

    def realisations(self, site: Site) -> Iterator[Realisation]:
        for index, name in enumerate(self.files):
            path = site.place.file(name)
            try:
                content = hashlib.sha256(path.read_bytes()).hexdigest()
            except OSError as error:
                raise InputError(
                    f"{site.place.where('files', index)}: wind file {name!r} cannot be read ({error.strerror}); "
                    "paths start at the campaign file"
                ) from None
            yield Realisation(
                file_id(path.stem), self.kind, (("path", str(path)), ("harmonics", self.harmonics)), ("files", index),
                contents=(("path", content),),
            )  # fmt: skip

    def resolved(self, place: Place) -> dict[str, Any]:
        return {**super().resolved(place), "files": [str(place.file(name)) for name in self.files]}
