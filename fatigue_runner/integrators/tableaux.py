"""The Runge-Kutta methods as data. A new one is one more entry here, found by itself."""

from __future__ import annotations

from functools import cache

from fatigue_runner.integrators.butcher import ButcherTableau, tableau

EULER = tableau("euler", 1, [], "1", "Euler (1768)")
_RK3 = tableau(
    "rk3", 3, ["1", "1/4 1/4"], "1/6 1/6 2/3",
    "Shu & Osher (1988), doi:10.1016/0021-9991(88)90177-5; arXiv:2504.05493, example 3: shares Heun's two stages",
    b_hat="1/2 1/2 0", embedded_order=2,
)  # fmt: skip
HEUN = tableau(
    "heun",
    2,
    ["1"],
    "1/2 1/2",
    "Heun (1900); arXiv:2504.05493, example 1",
    b_hat="1 0",
    embedded_order=1,
    shared_by=_RK3,
)
RK3 = _RK3
# Heun over the step and over its two halves, extrapolated to order 3; the first evaluation is shared.
HEUN_RICHARDSON = tableau(
    "heun-richardson", 3, ["1", "1/2", "1/4 0 1/4", "1/4 0 1/4 1/2"], "1/6 -1/6 1/3 1/3 1/3",
    "Richardson (1911) applied to Heun: Hairer, Norsett & Wanner (2008), II.4, eq. 4.5; arXiv:2504.05493",
    b_hat="1/2 1/2 0 0 0", embedded_order=2,
)  # fmt: skip
BS32 = tableau(
    "bs32", 3, ["1/2", "0 3/4", "2/9 1/3 4/9"], "2/9 1/3 4/9 0", "Bogacki & Shampine (1989), doi:10.1016/0893-9659(89)90079-7",
    b_hat="7/24 1/4 1/3 1/8", embedded_order=2,
)  # fmt: skip
RK4 = tableau(
    "rk4",
    4,
    ["1/2", "0 1/2", "0 0 1"],
    "1/6 1/3 1/3 1/6",
    "Kutta (1901); Hairer, Norsett & Wanner (2008), II.1, table 1.2",
)
DP5 = tableau(
    "dp5", 5,
    ["1/5", "3/40 9/40", "44/45 -56/15 32/9", "19372/6561 -25360/2187 64448/6561 -212/729",
     "9017/3168 -355/33 46732/5247 49/176 -5103/18656", "35/384 0 500/1113 125/192 -2187/6784 11/84"],
    "35/384 0 500/1113 125/192 -2187/6784 11/84 0", "Dormand & Prince (1980), doi:10.1016/0771-050X(80)90013-3",
    b_hat="5179/57600 0 7571/16695 393/640 -92097/339200 187/2100 1/40", embedded_order=4,
)  # fmt: skip
TSIT5 = ButcherTableau(
    "tsit5", 5,
    ((0.161,), (-0.008480655492356989, 0.335480655492357), (2.8971530571054935, -6.359448489975075, 4.3622954328695815),
     (5.325864828439257, -11.748883564062828, 7.4955393428898365, -0.09249506636175525),
     (5.86145544294642, -12.92096931784711, 8.159367898576159, -0.071584973281401, -0.028269050394068383),
     (0.09646076681806523, 0.01, 0.4798896504144996, 1.379008574103742, -3.290069515436081, 2.324710524099774)),
    (0.09646076681806523, 0.01, 0.4798896504144996, 1.379008574103742, -3.290069515436081, 2.324710524099774, 0.0),
    "Tsitouras (2011), doi:10.1016/j.camwa.2011.06.002",
    b_hat=(0.09468075576583945, 0.009183565540343254, 0.4877705284247616, 1.234297566930479, -2.7077123499835256,
           1.866628418170587, 1 / 66),
    embedded_order=4,
)  # fmt: skip
RK7 = tableau(
    "rk7", 7,
    ["2/27", "1/36 1/12", "1/24 0 1/8", "5/12 0 -25/16 25/16", "1/20 0 0 1/4 1/5",
     "-25/108 0 0 125/108 -65/27 125/54",
     "31/300 0 0 0 61/225 -2/9 13/900", "2 0 0 -53/6 704/45 -107/9 67/90 3",
     "-91/108 0 0 23/108 -976/135 311/54 -19/60 17/6 -1/12",
     "2383/4100 0 0 -341/164 4496/1025 -301/82 2133/4100 45/82 45/164 18/41"],
    "41/840 0 0 0 0 34/105 9/35 9/35 9/280 9/280 41/840",
    "Fehlberg (1968), NASA TR R-287, RK7(8): the 11 stages of its 7th-order result",
)  # fmt: skip


@cache
def dop853() -> ButcherTableau:
    """Dormand & Prince's 8th-order method; the 12-stage coefficients are those of SciPy's DOP853."""
    from scipy.integrate import DOP853

    rows = tuple(tuple(float(x) for x in DOP853.A[i, :i]) for i in range(1, DOP853.n_stages))
    source = "Dormand & Prince's 8(5,3): Hairer, Norsett & Wanner (2008), II.10"
    return ButcherTableau("dop853", 8, rows, tuple(float(x) for x in DOP853.B), source)
