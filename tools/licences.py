"""Under which licence each dependency is: docs/licences.md, from the metadata of the packages that are installed here.

    python tools/licences.py            writes the page
    python tools/licences.py --check    says what is no longer so

Listed are the packages that a plain install brings, with what they bring themselves, and what each extra names.
"""

from __future__ import annotations

import re
import sys
import tomllib
from importlib import metadata
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement

PAGE = Path(__file__).parents[1] / "docs" / "licences.md"
PROJECT = PAGE.parents[1] / "pyproject.toml"
HEAD = """# Licences of the dependencies

Fatigue Runner is under the Apache License 2.0. It ships no code of others; pip brings these packages, each under its own licence, as its
metadata say it. Made by `python tools/licences.py`; a test holds the page to what is installed.

| package | licence | brought by |
|---|---|---|
"""
_SPDX = {
    "mit license": "MIT", "the mit license": "MIT", "mit": "MIT", "bsd license": "BSD", "3-clause bsd license": "BSD-3-Clause",
    "bsd 3-clause": "BSD-3-Clause", "apache software license": "Apache-2.0", "apache 2.0": "Apache-2.0",
    "apache license 2.0": "Apache-2.0", "python software foundation license": "PSF", "bsd 2-clause license": "BSD-2-Clause",
    "mozilla public license 2.0 (mpl 2.0)": "MPL-2.0", "isc license (iscl)": "ISC", "isc license": "ISC",
}  # fmt: skip


def rows() -> dict[str, tuple[str, str]]:
    """{package: (licence, what brings it)} of what is installed."""
    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    found: dict[str, str] = {}
    left = [(text, "plain install") for text in project["dependencies"]]
    while left:
        text, brought_by = left.pop(0)
        needed = Requirement(text)
        name = canonical(needed.name)
        if name in found or (needed.marker and not needed.marker.evaluate({"extra": ""})):
            continue
        try:
            left += [(under, name) for under in metadata.requires(name) or ()]
        except metadata.PackageNotFoundError:
            continue
        found[name] = brought_by
    for extra, texts in project["optional-dependencies"].items():
        for name in (canonical(Requirement(text).name) for text in texts):
            if name not in found and name != project["name"] and _installed(name):
                found[name] = f"`[{extra}]`"
    return {name: (licence(name), brought_by) for name, brought_by in sorted(found.items())}


def licence(package: str) -> str:
    """As SPDX writes it where that is known, else in the package's own words."""
    about: Any = metadata.metadata(package)
    said = about.get("License-Expression") or about.get("License") or ""
    if not said or len(said) > 60 or "\n" in said:
        named = [
            c.rpartition(" :: ")[2] for c in about.get_all("Classifier") or () if c.startswith("License ::")
        ]
        said = ", ".join(named) or said.partition("\n")[0]
    return _SPDX.get(said.strip().lower(), said.strip()) or "see its files"


def listed() -> dict[str, tuple[str, str]]:
    """What the page says."""
    text = PAGE.read_text(encoding="utf-8") if PAGE.is_file() else ""
    return {
        m[1]: (m[2], m[3])
        for m in re.finditer(r"^\| ([\w.-]+) \| (.+?) \| (.+?) \|$", text, re.M)
        if m[1] != "package"
    }


def differences() -> list[str]:
    """Sentences on what the page says otherwise than the packages that are installed here; of others it may tell."""
    installed, told = rows(), listed()
    said = [f"{name} is missing on {PAGE.name}" for name in installed.keys() - told.keys()]
    return sorted(said) + [
        f"{name}: {PAGE.name} says {told[name][0]!r}, the package {row[0]!r}"
        for name, row in installed.items()
        if name in told and told[name][0] != row[0]
    ]


def canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _installed(name: str) -> bool:
    return any(True for _ in metadata.distributions(name=name))


def main() -> int:
    if "--check" in sys.argv[1:]:
        found = differences()
        print("\n".join(found))
        return 1 if found else 0
    lines = (f"| {name} | {licence} | {brought_by} |\n" for name, (licence, brought_by) in rows().items())
    PAGE.write_text(HEAD + "".join(lines), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
