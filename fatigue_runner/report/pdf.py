"""The page as PDF, printed by a Chromium that is installed; the page itself needs none."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from fatigue_runner.errors import FatigueRunnerError, InputError

VARIABLE = "FATIGUE_RUNNER_CHROMIUM"
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
LONGEST = 120  # s; a page of hundreds of cases takes some seconds


def find_chromium() -> str:
    """The program; that of the environment variable, where it is set. Raises InputError where there is none."""
    given = os.environ.get(VARIABLE)
    found = shutil.which(given) if given else next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        missing = (
            f"{VARIABLE} is {given!r}, which is no program" if given else "no Chromium or Chrome is installed"
        )
        raise InputError(
            f"a PDF is printed by a browser, and {missing}; install one, name it in {VARIABLE}, or print report.html from any browser"
        )
    return found


def write_pdf(page: Path) -> Path:
    """Print a page beside itself; only a whole PDF replaces an older one. Raises InputError without a browser, FatigueRunnerError where it
    fails."""
    target = page.with_suffix(".pdf")
    with tempfile.TemporaryDirectory(prefix="fatigue-runner-pdf-") as folder:
        made = Path(folder) / "page.pdf"
        command = [
            find_chromium(), "--headless", "--disable-gpu", "--no-first-run", "--no-pdf-header-footer",
            f"--user-data-dir={folder}/profile", f"--print-to-pdf={made}", page.resolve().as_uri(),
        ]  # fmt: skip
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            command.insert(
                1, "--no-sandbox"
            )  # it refuses to run as root with one; the page is this program's own
        try:
            ran = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise FatigueRunnerError(f"{command[0]} made no PDF of {page}: {error}") from None
        if not made.is_file() or not made.read_bytes().startswith(b"%PDF"):
            said = (ran.stderr.strip().splitlines() or [f"exit code {ran.returncode}"])[-1]
            raise FatigueRunnerError(f"{command[0]} made no PDF of {page}: {said}")
        try:
            shutil.copyfile(made, beside := target.with_name(f"{target.name}.part"))
            os.replace(beside, target)
        except OSError as error:
            raise InputError(
                f"{target} cannot be written: {error.strerror}; make room there, or make the folder writable"
            ) from None
    return target
