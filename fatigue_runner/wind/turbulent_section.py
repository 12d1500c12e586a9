"""What a campaign file says of turbulent wind; what blows is `turbulence.TurbulentWind`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, ClassVar

from pydantic import Field, PlainValidator, ValidationInfo, field_validator, model_validator

from fatigue_runner.errors import InputError
from fatigue_runner.inputs.section import known_name, problem
from fatigue_runner.inputs.sweep import Sweep, expand
from fatigue_runner.naming import joined, speed_id
from fatigue_runner.wind import spectrum
from fatigue_runner.wind.azimuthal_spectrum import DEFAULT_HARMONICS
from fatigue_runner.wind.mean_shear import one_profile
from fatigue_runner.wind.section import Harmonics, Realisation, Site, WindSection
from fatigue_runner.wind.streams import own_seeds
from fatigue_runner.wind.strength import Strength

# keys whose values are names of a table, and how these are spelled there
TABLES: dict[str, tuple[Mapping[str, Any], Callable[[str], str]]] = {
    "spectrum": (spectrum.SPECTRA, str.lower),
    "turbulence": (spectrum.TURBULENCE_MODELS, str.lower),
    "turbulence_class": (spectrum.TURBULENCE_CLASSES, str.upper),
    "wind_class": (spectrum.WIND_CLASSES, str.upper),
}


def _seeds(value: Any) -> int | list[int]:
    if isinstance(value, list):
        if not value or not all(type(seed) is int and seed >= 0 for seed in value):
            raise problem(f"must be a count or a list of whole numbers, 0 or more; got {value!r:.60}")
        twice = next((seed for i, seed in enumerate(value) if seed in value[:i]), None)
        if twice is not None:
            raise problem(f"seed {twice} stands twice; the same wind would count twice: remove one")
        return list(value)
    if type(value) is not int or not 1 <= value <= 999:
        raise problem(f"must be a count from 1 to 999 or a list of seeds; got {value!r:.60}")
    return value


class TurbulentSection(WindSection):
    """Every combination of speed and seed, in this order.

    speeds             mean hub-height speeds [m/s]: a sweep
    intensity          sigma_1 / mean speed at hub height [-], e.g. 0.14
    turbulence_class   `A+`, `A`, `B` or `C` of an IEC turbulence model, instead of `intensity`
    turbulence         that model: `ntm` (normal, default) or `etm` (extreme), which needs a
    wind_class         `I`, `II` or `III`
    shear_exponent     power-law exponent alpha of the mean wind (default 0.2), or
    roughness_length   z_0 [m] of a logarithmic mean wind
    seeds              how many per speed (default 1; also `n_seeds`), numbers that no other speed has: 600001, 600002, ... at 6 m/s; or a
                       list of numbers for every speed. One number is another turbulence at every speed
    harmonics          azimuthal harmonics that the blades feel: 6 (default) hold 98 % of every load range, 1 is mean and linear shears
    spectrum           `kaimal` (default) or `von-karman`
    """

    kind = "turbulent"
    synonyms: ClassVar = {"n_seeds": "seeds"}

    speeds: Sweep
    intensity: float | None = Field(default=None, gt=0, le=1)
    turbulence_class: str | None = None
    turbulence: str = "ntm"
    wind_class: str | None = None
    shear_exponent: float | None = Field(default=None, ge=-1, le=1)
    roughness_length: float | None = Field(default=None, gt=0)
    seeds: Annotated[int | list[int], PlainValidator(_seeds)] = 1
    harmonics: Harmonics = DEFAULT_HARMONICS
    spectrum: str = "kaimal"

    @field_validator(*TABLES)
    @classmethod
    def _exists(cls, name: str | None, about: ValidationInfo) -> str | None:
        table, spelled = TABLES[str(about.field_name)]
        return None if name is None else known_name(name, table, spelled(name))

    @model_validator(mode="after")
    def _one_strength(self) -> TurbulentSection:
        one_profile(self)
        if (self.intensity is None) == (self.turbulence_class is None):
            classes = ", ".join(spectrum.TURBULENCE_CLASSES)
            raise problem(
                f"of type 'turbulent' needs either `intensity` (e.g. 0.14) or `turbulence_class` ({classes})"
            )
        try:
            _ = self._strength
        except InputError as error:
            raise problem(str(error).removeprefix("turbulent wind: "), key="turbulence") from None
        return self

    @property
    def _strength(self) -> Strength:
        return Strength(self.intensity, self.turbulence_class, self.turbulence, self.wind_class)

    def seeds_at(self, speed: float) -> list[int]:
        """The seeds of the winds of a mean speed [m/s]: as many as asked for, which no other speed has, or the list as it stands.

        More speeds or more seeds leave the others as they are.
        """
        return self.seeds if isinstance(self.seeds, list) else own_seeds(speed, self.seeds)

    def realisations(self, site: Site) -> Iterator[Realisation]:
        keys = "intensity", "turbulence_class", "wind_class", "shear_exponent", "roughness_length"
        given = tuple((key, getattr(self, key)) for key in keys if getattr(self, key) is not None)
        model = (("turbulence", self.turbulence),) if self.turbulence != "ntm" else ()
        more = (("harmonics", self.harmonics), ("spectrum_name", self.spectrum))
        for speed, piece in expand(self.speeds):
            for seed in self.seeds_at(speed):
                yield Realisation(
                    joined(speed_id(speed), self._strength.id, f"s{seed}"),
                    self.kind,
                    (("mean", speed), ("seed", seed), ("duration", site.duration), *given, *model, *more),
                    ("speeds", piece),
                    speed,
                )
