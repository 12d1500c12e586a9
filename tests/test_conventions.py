"""What the tests promise of themselves: each lies in the folder of its room, and each slow one says why it is slow."""

from __future__ import annotations

import ast

import pytest
from places import ROOT, TESTS

FILES = sorted(TESTS.rglob("test_*.py"))


def slow_marks(tree: ast.AST) -> list[ast.Attribute]:
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and ast.unparse(node) == "pytest.mark.slow"
    ]


def reasons(tree: ast.AST) -> list[str]:
    """The reasons of all slow marks; a mark without one has none here."""
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and slow_marks(node.func)]
    given = [{word.arg: word.value for word in call.keywords}.get("reason") for call in calls]
    return [text.value for text in given if isinstance(text, ast.Constant) and isinstance(text.value, str)]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(TESTS).as_posix())
def test_a_slow_test_says_why(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    given = reasons(tree)
    assert len(given) == len(slow_marks(tree)), 'write pytest.mark.slow(reason="what takes the time")'
    assert [text for text in given if len(text) < 10] == []


@pytest.mark.parametrize(
    ("code", "given"),
    [
        ("pytestmark = pytest.mark.slow", []),
        ("@pytest.mark.slow()\ndef test(): ...", []),
        ("@pytest.mark.slow(reason='trains a network')\ndef test(): ...", ["trains a network"]),
    ],
)
def test_a_mark_without_a_reason_is_seen(code, given):
    tree = ast.parse(code)
    assert (len(slow_marks(tree)), reasons(tree)) == (1, given)


def test_folders_of_tests_are_rooms_of_the_package():
    for path in FILES:
        room = path.parent.relative_to(TESTS)
        assert (ROOT / "fatigue_runner" / room).is_dir(), f"{path}: the package has no room {room}"
