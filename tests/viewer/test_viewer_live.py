"""A campaign that is being watched: the run is the same to the bit, and nothing that happens to the viewer stops or holds it."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from viewer_example import motion, write

from fatigue_runner.errors import InputError
from fatigue_runner.logbook import Log, LogWriter
from fatigue_runner.viewer import bridge, live, priority, window
from fatigue_runner.viewer.live import BridgeProcess, Look, Watched
from fatigue_runner.viewer.overview import Overview, chart, ticks
from fatigue_runner.viewer.player import Player, extended
from fatigue_runner.viewer.priority import Allowance


def record(case_id: str, **row: object) -> dict:
    return {"row": {"case_id": case_id, "status": "done", "method": "heun", "step": 0.01, **row}}


def append(folder: Path, *records: dict, end: str = "\n") -> None:
    with (folder / "cases.jsonl").open("a") as file:
        file.write("\n".join(json.dumps(r) for r in records) + end)


# --- the campaign as it fills


def test_counts_follow_the_records_as_blocks_of_cases_come_in(tmp_path):
    view = Overview(tmp_path, 7, [["a", "b"], ["c", "d"], ["e", "f"]], workers=1)
    assert not view.update(), "no record yet"
    assert view.counts() == {"done": 0, "diverged": 0, "failed": 0, "running": 2, "waiting": 5}
    append(tmp_path, record("a"), record("b", status="diverged"))
    assert view.update()
    assert view.counts() == {"done": 1, "diverged": 1, "failed": 0, "running": 2, "waiting": 3}
    append(tmp_path, record("c", status="failed"))
    view.update()
    assert view.counts()["running"] == 1
    assert not view.update(), "nothing new"


def test_half_a_record_waits_for_its_other_half(tmp_path):
    view = Overview(tmp_path, 2)
    whole = json.dumps(record("a"))
    (tmp_path / "cases.jsonl").write_text(whole[:20])
    view.update()
    assert not view.rows
    (tmp_path / "cases.jsonl").write_text(whole + "\n")
    view.update()
    assert list(view.rows) == ["a"]


def test_campaign_that_is_begun_anew_is_counted_anew(tmp_path):
    view = Overview(tmp_path, 2)
    append(tmp_path, record("a"), record("b"))
    view.update()
    (tmp_path / "cases.jsonl").write_text(json.dumps(record("c")) + "\n")
    view.update()
    assert list(view.rows) == ["c"]


def test_chart_has_a_point_per_case_that_is_done_at_its_wind_and_load(tmp_path):
    view = Overview(tmp_path, 9)
    name = "del_blade1_root_flapwise_moment_m10"
    append(
        tmp_path,
        *(
            record(f"a{v}", wind_speed=v, **{name: 1e5 * v, f"del_error_{name[4:]}": 0.1})
            for v in (5, 10, 15)
        ),
        record("lost", status="diverged", wind_speed=7.0),
        record("b", method="rk4", wind_speed=10, **{name: 1e6}),
    )
    view.update()
    assert view.figure() == name
    drawing = chart(view)
    assert {key: len(points) for key, (points, _) in drawing.series.items()} == {
        "heun 10 ms": 3,
        "rk4 10 ms": 1,
    }
    points = drawing.series["heun 10 ms"][0]
    # equal steps in wind and in load are equal steps to the right and up
    assert np.diff(points[:, 0]) == pytest.approx(np.diff(points[:, 0])[::-1])
    assert (np.diff(points[:, 1]) < 0).all()
    append(
        tmp_path,
        *(
            record(name, corrector=name, mode="hybrid", wind_speed=9, **{name: 1.0})
            for name in ("affine", "network")
        ),
    )
    view.update()
    for name in ("affine", "network"):
        assert f"| heun 10 ms + {name}, hybrid | 1 |" in view.text(), "two correctors are two integrators"
    assert "worst DEL error" in view.text() and "| heun 10 ms | 4 | 10 % |" in view.text()


@pytest.mark.parametrize(
    ("low", "high"), [(0.3, 9.7), (5.0, 25.0), (1e-6, 3e-6), (1e6, 1.001e6), (-3.0, 4.0)]
)
def test_ticks_are_round_and_enclose_the_values(low, high):
    marks = ticks(low, high)
    assert marks[0] <= low and marks[-1] >= high and 2 <= len(marks) <= 8
    step = np.diff(marks)[0]
    assert float(f"{step:.0e}") == pytest.approx(step)


# --- the case that is played


def test_log_is_followed_while_it_is_written_and_played_at_its_pace(tmp_path):
    whole = motion(201)  # 10 s
    first, rest = cut(whole, 0, 101), cut(whole, 101, 201)
    player = Player(tmp_path / "case.mcap", pace=2.0)
    assert not player.read(now=0.0), "there is no log yet"
    with LogWriter(tmp_path / "case.mcap", run={"turbine": "nrel5mw"}, chunk_seconds=0.0) as log:
        log.append(first)
        assert player.read(now=100.0), "seen for the first time"
        assert len(player.viewed.log.time) == 101 and not player.ended
        log.append(rest)
    player.read(now=101.0)
    assert player.ended and len(player.viewed.log.time) == 201
    assert np.array_equal(player.viewed.log.state, whole.state)
    assert len(player.viewed.log.accepted) == 200
    # began at 100: after 2.5 s at twice real time, 5 s and their 101 rows are due
    assert player.due(now=102.5) == 101
    assert player.due(now=105.1) == 201 and player.has_more
    player.sent = 201
    assert not player.has_more


def cut(t, start, stop):
    within = slice(max(start - 1, 0), stop - 1)
    return dataclasses.replace(
        t, time=t.time[start:stop], state=t.state[start:stop], wind=t.wind[start:stop],
        loads={k: v[start:stop] for k, v in t.loads.items()}, accepted=t.accepted[within],
        discrepancy=t.discrepancy[within], threshold=t.threshold[within], local_error=t.local_error[within],
    )  # fmt: skip


def test_pace_must_be_positive():
    for pace in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="--pace"):
            live.watcher(pace=pace)


def test_missing_viewer_is_said_before_anything_runs(monkeypatch):
    monkeypatch.setattr(window, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="pip install"):
        live.watcher()


def test_live_view_without_a_display_is_refused_before_anything_is_written(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    from fatigue_runner.cli import app

    monkeypatch.setattr(live, "require_rerun", lambda: None)
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    campaign = tmp_path / "a.yaml"
    campaign.write_text("name: a\n")
    done = CliRunner().invoke(app, ["run", str(campaign), "--live", "--out", str(tmp_path / "run")])
    assert isinstance(done.exception, InputError) and done.exception.exit_code == 2
    assert "no display" in str(done.exception) and "--viewer-port 9876" in str(done.exception)
    assert not (tmp_path / "run").exists()


# --- the process beside the run, in all that can happen to its viewer


def started(folder: Path, port: int, **look: object) -> BridgeProcess:
    made = BridgeProcess(Look(port=port, **look))
    made.tell(Watched(str(folder), 1, [["u10_rk3_20ms"]], 1))
    return made


def finished(made: BridgeProcess) -> subprocess.Popen[bytes]:
    """The bridge's process after the run told it that all is over."""
    made.over()
    made.close()
    return made.process


def test_bridge_ends_with_the_run_when_there_is_no_viewer(tmp_path):
    assert finished(started(tmp_path, window.free_port())).wait(timeout=60) == 0


def test_bridge_of_a_campaign_that_was_refused_ends():
    made = BridgeProcess(Look(port=window.free_port()))
    made.close()
    assert made.process.wait(timeout=60) == 0


def test_watching_takes_its_share_of_a_core_and_something_at_once_for_the_first_picture():
    allowance = Allowance(0.2, first=1.5)
    assert allowance.wait(now=100.0, used=3.0) == 0.0, "what was loaded before does not count"
    assert allowance.wait(now=100.5, used=4.5) == 0.0
    # 1 s more than at once, which 0.2 of a core earns in 5 s
    assert allowance.wait(now=101.0, used=5.5) == pytest.approx(4.0)
    assert allowance.wait(now=105.0, used=5.5) == 0.0


@pytest.mark.parametrize(("workers", "spare"), [(1, True), (2, True), (3, False), (9, False)])
def test_share_counts_where_the_workers_leave_fewer_than_two_cores_idle(monkeypatch, workers, spare):
    monkeypatch.setattr(priority, "cores", lambda: 4)
    beside = bridge.Beside(Look(port=1, share=0.01), Watched("", 1, [], workers), None)
    assert beside.spare is spare
    beside.may_work(0.0, None)
    monkeypatch.setattr(time, "process_time", lambda: 1e6)
    assert beside.may_work(1.0, None) is spare


def test_viewer_counts_less_than_a_worker_once_it_had_time_for_its_first_picture(monkeypatch):
    monkeypatch.setattr(priority, "cores", lambda: 2)
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    try:
        beside = bridge.Beside(Look(share=0.2), Watched("", 1, [], 2), process)
        now = time.monotonic()
        beside.may_work(now + bridge.UNKNOWN_SECONDS - 1.0, None)
        beside.may_work(now + 2.0, now)
        assert os.getpriority(os.PRIO_PROCESS, process.pid) == os.getpriority(os.PRIO_PROCESS, 0)
        beside.may_work(now + 4.0, now)
        # half of the share, 0.1 of a core, beside a worker: 1 / (1 + 1.25^10) = 0.097
        assert os.getpriority(os.PRIO_PROCESS, process.pid) == 10
    finally:
        process.kill()
        process.wait()


def test_run_waits_for_no_bridge_that_does_not_answer(tmp_path):
    made = BridgeProcess(Look(port=window.free_port()))
    os.kill(made.process.pid, signal.SIGSTOP)
    try:
        many = [[f"case {i} of a large campaign" for i in range(20000)]]  # far more than a pipe holds
        made.tell(Watched(str(tmp_path), 20000, many, 1))
        assert finished(made).poll() is None
    finally:
        made.process.kill()
        made.process.wait()


def test_run_goes_on_when_the_bridge_cannot_be_started_or_is_gone(tmp_path, monkeypatch):
    def refuse(*_: object, **__: object) -> None:
        raise OSError(12, "Cannot allocate memory")

    said: list[str] = []
    with monkeypatch.context() as failing:
        failing.setattr(subprocess, "Popen", refuse)
        with live.Watcher(Look(port=1), said.append) as watch, watch(tmp_path, 1, [["a"]], 1):
            pass
    assert said == ["live view: it could not be started (Cannot allocate memory); the run goes on"]
    with live.Watcher(Look(port=window.free_port()), said.append) as watch:
        watch.bridge.process.kill()
        watch.bridge.process.wait()
        with watch(tmp_path, 1, [["a"]], 1):
            pass
    assert said[-1] == "live view: it was ended; `fatigue-runner view` shows the logs"


@pytest.mark.skipif(not Path("/proc").exists(), reason="this system does not say what a process took")
def test_what_watching_took_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(priority, "cores", lambda: 2)
    said: list[str] = []
    with live.Watcher(Look(port=window.free_port(), share=0.3), said.append) as watch:
        with watch(tmp_path, 1, [["a"]], 2):
            pass
        finished(watch.bridge)
    (told,) = said
    assert re.fullmatch(
        r"live view: the bridge to the viewer took \d+\.\d s of a core in the \d+\.\d s of the cases \(\d+% of one; "
        r"--live-share 0.3\)", told
    )  # fmt: skip


@pytest.mark.parametrize(
    "option", [["--live"], ["--pace", "2"], ["--viewer-port", "9876"], ["--live-case", "a"]]
)
def test_every_option_of_watching_asks_for_it(option, monkeypatch):
    from typer.testing import CliRunner

    from fatigue_runner.cli import app

    def asked(**how: object) -> None:
        raise InputError("watched")

    monkeypatch.setattr(live, "watcher", asked)
    assert str(CliRunner().invoke(app, ["run", "a.yaml", *option]).exception) == "watched"


def test_turbine_of_a_controlled_run_is_whole_where_its_log_came_in_pieces():
    one, other = (
        Log(
            **vars(
                dataclasses.replace(
                    cut(motion(40), *rows), pitch=np.arange(20.0), control={"a": np.arange(20.0)}
                )
            )
        )
        for rows in ((0, 20), (20, 40))
    )
    whole = extended(one, other)
    assert len(whole.time) == len(whole.pitch) == len(whole.control["a"]) == len(whole.state) == 40


def test_bridge_is_of_the_run_s_session_and_out_of_reach_of_its_ctrl_c(tmp_path):
    made = started(tmp_path, window.free_port())
    try:
        # Linux weighs sessions first: a priority counts within one
        assert os.getsid(made.process.pid) == os.getsid(0)
        assert os.getpgid(made.process.pid) != os.getpgid(0), "Ctrl-C is for the run"
    finally:
        made.process.kill()
        made.process.wait()


def test_bridge_that_stands_still_ends_itself_even_inside_a_call_that_never_returns():
    code = "import ctypes; from fatigue_runner.viewer.bridge import heartbeat; heartbeat(0.3); ctypes.PyDLL(None).pause()"
    done = subprocess.run([sys.executable, "-c", code], timeout=30, check=False)
    assert done.returncode == 1  # PyDLL holds the interpreter's lock: no Python thread could have ended it


CAMPAIGN = {
    "name": "watched", "turbine": "nrel5mw", "duration": 20, "output_rate": 20, "workers": 1,
    "wind": {"type": "constant", "speeds": [7, 9], "vertical_shear": 0.1},
    "integrators": [{"method": "heun", "step": 0.02}, {"method": "rk4", "step": 0.04}],
    "reference": {"method": "rk4", "step": 0.01},
    "fatigue": {"wohler_exponents": [3, 10]},
}  # fmt: skip


def run(folder: Path, watch=None) -> dict[str, str]:
    """Run the campaign; what of its outcome must not depend on who watches: states and loads of every log, and the DELs."""
    from fatigue_runner.campaign import run_campaign
    from fatigue_runner.logbook import read_log

    with watch or nullcontext():
        results = run_campaign(CAMPAIGN, folder, watch=watch)
    assert results.exit_code == 0
    out = {}
    for row in results:
        log = read_log(folder / "logs" / f"{row['case_id']}.mcap")
        digest = hashlib.sha256(log.time.tobytes() + log.state.tobytes() + log.accepted.tobytes())
        for name in sorted(log.loads):
            digest.update(log.loads[name].tobytes())
        out[row["case_id"]] = digest.hexdigest() + str([v for k, v in row.items() if k.startswith("del_")])
    return out


@pytest.fixture(scope="module")
def unwatched(tmp_path_factory) -> dict[str, str]:
    return run(tmp_path_factory.mktemp("unwatched") / "run")


@pytest.mark.slow(reason="five whole campaigns, four of them with a viewer")
class TestRun:
    """Whole campaigns with a viewer that is open, absent, stopped or killed."""

    @pytest.fixture(autouse=True)
    def _needs_rerun(self):
        pytest.importorskip("rerun", reason="rerun-sdk is not installed")

    def test_viewer_open_shows_the_campaign_and_the_turbine(self, unwatched, tmp_path):
        from viewer_pictures import near, part, screen, warm

        from fatigue_runner.viewer import colours

        port = window.free_port()
        with screen(port=port) as viewer:
            assert run(tmp_path / "run", live.watcher(port=port)) == unwatched
            for _ in range(30):  # what is sent is drawn soon
                picture = viewer.soon()
                blades = warm(part(picture, 0.0, 0.6, 0.05, 0.6)).sum()
                drawn = part(picture, 0.6, 1.0, 0.55, 0.85)
                dots = near(drawn, colours.INTEGRATORS[1], 30).sum()
                if blades > 800 and dots > 15:
                    return
        pytest.fail(f"{blades} pixels of blades, {dots} of DELs")

    def test_turbine_moves_within_three_seconds_and_stays_with_its_pace_though_every_core_is_busy(
        self, tmp_path
    ):
        for attempt in range(3):  # other programs may take what is the workers'
            folder = tmp_path / str(attempt)
            folder.mkdir()
            first, later = self.served(folder)
            if first < 3.0 and later > 3.0:
                return
        pytest.fail(
            f"first picture after {first:.1f} s; 5 s later the scene is at {later:.1f} s of its minute"
        )

    def served(self, folder: Path) -> tuple[float, float]:
        """Seconds after the first case until turbine and campaign are served, and how far the turbine has moved 5 s later [s],
        played in real time, as a viewer's server receives it, which writes it into a file."""
        port, got = window.free_port(), folder / "got.rrd"
        busy: list[subprocess.Popen[bytes]] = []
        with window.viewer("--port", str(port), "--save", str(got)):
            try:
                wait_for(port)
                made = BridgeProcess(Look(port=port, pace=1.0))
                time.sleep(3.0)  # the campaign is read
                spin = [sys.executable, "-c", "while True: pass"]
                busy += [subprocess.Popen(spin) for _ in range(priority.cores())]
                made.tell(Watched(str(folder), 1, [["u10_rk3_20ms"]], priority.cores(), time.time()))
                time.sleep(1.0)
                log = write(folder / "logs", "rk3", rows=1200)  # a minute at 20 Hz
                append(folder, record(log.stem))
                first = max(
                    until(lambda what=what: what in got.read_bytes())
                    for what in (b"/blade1", b"/campaign/cases")
                )
                time.sleep(5.0)
            finally:
                for process in (*busy, made.process):
                    process.kill()
                    process.wait()
        return first, frames(got) / 20

    def test_viewer_absent(self, unwatched, tmp_path):
        assert run(tmp_path / "run", live.watcher(port=window.free_port())) == unwatched

    @pytest.mark.parametrize("what", [signal.SIGSTOP, signal.SIGKILL])
    def test_viewer_stopped_or_killed(self, unwatched, tmp_path, what):
        port = window.free_port()
        with window.viewer("--serve-grpc", "--port", str(port)) as process:
            wait_for(port)
            os.kill(process.pid, what)
            try:
                assert run(tmp_path / "run", live.watcher(port=port)) == unwatched
            finally:
                if what == signal.SIGSTOP:
                    os.kill(process.pid, signal.SIGCONT)

    def test_viewer_killed_while_a_case_is_played_ends_the_bridge(self, tmp_path):
        write(tmp_path / "logs", "rk3", rows=2000)
        port = window.free_port()
        with window.viewer("--serve-grpc", "--port", str(port)) as process:
            wait_for(port)
            playing = finished(started(tmp_path, port, pace=1.0))
            time.sleep(3.0)
            assert playing.poll() is None, "it plays on beyond the end of the run"
            process.kill()
            assert playing.wait(timeout=30) == 0

    def test_stopped_viewer_ends_a_bridge_that_plays_much_in_time(self, tmp_path):
        write(tmp_path / "logs", "rk3", rows=30000)
        port = window.free_port()
        with window.viewer("--serve-grpc", "--port", str(port)) as process:
            wait_for(port)
            os.kill(process.pid, signal.SIGSTOP)
            try:
                finished(started(tmp_path, port, pace=1e4, stall=5.0)).wait(timeout=60)
            finally:
                os.kill(process.pid, signal.SIGCONT)


def until(there, seconds: float = 60.0) -> float:
    """Seconds until something is there."""
    began = time.monotonic()
    while not there() and time.monotonic() - began < seconds:
        time.sleep(0.05)
    return time.monotonic() - began


def frames(recording: Path) -> int:
    """How many pictures of a blade a recording has."""
    printed = [str(window.program()), "rrd", "print", "--continue-on-error", "true", str(recording)]
    told = subprocess.run(printed, capture_output=True, text=True, check=False).stdout
    return sum(map(int, re.findall(r"with (\d+) rows \(.*?\) - /scene/\S+/blade1 - ", told)))


def wait_for(port: int) -> None:
    for _ in range(200):
        if window.listens(port):
            return
        time.sleep(0.05)
    pytest.skip("the viewer's server does not start here")
