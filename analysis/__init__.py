"""From a log to power required: air data, trajectory, maneuvers, drag polar, performance, report.

Imports only `flight` of ours. As a library: `from analysis import read, analyze, tables, export, write_report`
(docs/python.md); these are imported when they are first asked for, since NumPy, SciPy and pandas take a second.
"""

import importlib
from typing import Any

INTERFACE = ("read", "analyze", "tables", "export", "write_report")


def __getattr__(name: str) -> Any:
    if name not in INTERFACE:
        raise AttributeError(f"module 'analysis' has no attribute {name!r}")
    return getattr(importlib.import_module("analysis.exports.interface"), name)
