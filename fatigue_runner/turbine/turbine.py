"""A turbine ready to simulate: parameters, tables, and the compiled right-hand side."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fatigue_runner.caches import kept_with
from fatigue_runner.control import Submodel
from fatigue_runner.control.section import control_section
from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.layout import DEFAULT_FAMILY, FAMILIES, HARMONICS, RPM, Channel, Layout
from fatigue_runner.rotor import SQUARE, Rotor
from fatigue_runner.turbine.dynamics import CONTROLLED_BY, UNCONTROLLED, Dynamics
from fatigue_runner.turbine.file import check_turbine, mapping_source, read_turbine_file
from fatigue_runner.turbine.parameters import DEFAULTS, at_pitch, checked, equation_parameters
from fatigue_runner.turbine.rated import rated_rotor_speed
from fatigue_runner.turbine.rigid import RigidRotor
from fatigue_runner.turbine.tables import AeroTables, read_tables, table_file, tables_from_mapping

if TYPE_CHECKING:
    from fatigue_runner.turbine.lanes import KernelData
    from fatigue_runner.turbine.model import Model

Array = NDArray[np.float64]


# fixed: the pitch is held, the torque follows the momentary speed; torque-law: the controller's torque at fine pitch; controlled: both
FIXED, TORQUE_LAW, CONTROLLED = "fixed", "torque-law", "controlled"
OPERATIONS = (FIXED, TORQUE_LAW, CONTROLLED)
BEYOND_FINE = 0.1  # rad: a pitch at which the torque is that of region 3


@dataclass(frozen=True, eq=False)
class Turbine:
    """One turbine. `parameters` by `parameter_names.PARAMETERS` [SI], at zero pitch.

    family: `t2b1i1cg` (the blades share one edge mode) or `t2b2cg` (each has its own);
    control: the turbine file's section, None where it has none; operation: who steers, see `OPERATIONS`; dynamics: what moves it;
    tower: heights and diameters as `rotor.Rotor` has them, which only the wind sees;
    sections {name: (outer diameter, wall) [m]}: circles whose wear is counted, which change no motion;
    base_height: of the tower's foot above ground [m];
    operating_wind: from cut-in to cut-out [m/s], None where the file does not say;
    generator_efficiency: electrical power over mechanical power;
    file: the name or path that it was loaded by, "" for a mapping; content: of the turbine file, None for a full parameter set.
    """

    name: str
    parameters: Mapping[str, float]
    tables: AeroTables
    description: str = ""
    dynamics: Dynamics = UNCONTROLLED[DEFAULT_FAMILY]
    control: Mapping[str, Any] | None = None
    operation: str = FIXED
    tower: tuple[tuple[float, float], ...] = ()
    family: str = DEFAULT_FAMILY
    sections: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    operating_wind: tuple[float, float] | None = None
    generator_efficiency: float = 1.0
    base_height: float = 0.0
    file: str = ""
    content: Mapping[str, Any] | None = field(default=None, repr=False)

    @property
    def layout(self) -> Layout:
        """The states and signals of its equations."""
        return self.dynamics.layout

    def operated(self, operation: str) -> Turbine:
        """The turbine in a mode of operation; itself where that is its own.

        Raises InputError for an unknown mode, and for a controller that the turbine file does not have.
        """
        if operation not in OPERATIONS:
            raise InputError(f"unknown operation {operation!r}{did_you_mean(str(operation), OPERATIONS)}")
        if operation == self.operation:
            return self
        if operation != FIXED and self.control is None:
            raise InputError(
                f"turbine {self.name} has no `control` section, so that it cannot run with operation {operation!r}; "
                "add one (compare nrel5mw.yaml) or use operation: fixed"
            )
        return _operated(self, operation)

    @property
    def way_out(self) -> str:
        """What to do in a wind in which there is no steady rotation."""
        rated = rated_rotor_speed(self)
        if self.operation != FIXED or rated is None:
            return "take another wind or pitch, or give `initial` explicitly"
        return (
            f"a fixed pitch has no controller that holds the rated {RPM * rated:.3g} rpm: use operation: controlled, a larger pitch or "
            "less wind"
        )

    @property
    def controller(self) -> Submodel | None:
        """Who steers; None where the pitch is fixed."""
        return self.dynamics.controller

    @cached_property
    def control_parameters(self) -> dict[str, float]:
        """The controller's `parameters` in this operation; none where the pitch is fixed."""
        if self.controller is None or self.control is None:
            return {}
        p = self.parameters
        law = {key: p[key] for key in ("tg_k", "tg_a2", "tg_ws", "tg_p", "tg_t")} | {
            "tg_e": self.control["torque_blend"]
        }
        return self.controller.read(self.control, law, self.operation == CONTROLLED)

    def _by_name(self, state: ArrayLike) -> dict[str, Array]:
        x = np.asarray(state, float)
        return {name: x[..., i] for i, name in enumerate(self.layout.names)}

    def commanded(self, state: ArrayLike) -> dict[str, Array]:
        """Pitch [rad] and generator torque [N m] that the controller makes of states (..., k); empty where the pitch is fixed."""
        if self.controller is None:
            return {}
        return self.controller.outputs(self._by_name(state), self.control_parameters, np.sqrt)

    def observed(self, state: ArrayLike) -> dict[str, Array]:
        """What else a person sees of the controller in states (..., k), by `controller.seen`; empty where the pitch is fixed."""
        if self.controller is None or self.control is None:
            return {}
        limit = float(np.radians(self.control["pitch_rate_limit_deg"]))
        return self.controller.observed(self._by_name(state), self.control_parameters, limit)

    @property
    def watched(self) -> dict[str, float]:
        """What decides channels and not the motion, so that it stands in no hash of the turbine."""
        limit = (
            {"pitch_rate_limit_deg": self.control["pitch_rate_limit_deg"]}
            if self.controller and self.control
            else {}
        )
        return {"generator_efficiency": self.generator_efficiency, **limit}

    @cached_property
    def rigid(self) -> RigidRotor:
        """The rotor as its tables have it."""
        return RigidRotor(self.parameters, self.tables)

    @cached_property
    def rated_wind(self) -> float | None:
        """Wind [m/s] at which the rigid rotor reaches the controller's power; None where it never does, or nobody steers."""
        if self.controller is None:
            return None
        fastest = self.controller.speeds(self.control_parameters)[1] / self.gearbox_ratio
        fine = self._fine_pitch
        return self.rigid.rated_wind(self._taken(fastest, fine + BEYOND_FINE), fastest, fine)

    @property
    def pitches(self) -> bool:
        """Whether a controller turns its blades."""
        return self.operation == CONTROLLED

    def needed_pitch(self, wind: float) -> float | None:
        """Pitch [rad] at which the rigid rotor holds its speed in a wind [m/s]; None where the aerodynamic tables end below it.

        Raises InputError where nobody pitches.
        """
        if self.controller is None:
            raise InputError(f"operation {self.operation!r} has no controller that pitches")
        fine = self._fine_pitch
        fastest = self.controller.speeds(self.control_parameters)[1] / self.gearbox_ratio
        if self.rated_wind is None or wind < self.rated_wind:
            return fine
        return self.rigid.pitch_for(self._taken(fastest, fine + BEYOND_FINE), wind, fastest, fine)

    @property
    def _fine_pitch(self) -> float:
        return float(np.radians(self.control["fine_pitch_deg"])) if self.control else 0.0

    def guesses(self, wind: float) -> tuple[list[tuple[float, Array]], float]:
        """Where a search for steady rotation starts: see `steady.Equations`.

        From the fastest rotation down, so that the point right of the power maximum is found, not the stalled one; under a controller
        first where the rigid rotor is in balance, not faster than it holds, and no rotation that its cut-in is above.
        """
        radius, controller = self.parameters["radius"], self.controller
        if controller is None:
            none = np.zeros(len(self.layout.first_order))
            ratios = (7.5, 9.0, 6.0, 5.0, 10.5, 4.0, 3.0, 12.0)
            return [(ratio * wind / radius, none) for ratio in ratios], 0.02
        p, gearbox = self.control_parameters, self.gearbox_ratio
        slowest, fastest = (speed / gearbox for speed in controller.speeds(p))
        pairs = [self._balance(wind, slowest, fastest)]
        for pitch in np.radians((0.0, 2.0, 5.0, 9.0, 13.0, 17.0, 21.0, 25.0)):
            pairs += [(min(r * wind / radius, fastest), pitch) for r in (7.5, 9.0, 12.0, 14.0, 6.0, 5.0)]
        found = [
            (speed, np.array(controller.start(p, gearbox * speed, self._fine_pitch + beyond)))
            for speed, beyond in pairs
        ]
        return found, slowest

    def _balance(self, wind: float, slowest: float, fastest: float) -> tuple[float, float]:
        """Rotor speed [rad/s] and pitch beyond fine [rad] at which the rigid rotor gives the power that the controller takes."""
        fine = self._fine_pitch
        speeds = np.linspace(slowest, fastest, 200)
        surplus = self.rigid.power(wind, speeds, fine) - np.array(
            [self._taken(speed, fine) for speed in speeds]
        )
        if surplus[-1] > 0 and self.operation == CONTROLLED:
            pitch = self.rigid.pitch_for(self._taken(fastest, fine + BEYOND_FINE), wind, fastest, fine)
            return fastest, (pitch or fine) - fine
        gives = np.flatnonzero(surplus > 0)
        return float(speeds[gives[-1]] if len(gives) else slowest), 0.0

    def _taken(self, speed: float, pitch: float) -> float:
        """Power [W] that the controller takes from a steady rotor."""
        assert self.controller is not None
        generator = self.gearbox_ratio * speed
        states = {"generator_speed": generator, **dict.fromkeys(self.layout.names, 0.0)}
        own = self.controller.start(self.control_parameters, generator, pitch)
        states |= dict(zip(self.controller.names, own, strict=True))
        return float(
            generator * self.controller.outputs(states, self.control_parameters, np.sqrt)["generator_torque"]
        )

    @property
    def hash(self) -> str:
        """SHA-256 of parameters, tables and interpolation: what logs, correctors and reports are bound to."""
        return _hash(self)

    def kernel_data(self, pitch: float = 0.0, harmonics: bool = False) -> KernelData:
        """Constants and table cells for the kernels; pitch [rad], positive to feather; harmonics: for winds with azimuthal ones."""
        return _data_of(self, self.dynamics.model(False, harmonics), float(pitch))

    def pitched_kernel_data(self, harmonics: bool = False) -> KernelData:
        """The same for a pitch that varies in time. Raises InputError where the tables have too few pitches."""
        return _data_of(self, self.dynamics.model(True, harmonics), 0.0)

    @property
    def pitch_range(self) -> tuple[float, float]:
        """Lowest and highest pitch of the aerodynamic tables [rad]."""
        return float(self.tables.pitch[0]), float(self.tables.pitch[-1])

    @property
    def rotor_radius(self) -> float:
        """R of the tip-speed ratio and the shears: the tips' distance from the shaft [m]."""
        return self.parameters["radius"]

    @property
    def rotor(self) -> Rotor:
        """What a wind source needs to know of the turbine."""
        p = self.parameters
        tilt, cone = (float(np.arctan2(p[f"sin_{name}"], p[f"cos_{name}"])) for name in ("tilt", "cone"))
        weight = self.tables.span_weight or SQUARE
        apex = p["overhang"] * p["cos_tilt"]
        return Rotor(self.rotor_radius, self.hub_height, weight, apex, tilt, cone, self.tower)

    @property
    def gearbox_ratio(self) -> float:
        """Generator speed over rotor speed [-]."""
        return self.parameters["g_ratio"]

    @property
    def hub_height(self) -> float:
        """Height of the rotor apex above ground [m]."""
        p = self.parameters
        return self.base_height + p["t_h"] + p["tower_to_shaft"] + p["overhang"] * p["sin_tilt"]

    def rhs(
        self,
        state: ArrayLike,
        wind: ArrayLike,
        vertical_shear: ArrayLike = 0.0,
        horizontal_shear: ArrayLike = 0.0,
        pitch: ArrayLike = 0.0,
    ) -> Array:
        """Time derivative of the state; (size,) or (size, n) -> the same shape.

        wind [m/s], shears [-]: numbers or (n,), other signals are zero; pitch [rad]: a number, or (n,), which takes the kernel for a
        varying pitch.
        Raises InputError for another shape.
        """
        from fatigue_runner.turbine.lanes import evaluate

        x, size = np.asarray(state, float), self.layout.size
        if x.ndim not in (1, 2) or x.shape[0] != size:
            raise InputError(f"state must have shape ({size},) or ({size}, n), got {x.shape}")
        columns, angle = x.reshape(size, -1), np.asarray(pitch, float)
        p = np.zeros((self.layout.wind_size(), columns.shape[1]))
        for row, signal in enumerate((wind, vertical_shear, horizontal_shear)):
            p[row] = signal
        if angle.ndim:
            u = np.broadcast_to(angle, (1, columns.shape[1]))
            return evaluate(self.pitched_kernel_data(), columns, p, u)[0].reshape(x.shape)
        return evaluate(self.kernel_data(float(angle)), columns, p)[0].reshape(x.shape)

    def loads(
        self,
        state: ArrayLike,
        wind: ArrayLike,
        pitch: ArrayLike = 0.0,
        signals: Sequence[Channel] | None = None,
    ) -> dict[str, Array]:
        """Load channels [SI] for states (n, k) and wind (n, 3 or more), the accelerations being those of the equations.

        pitch [rad]: a number, or (n,), the pitch of each state; signals: what the wind's columns are, None for those of the layout
        and then the azimuthal harmonics, as far as they go.
        """
        from fatigue_runner.turbine.lanes import load_channels

        x = np.asarray(state, float)
        data, rows, control = self._driven(x, wind, pitch, signals)
        return self.completed(load_channels(data, x, rows, control), x, pitch)

    def completed(self, loads: dict[str, Array], state: Array, pitch: ArrayLike = 0.0) -> dict[str, Array]:
        """The kernel's load channels of states (n, k) with those that are made of them: power and blade pitch."""
        mechanical = loads["generator_torque"] * state[:, self.layout.generator_speed]
        return loads | {
            "generator_power": self.generator_efficiency * mechanical,
            "blade_pitch": self.turned(state, pitch),
        }

    def turned(self, state: Array, pitch: ArrayLike = 0.0) -> Array:
        """Blade pitch [rad] (n,) in states (n, k): what the controller makes of them, else `pitch`."""
        angle = np.asarray(pitch, float) if self.controller is None else self.commanded(state)["pitch"]
        return np.broadcast_to(angle, len(state)).astype(float)

    def derivative(
        self,
        state: ArrayLike,
        wind: ArrayLike,
        pitch: ArrayLike = 0.0,
        signals: Sequence[Channel] | None = None,
    ) -> Array:
        """Time derivatives (n, k) of states (n, k); wind, pitch and signals as in `loads`."""
        from fatigue_runner.turbine.lanes import evaluate

        x = np.asarray(state, float)
        data, rows, control = self._driven(x, wind, pitch, signals)
        turned = None if control is None else np.ascontiguousarray(control.T)
        return evaluate(data, np.ascontiguousarray(x.T), np.ascontiguousarray(rows.T), turned)[0].T

    def _driven(
        self, x: Array, wind: ArrayLike, pitch: ArrayLike, signals: Sequence[Channel] | None
    ) -> tuple[KernelData, Array, Array | None]:
        """What the kernels read for states (n, k): turbine, wind (n, rows), and control signals (n, 1) where the pitch is one."""
        angle, blown = np.asarray(pitch, float), np.asarray(wind, float)
        known = (*self.layout.wind, *HARMONICS)[: blown.shape[1]] if signals is None else signals
        rows = np.zeros((len(blown), self.layout.wind_size(known)))
        rows[:, self.layout.wind_rows(known)] = blown
        harmonics = self.layout.beyond(known)
        if self.controller is not None:
            angle = np.asarray(0.0)
        if angle.ndim:
            return self.pitched_kernel_data(harmonics), rows, angle[:, None]
        return self.kernel_data(float(angle), harmonics), rows, None

    def operating_point(
        self,
        wind: float,
        vertical_shear: float = 0.0,
        horizontal_shear: float = 0.0,
        azimuth: float = 0.0,
        pitch: float = 0.0,
        operation: str | None = None,
    ) -> Array:
        """(size,) state of steady rotation: mean loads and the flap's swing over a revolution are balanced.

        wind [m/s], shears [-], azimuth and pitch [rad]; operation: another one than the turbine's, whose states it then has.
        Raises InputError where the turbine has no steady rotation at this wind and pitch.
        """
        from fatigue_runner.turbine.steady import operating_point

        if operation is not None:
            return self.operated(operation).operating_point(
                wind, vertical_shear, horizontal_shear, azimuth, pitch
            )
        return operating_point(self, wind, vertical_shear, horizontal_shear, azimuth, pitch)

    def revolution(self, wind: float, pitch: float = 0.0) -> Array:
        """(n, size) states at equal steps of the azimuth, one revolution of steady rotation in uniform wind; else as `operating_point`."""
        from fatigue_runner.turbine.steady import revolution

        return revolution(self, wind, pitch)

    def natural_frequencies(self, wind: float, pitch: float = 0.0) -> list[tuple[str, float, float]]:
        """(name, undamped natural frequency [Hz], damping ratio) of the oscillating modes, by frequency."""
        from fatigue_runner.turbine.steady import natural_frequencies

        return natural_frequencies(self, wind, pitch)


@kept_with(4)
def _operated(turbine: Turbine, operation: str) -> Turbine:
    dynamics = UNCONTROLLED[turbine.family]
    if turbine.control is not None and operation != FIXED:
        name = turbine.control["controller"]
        behind_actuator = turbine.control["actuator"] is not None and operation == CONTROLLED
        dynamics = CONTROLLED_BY[turbine.family][f"{name}_actuator" if behind_actuator else name]
    return replace(turbine, operation=operation, dynamics=dynamics)


@kept_with(1)
def _hash(turbine: Turbine) -> str:
    digest = hashlib.sha256()
    for name, value in sorted(turbine.parameters.items()):
        if DEFAULTS.get(name) == value:
            continue
        # nine digits: the mode integrals' last bits depend on the BLAS kernels that a processor gets
        digest.update(f"{name}={value:.8e};".encode())
    if turbine.family != DEFAULT_FAMILY:
        digest.update(turbine.family.encode())
    digest.update(turbine.tables.interpolation.encode())
    for values in (turbine.tables.tip_speed_ratio, turbine.tables.pitch):
        digest.update(np.ascontiguousarray(values).tobytes())
    for name in sorted(turbine.tables.coefficients):
        digest.update(name.encode() + np.ascontiguousarray(turbine.tables.coefficients[name]).tobytes())
    if turbine.operation != FIXED:
        digest.update(turbine.operation.encode())
        for name, value in sorted(turbine.control_parameters.items()):
            digest.update(f"{name}={value:.8e};".encode())
    return digest.hexdigest()


def _data_of(turbine: Turbine, model: Model, pitch: float) -> KernelData:
    """What the kernels of `model` read; pitch [rad] where they are made for one."""
    if model.looks_up_pitch:
        return _data_for_every_pitch(turbine, model)
    return _data_at_pitch(turbine, model, pitch)


@kept_with(256)
def _data_at_pitch(turbine: Turbine, model: Model, pitch: float) -> KernelData:
    from fatigue_runner.turbine.lanes import KernelData

    kernel, tables = model.generated, turbine.tables
    return KernelData(
        model=model,
        constants=kernel.constants(at_pitch(turbine.parameters, pitch)),
        tables=tables.cells(pitch, kernel.TABLES[: kernel.EQUATION_TABLES]),
        make_load_tables=lambda: tables.cells(pitch, kernel.TABLES),
        cells=len(tables.tip_speed_ratio) - 1,
    )


@kept_with(4)
def _data_for_every_pitch(turbine: Turbine, model: Model) -> KernelData:
    from fatigue_runner.turbine.lanes import KernelData

    kernel, tables = model.generated, turbine.tables
    return KernelData(
        model=model,
        constants=kernel.constants({**turbine.parameters, **turbine.control_parameters}),
        tables=_pitched_cells(tables, kernel.TABLES[: kernel.EQUATION_TABLES]),
        make_load_tables=lambda: _pitched_cells(tables, kernel.TABLES),
        cells=len(tables.tip_speed_ratio) - 1,
    )


@kept_with(4)
def _pitched_cells(tables: AeroTables, names: tuple[str, ...]) -> Array:
    """Made once for all modes of operation and gains of a turbine: seconds otherwise."""
    return tables.pitched_cells(names)


def load_turbine(source: str | Path | Mapping[str, Any]) -> Turbine:
    """A turbine by shipped name (`nrel5mw`, `t2b1i1cg`), by the path of a turbine YAML, or from a mapping.

    A mapping is either a turbine file's content, or a full parameter set: `parameters` (parameter_names.PARAMETERS) and `tables`
    (tip_speed_ratio, pitch_deg, coefficients), with `interpolation: cubic | bilinear`.
    Raises InputError naming what is missing or wrong.
    """
    if not isinstance(source, Mapping):
        data = read_turbine_file(str(source))
    else:
        data = dict(source) if "parameters" in source else check_turbine(mapping_source(source))
    name, description = str(data.get("name", "unnamed")), str(data.get("description", ""))
    family = str(data.get("model", DEFAULT_FAMILY))
    if "parameters" in data:
        if "tables" not in data:
            raise InputError(f"turbine {name}: a full parameter set needs `tables` beside `parameters`")
        if family not in FAMILIES:
            raise InputError(f"turbine {name}: unknown model {family!r}{did_you_mean(family, FAMILIES)}")
        interpolation = str(data.get("interpolation", "cubic"))
        return Turbine(
            name,
            checked(data["parameters"]),
            tables_from_mapping(data["tables"], interpolation),
            description,
            UNCONTROLLED[family],
            family=family,
        )
    try:
        with np.errstate(all="ignore"):  # what is no number is refused
            parameters = equation_parameters(data)
    except InputError as error:
        raise error if isinstance(source, Mapping) else InputError(f"{source}: {error}") from None
    aero = data["aerodynamics"]
    path = Path(str(aero["tables"]))
    tables = read_tables(path, str(aero.get("interpolation", "cubic")))
    # a shipped turbine's tables are checked when the project is built; a user's may have been made before the blade changed
    if isinstance(source, Mapping) or Path(str(source)).suffix:
        _check_inputs(path, data)
    # a law without regions has no rated speed that a pitch could hold
    given = data.get("control") if data["generator"]["law"] == "regions" else None
    control = _control(given, data, parameters, tables) if given else None
    tower = tuple(
        (float(height), float(diameter)) for height, diameter in data["tower"].get("diameters") or ()
    )
    sections = {
        where: (float(circle["diameter"]), float(circle["wall"]))
        for where, circle in (data.get("sections") or {}).items()
        if circle
    }
    wind = data.get("operating_wind")
    return Turbine(
        name, parameters, tables, description, UNCONTROLLED[family], control, tower=tower, family=family,
        base_height=float(data["geometry"]["tower_base_height"]),
        file="" if isinstance(source, Mapping) else str(source),
        sections=sections, operating_wind=None if wind is None else (float(wind[0]), float(wind[1])),
        generator_efficiency=float(data["generator"].get("efficiency", 1.0)), content=data,
    )  # fmt: skip


def _control(
    given: Mapping[str, Any], data: Mapping[str, Any], parameters: Mapping[str, float], tables: AeroTables
) -> dict[str, Any]:
    """The `control` section with its defaults and, where it says `tuning`, the gains that follow."""
    section = control_section(given).model_dump()
    if section["tuning"] is None:
        return section
    from fatigue_runner.turbine.design import designed_gains

    try:
        return section | designed_gains(section, data, RigidRotor(parameters, tables))
    except InputError as error:
        raise InputError(f"turbine {data.get('name', '?')}: control: tuning: {error}") from None


def _check_inputs(path: Path, data: Mapping[str, Any]) -> None:
    """Refuse tables that were made for another blade."""
    from fatigue_runner.turbine.table_builder import turbine_inputs

    with table_file(path) as stored:
        made_for = str(stored["inputs"]) if "inputs" in stored else ""
    # tables from another program carry no such hash: whoever gives them answers for them
    if made_for and "airfoils" in data["aerodynamics"] and made_for != turbine_inputs(data):
        raise InputError(
            f"aerodynamic tables {path} were made for another blade, cone or airfoil than turbine {data.get('name', '?')} has; "
            "make them anew with `fatigue-runner turbine tables FILE`"
        )
