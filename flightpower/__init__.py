"""Power required of small electric aircraft: functions for programs (python.md), and the command `flightpower`.

Nothing is imported before it is used: importing NumPy, SciPy and pandas takes a second, and the daemon has none of
them.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flightpower.analysis import estimation
    from flightpower.interface import (
        Comparison,
        Flight,
        FlightPlan,
        InputError,
        Log,
        Options,
        PlanOptions,
        Pool,
        Recording,
        Results,
        analyze,
        compare,
        export,
        plan,
        pool,
        read,
        reasons_not_to_trust,
        tables,
        write_report,
    )

__all__ = [
    "Comparison",
    "Flight",
    "FlightPlan",
    "InputError",
    "Log",
    "Options",
    "PlanOptions",
    "Pool",
    "Recording",
    "Results",
    "analyze",
    "compare",
    "estimation",
    "export",
    "plan",
    "pool",
    "read",
    "reasons_not_to_trust",
    "tables",
    "write_report",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'flightpower' has no attribute {name!r}")
    if name == "estimation":
        return importlib.import_module("flightpower.analysis.estimation")
    return getattr(importlib.import_module("flightpower.interface"), name)


def __dir__() -> list[str]:
    return __all__
