"""Rows of figures as records, which benchmarks print as tables and `benchmarks/evidence.py` keeps in files."""

import contextlib
import json
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

# By column title: a text, a number, a list of numbers (one per speed), or None for an unknown value.
Record = dict[str, Any]


def rounded(values: ArrayLike, digits: int = 0) -> Any:
    """Round a number, or a list of numbers, for display; None replaces NaN and infinity."""
    if np.ndim(values):
        return [rounded(value, digits) for value in np.asarray(values)]
    value = float(np.asarray(values))
    if not np.isfinite(value):
        return None
    return round(value, digits) + 0.0 if digits else round(value)


def counted(covered: ArrayLike) -> tuple[float, float]:
    """Return the mean of the flights' shares (n,) [%] and its counting error (1 sigma).

    The error comes from the scatter of these flights plus one half-covered flight, so that 0 or 100 % is not certain.
    """
    share = np.asarray(covered, dtype=float)
    with_one_more = np.append(share, 0.5)
    return 100 * float(np.mean(share)), 100 * float(np.std(with_one_more) / np.sqrt(len(with_one_more)))


def text(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, list | tuple):
        return " / ".join(text(part) for part in value)
    return f"{value:,}" if isinstance(value, int) else str(value)


def markdown(records: Sequence[Record]) -> str:
    """Return a Markdown table with the columns of all records, in the order in which they occur."""
    columns = list(dict.fromkeys(name for record in records for name in record))
    lines = [columns, ["---"] * len(columns), *([text(record.get(name, "")) for name in columns] for record in records)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def with_lead(lead: Record, records: Iterable[Record]) -> list[Record]:
    """Return the records with shared columns put before their own."""
    return [{**lead, **record} for record in records]


def ratio(what: str, measured: float, against: float, unit: str, **limit: float) -> Record:
    """Return a row with measured / against. limit: `at_most` or `at_least`, which `benchmarks/bench.py` checks."""
    row = {"what": what, "unit": unit, "measured": significant(measured), "against": significant(against)}
    return row | {"ratio": significant(measured / against)} | {k.replace("_", " "): v for k, v in limit.items()}


def significant(value: float) -> float:
    """Return the number with three significant digits."""
    return float(f"{value:.3g}")


def option(text: str) -> tuple[str, Any]:
    """Return name and value of an option NAME=VALUE; without a value, it is switched on."""
    name, _, value = text.partition("=")
    with contextlib.suppress(ValueError):
        return name, json.loads(value or "true")
    return name, value
