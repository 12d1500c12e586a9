"""What left the model's range is told in a sentence, with how often, how far and in which winds."""

from __future__ import annotations

import math

from fatigue_runner.results.beyond import beyond, left_tables, no_pitch_control, overspeed

RPM = math.pi / 30


def row(speed: float, rotor: float | None = None, clamped: int = 0) -> dict[str, object]:
    return {
        "wind_speed": speed,
        "clamped_lookups": clamped,
        "evaluations": 12000,
        "max_rotor_speed": None if rotor is None else rotor * RPM,
    }


def test_left_tables_are_told_with_their_share_of_the_worst_case():
    (said,) = left_tables([row(8.0), row(3.0, clamped=8386), row(4.0, clamped=12)])
    assert said.startswith(
        "2 of 3 cases left the range of the aerodynamic tables (8398 look-ups in all, up to 70 % of a case"
    )
    assert "from 3 to 4 m/s" in said
    assert left_tables([row(8.0), row(9.0)]) == []


def test_a_rotor_beyond_1_2_times_its_rated_speed_is_outside_the_model_s_use():
    (said,) = overspeed([row(8.0, 9.1), row(11.0, 14.4), row(18.0, 128.0)], 12.1 * RPM)
    assert said.startswith(
        "In 1 of 3 cases the rotor turned faster than 1.2 times its rated 12.1 rpm, up to 128 rpm, at 18 m/s"
    )
    assert "controlled" in said
    assert overspeed([row(8.0, 14.5)], None) == [] and overspeed([row(8.0)], 12.1 * RPM) == []


def test_both_are_told_and_a_fixed_pitch_names_what_rated_is():
    assert len(beyond([row(18.0, 128.0, clamped=5)], 12.1 * RPM)) == 2
    assert no_pitch_control(12.1 * RPM).endswith("no controller limits the rotor's speed; rated is 12.1 rpm.")
