"""Agreement of the sensors with one another, and the sensor errors that the flight determined."""

import math
from typing import NamedTuple

from analysis.report.html_page import HtmlTable
from analysis.results.schema import Results, SensorError

CHANNELS = {
    "V": "airspeed", "alpha": "angle of attack", "beta": "sideslip", "height": "barometer",
    "gps_north": "GPS north", "gps_east": "GPS east", "gps_down": "GPS down", "compass": "compass",
    "v_north": "velocity north at rest", "v_east": "velocity east at rest", "v_down": "velocity down at rest",
}  # fmt: skip


class SensorsSection(NamedTuple):
    checks: HtmlTable
    residuals: str
    errors: HtmlTable


def sensors_section(results: Results) -> SensorsSection | None:
    """None where no trajectory was reconstructed."""
    path = results.path
    if path is None:
        return None
    checks = [
        (check.before.title, *(f"{c.mean:+z.2f} ± {c.sigma:.2f} {c.unit}" for c in (check.before, check.after)))
        for check in path.checks
    ]
    residuals = (f"{title} {path.residuals[name]:.1f}" for name, title in CHANNELS.items() if name in path.residuals)
    return SensorsSection(
        HtmlTable(("difference in flight, mean ± standard deviation", "before", "after"), checks),
        ", ".join(residuals),
        HtmlTable(
            ("sensor error", "estimate ± 1 sigma", "assumed before the flight", "determined by this flight?"),
            [_error_row(error) for error in path.sensor_errors],
        ),
    )


def _error_row(error: SensorError) -> tuple[str, str, str, str]:
    digits = decimals(error.standard_error)
    return (
        error.title,
        f"{error.value:+.{digits}f} ± {error.standard_error:.{digits}f} {error.unit}",
        f"± {error.assumed_sigma:.3g}",
        "yes" if error.determined else "no: " + "; ".join(error.missing),
    )


def decimals(sigma: float) -> int:
    """Decimals that show two significant digits of a standard error."""
    return max(0, 1 - math.floor(math.log10(sigma))) if sigma > 0 else 2
