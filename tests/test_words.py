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


# Participles, pronouns and prepositions say nothing about what they hold: a fit, a message, a request, a flight.
NO_NOUNS = {
    "found", "said", "told", "asked", "one", "known", "given", "kept", "drawn", "stated", "whole", "at", "one_by_one",
    "other_blades", "of_the_day", "mine",
}  # fmt: skip
# Allowed in docs and tests for now, and nowhere else.
OTHER_NO_NOUNS = {
    "beyond", "both", "far", "heard", "held", "here", "how", "kin", "lot", "of", "shown", "such", "theirs",
    "there", "thing", "together", "way",
}  # fmt: skip
WITH_OTHERS = ("docs", "tests")


@pytest.mark.parametrize("folder", FOLDERS)
def test_names_of_variables_parameters_and_functions_are_nouns_or_verbs(folder: str) -> None:
    """A method is exempt if it reads with its class or object: `Constants.of(aircraft)`."""
    words = NO_NOUNS if folder in WITH_OTHERS else NO_NOUNS | OTHER_NO_NOUNS
    names = [
        f"{path}:{getattr(node, 'lineno', 0)}: {name}"
        for path, node in nodes(binding(words), (folder,))
        for name in bound_names(node)
        if name.strip("_") in words
    ]
    assert names == []


# Phrases that puzzled readers. Things are reported, shown, distinguished or named; they are not told.
PUZZLING = re.compile(
    r"\b(?:(?:is|are|was|were|been) told|as it were|anew|(?:is|was) said of|[Bb]ut for|[Tt]o and fro|"
    r"one after the other|mend(?:s|ed|ing)|[Tt]ells? apart)\b|as of `"
)
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


def binding(words: set[str]) -> re.Pattern[str]:
    """A pattern of code that binds one of these names, which prose hardly matches: only files with a match are
    parsed."""
    word = rf"\*{{0,2}}_?(?:{'|'.join(sorted(words))})\b"
    return re.compile(
        rf"(?:^ *|[(\[] ?)(?:[\w.*()]+, )*\(?(?:self\.)?{word}\)?(?:, [\w.*()]+)* (?::?=(?!=))"  # x, held = ...
        rf"|\bfor \(?(?:[\w*()]+, )*\(?{word}\)?(?:, [\w*()]+)*\)? in "
        rf"|[(,] ?{word}(?:: |=)|^ +{word}: |\bdef \w+\([^)\n]*\b{word}"
        rf"|\blambda (?:\w+, )*{word}|\bas {word}:|\bdef {word}",
        re.MULTILINE,
    )


def nodes(pattern: re.Pattern[str], folders: tuple[str, ...] = FOLDERS) -> Iterator[tuple[Path, ast.AST]]:
    """The path and each node of our files in which the pattern occurs."""
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*.py")):
            if pattern.search(path.read_text("utf-8")):
                for node in nodes_of(path):
                    yield path.relative_to(ROOT), node


def bound_names(node: ast.AST) -> list[str]:
    """The variables, fields, parameters and functions outside classes that a node binds, itself or in its body."""
    if isinstance(node, ast.arg):
        return [node.arg]
    if isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
        return [node.id if isinstance(node, ast.Name) else node.attr]
    if isinstance(node, ast.Module | ast.FunctionDef):
        return [inner.name for inner in node.body if isinstance(inner, ast.FunctionDef)]
    return []


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ("held = 1", ["held"]),
        ("self._thing = 1", ["_thing"]),
        ("def fit(both): ...", ["fit", "both"]),
        ("def flown():\n    def beyond(): ...", ["flown", "beyond"]),
        ("class Pool:\n    way: int\n    def of(self): ...", ["way", "self"]),
        ("for a, here in pairs: print(far)", ["a", "here"]),
    ],
)
def test_all_ways_to_bind_a_name_are_seen(source: str, names: list[str]) -> None:
    assert all(binding({name}).search(source) for name in names if name != "self")
    assert [name for node in ast.walk(ast.parse(source)) for name in bound_names(node)] == names
