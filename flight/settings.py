"""Thresholds and priors as typed, documented records: each has its unit, and the reason for its value or its source.

A package keeps its own settings in `settings.py`, one record per subject:

    @dataclass(frozen=True)
    class LevelRuns(Settings):
        "What counts as a level acceleration or deceleration."

        shortest_s: float = setting(3.0, "s", "a shorter run holds fewer than ten independent samples of drag")

    LEVEL_RUNS = LevelRuns()

The site's page of assumed values is made from these records. A value that follows from another setting, from the noise
or from the aircraft's size is not a setting; it is computed.
"""

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, field, fields
from typing import Any, NamedTuple, TypeVar

T = TypeVar("T")
NORMAL_95 = 1.959963984540054  # half-width of a 95 % interval in standard errors; a number because daq has no SciPy


def setting(value: T, unit: str, reason: str) -> T:
    """The default of a field of `Settings`. unit: "1" for a ratio; reason: why this value, or its source.

    A table of similar numbers is one setting, whose value is a mapping.
    """
    metadata = {"unit": unit, "reason": reason}
    if isinstance(value, Mapping):  # dataclasses reject a mutable default
        return field(default_factory=lambda: value, metadata=metadata)
    return field(default=value, metadata=metadata)


class Described(NamedTuple):
    """A setting with its unit and reason."""

    name: str
    value: Any
    unit: str
    reason: str


class Settings:
    """Base of all records of settings; subclasses are frozen dataclasses."""

    @classmethod
    def described(cls) -> Iterator[Described]:
        """All settings of the record with their defaults."""
        for setting_field in fields(cls):  # type: ignore[arg-type]
            value = (
                setting_field.default if setting_field.default_factory is MISSING else setting_field.default_factory()
            )
            yield Described(setting_field.name, value, setting_field.metadata["unit"], setting_field.metadata["reason"])
