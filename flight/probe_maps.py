"""The polynomial maps of a probe calibration (`probe.json`), which are evaluated here for single readings in plain
Python.

The analysis fits the maps, and evaluates them for arrays (`analysis.air`).
"""

from pathlib import Path
from typing import NamedTuple

import msgspec

from flightpower.flight.files import read_text

FORMAT = "flightpower-probe-2"
FIRST_FORMAT = "flightpower-probe-1"  # in this format angles and q_c/qbar are polynomials in C_alpha and C_beta
FORMATS = (FORMAT, FIRST_FORMAT)
ALPHA_PORT_SLOPE = 4.5  # d(pressure difference)/d(angle)/qbar, from 9/4 sin 2 alpha (ports of a sphere at 45 deg)
LEAST_SUM = 1e-3  # far outside the measured region the sum may be negative; this lower limit keeps its power real


class FlowAngles(NamedTuple):
    """Angles of attack and sideslip, and the ratio of measured to true dynamic pressure."""

    alpha_rad: float
    beta_rad: float
    q_ratio: float  # q_c/qbar


class PolynomialMap(msgspec.Struct, frozen=True):
    """A polynomial in two variables to a power: (sum of coefficient * x^i * y^j)^exponent. Part of `probe.json`."""

    powers: list[tuple[int, int]]
    coefficients: list[float]
    exponent: float = 1.0

    def at(self, x: float, y: float) -> float:
        """The value at one point."""
        terms = zip(self.powers, self.coefficients, strict=True)
        total = sum(coefficient * x**i * y**j for (i, j), coefficient in terms)
        return total if self.exponent == 1 else float(max(total, LEAST_SUM) ** self.exponent)


class ProbeMaps(msgspec.Struct, frozen=True):
    """The maps of a `probe.json`. Their inputs derive from C_alpha = dp_alpha/q_c and C_beta = dp_beta/q_c."""

    format: str
    alpha_rad: PolynomialMap
    beta_rad: PolynomialMap
    q_ratio: PolynomialMap
    hull: list[tuple[float, float]]

    def flow(self, C_alpha: float, C_beta: float) -> FlowAngles:
        """Flow angles and q_c/qbar, for display: inputs are limited to the bounding box of the calibration."""
        low_a, high_a = min(a for a, _ in self.hull), max(a for a, _ in self.hull)
        low_b, high_b = min(b for _, b in self.hull), max(b for _, b in self.hull)
        a, b = min(max(C_alpha, low_a), high_a), min(max(C_beta, low_b), high_b)
        ratio = max(self.q_ratio.at(a, b), 0.1)
        # In the first format the angles are functions of C_alpha and C_beta, later of dp_alpha/qbar and dp_beta/qbar.
        x, y = (a, b) if self.format == FIRST_FORMAT else (a * ratio, b * ratio)
        return FlowAngles(self.alpha_rad.at(x, y), self.beta_rad.at(x, y), ratio)


def load_probe_maps(path: Path) -> ProbeMaps | None:
    """The maps of a calibration file; None if it has another format. Raises InputError if the file cannot be read."""
    try:
        probe = msgspec.json.decode(read_text(path), type=ProbeMaps)
    except msgspec.MsgspecError:
        return None
    if probe.format not in FORMATS or not probe.hull:
        return None
    return probe
