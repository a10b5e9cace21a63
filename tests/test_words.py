"""Docstrings are sentences with a subject, and names are nouns of what they hold."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.our_files import nodes_of

pytestmark = pytest.mark.xdist_group("sources")

ROOT = Path(__file__).parents[1]
FOLDERS = ("analysis", "benchmarks", "daq", "debian", "docs", "flight", "flightpower", "hw_fakes", "sim", "tests")
WITHOUT_SUBJECT = ("Of ", "By ", "The same")
BEGUN_SO = re.compile(rf"[\"']\s*(?:{'|'.join(WITHOUT_SUBJECT)})")  # only such files are parsed
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def test_no_docstring_lacks_its_subject() -> None:
    docstrings = [
        f"{path}: {text.splitlines()[0]}"
        for path, node in nodes(BEGUN_SO)
        if isinstance(node, DOCUMENTED) and (text := ast.get_docstring(node) or "").startswith(WITHOUT_SUBJECT)
    ]
    assert docstrings == []


# Participles and pronouns say nothing about what they hold: a fit, a message, a request, a flight.
NO_NOUNS = {"found", "said", "told", "asked", "one"}
BOUND_SO = re.compile(rf"(?<![\w.])(?:{'|'.join(sorted(NO_NOUNS))})\b(?=\s*(?:=(?!=)|:=|[:,)]| in\b))")


def test_no_variable_or_parameter_is_a_participle_or_a_pronoun() -> None:
    names = [
        f"{path}:{getattr(node, 'lineno', 0)}: {name}"
        for path, node in nodes(BOUND_SO)
        if (name := bound_name(node)) in NO_NOUNS
    ]
    assert names == []


# Phrases that puzzled readers. Things are reported, shown, distinguished or named; they are not told.
PUZZLING = re.compile(r"\b(?:(?:is|are|was|were|been) told|as it were|anew|(?:is|was) said of)\b|as of `")
FOR_READERS = ("README.md", "SECURITY.md", "docs/*/*.md", "systemd/*.md", "firmware/*/*.md",
               *(f"{folder}/**/*.py" for folder in ("analysis", "daq", "flight", "hw_fakes", "sim")))  # fmt: skip


def test_no_sentence_has_a_phrase_that_puzzles() -> None:
    lines = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for pattern in FOR_READERS
        for path in ROOT.glob(pattern)
        for number, line in enumerate(path.read_text("utf-8").splitlines(), start=1)
        if PUZZLING.search(line)
    ]
    assert lines == []


def nodes(pattern: re.Pattern[str]) -> Iterator[tuple[Path, ast.AST]]:
    """The path and each node of our files in which the pattern occurs."""
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            if pattern.search(path.read_text("utf-8")):
                for node in nodes_of(path):
                    yield path.relative_to(ROOT), node


def bound_name(node: ast.AST) -> str:
    """The variable or parameter that a node binds; empty for all other nodes."""
    if isinstance(node, ast.arg):
        return node.arg
    return node.id if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) else ""
