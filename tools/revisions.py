"""Two source trees beside each other: the working tree, and a git revision that it is compared with."""

from __future__ import annotations

import argparse
import io
import os
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BASELINE = "2ae44e5"  # the last commit before layout, ensemble and integrator became one description each
PARTS = ("fatigue_runner", "correctors", "campaigns")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments that say what the working tree is compared with."""
    parser.add_argument(
        "revision", nargs="?", help=f"default: the last tag, or {BASELINE} where there is none"
    )
    parser.add_argument(
        "--tree", type=Path, help="a source tree that is there already, instead of a revision"
    )


def base_tree(arguments: argparse.Namespace) -> tuple[str, Path]:
    """The name and the folder of what the working tree is compared with. Exits with a sentence where it cannot be had."""
    if arguments.tree is not None:
        if arguments.revision is not None:
            sys.exit("give a revision or --tree, not both")
        if not (arguments.tree / PARTS[0]).is_dir():
            sys.exit(f"{arguments.tree} holds no {PARTS[0]}/; --tree takes the root of a source tree")
        return str(arguments.tree), arguments.tree.resolve()
    revision = arguments.revision or _last_tag() or BASELINE
    return revision, _extracted(revision)


def _git(*arguments: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, check=False)


def _last_tag() -> str:
    return _git("describe", "--tags", "--abbrev=0").stdout.decode().strip()


def _cache() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fatigue-runner"


def _extracted(revision: str) -> Path:
    """The package at a revision, in a folder that stays.

    `git archive`, not a worktree under a new name: numba's cache looks at a file's path and time, which are the same again here,
    so that the kernels of the revision are compiled once.
    """
    found = _git("rev-parse", "--verify", "--quiet", f"{revision}^{{commit}}")
    if found.returncode:
        sys.exit(f"{revision} is no revision of {ROOT}; fetch it, or give another one or --tree")
    commit = found.stdout.decode().strip()
    folder = _cache() / "revisions" / commit
    if not folder.is_dir():
        archive = _git("archive", commit, *PARTS)
        if archive.returncode:
            sys.exit(f"git archive {commit}: {archive.stderr.decode().strip()}")
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent) as made:
            with tarfile.open(fileobj=io.BytesIO(archive.stdout)) as tar:
                tar.extractall(Path(made) / "tree", filter="data")
            # a run beside this one may have been first
            if not folder.is_dir():
                (Path(made) / "tree").rename(folder)
    return folder


def start(
    tree: Path, script: Path, arguments: Sequence[str], python: str = sys.executable, **options: object
) -> subprocess.Popen[str]:
    """Start a Python script that imports the package of `tree`, one thread, its standard output as text."""
    environment = {
        **os.environ,
        **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"),
        "PYTHONPATH": str(tree),
    }
    if tree != ROOT:
        # the package drops the oldest of its kernels' folders: here the ones of the revision stay, whatever else is compiled
        environment.setdefault("NUMBA_CACHE_DIR", str(_cache() / "revisions" / "kernels"))
    command = [python, str(script), *arguments]
    return subprocess.Popen(command, env=environment, text=True, stdout=subprocess.PIPE, **options)  # type: ignore[call-overload]


def check_import(tree: str) -> None:
    """Exit unless the package is imported from `tree`: an installed one in its place would compare a tree with itself."""
    import fatigue_runner

    found = Path(fatigue_runner.__file__).resolve().parents[1]
    if found != Path(tree).resolve():
        sys.exit(f"imported fatigue_runner from {found}, not from {tree}")
