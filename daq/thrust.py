"""Thrust of a propeller from its table, for single values and without NumPy. `flight.propeller` works on arrays."""

import csv
import re
from bisect import bisect_right
from pathlib import Path
from typing import NamedTuple

from flightpower.flight.shipped_propellers import FOLDER


class ThrustRow(NamedTuple):
    """The table at one speed of rotation, in ascending J."""

    rpm: float
    J: list[float]
    cT: list[float]

    def at(self, J: float) -> float:
        """Interpolate cT linearly between points and beyond the last point; it is constant below the first."""
        if J <= self.J[0]:
            return self.cT[0]
        i = min(bisect_right(self.J, J), len(self.J) - 1)
        share = (J - self.J[i - 1]) / (self.J[i] - self.J[i - 1])
        return self.cT[i - 1] + share * (self.cT[i] - self.cT[i - 1])


class ThrustTable(NamedTuple):
    """A propeller's table. folding: whether blades fold where thrust would be negative; their friction is neglected."""

    diameter_m: float
    rows: list[ThrustRow]
    folding: bool

    def thrust_N(self, V_mps: float, n_revps: float, rho: float) -> float:
        """Thrust [N]: cT rho n^2 D^4 (3.48). n_revps must be positive."""
        rpm, J = 60 * n_revps, V_mps / (n_revps * self.diameter_m)
        above = next((i for i, row in enumerate(self.rows) if row.rpm >= rpm), len(self.rows) - 1)
        below = max(above - 1, 0)
        high, low = self.rows[above], self.rows[below]
        span = high.rpm - low.rpm
        share = min(max((rpm - low.rpm) / span, 0.0), 1.0) if span else 1.0
        cT = (1 - share) * low.at(J) + share * high.at(J)
        if self.folding:
            cT = max(cT, 0.0)
        return cT * rho * n_revps**2 * self.diameter_m**4


def load_thrust(name_or_path: str, *, folding: bool) -> ThrustTable | None:
    """Load the table of a shipped propeller, or of a file in our own format; otherwise return None."""
    shipped = FOLDER / f"{name_or_path}.csv"
    try:
        text = (shipped if shipped.is_file() else Path(name_or_path)).read_text("utf-8")
        diameter = re.search(r"^# *diameter_m\s*=\s*(\S+)", text, re.MULTILINE)
        points: dict[float, list[tuple[float, float]]] = {}
        for entry in csv.DictReader(line for line in text.splitlines() if line.strip() and not line.startswith("#")):
            points.setdefault(float(entry["rpm"]), []).append((float(entry["J"]), float(entry["cT"])))
        if diameter is None or not points or min(len(row) for row in points.values()) < 2:
            return None
        rows = []
        for rpm in sorted(points):
            J, cT = zip(*sorted(points[rpm]), strict=True)
            rows.append(ThrustRow(rpm, list(J), list(cT)))
        return ThrustTable(float(diameter[1]), rows, folding)
    except (OSError, KeyError, TypeError, ValueError):
        return None
