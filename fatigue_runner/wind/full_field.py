"""Wind of a file on the turbine's rotor: full fields (TurbSim, Bladed, Mann boxes) and AeroDyn's uniform wind."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from fatigue_runner.errors import InputError
from fatigue_runner.inputs.section import Section, problem
from fatigue_runner.inputs.source import Place
from fatigue_runner.inputs.sweep import as_list, check_not_empty
from fatigue_runner.layout import ACROSS, HARMONICS, WIND, Channel, harmonic_channels
from fatigue_runner.naming import file_id
from fatigue_runner.rotor import Rotor
from fatigue_runner.wind.azimuthal_spectrum import DEFAULT_HARMONICS
from fatigue_runner.wind.checks import refuse_standstill
from fatigue_runner.wind.fields.on_rotor import BOX_KEYS, FileWind, content, on_rotor
from fatigue_runner.wind.mean_shear import (
    NO_TURBINE,
    checked_harmonics,
    mean_profile,
    one_profile,
    radial_rule,
)
from fatigue_runner.wind.section import Harmonics, Realisation, Site, WindSection
from fatigue_runner.wind.source import WindSource
from fatigue_runner.wind.words import told_strength


@dataclass(frozen=True, init=False)
class FullFieldWind(WindSource):
    """The longitudinal wind of a file as the blades feel it: `harmonics` azimuthal amplitudes in time, on the turbine's rotor.

    `.bts` (TurbSim), full-field `.wnd` with its `.sum` beside it, HAWC2 boxes, uniform wind `.wnd`/`.hh`; Taylor's hypothesis with
    OpenFAST's time origin (`wind.fields.projection`), the rotor plane at the apex, leaning with the shaft's tilt. With 1 harmonic the
    wind is the field's least-squares plane over the disc, with 0 its mean.

    A Mann box needs its mean_speed [m/s] at the hub and, where no `.hawc` or `.htc` names it, box: {points: (nx, ny, nz), spacing:
    (dx, dy, dz) [m]}, and may have `scale` or `sigma` [m/s], `reference_height` and `upstream` [m] (`wind.fields.MannBox`);
    shear_exponent or roughness_length [m] of the mean profile that is added to it. Of a file that has a mean wind of its own,
    mean_speed is what it must be.

    Raises InputError, when it is first asked for its wind, for a file that cannot be read or does not cover the rotor.
    """

    kind = "full-field"

    path: str
    order: int
    mean_wind: float | None
    shear_exponent: float | None
    roughness_length: float | None
    box: tuple[tuple[str, Any], ...]
    rotor: Rotor | None

    def __init__(
        self,
        path: str | Path,
        harmonics: int = DEFAULT_HARMONICS,
        mean_speed: float | None = None,
        box: Mapping[str, Any] | tuple[tuple[str, Any], ...] | None = None,
        shear_exponent: float | None = None,
        roughness_length: float | None = None,
        rotor: Rotor | None = None,
    ) -> None:
        put = object.__setattr__
        put(self, "path", str(path))
        put(self, "order", checked_harmonics("full-field wind", harmonics))
        put(self, "mean_wind", mean_speed)
        mean_profile(
            "full-field wind", shear_exponent, roughness_length
        )  # raises for what contradicts itself
        put(self, "shear_exponent", shear_exponent)
        put(self, "roughness_length", roughness_length)
        put(self, "box", _plain(dict(box or {})))
        put(self, "rotor", rotor)

    def on(self, rotor: Rotor) -> Self:
        if self.rotor is not None:
            return self
        shear = self.shear_exponent, self.roughness_length
        return type(self)(self.path, self.order, self.mean_wind, self.box, *shear, rotor)

    @property
    def harmonics(self) -> int:
        return self.order

    @property
    def channels(self) -> tuple[Channel, ...]:
        across = () if self._found.harmonics.across is None else ACROSS
        return (*WIND, *across, *harmonic_channels(self.order))

    @property
    def name(self) -> str:
        return f"field-{Path(self.path).stem}"

    @property
    def mean_speed(self) -> float:
        return self._found.harmonics.mean_speed

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know of the file."""
        return self._found.harmonics.notes

    @property
    def parameters(self) -> dict[str, Any]:
        signals = self._coefficients[:, 0]
        return {
            "vertical_shear": float(signals[:, 1].mean()),
            "horizontal_shear": float(signals[:, 2].mean()),
            "turbulence_intensity": self._found.harmonics.hub_intensity,
            "wind_file": Path(self.path).name,
        }

    @property
    def description(self) -> str:
        if self._found.uniform:
            return "the speed and the linear shears of a uniform wind file"
        return "the longitudinal wind of a full-field file, carried past the rotor as it is (Taylor's hypothesis)"

    @property
    def strength(self) -> str:
        point = self._found.harmonics.hub_intensity
        if point is None:
            return ""
        variances = self._coefficients[:, 0].var(axis=0)
        beyond = sum(v for v, c in zip(variances, self.channels, strict=True) if c in HARMONICS)
        rotor, blade = variances[0] ** 0.5, (variances[0] + beyond / 2) ** 0.5
        mean = self.mean_speed
        return told_strength(
            mean, point * mean, float(rotor), float(blade) if self.order > 1 else None, self.order
        )

    @property
    def cell_key(self) -> float:
        return self._found.harmonics.time_step

    @property
    def length(self) -> float:
        return self._found.length

    @property
    def _settled(self) -> float:
        return len(self._coefficients) * self.cell_key

    @property
    def _found(self) -> FileWind:
        profile = mean_profile("full-field wind", self.shear_exponent, self.roughness_length)
        rotor = self.rotor or NO_TURBINE
        return on_rotor(self.path, rotor, max(self.order, 1), self.mean_wind, profile, self.box)

    def _samples(self) -> np.ndarray:
        """Signals at the samples from run time 0, as `channels`; with M < 2 of the plane over the disc."""
        found = self._found.harmonics
        amplitudes, disc, across = found.sampled(found.end)
        out = np.zeros((len(disc), self.signals))
        out[:, 0] = disc[:, 0]
        first = len(WIND) + across.shape[1]
        out[:, len(WIND) : first] = across
        if self.order < 2:
            out[:, 1:3] = self.order * disc[:, 1:] / disc[:, :1]
            return out
        # linear along the blade are the shears of the mean wind, and those of a uniform wind, which has no eddies
        slopes = disc[:, 1:] if self._found.uniform else np.tile(disc[:, 1:].mean(axis=0), (len(disc), 1))
        mean_radius = radial_rule(self.rotor or NO_TURBINE)[2]
        out[:, 1:3] = slopes / disc[:, :1]
        out[:, first:] = amplitudes[:, 1:]
        # kappa_h enters with -sin(psi)
        out[:, first] -= slopes[:, 0] * mean_radius
        out[:, first + 1] += slopes[:, 1] * mean_radius
        return out

    @cached_property
    def _coefficients(self) -> np.ndarray:
        from scipy.interpolate import CubicSpline, PchipInterpolator  # slower to import than all of wind

        step, samples = self.cell_key, self._samples()
        # a uniform wind's lines have corners, which a spline would overshoot
        through = PchipInterpolator if self._found.uniform else CubicSpline
        found = through(np.arange(len(samples)) * step, samples)
        cells = np.ascontiguousarray(found.c[::-1].transpose(1, 0, 2))
        refuse_standstill(self.name, step, cells, "take a file with more wind and less turbulence")
        return cells

    def _cells(self, n_cells: int) -> np.ndarray:
        cells = self._coefficients[:n_cells]
        if n_cells == len(cells):
            return cells
        rest = np.zeros((n_cells - len(cells), *cells.shape[1:]))  # the last line of a uniform wind holds on
        rest[:, 0] = cells[-1, 0]  # two cells are behind that line
        return np.concatenate([cells, rest])


def _plain(box: Mapping[str, Any]) -> tuple[tuple[str, Any], ...]:
    """A box as it can be hashed."""
    return tuple((key, tuple(x) if isinstance(x, list | tuple) else x) for key, x in sorted(box.items()))


class BoxSection(Section):
    """What a Mann box does not say itself (`wind.fields.MannBox`); lengths in m."""

    points: list[int] | None = Field(default=None, min_length=3, max_length=3)
    spacing: list[float] | None = Field(default=None, min_length=3, max_length=3)
    reference_height: float | None = Field(default=None, gt=0)
    scale: float | None = Field(default=None, ge=0)
    sigma: float | None = Field(default=None, ge=0)
    upstream: float = 0.0

    @model_validator(mode="after")
    def _sizes(self) -> BoxSection:
        for key in ("points", "spacing"):
            if not all(x > 0 for x in getattr(self, key) or ()):
                raise problem("must be three positive numbers along x, y, z", key=key)
        if self.scale is not None and self.sigma is not None:
            raise problem("stands beside scale; give one of the two", key="sigma")
        return self


assert set(BoxSection.model_fields) == set(BOX_KEYS)


class FullFieldSection(WindSection):
    """One wind per file.

    files             one path or a list, relative to the campaign file: `.bts`, `.wnd` (with its `.sum` beside it where it is a field),
                      `.hh`, a Mann box's u component or the `.hawc`, `.htc` that names it
    harmonics         azimuthal harmonics that the blades feel (default 6); 1 is the plane over the disc, 0 its mean
    mean_speed        of Mann boxes at hub height [m/s]; of other files what it must be
    shear_exponent    of the mean wind that is added to a Mann box; or
    roughness_length  [m] of a logarithmic one
    box               of Mann boxes: points and spacing [m] along x, y, z; scale or sigma [m/s], reference_height, upstream [m]
    """

    kind = "full-field"

    files: Annotated[list[str], BeforeValidator(check_not_empty), BeforeValidator(as_list)]
    harmonics: Harmonics = DEFAULT_HARMONICS
    mean_speed: float | None = Field(default=None, gt=0)
    shear_exponent: float | None = Field(default=None, ge=-1, le=1)
    roughness_length: float | None = Field(default=None, gt=0)
    box: BoxSection | None = None

    @model_validator(mode="after")
    def _one_profile(self) -> FullFieldSection:
        one_profile(self)
        return self

    def realisations(self, site: Site) -> Iterator[Realisation]:
        keys = "harmonics", "mean_speed", "shear_exponent", "roughness_length"
        given = tuple((key, getattr(self, key)) for key in keys if getattr(self, key) is not None)
        if self.box is not None:
            given = (*given, ("box", _plain(self.box.model_dump(exclude_unset=True))))
        for index, name in enumerate(self.files):
            path = site.place.file(name)
            try:
                digest = content(path)
            except OSError as error:
                what = name if str(error.filename) == str(path) else error.filename  # or what lies beside it
                raise InputError(
                    f"{site.place.where('files', index)}: wind file {str(what)!r} cannot be read ({error.strerror}); "
                    "paths start at the campaign file"
                ) from None
            except InputError as error:
                raise InputError(f"{site.place.where('files', index)}: {error}") from None
            yield Realisation(
                file_id(path.stem), self.kind, (("path", str(path)), *given), ("files", index), contents=(("path", digest),)
            )  # fmt: skip

    def resolved(self, place: Place) -> dict[str, Any]:
        return {**super().resolved(place), "files": [str(place.file(name)) for name in self.files]}
