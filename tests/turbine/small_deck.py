"""A small OpenFAST deck of round numbers, written as different versions and different hands write one; nobody's turbine."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

POLAR_ANGLES = (-180, -90, -20, -10, 0, 8, 14, 20, 90, 180)
LIFT = (0.0, 0.0, -0.6, -0.9, 0.4, 1.2, 1.4, 1.1, 0.0, 0.0)
DRAG = (0.02, 1.3, 0.2, 0.02, 0.01, 0.011, 0.05, 0.3, 1.3, 0.02)


def columns(*names: str, rows: list[tuple[float, ...]]) -> str:
    head = " ".join(f"{name:>14}" for name in names) + "\n" + " ".join(f"{'(-)':>14}" for _ in names) + "\n"
    return (
        head
        + "\n".join(
            " ".join(f"{value:14.7E}" if isinstance(value, float) else f"{value:>14}" for value in row)
            for row in rows
        )
        + "\n"
    )


def entry(value: object, key: str, dash: bool = True) -> str:
    return f"{value!s:<24}{key:<14}{'- ' if dash else ''}what it is (unit)\n"


def fst(version: int, **change: object) -> str:
    # what versions call the kinds of CompAero did not change for AeroDyn 15
    values = {
        "CompElast": 1, "CompInflow": 1, "CompAero": 2, "CompServo": 1, "CompHydro": 0, "CompSub": 0, "CompMooring": 0, "MHK": 0,
        "Gravity": 9.81, "AirDens": 1.2, "EDFile": '"small_ElastoDyn.dat"', "InflowFile": '"small_Inflow.dat"',
        "AeroFile": '"small_AeroDyn.dat"', "ServoFile": '"small_ServoDyn.dat"',
    } | change  # fmt: skip
    extra = {
        3: "",
        5: entry(1, "ModCoupling")
        + entry("1.0", "RhoInf")
        + entry(1, "NRotors")
        + entry("False", "MirrorRotor"),
    }[version]
    return (
        "------- OpenFAST INPUT FILE ----\nA small turbine, NumBl 7 of which is nonsense\n"
        + extra
        + "".join(entry(value, key) for key, value in values.items())
    )


def elastodyn(version: int, **change: object) -> str:
    index = "(1)" if version == 5 else "1"
    values: dict[str, object] = {
        "FlapDOF1": "True", "FlapDOF2": "True", "EdgeDOF": "True", "DrTrDOF": "False", "GenDOF": "True", "YawDOF": "False",
        "TwFADOF1": "True", "TwSSDOF1": "True", "PtfmHvDOF": "False", "BlPitch(1)": 0.01745,
        "NumBl": 3, "TipRad": 32.0, "HubRad": 2.0, "PreCone(1)": -2.0, "PreCone(2)": -2.0, "PreCone(3)": -2.0, "HubCM": 0.0,
        "OverHang": -3.5, "ShftTilt": -4.0, "NacCMxn": 1.0, "NacCMyn": -0.1, "NacCMzn": 1.0, "Twr2Shft": 1.5, "TowerHt": 60.0,
        "TowerBsHt": 0.0, "TipMass(1)": 0.0, "HubMass": 9000.0, "HubIner": 2.0e4, "GenIner": 60.0, "NacMass": 4.0e4,
        "NacYIner": 4.0e5, "YawBrMass": 1000.0, "BldNodes": 10, f"BldFile{index}": '"small_blade.dat"',
        "GBoxEff": 95.0, "GBRatio": 80.0, "DTTorSpr": 1.0e8, "DTTorDmp": 1.0e6, "TwrNodes": 10, "TwrFile": '"small_tower.dat"',
    } | change  # fmt: skip
    return "------- ELASTODYN INPUT FILE ----\nGenerated with a pen\n" + "".join(
        entry(value, key) for key, value in values.items()
    )


def blade(version: int, modes: bool = True, **change: object) -> str:
    values: dict[str, object] = {
        "NBlInpSt": 5,
        "BldFlDmp(1)": 1.0,
        "BldFlDmp(2)": 1.0,
        "BldEdDmp(1)": 1.0,
        "FlStTunr(1)": 1.0,
        "AdjBlMs": 1.0,
        "AdjFlSt": 1.0,
        "AdjEdSt": 1.0,
    } | change
    x = np.linspace(0, 1, 5)
    names = [
        "BlFract",
        *(["PitchAxis"] if version == 3 else []),
        "StrcTwst",
        "BMassDen",
        "FlpStff",
        "EdgStff",
    ]
    rows = [
        (
            float(a),
            *([0.3] if version == 3 else []),
            float(10 * (1 - a)),
            float(300 - 270 * a),
            float(2e9 * (1.001 - a) ** 2 + 1e6),
            float(4e9 * (1.001 - a) ** 2 + 5e6),
        )
        for a in x
    ]
    text = "------- ELASTODYN BLADE INPUT FILE ----\nA small blade\n" + "".join(
        entry(v, k) for k, v in values.items()
    )
    text += (
        "---- DISTRIBUTED BLADE PROPERTIES ----\n"
        + columns(*names, rows=rows)
        + "---- BLADE MODE SHAPES ----\n"
    )
    for stem in ("BldFl1Sh", "BldFl2Sh", "BldEdgSh") if modes else ():
        text += "".join(
            entry(v, f"{stem}({p})") for p, v in zip(range(2, 7), (0.5, 0.9, -0.6, 0.3, -0.1), strict=True)
        )
    return text


def tower(**change: object) -> str:
    values: dict[str, object] = {
        "NTwInpSt": 3,
        "TwrFADmp(1)": 1.0,
        "TwrSSDmp(1)": 1.0,
        "FAStTunr(1)": 1.0,
        "SSStTunr(1)": 1.0,
        "AdjTwMa": 1.0,
        "AdjFASt": 1.0,
        "AdjSSSt": 1.0,
    } | change
    text = "------- ELASTODYN TOWER INPUT FILE ----\nA small tower\n" + "".join(
        entry(v, k) for k, v in values.items()
    )
    rows = [(a, 3000 - 1500 * a, 6e10 * (1 - 0.7 * a), 6e10 * (1 - 0.7 * a)) for a in (0.0, 0.5, 1.0)]
    text += columns("HtFract", "TMassDen", "TwFAStif", "TwSSStif", rows=rows)
    for stem in ("TwFAM1Sh", "TwSSM1Sh"):
        text += "".join(
            entry(v, f"{stem}({p})") for p, v in zip(range(2, 7), (0.9, 0.3, -0.3, 0.2, -0.1), strict=True)
        )
    return text


def aerodyn(version: int, **change: object) -> str:
    wake = (
        {"Wake_Mod": 1, "UA_Mod": 0, "Skew_Mod": 1}
        if version == 5
        else {"WakeMod": 1, "AFAeroMod": 2, "SkewMod": 2}
    )
    values: dict[str, object] = {
        **wake,
        "TwrPotent": 1,
        "TwrShadow": 0,
        "TwrAero": "True",
        "AirDens": '"default"',
        "TipLoss": "True",
        "HubLoss": "True",
        "TanInd": "True",
        "AIDrag": "True",
        "InCol_Alfa": 1,
        "InCol_Cl": 2,
        "InCol_Cd": 3,
        "NumAFfiles": 2,
    } | change
    text = "------- AERODYN INPUT FILE ----\nA small rotor\n" + "".join(
        entry(v, k) for k, v in values.items()
    )
    text += '"Airfoils/round.dat"    AFNames            - Airfoil file names\n"Airfoils/thin.dat"\n'
    text += (
        entry("True", "UseBlCm")
        + entry('"small_AeroBlade.dat"', "ADBlFile(1)")
        + entry('"small_AeroBlade.dat"', "ADBlFile(2)")
    )
    text += entry(2, "NumTwrNds") + columns(
        "TwrElev", "TwrDiam", "TwrCd", rows=[(0.0, 4.0, 0.5), (60.0, 2.5, 0.5)]
    )
    return text


def aero_blade(**change: object) -> str:
    """Keys are columns of the table, values functions of the span fraction."""
    x = np.array([0.0, 0.1, 0.3, 0.6, 0.985, 1.0])
    shape: dict[str, Callable[[float], float]] = {
        "BlSpn": lambda a: 30.0 * a, "BlCrvAC": lambda a: 0.0, "BlSwpAC": lambda a: 0.0, "BlCrvAng": lambda a: 0.0,
        "BlTwist": lambda a: 12.0 * (1 - a), "BlChord": lambda a: 2.4 - 1.6 * a,
    }  # fmt: skip
    shape |= change  # type: ignore[arg-type]
    rows = [(*(float(f(float(a))) for f in shape.values()), 1 if a < 0.2 else 2) for a in x]
    return (
        "------- AERODYN BLADE FILE ----\nA small blade\n"
        + entry(len(x), "NumBlNds")
        + columns(*shape, "BlAFID", rows=rows)
    )


def airfoil(lift: bool, *more: tuple[float, float, float]) -> str:
    """more: further tables, each a Reynolds number in millions, a setting, and what lift and drag of the first are multiplied with."""
    text = "! ---- AirfoilInfo ----\n! a comment\nDEFAULT  InterpOrd  ! order\n"
    text += f'@"thin_coords.txt" NumCoords ! shape\n{1 + len(more)} NumTabs ! tables\n'
    for reynolds, setting, factor in ((0.75, 0.0, 1.0), *more):
        text += f"{reynolds} Re ! millions\n{setting:g} Ctrl ! setting\n"
        text += f"! table\n{len(POLAR_ANGLES)} NumAlf ! lines\n! Alpha Cl Cd Cm\n! (deg) (-) (-) (-)\n"
        for a, cl, cd in zip(POLAR_ANGLES, LIFT, DRAG, strict=True):
            cl, cd = (cl, cd) if lift else (0.0, 0.5)
            text += f"  {a:.2f}  {factor * cl:.4f}  {factor * cd:.4f}  0.0000\n"
    return text


def servodyn(**change: object) -> str:
    values: dict[str, object] = {
        "PCMode": 5,
        "VSContrl": 5,
        "GenEff": 94.0,
        "VS_RtGnSp": 99999.0,
        "VS_RtTq": 99999.0,
        "VS_Rgn2K": 99999.0,
        "VS_SlPc": 99999.0,
        "DLL_FileName": '"libdiscon.so"',
        "DLL_InFile": '"small_DISCON.IN"',
    } | change
    return "------- SERVODYN INPUT FILE ----\nA small controller\n" + "".join(
        entry(v, k) for k, v in values.items()
    )


def discon(**change: object) -> str:
    pitch = np.linspace(0.05, 0.4, 8)
    gain = 1 / (1 + pitch / 0.15)
    values: dict[str, object] = {
        "LoggingLevel": 1, "F_LPFType": 1, "VS_ControlMode": 3, "PC_ControlMode": 1, "PS_Mode": 1, "F_LPFCornerFreq": 1.6,
        "PC_GS_n": 8, "PC_GS_angles": " ".join(f"{v:.6f}" for v in pitch), "PC_GS_KP": " ".join(f"{-0.02 * v:.6e}" for v in gain),
        "PC_GS_KI": " ".join(f"{-0.008 * v:.6e}" for v in gain), "PC_MaxRat": 0.14, "PC_RefSpd": 200.0, "PC_FinePit": 0.0,
        "PC_Switch": 0.01745, "VS_GenEff": 94.0, "VS_MaxTq": 5500.0, "VS_MinOMSpd": 80.0, "VS_Rgn2K": 0.12, "VS_RtPwr": 940000.0,
        "VS_RtTq": 5000.0,
    } | change  # fmt: skip
    return "! Controller parameter input file\n!    - File written using a pen\n\n" + "".join(
        f"{value}  ! {key}  - what it is\n" for key, value in values.items()
    )


def write(folder: Path, version: int = 5, **files: str) -> Path:
    """A deck in `folder`; files: other texts by a file's stem without `small_`. Returns its .fst."""
    (folder / "Airfoils").mkdir(parents=True, exist_ok=True)
    texts = {
        "small.fst": fst(version), "small_ElastoDyn.dat": elastodyn(version), "small_blade.dat": blade(version),
        "small_tower.dat": tower(), "small_AeroDyn.dat": aerodyn(version), "small_AeroBlade.dat": aero_blade(),
        "Airfoils/round.dat": airfoil(lift=False), "Airfoils/thin.dat": airfoil(lift=True),
        "small_ServoDyn.dat": servodyn(), "small_DISCON.IN": discon(), "small_Inflow.dat": "------- InflowWind ----\nx\n",
    }  # fmt: skip
    for name, text in texts.items():
        stem = Path(name).stem.removeprefix("small_") if name != "small.fst" else "fst"
        (folder / name).write_text(files.get(stem, text))
    return folder / "small.fst"
