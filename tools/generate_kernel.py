"""Print the equations of motion as the lane kernels `fatigue_runner/turbine/generated/kernel.py` and `pitched.py`.

python tools/generate_kernel.py            write it
python tools/generate_kernel.py --check    exit 1 if the committed file is not what the equations give
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import sympy as sp
from sympy.printing.pycode import PythonCodePrinter

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from fatigue_runner.channels import LOAD_NAMES  # noqa: E402
from fatigue_runner.turbine import equations as eq  # noqa: E402
from fatigue_runner.turbine.pitching import PITCH, with_varying_pitch  # noqa: E402

TARGET = ROOT / "fatigue_runner" / "turbine" / "generated" / "kernel.py"
LANES = 16


class Printer(PythonCodePrinter):  # type: ignore[misc]  # sympy has no hints
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
    name: str, doc: str, sheet: eq.Sheet, outputs: dict[int, sp.Expr], extra_inputs, tables, constants, pitch
) -> str:
    """One lane kernel: its assignments in order, each value read from an array just before its first use."""
    wanted: set[sp.Symbol] = set().union(*(e.free_symbols for e in outputs.values()))
    lines = schedule(used_only(sheet.lines, wanted | {eq.TIP_SPEED_RATIO}), "u")
    inputs = {s: f"x[{i}]" for i, s in enumerate(eq.STATE)} | {s: f"wind[{i}]" for i, s in enumerate(eq.WIND)}
    for array, symbols in extra_inputs.items():
        inputs |= {s: f"{array}[{i}]" for i, s in enumerate(symbols)}
    inputs[eq.HALF_SQRT3] = repr(3**0.5 / 2)
    inputs |= {c: f"constants[{i}]" for i, c in enumerate(constants)}
    phi = eq.STATE[6]
    source = [f"{phi} = {inputs.pop(phi)}"]
    if pitch:
        source.append(f"{pitch} = wind[{len(eq.WIND)}]")
    source += SINE_COSINE.format(sine=horner(1, 9), cosine=horner(0, 10)).rstrip("\n").split("\n")

    def write(target: str, expr: sp.Expr) -> None:
        for symbol in sorted(expr.free_symbols & inputs.keys(), key=str):
            source.append(f"{symbol} = {inputs.pop(symbol)}")
        source.append(f"{target} = {PRINT(expr)}")

    for symbol, expr in lines:
        write(str(symbol), expr)
    for i, expr in outputs.items():
        write(f"out[{i}]", expr)
    upper, width = f"{name.upper()}_CODE", len(tables)
    arguments = "".join(f"{a}, " for a in ("x", "wind", *extra_inputs, "out"))
    arrays = ", ".join(repr(a) for a in ("x", "wind", *extra_inputs, "out"))
    places = f"place={str(eq.TIP_SPEED_RATIO)!r}" + (f", second={pitch!r}" if pitch else "")
    return "\n".join([
        f"{upper} = Code({places}, tables=TABLES[:{width}], width={-(-width // 8) * 8}, text=\"\"\"\\",
        *source, '""")',
        f"_{name}: Any = lane_kernel({upper}, ({arrays}), LANES)",
        "", "",
        "@njit(**INLINE)",
        f"def {name}({arguments}start, tables, cells, constants, scratch, row, clamped):",
        f'    """{doc}"""',
        f"    _{name}({arguments}start, tables, cells, constants, clamped)",
        "",
    ])  # fmt: skip


PRELUDE = '''"""{doc}

Generated by `python tools/generate_kernel.py` from fatigue_runner/turbine/{source}; do not edit.
"""

from typing import Any

import numpy as np
from fatigue_runner.compiled import INLINE, njit
'''

KERNEL = '''from fatigue_runner.turbine.lane_code import Code, lane_kernel

LANES = {lanes}

PARAMETERS = {parameters}
TABLES = {tables}
EQUATION_TABLES = {width}
LOADS = {loads}


def constants(parameters):
    """Everything that depends on parameters only. parameters: mapping of PARAMETERS; returns (n,) for the kernels."""
    p = parameters
'''

PITCHED = '''from fatigue_runner.turbine.generated.kernel import LANES, TABLES
from fatigue_runner.turbine.lane_code import Code, lane_kernel


def constants(parameters):
    """Everything that depends on parameters only. parameters: kernel.PARAMETERS at zero pitch; returns (n,) for the kernels."""
    p = parameters
'''


def module(head: str, sheets: dict[str, tuple[eq.Sheet, dict[int, sp.Expr]]], pitch: str) -> str:
    """A generated module: its head, the constants, and the kernels `rhs` and `loads`."""
    sheet, out = sheets["rhs"]
    load_sheet, load_out = sheets["loads"]
    # both sheets number their constants from k0: give the second its own letter
    rename = {s: sp.Symbol("l" + s.name[1:], real=True) for s in load_sheet.constants}
    load_sheet.lines = [(s, e.xreplace(rename)) for s, e in load_sheet.lines]
    load_out = {n: e.xreplace(rename) for n, e in load_out.items()}
    symbols = [*eq.P.values(), *sheet.constants, *rename.values()]
    definitions = {
        **sheet.constants,
        **{rename[s]: e.xreplace(rename) for s, e in load_sheet.constants.items()},
    }
    tables = eq.TABLES[: eq.TABLES_OF_THE_EQUATIONS]
    derivative = [sp.Symbol(f"v{i}_unused") for i in range(8)] + list(eq.ACCELERATION)
    rows = 4 if pitch else 3
    kernels = [
        kernel("rhs", f"State derivative of LANES cases: x, out[start:] in blocks (16, LANES), wind ({rows}, LANES).",
               sheet, out, {}, tables, symbols, pitch),
        kernel("loads", f"Load channels of LANES states: x, derivative (16, LANES), wind ({rows}, LANES), out (k, LANES).",
               load_sheet, load_out, {"derivative": derivative}, eq.TABLES, symbols, pitch),
    ]  # fmt: skip
    lines = [f"    {name} = p[{name!r}]" for name in eq.PARAMETERS]
    lines += [f"    {s} = {PRINT(e)}" for s, e in definitions.items()]
    lines += ["    return np.array([", *(f"        {s}," for s in symbols), "    ], dtype=np.float64)"]
    return head + "\n".join(lines) + "\n\n\n" + "\n\n".join(kernels)


def generate() -> dict[Path, str]:
    """The generated modules by their paths."""
    sheet, acc = eq.accelerations()
    load_sheet, loads = eq.load_channels()
    out = dict(enumerate(eq.STATE[8:])) | {8 + i: a for i, a in enumerate(acc)}
    load_out = {i: loads[n] for i, n in enumerate(LOAD_NAMES)}
    kernels = {"rhs": (sheet, out), "loads": (load_sheet, load_out)}
    pitched = {name: with_varying_pitch(*pair) for name, pair in kernels.items()}
    fixed_head = PRELUDE.format(doc="The lane kernels at a fixed pitch.", source="equations.py") + KERNEL.format(
        lanes=LANES, parameters=repr(tuple(eq.PARAMETERS)), tables=repr(eq.TABLES),
        width=eq.TABLES_OF_THE_EQUATIONS, loads=repr(LOAD_NAMES),
    )  # fmt: skip
    doc = "The lane kernels with each lane's pitch [rad] as a fourth signal."
    pitched_head = PRELUDE.format(doc=doc, source="equations.py and pitching.py") + PITCHED
    return {
        TARGET: module(fixed_head, kernels, ""),
        TARGET.with_name("pitched.py"): module(pitched_head, pitched, str(PITCH)),
    }


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--check", action="store_true", help="compare, write nothing")
    check = parser.parse_args().check
    stale = 0
    for path, text in generate().items():
        if not check:
            path.write_text(text, encoding="utf-8")
            print(f"wrote {path.relative_to(ROOT)}: {len(text.splitlines())} lines")
        elif path.exists() and path.read_text(encoding="utf-8") == text:
            print(f"generated {path.name} is current")
        else:
            print(f"generated {path.name} is stale: run python tools/generate_kernel.py")
            stale = 1
    return stale


if __name__ == "__main__":
    raise SystemExit(main())
