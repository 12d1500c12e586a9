"""Nothing here calls home: no process of a run, a view or a report connects to another machine."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time

import pytest

strace = pytest.mark.skipif(shutil.which("strace") is None, reason="needs strace to see what is connected to")


def connected(trace: str) -> list[str]:
    """Addresses beyond this machine that a trace of system calls names."""
    found = re.findall(r'(?:inet_addr\("|inet_pton\(AF_INET6, ")([^"]+)"', trace)
    return [
        address
        for address in found
        if not address.startswith("127.") and address not in ("::1", "0.0.0.0", "::")
    ]


def traced(tmp_path, command, seconds=None) -> list[str]:
    trace = tmp_path / "trace"
    process = subprocess.Popen(
        ["strace", "-f", "--seccomp-bpf", "-e", "trace=connect,sendto,sendmsg,sendmmsg", "-o", str(trace), *command],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env={k: v for k, v in os.environ.items() if k != "CI"},
        start_new_session=True,
    )  # fmt: skip
    if seconds is None:
        assert process.wait(timeout=300) == 0
    else:
        time.sleep(seconds)
        os.killpg(process.pid, 9)
        process.wait()
    return connected(trace.read_text())


def test_a_trace_tells_this_machine_from_others():
    assert connected('connect(3, {sin_addr=inet_addr("10.0.0.53")}, 16) = 0') == ["10.0.0.53"]
    assert connected('connect(3, {sin_addr=inet_addr("127.0.0.1")}, 16) = 0') == []


@strace
@pytest.mark.slow(reason="a viewer and a run under strace")
def test_neither_run_nor_report_nor_viewer_connects_to_another_machine(tmp_path):
    campaign = tmp_path / "small.yaml"
    campaign.write_text(
        "name: small\nduration: 5\nwind: {type: constant, speeds: [8]}\nintegrators:\n  - {method: heun, step: 0.01}\n"
    )
    tool = [sys.executable, "-m", "fatigue_runner"]
    assert not traced(tmp_path, [*tool, "run", str(campaign), "--out", str(tmp_path / "out")])
    assert not traced(tmp_path, [*tool, "report", str(tmp_path / "out")])
    pytest.importorskip("rerun")
    start = "from fatigue_runner.viewer.window import start_viewer as s; s('--serve-grpc', '--port', '19871', own_session=False).wait()"
    assert not traced(tmp_path, [sys.executable, "-c", start], seconds=8)
