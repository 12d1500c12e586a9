"""The equations for a pitch that varies in time: what turns with the blades becomes a function of each lane's own pitch.

Quasi-steady: the modes, the section axes and the aerodynamic coefficients are those of the momentary pitch; pitch rate and
acceleration are neglected (the 5-MW's fastest rate, 8 deg/s, moves the tip's trailing edge by a few per cent of the tip speed).
Every mass integral is a first or second harmonic of the pitch, so that every constant which depends on it is, too.
"""

from __future__ import annotations

import sympy as sp

from fatigue_runner.turbine.derivation.equations import P, Sheet, sin_cos_small

PITCH = sp.Symbol("theta", real=True)  # [rad], positive to feather
HARMONICS = sp.symbols(
    "theta_c theta_s theta_cc theta_ss", real=True
)  # cos, sin of the pitch and of twice the pitch


def turned_parameters() -> dict[sp.Symbol, sp.Expr]:
    """The parameters that turn with the pitch in terms of those at zero pitch, as `turbine.parameters.at_pitch`."""
    c, s, cc, ss = HARMONICS
    out = {P["cos_pitch"]: c, P["sin_pitch"]: s}
    for stem in ("b_f", "b_e", "b_rf", "b_re", "b_tip_f", "b_tip_e"):
        x, y = P[f"{stem}x"], P[f"{stem}y"]
        out |= {x: c * x + s * y, y: c * y - s * x}
    for a, b in (("f", "f"), ("e", "e"), ("f", "e")):
        xx, yy, xy = P[f"b_{a}x{b}x"], P[f"b_{a}y{b}y"], P[f"b_{a}x{b}y"]
        yx = xy if a == b else P[f"b_{a}y{b}x"]
        mean, difference = (xx + yy) / 2, (xx - yy) / 2
        even, odd = (xy + yx) / 2, (xy - yx) / 2
        out |= {
            xx: mean + difference * cc + even * ss,
            yy: mean - difference * cc - even * ss,
            xy: odd + even * cc - difference * ss,
        }
        if a != b:
            out[yx] = -odd + even * cc - difference * ss
    return out


def with_varying_pitch(sheet: Sheet, outputs: dict[int, sp.Expr]) -> tuple[Sheet, dict[int, sp.Expr]]:
    """The same equations with the pitch as an input: a new sheet, whose constants are those of zero pitch."""
    new = Sheet()
    turned = turned_parameters()
    sine, cosine = sin_cos_small(new, "theta_half", PITCH / 2)
    s = sp.Symbol("theta_s", real=True)
    c, _, cc, ss = HARMONICS
    new.lines += [(s, 2 * sine * cosine), (c, 1 - 2 * sine * sine), (ss, 2 * s * c), (cc, 1 - 2 * s * s)]
    known: dict[sp.Symbol, sp.Expr] = {}
    for symbol, expr in sheet.constants.items():
        varying = sp.expand(expr.xreplace(turned).xreplace(known))
        if varying.free_symbols & set(HARMONICS):
            known[symbol] = new.let(f"{symbol}_turned", new.collect(varying))
        else:
            known[symbol] = new.constant(expr.xreplace(known))
    for symbol, expr in turned.items():
        known[symbol] = new.let(f"{symbol}_turned", new.collect(expr)) if expr not in HARMONICS else expr
    new.lines += [(s, e.xreplace(known)) for s, e in sheet.lines]
    return new, {i: e.xreplace(known) for i, e in outputs.items()}
