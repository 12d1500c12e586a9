"""What the state and the signals of a simulation are: one description, from which every width, row and name follows.

A state is q, then q', then the first-order states (of a controller, say). q ends with the two azimuths of the drivetrain, rotor
and generator; what stands before them are deflections. Three coordinates in a row that are one deflection of each blade are a *blade
set*. Wind signals and control signals are inputs: the wind's come as cubics in time, control signals (a prescribed pitch) too.

A new state or signal is one entry here, or one entry of a layout that is derived from this one (`Layout.extended`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from fatigue_runner.errors import InputError

BLADES = 3


@dataclass(frozen=True)
class Channel:
    """One signal: its name everywhere, its SI unit, and how a person reads it (value * `scale` in `read_unit`)."""

    name: str
    unit: str
    label: str
    read_unit: str
    scale: float = 1.0


DEGREES, RPM = 57.29577951308232, 9.549296585513721


@dataclass(frozen=True)
class Coordinate:
    """A degree of freedom: q, its rate, and what the numerics must know of it.

    nudge: step of finite differences for q and for its rate; blade: 1 to 3 where it is one blade's part of a blade set.
    """

    position: Channel
    velocity: Channel
    nudge: float
    blade: int = 0


@dataclass(frozen=True)
class FirstOrder:
    """A state with a first derivative only; `nudge` as for a coordinate. Where a run begins elsewhere than in steady operation, it begins
    with the value of the state `follows`, as a filter does that has seen it for long, or at zero.

    In a unit in which it stays well below 1e4: beyond, a case counts as diverged (`integrators.vectors`).
    """

    signal: Channel
    nudge: float = 1e-4
    follows: str = ""


@dataclass(frozen=True)
class Layout:
    """Rows of the state, of the wind and of the control signals, in this order.

    harmonics: whether the wind goes on beyond `wind`: with that across the rotor (`ACROSS`), and with pairs of azimuthal harmonics, as
    many as the wind has.
    Raises ValueError where the drivetrain does not end the coordinates or a blade set is not three in a row.
    """

    coordinates: tuple[Coordinate, ...]
    wind: tuple[Channel, ...]
    first_order: tuple[FirstOrder, ...] = ()
    control: tuple[Channel, ...] = ()
    harmonics: bool = False

    def __post_init__(self) -> None:
        if [c.position.name for c in self.coordinates[-2:]] != ["rotor_azimuth", "generator_azimuth"]:
            raise ValueError("a layout's coordinates end with rotor_azimuth and generator_azimuth")
        blades = [c.blade for c in self.coordinates]
        firsts = [i for i, blade in enumerate(blades) if blade == 1]
        if any(blades[i : i + BLADES] != [1, 2, 3] for i in firsts) or len(firsts) * BLADES != sum(
            b > 0 for b in blades
        ):
            raise ValueError("a blade set of a layout is blade 1, 2 and 3 in a row")
        names = [c.name for c in (*self.states, *self.wind, *self.control)]
        if len(set(names)) != len(names):
            raise ValueError(f"a name stands twice in a layout: {', '.join(names)}")

    def extended(
        self,
        first_order: tuple[FirstOrder, ...] = (),
        wind: tuple[Channel, ...] = (),
        control: tuple[Channel, ...] = (),
        harmonics: bool | None = None,
    ) -> Layout:
        """The same with more states and signals behind its own."""
        return replace(
            self,
            first_order=(*self.first_order, *first_order),
            wind=(*self.wind, *wind),
            control=(*self.control, *control),
            harmonics=self.harmonics if harmonics is None else harmonics,
        )

    # --- the state ---

    @cached_property
    def states(self) -> tuple[Channel, ...]:
        """Every row of the state."""
        positions = tuple(c.position for c in self.coordinates)
        velocities = tuple(c.velocity for c in self.coordinates)
        return (*positions, *velocities, *(s.signal for s in self.first_order))

    @cached_property
    def names(self) -> tuple[str, ...]:
        return tuple(c.name for c in self.states)

    @property
    def size(self) -> int:
        """Rows of the state."""
        return 2 * len(self.coordinates) + len(self.first_order)

    @property
    def freedoms(self) -> int:
        """Number of coordinates q; the row of a coordinate's rate is this much further on."""
        return len(self.coordinates)

    @property
    def deflections(self) -> int:
        """Coordinates before the drivetrain's azimuths."""
        return self.freedoms - 2

    @property
    def rotor(self) -> int:
        """Row of the rotor azimuth; the generator's follows."""
        return self.freedoms - 2

    @property
    def generator(self) -> int:
        return self.freedoms - 1

    @property
    def rotor_speed(self) -> int:
        return self.freedoms + self.rotor

    @property
    def generator_speed(self) -> int:
        return self.freedoms + self.generator

    @property
    def positions(self) -> slice:
        return slice(0, self.freedoms)

    @property
    def velocities(self) -> slice:
        return slice(self.freedoms, 2 * self.freedoms)

    @property
    def first_order_rows(self) -> slice:
        return slice(2 * self.freedoms, self.size)

    @cached_property
    def blade_sets(self) -> tuple[int, ...]:
        """First row of each blade set among the coordinates."""
        return tuple(i for i, c in enumerate(self.coordinates) if c.blade == 1)

    @cached_property
    def nudges(self) -> tuple[float, ...]:
        """Finite-difference steps of all rows."""
        own = tuple(c.nudge for c in self.coordinates)
        return (*own, *own, *(s.nudge for s in self.first_order))

    def row(self, name: str) -> int:
        """Row of a state by its name; raises KeyError."""
        return self._rows[name]

    @cached_property
    def _rows(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.names)}

    # --- the wind ---

    def wind_rows(self, signals: Iterable[Channel]) -> list[int]:
        """Row that the kernels read each of a wind's signals from: wind across and azimuthal harmonics stand behind the layout's own.

        Raises InputError for a signal that these equations do not know.
        """
        own = {c.name: row for row, c in enumerate((*self.wind, *ACROSS, *HARMONICS))}
        names = [c.name for c in signals]
        if unknown := [name for name in names if name not in own]:
            raise InputError(
                f"the wind has a signal {unknown[0]!r} that the equations do not know; they know "
                f"{', '.join(c.name for c in (*self.wind, *ACROSS))} and azimuthal harmonics"
            )
        return [own[name] for name in names]

    def wind_size(self, signals: Collection[Channel] = ()) -> int:
        """Rows of the wind that the kernels take: the layout's own, wind across, and harmonics filled up to whole triples.

        The layout's own alone where the wind has nothing else and the equations need not know of it.
        """
        names = {c.name for c in signals}
        if not (self.harmonics or self.beyond(signals)):
            return len(self.wind)
        return self.first_harmonic + 2 * TRIPLE * -(-sum(c.name in names for c in HARMONICS) // (2 * TRIPLE))

    def beyond(self, signals: Collection[Channel]) -> bool:
        """Whether a wind has more than the layout's own signals: it needs the equations that take wind across and harmonics."""
        return not {c.name for c in signals} <= {c.name for c in self.wind}

    @property
    def first_harmonic(self) -> int:
        """Row of the first azimuthal harmonic's cosine."""
        return len(self.wind) + len(ACROSS)

    # --- relative coordinates: what forces depend on, besides the azimuth ---

    @property
    def relative_size(self) -> int:
        """Deflections, shaft twist, rates with that of the twist in place of the generator's, first-order states."""
        return self.size - 1

    @property
    def relative_blade_sets(self) -> tuple[int, ...]:
        """First rows of the blade sets and of their rates in relative coordinates, where one row is missing before the rates."""
        return (*self.blade_sets, *(i + self.freedoms - 1 for i in self.blade_sets))

    @property
    def state_blade_sets(self) -> tuple[int, ...]:
        """First rows of the blade sets and of their rates in the state."""
        return (*self.blade_sets, *(i + self.freedoms for i in self.blade_sets))

    @property
    def slope_rows(self) -> tuple[int, ...]:
        """Rows of the state's derivative that are not just the rates: accelerations, then first-order slopes."""
        return tuple(range(self.freedoms, self.size))


def _metres(name: str, label: str, rate_label: str = "", blade: int = 0, nudge: float = 1e-4) -> Coordinate:
    rate = Channel(f"{name}_velocity", "m/s", rate_label or f"{label} velocity", "m/s")
    return Coordinate(Channel(name, "m", label, "m"), rate, nudge, blade=blade)


def _turning(name: str, label: str, speed: str, speed_label: str, nudge: float) -> Coordinate:
    return Coordinate(
        Channel(name, "rad", label, "deg", DEGREES), Channel(speed, "rad/s", speed_label, "rpm", RPM), nudge
    )  # fmt: skip


WIND = (
    Channel("wind_speed", "m/s", "wind speed, mean over the rotor", "m/s"),
    Channel("vertical_shear", "-", "linear vertical shear", "-"),
    Channel("horizontal_shear", "-", "linear horizontal shear", "-"),
)

# Across the nacelle's axis, mean over the rotor: y to the left of who looks downwind, z up. Of a wind that blows straight on, zero
ACROSS = (
    Channel("lateral_wind", "m/s", "lateral wind, mean over the rotor", "m/s"),
    Channel("vertical_wind", "m/s", "vertical wind, mean over the rotor", "m/s"),
)

TRIPLE = 3  # azimuthal harmonics that the kernels fold at once
MOST_HARMONICS = 16  # of any wind; six hold 98 % of every load range (docs/decisions/0011)


def harmonic_channels(harmonics: int) -> tuple[Channel, ...]:
    """The signals behind the three of a wind with `harmonics` azimuthal ones: c_1, s_1, c_2, ... [m/s]; none for 0 or 1, whose shears
    stand among the three."""
    orders = range(1, harmonics + 1) if harmonics > 1 else ()
    return tuple(
        Channel(f"wind_{part}_{m}", "m/s", f"azimuthal harmonic {m} of the wind, {word}", "m/s")
        for m in orders
        for part, word in (("cos", "cosine"), ("sin", "sine"))
    )


HARMONICS = harmonic_channels(MOST_HARMONICS)


PITCH = Channel("pitch", "rad", "blade pitch", "deg", DEGREES)

# What a controller lets a person see besides pitch, torque and its states
PITCH_RATE = Channel("pitch_rate", "rad/s", "blade pitch rate", "deg/s", DEGREES)
PITCH_RATE_LIMITED = Channel("pitch_rate_limited", "-", "whether the pitch turns faster than its limit", "-")
PITCH_COMMAND = Channel("pitch_command", "rad", "pitch that the actuator is asked for", "deg", DEGREES)
TORQUE_REGION = Channel("torque_region", "-", "region of the torque law", "-")
SEEN_OF_CONTROL = (PITCH_RATE, PITCH_RATE_LIMITED, PITCH_COMMAND, TORQUE_REGION)

_TOWER = (
    _metres("tower_fore_aft", "tower-top fore-aft"),
    _metres("tower_side_side", "tower-top side-side"),
)
_FLAPS = tuple(_metres(f"blade{i}_flap", f"blade {i} flap", blade=i, nudge=1e-3) for i in (1, 2, 3))
_EDGES = tuple(_metres(f"blade{i}_edge", f"blade {i} edge", blade=i) for i in (1, 2, 3))
_DRIVETRAIN = (
    _turning("rotor_azimuth", "rotor azimuth", "rotor_speed", "rotor speed", 1e-6),
    _turning(
        "generator_azimuth", "generator azimuth (high-speed side)", "generator_speed", "generator speed", 1e-4
    ),
)  # fmt: skip

# Two tower modes, one flap mode of each blade, a collective edge mode (CADynTurb's T2B1i1cG) or one of each blade, rotor and generator.
# CADynTurb's T2B2cG has flap and edge for all blades together: T2B2CG with equal ones
T2B1I1CG = Layout((*_TOWER, *_FLAPS, _metres("edge", "collective edge"), *_DRIVETRAIN), WIND)
T2B2CG = Layout((*_TOWER, *_FLAPS, *_EDGES, *_DRIVETRAIN), WIND)
DEFAULT_FAMILY = "t2b1i1cg"
FAMILIES = {DEFAULT_FAMILY: T2B1I1CG, "t2b2cg": T2B2CG}


def family_of(names: Sequence[str]) -> str | None:
    """The member of the family whose states begin a list of names, in any order; None where there is none."""
    for family, layout in FAMILIES.items():
        if set(layout.names) <= set(names):
            return family
    return None
