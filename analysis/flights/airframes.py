"""Curves of a fleet and of its airframes, each of which is treated as a random draw from the fleet."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import minimize

from flightpower.analysis.curve import Polar
from flightpower.analysis.flights.changes import Change, FlightShares, find_changes, flight_shares, series
from flightpower.analysis.flights.flight_statistics import FlightStatistics, PoolFlight
from flightpower.analysis.flights.joint_pool import JointPool
from flightpower.analysis.flights.pool import pool_flights
from flightpower.analysis.flights.pooled import Pool
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.units import DAY_S

if TYPE_CHECKING:
    from flightpower.analysis.flights.dataset import Dataset


class Airframe(NamedTuple):
    """The flights of one airframe in one configuration.

    flights : sorted by date, undated ones last
    pool : the flights since the last change     changes : changes of drag and propulsion, the earliest first
    shares : drag and thrust of the dated flights; None if no search for changes was made
    """

    name: str
    configuration: str
    flights: tuple[PoolFlight, ...]
    pool: Pool
    changes: tuple[Change, ...]
    shares: FlightShares | None = None

    @property
    def dated(self) -> int:
        """How many flights have a date. These come first, and only these are searched for changes."""
        return sum(flight.dated for flight in self.flights)

    @property
    def kind(self) -> tuple[float, str]:
        """Wing area and propeller table, which all airframes of one fleet curve have in common."""
        first = self.flights[0]
        return first.aircraft.wing_area_m2, first.propeller_table if isinstance(first, FlightStatistics) else ""


class FleetCurve(NamedTuple):
    """Polar of the mean airframe, and the covariance (3, 3) of the polar's coefficients among airframes."""

    mean: Polar
    among_airframes: Array

    @property
    def of_another(self) -> Polar:
        """Predicted polar of an airframe of this fleet that has not flown yet."""
        return Polar(self.mean.A, self.mean.covariance + self.among_airframes)


def airframes(dataset: "Dataset", alarms_a_year: float, unread: list[str], names: Sequence[str] = ()) -> list[Airframe]:
    """Return an `Airframe` for each configuration of the named airframes, or of all airframes if no names are given.

    alarms_a_year : accepted false alarms per year for an airframe that does not change     unread : receives a line for
    each file that cannot be read. Raises InputError for a name that the dataset lacks.
    """
    airframes, stored = [], dataset.airframes
    for name in names:
        if name not in stored:
            raise InputError(f"{dataset.address}: no airframe {name}; there are {', '.join(stored)}")
    for name in names or stored:
        for configuration, flights in dataset.flights(name, unread).items():
            airframes.append(airframe(name, configuration, flights, alarms_a_year))
    return airframes


def airframe(name: str, configuration: str, flights: Sequence[PoolFlight], alarms_a_year: float) -> Airframe:
    """Build an airframe from its flights in one configuration, sorted by date. alarms_a_year: see `airframes`

    A flight without a date may be from before or after a change, so it is pooled only if there is no change.
    """
    dated = [flight for flight in flights if flight.dated]
    ordered = (*dated, *(flight for flight in flights if not flight.dated))
    pool = pool_flights(ordered)
    changes, shares = (
        _watched(pool if len(dated) == len(flights) else pool_flights(dated), alarms_a_year)
        if len(dated) > 2
        else ([], None)
    )
    lately = pool_flights(dated[max(change.since for change in changes) :]) if changes else pool
    return Airframe(name, configuration, ordered, lately, tuple(changes), shares)


def _watched(pool: Pool, alarms_a_year: float) -> tuple[list[Change], FlightShares | None]:
    """Find changes in three or more dated flights; none in electrical power, where drag and thrust are inseparable."""
    if not isinstance(pool, JointPool):
        return [], None
    flights = pool.flights
    times = np.array([flight.start_unix_s for flight in flights], dtype=float) / DAY_S
    flights_a_year = 365.25 * len(flights) / max(times[-1] - times[0], len(flights))  # at most one per day
    of_flights = series(pool)
    changes = find_changes(of_flights, times, flights_a_year / alarms_a_year)
    return changes, flight_shares(of_flights, changes)


def fleet_curve(fleet: Sequence[Airframe]) -> FleetCurve:
    """Estimate mean and scatter of three or more airframes of one kind by restricted maximum likelihood.

    Each airframe's polar is a random draw about the mean, observed with its own error (Gasparrini et al. 2012,
    multivariate random-effects meta-analysis).
    """
    pools = [airframe.pool for airframe in fleet if isinstance(airframe.pool, JointPool)]
    values = np.stack([pool.polar.A for pool in pools])
    own = np.stack([pool.polar.covariance for pool in pools])
    scale = np.sqrt(np.mean(np.einsum("fkk->fk", own), axis=0))
    among = scale[:, None] * random_effects(values / scale, own / np.outer(scale, scale)) * scale
    weights = np.linalg.inv(own + among)
    covariance = np.linalg.inv(weights.sum(axis=0))
    mean = covariance @ np.einsum("fij,fj->i", weights, values)
    return FleetCurve(Polar(mean, covariance), among)


def random_effects(values: Array, own: Array) -> Array:
    """Estimate the covariance (k, k) among n draws from values (n, k), whose errors have covariances own (n, k, k)."""
    k = values.shape[1]
    lower = np.tril_indices(k)

    def among(parameters: Array) -> Array:
        L = np.zeros((k, k))
        L[lower] = parameters
        return np.asarray(L @ L.T)

    def minus_twice_likelihood(parameters: Array) -> float:
        total = own + among(parameters)
        weights = np.linalg.inv(total)
        information = weights.sum(axis=0)
        mean = np.linalg.solve(information, np.einsum("fij,fj->i", weights, values))
        residual = values - mean
        misfit = np.einsum("fi,fij,fj->", residual, weights, residual)
        return float(np.linalg.slogdet(total)[1].sum() + np.linalg.slogdet(information)[1] + misfit)

    spread = np.cov(values.T).reshape(k, k)
    start = np.linalg.cholesky(spread + np.eye(k) * np.trace(spread) / k * 1e-6)[lower]
    return among(minimize(minus_twice_likelihood, start, method="BFGS").x)
