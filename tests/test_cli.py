"""The command line says in one sentence what happened, with the exit code that belongs to it."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from campaign_world import CAMPAIGN, build_world, write_campaign

import fatigue_runner
from fatigue_runner import cli
from fatigue_runner.errors import InputError
from fatigue_runner.interruption import Ended


@pytest.fixture
def world(monkeypatch):
    monkeypatch.setattr("fatigue_runner.report.write_report", lambda folder: folder / "report.html")
    return build_world(monkeypatch)


@pytest.fixture
def call(monkeypatch, capsys, tmp_path):
    """call(*arguments) -> (exit code, what was printed, what was printed as an error), in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["fatigue-runner", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        printed = capsys.readouterr()
        return int(ended.value.code or 0), printed.out, printed.err

    return run


def words(text: str) -> str:
    return " ".join(text.split())


def test_run_answers_which_integrator_is_good_enough_and_where_the_report_is(world, call, tmp_path):
    code, out, _ = call("run", write_campaign(tmp_path, CAMPAIGN.replace("[0.05, 0.1]", "[0.05, 0.08]")))
    assert code == 0
    # DEL errors of the toy: heun 0.64 % at 80 ms and 0.25 % at 50 ms, rk4 0.01 % at 100 ms (campaign_world).
    assert "Cheapest within 1 % DEL error: heun 80 ms" in words(out)
    assert "Cheapest within 0.1 % DEL error: rk4 100 ms" in words(out)
    assert "12 cases, 12 of them simulated now" in words(out)
    assert "report: runs/toy/report.html" in words(out)
    assert (tmp_path / "runs" / "toy" / "results.csv").is_file()


def test_the_table_has_costs_errors_and_a_verdict_per_integrator(world, call, tmp_path):
    _, out, _ = call("run", write_campaign(tmp_path))
    (line,) = (line for line in out.splitlines() if line.strip().startswith("rk4 100 ms"))
    cells = [cell for cell in line.split("  ") if cell.strip()]
    label, evaluations, wall_time, _, _, *errors, verdict = (cell.strip() for cell in cells)
    assert (label, evaluations, wall_time, verdict) == ("rk4 100 ms", "40", "1", "≤ 0.1 %")
    assert errors == ["0.01"] * 4


def test_progress_is_told_line_by_line_where_there_is_no_terminal(world, call, tmp_path):
    _, out, _ = call("run", write_campaign(tmp_path))
    told = [line.strip() for line in out.splitlines() if line.strip().endswith("...")]
    assert [line.split()[0] for line in told] == ["reading", "loading", "running", "writing"]


def test_run_into_the_same_folder_says_what_it_kept(world, call, tmp_path):
    campaign = write_campaign(tmp_path)
    call("run", campaign, "--out", "here")
    code, out, _ = call("run", campaign, "--out", "here")
    assert code == 0
    assert "12 of 12 cases are finished from an earlier run and are kept" in words(out)
    assert "12 cases, 0 of them simulated now" in words(out)


@pytest.mark.parametrize("encoding", ["cp1252", "latin-1", "ascii"])
def test_a_pipe_of_any_encoding_gets_the_answer(world, call, tmp_path, monkeypatch, encoding):
    """A finished campaign once ended with an internal error where the pipe has no `≤`."""
    pipe = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, "stdout", pipe)
    code, *_ = call("run", write_campaign(tmp_path))
    pipe.flush()
    out = pipe.buffer.getvalue().decode(encoding)
    assert code == 0 and "<= 0.1 %" in out and "report: runs" in out and "?" not in out


def test_a_diverged_case_is_listed_with_its_time_and_the_exit_code_is_1(world, call, tmp_path):
    world.diverging["heun", 8.0] = 4.0
    code, out, _ = call("run", write_campaign(tmp_path))
    assert code == 1
    assert "diverged v08.00_heun_50ms at 4 s" in words(out)
    assert "1 of 3 lost" in words(out)


def test_a_report_that_fails_is_told_after_the_table(world, call, tmp_path, monkeypatch):
    def broken(folder):
        raise ValueError("no ink")

    monkeypatch.setattr("fatigue_runner.report.write_report", broken)
    code, out, _ = call("run", write_campaign(tmp_path))
    assert code == 1
    assert "rk4 100 ms" in out
    assert "no report: ValueError: no ink `fatigue-runner report runs/toy --debug` tries again" in words(out)


def test_wrong_input_is_one_sentence_without_a_traceback_and_the_exit_code_is_2(world, call, tmp_path):
    code, out, err = call("run", write_campaign(tmp_path, CAMPAIGN.replace("speeds", "sped")))
    assert code == 2
    assert err.replace(f"{tmp_path}/", "") == (
        "error: toy.yaml:6: unknown key 'sped' in wind; did you mean 'speeds'?\n"
    )
    assert "Traceback" not in out
    assert not (tmp_path / "runs").exists()


def test_a_missing_file_is_wrong_input(call):
    code, _, err = call("run", "gone.yaml")
    assert (code, err) == (2, "error: gone.yaml: no such file\n")


def test_debug_shows_the_traceback(world, call, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["fatigue-runner", "run", "gone.yaml", "--debug"])
    with pytest.raises(fatigue_runner.errors.InputError):
        cli.main()


def test_an_interruption_ends_with_130_and_says_how_to_go_on(world, call, tmp_path, monkeypatch):
    def interrupt(self, records):
        raise KeyboardInterrupt

    monkeypatch.setattr("fatigue_runner.campaign.progress.Progress.advance", interrupt)
    code, _, err = call("run", write_campaign(tmp_path))
    assert code == 130
    assert err == "error: interrupted: 12 of 12 cases are finished; the same command runs the rest\n"


def test_an_interruption_before_anything_ran_ends_with_130_too(call, tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("fatigue_runner.campaign.run.read_plan", interrupt)
    assert call("run", write_campaign(tmp_path))[0] == 130


@pytest.mark.parametrize("command", sorted(cli.MOUNTED))
def test_every_command_that_is_ended_says_so_in_one_sentence(call, monkeypatch, command):
    def ended(self, ctx):
        raise Ended(signal.SIGTERM)

    monkeypatch.setattr(cli.TyperGroup, "invoke", ended)
    assert call(command) == (143, "", "error: interrupted; the same command does the rest\n")


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_real_signal_ends_logs_make_with_a_sentence_and_its_code(number):
    """The work itself is stood in for by a wait: what ends it is the command line's."""
    program = (
        "import sys, time, types\n"
        "def make_logs(*_):\n    print('at work', flush=True)\n    time.sleep(100)\n"
        "sys.modules['fatigue_runner.campaign'] = types.SimpleNamespace(make_logs=make_logs)\n"
        "sys.argv = ['fatigue-runner', 'logs', 'make', 'runs/x', '--all']\n"
        "from fatigue_runner.__main__ import main\n"
        "main()\n"
    )
    # a test run in the background may ignore SIGINT, which its children would inherit
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(number, signal.SIG_DFL),
    )  # fmt: skip
    assert process.stdout is not None and process.stdout.readline() == "at work\n"
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (128 + number, "error: interrupted; the same command does the rest\n")


def test_a_bug_is_told_as_one_without_a_traceback(call, tmp_path, monkeypatch):
    def broken(*_):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr("fatigue_runner.campaign.run.read_plan", broken)
    code, out, err = call("run", write_campaign(tmp_path))
    assert code == 1
    assert err.startswith("internal error: ZeroDivisionError: division by zero; please report it")
    assert "Traceback" not in out + err


def test_a_mistyped_command_names_the_nearest_one(call):
    code, _, err = call("rnu")
    assert code == 2
    assert "run" in err and "rnu" in err


def test_help_shows_an_example(call):
    code, out, _ = call("--help")
    assert code == 0
    assert "fatigue-runner run campaigns/quickstart.yaml" in words(out)
    for command in ("run", *cli.MOUNTED):
        assert call(command, "--help")[0] == 0
        assert command in out


def test_version_is_the_package_version(call):
    assert call("--version") == (0, f"fatigue-runner {fatigue_runner.__version__}\n", "")


def test_report_of_a_folder_without_results_is_wrong_input(call, tmp_path):
    code, _, err = call("report", tmp_path)
    assert code == 2
    assert "holds no results.csv" in err


def test_turbine_prints_the_published_check_values(call):
    # NREL/TP-500-38060: blade 17 740 kg, 363 231 kg.m, 11 776 047 kg.m2; tower 347 460 kg, centre 38.234 m.
    code, out, _ = call("turbine", "nrel5mw", "--wind", 8)
    assert code == 0
    for value in ("17,740", "363,231", "11,776,0", "347,460", "38.234"):
        assert value in out
    for mode in ("tower fore-aft", "tower side-side", "drivetrain and collective edge 2"):
        assert mode in out


def test_an_unknown_turbine_names_the_nearest_one(call):
    code, _, err = call("turbine", "nrel5m")
    assert code == 2
    assert "did you mean 'nrel5mw'" in err


@pytest.mark.parametrize(
    "command",
    [
        ["train", "recipe.yaml", "--out", "taken"],
        ["benchmark", "work-precision", "--out", "taken"],
        ["benchmark", "paper", "--out", "taken"],
        ["benchmark", "kernel", "--json", "no/x.json"],
        ["turbine", "show", "nrel5mw", "--plot", "no/x.png"],
        ["turbine", "show", "nrel5mw", "--plot", "x.txt"],
        ["view", "run", "--save", "no/x.rrd"],
        ["view", "run", "--save", "x.txt"],
    ],
    ids=" ".join,
)
def test_commands_refuse_what_they_cannot_write_before_they_begin(command, call, tmp_path):
    (tmp_path / "taken").write_text("")
    code, _, said = call(*command)
    assert code == 2
    assert any(why in said for why in ("is a file", "is not a folder", "must end in"))


def test_what_will_be_written_after_long_work_is_refused_before_it(tmp_path):
    from fatigue_runner.terminal import writable_file, writable_folder

    (tmp_path / "file").write_text("")
    assert writable_file(tmp_path / "x.png", "--plot", (".png",)) == tmp_path / "x.png"
    assert writable_folder(tmp_path / "new" / "deep", "--out") == tmp_path / "new" / "deep"
    assert writable_file(None, "--json") is writable_folder(None, "--out") is None
    assert os.listdir(tmp_path) == ["file"], "nothing is left behind"
    for check, said in (
        (lambda: writable_file(tmp_path, "--json"), "is a folder; give --json the name of a file"),
        (lambda: writable_file(tmp_path / "x.txt", "--plot", (".png", ".svg")), "must end in .png or .svg"),
        (lambda: writable_file(tmp_path / "no" / "x", "--json"), "no is not a folder; make it first, or give --json another path"),
        (lambda: writable_folder(tmp_path / "file", "--out"), "file is a file; give --out a folder"),
        (lambda: writable_folder(tmp_path / "file" / "deep", "--out"), "file is a file; give --out a folder"),
        (lambda: writable_folder(Path("/proc/x"), "--out"), "/proc/x cannot be written"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=said):
            check()


def test_version_tells_what_a_report_of_a_bug_needs():
    from fatigue_runner.version_command import facts

    told = facts()
    assert told["fatigue-runner"] == fatigue_runner.__version__ and told["numba"][0].isdigit()
    assert {"code", "system", "kernel cache", "torch"} <= told.keys()
