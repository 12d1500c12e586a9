"""CADynTurb's T2B1i1cG parameters (shared reference data) in this project's terms, for the comparison tests.

CADynTurb's conventions (model/T2B1i1cG in jgeisler0303/CADynTurb): cf and ce are per blade, cm and ct per rotor; the thrust acts at
2/3 R with the rest of the bending moment in cmy_D23; the in-plane force is torque / torqueForceRadius; Ftow_y = 1.5 Fwind_v v_y dcs.
"""

from __future__ import annotations

import json

import numpy as np
from places import SHARED


def parameters(data: dict) -> dict[str, float]:
    s = data["scalars"]
    g = lambda *key: s["_".join(map(str, key))]  # noqa: E731
    mass = s["blade_mass"]
    # K = integral r S dm from the two centrifugal terms: Oe1_xx = K - A_yy, Oe1_yy = K - A_xx, A_xx + A_yy = Me
    out: dict[str, float] = {}
    for i, mode in ((1, "f"), (2, "e")):
        xx, yy, me = g("blade_Oe1", i, i, 1), g("blade_Oe1", i, i, 2), g("blade_Me0", i, i)
        out[f"b_{mode}x{mode}x"] = (me + (xx - yy)) / 2
        out[f"b_{mode}y{mode}y"] = (me - (xx - yy)) / 2
        out[f"b_{mode}x{mode}y"] = g("blade_Oe1", i, i, 4) / 2
        out[f"b_rs{mode}{mode}"] = xx + out[f"b_{mode}y{mode}y"]
        out[f"b_{mode}x"], out[f"b_{mode}y"] = g("blade_Ct0", i, 1), g("blade_Ct0", i, 2)
        out[f"b_r{mode}x"], out[f"b_r{mode}y"] = g("blade_Cr0", i, 2), -g("blade_Cr0", i, 1)
    # cross terms flap-edge: Oe1_12_xx = K_fe - A_fyey, Oe1_12_yy = K_fe - A_fxex, A_fxex + A_fyey = Me_12
    xx, yy, me = g("blade_Oe1", 1, 2, 1), g("blade_Oe1", 1, 2, 2), g("blade_Me0", 1, 2)
    out["b_fxex"], out["b_fyey"] = (me + (xx - yy)) / 2, (me - (xx - yy)) / 2
    out["b_rsfe"] = xx + out["b_fyey"]
    # Oe1_12_xy = A_fxey + A_fyex; their difference is Gr/h: taken from the NREL shapes' ratio, see test
    out["sum_fxey_fyex"] = g("blade_Oe1", 1, 2, 4)
    first = 363231.0 / 17740.0 * mass + 1.5 * mass
    out |= {
        "b_m": mass, "b_m1": first, "b_m2": s["blade_I0_1_1"],
        "b_sff": -s["blade_Ct1_1_1_3"], "b_sfe": -s["blade_Ct1_1_2_3"], "b_see": 0.0,
        "b_kf": s["blade_K0_1_1"], "b_ke": s["blade_K0_2_2"], "b_kfe": 0.0,
        "b_df": s["blade_D0_1_1"], "b_de": s["blade_D0_2_2"],
        "b_tip_fx": 1.0, "b_tip_fy": 0.0, "b_tip_ex": 0.0, "b_tip_ey": 1.0, "b_root": 1.5,
        "cos_pitch": 1.0, "sin_pitch": 0.0, "cos_cone": 1.0, "sin_cone": 0.0, "cos_tilt": 1.0, "sin_tilt": 0.0,
        "h_m": s["HubMass"], "h_ixx": s["HubIner"], "h_itt": s["HubIner"],
        "overhang": s["OverHang"], "tower_to_shaft": s["Twr2Shft"],
        "n_m": s["NacMass"], "n_x": s["NacCMxn"], "n_y": s["NacCMyn"], "n_z": s["NacCMzn"],
        "n_ixx": s["NacXIner"], "n_iyy": s["NacYIner"], "n_izz": 0.0,
        "g_i": s["GenIner"], "g_ratio": s["GBRatio"], "d_k": s["DTTorSpr"], "d_d": s["DTTorDmp"],
        "t_h": 87.6, "t_maa": s["tower_Me0_1_1"], "t_mss": s["tower_Me0_2_2"],
        "t_fa": 0.0, "t_ss": 0.0, "t_zfa": 0.0, "t_zss": 0.0,
        "t_slope_fa": s["tower_frame_11_psi0_2_1"], "t_slope_ss": -s["tower_frame_11_psi0_1_2"],
        "t_short_fa": -s["tower_frame_11_phi1_1_3_1"], "t_short_ss": -s["tower_frame_11_phi1_2_3_2"],
        "t_gfa": -s["tower_Ct1_1_1_3"], "t_gss": -s["tower_Ct1_2_2_3"],
        "t_ka": s["tower_K0_1_1"], "t_ks": s["tower_K0_2_2"], "t_da": s["tower_D0_1_1"], "t_ds": s["tower_D0_2_2"],
        "gravity": s["g"], "radius": s["Rrot"], "q_area": s["rho"] * s["Arot"] / 2,
        "tg_k": 2.332287, "tg_a2": 0.0, "tg_ws": 0.0, "tg_t2": -1e9, "tg_p": 0.0, "tg_t": 1e9, "tg_e": 0.0,
    }  # fmt: skip
    total = out.pop("sum_fxey_fyex")
    # FEMBeam's Oe1_xy does not separate the two; with the modes' axes turned by the twist, A_fyex is second order: -tan^2
    out["b_fxey"], out["b_fyex"] = total, 0.0
    return out


def tables(data: dict, with_slip: bool = True) -> dict[str, np.ndarray]:
    """Coefficients (n_lambda,) at pitch 0 by this project's names. `with_slip`: CADynTurb looks dce_dve up for dcf_dve."""
    t = {k: np.asarray(v) for k, v in data["tables_at_pitch_0"].items()}
    get = lambda name: t[f"{name}_lut"]  # noqa: E731
    d = lambda name, by: t[f"d{name}_d{by}_v_lut"]  # noqa: E731
    out = {"thrust": get("ct"), "torque": get("cm"), "flap": 3 * get("cf"), "edge": 3 * get("ce")}
    out["bending"] = 2 / 3 * get("ct") + 3 * get("cmy_D23")
    for ours, theirs in (("flap", "vf"), ("edge", "ve")):
        out[f"thrust_{ours}"], out[f"torque_{ours}"] = d("ct", theirs), d("cm", theirs)
        out[f"bending_{ours}"] = 2 / 3 * d("ct", theirs)
        out[f"edge_{ours}"] = 3 * d("ce", theirs)
    out["flap_flap"] = 3 * d("cf", "vf")
    out["flap_edge"] = 3 * (d("ce", "ve") if with_slip else d("cf", "ve"))
    radius = data["scalars"]["Rrot"] / data["scalars"]["torqueForceRadius"]
    for key in ("", "_flap", "_edge"):
        out[f"tangential{key}"] = radius * out[f"torque{key}"]
    out["tangential_y"] = 3 * d("cs", "vy")
    return out


def load() -> dict:
    return json.loads((SHARED / "t2b1i1cg_params.json").read_text())
