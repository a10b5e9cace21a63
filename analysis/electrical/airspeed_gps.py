"""Residuals that are correlated in time: their most likely standard deviation and correlation time.

Scale and zero of the airspeed, and the wind, from airspeed against GPS ground speed on changing headings.

The horizontal wind is constant but for a linear trend; what it does besides is in the residuals, which are correlated
over seconds. Their standard deviation and correlation time are estimated too.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from analysis.autopilot_logs import recording
from analysis.electrical.flight_table import FlightTable

Array = NDArray[np.float64]

TOLERANCE = 1e-6  # of the cost and of the parameters, relative
WHITE_SHARE = 0.05  # of the variance, uncorrelated


def correlation(apart_s: Array, time_s: float) -> Array:
    """Correlation matrix of first-order noise at instants `apart_s` (n, n) from each other."""
    return np.asarray((1 - WHITE_SHARE) * np.exp(-apart_s / time_s) + WHITE_SHARE * np.eye(len(apart_s)))


def most_probable(
    residual: Callable[[Array], Array],
    whiten: Array,
    mean: Array,
    sigma: Array,
    start: Array,
    measured: tuple[Array, Array] | None = None,
) -> tuple[Array, Array]:
    """Maximum a posteriori parameters (m,), and the derivative (n + m + k, m) of whitened residuals and priors there.

    residual: of (m,), (n,). whiten: (n, n), the inverse of a root of its covariance. mean, sigma: (m,) of the prior.
    measured: rows (k, m) and values (k,) of combinations that were measured before, in units of their errors.
    """
    rows, values = measured or (np.zeros((0, len(mean))), np.zeros(0))

    from scipy.optimize import least_squares  # takes 0.2 s to import, which other analyses do not need

    def cost(x: Array) -> Array:
        return np.concatenate([whiten @ residual(x), (x - mean) / sigma, rows @ x - values])

    found = least_squares(cost, start, x_scale=sigma, ftol=TOLERANCE, xtol=TOLERANCE)
    return found.x, np.asarray(found.jac)


def most_likely_noise(residual: Array, apart_s: Array, times_s: Sequence[float]) -> tuple[float, float]:
    """Standard deviation and correlation time of greatest likelihood, the latter out of `times_s`."""
    best = (np.inf, 1.0, times_s[0])
    for time_s in times_s:
        factor = np.linalg.cholesky(correlation(apart_s, time_s))
        white = solve_triangular(factor, residual, lower=True, check_finite=False)
        variance = float(np.mean(white**2))
        cost = len(residual) * np.log(variance) + 2 * float(np.sum(np.log(np.diag(factor))))
        best = min(best, (cost, float(np.sqrt(variance)), time_s))
    return best[1], best[2]


SCALE_SIGMA = 0.0125  # of an airspeed sensor and its place, before the flight
TREND_MPS_PER_S = 0.01  # prior of the wind's trend
WIND_SIGMA_MPS = 10.0
LATENCY_S = 0.15  # of GPS velocity
CORRELATION_S = (2.0, 5.0, 10.0, 20.0, 40.0)
LEAST_STEP_S, MOST_POINTS, FEWEST_POINTS = 1.0, 500, 20
ITERATIONS = 3


class AirspeedErrors(NamedTuple):
    """scale : fraction by which airspeed reads high; zero_Pa : remaining zero of the pitot; covariance (2, 2) of both.

    wind_mps, wind_from_deg : mean over the flight; None where the log has no GPS
    """

    scale: float
    zero_Pa: float
    covariance: Array
    wind_mps: float | None
    wind_from_deg: float | None
    prior_sigma: float = SCALE_SIGMA  # of the scale


def one_way(north_mps: Array, east_mps: Array, errors: AirspeedErrors) -> float:
    """Length of the mean heading vector over ground velocities (n,): 0 for even headings, 1 for a single one."""
    toward = np.radians((errors.wind_from_deg or 0.0) + 180.0)
    wind = (errors.wind_mps or 0.0) * complex(np.cos(toward), np.sin(toward))
    through_air = north_mps + 1j * east_mps - wind
    return float(np.abs(np.nanmean(np.exp(1j * np.angle(through_air)))))


def true_airspeed(pressure_Pa: Array, rho: Array, scale: float, zero_Pa: float) -> Array:
    """True airspeed (n,) [m/s] from the pitot's pressure."""
    return np.asarray(np.sqrt(2 * np.maximum(pressure_Pa - zero_Pa, 1.0) / rho) / (1 + scale))


def airspeed_errors(flight: FlightTable, most_points: int = MOST_POINTS) -> AirspeedErrors:
    """The most probable errors of a flight's airspeed, given their priors and GPS."""
    prior_sigma = np.array([SCALE_SIGMA, flight.zero_sigma_Pa])
    table, step_s = flight.table, float(flight.table.index[1] - flight.table.index[0])
    has_gps = table[list(recording.GPS)].notna().all(axis=1).to_numpy()
    rows = np.flatnonzero(flight.flown & has_gps)
    rows = rows[:: max(round(LEAST_STEP_S / step_s), len(rows) // most_points, 1)]
    if len(rows) < FEWEST_POINTS:
        return AirspeedErrors(0.0, 0.0, np.diag(prior_sigma**2), None, None)
    t_s = table.index.to_numpy()
    pressure, rho = (table[name].to_numpy()[rows] for name in ("pressure_Pa", "rho"))
    # A GPS velocity is that of LATENCY_S before.
    north, east, down = (np.interp(t_s[rows] + LATENCY_S, t_s[has_gps], table[n][has_gps]) for n in recording.GPS)
    elapsed = t_s[rows] - t_s[rows].mean()
    priors = np.array([*prior_sigma, WIND_SIGMA_MPS, WIND_SIGMA_MPS, TREND_MPS_PER_S, TREND_MPS_PER_S])
    apart_s = np.abs(elapsed[:, None] - elapsed)

    def residual(x: Array) -> Array:
        scale, zero_Pa, wind_n, wind_e, trend_n, trend_e = x
        air_n, air_e = north - wind_n - trend_n * elapsed, east - wind_e - trend_e * elapsed
        return np.asarray(np.sqrt(air_n**2 + air_e**2 + down**2) - true_airspeed(pressure, rho, scale, zero_Pa))

    x = np.array([0.0, 0.0, float(np.mean(north)), float(np.mean(east)), 0.0, 0.0])
    sigma, time_s = 1.0, CORRELATION_S[0]
    for _ in range(ITERATIONS):
        whiten = np.linalg.inv(np.linalg.cholesky(sigma**2 * correlation(apart_s, time_s)))
        x, jacobian = most_probable(residual, whiten, np.zeros(len(priors)), priors, x)
        sigma, time_s = most_likely_noise(residual(x), apart_s, CORRELATION_S)
    covariance = np.asarray(np.linalg.inv(jacobian.T @ jacobian)[:2, :2], dtype=float)
    wind_mps, wind_from_deg = float(np.hypot(x[2], x[3])), float(np.degrees(np.arctan2(-x[3], -x[2])) % 360)
    return AirspeedErrors(float(x[0]), float(x[1]), covariance, wind_mps, wind_from_deg)
