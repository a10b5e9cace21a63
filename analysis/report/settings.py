"""How much a page shows, and from when on it says that something is large."""

from dataclasses import dataclass

from flight.settings import Settings, setting


@dataclass(frozen=True)
class Report(Settings):
    """Tables and figures of the pages, and the answers to "how sure, and why"."""

    page_rows: int = setting(12, "1", "about so many points of a curve stand in a table of a page")
    terminal_rows: int = setting(8, "1", "and in a table on the terminal, which has 24 lines")
    most_runs: int = setting(200, "1", "more additional runs than this are no advice")
    large_residual: float = setting(1.5, "1", "rms in standard deviations of a channel's noise that is told as large")
    colored_share: float = setting(
        0.10, "1", "lags beyond the 95 % bound of white noise that may be chance in a run of a few seconds"
    )
    range_differs_mps: float = setting(0.2, "m/s", "speeds of least drag and longest range that differ visibly")
    points_drawn: int = setting(1200, "1", "of a time history; more do not show on a screen")
    significant_digits: int = setting(5, "1", "of values drawn: enough to zoom a little")
    polar_points: int = setting(60, "1", "a smooth drag polar")
    intervals_shown: int = setting(4, "1", "bars on each curve of the comparison of methods; more would overlap")
    section_rad: float = setting(0.017453292519943295, "rad", "1 deg: the other angle in a section of a calibration")
    color_percentile: float = setting(99.0, "1", "of the residuals, at the ends of a color scale: outliers saturate")


REPORT = Report()
