"""Open logs in a window, in a browser, or write them to a file for later. Viewers listen on this machine only."""

from __future__ import annotations

import ctypes
import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from time import monotonic, sleep
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from fatigue_runner.errors import InputError
from fatigue_runner.terminal import writable_file

if TYPE_CHECKING:
    from fatigue_runner.viewer.cases import Viewed

HOST = "127.0.0.1"
WEB_PORT = 9090
_PR_SET_PDEATHSIG = 1  # linux/prctl.h
_START_SECONDS = 20.0
_WRITE_SECONDS = 300.0
INSTALL = "pip install 'rerun-sdk>=0.41,<0.42'"


def view(
    paths: Sequence[str | Path],
    save: str | Path | None = None,
    web: bool = False,
    *,
    case: str | None = None,
    scale: float = 1.0,
    turbine: str | None = None,
    port: int | None = None,
    say: Callable[[str], Any] = print,
) -> None:
    """Show logs, or the logs of one wind in a run folder, in Rerun; returns when the viewer is closed.

    save: write this .rrd instead of opening a window. web: serve a page on this machine instead, until Ctrl-C; port: of that
    page. case: id of the case to show of a run folder. scale: times true deflection. turbine: name or file of the turbine to
    draw, default as the logs say. Raises InputError where there is nothing to show, or nothing to show it with.
    """
    if not 0.0 < scale <= 50.0:
        raise InputError(f"--scale must be above 0 and at most 50, got {scale:g}")
    writable_file(None if save is None else Path(save), "--save", (".rrd",))
    require_rerun()
    if save is None and not web:
        require_display()
    from fatigue_runner.viewer.cases import find_logs, read_cases

    cases = read_cases(find_logs([Path(p) for p in paths], case), turbine)
    for seen in cases:
        if seen.log.lost:
            say(f"{seen.label}: shown up to {seen.log.time[-1]:g} s, the rest is damaged ({seen.log.lost})")
    if save is not None:
        write_recording(Path(save), cases, scale)
        say(f"saved: {save}; open it with `rerun {save}`")
        return
    with tempfile.TemporaryDirectory(prefix="fatigue-runner-") as folder:
        recording = Path(folder) / "turbine.rrd"
        write_recording(recording, cases, scale)
        if web:
            serve(recording, port or WEB_PORT, say)
        else:
            say("the viewer is open; it ends with its window, or with Ctrl-C")
            with viewer(recording, "--port", str(free_port())) as process:
                wait(process)


def write_recording(path: Path, cases: Sequence[Viewed], scale: float = 1.0, playing: bool = True) -> None:
    """Write cases with their first screen as an .rrd. Raises InputError where it cannot be written."""
    import rerun as rr

    from fatigue_runner.viewer.blueprint import first_screen
    from fatigue_runner.viewer.recording import Stage

    if path.is_dir() or not path.parent.is_dir():
        raise InputError(f"{path} cannot be written; give the name of a file in a folder that exists")
    recording = rr.RecordingStream("fatigue-runner")
    try:
        recording.save(path, default_blueprint=first_screen(cases, playing))
        stage = Stage(recording, cases, scale)
        stage.set_up()
        for case in cases:
            stage.send(case)
        recording.flush(timeout_sec=_WRITE_SECONDS)
    except (OSError, RuntimeError) as error:
        raise InputError(f"{path} cannot be written: {' '.join(str(error).split())}") from None
    finally:
        recording.disconnect()


def serve(recording: Path, port: int, say: Callable[[str], Any] = print) -> None:
    """Serve a recording as a page on this machine until Ctrl-C. Raises InputError for a port that is in use."""
    require_free(port)
    data_port = free_port()
    with viewer(
        recording, "--serve-web", "--port", str(data_port), "--web-viewer-port", str(port)
    ) as process:
        _wait_until_served(process, port)
        say(f"open {page_address(port, data_port)} in a browser on this machine; Ctrl-C ends")
        wait(process)


def page_address(port: int, data_port: int) -> str:
    """Address of the web viewer that shows what is sent to `data_port`."""
    source = quote(f"rerun+http://{HOST}:{data_port}/proxy", safe="")
    return f"http://{HOST}:{port}/?url={source}"


@contextmanager
def viewer(*arguments: str | Path) -> Iterator[subprocess.Popen[bytes]]:
    """A viewer process on the loopback interface, ended with the block. Its own chatter is kept from the user."""
    process = start_viewer(*arguments)
    try:
        yield process
    finally:
        end(process)


# The viewer reports its use to its makers unless it was told not to in a file of the user's, or runs in continuous integration.
SILENT = {"CI": "1"}


def start_viewer(*arguments: str | Path, own_session: bool = True) -> subprocess.Popen[bytes]:
    """Start the viewer's program itself: the `rerun` script is a wrapper, and stopping that leaves the viewer alone.

    own_session: keep it from the Ctrl-C of this terminal, and let it end with this process, whatever ends that. Without it the viewer
    stays open.
    """
    command = [str(program()), "--bind", HOST, "--hide-welcome-screen", *map(str, arguments)]
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **SILENT},
        start_new_session=own_session,
        preexec_fn=_ends_with_its_parent() if own_session else None,
    )


def _ends_with_its_parent() -> Callable[[], None] | None:
    """What a new process does first, so that Linux ends it with this one; None on other systems."""
    try:
        libc, parent = ctypes.CDLL(None), os.getpid()
        libc.prctl  # noqa: B018  (looked up here: between fork and exec nothing should be)
    except (OSError, TypeError, AttributeError):
        return None

    def ask() -> None:
        libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it has gone meanwhile
            os._exit(1)

    return ask


def end(process: subprocess.Popen[bytes]) -> None:
    """End a process that may not want to."""
    if process.poll() is not None:
        return
    process.terminate()
    try:
        process.wait(timeout=3.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def wait(process: subprocess.Popen[bytes]) -> None:
    """Until the viewer is closed; Ctrl-C is the usual way to say so. Raises InputError where it did not start well."""
    started = monotonic()
    try:
        code = process.wait()
    except KeyboardInterrupt:
        return
    if code and monotonic() - started < _START_SECONDS:
        raise InputError(
            f"the viewer ended at once with code {code}; it needs a graphics driver: try --web, or --save FILE.rrd and open "
            "that on another machine"
        )


def _wait_until_served(process: subprocess.Popen[bytes], port: int) -> None:
    import urllib.request  # slow to load, and the process beside a run must not be

    deadline = monotonic() + _START_SECONDS
    while monotonic() < deadline:
        if process.poll() is not None:
            raise InputError(
                f"the web viewer ended at once with code {process.returncode}; try --save FILE.rrd"
            )
        try:
            with urllib.request.urlopen(f"http://{HOST}:{port}/", timeout=1.0):
                return
        except OSError:
            sleep(0.1)
    raise InputError(f"the web viewer does not answer on port {port}; try --save FILE.rrd")


def require_rerun() -> None:
    """Raises InputError with the command that installs the viewer where it is missing."""
    if find_spec("rerun") is None or find_spec("rerun_cli") is None:
        raise InputError(f"the viewer is not installed; install it with {INSTALL}")


def require_display(
    way_out: str = "use --web and a browser, or --save FILE.rrd and open that elsewhere",
) -> None:
    """Raises InputError, with the way out, where no window can be opened."""
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise InputError(f"there is no display to open a window on; {way_out}")


def require_free(port: int) -> None:
    """Raises InputError where somebody listens on a port of this machine."""
    with socket.socket() as probe:
        # as the viewer does: a port that was just left by another viewer is free
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            raise InputError(
                f"port {port} cannot be used ({error.strerror}); choose another with --port"
            ) from None


def listens(port: int) -> bool:
    """Whether somebody listens on a port of this machine."""
    try:
        with socket.create_connection((HOST, port), timeout=1.0):
            return True
    except OSError:
        return False


def free_port() -> int:
    """A port of this machine on which nobody listens now."""
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])


def program() -> Path:
    """The viewer's program in the installed wheel. Raises InputError where it is missing."""
    spec = find_spec("rerun_cli")
    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    for folder in (spec.submodule_search_locations or []) if spec else []:
        if (Path(folder) / name).is_file():
            return Path(folder) / name
    raise InputError(f"the viewer is not installed; install it with {INSTALL}")
