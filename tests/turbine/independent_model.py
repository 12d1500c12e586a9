"""The turbine's energy and accelerations written a second time, by plain numerical differentiation, to check the derived kernel.

Every mass element sits at p = sum_k a_k(r) B_k(q) with the integrals G_kl = integral a_k a_l dm; kinetic energy is
sum G_kl B_k' . B_l' / 2 and needs no frames, angular velocities or Coriolis terms. Derivatives are complex steps.
"""

from __future__ import annotations

import numpy as np

BASIS = ("1", "r", "fx", "fy", "ex", "ey", "sff", "sfe", "see")


def rot_x(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def rot_y(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


class IndependentModel:
    def __init__(self, p, own_edges=False):
        """own_edges: coordinates are then a, s, f1, f2, f3, e1, e2, e3, rotor, generator."""
        self.p = p
        self.own_edges = own_edges
        self.size = 10 if own_edges else 8
        self.cone = np.arctan2(p["sin_cone"], p["cos_cone"])
        self.tilt = np.arctan2(p["sin_tilt"], p["cos_tilt"])
        g = np.zeros((9, 9))
        names = {("1", "1"): "b_m", ("1", "r"): "b_m1", ("r", "r"): "b_m2"}
        for x in BASIS[2:]:
            names["1", x] = f"b_{x}"
            names["r", x] = f"b_r{x}"
        for i, a in enumerate(("fx", "fy", "ex", "ey")):
            for b in ("fx", "fy", "ex", "ey")[i:]:
                names[a, b] = f"b_{a}{b}"
        for (a, b), key in names.items():
            i, j = BASIS.index(a), BASIS.index(b)
            g[i, j] = g[j, i] = p[key]
        self.gram = g

    def frames(self, q):
        p = self.p
        nacelle = rot_y(p["t_slope_fa"] * q[0]) @ rot_x(-p["t_slope_ss"] * q[1])
        top = np.array(
            [q[0], q[1], p["t_h"] - (p["t_short_fa"] * q[0] ** 2 + p["t_short_ss"] * q[1] ** 2) / 2]
        )
        # the shaft points along (cos tilt, 0, sin tilt)
        shaft = nacelle @ rot_y(-self.tilt)
        apex = top + nacelle @ np.array([0, 0, p["tower_to_shaft"]]) + shaft @ np.array([p["overhang"], 0, 0])
        return top, nacelle, apex, shaft @ rot_x(q[-2])

    def blade_vectors(self, q, number):
        """B_k (9, 3) of one blade."""
        _, _, apex, rotor = self.frames(q)
        axes = rotor @ rot_x(2 * np.pi / 3 * (number - 1)) @ rot_y(self.cone)
        n1, n2, n3 = axes[:, 0], axes[:, 1], axes[:, 2]
        f, e = q[1 + number], q[4 + number if self.own_edges else 5]
        return np.array(
            [apex, n3, f * n1, f * n2, e * n1, e * n2, -(f**2) / 2 * n3, -f * e * n3, -(e**2) / 2 * n3]
        )

    def points(self, q):
        """Position-like vectors and their Gram matrices: (list of (k, 3) arrays, list of (k, k))."""
        p = self.p
        top, nacelle, apex, rotor = self.frames(q)
        arrays = [self.blade_vectors(q, i) for i in (1, 2, 3)]
        grams = [self.gram] * 3
        arrays.append((top + nacelle @ np.array([p["n_x"], p["n_y"], p["n_z"]]))[None])
        grams.append(np.array([[p["n_m"]]]))
        arrays.append(apex[None])
        grams.append(np.array([[p["h_m"]]]))
        # a rigid body's rotational energy is tr(R' D R'^T)/2 with D = tr(I)/2 - I: its axes as position-like vectors
        for axes, inertia in (
            (nacelle, (p["n_ixx"], p["n_iyy"], p["n_izz"])),
            (rotor, (p["h_ixx"], p["h_itt"], p["h_itt"])),
        ):
            arrays.append(axes.T)
            grams.append(np.diag(sum(inertia) / 2 - np.array(inertia)))
        zero = 0 * q[0]
        arrays.append(np.array([[q[0], zero, zero], [zero, q[1], zero], [q[-1], zero, zero]]))
        grams.append(np.diag([p["t_maa"], p["t_mss"], p["g_i"]]))
        return arrays, grams

    def jacobians(self, q):
        """dB/dq: list of (size, k, 3)."""
        h = 1e-30
        columns = [self.points(q + 1j * h * np.eye(self.size)[i])[0] for i in range(self.size)]
        return [np.array([c[b].imag / h for c in columns]) for b in range(len(columns[0]))]

    def mass_matrix(self, q):
        _, grams = self.points(q)
        return sum(
            np.einsum("ikx,kl,jlx->ij", j, g, j) for j, g in zip(self.jacobians(q), grams, strict=True)
        )

    def potential(self, q):
        p = self.p
        g = p["gravity"]
        arrays, _ = self.points(q)
        weight = sum(g * (self.gram[0] @ arrays[i][:, 2]) for i in range(3))
        weight += g * (p["n_m"] * arrays[3][0, 2] + p["h_m"] * arrays[4][0, 2])
        weight -= g * (p["t_gfa"] * q[0] ** 2 + p["t_gss"] * q[1] ** 2) / 2
        spring = p["t_ka"] * q[0] ** 2 + p["t_ks"] * q[1] ** 2
        edges = q[5:8] if self.own_edges else [q[5]] * 3
        for f, e in zip(q[2:5], edges, strict=True):
            spring += p["b_kf"] * f**2 + 2 * p["b_kfe"] * f * e + p["b_ke"] * e**2
        return weight + (spring + p["d_k"] * (q[-2] - q[-1] / p["g_ratio"]) ** 2) / 2

    def energy(self, x):
        """Kinetic plus potential energy [J] of a state."""
        q, v = x[: self.size], x[self.size :]
        return v @ self.mass_matrix(q) @ v / 2 + self.potential(q)

    def accelerations(self, x):
        """q'' of the free, undamped turbine."""
        q, v = x[: self.size], x[self.size :]
        h = 1e-30
        nudges = 1j * h * np.eye(self.size)
        gradient = np.array([self.potential(q + nudge).imag / h for nudge in nudges])
        # B'' at q'' = 0 by central differences of the complex-step velocity along the motion
        d = 1e-4

        def velocity(t):
            return [a.imag / h for a in self.points(q + v * t + 1j * h * v)[0]]

        ahead, behind = velocity(d), velocity(-d)
        _, grams = self.points(q)
        bias = sum(
            np.einsum("ikx,kl,lx->i", j, g, (b1 - b0) / (2 * d))
            for j, g, b1, b0 in zip(self.jacobians(q), grams, ahead, behind, strict=True)
        )
        return np.linalg.solve(self.mass_matrix(q), -gradient - bias)
