"""What a campaign with a shipped corrector leaves in its logs is enough to say what ran and to count its damage again."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from fatigue_runner.campaign import run_campaign
from fatigue_runner.corrector.library import locate
from fatigue_runner.fatigue import damage_equivalent_load, short_term_cycles
from fatigue_runner.logbook import read_log

CAMPAIGN = {
    "name": "hybrid",
    "duration": 4,
    "workers": 1,
    "wind": {"speeds": [8], "vertical_shear": 0.1},
    "integrators": [{"method": "rk4", "step": 0.1, "corrector": "rk4-100ms", "mode": "hybrid"}],
    "reference": {"method": "rk7", "step": 0.01},
    "fatigue": {"wohler_exponents": [4, 10]},
}


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    out = tmp_path_factory.mktemp("run") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fatigue_runner.report.write_report", lambda folder: folder / "report.html")
        (row,) = run_campaign(CAMPAIGN, out).where(method="rk4")
    return row, read_log(out / "logs" / f"{row['case_id']}.mcap")


def test_a_log_names_its_corrector_by_content(outcome):
    _, log = outcome
    assert log.run["corrector_hash"] == hashlib.sha256(locate("rk4-100ms").read_bytes()).hexdigest()
    assert log.run["mode"] == "hybrid" and {"campaign.yaml", "turbine.yaml"} <= set(log.attachments)


def test_the_acceptance_of_the_result_is_that_of_the_status_beside_the_threshold(outcome):
    row, log = outcome
    tested = np.isfinite(log.threshold)
    assert tested.any() and row["acceptance_rate"] is not None
    assert (log.accepted[tested] == (log.discrepancy <= log.threshold)[tested]).all()
    assert np.isfinite(log.reference_error).all()


def test_damage_counted_from_the_log_is_the_result_s_bit_for_bit(outcome):
    row, log = outcome
    for name in ("blade1_root_flapwise_moment", "tower_base_fore_aft_moment"):
        for exponent in (4, 10):
            load = damage_equivalent_load(log.loads[name], exponent, short_term_cycles(4.0))
            assert load == row[f"del_{name}_m{exponent}"]
