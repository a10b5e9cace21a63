"""Scale and zero of the airspeed, and the wind, from airspeed compared with GPS ground speed on changing headings.

The horizontal wind is constant except for a linear trend. Its other changes are in the residuals, which are correlated
over seconds; their most likely standard deviation and correlation time are also estimated (`most_likely_noise`).

`most_probable` gives the maximum a posteriori parameters here, and those of the energy balance in `fit`.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from flightpower.analysis.estimation.model import NamedValues
from flightpower.analysis.methods.whole_flight.flight_table import FlightTable
from flightpower.analysis.methods.whole_flight.parameters import AIRSPEED, MEAN_WIND, WIND, block, pack, unpack
from flightpower.analysis.methods.whole_flight.settings import GPS
from flightpower.analysis.sources import recording
from flightpower.analysis.sources.autopilot_settings import READABLE
from flightpower.analysis.sources.grid_settings import FLIGHT
from flightpower.flight.arrays import Array

TOLERANCE = 1e-6  # relative tolerance of the cost and of the parameters
ROOT_EPS = float(np.sqrt(np.finfo(float).eps))  # relative step of a numerical derivative


def correlation(apart_s: Array, time_s: float) -> Array:
    """Correlation matrix (n, n) of first-order noise at instants that are `apart_s` (n, n) apart."""
    return np.asarray((1 - GPS.white_share) * np.exp(-apart_s / time_s) + GPS.white_share * np.eye(len(apart_s)))


def most_probable(
    residual: Callable[[Array], Array],
    factor: Array,
    mean: Array,
    sigma: Array,
    start: Array,
    *,
    measured: tuple[Array, Array] | None = None,
) -> tuple[Array, Array]:
    """Maximum a posteriori parameters (m,), and the derivative (n + m + k, m) of whitened residuals and priors there.

    residual: function of parameters (m,) that gives (n,). factor: (n, n), the lower Cholesky factor of its covariance.
    mean, sigma: (m,) of the prior; sigma is infinite for a parameter without a prior. measured: rows (k, m) and values
    (k,) of linear combinations that were measured before the flight, in units of their errors.
    """
    rows, values = measured or (np.zeros((0, len(mean))), np.zeros(0))

    from scipy.optimize import least_squares  # takes 0.2 s to import, which other analyses do not need

    def cost(x: Array) -> Array:
        return np.concatenate([whitened(factor, residual(x)), (x - mean) / sigma, rows @ x - values])

    def derivative(x: Array) -> Array:
        """Differentiate the residuals numerically, and whiten all columns of the derivative at once."""
        base, columns = residual(x), []
        for i in range(len(x)):
            moved = x.copy()
            moved[i] += ROOT_EPS * max(1.0, abs(x[i])) * (1.0 if x[i] >= 0 else -1.0)
            columns.append((residual(moved) - base) / (moved[i] - x[i]))
        return np.concatenate([whitened(factor, np.stack(columns, axis=1)), np.diag(1 / sigma), rows])

    x_scale = np.where(np.isfinite(sigma), sigma, 1.0)
    solution = least_squares(cost, start, derivative, x_scale=x_scale, ftol=TOLERANCE, xtol=TOLERANCE)
    return solution.x, np.asarray(solution.jac)


def root(covariance: Array) -> Array:
    """The lower Cholesky factor (n, n) of a covariance. Raises LinAlgError if this is not positive definite."""
    return np.asarray(np.linalg.cholesky(covariance), dtype=float)


def whitened(factor: Array, values: Array) -> Array:
    """Whiten residuals (n,), or columns (n, k). factor: the lower Cholesky factor (n, n) of their covariance"""
    return np.asarray(solve_triangular(factor, values, lower=True, check_finite=False))


def most_likely_noise(residual: Array, apart_s: Array, times_s: Sequence[float]) -> tuple[float, float]:
    """The most likely standard deviation and correlation time of residuals; the time is one of `times_s`."""
    best = (np.inf, 1.0, times_s[0])
    for time_s in times_s:
        factor = root(correlation(apart_s, time_s))
        white = whitened(factor, residual)
        variance = float(np.mean(white**2))
        cost = len(residual) * np.log(variance) + 2 * float(np.sum(np.log(np.diag(factor))))
        best = min(best, (cost, float(np.sqrt(variance)), time_s))
    return best[1], best[2]


class AirspeedErrors(NamedTuple):
    """scale : fraction by which airspeed reads high; zero_Pa : remaining zero of the pitot; covariance (2, 2) of both.

    wind_mps, wind_from_deg : mean wind over the flight; None where the log has no GPS
    wind, wind_covariance : (4,) of `parameters.WIND` and (4, 4), if airspeed is GPS velocity less the wind; else None
    """

    scale: float
    zero_Pa: float
    covariance: Array
    wind_mps: float | None
    wind_from_deg: float | None
    prior_sigma: float = GPS.scale_sigma  # prior standard deviation of the scale
    wind: Array | None = None
    wind_covariance: Array | None = None

    @property
    def by_gps(self) -> float:
        """The share, 0 to 1, to which GPS determines true airspeed; an error of density changes the scale by this share
        and airspeed by the rest."""
        if self.wind is not None:
            return 1.0
        return 1.0 - min(1.0, self.scale_variance / self.prior_sigma**2)

    @property
    def scale_variance(self) -> float:
        return float(block(AIRSPEED, self.covariance, ["scale"]).item())

    @property
    def mean_wind_covariance(self) -> Array | None:
        """Covariance (2, 2) of the mean wind, if airspeed is GPS velocity less the wind; else None."""
        return None if self.wind_covariance is None else block(WIND, self.wind_covariance, MEAN_WIND)


def one_way(north_mps: Array, east_mps: Array, errors: AirspeedErrors) -> float:
    """Length of the mean heading vector over ground velocities (n,): 0 for even headings, 1 for a single one."""
    toward = np.radians((errors.wind_from_deg or 0.0) + 180.0)
    wind = (errors.wind_mps or 0.0) * complex(np.cos(toward), np.sin(toward))
    through_air = north_mps + 1j * east_mps - wind
    return float(np.abs(np.nanmean(np.exp(1j * np.angle(through_air)))))


def true_airspeed(pressure_Pa: Array, rho: Array, scale: float, zero_Pa: float) -> Array:
    """True airspeed (n,) [m/s] from the pitot's pressure, corrected for scale and zero."""
    return np.asarray(np.sqrt(2 * np.maximum(pressure_Pa - zero_Pa, 1.0) / rho) / (1 + scale))


def by_wind(wind: Array, covariance: Array) -> AirspeedErrors:
    """Errors of an airspeed that is GPS velocity less a wind (4,) with covariance (4, 4)."""
    wind_mps, wind_from_deg = _speed_and_direction(unpack(WIND, wind))
    return AirspeedErrors(0.0, 0.0, np.zeros((2, 2)), wind_mps, wind_from_deg, wind=wind, wind_covariance=covariance)


def _speed_and_direction(wind: NamedValues) -> tuple[float, float]:
    """Wind speed [m/s], and where the mean wind comes from [deg]."""
    north, east = wind.wind_north, wind.wind_east
    return float(np.hypot(north, east)), float(np.degrees(np.arctan2(-east, -north)) % 360)


def airspeed_errors(flight: FlightTable, most_points: int = GPS.most_points) -> AirspeedErrors:
    """The most probable errors of a flight's airspeed, given their priors and GPS."""
    prior_sigma = np.array([flight.airspeed_scale_sigma, flight.zero_sigma_Pa])
    table, step_s = flight.table, float(flight.table.index[1] - flight.table.index[0])
    has_gps = table[list(recording.GPS)].notna().all(axis=1).to_numpy()
    rows = np.flatnonzero(flight.flown & has_gps)
    rows = rows[:: max(round(FLIGHT.smoothing_s / step_s), len(rows) // most_points, 1)]
    if len(rows) < READABLE.fewest_samples:
        return AirspeedErrors(0.0, 0.0, np.diag(prior_sigma**2), None, None, flight.airspeed_scale_sigma)
    t_s = table.index.to_numpy()
    pressure, rho = (table[name].to_numpy()[rows] for name in ("pressure_Pa", "rho"))
    # GPS reports a velocity GPS.latency_s late.
    north, east, down = (np.interp(t_s[rows] + GPS.latency_s, t_s[has_gps], table[n][has_gps]) for n in recording.GPS)
    elapsed = t_s[rows] - t_s[rows].mean()
    names = (*AIRSPEED, *WIND)
    priors = np.array([*prior_sigma, GPS.wind_sigma_mps, GPS.wind_sigma_mps, GPS.trend_mps2, GPS.trend_mps2])
    apart_s = np.abs(elapsed[:, None] - elapsed)

    def by_pitot(x: Array) -> Array:
        """Residuals of the pitot's airspeed. They are right if only this airspeed contains gusts and noise."""
        p = unpack(names, x)
        return np.asarray(np.sqrt(np.maximum((1 + p.scale) ** 2 * through_air(p) + 2 * p.zero_Pa / rho, 0.1)) - seen)

    def by_gps(x: Array) -> Array:
        """Residuals of the airspeed from GPS. They are right if only GPS velocity contains gusts and noise, as it does
        with slow gusts, which carry the aircraft along."""
        p = unpack(names, x)
        return np.asarray(np.sqrt(through_air(p)) - true_airspeed(pressure, rho, p.scale, p.zero_Pa))

    def through_air(p: NamedValues) -> Array:
        air_n = north - p.wind_north - p.wind_north_trend * elapsed
        air_e = east - p.wind_east - p.wind_east_trend * elapsed
        return np.asarray(air_n**2 + air_e**2 + down**2)

    seen, start = true_airspeed(pressure, rho, 0.0, 0.0), np.array([0.0, 0.0, np.mean(north), np.mean(east), 0.0, 0.0])
    (x, covariance), (other, other_covariance) = (
        _solved(equations, priors, start, apart_s) for equations in (by_pitot, by_gps)
    )
    # The truth lies between both regressions (R. Frisch, 1934), evenly distributed. No flight widens the prior.
    values, half = unpack(names, (x + other) / 2), pack(AIRSPEED, unpack(names, (x - other) / 2))
    before = np.diag(1 / prior_sigma**2)
    by_flight = np.linalg.inv((covariance + other_covariance) / 2) - before
    by_flight = by_flight - np.outer(by_flight @ half, by_flight @ half) / (3 + half @ by_flight @ half)
    covariance = np.asarray(np.linalg.inv(before + by_flight), dtype=float)
    wind = _speed_and_direction(values)
    return AirspeedErrors(float(values.scale), float(values.zero_Pa), covariance, *wind, flight.airspeed_scale_sigma)


def _solved(residual: Callable[[Array], Array], sigma_of: Array, start: Array, apart_s: Array) -> tuple[Array, Array]:
    """Most probable parameters (6,), and the covariance (2, 2) of scale and zero, for the most likely noise."""
    x, sigma, time_s = start, 1.0, GPS.correlation_s[0]
    for _ in range(3):
        factor = root(sigma**2 * correlation(apart_s, time_s))
        x, jacobian = most_probable(residual, factor, np.zeros(len(sigma_of)), sigma_of, x)
        sigma, time_s = most_likely_noise(residual(x), apart_s, GPS.correlation_s)
    return x, block((*AIRSPEED, *WIND), np.linalg.inv(jacobian.T @ jacobian), AIRSPEED)
