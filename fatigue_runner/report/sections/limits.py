"""What limits the result, before the figures: lost cases, clamped look-ups, a pitch faster than its limit, winds that a corrector does not
know, missing references."""

from __future__ import annotations

from fatigue_runner.report.blocks import Section, Warnings
from fatigue_runner.report.rundata import Run
from fatigue_runner.results.beyond import beyond, no_pitch_control
from fatigue_runner.results.cells import Row, format_percent, text
from fatigue_runner.results.operation import pitch_rate_sentences
from fatigue_runner.results.ranking import LEVELS, unseen_winds

ORDER = 20
NEAR = 10.0  # times what is known of the reference: errors below are its own as likely as the integrator's
SHORT = 600.0  # s; the length of a load case in IEC 61400-1


def build(run: Run) -> Section | None:
    """The warnings of this run; None where there are none."""
    items = [
        *run.changed,
        *_unfinished(run),
        *_operation(run),
        *pitch_rate_sentences(run.rows),
        *_lost(run),
        *unseen_winds(run.summaries),
        *_uncompared(run),
    ]
    items += [*_unresolved(run), *_short(run), *_folder(run)]
    return Section("What limits this result", [Warnings(items)]) if items else None


def _unfinished(run: Run) -> list[str]:
    if not run.missing:
        return []
    return [
        f"The run is not finished: {len(run.rows)} of {run.planned} cases are there, and the page shows what they say. The command that "
        "began it goes on with the rest."
    ]


def lost_share(rows: list[Row]) -> float:
    """Share of the cases that did not finish."""
    return sum(text(row, "status") != "done" for row in rows) / len(rows) if rows else 0.0


def _operation(run: Run) -> list[str]:
    rated = float(run.fact("rated_rotor_speed") or 0.0) or None
    fixed = [no_pitch_control(rated)] if run.setting("operation") == "fixed" else []
    return [*beyond(run.rows, rated), *fixed]


def _lost(run: Run) -> list[str]:
    items = []
    for s in run.summaries:
        if s.cases and not s.complete:
            share = format_percent(lost_share(run.rows_of(s)))
            items.append(
                f"{s.label}: {s.cases - s.done} of {s.cases} cases did not finish ({share}); no damage is counted for them. "
                "They are listed below."
            )
    return items


def _uncompared(run: Run) -> list[str]:
    if run.reference is None:
        return [
            "The campaign has no reference: the errors are unknown and no integrator can be called good "
            "enough."
        ]
    if not run.reference.complete:
        return ["The reference did not finish every wind; where it is missing, no integrator was compared."]
    return []


def _unresolved(run: Run) -> list[str]:
    """Integrators whose DEL errors are not far above what is known of the reference's own, where that could change a verdict."""
    try:
        known = float(run.fact("reference_del_error"))
    except ValueError:
        return []
    near = [
        s for s in run.integrators if s.worst_del_error is not None and s.worst_del_error.size < NEAR * known
    ]
    if not near or NEAR * known < min(LEVELS):
        return []
    return [
        f"The loads of the reference are known to {format_percent(known)} only ({run.fact('reference_agreement')}). The DEL errors of "
        f"{', '.join(s.label for s in near)} are less than {NEAR:g} times that and may be the reference's own: give the reference "
        "a smaller step."
    ]


def _short(run: Run) -> list[str]:
    counted = float(run.setting("duration", SHORT)) - float(run.setting("discard", 0.0))
    if counted >= SHORT:
        return []
    return [
        f"Each case counts {counted:g} s; IEC 61400-1 asks for {SHORT:g} s. That is enough to compare "
        "integrators under the same wind, and too little for a design load."
    ]


def _folder(run: Run) -> list[str]:
    return (
        []
        if run.campaign
        else ["The run folder has no campaign.yaml; the settings below are the program's defaults."]
    )
