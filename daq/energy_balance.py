"""Fits a drag polar to the energy of runs, by least squares with sums that are updated by each run.

Over a window of a run, the work of thrust minus the gain in kinetic and potential energy is the work of drag
(2.23)-(2.26). Divided by mass and distance flown, this work is the mean of drag/mass. It is regressed on
C_D = A0 + A1 C_L + A2 C_L^2, with the errors of thrust's scale and of its slope over J as further unknowns. The
residuals give the noise. The scale of airspeed, which only the analysis determines, adds the uncertainty that the
aircraft file states; other errors of the probe are not in the interval.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from flightpower.daq.legs import Row
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.settings import NORMAL_95
from flightpower.flight.units import GRAVITY_MPS2

WINDOW_ROWS = 11  # longer than the smoothing, so that errors of speed at the two ends are independent
UNKNOWNS = 5  # A0, A1, A2, thrust scale, thrust slope
J_REFERENCE = 0.5
STAND = {3: 1.0, 4: -J_REFERENCE}  # coefficients of the unknowns in the correction of thrust at J = 0
# Relative error of power divided by that of airspeed, near the speed of least power: the thrust computed for a motor
# speed falls with airspeed to the power of about 2 to 2.5, and power is thrust times airspeed.
POWER_PER_AIRSPEED = 1.5
LEAST_NOISE_MPS2 = 0.05  # lower limit for the noise of a window: speed with 0.2 m/s of noise
FEWEST_WINDOWS = 8


class PowerInterval(NamedTuple):
    """The speed of least power required in the range of speeds flown, and the power's 95 % interval."""

    speed_mps: float
    half_width: float  # relative half-width of the power's interval


class EnergyBalance:
    """The normal equations of the polar. Each window of a run adds some forty products to their sums."""

    def __init__(self, uncertainty: Uncertainty, static_thrust_excess: tuple[float, float] | None = None) -> None:
        """uncertainty: the aircraft file's, with the errors of thrust and airspeed. static_thrust_excess: the property
        of `Aircraft`, the correction of thrust at J = 0 by a stand test, and its standard deviation."""
        self._prior_sigma = {3: uncertainty.thrust_scale_fraction, 4: uncertainty.thrust_slope}  # by index
        self._stand = static_thrust_excess
        self._airspeed_sigma = uncertainty.airspeed_scale_fraction
        self.windows = 0
        self._N = [[0.0] * UNKNOWNS for _ in range(UNKNOWNS)]
        self._Nz = [0.0] * UNKNOWNS
        self._zz = 0.0
        self._weight = 0.0  # sum of rho S / m: q S / m = V^2 times half of its mean

    def add_run(self, rows: Sequence[Row]) -> None:
        """Add a run, window by window. Windows without thrust are skipped."""
        intervals = len(rows) - 1
        windows = max(1, round(intervals / WINDOW_ROWS))
        ends = [intervals * i // windows for i in range(windows + 1)]
        for first, last in pairwise(ends):
            self._add(rows[first : last + 1])

    def _add(self, rows: Sequence[Row]) -> None:
        sum_V = 0.0
        sums = [0.0] * (UNKNOWNS + 1)  # integrals for the unknowns, and for rho S/m
        for i, row in enumerate(rows):
            if row.drag is None:
                return
            thrust, qS, CL, J = row.drag
            step = row.V / 2 if i in (0, len(rows) - 1) else row.V  # trapezoidal rule
            sum_V += step
            beside = (qS, qS * CL, qS * CL * CL, -thrust, -thrust * (J - J_REFERENCE), 2 * qS / row.V**2)
            for j, value in enumerate(beside):
                sums[j] += value * step
        x = [value / sum_V for value in sums]
        length_m = sum_V * (rows[-1].t_s - rows[0].t_s) / (len(rows) - 1)
        energy = (rows[-1].V ** 2 - rows[0].V ** 2) / 2 + GRAVITY_MPS2 * (
            rows[-1].smooth_height_m - rows[0].smooth_height_m
        )
        z = -x[3] - energy / length_m
        self.windows += 1
        self._weight += x[UNKNOWNS]
        self._zz += z * z
        for i in range(UNKNOWNS):
            self._Nz[i] += x[i] * z
            for j in range(UNKNOWNS):
                self._N[i][j] += x[i] * x[j]

    def polar(self) -> tuple[list[float], list[list[float]]] | None:
        """The unknowns (5,) and their covariance (5, 5); None until enough has been flown."""
        if self.windows < FEWEST_WINDOWS:
            return None
        noise2 = LEAST_NOISE_MPS2**2
        p: list[float] = []
        inverse: list[list[float]] | None = None
        for _ in range(3):  # repeated because the prior's weight depends on the noise
            N = [row[:] for row in self._N]
            for i, sigma in self._prior_sigma.items():
                N[i][i] += noise2 / sigma**2
            Nz = self._Nz[:]
            if self._stand:
                excess, sigma = self._stand
                for i, a in STAND.items():
                    Nz[i] += noise2 / sigma**2 * a * excess
                    for j, b in STAND.items():
                        N[i][j] += noise2 / sigma**2 * a * b
            inverse = inverted(N)
            if inverse is None:
                return None
            p = [sum(a * b for a, b in zip(row, Nz, strict=True)) for row in inverse]
            squares = self._zz - 2 * sum(a * b for a, b in zip(p, self._Nz, strict=True))
            squares += sum(p[i] * p[j] * self._N[i][j] for i in range(UNKNOWNS) for j in range(UNKNOWNS))
            noise2 = max(LEAST_NOISE_MPS2**2, squares / max(1, self.windows - 3))
        return p, [[noise2 * value for value in row] for row in inverse or []]

    def power_W(self, V_mps: float, mass_kg: float) -> float | None:
        """Power required in level flight [W]; None until enough has been flown."""
        polar = self.polar()
        if polar is None:
            return None
        return mass_kg * sum(a * b for a, b in zip(self._gradient(V_mps), polar[0][:3], strict=True))

    def _gradient(self, V_mps: float) -> list[float]:
        """Gradient of power/mass in level flight with respect to A0, A1, A2."""
        qS_over_m = self._weight / self.windows / 2 * V_mps**2
        CL = GRAVITY_MPS2 / qS_over_m
        return [qS_over_m * V_mps * CL**i for i in range(3)]

    def at_endurance_speed(self, slowest_mps: float, fastest_mps: float) -> PowerInterval | None:
        """The interval at the speed of least power between two speeds; None until enough has been flown."""
        polar = self.polar()
        if polar is None:
            return None
        p, covariance = polar
        best: tuple[float, float, list[float]] | None = None
        for i in range(25):
            V = slowest_mps + (fastest_mps - slowest_mps) * i / 24
            gradient = self._gradient(V)
            power = sum(a * b for a, b in zip(gradient, p[:3], strict=True))
            if best is None or power < best[1]:
                best = V, power, gradient
        if best is None or best[1] <= 0:
            return None
        V, power, g = best
        variance = sum(g[i] * g[j] * covariance[i][j] for i in range(3) for j in range(3))
        relative = math.hypot(math.sqrt(max(variance, 0.0)) / power, POWER_PER_AIRSPEED * self._airspeed_sigma)
        return PowerInterval(V, NORMAL_95 * relative)


def inverted(matrix: list[list[float]]) -> list[list[float]] | None:
    """The inverse of a symmetric positive definite matrix, scaled to a unit diagonal; None if it is singular."""
    n = len(matrix)
    if min(matrix[i][i] for i in range(n)) <= 0:
        return None
    scale = [1 / math.sqrt(matrix[i][i]) for i in range(n)]
    rows = [[matrix[i][j] * scale[i] * scale[j] for j in range(n)] for i in range(n)]
    rows = [row + [float(i == j) for j in range(n)] for i, row in enumerate(rows)]
    for i in range(n):
        pivot = rows[i][i]
        if pivot < 1e-12:
            return None
        rows[i] = [value / pivot for value in rows[i]]
        for k in range(n):
            if k != i:
                factor = rows[k][i]
                rows[k] = [a - factor * b for a, b in zip(rows[k], rows[i], strict=True)]
    return [[rows[i][n + j] * scale[i] * scale[j] for j in range(n)] for i in range(n)]
