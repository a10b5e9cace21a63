"""The table of coverage by world, all weathers together: of `benchmarks/study.py` and `benchmarks/campaigns.py`."""

from collections.abc import Mapping, Sequence

import numpy as np
from estimators import OVER_STALL
from flights import error_rows
from numpy.typing import ArrayLike, NDArray

# Error and half the 95 % interval of one flight at each of OVER_STALL, % of the true power; NaN where it did not fly.
Points = tuple[ArrayLike, ArrayLike]


def world_table(flights: Mapping[str, Mapping[float, Sequence[Points]]]) -> list[str]:
    """Markdown lines, one a world. flights: of each world, by W20 [kt]."""
    weathers = sorted({weather for by_weather in flights.values() for weather in by_weather})
    speed_names = " / ".join(f"{x:g}" for x in OVER_STALL)
    names = " / ".join(f"{weather:g}" for weather in weathers)
    out = [
        f"All weathers together. Speeds: {speed_names} times the stalling speed. 95 % of errors below; median half"
        " width; % of the true power.",
        "",
        f"| world | flights | coverage, % | at {names} kt | at each speed | error | half width |",
        "|---|---|---|---|---|---|---|",
    ]
    for world, by_weather in flights.items():
        error, half = (
            np.array([points[i] for of_weather in by_weather.values() for points in of_weather], dtype=float)
            for i in (0, 1)
        )
        rows = {name: values for name, values, _ in error_rows(error, half)}
        of_weather = " / ".join(_covered(by_weather.get(weather, ())) for weather in weathers)
        listed = " | ".join(
            " / ".join("-" if np.isnan(x) else f"{x:.{digits}f}" for x in rows[name])
            for name, digits in (("coverage, %", 0), ("95 % of errors below", 1), ("half width of intervals", 1))
        )
        out.append(f"| {world} | {len(error)} | {coverage(error, half):.0f} | {of_weather} | {listed} |")
    return out


def coverage(error: NDArray[np.float64], half: NDArray[np.float64]) -> float:
    """Share [%] of the flights' known errors that their intervals cover."""
    known = np.isfinite(error)
    return float(100 * np.mean(np.abs(error[known]) < half[known]))


def _covered(flights: Sequence[Points]) -> str:
    if not flights:
        return "-"
    error, half = (np.array([points[i] for points in flights], dtype=float) for i in (0, 1))
    return f"{coverage(error, half):.0f}"
