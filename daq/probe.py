"""The probe's calibration in plain numbers, for telemetry: the analysis has the same maps on arrays."""

from pathlib import Path
from typing import NamedTuple

import msgspec

from daq.config import read_text

FIRST_FORMAT = "flightpower-probe-1"
FORMATS = (FIRST_FORMAT, "flightpower-probe-2")
LEAST_SUM = 1e-3


class Flow(NamedTuple):
    alpha_rad: float
    beta_rad: float
    q_ratio: float  # q_c/qbar


class Surface(msgspec.Struct, frozen=True):
    """(sum of coefficient * x^i * y^j)^exponent."""

    powers: list[tuple[int, int]]
    coefficients: list[float]
    exponent: float = 1.0

    def at(self, x: float, y: float) -> float:
        terms = zip(self.powers, self.coefficients, strict=True)
        total = sum(coefficient * x**i * y**j for (i, j), coefficient in terms)
        return total if self.exponent == 1 else float(max(total, LEAST_SUM) ** self.exponent)


class Probe(msgspec.Struct, frozen=True):
    """The maps of a `probe.json` from C_alpha = dp_alpha/q_c, C_beta = dp_beta/q_c."""

    format: str
    alpha_rad: Surface
    beta_rad: Surface
    q_ratio: Surface
    hull: list[tuple[float, float]]

    def flow(self, C_alpha: float, C_beta: float) -> Flow:
        """Flow angles and q_c/qbar. Beyond the calibrated region its nearest corner's box is taken: for display."""
        low_a, high_a = min(a for a, _ in self.hull), max(a for a, _ in self.hull)
        low_b, high_b = min(b for _, b in self.hull), max(b for _, b in self.hull)
        a, b = min(max(C_alpha, low_a), high_a), min(max(C_beta, low_b), high_b)
        ratio = max(self.q_ratio.at(a, b), 0.1)
        # The angles are maps of C_alpha and C_beta in the first format, of dp_alpha/qbar and dp_beta/qbar since.
        x, y = (a, b) if self.format == FIRST_FORMAT else (a * ratio, b * ratio)
        return Flow(self.alpha_rad.at(x, y), self.beta_rad.at(x, y), ratio)


def load_probe(path: Path) -> Probe | None:
    """The calibration of a file, None when it is of another kind; raises InputError when it cannot be read."""
    try:
        probe = msgspec.json.decode(read_text(path), type=Probe)
    except msgspec.MsgspecError:
        return None
    if probe.format not in FORMATS or not probe.hull:
        return None
    return probe
