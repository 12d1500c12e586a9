"""What `memory.Watch` counts: a process and all below it."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import memory
import pytest

LARGE = "block = b'1' * 200_000_000; print('there', flush=True); input()"
PARENT = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {LARGE!r}])"


@pytest.mark.skipif(
    not Path("/proc/self/smaps_rollup").exists(), reason="this system tells no proportional set sizes"
)
def test_a_child_of_a_child_counts_and_what_has_ended_does_not(monkeypatch):
    monkeypatch.setattr(memory, "EVERY", 0.02)
    parent = subprocess.Popen([sys.executable, "-c", PARENT], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert parent.stdout.readline()
    watch = memory.Watch(parent.pid)
    until = time.monotonic() + 60
    while not watch.peak and time.monotonic() < until:
        time.sleep(0.02)
    assert len(memory.tree(parent.pid)) == 2
    parent.communicate(b"\n")
    assert 0.2 < watch.stop() < 0.4
    (size, command), *_ = watch.processes
    assert size > 0.2 and "block" in command
    after = memory.Watch(parent.pid)
    time.sleep(0.2)
    assert after.stop() == 0
