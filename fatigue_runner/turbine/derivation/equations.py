"""Equations of motion of the turbines T2B1i1cG and T2B2cG, derived symbolically; `tools/generate_kernel.py` prints them as code.

Degrees of freedom q: tower fore-aft a, tower side-side s, flap of blades 1-3 f1 f2 f3, edge (one collective e, or e1 e2 e3 of each
blade: `States`), rotor azimuth, generator azimuth (high-speed side). Method: D'Alembert's principle on the positions of all mass elements,
    sum over bodies of  integral (dp/dq_j) . (p'' - g) dm  =  Q_j ,
with the rotor as one flexible body in the rotating hub frame F (floating-frame formulation, e.g. Shabana, Dynamics of
Multibody Systems, ch. 5). Nothing is linearised, except that products of the blades' axial foreshortening with another
deflection (third order) are dropped; they are dropped in the position integrals, hence from kinetic energy and forces alike,
and energy is conserved to rounding.

Frames. I: inertial, x downwind, z up, at the tower base. N: nacelle = Ry(slope_fa a) Rx(-slope_ss s). S: shaft = N tilted.
F: S turned about its x axis by the azimuth. Blade i: F turned by 120 (i-1) degrees about x ("az frame"), then coned about y:
axes e1 out of plane (downwind), e2 = e3 x e1 (towards the trailing edge), e3 along the span, as OpenFAST's coned system.

Blade point at distance r from the apex: u = (phi_x f + psi_x e) e1 + (phi_y f + psi_y e) e2 + (r - w) e3 with the foreshortening
w = (S_ff f^2 + 2 S_fe f e + S_ee e^2)/2. Only integrals of products of (1, r, phi, psi, S) over the mass enter: symbols below.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import sympy as sp

from fatigue_runner.turbine.parameter_names import PARAMETERS

P = {name: sp.Symbol(name, real=True) for name in PARAMETERS}


@dataclass(frozen=True)
class States:
    """Symbols of the coordinates, their rates (`..d`) and accelerations (`..dd`), by the edge coordinates: one, or one of each blade."""

    edges: tuple[str, ...]

    @property
    def coordinates(self) -> tuple[str, ...]:
        return ("a", "s", "f1", "f2", "f3", *self.edges, "phi", "gen")

    def symbols(self, order: int) -> tuple[sp.Symbol, ...]:
        """The coordinates' derivatives of an order."""
        return tuple(sp.Symbol(name + "d" * order, real=True) for name in self.coordinates)

    @property
    def all(self) -> tuple[sp.Symbol, ...]:
        """Coordinates, then rates, as in the layout."""
        return (*self.symbols(0), *self.symbols(1))

    def of(self, name: str, order: int = 0) -> sp.Symbol:
        return self.symbols(order)[self.coordinates.index(name)]

    def flap(self, number: int, order: int = 0) -> sp.Symbol:
        return self.of(f"f{number}", order)

    def edge(self, number: int, order: int = 0) -> sp.Symbol:
        """Of blade 1, 2 or 3."""
        return self.of(self.edges[number - 1 if self.own_edges else 0], order)

    @property
    def own_edges(self) -> bool:
        """Whether each blade has an edge coordinate of its own."""
        return len(self.edges) > 1


T2B1I1CG, T2B2CG = States(("e",)), States(("e1", "e2", "e3"))
WIND = sp.symbols("v kv kh", real=True)
ACROSS = sp.symbols("v_lateral v_vertical", real=True)  # of winds that may have it: see `inflow`
# what the wind's azimuthal harmonics add at the blades, uniform along them: mean + cos cos(alpha_i) + sin sin(alpha_i)
FOLDED = sp.symbols("w_fold_mean w_fold_cos w_fold_sin", real=True)
SINE, COSINE = sp.symbols("sin_phi cos_phi", real=True)

# Coefficients of one blade's aerodynamic loads; the equations read the first 32 (whole vectors of 8), the load channels all.
TABLES = (
    "thrust", "thrust_kappa", "thrust_y", "thrust_flap", "thrust_edge",
    "flap", "flap_kappa", "flap_y", "flap_flap", "flap_edge",
    "torque", "torque_kappa", "torque_y", "torque_flap", "torque_edge",
    "edge", "edge_flap", "edge_edge",
    "tangential_kappa", "tangential_y", "tangential_flap",
    "bending_kappa", "bending_y", "bending_flap",
    "thrust_skew", "flap_skew", "torque_skew", "tangential_skew", "bending_skew",
    "tangential", "tangential_edge", "bending", "bending_edge", "edge_kappa", "edge_y", "edge_skew",
)  # fmt: skip
TABLES_OF_THE_EQUATIONS = 32
# the loads' derivatives by a wind that is the same all along the blade, for winds with azimuthal harmonics
UNIFORM_TABLES = ("thrust_w", "flap_w", "torque_w", "edge_w", "tangential_w", "bending_w")
_OWN = 29  # tables without which the equations do not do
HARMONIC_TABLES = (*TABLES[:_OWN], *UNIFORM_TABLES, *TABLES[_OWN:])
HARMONIC_TABLES_OF_THE_EQUATIONS = _OWN + len(UNIFORM_TABLES)
_LOADS_ONLY = ("tangential", "bending")  # what blades with an edge of their own read for their loads only


def tables(states: States, harmonics: bool) -> tuple[tuple[str, ...], int]:
    """Names of the coefficients, those of the equations first; and how many these are (whole vectors of 8 where others follow)."""
    names = HARMONIC_TABLES if harmonics else TABLES
    if states.own_edges:
        first = tuple(name for name in names if name not in _LOADS_ONLY)
        return (*first, *_LOADS_ONLY), len(first)
    return names, HARMONIC_TABLES_OF_THE_EQUATIONS if harmonics else TABLES_OF_THE_EQUATIONS


HALF_SQRT3 = sp.Symbol(
    "half_sqrt3", real=True
)  # sin 120 degrees; a symbol, so that it stays one number in the code
BLADE_AZIMUTH = (
    (sp.Integer(1), sp.Integer(0)),
    (-sp.Rational(1, 2), HALF_SQRT3),
    (-sp.Rational(1, 2), -HALF_SQRT3),
)


# --- bookkeeping -------------------------------------------------------------------------------------------------------


@dataclass
class Sheet:
    """Straight-line assignments: `constants` depend on parameters only, `lines` on the state as well."""

    states: States = T2B1I1CG
    constants: dict[sp.Symbol, sp.Expr] = field(default_factory=dict)
    lines: list[tuple[sp.Symbol, sp.Expr]] = field(default_factory=list)
    _known: dict[sp.Expr, sp.Symbol] = field(default_factory=dict)

    def constant(self, expr: sp.Expr) -> sp.Expr:
        """A parameter-only expression as one symbol, computed once per run."""
        expr = sp.sympify(expr)
        if expr.is_number or expr in P.values():
            return expr
        if expr.could_extract_minus_sign():
            return -self.constant(-expr)
        if expr not in self._known:
            self._known[expr] = sp.Symbol(f"k{len(self.constants)}", real=True)
            self.constants[self._known[expr]] = expr
        return self._known[expr]

    def collect(self, expr: sp.Expr) -> sp.Expr:
        """Polynomial in the state symbols with its parameter-only coefficients replaced by constants, Horner's way in e and ed."""
        expr = sp.expand(expr)
        variables = sorted(expr.free_symbols - set(P.values()), key=lambda x: x.name)
        if not variables:
            return self.constant(expr)
        terms = sp.Poly(expr, *variables).terms()
        flat = sp.Add(
            *(self.constant(c) * sp.prod(x**k for x, k in zip(variables, ks, strict=True)) for ks, c in terms)
        )
        if self.states.own_edges:
            return flat
        e, ed = self.states.edge(1), self.states.edge(1, 1)
        for edge in (ed, e):
            flat = sp.collect(flat, edge, lambda part: sp.horner(part, wrt=e) if part.has(e) else part)
        return flat

    def linear(self, expr: sp.Expr, variables) -> sp.Expr:
        """A form linear in `variables` with coefficients in e: equal coefficients are computed once, whoever uses them."""
        variables = [x for x in variables if not sp.sympify(x).is_number]
        if not variables:
            return self._shared(self.collect(expr))
        poly = sp.Poly(sp.expand(expr), *variables)
        total = sp.Integer(0)
        for powers, coefficient in poly.terms():
            total += self._shared(self.collect(coefficient)) * sp.prod(
                x**k for x, k in zip(variables, powers, strict=True)
            )
        return total

    def _shared(self, expr: sp.Expr) -> sp.Expr:
        if expr.is_number or expr.is_Symbol or (-expr).is_Symbol:
            return expr
        if expr.could_extract_minus_sign():
            return -self._shared(-expr)
        if expr not in self._known:
            self._known[expr] = self.let(f"c{len(self._known)}", expr)
        return self._known[expr]

    def let(self, name: str, expr: sp.Expr) -> sp.Expr:
        """Name an intermediate result; numbers and plain symbols stay as they are."""
        expr = sp.sympify(expr)
        if expr.is_number or expr.is_Symbol:
            return expr
        symbol = sp.Symbol(name, real=True)
        if (symbol, expr) not in self.lines:
            self.lines.append((symbol, expr))
        return symbol

    def let_vector(self, name: str, vector) -> sp.Matrix:
        return sp.Matrix([self.let(f"{name}_{axis}", x) for axis, x in zip("xyz", vector, strict=True)])


def cross(a, b) -> sp.Matrix:
    return sp.Matrix(a).cross(sp.Matrix(b))


def rot_x_t(c, s, v) -> sp.Matrix:
    """Rx(angle)^T v."""
    return sp.Matrix([v[0], c * v[1] + s * v[2], -s * v[1] + c * v[2]])


def rot_y_t(c, s, v) -> sp.Matrix:
    """Ry(angle)^T v."""
    return sp.Matrix([c * v[0] - s * v[2], v[1], s * v[0] + c * v[2]])


def rot_y(c, s, v) -> sp.Matrix:
    return sp.Matrix([c * v[0] + s * v[2], v[1], -s * v[0] + c * v[2]])


def cone(v) -> sp.Matrix:
    """Coned blade axes -> az frame of the blade."""
    return rot_y(P["cos_cone"], P["sin_cone"], v)


def cone_t(v) -> sp.Matrix:
    return rot_y_t(P["cos_cone"], P["sin_cone"], v)


def cone_tensor(j: sp.Matrix) -> sp.Matrix:
    c, s = P["cos_cone"], P["sin_cone"]
    r = sp.Matrix([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return r * j * r.T


def sin_cos_small(sheet: Sheet, name: str, angle) -> tuple[sp.Expr, sp.Expr]:
    """sin and cos of a tower-top rotation by their Taylor series: to rounding for |angle| < 0.3 rad."""
    x = sheet.let(f"{name}_angle", angle)
    y = sheet.let(f"{name}_square", x * x)

    def horner(first: int) -> sp.Expr:
        terms = [sp.Rational((-1) ** k, sp.factorial(2 * k + first)) for k in range(7)]
        total = terms[-1]
        for term in reversed(terms[:-1]):
            total = term + y * total
        return total

    return sheet.let(f"{name}_sin", x * horner(1)), sheet.let(f"{name}_cos", horner(0))


# --- bodies ------------------------------------------------------------------------------------------------------------


@dataclass
class Blade:
    """Mass integrals of one blade in its coned axes as polynomials in (f, e) and their rates (fd, ed)."""

    f: sp.Expr
    e: sp.Expr
    fd: sp.Expr
    ed: sp.Expr

    def own(self, sheet: Sheet) -> dict[str, sp.Expr]:
        """What differs from blade to blade, by its letter in products: f, its rate d, and e, its rate g unless the blades share it."""
        flap = {"f": self.f, "d": self.fd}
        return flap | {"e": self.e, "g": self.ed} if sheet.states.own_edges else flap

    def foreshortening(self, kind: str) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
        return P[f"b_{kind}ff"], P[f"b_{kind}fe"], P[f"b_{kind}ee"]

    def first_moment(self) -> sp.Matrix:
        """integral u dm"""
        ff, fe, ee = self.foreshortening("s")
        f, e = self.f, self.e
        short = (ff * f**2 + 2 * fe * f * e + ee * e**2) / 2
        return sp.Matrix([P["b_fx"] * f + P["b_ex"] * e, P["b_fy"] * f + P["b_ey"] * e, P["b_m1"] - short])

    def first_moment_rate2(self) -> sp.Matrix:
        """The part of the second time derivative of integral u dm that remains at zero modal acceleration."""
        ff, fe, ee = self.foreshortening("s")
        return sp.Matrix([0, 0, -(ff * self.fd**2 + 2 * fe * self.fd * self.ed + ee * self.ed**2)])

    def second_moment(self) -> sp.Matrix:
        """J = integral u u^T dm (3, 3)"""
        f, e = self.f, self.e
        ff, fe, ee = self.foreshortening("rs")
        j11 = P["b_fxfx"] * f**2 + 2 * P["b_fxex"] * f * e + P["b_exex"] * e**2
        j22 = P["b_fyfy"] * f**2 + 2 * P["b_fyey"] * f * e + P["b_eyey"] * e**2
        j12 = P["b_fxfy"] * f**2 + (P["b_fxey"] + P["b_fyex"]) * f * e + P["b_exey"] * e**2
        j13 = P["b_rfx"] * f + P["b_rex"] * e
        j23 = P["b_rfy"] * f + P["b_rey"] * e
        j33 = P["b_m2"] - (ff * f**2 + 2 * fe * f * e + ee * e**2)
        return sp.Matrix([[j11, j12, j13], [j12, j22, j23], [j13, j23, j33]])

    def rate(self, quantity):
        """Time derivative of a polynomial in (f, e)."""
        return sp.diff(quantity, self.f) * self.fd + sp.diff(quantity, self.e) * self.ed

    def angular(self, mode: str) -> sp.Matrix:
        """L = integral u x du/d(mode) dm, for mode 'f' or 'e'"""
        # integral (psi x phi) dm along e3: the Coriolis coupling of flap and edge
        h = P["b_fyex"] - P["b_fxey"]
        twist = {"f": self.e * h, "e": -self.f * h}[mode]
        return sp.Matrix([-P[f"b_r{mode}y"], P[f"b_r{mode}x"], twist])

    def coriolis(self) -> sp.Expr:
        return P["b_fyex"] - P["b_fxey"]


AZIMUTH = sp.symbols("cos_blade sin_blade", real=True)  # of a generic blade's place on the hub


def over_azimuth(expr: sp.Expr) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """(q0, qc, qs) of a polynomial in AZIMUTH = q0 + qc cos + qs sin at the three blades' places.

    There cos(2 alpha) = cos(alpha) and sin(2 alpha) = -sin(alpha).
    """
    half = sp.Rational(1, 2)
    reduced = {(0, 0): (1, 0, 0), (1, 0): (0, 1, 0), (0, 1): (0, 0, 1),
               (2, 0): (half, half, 0), (0, 2): (half, -half, 0), (1, 1): (0, 0, -half)}  # fmt: skip
    out = [sp.Integer(0)] * 3
    for powers, coefficient in sp.Poly(sp.expand(expr), *AZIMUTH).terms():
        out = [total + part * coefficient for total, part in zip(out, reduced[powers], strict=True)]
    return out[0], out[1], out[2]


def at_blades(sheet: Sheet, name: str, harmonics) -> list[sp.Expr]:
    """q0 + qc cos + qs sin at the blades."""
    mean, cosine, sine = (
        sheet.let(f"{name}_{n}", x) for n, x in zip(("mean", "cos", "sin"), harmonics, strict=True)
    )
    if cosine == sine == 0:
        return [mean] * 3
    other = sheet.let(f"{name}_other", mean - cosine / 2)
    values = mean + cosine, other + HALF_SQRT3 * sine, other - HALF_SQRT3 * sine
    return [sheet.let(f"{name}_{i + 1}", x) for i, x in enumerate(values)]


# products of a blade's own f, fd (d), e, ed (g) in terms of what `harmonic_sums` sums up
_HALF = sp.Rational(1, 2)
_PRODUCTS = {
    **{name: ((name, sp.Integer(1)),) for name in ("f", "d", "e", "g", "ff", "ef", "ee", "dd", "dg", "gg")},
    "df": (("fd", _HALF),),
    "eg": (("eg", _HALF),),
    "fg": (("ef_rate", _HALF), ("turn", -_HALF)),
    "de": (("ef_rate", _HALF), ("turn", _HALF)),
}


def rotor_sum(sheet: Sheet, expr: sp.Expr, blade: Blade) -> sp.Expr:
    """Sum over the three blades of a polynomial in a generic blade's own deflections, their rates and AZIMUTH."""
    total = sp.Integer(0)
    letters = blade.own(sheet)
    for powers, coefficient in sp.Poly(sp.expand(expr), *letters.values()).terms():
        mean, cosine, sine = over_azimuth(coefficient)
        name = "".join(sorted("".join(letter * k for letter, k in zip(letters, powers, strict=True))))
        if not name:
            total += 3 * mean
            continue
        for product, scale in _PRODUCTS[name]:
            own = harmonic_symbols(product)
            total += scale * (3 * mean * own[0] + sp.Rational(3, 2) * (cosine * own[1] + sine * own[2]))
    return sheet.collect(total)


def harmonic_symbols(name: str) -> list[sp.Symbol]:
    return [sp.Symbol(f"{name}_{weight}", real=True) for weight in ("mean", "cos", "sin")]


def harmonic_sums(sheet: Sheet) -> None:
    """Mean, cosine and sine part over the rotor of the blades' own deflections, rates and products: x_i = mean + cos cos_i + sin sin_i."""
    x = sheet.states
    f, fd, e, ed = ([of(i, k) for i in (1, 2, 3)] for of in (x.flap, x.edge) for k in (0, 1))

    def times(a, b, scale=1):
        return [scale * p * q for p, q in zip(a, b, strict=True)]

    products = {
        "f": f,
        "d": fd,
        "ff": times(f, f),
        "fd": times(f, fd, 2),  # the rate of ff
        "dd": times(fd, fd),
    }
    if x.own_edges:
        both = list(zip(times(f, ed), times(e, fd), strict=True))
        products |= {
            "e": e,
            "g": ed,
            "ef": times(e, f),
            "ee": times(e, e),
            "ef_rate": [a + b for a, b in both],
            "eg": times(e, ed, 2),  # the rate of ee
            "turn": [b - a for a, b in both],
            "dg": times(fd, ed),
            "gg": times(ed, ed),
        }
    for name in products:
        one, two, three = (sheet.let(f"{name}_of_{i + 1}", x) for i, x in enumerate(products[name]))
        mean, cosine, sine = harmonic_symbols(name)
        sheet.lines.append((mean, (one + (two + three)) / 3))
        sheet.lines.append((cosine, one - mean))
        sheet.lines.append((sine, (two - three) / (2 * HALF_SQRT3)))


def to_hub(v) -> sp.Matrix:
    """Coned axes of the generic blade -> F."""
    return rot_x_t(AZIMUTH[0], -AZIMUTH[1], cone(v))


def sum_vector(sheet: Sheet, v: sp.Matrix, blade: Blade) -> sp.Matrix:
    """Sum over the blades of a vector given in coned axes, in frame F."""
    return to_hub(v).applyfunc(lambda x: rotor_sum(sheet, x, blade))


@dataclass
class Tensor:
    """Symmetric; `mean` and `difference` are the half sum and half difference of yy and zz."""

    xx: sp.Expr
    xy: sp.Expr
    xz: sp.Expr
    yz: sp.Expr
    mean: sp.Expr
    difference: sp.Expr

    def map(self, function) -> Tensor:
        return Tensor(*(function(n, x) for n, x in vars(self).items()))

    def quadratic(self, sheet: Sheet, w) -> sp.Expr:
        """w . T w"""
        p = products(sheet, w)
        return (
            self.xx * p.xx + self.mean * 2 * p.mean + self.difference * 2 * p.difference
            + 2 * (self.xy * p.xy + self.xz * p.xz + self.yz * p.yz)
        )  # fmt: skip

    def matrix(self, sheet: Sheet, name: str) -> sp.Matrix:
        yy = sheet.let(f"{name}_yy", self.mean + self.difference)
        zz = sheet.let(f"{name}_zz", self.mean - self.difference)
        return sp.Matrix([[self.xx, self.xy, self.xz], [self.xy, yy, self.yz], [self.xz, self.yz, zz]])


def products(sheet: Sheet, w) -> Tensor:
    """w w^T"""
    names = {"xx": (0, 0), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2), "yy": (1, 1), "zz": (2, 2)}
    p = {n: sheet.let(f"w_{n}", w[i] * w[j]) for n, (i, j) in names.items()}
    half = sp.Rational(1, 2)
    mean, difference = (
        sheet.let(f"w_{n}", half * x) for n, x in (("mean", p["yy"] + p["zz"]), ("diff", p["yy"] - p["zz"]))
    )
    return Tensor(p["xx"], p["xy"], p["xz"], p["yz"], mean, difference)


def sum_tensor(sheet: Sheet, j: sp.Matrix, blade: Blade) -> Tensor:
    """Sum over the blades of a symmetric tensor given in coned axes, in frame F."""
    c, s = AZIMUTH
    turn = sp.Matrix([[1, 0, 0], [0, c, -s], [0, s, c]])
    # the square of c and s is 1, which the reduction to harmonics does not know of
    t = (turn * cone_tensor(j) * turn.T).applyfunc(sp.expand)
    yy, zz = t[1, 1], t[2, 2]
    parts = Tensor(t[0, 0], t[0, 1], t[0, 2], t[1, 2], (yy + zz) / 2, (yy - zz) / 2)
    return parts.map(lambda _, x: rotor_sum(sheet, x, blade))


def with_edge_slope(sheet: Sheet, name: str, expr: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """A quadratic polynomial in e, and its derivative by e, sharing their parts."""
    e = sheet.states.edge(1)
    square, linear, fixed = (sp.expand(expr).coeff(e, k) for k in (2, 1, 0))
    slope = sheet.let(f"{name}_slope", linear + square * e)
    return sheet.let(name, fixed + e * slope), sheet.let(f"{name}_by_e", slope + square * e)


# --- motion of the tower top and the hub -------------------------------------------------------------------------------


@dataclass
class Motion:
    """Velocity of a point as t_a ad + t_s sd and of its frame as w_a ad + w_s sd; `acceleration` and `spin` at zero q''."""

    t_a: sp.Matrix
    t_s: sp.Matrix
    w_a: sp.Matrix
    w_s: sp.Matrix
    omega: sp.Matrix
    acceleration: sp.Matrix  # minus gravity: what a weighing cell would feel
    spin: sp.Matrix


def tower(sheet: Sheet, order: int = 0) -> tuple[sp.Symbol, sp.Symbol]:
    """The tower top's fore-aft and side-side coordinate, or their derivatives."""
    return sheet.states.of("a", order), sheet.states.of("s", order)


def tower_top(sheet: Sheet) -> Motion:
    """Motion of the tower top, components in N."""
    a, s = tower(sheet)
    ad, sd = tower(sheet, 1)
    mu_a, mu_s = P["t_slope_fa"], P["t_slope_ss"]
    sin_a, cos_a = sin_cos_small(sheet, "pitch", mu_a * a)
    sin_r, cos_r = sin_cos_small(sheet, "roll", -mu_s * s)

    def to_n(name, vector):
        return sheet.let_vector(name, rot_x_t(cos_r, sin_r, rot_y_t(cos_a, sin_a, vector)))

    w_a = sheet.let_vector("wa", [0, mu_a * cos_r, -mu_a * sin_r])
    w_s = sp.Matrix([-mu_s, 0, 0])
    rates = sheet.let("rates", mu_a * mu_s * ad * sd)
    drop = P["t_short_fa"] * ad**2 + P["t_short_ss"] * sd**2
    return Motion(
        t_a=to_n("ta", [1, 0, -P["t_short_fa"] * a]),
        t_s=to_n("ts", [0, 1, -P["t_short_ss"] * s]),
        w_a=w_a,
        w_s=w_s,
        omega=sheet.let_vector("wn", w_a * ad + w_s * sd),
        acceleration=to_n("top", [0, 0, P["gravity"] - drop]),
        spin=sheet.let_vector("spin_n", [0, rates * sin_r, rates * cos_r]),
    )


def offset(sheet: Sheet, name: str, motion: Motion, arm) -> Motion:
    """Motion of another point of the same rigid body, `arm` away."""
    arm = sp.Matrix(arm)
    w = motion.omega
    carried = motion.acceleration + cross(motion.spin, arm) + cross(w, cross(w, arm))
    return Motion(
        t_a=sheet.let_vector(f"{name}_ta", motion.t_a + cross(motion.w_a, arm)),
        t_s=sheet.let_vector(f"{name}_ts", motion.t_s + cross(motion.w_s, arm)),
        w_a=motion.w_a,
        w_s=motion.w_s,
        omega=w,
        acceleration=sheet.let_vector(f"{name}_acc", carried),
        spin=motion.spin,
    )


def apex_arm(sheet: Sheet) -> sp.Matrix:
    """Rotor apex from the tower top, in N (OpenFAST: overhang along the tilted shaft, which crosses the yaw axis)."""
    return sp.Matrix(
        [
            sheet.constant(P["overhang"] * P["cos_tilt"]),
            0,
            sheet.constant(P["tower_to_shaft"] + P["overhang"] * P["sin_tilt"]),
        ]
    )


def to_shaft(sheet: Sheet, name: str, v) -> sp.Matrix:
    """N -> S. The tilt's sign is OpenFAST's: the shaft axis is (cos tilt, 0, sin tilt) in N."""
    return sheet.let_vector(name, rot_y_t(P["cos_tilt"], -P["sin_tilt"], v))


def hub(sheet: Sheet, top: Motion) -> Motion:
    """Motion of the rotor apex and of frame F, components in F."""
    apex = offset(sheet, "apex", top, apex_arm(sheet))
    phid = sheet.states.of("phi", 1)

    def to_f(name, v):
        return sheet.let_vector(name, rot_x_t(COSINE, SINE, to_shaft(sheet, f"{name}_s", v)))

    omega_n = to_f("won", apex.omega)
    spin = to_f("spin_f", apex.spin)
    # frame F turns with phid about x: the components of omega_n change by -phid e_x x omega_n
    return Motion(
        t_a=to_f("tha", apex.t_a),
        t_s=to_f("ths", apex.t_s),
        w_a=to_f("wha", apex.w_a),
        w_s=to_f("whs", apex.w_s),
        omega=sp.Matrix([sheet.let("wf_x", omega_n[0] + phid), omega_n[1], omega_n[2]]),
        acceleration=to_f("acc_f", apex.acceleration),
        spin=sheet.let_vector("spin_h", [spin[0], spin[1] + phid * omega_n[2], spin[2] - phid * omega_n[1]]),
    )


# --- inertia of the rotor ----------------------------------------------------------------------------------------------


@dataclass
class RotorInertia:
    mass: sp.Expr
    first: sp.Matrix
    inertia: sp.Matrix
    force: sp.Matrix  # integral (a - g) dm at zero q''
    moment: sp.Matrix  # integral rho x (a - g) dm about the apex
    edge: CollectiveEdge | None  # where the blades share one


@dataclass
class CollectiveEdge:
    """What the blades' edgewise deflection meets when they share it, summed over them."""

    linear: sp.Matrix  # integral du/de dm
    angular: sp.Matrix
    force: sp.Expr  # integral du/de . (a - g) dm at zero q''


def inertia_of(j: sp.Matrix) -> sp.Matrix:
    return sp.eye(3) * j.trace() - j


def let_symmetric(sheet: Sheet, name: str, m: sp.Matrix) -> sp.Matrix:
    out = sp.zeros(3, 3)
    for i in range(3):
        for j in range(i, 3):
            out[i, j] = out[j, i] = sheet.let(f"{name}_{'xyz'[i]}{'xyz'[j]}", m[i, j])
    return out


def blade_symbols(sheet: Sheet, number: int | None = None) -> Blade:
    """Blade 1, 2 or 3; None: a generic blade for sums over the rotor."""
    x = sheet.states
    if number is not None:
        return Blade(x.flap(number), x.edge(number), x.flap(number, 1), x.edge(number, 1))
    f, fd, e, ed = (sp.Symbol(name, real=True) for name in ("f", "fd", "e", "ed"))
    return Blade(f, e, fd, ed)


def body_force(sheet, name, m, mass, first, first_rate, first_rate2, inertia, turning, spin_moment):
    """Inertial plus gravity force and moment about the apex of a deforming body whose frame moves with m, zero q''.

    `turning`: the inertia's rate times omega.
    """
    w = m.omega
    whirl = sheet.let_vector(f"{name}_whirl", cross(w, first) + 2 * first_rate)
    force = m.acceleration * mass + cross(m.spin, first) + cross(w, whirl) + first_rate2
    momentum = sheet.let_vector(f"{name}_momentum", inertia * w + spin_moment)
    moment = cross(first, m.acceleration) + inertia * m.spin + cross(w, momentum) + turning
    return sheet.let_vector(f"{name}_force", force), sheet.let_vector(f"{name}_moment", moment)


def rotor(sheet: Sheet, m: Motion) -> RotorInertia:
    """Hub and three blades as one body in frame F."""
    harmonic_sums(sheet)
    b, w = blade_symbols(sheet), m.omega
    own = inertia_of(b.second_moment())
    mass = 3 * P["b_m"] + P["h_m"]
    hub_tensor = sp.diag(P["h_ixx"], P["h_itt"], P["h_itt"])
    if sheet.states.own_edges:
        first = sheet.let_vector("rs", sum_vector(sheet, b.first_moment(), b))
        first_rate = sheet.let_vector("rsd", sum_vector(sheet, b.rate(b.first_moment()), b))
        first_rate2 = sheet.let_vector("rsdd", sum_vector(sheet, b.first_moment_rate2(), b))
        spin_moment = sheet.let_vector(
            "rl", sum_vector(sheet, b.angular("f") * b.fd + b.angular("e") * b.ed, b)
        )
        whole = sum_tensor(sheet, own, b).map(lambda n, x: sheet.let(f"ri_{n}", x))
        inertia = let_symmetric(sheet, "rih", whole.matrix(sheet, "ri") + hub_tensor)
        rate = sum_tensor(sheet, b.rate(own), b).map(lambda n, x: sheet.let(f"rid_{n}", x))
        turning = sheet.let_vector("turning", rate.matrix(sheet, "rid") * w)
        mass = sheet.constant(mass)
        force, moment = body_force(
            sheet, "rot", m, mass, first, first_rate, first_rate2, inertia, turning, spin_moment
        )
        return RotorInertia(mass, first, inertia, force, moment, None)

    ed = b.ed
    first, edge_linear = (sp.Matrix(x) for x in zip(*(
        with_edge_slope(sheet, f"rs_{n}", x) for n, x in zip("xyz", sum_vector(sheet, b.first_moment(), b), strict=True)
    ), strict=True))  # fmt: skip
    by_flap = sum_vector(sheet, sp.diff(b.first_moment(), b.f) * b.fd, b)
    first_rate = sheet.let_vector("rsd", edge_linear * ed + by_flap)
    first_rate2 = sheet.let_vector("rsdd", sum_vector(sheet, b.first_moment_rate2(), b))
    edge_angular = sheet.let_vector("rle", sum_vector(sheet, b.angular("e"), b))
    spin_moment = sheet.let_vector("rl", edge_angular * ed + sum_vector(sheet, b.angular("f") * b.fd, b))

    pairs = sum_tensor(sheet, own, b).map(lambda n, x: with_edge_slope(sheet, f"ri_{n}", x))
    inertia = let_symmetric(sheet, "rih", pairs.map(lambda _, pair: pair[0]).matrix(sheet, "ri") + hub_tensor)
    by_edge = pairs.map(lambda _, pair: pair[1])
    by_flap = sum_tensor(sheet, sp.diff(own, b.f) * b.fd, b)
    rate = by_flap.map(lambda n, x: sheet.let(f"rid_{n}", x + getattr(by_edge, n) * ed))
    turning = sheet.let_vector("turning", rate.matrix(sheet, "rid") * w)
    mass = sheet.constant(mass)
    force, moment = body_force(
        sheet, "rot", m, mass, first, first_rate, first_rate2, inertia, turning, spin_moment
    )
    # centrifugal, Coriolis (only the in-plane/out-of-plane pair of one blade contributes), weight and carried motion
    along = rotor_sum(sheet, to_hub([0, 0, 1]).dot(w) * 2 * b.coriolis() * b.fd, b)
    centrifugal = by_edge.quadratic(sheet, w) / 2
    edge = edge_linear.dot(m.acceleration) + edge_angular.dot(m.spin) - centrifugal - along
    return RotorInertia(
        mass,
        first,
        inertia,
        force,
        moment,
        CollectiveEdge(edge_linear, edge_angular, sheet.let("h_edge", edge)),
    )


@dataclass
class Bladewise:
    """A quantity of each blade by harmonics over its place: `parts[""]` is the same for any deflection, `parts["f"]` goes with the
    blade's own flap and, where it has one, `parts["e"]` with its own edge."""

    parts: dict[str, list[sp.Expr]]

    @classmethod
    def of(cls, sheet: Sheet, expr: sp.Expr, variables) -> Bladewise:
        """A polynomial in AZIMUTH, linear in a generic blade's own deflections, and linear in `variables`."""
        deflections = {k: x for k, x in blade_symbols(sheet).own(sheet).items() if k in "fe"}
        rest, found = sp.expand(expr), {}
        for letter, x in deflections.items():
            found[letter], rest = rest.coeff(x, 1), rest.coeff(x, 0)
        parts = {"": rest} | found
        return cls({k: [sheet.linear(x, variables) for x in over_azimuth(part)] for k, part in parts.items()})

    def at_blades(self, sheet: Sheet, name: str) -> list[sp.Expr]:
        names = {"": "fixed", "f": "by_flap", "e": "by_edge"}
        at = {k: at_blades(sheet, f"{name}_{names[k]}", part) for k, part in self.parts.items()}
        x = sheet.states
        own = {"f": [x.flap(i) for i in (1, 2, 3)], "e": [x.edge(i) for i in (1, 2, 3)]}
        return [at[""][i] + sum(own[k][i] * at[k][i] for k in at if k) for i in range(3)]


def mode_of(blade: Blade, mode: str) -> sp.Expr:
    return {"f": blade.f, "e": blade.e}[mode]


def coupling(sheet: Sheet, mode: str, t, w) -> Bladewise:
    """integral du/d(mode) . (t + w x rho) dm of each blade: t, w in F."""
    b = blade_symbols(sheet)
    linear, angular = to_hub(sp.diff(b.first_moment(), mode_of(b, mode))), to_hub(b.angular(mode))
    return Bladewise.of(sheet, linear.dot(t) + angular.dot(w), [*t, *w])


def centrifugal(sheet: Sheet, mode: str, w) -> tuple[sp.Expr, list[sp.Expr]]:
    """integral du/d(mode) . (w x (w x rho)) dm of each blade, and the products of w that it is linear in."""
    b = blade_symbols(sheet)
    own = inertia_of(sp.diff(b.second_moment(), mode_of(b, mode)))
    c, s = AZIMUTH
    turn = sp.Matrix([[1, 0, 0], [0, c, -s], [0, s, c]])
    tensor = turn * cone_tensor(own) * turn.T
    p = products(sheet, w)
    whole = sp.Matrix(
        [[p.xx, p.xy, p.xz], [p.xy, p.mean + p.difference, p.yz], [p.xz, p.yz, p.mean - p.difference]]
    )
    total = -sum(tensor[i, j] * whole[i, j] for i in range(3) for j in range(3)) / 2
    return sp.expand(total), list(vars(p).values())


def flap_whirl(sheet: Sheet, w) -> Bladewise:
    """integral du/df . (w x (w x rho) + 2 w x du/dt) dm of each blade that shares its edge with the others."""
    b = blade_symbols(sheet)
    outwards, variables = centrifugal(sheet, "f", w)
    twice = [sheet.let(f"w_ed_{n}", x * b.ed) for n, x in zip("xyz", w, strict=True)]
    coriolis = 2 * b.coriolis() * to_hub([0, 0, 1]).dot(twice)
    return Bladewise.of(sheet, outwards + coriolis, [*variables, *twice])


def az_frame(sheet: Sheet, name: str, v, number: int) -> sp.Matrix:
    """F -> the blade's az frame."""
    c, s = BLADE_AZIMUTH[number - 1]
    return sheet.let_vector(f"{name}_{number}", rot_x_t(c, s, v))


def coned(sheet: Sheet, name: str, v, number: int) -> sp.Matrix:
    """F -> the blade's coned axes."""
    return sheet.let_vector(f"{name}_c{number}", cone_t(az_frame(sheet, name, v, number)))


# --- applied forces ----------------------------------------------------------------------------------------------------

TABLE = {name: sp.Symbol(f"c_{name}", real=True) for name in HARMONIC_TABLES}
TIP_SPEED_RATIO = sp.Symbol("tip_speed_ratio", real=True)


@dataclass
class Aerodynamics:
    """Velocities [m/s] that one blade sees besides the normal wind: x_i = cos part * cos(alpha_i) + sin part * sin(alpha_i)."""

    normal: sp.Expr  # V
    kappa: tuple[sp.Expr, sp.Expr]  # V kappa_i
    inplane: tuple[sp.Expr, sp.Expr]  # V y_i
    skew: tuple[sp.Expr, sp.Expr]  # in-plane wind along the blade, outwards
    pressure: sp.Expr  # rho A V / 6: a blade's third of rho/2 A V
    states: States
    uniform: tuple[
        sp.Expr, ...
    ] = ()  # mean, cos and sin part of the wind that the harmonics add along the shaft; or nothing

    def load(self, name: str, number: int) -> sp.Expr:
        """One blade's coefficient times velocity; times `pressure` (and R) it is the load."""
        c, s = BLADE_AZIMUTH[number - 1]
        total = TABLE[name] * self.normal
        for key, (pc, ps) in (("kappa", self.kappa), ("y", self.inplane), ("skew", self.skew)):
            total += TABLE[f"{name}_{key}"] * (pc * c + ps * s) if f"{name}_{key}" in TABLE else 0
        if self.uniform:
            mean, uc, us = self.uniform
            total += TABLE[f"{name}_w"] * (mean + uc * c + us * s)
        flap = TABLE[f"{name}_flap"] * self.states.flap(number, 1)
        return total + flap + TABLE[f"{name}_edge"] * self.states.edge(number, 1)

    def parts(self) -> list[tuple[str, tuple[sp.Expr, ...]]]:
        """(table's suffix, cos and sin part) of everything periodic."""
        own: list[tuple[str, tuple[sp.Expr, ...]]] = [
            ("kappa", self.kappa), ("y", self.inplane), ("skew", self.skew)
        ]  # fmt: skip
        return own + ([("w", self.uniform[1:])] if self.uniform else [])

    def of_uniform(self, name: str, i: int) -> sp.Expr:
        """What part i of the harmonics' wind makes of a load."""
        return TABLE[f"{name}_w"] * self.uniform[i] if self.uniform else sp.Integer(0)

    def of_shared_edge(self, name: str) -> sp.Expr:
        """What the edgewise velocity that all blades share makes of a load."""
        return sp.Integer(0) if self.states.own_edges else TABLE[f"{name}_edge"] * self.states.edge(1, 1)

    def resting(self, name: str) -> list[sp.Expr]:
        """The generalised flap or edge force of a blade that does not deflect by itself, by harmonics; times `pressure`."""
        mean = TABLE[name] * self.normal + self.of_shared_edge(name) + self.of_uniform(name, 0)
        parts = self.parts()
        return [mean, *(sum(TABLE[f"{name}_{key}"] * part[i] for key, part in parts) for i in (0, 1))]

    def of_rates(self, name: str, i: int) -> sp.Expr:
        """What part i (mean, cos, sin) of the blades' own modal velocities makes of a load."""
        total = TABLE[f"{name}_flap"] * harmonic_symbols("d")[i]
        return total + TABLE[f"{name}_edge"] * harmonic_symbols("g")[i] if self.states.own_edges else total

    def mean(self, name: str) -> sp.Expr:
        """A third of the sum over the blades."""
        own = self.of_rates(name, 0) + self.of_uniform(name, 0)
        return TABLE[name] * self.normal + self.of_shared_edge(name) + own

    def harmonic(self, name: str) -> tuple[sp.Expr, sp.Expr]:
        """Two thirds of the sums weighted with cos and sin of the blade's place; what all blades share drops out."""
        out = []
        for i in (0, 1):
            periodic = sum(TABLE[f"{name}_{key}"] * part[i] for key, part in self.parts())
            out.append(periodic + self.of_rates(name, i + 1))
        return out[0], out[1]


def inflow(sheet: Sheet, m: Motion, harmonics: bool) -> Aerodynamics:
    """Relative wind at the hub, in F, and the tip-speed ratio of the look-up; harmonics: whether the wind may blow across, too, and blades
    feel azimuthal ones.

    Of the harmonics' wind, the part along the shaft acts on the blades; across the rotor it would be a few per cent of a fluctuation.
    """
    v, kv, kh = WIND
    blowing = [v, *ACROSS] if harmonics else [v, 0, 0]
    ad, sd = tower(sheet, 1)
    cos_a, sin_a, cos_r, sin_r = sp.symbols("pitch_cos pitch_sin roll_cos roll_sin", real=True)
    wind_n = rot_x_t(cos_r, sin_r, rot_y_t(cos_a, sin_a, blowing))
    wind_s = to_shaft(sheet, "wind_s", sheet.let_vector("wind_n", wind_n))
    wind = rot_x_t(COSINE, SINE, wind_s)
    relative = sheet.let_vector("relative", wind - m.t_a * ad - m.t_s * sd)
    radius = P["radius"]
    kc = sheet.let("kappa_cos", wind_s[0] * (kv * COSINE - kh * SINE) - radius * m.omega[1])
    ks = sheet.let("kappa_sin", -wind_s[0] * (kv * SINE + kh * COSINE) - radius * m.omega[2])
    normal = relative[0]
    sheet.lines.append((TIP_SPEED_RATIO, radius * m.omega[0] / normal))
    pressure = sheet.let("pressure", sheet.constant(P["q_area"] / 3) * normal)
    # e3 = (0, -sin, cos): a blade that points where the wind blows across the rotor lies in more of the wake. The wake leans
    # with the wind; it does not follow the tower's swaying.
    skew = tuple(sheet.let(f"skew_{n}", x) for n, x in (("cos", wind[2]), ("sin", -wind[1])))
    folded = zip(("mean", "cos", "sin"), FOLDED, strict=True) if harmonics else ()
    uniform = tuple(sheet.let(f"uniform_{n}", P["cos_tilt"] * x) for n, x in folded)
    return Aerodynamics(normal, (kc, ks), (relative[1], relative[2]), skew, pressure, sheet.states, uniform)


def aero_resultant(sheet: Sheet, aero: Aerodynamics) -> tuple[sp.Matrix, sp.Matrix]:
    """Aerodynamic force and moment about the apex of the whole rotor, in F."""
    sg = P["sin_cone"]
    along = sheet.let("pressure_x", aero.pressure * sheet.constant(3 * P["cos_cone"]))
    across = sheet.let("pressure_yz", aero.pressure * sp.Rational(3, 2))
    radius = P["radius"]
    (tc, ts), (sc, ss) = aero.harmonic("thrust"), aero.harmonic("tangential")
    (qc, qs), (mc, ms) = aero.harmonic("torque"), aero.harmonic("bending")
    force = sp.Matrix([along * aero.mean("thrust"), across * (sg * ts - sc), across * (-sg * tc - ss)])
    along, across = sheet.let("pressure_rx", along * radius), sheet.let("pressure_ryz", across * radius)
    moment = sp.Matrix([along * aero.mean("torque"), across * (mc + sg * qs), across * (ms - sg * qc)])
    return sheet.let_vector("aero_force", force), sheet.let_vector("aero_moment", moment)


COMMANDED = sp.Symbol("torque_commanded", real=True)  # generator torque where a controller makes it


def generator_torque(sheet: Sheet, controlled: bool) -> sp.Expr:
    """The controller's; or, of the momentary speed, regions 2, 2.5 and 3 of NREL/TP-500-38060, 7.2: min(max(k omega^2, line), power /
    omega), with smooth corners.

    A kink where a trajectory passes costs every method its order (docs/decisions/0002).
    """
    if controlled:
        return COMMANDED
    w, blend = sheet.states.of("gen", 1), sheet.constant(P["tg_e"] ** 2)
    optimal = sheet.let("torque_optimal", P["tg_k"] * w * w)
    rise = sheet.let("torque_rise", P["tg_a2"] * (w - P["tg_ws"]) + P["tg_t2"] - optimal)
    below = sheet.let("torque_below", optimal + (rise + sp.sqrt(rise * rise + blend)) / 2)
    # a generator that stands still would divide by zero; the addend is lost in the rounding of any speed but zero
    excess = sheet.let("torque_excess", below - P["tg_t"] - P["tg_p"] / (w + sp.Float("1e-100")))
    return sheet.let("torque_gen", below - (excess + sp.sqrt(excess * excess + blend)) / 2)


def shaft_torque(sheet: Sheet, torque: sp.Expr) -> sp.Expr:
    """Torque of the drivetrain on the rotor side: of spring and damper; through a rigid shaft also that of the generator, `torque`.

    What the generator's inertia takes through a rigid shaft is not in it: that is in the mass matrix (`rigid_inertia`).
    """
    phi, gen, phid, gend = (sheet.states.of(name, k) for k in (0, 1) for name in ("phi", "gen"))
    inverse = sheet.constant(1 / P["g_ratio"])
    spring = P["d_k"] * (phi - gen * inverse) + P["d_d"] * (phid - gend * inverse)
    return sheet.let(
        "torque_shaft", spring + sheet.constant(P["g_rigid"] * P["g_ratio"] / P["g_efficiency"]) * torque
    )


def rigid_inertia(sheet: Sheet) -> sp.Expr:
    """Inertia of the generator that a rigid shaft adds to the rotor's; what accelerates it goes through the gearbox, too."""
    return sheet.constant(P["g_rigid"] * P["g_ratio"] ** 2 * P["g_i"] / P["g_efficiency"])


# --- assembly ----------------------------------------------------------------------------------------------------------


def tower_and_nacelle(sheet: Sheet, top: Motion) -> tuple[dict[str, sp.Expr], dict[str, sp.Expr]]:
    """Mass terms and generalised forces of the two tower degrees of freedom without the rotor."""
    a, s = tower(sheet)
    ad, sd = tower(sheet, 1)
    n = offset(sheet, "nac", top, [P["n_x"], P["n_y"], P["n_z"]])
    tensor = sp.diag(P["n_ixx"], P["n_iyy"], P["n_izz"])
    spin_moment = sheet.let_vector("nac_moment", tensor * n.spin + cross(n.omega, tensor * n.omega))
    mass, force = {}, {}
    for key, tj, wj in (("a", n.t_a, n.w_a), ("s", n.t_s, n.w_s)):
        force[key] = -P["n_m"] * tj.dot(n.acceleration) - wj.dot(spin_moment)
    for key, tj, wj, tk, wk in (
        ("aa", n.t_a, n.w_a, n.t_a, n.w_a), ("as", n.t_a, n.w_a, n.t_s, n.w_s), ("ss", n.t_s, n.w_s, n.t_s, n.w_s),
    ):  # fmt: skip
        mass[key] = P["n_m"] * tj.dot(tk) + (tensor * wj).dot(wk)
    mass["aa"] += P["t_maa"]
    mass["ss"] += P["t_mss"]
    # the tower's own weight on its foreshortening softens it
    force["a"] += -sheet.constant(P["t_ka"] - P["gravity"] * P["t_gfa"]) * a - P["t_da"] * ad
    force["s"] += -sheet.constant(P["t_ks"] - P["gravity"] * P["t_gss"]) * s - P["t_ds"] * sd
    return mass, force


@dataclass
class Moved:
    """The whole model: a sheet of assignments, the motions and the flow that the loads depend on as well, and the accelerations."""

    sheet: Sheet
    top: Motion
    hub: Motion
    aero: Aerodynamics
    accelerations: tuple[sp.Expr, ...]


def accelerations(states: States = T2B1I1CG, harmonics: bool = False, controlled: bool = False) -> Moved:
    """The equations of motion, solved; harmonics: see `inflow`; controlled: `generator_torque`."""
    sheet = Sheet(states)
    top = tower_top(sheet)
    m = hub(sheet, top)
    aero = inflow(sheet, m, harmonics)
    r = rotor(sheet, m)
    mass, force = tower_and_nacelle(sheet, top)

    aero_force, aero_moment = aero_resultant(sheet, aero)
    net_force = sheet.let_vector("net_force", aero_force - r.force)
    net_moment = sheet.let_vector("net_moment", aero_moment - r.moment)
    torque = generator_torque(sheet, controlled)
    twist = shaft_torque(sheet, torque)

    # columns of the mass matrix that belong to the rotor; `iw` = moment about the apex per unit acceleration
    columns = {"a": (m.t_a, m.w_a), "s": (m.t_s, m.w_s), "p": (sp.zeros(3, 1), sp.Matrix([1, 0, 0]))}
    momentum, angular = {}, {}
    for key, (t, w) in columns.items():
        momentum[key] = sheet.let_vector(f"mom_{key}", r.mass * t + cross(w, r.first))
        angular[key] = sheet.let_vector(f"ang_{key}", cross(r.first, t) + r.inertia * w)
    for j, k in (("a", "a"), ("a", "s"), ("s", "s"), ("p", "a"), ("p", "s"), ("p", "p")):
        t, w = columns[j]
        mass[j + k] = mass.get(j + k, 0) + t.dot(momentum[k]) + w.dot(angular[k])
    for key, (t, w) in columns.items():
        force[key] = force.get(key, 0) + t.dot(net_force) + w.dot(net_moment)
        if r.edge is not None:
            mass["e" + key] = t.dot(r.edge.linear) + w.dot(r.edge.angular)
    force["p"] -= twist
    mass["pp"] += rigid_inertia(sheet)

    b_ff = sheet.constant(P["b_fxfx"] + P["b_fyfy"])
    b_fe = sheet.constant(P["b_fxex"] + P["b_fyey"])
    if r.edge is not None:
        mass["ee"] = sheet.constant(3 * (P["b_exex"] + P["b_eyey"]))
        e, ed, f_mean = states.edge(1), states.edge(1, 1), harmonic_symbols("f")[0]
        elastic = P["b_ke"] * e + P["b_de"] * ed + P["b_kfe"] * f_mean
        force["e"] = 3 * (aero.pressure * aero.mean("edge") - elastic) - r.edge.force
        force |= flap_forces(sheet, m, aero)
    else:
        force |= blade_forces(sheet, m, aero)
    for key, (t, w) in columns.items():
        for mode in "fe" if states.own_edges else "f":
            values = coupling(sheet, mode, t, w).at_blades(sheet, f"m_{mode}_{key}")
            for number in (1, 2, 3):
                mass[f"{mode}{number}{key}"] = sheet.let(f"m_{mode}{number}{key}", values[number - 1])
    if states.own_edges:
        b_ee = sheet.constant(P["b_exex"] + P["b_eyey"])
        result = solve_own_edges(sheet, mass, force, b_ff, b_fe, b_ee)
    else:
        result = solve(sheet, mass, force, b_ff, b_fe)
    share = sheet.constant(P["g_efficiency"] / P["g_ratio"])
    generator = (twist * share - torque) * sheet.constant(1 / P["g_i"])
    generator += sheet.constant(P["g_rigid"] * P["g_ratio"]) * result["p"]
    result |= {"phi": result["p"], "gen": sheet.let("x_gen", generator)}
    return Moved(sheet, top, m, aero, tuple(result[name] for name in states.coordinates))


def flap_forces(sheet: Sheet, m: Motion, aero: Aerodynamics) -> dict[str, sp.Expr]:
    """Generalised force of each blade's flap at zero q'', where the blades share their edge."""
    x = sheet.states
    carried, whirl = coupling(sheet, "f", m.acceleration, m.spin), flap_whirl(sheet, m.omega)
    fixed = [
        aero.pressure * q - x - y
        for q, x, y in zip(aero.resting("flap"), carried.parts[""], whirl.parts[""], strict=True)
    ]
    fixed[0] -= P["b_kfe"] * x.edge(1)
    by_flap = [-x - y for x, y in zip(carried.parts["f"], whirl.parts["f"], strict=True)]
    by_flap[0] -= P["b_kf"]
    values = Bladewise({"": fixed, "f": by_flap}).at_blades(sheet, "q_f")
    damping = sheet.let("flap_damping", aero.pressure * TABLE["flap_flap"] - P["b_df"])
    return {f"f{i}": sheet.let(f"q_f{i}", values[i - 1] + damping * x.flap(i, 1)) for i in (1, 2, 3)}


def blade_forces(sheet: Sheet, m: Motion, aero: Aerodynamics) -> dict[str, sp.Expr]:
    """Generalised forces of each blade's flap and edge at zero q'', where each blade has both."""
    x, b = sheet.states, blade_symbols(sheet)
    # twice the moment about the blade's axis by which flap and edge turn into each other
    gyroscopic = at_blades(
        sheet, "gyro", [sheet.linear(q, m.omega) for q in over_azimuth(2 * b.coriolis() * to_hub([0, 0, 1]).dot(m.omega))]
    )  # fmt: skip
    out = {}
    stiffness = {"ff": P["b_kf"], "ee": P["b_ke"], "fe": P["b_kfe"], "ef": P["b_kfe"]}
    damping = {"f": P["b_df"], "e": P["b_de"]}
    for mode, name in (("f", "flap"), ("e", "edge")):
        outwards, variables = centrifugal(sheet, mode, m.omega)
        carried, whirl = (
            coupling(sheet, mode, m.acceleration, m.spin),
            Bladewise.of(sheet, outwards, variables),
        )
        parts = {
            k: [-x - y for x, y in zip(carried.parts[k], whirl.parts[k], strict=True)] for k in carried.parts
        }
        parts[""] = [aero.pressure * q + rest for q, rest in zip(aero.resting(name), parts[""], strict=True)]
        for other in "fe":
            parts[other][0] -= stiffness[mode + other]
        values = Bladewise(parts).at_blades(sheet, f"q_{mode}")
        by_flap, by_edge = (
            sheet.let(
                f"{name}_{other}",
                aero.pressure * TABLE[f"{name}_{other}"] - (damping[mode] if other == name else 0),
            )
            for other in ("flap", "edge")
        )
        for i in (1, 2, 3):
            d, g, turn = x.flap(i, 1), x.edge(i, 1), gyroscopic[i - 1]
            total = values[i - 1] + by_flap * d + by_edge * g + (turn * d if mode == "e" else -turn * g)
            out[f"{mode}{i}"] = sheet.let(f"q_{mode}{i}", total)
    return out


def factored(
    sheet: Sheet,
    keys: Sequence[str],
    mass: dict,
    force: dict,
    eliminated: Callable,
    constant: Sequence[str] = (),
) -> dict[str, sp.Expr]:
    """Accelerations of the coordinates `keys` by LDL^T of their mass matrix, less what was `eliminated` from row i and column j (or `q`,
    the right side). constant: of which coordinates, the first, the pivot depends on parameters only."""
    lower: dict[tuple[str, str], sp.Expr] = {}
    pivot: dict[str, sp.Expr] = {}
    scaled_row: dict[tuple[str, str], sp.Expr] = {}
    rhs: dict[str, sp.Expr] = {}
    for r, i in enumerate(keys):
        right = sheet.let(f"r_{i}", force[i] - eliminated(i, "q"))
        for j in keys[: r + 1]:
            m_ij = mass[i + j] if i + j in mass else mass[j + i]
            s_ij = m_ij - eliminated(i, j)
            s_ij = sheet.constant(s_ij) if i == j and i in constant else sheet.let(f"s_{i}{j}", s_ij)
            for k in keys[: keys.index(j)]:
                s_ij = s_ij - lower[i, k] * scaled_row[j, k]
            if i != j:
                scaled_row[i, j] = sheet.let(f"v_{i}{j}", s_ij)
                lower[i, j] = sheet.let(f"l_{i}{j}", scaled_row[i, j] * pivot[j])
            elif i in constant:
                pivot[i] = sheet.constant(1 / s_ij)
            else:
                pivot[i] = sheet.let(f"inv_{i}", 1 / s_ij)
        for j in keys[:r]:
            right = right - lower[i, j] * rhs[j]
        rhs[i] = sheet.let(f"z_{i}", right)
    x: dict[str, sp.Expr] = {}
    for r in range(len(keys) - 1, -1, -1):
        i = keys[r]
        x[i] = sheet.let(f"x_{i}", rhs[i] * pivot[i] - sum(lower[j, i] * x[j] for j in keys[r + 1 :]))
    return x


def solve(sheet: Sheet, mass: dict, force: dict, b_ff, b_fe) -> dict[str, sp.Expr]:
    """Block elimination of the flap coordinates (their block is b_ff times unity), then LDL^T of the 4 x 4 rest."""
    inverse = sheet.constant(1 / b_ff)
    keys, blades = ("e", "p", "a", "s"), (1, 2, 3)
    # the coupling to edge and rotor is the same for all blades
    column = {i: [mass[f"f{n}{i}"] for n in blades] for i in ("a", "s")} | {"e": b_fe, "p": mass["f1p"]}
    flap = [force[f"f{n}"] for n in blades]

    def shared(i: str) -> bool:
        return not isinstance(column[i], list)

    total = {i: sheet.let(f"sum_{i}", sum(column[i])) for i in ("a", "s")} | {
        "q": sheet.let("sum_q", sum(flap))
    }
    scaled = {"e": sheet.constant(inverse * b_fe), "p": sheet.let("y_p", inverse * column["p"])}

    def eliminated(i: str, j: str) -> sp.Expr:
        """What the flaps take from row i, column j (or `q`, the right side)."""
        other = flap if j == "q" else column[j]
        if shared(i):
            return scaled[i] * total[j] if isinstance(other, list) else 3 * scaled[i] * other
        if isinstance(other, list):
            return inverse * sum(x * y for x, y in zip(column[i], other, strict=True))
        return eliminated(j, i)

    x = factored(sheet, keys, mass, force, eliminated, constant=("e",))
    common = sheet.let("x_common", b_fe * x["e"] + column["p"] * x["p"])
    for n in blades:
        coupling = sum(column[k][n - 1] * x[k] for k in ("a", "s"))
        x[f"f{n}"] = sheet.let(f"x_f{n}", inverse * (flap[n - 1] - common - coupling))
    return x


def solve_own_edges(sheet: Sheet, mass: dict, force: dict, b_ff, b_fe, b_ee) -> dict[str, sp.Expr]:
    """Block elimination of each blade's flap and edge (blocks that are the same constant for all), then LDL^T of the 3 x 3 rest.

    With the edge rows less `ratio` times the flap rows a block is diagonal.
    """
    keys, blades = ("p", "a", "s"), (1, 2, 3)
    ratio = sheet.constant(b_fe / b_ff)
    weight = {"f": sheet.constant(1 / b_ff), "e": sheet.constant(1 / (b_ee - b_fe**2 / b_ff))}

    def rows(of) -> dict[str, list[sp.Expr]]:
        flap, edge = ([of(f"{mode}{n}") for n in blades] for mode in "fe")
        return {"f": flap, "e": [y - ratio * x for x, y in zip(flap, edge, strict=True)]}

    column = {k: rows(lambda name, k=k: mass[name + k]) for k in keys} | {"q": rows(lambda name: force[name])}
    for k, found in column.items():
        found["e"] = [sheet.let(f"own_{k}{n}", x) for n, x in zip(blades, found["e"], strict=True)]

    def eliminated(i: str, j: str) -> sp.Expr:
        """What the blades take from row i, column j (or `q`, the right side)."""
        return sum(
            weight[mode] * sum(x * y for x, y in zip(column[i][mode], column[j][mode], strict=True))
            for mode in "fe"
        )

    x = factored(sheet, keys, mass, force, eliminated)
    for n in blades:
        flap, edge = (
            weight[mode] * (column["q"][mode][n - 1] - sum(column[k][mode][n - 1] * x[k] for k in keys))
            for mode in "fe"
        )
        x[f"e{n}"] = sheet.let(f"x_e{n}", edge)
        x[f"f{n}"] = sheet.let(f"x_f{n}", flap - ratio * x[f"e{n}"])
    return x


# --- load channels -----------------------------------------------------------------------------------------------------


def full_motion(m: Motion, sheet: Sheet, name: str, spin_rate: sp.Expr | int = 0) -> Motion:
    """The same motion with the actual accelerations in `acceleration` and `spin`; `spin_rate`: extra spin about x."""
    add, sdd = tower(sheet, 2)
    spin = m.spin + m.w_a * add + m.w_s * sdd + sp.Matrix([spin_rate, 0, 0])
    return Motion(
        m.t_a, m.t_s, m.w_a, m.w_s, m.omega,
        sheet.let_vector(f"{name}_full", m.acceleration + m.t_a * add + m.t_s * sdd),
        sheet.let_vector(f"{name}_fullspin", spin),
    )  # fmt: skip


def blade_inertia(
    sheet: Sheet, own: Motion, b: Blade, rates: tuple[sp.Symbol, sp.Symbol], number: int | str = ""
) -> tuple[sp.Matrix, sp.Matrix]:
    """Inertia plus weight of a blade: force, and moment about the apex; `own`: motion of the hub in the blade's axes, rates: (f'', e'')."""
    first = sheet.let_vector(f"bs{number}", b.first_moment())
    inertia = let_symmetric(sheet, f"bi{number}", inertia_of(b.second_moment()))
    inertia_rate = let_symmetric(sheet, f"bid{number}", b.rate(inertia_of(b.second_moment())))
    l_f, l_e = b.angular("f"), b.angular("e")
    p_f, p_e = (sp.diff(b.first_moment(), x) for x in (b.f, b.e))
    force, moment = body_force(
        sheet, f"blade{number}", own, P["b_m"], first, b.rate(b.first_moment()), b.first_moment_rate2(),
        inertia, inertia_rate * own.omega, l_f * b.fd + l_e * b.ed,
    )  # fmt: skip
    fdd, edd = rates
    return force + p_f * fdd + p_e * edd, moment + l_f * fdd + l_e * edd


def blade_root(
    sheet: Sheet, aero: Aerodynamics, m: Motion, number: int
) -> tuple[sp.Matrix, sp.Matrix, sp.Matrix]:
    """One blade's force and moment about the apex on the hub, and its moment about the root, in coned axes."""
    b = blade_symbols(sheet, number)
    rates = sheet.states.flap(number, 2), sheet.states.edge(number, 2)
    force, moment = blade_inertia(sheet, carried_blade(sheet, m, number), b, rates, number)
    pressure, pressure_r = aero.pressure, aero.pressure * P["radius"]
    aero_force = sp.Matrix([aero.load("thrust", number), -aero.load("tangential", number), 0]) * pressure
    aero_moment = sp.Matrix([aero.load("torque", number), aero.load("bending", number), 0]) * pressure_r
    force = sheet.let_vector(f"blade{number}_net", aero_force - force)
    moment = sheet.let_vector(f"blade{number}_netm", aero_moment - moment)
    return force, moment, moment - cross([0, 0, P["b_root"]], force)


def carried_blade(sheet: Sheet, m: Motion, number: int) -> Motion:
    """The hub's motion in a blade's coned axes."""
    return Motion(
        m.t_a, m.t_s, m.w_a, m.w_s,
        coned(sheet, "lw", m.omega, number),
        coned(sheet, "lg", m.acceleration, number),
        coned(sheet, "lsp", m.spin, number),
    )  # fmt: skip


def rotor_load(m: Motion, blades: Sequence[tuple[sp.Matrix, sp.Matrix]]) -> tuple[sp.Matrix, sp.Matrix]:
    """Force and moment about the apex of hub and blades, in F, from those of the blades in their coned axes; m: as `full_motion`."""
    hub_tensor = sp.diag(P["h_ixx"], P["h_itt"], P["h_itt"])
    force = -P["h_m"] * m.acceleration
    moment = -(hub_tensor * m.spin + cross(m.omega, hub_tensor * m.omega))
    for number, (f, mom) in enumerate(blades, start=1):
        force, moment = force + from_blade(f, number), moment + from_blade(mom, number)
    return force, moment


def from_blade(v, number: int) -> sp.Matrix:
    """Coned axes -> F."""
    c, s = BLADE_AZIMUTH[number - 1]
    return rot_x_t(c, -s, cone(v))


def load_channels(
    states: States = T2B1I1CG, harmonics: bool = False, controlled: bool = False
) -> tuple[Sheet, dict[str, sp.Expr]]:
    """Loads by their channel names from states and wind, on the sheet of their accelerations, whose flow and look-ups they share;
    harmonics and controlled as in `accelerations`."""
    moved = accelerations(states, harmonics, controlled)
    sheet, top, m, aero = moved.sheet, moved.top, moved.hub, moved.aero
    sheet.lines += zip(states.symbols(2), moved.accelerations, strict=True)
    phidd = states.of("phi", 2)
    rotating = full_motion(m, sheet, "hub", phidd)
    out: dict[str, sp.Expr] = {}
    blades = []
    cp, spitch = P["cos_pitch"], P["sin_pitch"]
    for number in (1, 2, 3):
        f, mom, root = blade_root(sheet, aero, rotating, number)
        blades.append((f, mom))
        # section axes turn with the pitch about e3, towards feather
        out[f"blade{number}_root_edgewise_moment"] = cp * root[0] - spitch * root[1]
        out[f"blade{number}_root_flapwise_moment"] = spitch * root[0] + cp * root[1]
        b = blade_symbols(sheet, number)
        out[f"blade{number}_tip_out_of_plane"] = P["b_tip_fx"] * b.f + P["b_tip_ex"] * b.e
        out[f"blade{number}_tip_in_plane"] = P["b_tip_fy"] * b.f + P["b_tip_ey"] * b.e
    force, moment = rotor_load(rotating, blades)
    force = sheet.let_vector("rotor_force", force)
    moment = sheet.let_vector("rotor_moment", moment)
    out |= tower_base(sheet, top, force, moment)[0]
    out["generator_torque"] = torque = generator_torque(sheet, controlled)
    out["low_speed_shaft_torque"] = shaft_torque(sheet, torque) + rigid_inertia(sheet) * phidd
    out["rotor_thrust"] = sheet.constant(3 * P["cos_cone"]) * aero.mean("thrust") * aero.pressure
    out["tower_top_fore_aft_acceleration"], out["tower_top_side_side_acceleration"] = tower(sheet, 2)
    return sheet, out


def tower_base(
    sheet: Sheet, top: Motion, force: sp.Matrix, moment: sp.Matrix
) -> tuple[dict[str, sp.Expr], sp.Matrix]:
    """Tower-base moments from the rotor's force and moment about the apex (in F), nacelle, generator and tower; and the force on the
    tower's top, in I."""
    a, s = tower(sheet)
    add, sdd = tower(sheet, 2)

    def to_n(v):
        x, y, z = rot_x_t(COSINE, -SINE, v)
        return sp.Matrix(rot_y_t(P["cos_tilt"], P["sin_tilt"], [x, y, z]))

    force_n, moment_n = sheet.let_vector("rf_n", to_n(force)), sheet.let_vector("rm_n", to_n(moment))
    moment_n = moment_n + cross(apex_arm(sheet), force_n)
    arm = sp.Matrix([P["n_x"], P["n_y"], P["n_z"]])
    nacelle = full_motion(offset(sheet, "nacl", top, arm), sheet, "nacl")
    tensor = sp.diag(P["n_ixx"], P["n_iyy"], P["n_izz"])
    weight = sheet.let_vector("nac_force", -P["n_m"] * nacelle.acceleration)
    force_n = sheet.let_vector("top_force", force_n + weight)
    turning = tensor * nacelle.spin + cross(nacelle.omega, tensor * nacelle.omega)
    # the generator's housing carries the torque that does not accelerate its rotor
    shaft_axis = sp.Matrix([P["cos_tilt"], 0, P["sin_tilt"]])
    generator = shaft_axis * (P["g_i"] * sheet.states.of("gen", 2))
    moment_n = sheet.let_vector("top_moment", moment_n + cross(arm, weight) - turning - generator)
    cos_a, sin_a, cos_r, sin_r = sp.symbols("pitch_cos pitch_sin roll_cos roll_sin", real=True)

    def to_inertial(v):
        x, y, z = rot_x_t(cos_r, -sin_r, v)
        return rot_y(cos_a, sin_a, [x, y, z])

    force_i = sheet.let_vector("base_force", to_inertial(force_n))
    drop = (P["t_short_fa"] * a * a + P["t_short_ss"] * s * s) / 2
    base = to_inertial(moment_n) + cross([a, s, P["t_h"] - drop], force_i)
    g = P["gravity"]
    return {
        "tower_base_fore_aft_moment": base[1] - P["t_zfa"] * add + g * P["t_fa"] * a,
        "tower_base_side_side_moment": base[0] + P["t_zss"] * sdd - g * P["t_ss"] * s,
    }, force_i


# --- what the loads of sections are made of: plain functions over arrays, the same for the whole family -----------------


def hub_motion() -> tuple[Sheet, dict[str, sp.Expr]]:
    """How the hub moves, in F and in the blades' coned axes, and what wind the blades meet; by the names of `section_loads`."""
    sheet = Sheet()
    top = tower_top(sheet)
    m = hub(sheet, top)
    aero = inflow(sheet, m, harmonics=True)
    moving = full_motion(m, sheet, "hub", sheet.states.of("phi", 2))
    out = {"tip_speed_ratio": TIP_SPEED_RATIO, "pressure": aero.pressure, "normal": aero.normal}
    mean, *uniform = aero.uniform
    out["w_mean"] = mean
    for key, part in (("kappa", aero.kappa), ("y", aero.inplane), ("skew", aero.skew), ("w", uniform)):
        out |= {f"{key}_cos": part[0], f"{key}_sin": part[1]}
    seen = {"": moving} | {f"{number}": carried_blade(sheet, moving, number) for number in (1, 2, 3)}
    for place, motion in seen.items():
        for name in ("omega", "acceleration", "spin"):
            out |= {f"{name}{place}_{axis}": x for axis, x in zip("xyz", getattr(motion, name), strict=True)}
    return sheet, out


def _vector(name: str) -> sp.Matrix:
    return sp.Matrix([sp.Symbol(f"{name}_{axis}", real=True) for axis in "xyz"])


def section_blade() -> tuple[Sheet, dict[str, sp.Expr]]:
    """Inertia plus weight of the part of a blade whose mass integrals are given: force and moment about the apex."""
    sheet, none = Sheet(), sp.zeros(3, 1)
    own = Motion(none, none, none, none, _vector("omega"), _vector("acceleration"), _vector("spin"))
    b = blade_symbols(sheet)
    force, moment = blade_inertia(sheet, own, b, sp.symbols("fdd edd", real=True))
    named = zip("xyz", force, moment, strict=True)
    return sheet, {
        f"{what}_{axis}": x
        for axis, *pair in named
        for what, x in zip(("force", "moment"), pair, strict=True)
    }


def section_tower() -> tuple[Sheet, dict[str, sp.Expr]]:
    """Tower-base moments and the force on the tower's top from the forces and moments of the blades and the motion of the hub in F."""
    sheet, none = Sheet(), sp.zeros(3, 1)
    top = tower_top(sheet)
    moving = Motion(none, none, none, none, _vector("omega"), _vector("acceleration"), _vector("spin"))
    force, moment = rotor_load(
        moving, [(_vector(f"force{number}"), _vector(f"moment{number}")) for number in (1, 2, 3)]
    )
    out, at_top = tower_base(
        sheet, top, sheet.let_vector("rotor_force", force), sheet.let_vector("rotor_moment", moment)
    )
    return sheet, out | {f"force_{axis}": x for axis, x in zip("xyz", at_top, strict=True)}
