"""Docstrings are sentences with a subject: none begins as a phrase whose noun stands in the signature."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("analysis", "benchmarks", "daq", "debian", "docs", "flight", "flightpower", "hw_fakes", "sim", "tests")
WITHOUT_SUBJECT = ("Of ", "By ", "The same")
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


@pytest.mark.slow
def test_no_docstring_lacks_its_subject() -> None:
    found = [
        f"{path.relative_to(ROOT)}: {text.splitlines()[0]}"
        for folder in FOLDERS
        for path in sorted((ROOT / folder).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, DOCUMENTED) and (text := ast.get_docstring(node) or "").startswith(WITHOUT_SUBJECT)
    ]
    assert found == []
