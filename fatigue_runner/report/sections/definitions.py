"""What every figure of the report rests on, spelled out."""

from __future__ import annotations

from collections.abc import Mapping

from fatigue_runner.channels import BY_NAME
from fatigue_runner.report.blocks import Definitions, Section
from fatigue_runner.report.rundata import Run
from fatigue_runner.results.life_words import place_label
from fatigue_runner.results.relevance import FLOOR

ORDER = 90

RESIDUES = {
    "half": "counted as half cycles",
    "full": "counted as full cycles",
    "drop": "left out",
}


def build(run: Run) -> Section:
    """The definitions with this run's settings in them."""
    items = [
        ("Damage-equivalent load (DEL)", _del(run)),
        ("Counting", _counting(run)),
        (
            "Wöhler exponents",
            f"m = {', '.join(f'{m:g}' for m in sorted({m for _, m, _ in run.columns}))}; every exponent on "
            "the same ranges.",
        ),
        ("Channels", _channels(run)),
        ("Model", _model(run)),
        (
            "DEL error",
            "(DEL − DEL_ref) / DEL_ref of the same wind. An error e of the load is about m·e of the damage. Where DEL_ref is below "
            f"{FLOOR:.0%} of the largest mean load or DEL at the same place (tower base, blade root), verdicts and tables here take the "
            "error over that instead: it matters to nobody. results.csv has it over DEL_ref always.",
        ),
        (
            "Damage ratio",
            "(DEL / DEL_ref)ᵐ of the same wind: the damage with this integrator over that of the reference.",
        ),
        ("Reference", _reference(run)),
        (
            "NRMSE",
            "Root mean square of (state − reference) over the output samples, over the range (max − min) of "
            "the reference state; the headline is the worst of all states.",
        ),
        (
            "Cost",
            "Evaluations of the equations of motion per simulated second, and the wall-clock time of the "
            "compiled integration alone: no start-up, no log, no counting.",
        ),
        (
            "Divergence",
            "A case whose state leaves all physical bounds ends there; it is logged up to that time and "
            "takes no part in any load.",
        ),
        ("Sampling", _sampling(run)),
        *_life(run),
    ]
    return Section("Definitions", [Definitions([(term, meaning) for term, meaning in items if meaning])])


def _life(run: Run) -> list[tuple[str, str]]:
    life = run.life
    if life is None:
        return []
    section = life.section
    walls = [
        f"{place_label(str(entry.get('place')))}: {_curve(entry.get('curve'))}, stress × {float(entry.get('stress_concentration', 1)):g} "
        f"(concentration) × {float(entry.get('safety_factor', 1)):g} (safety)"
        for entry in run.setting("fatigue.damage", [])
    ]
    found = [
        (
            "Lifetime DEL",
            "(Σ pⱼ T Lⱼᵐ / N_eq)^(1/m) over the winds j: Lⱼ the short-term DEL, pⱼ the probability of its bin shared by the winds in it, "
            f"T = {section.years:g} years of 8760 h × availability {section.availability:g} in seconds, N_eq = {section.n_eq:g}. A power "
            "sum, never a mean of DELs. Bins from the distribution function.",
        ),
        (
            "Seeds' interval",
            f"The winds of every bin drawn anew with replacement {section.resamples} times (bootstrap, a fixed seed): "
            f"{section.confidence:.0%} of the lives lie within it. It knows other seeds of this wind, not other models or climates.",
        ),
    ]
    if walls:
        said = (
            "σ(a) = (Mₓ sin a − M_y cos a) / W on the section's circle, every azimuth counted by itself; Miner's sum Σ n / N(S), 1 is "
            "failure."
        )
        found.append(
            ("Damage of a section", f"{said} {'; '.join(walls)}. Sources of the curves: docs/fatigue.md.")
        )
    return found


def _curve(curve: object) -> str:
    if not isinstance(curve, Mapping):
        return f"curve {curve}"
    if "laminate" in curve:
        return (
            f"{curve['laminate']} laminate, {curve.get('tension')}/{curve.get('compression')} MPa, factors "
            f"{curve.get('mean_factor', 1)} on the mean and {curve.get('amplitude_factor', 1)} on the amplitude"
        )
    return f"a curve of the campaign, m = {curve.get('exponents')} through {curve.get('stress')} MPa"


def _counted(run: Run) -> float | None:
    duration = run.setting("duration")
    return None if duration is None else float(duration) - float(run.setting("discard", 0.0))


def _del(run: Run) -> str:
    counted = _counted(run)
    cycles = "" if counted is None else f" = {counted:g} cycles"
    return (
        "DEL = (Σ nᵢ Sᵢᵐ / N_eq)^(1/m): the constant load range S that in N_eq cycles does the damage of "
        "all counted ranges Sᵢ (peak to peak), nᵢ times each. Short-term: N_eq = 1 Hz × counted "
        f"duration{cycles}."
    )


def _counting(run: Run) -> str:
    residue = str(run.setting("fatigue.residue", "half"))
    return (
        "Rainflow, three-point, as ASTM E1049; ranges unbinned, no mean-stress correction; the residue is "
        f"{RESIDUES.get(residue, residue)}."
    )


def _channels(run: Run) -> str:
    channels = dict.fromkeys(channel for channel, _, _ in run.columns)
    named = [BY_NAME[c].label if c in BY_NAME else c for c in channels]
    axes = " Axes and signs as OpenFAST's RootMyb/RootMxb (blade root) and TwrBsMyt/TwrBsMxt (tower base)."
    return f"{', '.join(named)}.{axes}" if named else ""


def _model(run: Run) -> str:
    """Which bodies move, by the states whose errors the table has."""
    states = {
        str(name).removeprefix("nrmse_")
        for row in run.rows[:1]
        for name in row
        if str(name).startswith("nrmse_")
    }
    if "tower_fore_aft" not in states:
        return ""
    edge = "one edge mode of each" if "blade1_edge" in states else "one edge mode that the blades share"
    own = sorted(states & {"filtered_generator_speed", "speed_error_integral", "pitch_actuator_angle"})
    steered = {
        "controlled": "under the controller of its file (pitch and torque)",
        "torque-law": "under its controller's torque at fine pitch",
    }.get(str(run.setting("operation", "fixed")), "at a fixed pitch")
    name = run.fact("turbine") or run.setting("turbine", "The turbine")
    return (
        f"{name} {steered}: a bending mode of the tower fore-aft and side-side, a flap mode of each blade, {edge}, rotor and "
        f"generator{', states of the controller' if own else ''}; quasi-steady blade-element momentum theory from tables. Left out: "
        "higher modes, torsion, yaw, foundation, dynamic stall and wake; docs/model.md says what that costs."
    )


def _reference(run: Run) -> str:
    if run.reference is None:
        return "None was run."
    agreement = run.fact("reference_agreement")
    return (
        f"{run.reference.label}: the same wind, initial state, turbine and compiled kernel; only the "
        "integrator differs. What the reference itself gets wrong is in no figure here"
        + (f"; how far it can be trusted: {agreement}." if agreement else ".")
    )


def _sampling(run: Run) -> str:
    parts = []
    if run.setting("output_rate") is not None:
        parts.append(
            f"States and loads are taken at {float(run.setting('output_rate')):g} Hz, whatever the step."
        )
    if run.setting("duration") is not None:
        discard = float(run.setting("discard", 0.0))
        parts.append(
            f"Each case lasts {float(run.setting('duration')):g} s; "
            + (
                f"the first {discard:g} s are discarded."
                if discard
                else "nothing is discarded from its start."
            )
        )
    if run.setting("initial") is not None:
        initial = run.setting("initial")
        parts.append(f"Initial state: {initial if isinstance(initial, str) else 'as given in the campaign'}.")
    return " ".join(parts)
