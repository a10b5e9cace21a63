"""Names of our modules, as imports write them, and the files that hold them, read once in each process of the tests."""

import ast
from functools import cache
from pathlib import Path

PARTS = ("analysis", "daq", "flight", "hw_fakes", "sim")  # installed inside `flightpower`; in the repository beside it


def dotted_path(module: str) -> str:
    """The folders and the file of a module, with dots: `flightpower.daq.config` lies in daq."""
    inside = module.removeprefix("flightpower.")
    return inside if inside.split(".")[0] in PARTS else module


def module_of(dotted: str) -> str:
    """The name by which imports know a file."""
    return f"flightpower.{dotted}" if dotted.split(".")[0] in PARTS else dotted


def syntax_of(path: Path) -> ast.Module:
    """The syntax of a file."""
    return _parsed(path.read_text("utf-8"))


def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """All nodes of a file's syntax."""
    return _nodes(path.read_text("utf-8"))


@cache
def _parsed(text: str) -> ast.Module:
    return ast.parse(text)


@cache
def _nodes(text: str) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(_parsed(text)))
