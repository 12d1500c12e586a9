"""Where the checkout keeps what the tests read; the one place that counts folders upwards."""

from __future__ import annotations

import os
from pathlib import Path

TESTS = Path(__file__).resolve().parent
ROOT = TESTS.parent
CAMPAIGNS = ROOT / "campaigns"
CORRECTORS = ROOT / "correctors"
TURBINE_DATA = ROOT / "fatigue_runner" / "turbine" / "data"
# reference data that are too large for the repository: beside the checkout, or where the variable says
SHARED = Path(os.environ.get("FATIGUE_RUNNER_SHARED", ROOT.parent / "shared")) / "data"
