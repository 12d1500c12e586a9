"""Prints the equations of motion as lane kernels: the text of `turbine/generated/`.

A `Variant` is one generated module: which layout, whether the pitch is an input, which submodels stand beside the turbine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import sympy as sp
from sympy.printing.pycode import PythonCodePrinter

from fatigue_runner.channels import EQUATION_LOADS
from fatigue_runner.control import SUBMODELS
from fatigue_runner.control import Submodel as Controller
from fatigue_runner.layout import FAMILIES, T2B1I1CG, Layout
from fatigue_runner.layout import PITCH as PITCH_SIGNAL
from fatigue_runner.turbine.derivation import equations as eq
from fatigue_runner.turbine.derivation.pitching import PITCH, with_varying_pitch
from fatigue_runner.turbine.parameter_names import PARAMETERS

Lines = list[tuple[sp.Symbol, sp.Expr]]


@dataclass(frozen=True)
class Submodel:
    """First-order states beside the turbine's. rates: from {name of a state or signal: its symbol} to {own state: derivative}."""

    rates: Callable[[dict[str, sp.Symbol]], dict[str, sp.Expr]]


@dataclass(frozen=True)
class Variant:
    """One generated module: `doc` its first line, `source` the files that it is made from."""

    doc: str
    source: str
    layout: Layout = T2B1I1CG
    states: eq.States = eq.T2B1I1CG
    varying_pitch: bool = False
    submodels: tuple[Submodel, ...] = field(default=())
    controller: Controller | None = None

    @property
    def parameters(self) -> tuple[str, ...]:
        """Of the equations, then of the controller."""
        return (*PARAMETERS, *(self.controller.parameters if self.controller else ()))

    def control_lines(self) -> Lines:
        """What the controller commands, as the first lines of a sheet; none without one."""
        if self.controller is None:
            return []
        made = self.controller.outputs(self.symbols, self.control_parameters, sp.sqrt)
        return [(PITCH, made["pitch"]), (eq.COMMANDED, made["generator_torque"])]

    def control_rates(self) -> dict[int, sp.Expr]:
        """Derivatives of the controller's states by their rows."""
        if self.controller is None:
            return {}
        made = self.controller.rates(self.symbols, self.control_parameters, sp.sqrt)
        return {self.layout.row(name): rate for name, rate in made.items()}

    @property
    def control_parameters(self) -> dict[str, sp.Symbol]:
        return {
            name: sp.Symbol(name, real=True)
            for name in (self.controller.parameters if self.controller else ())
        }

    @property
    def symbols(self) -> dict[str, sp.Symbol]:
        """Symbol of every state and signal by its name: the equations' own where they have one."""
        names = [c.name for c in (*self.layout.states, *self.layout.wind, *self.layout.control)]
        moving = zip(names, self.states.all, strict=False)  # first-order states and signals follow
        own = {
            **dict(moving),
            **dict(zip((c.name for c in T2B1I1CG.wind), eq.WIND, strict=True)),
            "pitch": PITCH,
        }
        return {name: own.get(name, sp.Symbol(name, real=True)) for name in names}

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the coefficients, those of the equations first."""
        return eq.tables(self.states, self.layout.harmonics)[0]

    @property
    def equation_tables(self) -> int:
        return eq.tables(self.states, self.layout.harmonics)[1]

    @property
    def inputs(self) -> dict[sp.Symbol, str]:
        """Where the kernels read each of them."""
        symbols = self.symbols
        out: dict[sp.Symbol, str] = {}
        for array, signals in (
            ("x", self.layout.states), ("wind", self.layout.wind), ("control", self.layout.control),
        ):  # fmt: skip
            out |= {symbols[signal.name]: f"{array}[{i}]" for i, signal in enumerate(signals)}
        return out | {s: f"wind[{len(self.layout.wind) + i}]" for i, s in enumerate(eq.ACROSS)}


class Printer(PythonCodePrinter):
    """Source that `lane_code` reads: products instead of powers, sums that become fused multiply-adds."""

    def _print_Pow(self, expr, rational=False):
        base, exponent = expr.as_base_exp()
        if exponent.is_Integer and 1 < abs(exponent) <= 4:
            product = "*".join([self.parenthesize(base, 50)] * abs(int(exponent)))
            return f"({product})" if exponent > 0 else f"(1.0/({product}))"
        if exponent == -1:
            return f"(1.0/{self.parenthesize(base, 50)})"
        if exponent == sp.Rational(1, 2) and not base.is_number:
            return f"sqrt({self._print(base)})"
        return repr(float(expr))

    def _print_Rational(self, expr):
        return repr(float(expr))

    def _print_Float(self, expr):
        # all digits, not sympy's fifteen
        return repr(float(expr))

    def _print_Integer(self, expr):
        return f"{int(expr)}.0"

    def _print_Add(self, expr, order=None):
        """Single terms first: `a + b*c + d*e` is two fused multiply-adds, `b*c + d*e + a` one more instruction."""
        terms = self._as_ordered_terms(expr, order=order)
        plain = [t for t in terms if not (-t if t.could_extract_minus_sign() else t).is_Mul]
        products = [t for t in terms if t not in plain]
        negative = [t for t in plain if t.could_extract_minus_sign()]
        positive = [t for t in plain if t not in negative] + [
            t for t in products if not t.could_extract_minus_sign()
        ]
        rest = negative + [t for t in products if t.could_extract_minus_sign()]
        first, others = (positive[0], positive[1:] + rest) if positive else (rest[0], rest[1:])
        text = self.parenthesize(first, 40)
        for t in others:
            minus = t.could_extract_minus_sign()
            text += (" - " if minus else " + ") + self.parenthesize(
                -t if minus else t, 40 if not minus else 41
            )
        return text


PRINT = Printer().doprint


def schedule(lines: list[tuple[sp.Symbol, sp.Expr]], prefix: str) -> list[tuple[sp.Symbol, sp.Expr]]:
    """The lines with their common subexpressions pulled out, each just before its first use."""
    names = sp.numbered_symbols(prefix, real=True)
    shared, reduced = sp.cse([expr for _, expr in lines], symbols=names, order="none")
    pending = dict(shared)
    out: list[tuple[sp.Symbol, sp.Expr]] = []

    def need(expr: sp.Expr) -> None:
        for symbol in sorted(expr.free_symbols & pending.keys(), key=lambda x: int(x.name[len(prefix) :])):
            if symbol in pending:
                definition = pending.pop(symbol)
                need(definition)
                out.append((symbol, definition))

    for (symbol, _), expr in zip(lines, reduced, strict=True):
        need(expr)
        out.append((symbol, expr))
    return out


def used_only(
    lines: list[tuple[sp.Symbol, sp.Expr]], wanted: set[sp.Symbol]
) -> list[tuple[sp.Symbol, sp.Expr]]:
    """Drop the lines that nothing wanted depends on."""
    kept = []
    for symbol, expr in reversed(lines):
        if symbol in wanted:
            wanted = wanted | expr.free_symbols
            kept.append((symbol, expr))
    return kept[::-1]


# sin and cos: remove whole turns, evaluate at a quarter of the rest, double the angle twice
SINE_COSINE = """\
turns = floor(phi * 0.15915494309189535 + 0.5)
quarter = (phi - turns * 6.283185307179586 - turns * 2.4492935982947064e-16) * 0.25
square = quarter * quarter
sine = quarter * ({sine})
cosine = {cosine}
double = 2.0 * sine * cosine
half = 1.0 - 2.0 * sine * sine
sin_phi = 2.0 * double * half
cos_phi = 1.0 - 2.0 * double * double
"""


def horner(first: int, terms: int) -> str:
    coefficients = [float(sp.Rational((-1) ** k, sp.factorial(2 * k + first))) for k in range(terms)]
    text = repr(coefficients[-1])
    for c in reversed(coefficients[:-1]):
        text = f"({c!r} + square * {text})"
    return text


def kernel(
    name: str,
    doc: str,
    variant: Variant,
    sheet: eq.Sheet,
    outputs: dict[int, sp.Expr],
    tables,
    constants,
) -> str:
    """One lane kernel: its assignments in order, each value read from an array just before its first use."""
    wanted: set[sp.Symbol] = set().union(*(e.free_symbols for e in outputs.values()))
    lines = schedule(used_only(sheet.lines, wanted | {eq.TIP_SPEED_RATIO}), "u")
    inputs = variant.inputs
    inputs[eq.HALF_SQRT3] = repr(3**0.5 / 2)
    inputs |= {c: f"constants[{i}]" for i, c in enumerate(constants)}
    phi = variant.states.of("phi")
    source = [f"{phi} = {inputs.pop(phi)}"]
    if PITCH in inputs:
        source.append(f"{PITCH} = {inputs.pop(PITCH)}")
    source += SINE_COSINE.format(sine=horner(1, 9), cosine=horner(0, 10)).rstrip("\n").split("\n")

    if variant.layout.harmonics:
        source.append(
            f"{', '.join(map(str, eq.FOLDED))} = harmonics(wind, {variant.layout.first_harmonic}, cos_phi, sin_phi)"
        )

    def write(target: str, expr: sp.Expr) -> None:
        for symbol in sorted(expr.free_symbols & inputs.keys(), key=str):
            source.append(f"{symbol} = {inputs.pop(symbol)}")
        source.append(f"{target} = {PRINT(expr)}")

    for symbol, expr in lines:
        write(str(symbol), expr)
    for i, expr in outputs.items():
        write(f"out[{i}]", expr)
    upper, width = f"{name.upper()}_CODE", len(tables)
    names = ("x", "wind", "control", "out")
    arguments, arrays = "".join(f"{a}, " for a in names), ", ".join(repr(a) for a in names)
    places = f"place={str(eq.TIP_SPEED_RATIO)!r}" + (
        f", second={str(PITCH)!r}" if variant.varying_pitch else ""
    )
    return "\n".join([
        f"{upper} = Code({places}, tables=TABLES[:{width}], width={-(-width // 8) * 8}, text=\"\"\"\\",
        *source, '""")',
        f"_{name}: Any = lane_kernel({upper}, ({arrays}), LANES)",
        "", "",
        "@njit(**INLINE)",
        f"def {name}({arguments}start, tables, cells, constants, clamped):",
        f'    """{doc}"""',
        f"    _{name}({arguments}start, tables, cells, constants, clamped)",
        "",
    ])  # fmt: skip


def commands(variant: Variant, constants: list[sp.Symbol]) -> str:
    """The lane kernel of the controller alone: what it commands, and the rates of its states, in a hundredth of the time of `rhs`."""
    made = dict(enumerate(value for _, value in variant.control_lines()))
    rates = dict(sorted(variant.control_rates().items())).values()
    made |= dict(enumerate(rates, start=len(made)))
    symbols = [sp.Symbol(f"c{i}", real=True) for i in made]
    inputs = variant.inputs | {c: f"constants[{i}]" for i, c in enumerate(constants)}
    source = []
    for symbol, expr in schedule(list(zip(symbols, made.values(), strict=True)), "u"):
        for read in sorted(expr.free_symbols & inputs.keys(), key=str):
            source.append(f"{read} = {inputs.pop(read)}")
        source.append(f"{symbol} = {PRINT(expr)}")
    source += [f"out[{i}] = {symbol}" for i, symbol in enumerate(symbols)]
    return "\n".join([
        "COMMANDS_CODE = Code(place=\"\", tables=(), width=0, text=\"\"\"\\",
        *source, '""")',
        '_commands: Any = lane_kernel(COMMANDS_CODE, ("x", "out"), LANES)',
        "", "",
        "@njit(**INLINE)",
        "def commands(x, out, start, tables, cells, constants, clamped):",
        '    """Commanded pitch and generator torque in LANES states x, then the rates of the controller\'s states, in out[start:]."""',
        "    _commands(x, out, start, tables, cells, constants, clamped)",
        "",
    ])  # fmt: skip


HEAD = '''"""{doc}

Generated by `python tools/generate_kernel.py` from {source}; do not edit.
"""

from typing import Any

import numpy as np
from fatigue_runner.compiled import INLINE, njit
from fatigue_runner.turbine.lane_code import LANES, Code, lane_kernel

PARAMETERS = {parameters}
TABLES = {tables}
EQUATION_TABLES = {width}
LOADS = {loads}


def constants(parameters):
    """Everything that depends on parameters only. parameters: mapping of PARAMETERS{turned}; returns (n,) for the kernels."""
    p = parameters
'''


def module(variant: Variant) -> str:
    """A generated module: its head, the constants, and the kernels `rhs` and `loads`."""
    layout = variant.layout
    controlled = variant.controller is not None
    moved = eq.accelerations(variant.states, layout.harmonics, controlled)
    sheet = moved.sheet
    load_sheet, loads = eq.load_channels(variant.states, layout.harmonics, controlled)
    out = dict(enumerate(variant.states.symbols(1))) | {
        layout.freedoms + i: a for i, a in enumerate(moved.accelerations)
    }
    load_out = {i: loads[n] for i, n in enumerate(EQUATION_LOADS)}
    if variant.varying_pitch:
        sheet, out = with_varying_pitch(sheet, out)
        load_sheet, load_out = with_varying_pitch(load_sheet, load_out)
    for kernel_sheet in (sheet, load_sheet):
        kernel_sheet.lines[:0] = variant.control_lines()
    out |= variant.control_rates()
    for submodel in variant.submodels:
        out |= {layout.row(name): rate for name, rate in submodel.rates(variant.symbols).items()}
    # both sheets number their constants from k0: give the second its own letter
    rename = {s: sp.Symbol("l" + s.name[1:], real=True) for s in load_sheet.constants}
    load_sheet.lines = [(s, e.xreplace(rename)) for s, e in load_sheet.lines]
    load_out = {n: e.xreplace(rename) for n, e in load_out.items()}
    symbols = [*eq.P.values(), *variant.control_parameters.values(), *sheet.constants, *rename.values()]
    definitions = {
        **sheet.constants,
        **{rename[s]: e.xreplace(rename) for s, e in load_sheet.constants.items()},
    }
    tables = variant.tables[: variant.equation_tables]
    sizes = (
        f"({layout.size}, LANES), wind ({layout.wind_size()}, LANES), control ({len(layout.control)}, LANES)"
    )
    kernels = [
        kernel("rhs", f"State derivative of LANES cases: x, out[start:] in blocks {sizes}.",
               variant, sheet, out, tables, symbols),
        kernel("loads", f"Load channels of LANES states: x {sizes}, out (k, LANES).",
               variant, load_sheet, load_out, variant.tables, symbols),
    ]  # fmt: skip
    head = HEAD.format(
        doc=variant.doc, source=variant.source, parameters=repr(variant.parameters), tables=repr(variant.tables),
        width=variant.equation_tables, loads=repr(EQUATION_LOADS), turned=" at zero pitch" if variant.varying_pitch else "",
    )  # fmt: skip
    lines = [f"    {name} = p[{name!r}]" for name in variant.parameters]
    lines += [f"    {s} = {PRINT(e)}" for s, e in definitions.items()]
    lines += ["    return np.array([", *(f"        {s}," for s in symbols), "    ], dtype=np.float64)"]
    if controlled:
        kernels.append(commands(variant, symbols))
    return head + "\n".join(lines) + "\n\n\n" + "\n\n".join(kernels)


_FOLDER = "fatigue_runner/turbine/derivation"
_STATES = {"t2b1i1cg": eq.T2B1I1CG, "t2b2cg": eq.T2B2CG}


def _variants(family: str) -> dict[str, Variant]:
    """The generated modules of one member of the family, by their names."""
    prefix = "" if family == "t2b1i1cg" else f"{family}_"
    layout = FAMILIES[family]
    equations, pitching = f"{_FOLDER}/equations.py", f"{_FOLDER}/equations.py and pitching.py"
    pitched = layout.extended(control=(PITCH_SIGNAL,))
    made = {
        "kernel": Variant("The lane kernels at a fixed pitch", equations, layout),
        "pitched": Variant(
            "The lane kernels with each lane's pitch [rad] as a control signal",
            pitching,
            pitched,
            varying_pitch=True,
        ),
        "harmonic": Variant(
            "The lane kernels at a fixed pitch, under wind with azimuthal harmonics",
            equations,
            layout.extended(harmonics=True),
        ),
        "pitched_harmonic": Variant(
            "The lane kernels with each lane's pitch [rad] as a control signal, under wind with azimuthal harmonics",
            pitching,
            pitched.extended(harmonics=True),
            varying_pitch=True,
        ),
    }
    for controller in SUBMODELS:
        made[f"controlled_{controller.name}"] = Variant(
            f"The lane kernels with states, pitch and torque of the controller `{controller.name}`, under wind with azimuthal harmonics",
            f"{pitching}, and fatigue_runner/control",
            layout.extended(first_order=controller.states, harmonics=True),
            varying_pitch=True,
            controller=controller,
        )
    what = "." if not prefix else ", each blade with an edge mode of its own."
    return {
        f"{prefix}{name}": replace(v, doc=v.doc + what, states=_STATES[family]) for name, v in made.items()
    }


VARIANTS = {name: variant for family in FAMILIES for name, variant in _variants(family).items()}
