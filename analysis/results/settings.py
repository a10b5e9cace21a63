"""What results.json holds, and from when on it withholds a value."""

from dataclasses import dataclass

from flight.settings import Settings, setting


@dataclass(frozen=True)
class ResultsSettings(Settings):
    """Lengths of what is written, and limits of what follows."""

    longest_lag_s: float = setting(4.0, "s", "of autocorrelations: the gusts of a run are shorter")
    clock_set_unix_s: float = setting(1.5e9, "s", "2017: an earlier time is that of a clock without battery")
    widest_share: float = setting(
        0.4, "1", "half width of an interval over its value beyond which a value for an autopilot is withheld"
    )
    weighed_share: float = setting(0.01, "1", "half width of the 95 % interval of a weighed mass")


RESULTS = ResultsSettings()
