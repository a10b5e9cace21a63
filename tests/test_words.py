"""Docstrings are sentences with a subject: none begins as a phrase whose noun stands in the signature."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDERS = ("analysis", "benchmarks", "daq", "debian", "docs", "flight", "flightpower", "hw_fakes", "sim", "tests")
WITHOUT_SUBJECT = ("Of ", "By ", "The same")
BEGUN_SO = re.compile(rf"[\"']\s*(?:{'|'.join(WITHOUT_SUBJECT)})")  # only such files are parsed
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def test_no_docstring_lacks_its_subject() -> None:
    results = [
        f"{path.relative_to(ROOT)}: {text.splitlines()[0]}"
        for folder in FOLDERS
        for path in sorted((ROOT / folder).rglob("*.py"))
        if BEGUN_SO.search(source := path.read_text("utf-8"))
        for node in ast.walk(ast.parse(source))
        if isinstance(node, DOCUMENTED) and (text := ast.get_docstring(node) or "").startswith(WITHOUT_SUBJECT)
    ]
    assert results == []
