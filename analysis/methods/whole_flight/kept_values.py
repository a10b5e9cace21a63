"""Functions of named parameters that keep their last values.

A numerical derivative changes one parameter at a time, and most terms of a balance depend on only a few parameters.
"""

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from flightpower.analysis.estimation.model import NamedValues

T = TypeVar("T")


class _Noted(NamedValues):
    """Parameters that record in `noted` which of them are read, and their values."""

    def __init__(self, values: NamedValues):
        self._source = values
        self.noted: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        value = self.noted[name] = self._source[name]
        return value


class Kept(Generic[T]):
    """A function of parameters that is computed again only if a parameter that it has read has another value.

    It may call other such functions; their reads count as its own. While a numerical derivative changes each parameter
    once, the value at the unchanged parameters is kept.
    """

    def __init__(self, function: Callable[[NamedValues], T]):
        self._function = function
        self._entries: list[tuple[dict[str, Any], T]] = []

    def __call__(self, p: NamedValues) -> T:
        for noted, value in self._entries:
            if all(p[name] == last for name, last in noted.items()):  # p[name] also counts as a caller's read
                return value
        seen = _Noted(p)
        value = self._function(seen)
        self._entries = [(seen.noted, value), *self._entries[: len(seen.noted) + 1]]
        return value
