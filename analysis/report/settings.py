"""From when on a page says that something is large."""

from dataclasses import dataclass

from flight.settings import Settings, setting


@dataclass(frozen=True)
class Report(Settings):
    """The answers to "how sure, and why"."""

    colored_share: float = setting(
        0.10, "1", "lags beyond the 95 % bound of white noise that may be chance in a run of a few seconds"
    )
    range_differs_mps: float = setting(0.2, "m/s", "speeds of least drag and longest range that differ visibly")


REPORT = Report()
