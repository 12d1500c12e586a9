"""How processes that only watch keep out of the way of those that work.

Linux weighs sessions (its "autogroups") against each other and processes within theirs, so a process that should give way to a run
stays in the run's session. There the idle class gives way at once whenever a worker wants the core; `nice` alone would let the
worker wait some milliseconds each time, and gets 1.5 % of a busy core rather than 0.3 %.
"""

from __future__ import annotations

import contextlib
import os


def yield_to_others(process_id: int = 0) -> None:
    """Run a process (default: this one) and what it starts only when nothing else of its session wants to.

    Elsewhere than on Linux: the lowest priority that the system has.
    """
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setscheduler(process_id, os.SCHED_IDLE, os.sched_param(0))
        return
    with contextlib.suppress(OSError, AttributeError):
        os.setpriority(os.PRIO_PROCESS, process_id, 19)
