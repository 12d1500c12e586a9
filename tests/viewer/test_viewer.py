"""`fatigue-runner view`: what is shown of what was asked for, and one clear sentence for everything that cannot be."""

from __future__ import annotations

import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import TURBINE_DATA
from typer.testing import CliRunner
from viewer_example import motion, write

from fatigue_runner.errors import InputError
from fatigue_runner.logbook import write_log
from fatigue_runner.viewer import cases, view, window
from fatigue_runner.viewer.commands import app


@pytest.fixture
def run_folder(tmp_path) -> Path:
    logs = tmp_path / "run" / "logs"
    for wind in ("u08", "u10"):
        for method in ("heun", "rk3", "dop853"):
            write(logs, method, wind, rows=40)
    return logs.parent


def names(paths: list[Path]) -> list[str]:
    return [path.stem for path in paths]


def test_run_folder_shows_every_integrator_of_one_wind_the_reference_among_them(run_folder):
    assert names(cases.find_logs([run_folder])) == ["u08_dop853_20ms", "u08_heun_20ms", "u08_rk3_20ms"]


def test_chosen_case_brings_the_other_integrators_of_its_wind(run_folder):
    shown = cases.find_logs([run_folder], case="u10_rk3_20ms")
    assert names(shown) == ["u10_rk3_20ms", "u10_dop853_20ms", "u10_heun_20ms"]


def test_reference_stands_first_and_every_turbine_has_its_own_place_and_colour(run_folder):
    viewed = cases.read_cases(cases.find_logs([run_folder]))
    assert [v.label for v in viewed] == ["dop853 20 ms (reference)", "heun 20 ms", "rk3 20 ms"]
    assert len({v.colour for v in viewed}) == len({v.key for v in viewed}) == 3
    offsets = np.array([v.offset for v in viewed])
    assert (np.abs(np.diff(offsets)) > 2 * 63).all(), "rotors do not touch"


def test_correctors_of_one_method_are_told_apart_by_their_names(tmp_path):
    made = [
        write(tmp_path / name, "rk3", mode="hybrid", corrector=name, case_id=name)
        for name in ("affine", "network")
    ]
    assert [v.label for v in cases.read_cases(made)] == [
        "rk3 20 ms + affine, hybrid",
        "rk3 20 ms + network, hybrid",
    ]
    assert [v.label for v in cases.read_cases(made[:1])] == ["rk3 20 ms + affine, hybrid"]


def test_log_of_another_turbine_is_refused(tmp_path):
    path = write(tmp_path, rows=20)
    with pytest.raises(InputError, match="made with another turbine than nrel5mw"):
        trajectory = motion(20)
        trajectory.loads["blade1_tip_out_of_plane"] = trajectory.loads["blade1_tip_out_of_plane"] + 0.01
        write_log(path, trajectory, {"turbine": "nrel5mw"}, {}, {})
        cases.read_cases([path])


def test_turbine_is_the_one_that_the_attached_campaign_names(tmp_path):
    path = tmp_path / "case.mcap"
    write_log(path, motion(5), {"turbine": "something"}, {"campaign.yaml": b"turbine: t2b1i1cg\n"}, {})
    assert cases.read_cases([path])[0].geometry.cone == 0.0


def test_attached_turbine_is_drawn_also_where_its_file_is_gone_or_has_changed(tmp_path):
    path = tmp_path / "case.mcap"
    text = (TURBINE_DATA / "nrel5mw.yaml").read_text()
    own = text.replace("precone_deg: -2.5", "precone_deg: -1.5")
    assert own != text
    attached = {"campaign.yaml": b"turbine: /gone/own.yaml\n", "turbine.yaml": own.encode()}
    still = motion(5)
    still.loads.clear()  # tip channels of another cone
    write_log(path, still, {"turbine": "own"}, attached, {})
    assert np.degrees(cases.read_cases([path])[0].geometry.cone) == pytest.approx(-1.5)
    with pytest.raises(InputError, match=r"/gone/own.yaml does not exist"):
        write_log(path, still, {"turbine": "own"}, {"campaign.yaml": attached["campaign.yaml"]}, {})
        cases.read_cases([path])


def test_cut_log_is_shown_up_to_where_it_is_good(tmp_path):
    whole = write(tmp_path, rows=4000)
    data = whole.read_bytes()
    part = tmp_path / "cut.mcap"
    part.write_bytes(data[: len(data) * 3 // 4])
    log = cases.read_cases([part])[0].log
    assert log.lost and 0 < len(log.time) < 4000


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "empty|not an MCAP"),
        (b"hello, world", "not an MCAP"),
        (b"\x89MCAP0\r\n" + bytes(40), "damaged|not|holds|ends"),
    ],
)
def test_file_that_is_no_log_is_one_sentence(tmp_path, content, sentence):
    path = tmp_path / "odd.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match=sentence):
        cases.read_cases([path])


def test_log_without_states_says_which_setting_keeps_them(tmp_path):
    path = tmp_path / "loads.mcap"
    write_log(path, motion(20), {}, {}, {}, topics=["loads"])
    with pytest.raises(InputError, match="log: topics"):
        cases.read_cases([path])


def test_what_is_not_there_is_named(tmp_path, run_folder):
    with pytest.raises(InputError, match=r"nowhere does not exist; give a log"):
        cases.find_logs([tmp_path / "nowhere"])
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"no log \(\.mcap\)"):
        cases.find_logs([tmp_path / "empty"])
    with pytest.raises(InputError, match="did you mean 'u10_heun_20ms'"):
        cases.find_logs([run_folder], case="u10_heun_2ms")


def test_missing_viewer_says_how_to_install_it(tmp_path, monkeypatch):
    monkeypatch.setattr(window, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="install it with pip install 'rerun-sdk"):
        view([write(tmp_path, rows=5)])


def test_missing_display_says_what_to_do_instead(tmp_path, monkeypatch):
    monkeypatch.setattr(window, "require_rerun", lambda: None)
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError, match=r"no display.*--web.*--save"):
        view([write(tmp_path, rows=5)])


def test_scale_must_be_a_sensible_number(tmp_path):
    for scale in (0.0, -1.0, 51.0, float("nan")):
        with pytest.raises(InputError, match="--scale"):
            view([write(tmp_path, rows=5)], scale=scale)


def test_port_in_use_is_one_sentence():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with pytest.raises(InputError, match=r"port \d+ cannot be used .*choose another with --port"):
            window.require_free(other.getsockname()[1])


def test_importing_the_viewer_does_not_import_rerun():
    code = "import sys, fatigue_runner.viewer, fatigue_runner.viewer.commands, fatigue_runner.viewer.cases; "
    done = subprocess.run([sys.executable, "-c", code + "sys.exit('rerun' in sys.modules)"], check=False)
    assert done.returncode == 0


def test_page_address_names_the_loopback_interface_only():
    assert (
        window.page_address(9090, 1234)
        == "http://127.0.0.1:9090/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A1234%2Fproxy"
    )


class TestWithRerun:
    """Recordings as Rerun reads them back."""

    @pytest.fixture(autouse=True)
    def _needs_rerun(self):
        pytest.importorskip("rerun", reason="rerun-sdk is not installed")

    def test_save_writes_a_recording_and_says_how_to_open_it(self, run_folder, tmp_path):
        target = tmp_path / "turbine.rrd"
        result = CliRunner().invoke(app, [str(run_folder), "--save", str(target)])
        assert result.exit_code == 0, result.output
        assert f"rerun {target}" in result.output
        assert target.stat().st_size > 10_000

    def test_plots_keep_the_log_s_rate_and_the_scene_moves_at_its_own(self, tmp_path, monkeypatch):
        from fatigue_runner.viewer import recording

        monkeypatch.setattr(recording, "FRAME_RATE", 5.0)
        rows = sent(write(tmp_path, rows=1201))  # 60 s at 20 Hz
        assert rows["plots/load/tower_base_fore_aft_moment"] == rows["plots/state/edge"] == 1201
        assert rows["plots/solver/discrepancy"] == 1200
        assert rows["trust"] == 3, "trusted, then fallen back, then the log's end"
        assert rows["scene/blade1"] == rows["scene/hub"] == rows["scene/blade_wind"] == 301
        assert rows["plots/wind/blade2_wind"] == rows["plots/wind/wind_sin_2"] == 1201

    def test_live_view_forwards_at_most_its_rate_and_the_largest_error_of_each_group(self, tmp_path):
        every = sent(write(tmp_path, rows=1201))  # 60 s at 20 Hz
        few = sent(write(tmp_path, rows=1201), series_rate=5.0)
        assert every["plots/load/rotor_thrust"] == 1201 and few["plots/load/rotor_thrust"] == 301
        assert few["plots/solver/discrepancy"] == 300
        assert few["trust"] == every["trust"] == 3, "no rejection is lost"

    def test_live_view_forwards_the_curves_of_its_screen_and_no_others(self, tmp_path):
        path = write(tmp_path, rows=101)
        from fatigue_runner.viewer.blueprint import shown_live

        rows = sent(path, only=shown_live(cases.read_cases([path])[0]))
        plots = {name for name in rows if name.startswith("plots/")}
        blades = {f"plots/load/blade{i}_root_flapwise_moment" for i in (1, 2, 3)}
        winds = {f"plots/wind/blade{i}_wind" for i in (1, 2, 3)} | {"plots/wind/wind_speed"}
        assert plots == blades | winds | {"plots/load/tower_base_fore_aft_moment"}
        assert rows["scene/blade1"] == 101

    @given(st.lists(st.integers(0, 150), max_size=5).map(sorted))
    @settings(max_examples=6, deadline=None)
    def test_log_sent_in_pieces_is_the_log_sent_at_once(self, cuts):
        with tempfile.TemporaryDirectory() as folder:
            path = write(Path(folder), rows=150)
            assert sent(path, tuple(cuts)) == sent(path)

    def test_folder_that_is_not_there_is_one_sentence(self, tmp_path):
        with pytest.raises(InputError, match="cannot be written"):
            view([write(tmp_path, rows=5)], save=tmp_path / "no" / "file.rrd")

    def test_web_page_is_served_on_this_machine_only(self, tmp_path, monkeypatch):
        import urllib.request

        port, said = window.free_port(), []

        def look(process):
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=10) as page:
                said.append(page.read())
            outside = socket.socket()
            outside.settimeout(2)
            own = _address_of_this_machine()
            said.append(None if own is None else outside.connect_ex((own, port)))

        monkeypatch.setattr(window, "wait", look)
        lines = []
        view([write(tmp_path, rows=5)], web=True, port=port, say=lines.append)
        page, outside = said
        assert b"<html" in page.lower()
        assert outside != 0, "nobody else can reach it"
        assert f"http://127.0.0.1:{port}/" in lines[0]
        window.require_free(port)  # and nothing is left behind


def _address_of_this_machine() -> str | None:
    """An address other than the loopback interface's; None where there is none."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # nothing is sent: it only asks which address would be used
        except OSError:
            return None
        return probe.getsockname()[0]


class Sent:
    """Stands for a recording and counts the rows of what is sent to each entity."""

    def __init__(self) -> None:
        self.rows: dict[str, int] = {}
        self.blocks: dict[str, int] = {}

    def log(self, path, *what, static) -> None:
        assert static, "only what stands still is logged by itself"

    def send_columns(self, path, indexes, columns) -> None:
        self.rows[path] = self.rows.get(path, 0) + len(indexes[0].as_arrow_array())
        self.blocks[path] = self.blocks.get(path, 0) + 1


def sent(path: Path, cuts: tuple[int, ...] = (), **stage_of: Any) -> dict[str, int]:
    """Rows sent of a log, by entity without the case's key, when it is sent in pieces that end at `cuts`."""
    from fatigue_runner.viewer.recording import Stage

    viewed = cases.read_cases([path])
    counter = Sent()
    stage = Stage(counter, viewed, **stage_of)
    stage.set_up()
    for first, last in zip((0, *cuts), (*cuts, None), strict=True):
        stage.send(viewed[0], first, last)
    return {name.replace(f"/{viewed[0].key}", ""): rows for name, rows in counter.rows.items()}


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux ends a process with its parent")
def test_a_viewer_ends_when_the_program_that_opened_it_is_killed():
    pytest.importorskip("rerun_cli", reason="the viewer is not installed")
    start = (
        "from fatigue_runner.viewer import window\n"
        "with window.viewer('--serve-grpc', '--port', str(window.free_port())) as process:\n"
        "    print(process.pid, flush=True)\n"
        "    process.wait()\n"
    )
    with subprocess.Popen([sys.executable, "-c", start], stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        viewer = Path(f"/proc/{int(program.stdout.readline())}")
        assert alive(viewer)
        program.kill()
    until = time.monotonic() + 2.0
    while alive(viewer) and time.monotonic() < until:
        time.sleep(0.02)
    assert not alive(viewer)


def alive(process: Path) -> bool:
    """Whether a process of this folder of /proc still does something."""
    try:
        return " Z " not in (process / "stat").read_text()
    except OSError:
        return False
