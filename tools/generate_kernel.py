"""Print the equations of motion as the lane kernel `fatigue_runner/turbine/generated/kernel.py`.

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

TARGET = ROOT / "fatigue_runner" / "turbine" / "generated" / "kernel.py"
LANES = 16


class Printer(PythonCodePrinter):
    """Python source that numba compiles well: products instead of powers."""

    def _print_Pow(self, expr, rational=False):
        base, exponent = expr.as_base_exp()
        if exponent.is_Integer and 1 < abs(exponent) <= 4:
            product = "*".join([self.parenthesize(base, 50)] * abs(int(exponent)))
            return f"({product})" if exponent > 0 else f"(1.0/({product}))"
        if exponent == -1:
            return f"(1.0/{self.parenthesize(base, 50)})"
        if exponent == sp.Rational(1, 2) and not base.is_number:
            return f"math.sqrt({self._print(base)})"
        return repr(float(expr))

    def _print_Rational(self, expr):
        return repr(float(expr))

    def _print_Integer(self, expr):
        return f"{int(expr)}.0"


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


SINE_COSINE = """\
            # sin and cos: remove whole turns, evaluate at a quarter of the rest, double the angle twice
            turns = math.floor(phi * 0.15915494309189535 + 0.5)
            quarter = (phi - turns * 6.283185307179586 - turns * 2.4492935982947064e-16) * 0.25
            square = quarter * quarter
            sine = quarter * ({sine})
            cosine = {cosine}
            double = 2.0 * sine * cosine
            cosine = 1.0 - 2.0 * sine * sine
            sin_phi = 2.0 * double * cosine
            cos_phi = 1.0 - 2.0 * double * double
"""

LOOKUP = """\
        # All tables of one cell lie side by side, so one look-up is SIMD across tables. The indices are unsigned: with signed
        # ones numba's wrap-around for negative indices keeps LLVM from vectorising (measured: 52 instead of 5 ns a look-up).
        for j in range(LANES):
            place = (scratch[j] - tables[0]) * tables[1]
            # the integer is clamped as well: a diverged lane's NaN must not become a wild index
            cell = min(max(int(min(max(place, -1.0), 1.0e6)), 0), cells - 1)
            inside = min(max(place - cell, 0.0), 1.0)
            clamped[j] += 1 if place != cell + inside else 0
            base = np.uint64(8 + cell * {stride})
            to = np.uint64(j * {width})
            for t in range(np.uint64({width})):
                row[to + t] = (
                    (tables[base + np.uint64({w3}) + t] * inside + tables[base + np.uint64({w2}) + t]) * inside
                    + tables[base + np.uint64({width}) + t]
                ) * inside + tables[base + t]
"""


def horner(first: int, terms: int) -> str:
    coefficients = [float(sp.Rational((-1) ** k, sp.factorial(2 * k + first))) for k in range(terms)]
    text = repr(coefficients[-1])
    for c in reversed(coefficients[:-1]):
        text = f"({c!r} + square * {text})"
    return text


def body(lines, indent: str) -> list[str]:
    return [f"{indent}{symbol} = {PRINT(expr)}" for symbol, expr in lines]


def kernel(
    name: str, doc: str, sheet: eq.Sheet, outputs: dict[int, sp.Expr], extra_inputs, tables, constants
) -> str:
    """One lane kernel: motion and tip-speed ratio, table look-up, the rest."""
    wanted: set[sp.Symbol] = set().union(*(e.free_symbols for e in outputs.values()))
    lines = schedule(used_only(sheet.lines, wanted | {eq.TIP_SPEED_RATIO}), "u")
    split = [s for s, _ in lines].index(eq.TIP_SPEED_RATIO)
    first, second = lines[: split + 1], lines[split + 1 :]
    later = set().union(*(e.free_symbols for _, e in second), *(e.free_symbols for e in outputs.values()))
    trig = {eq.SINE, eq.COSINE}
    carried = sorted((({s for s, _ in first} | trig) & later) - {eq.TIP_SPEED_RATIO}, key=str)
    width = len(tables)
    carry_row = 1
    needed_constants = [
        c
        for c in constants
        if c in set().union(*(e.free_symbols for _, e in lines), *(e.free_symbols for e in outputs.values()))
    ]
    places = {c: i for i, c in enumerate(constants)}
    source = [
        "@njit(**FAST)",
        f"def {name}(x, wind, {''.join(f'{a}, ' for a in extra_inputs)}out, start, tables, cells, constants, "
        "scratch, row, clamped):",
        f'        """{doc}"""'.replace("        ", "    ", 1),
    ]
    source += [f"    {c} = constants[{places[c]}]" for c in needed_constants]

    def loads(used):
        rows = [f"            {s} = x[{i} * LANES + j]" for i, s in enumerate(eq.STATE) if s in used]
        rows += [f"            {s} = wind[{i} * LANES + j]" for i, s in enumerate(eq.WIND) if s in used]
        for array, symbols in extra_inputs.items():
            rows += [
                f"            {s} = {array}[{i} * LANES + j]" for i, s in enumerate(symbols) if s in used
            ]
        return rows

    used_first = set().union(*(e.free_symbols for _, e in first)) | {eq.STATE[6]}
    source += ["    for _once in range(1):", "        for j in range(LANES):", *loads(used_first)]
    source += SINE_COSINE.format(sine=horner(1, 9), cosine=horner(0, 10)).rstrip("\n").split("\n")
    source += body(first, " " * 12)
    source += [f"            scratch[j] = {eq.TIP_SPEED_RATIO}"]
    source += [f"            scratch[{carry_row + i} * LANES + j] = {s}" for i, s in enumerate(carried)]
    source += (
        LOOKUP.format(width=width, stride=4 * width, w2=2 * width, w3=3 * width).rstrip("\n").split("\n")
    )
    source += ["        for j in range(LANES):", *loads(later)]
    source += [
        f"            {eq.TABLE[t]} = row[j * {width} + {i}]"
        for i, t in enumerate(tables)
        if eq.TABLE[t] in later
    ]
    source += [f"            {s} = scratch[{carry_row + i} * LANES + j]" for i, s in enumerate(carried)]
    source += body(second, " " * 12)
    source += [f"            out[start + {i} * LANES + j] = {PRINT(e)}" for i, e in outputs.items()]
    text = "\n".join(source)
    # the loop that runs once only served the templates' indentation
    head, tail = text.split("    for _once in range(1):\n")
    tail = "\n".join(line[4:] for line in tail.split("\n"))
    ROWS[name] = carry_row + len(carried)
    return head + tail + "\n"


ROWS: dict[str, int] = {}

HEADER = '''"""Generated by `python tools/generate_kernel.py` from fatigue_runner/turbine/equations.py; do not edit."""

import math

import numpy as np
from fatigue_runner.compiled import FAST, njit

LANES = {lanes}

PARAMETERS = {parameters}
TABLES = {tables}
EQUATION_TABLES = {width}
LOADS = {loads}


def constants(parameters):
    """Everything that depends on parameters only. parameters: mapping of PARAMETERS; returns (n,) for the kernels."""
    p = parameters
'''


def generate() -> str:
    """The whole generated module."""
    sheet, acc = eq.accelerations()
    load_sheet, loads = eq.load_channels()
    # both sheets number their constants from k0: give the second its own letter
    rename = {s: sp.Symbol("l" + s.name[1:], real=True) for s in load_sheet.constants}
    load_sheet.lines = [(s, e.xreplace(rename)) for s, e in load_sheet.lines]
    loads = {n: e.xreplace(rename) for n, e in loads.items()}
    symbols = [*eq.P.values(), *sheet.constants, *rename.values()]
    definitions = {**sheet.constants, **{rename[s]: e for s, e in load_sheet.constants.items()}}
    out = dict(enumerate(eq.STATE[8:])) | {8 + i: a for i, a in enumerate(acc)}
    load_out = {i: loads[n] for i, n in enumerate(LOAD_NAMES)}
    tables = eq.TABLES[: eq.TABLES_OF_THE_EQUATIONS]
    derivative = [sp.Symbol(f"v{i}_unused") for i in range(8)] + list(eq.ACCELERATION)
    kernels = [
        kernel("rhs", "State derivative of LANES cases: x, out[start:] in blocks (16, LANES), wind (3, LANES).",
               sheet, out, {}, tables, symbols),
        kernel("loads", "Load channels of LANES states: x, derivative (16, LANES), wind (3, LANES), out (k, LANES).",
               load_sheet, load_out, {"derivative": derivative}, eq.TABLES, symbols),
    ]  # fmt: skip
    lines = [f"    {name} = p[{name!r}]" for name in eq.PARAMETERS]
    lines += [f"    {s} = {PRINT(e)}" for s, e in definitions.items()]
    lines += ["    return np.array([", *(f"        {s}," for s in symbols), "    ], dtype=np.float64)"]
    header = HEADER.format(lanes=LANES, parameters=repr(tuple(eq.PARAMETERS)), tables=repr(eq.TABLES),
                           width=eq.TABLES_OF_THE_EQUATIONS, loads=repr(LOAD_NAMES))  # fmt: skip
    rows = "\n".join(f"{name.upper()}_ROWS = {n}" for name, n in ROWS.items())
    return header + "\n".join(lines) + "\n\n\n" + rows + "\n\n\n" + "\n\n".join(kernels)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--check", action="store_true", help="compare, write nothing")
    check = parser.parse_args().check
    text = generate()
    if check:
        current = TARGET.exists() and TARGET.read_text(encoding="utf-8") == text
        print(
            "generated kernel is current"
            if current
            else "generated kernel is stale: run python tools/generate_kernel.py"
        )
        return 0 if current else 1
    TARGET.write_text(text, encoding="utf-8")
    print(f"wrote {TARGET.relative_to(ROOT)}: {len(text.splitlines())} lines")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
