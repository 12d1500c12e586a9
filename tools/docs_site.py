"""The documentation site's hooks (mkdocs.yml): what lies outside docs/ and is shown all the same.

README.md is the first page, CONTRIBUTING.md and CHANGELOG.md are pages; a link from any page to another file of the repository leads to
a copy of it; every room of the package has a page of reference from its docstrings. A link that leads nowhere stays as it is, so that
`mkdocs build --strict` refuses it.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parents[1]
# Where a document of the repository's top stands in the site.
PAGES = {"README.md": "index.md", "CONTRIBUTING.md": "CONTRIBUTING.md", "CHANGELOG.md": "CHANGELOG.md"}
COPIES = "repository"  # the folder of the copies in the site
REFERENCE = "reference"

_LINK = re.compile(r"(\]\()([^)\s#]+)((?:#[^)\s]*)?\))")
_FENCE = re.compile(r"^(```.*?^```)", re.MULTILINE | re.DOTALL)


def rooms() -> list[str]:
    """The packages of the program that have a page of reference, by name."""
    return sorted(path.parent.name for path in (ROOT / "fatigue_runner").glob("*/__init__.py"))


def decisions() -> list[str]:
    """The pages of the decision records, in their order."""
    return [f"decisions/{path.name}" for path in sorted((ROOT / "docs" / "decisions").glob("[0-9]*.md"))]


def on_config(config: Any) -> Any:
    """Put the decisions and the rooms' pages under their headings of the menu."""
    headings = {name: pages for part in config.nav for name, pages in part.items()}
    headings["Decisions"] += decisions()
    headings["Reference"] += [{room: f"{REFERENCE}/{room}.md"} for room in rooms()]
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that lie outside docs/, the rooms', and copies of the files that any page links to."""
    for name, place in PAGES.items():
        files.append(File.generated(config, place, content=(ROOT / name).read_text(encoding="utf-8")))
    for room in rooms():
        files.append(
            File.generated(
                config, f"{REFERENCE}/{room}.md", content=f"# {room}\n\n::: fatigue_runner.{room}\n"
            )
        )
    wanted = {
        target
        for file in files.documentation_pages()
        for target in targets(file.src_uri, file.content_string)
    }
    for path in sorted(wanted):
        files.append(File.generated(config, f"{COPIES}/{path}", abs_src_path=str(ROOT / path)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """The page with its links as the site needs them."""
    return rewritten(page.file.src_uri, markdown)


def repository_path(page: str) -> str:
    """Where a page of the site lies in the repository."""
    return next((name for name, place in PAGES.items() if place == page), f"docs/{page}")


def site_path(path: str) -> str | None:
    """Where a file of the repository lies in the site; None for one that is not there."""
    if path in PAGES:
        return PAGES[path]
    if path.startswith("docs/"):
        return path.removeprefix("docs/")
    return f"{COPIES}/{path}" if (ROOT / path).is_file() else None


def targets(page: str, markdown: str) -> set[str]:
    """The files of the repository, neither pages nor in docs/, that a page links to."""
    found = (resolved(page, link) for _, link, _ in links(markdown))
    return {path for path in found if (site_path(path) or "").startswith(f"{COPIES}/")}


def rewritten(page: str, markdown: str) -> str:
    """A page's text with every link into the repository turned into one into the site."""
    folder = posixpath.dirname(page)

    def turned(match: re.Match[str]) -> str:
        before, link, after = match.groups()
        place = None if is_address(link) else site_path(resolved(page, link))
        return f"{before}{posixpath.relpath(place, folder or '.')}{after}" if place else match[0]

    parts = _FENCE.split(markdown)
    return "".join(part if _FENCE.match(part) else _LINK.sub(turned, part) for part in parts)


def links(markdown: str) -> list[tuple[str, str, str]]:
    """(before, target, after) of all relative links outside of fenced code."""
    found = _LINK.findall(_FENCE.sub("", markdown))
    return [link for link in found if not is_address(link[1])]


def is_address(link: str) -> bool:
    return "://" in link or link.startswith(("mailto:", "/"))


def resolved(page: str, link: str) -> str:
    """The path in the repository that a link of a page means."""
    return posixpath.normpath(posixpath.join(posixpath.dirname(repository_path(page)), link))
