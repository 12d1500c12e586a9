"""Straight-line code over lanes, written in LLVM's vector types.

A generated kernel is a text of assignments (`name = expression`, `out[3] = expression`) that hold for every lane alone. `lane_kernel`
turns it into one block of vector instructions. LLVM's own vectoriser needs a check for overlap of every pair of arrays, keeps a
scalar copy of the code, broadcasts all constants in front of the loop, where they fill the stack, and gathers the tables' values one
by one: together a quarter of the time (measured). Here a constant is broadcast where it is used and tables are transposed in registers.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from fatigue_runner.compiled import FAST

LANES = 16  # cases that advance together
VECTOR = 8  # doubles; LLVM splits a vector where the machine's are shorter
HEADER = 8  # of the tables: first value, cells per unit, padding to a cache line

_FLAGS = tuple(sorted(FAST["fastmath"]))
_INDEX = ir.IntType(32)
_WORD = ir.IntType(64)
_DOUBLE = ir.DoubleType()
_OPERATORS = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}


@dataclass(frozen=True)
class Code:
    """text: the assignments. The name `place` is looked up in cubic cells and gives `tables`, the names of columns 0, 1, ...

    With `second`, the name of another place that is assigned before, the cells are bicubic. The statement `mean, cos, sin =
    harmonics(array, row, cosine, sine)` folds azimuthal harmonics c_1, s_1, c_2, ... in the array's rows from `row` on, a multiple of
    three pairs, into their sum at three blades 120 degrees apart: mean + cos cos(alpha) + sin sin(alpha).
    """

    text: str
    place: str
    tables: Sequence[str]
    width: int  # columns of a cell, a multiple of VECTOR
    second: str = ""


def lane_kernel(code: Code, arrays: Sequence[str], lanes: int) -> Callable[..., Any]:
    """An intrinsic (arrays ..., start, tables, cells, constants, clamped) that runs `code` for `lanes` lanes.

    arrays: names of the flat [n][lanes] arrays in the text, the last one written from `start` on; tables as `AeroTables.cells`;
    clamped (lanes,) counts look-ups outside the tables.
    """
    count = len(arrays)
    flat = types.Array(types.float64, 1, "C")

    def typed(typing_context, *arguments):
        counters = types.Array(types.int64, 1, "C")
        signature = types.void(*[flat] * count, types.int64, flat, types.int64, flat, counters)

        def codegen(context, builder, sig, args):
            found = [
                context.make_array(sig.args[i])(context, builder, args[i])
                if i not in (count, count + 2)
                else args[i]
                for i in range(count + 5)
            ]
            data = [value if i in (count, count + 2) else value.data for i, value in enumerate(found)]
            names = [*arrays, "start", "tables", "cells", "constants", "clamped"]
            if "harmonics(" in code.text:
                data.append(found[arrays.index("wind")].nitems)
                names.append("wind_size")
            # a function of its own that takes nothing but pointers: numba's pass seven words an array
            kind = ir.FunctionType(ir.VoidType(), [value.type for value in data])
            function = ir.Function(builder.module, kind, builder.module.get_unique_name("lane_kernel"))
            function.linkage = "internal"
            function.attributes.add("noinline")
            inside = ir.IRBuilder(function.append_basic_block())
            _Emitter(inside, code, dict(zip(names, function.args, strict=True)), arrays[-1], lanes).run()
            inside.ret_void()
            builder.call(function, data)
            return context.get_dummy_value()

        return signature, codegen

    parameters = ", ".join(f"{a}_" for a in (*arrays, "start", "tables", "cells", "constants", "clamped"))
    space: dict[str, Any] = {"typed": typed}
    exec(f"def kernel(typing_context, {parameters}):\n    return typed(typing_context, {parameters})", space)
    return intrinsic(space["kernel"])


def _number(node: ast.expr) -> float:
    assert isinstance(node, ast.Constant) and isinstance(node.value, int | float)
    return node.value


class _Emitter:
    """Writes the code for one vector of lanes, in a loop over the vectors.

    Two vectors in turns are faster alone (22 instead of 31 ns a lane) and slower in a time step: their 35 kB of instructions fill the
    first-level cache and push out the rest of the step (measured: 36 instead of 34 ns an evaluation of RK4, everything included).
    """

    def __init__(self, builder: Any, code: Code, data: Mapping[str, Any], written: str, lanes: int) -> None:
        self.builder, self.code, self.data, self.written, self.lanes = builder, code, data, written, lanes
        self.size = VECTOR if lanes % VECTOR == 0 else 1
        self.vector = ir.VectorType(_DOUBLE, self.size)
        self.column = {f"c_{name}": i for i, name in enumerate(code.tables)}
        self.lane: Any = None  # first lane of the current vector
        self.values: dict[str, Any] = {}
        self.cells: list[tuple[Any, list[Any]]] = []

    def run(self) -> None:
        statements = ast.parse(self.code.text).body
        with cgutils.for_range(self.builder, _WORD(self.lanes // self.size)) as loop:
            self.lane = self.builder.mul(loop.index, _WORD(self.size))
            for statement in statements:
                assert isinstance(statement, ast.Assign)
                target = statement.targets[0]
                if isinstance(target, ast.Tuple):
                    self.fold(target, statement.value)
                else:
                    self.assign(target, self.expression(statement.value))

    def assign(self, target: ast.expr, value: Any) -> None:
        if isinstance(target, ast.Name):
            self.values[target.id] = value
            if target.id == self.code.place:
                self.find_cells(value)
            return
        assert isinstance(target, ast.Subscript)
        self.store(value, self.address(target))

    def expression(self, node: ast.expr) -> Any:
        b = self.builder
        if isinstance(node, ast.BinOp):
            left, right = self.expression(node.left), self.expression(node.right)
            return getattr(b, _OPERATORS[type(node.op)])(left, right, flags=_FLAGS)
        if isinstance(node, ast.UnaryOp):
            if isinstance(node.operand, ast.Constant):
                return self.number(-_number(node.operand))
            return b.fneg(self.expression(node.operand), flags=_FLAGS)
        if isinstance(node, ast.Constant):
            return self.number(_number(node))
        if isinstance(node, ast.Name):
            if node.id not in self.values:
                self.look_up(self.column[node.id] // VECTOR)
            return self.values[node.id]
        if isinstance(node, ast.Call):
            assert isinstance(node.func, ast.Name)
            return self.call(f"llvm.{node.func.id}", self.expression(node.args[0]))
        assert isinstance(node, ast.Subscript)
        if isinstance(node.value, ast.Name) and node.value.id == "constants":
            place = b.gep(self.data["constants"], [_WORD(int(_number(node.slice)))])
            return self.splat(b.load(place), self.size)
        return self.load(self.address(node), self.vector)

    # --- azimuthal harmonics ---

    def fold(self, target: ast.Tuple, call: ast.expr) -> None:
        """`mean, cos, sin = harmonics(array, row, cosine, sine)`: see `Code`.

        At the azimuth psi + alpha, c_m cos m(psi + alpha) + s_m sin m(psi + alpha) = a cos(m alpha) + b sin(m alpha) with
        a = c_m cos(m psi) + s_m sin(m psi), b = s_m cos(m psi) - c_m sin(m psi). At three blades cos(m alpha) is 1, cos(alpha),
        cos(alpha) and sin(m alpha) is 0, sin(alpha), -sin(alpha) for m = 3k, 3k + 1, 3k + 2.
        """
        assert isinstance(call, ast.Call) and all(isinstance(name, ast.Name) for name in target.elts)
        b, array = self.builder, call.args[0]
        assert isinstance(array, ast.Name)
        first = int(_number(call.args[1]))
        cosine, sine = (self.expression(a) for a in call.args[2:])
        slots = {name: cgutils.alloca_once(b, self.vector) for name in ("c", "s", "mean", "cos", "sin")}
        for name in ("mean", "cos", "sin"):
            b.store(self.number(0.0), slots[name])
        b.store(self.number(1.0), slots["c"])
        b.store(self.number(0.0), slots["s"])
        rows = b.sub(self.data[f"{array.id}_size"], _WORD(first * self.lanes))
        with cgutils.for_range(b, b.udiv(rows, _WORD(6 * self.lanes))) as loop:
            place = b.add(self.lane, b.mul(loop.index, _WORD(6 * self.lanes)))
            for m in (1, 2, 3):
                c, s = b.load(slots["c"]), b.load(slots["s"])
                turned = self.sum_of((c, cosine), (s, sine), minus=True), self.sum_of((s, cosine), (c, sine))
                b.store(turned[0], slots["c"])
                b.store(turned[1], slots["s"])
                pair = [
                    self.load(b.gep(self.data[array.id], [b.add(place, _WORD((first + 2 * m - 2 + i) * self.lanes))]), self.vector)
                    for i in (0, 1)
                ]  # fmt: skip
                along = self.sum_of((pair[0], turned[0]), (pair[1], turned[1]))
                self.add_to(slots["mean" if m == 3 else "cos"], along)
                if m < 3:
                    across = self.sum_of((pair[1], turned[0]), (pair[0], turned[1]), minus=True)
                    self.add_to(slots["sin"], across, minus=m == 2)
        for element, slot in zip(target.elts, ("mean", "cos", "sin"), strict=True):
            assert isinstance(element, ast.Name)
            self.values[element.id] = b.load(slots[slot])

    def sum_of(self, one: tuple[Any, Any], other: tuple[Any, Any], minus: bool = False) -> Any:
        """Product + product, or their difference."""
        b = self.builder
        first, second = (b.fmul(*pair, flags=_FLAGS) for pair in (one, other))
        return (b.fsub if minus else b.fadd)(first, second, flags=_FLAGS)

    def add_to(self, slot: Any, value: Any, minus: bool = False) -> None:
        b = self.builder
        b.store((b.fsub if minus else b.fadd)(b.load(slot), value, flags=_FLAGS), slot)

    # --- values ---

    def number(self, value: float) -> Any:
        return ir.Constant(self.vector, [float(value)] * self.size)

    def splat(self, scalar: Any, size: int) -> Any:
        kind = ir.VectorType(scalar.type, size)
        single = self.builder.insert_element(ir.Constant(kind, ir.Undefined), scalar, _INDEX(0))
        mask = ir.Constant(ir.VectorType(_INDEX, size), [0] * size)
        return self.builder.shuffle_vector(single, ir.Constant(kind, ir.Undefined), mask)

    def call(self, name: str, value: Any) -> Any:
        kind = ir.FunctionType(self.vector, [self.vector])
        function = cgutils.get_or_insert_function(self.builder.module, kind, f"{name}.v{self.size}f64")
        return self.builder.call(function, [value])

    # --- memory ---

    def address(self, node: ast.Subscript) -> Any:
        assert isinstance(node.value, ast.Name)
        place = self.builder.add(self.lane, _WORD(int(_number(node.slice)) * self.lanes))
        if node.value.id == self.written:
            place = self.builder.add(place, self.data["start"])
        return self.builder.gep(self.data[node.value.id], [place])

    def load(self, pointer: Any, kind: ir.Type) -> Any:
        value = self.builder.load(self.builder.bitcast(pointer, kind.as_pointer()))
        value.align = 8
        return value

    def store(self, value: Any, pointer: Any) -> None:
        self.builder.store(value, self.builder.bitcast(pointer, value.type.as_pointer())).align = 8

    # --- tables ---

    def find_cells(self, value: Any) -> None:
        """Cell and place within it of every lane; what lies outside is clamped and counted."""
        b, tables = self.builder, self.data["tables"]
        words = ir.VectorType(_WORD, self.size)
        cell, inside, outside = self.find(value, 0, self.data["cells"])
        places = [inside]
        if self.code.second:
            count = b.fptosi(b.load(b.gep(tables, [_WORD(4)])), _WORD)
            other, beside, beyond = self.find(self.values[self.code.second], 2, count)
            cell = b.add(b.mul(other, self.splat(self.data["cells"], self.size)), cell)
            places.append(beside)
            outside = b.or_(outside, beyond)
        counter = b.gep(self.data["clamped"], [self.lane])
        self.store(b.add(self.load(counter, words), b.zext(outside, words)), counter)
        terms = 4 ** len(places)
        self.cells[:] = [
            (
                b.mul(b.extract_element(cell, _INDEX(j)), _WORD(terms * self.code.width)),
                [self.splat(b.extract_element(x, _INDEX(j)), VECTOR) for x in places],
            )
            for j in range(self.size)
        ]

    def find(self, value: Any, header: int, count: Any) -> tuple[Any, Any, Any]:
        """Cell, place in it (0 to 1) and whether `value` lies outside, on the grid that starts at tables[header]."""
        b, tables = self.builder, self.data["tables"]
        first, per_unit = (self.splat(b.load(b.gep(tables, [_WORD(header + i)])), self.size) for i in (0, 1))
        place = b.fmul(b.fsub(value, first), per_unit)
        # a diverged lane's NaN must not become a wild index: comparisons, numbers and integers are all clamped
        bounded = self.clamp(place, -1.0, 1.0e6)
        words = ir.VectorType(_WORD, self.size)
        cell = b.fptosi(bounded, words)
        last = self.splat(b.sub(count, _WORD(1)), self.size)
        zero = ir.Constant(words, [0] * self.size)
        cell = b.select(b.icmp_signed("<", cell, last), cell, last)
        cell = b.select(b.icmp_signed(">", cell, zero), cell, zero)
        number = b.sitofp(cell, self.vector)
        inside = self.clamp(b.fsub(place, number), 0.0, 1.0)
        return cell, inside, b.fcmp_unordered("!=", place, b.fadd(number, inside))

    def clamp(self, value: Any, low: float, high: float) -> Any:
        b, bottom, top = self.builder, self.number(low), self.number(high)
        value = b.select(b.fcmp_ordered("<", value, top), value, top)
        return b.select(b.fcmp_ordered(">", value, bottom), value, bottom)

    def look_up(self, block: int) -> None:
        """The cubics of VECTOR tables: for each lane one vector across the tables, then transposed."""
        b, across = self.builder, ir.VectorType(_DOUBLE, VECTOR)

        def polynomial(base: Any, places: list[Any], first: int) -> Any:
            """Horner's way; of two variables the last one's powers are the outer ones."""
            if not places:
                return self.load(b.gep(self.data["tables"], [b.add(base, _WORD(first))]), across)
            inner = 4 ** (len(places) - 1) * self.code.width
            total = None
            for power in (3, 2, 1, 0):
                term = polynomial(base, places[:-1], first + power * inner)
                total = (
                    term
                    if total is None
                    else b.fadd(b.fmul(total, places[-1], flags=_FLAGS), term, flags=_FLAGS)
                )
            return total

        rows = [polynomial(base, places, HEADER + block * VECTOR) for base, places in self.cells]
        if self.size == 1:
            row = rows[0]
            columns = [self.splat(b.extract_element(row, _INDEX(i)), 1) for i in range(VECTOR)]
        else:
            columns = transposed(b, rows)
        for name, i in self.column.items():
            if i // VECTOR == block:
                self.values[name] = columns[i % VECTOR]


def transposed(builder: Any, rows: list[Any]) -> list[Any]:
    """VECTOR rows -> VECTOR columns by butterflies: at each distance the halves of two rows change places."""
    distance = 1
    while distance < VECTOR:
        low = [i if not i & distance else VECTOR + i - distance for i in range(VECTOR)]
        high = [i + distance if not i & distance else VECTOR + i for i in range(VECTOR)]
        masks = [ir.Constant(ir.VectorType(_INDEX, VECTOR), m) for m in (low, high)]
        out = list(rows)
        for i in range(VECTOR):
            if not i & distance:
                pair = rows[i], rows[i + distance]
                out[i], out[i + distance] = (builder.shuffle_vector(*pair, mask) for mask in masks)
        rows, distance = out, 2 * distance
    return rows
