"""The pool of several flights, from their results, and the contents of `results.json` (docs/understand/pooling.md)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from analysis.curve import POLAR, Condition, power_gradient
from analysis.estimation.noise import NORMAL_95
from analysis.flights.agreement import (
    ErrorParts,
    Test,
    differences_in_pool,
    error_parts,
    likely_cause,
    mounted_anew,
    trends,
)
from analysis.flights.comparison import plans_to_see
from analysis.flights.evidence import cause_text, installations_text, polars_text, undated_text
from analysis.flights.flight_statistics import POOLED, FlightStatistics, check_one_aircraft, read_statistics
from analysis.flights.joint import pooled_estimate, shared_prior, stacked
from analysis.flights.joint_pool import JointPool, mean_condition, pooled_polar
from analysis.flights.pool_settings import POOLING
from analysis.flights.power_train import mean_air, pooled_use, slowest_flown
from analysis.records.flight import ConditionResult, Results
from analysis.records.pool import (
    AgreementTest,
    Deviation,
    OneMore,
    Outlier,
    PolarCoefficients,
    PooledFlight,
    PooledResults,
    Scatter,
    SharedParameter,
    Trend,
)
from analysis.results.evidence import trust_by
from flight.arrays import Array
from flight.errors import InputError
from flight.version import version

_N_POLAR = len(POLAR)
_UNITS = {"alpha_bias": "rad", "beta_bias": "rad", "air_data_lag": "s"}


@dataclass(frozen=True)
class Pool(JointPool):
    """The joint estimate of flights, and the form of its results.json."""

    def results(self, left_out: Sequence[str] = (), failures: Sequence[str] = ()) -> PooledResults:
        """The contents of the pooled results.json.

        left_out, failures: lines about flights that are not in the pool, and about logs that cannot be used.
        """
        flights = _flights(self)
        error = self.estimate.parameters.standard_error
        shared = zip(POOLED[_N_POLAR:], self.estimate.parameters.value[_N_POLAR:], error[_N_POLAR:], strict=True)
        polars, installations = self.homogeneity, self.installation_homogeneity
        temperature_K, pressure_Pa = mean_air([one.content for one in self.flights])
        return PooledResults(
            trust=trust_by(self.evidence),
            evidence=self.evidence,
            software_version=version(),
            aircraft=self.flights[0].aircraft,
            installation=self.flights[0].installation,
            test=_condition_result(self.condition),
            drag_polar=_coefficients(self.polar.A),
            polar_covariance=self.polar.covariance.tolist(),
            parameters=[
                SharedParameter(name=name, value=float(x), standard_error=float(e), unit=_UNITS.get(name, ""))
                for name, x, e in shared
            ],
            power_required=self.curve.points(),
            between_flights=_between_flights(self),
            agreement=self.agreement,
            homogeneity=_agreement(polars, polars_text(polars, self.outlying_curves)) if polars else None,
            installation_homogeneity=(
                _agreement(installations, installations_text(installations)) if installations else None
            ),
            flights=flights,
            outliers=[
                Outlier(log=flights[i].log, p=min(one.p, one.p_installation), reason=flights[i].reason)
                for i, one in sorted(self.outliers.items())
            ],
            one_more=_one_more(self, flights),
            flights_to_see=plans_to_see(self),
            trends=_trends(self),
            notes=[*self.notes, *_undated(self.flights)],
            left_out=list(left_out),
            failures=list(failures),
            air_temperature_K=temperature_K,
            air_pressure_Pa=pressure_Pa,
            slowest_flown=slowest_flown(self),
            use=pooled_use(self),
        )


def pool_results(results: Sequence[Path | Mapping[str, Any] | Results]) -> Pool:
    """The joint estimate of flights, from the results.json of each.

    Raises InputError for none, for results without statistics, for one flight twice, and for flights of two aircraft,
    propellers or installations.
    """
    if not results:
        raise InputError("no flights to pool; give the results.json of one or more flights")
    return pool([read_statistics(one) for one in results])


def pool(flights: Sequence[FlightStatistics]) -> Pool:
    """The same from the statistics of the flights."""
    _refuse_repeated(flights)
    check_one_aircraft(flights)
    as_stated, prior = stacked(flights), shared_prior(flights)
    anew = mounted_anew(as_stated, prior)
    stack = stacked(flights, anew) if anew else as_stated
    estimate = pooled_estimate(stack, prior)
    return Pool(
        flights=tuple(flights),
        as_stated=as_stated,
        stack=stack,
        anew=anew,
        prior=prior,
        estimate=estimate,
        polar=pooled_polar(flights, estimate),
        condition=mean_condition(flights),
        flown_CL=(min(f.flown_CL[0] for f in flights), max(f.flown_CL[1] for f in flights)),
    )


def _condition_result(condition: Condition) -> ConditionResult:
    return ConditionResult(weight_N=condition.weight_N, air_density_kgpm3=condition.rho)


def _coefficients(A: Array) -> PolarCoefficients:
    return PolarCoefficients(**dict(zip(POLAR, A.tolist(), strict=True)))


def _agreement(test: Test, text: str) -> AgreementTest:
    return AgreementTest(chi_square=test.chi_square, degrees_of_freedom=test.degrees_of_freedom, p=test.p, text=text)


def _percent(pooled: JointPool, V: Array) -> Array:
    """Derivative (n, 3) of the power at V by the polar, in percent of the pooled power."""
    power, _ = pooled.power(V)
    return np.asarray(100 * power_gradient(V, pooled.condition) / power[:, None])


def _deviations(pooled: JointPool) -> list[tuple[Array, Array]]:
    """Of each flight's curve from the pooled one: percent and 95 % limits, each (n,), at `speeds_mps`."""
    if len(pooled.flights) == 1:
        return [(np.zeros(len(pooled.speeds_mps)), np.zeros(len(pooled.speeds_mps)))]
    J = _percent(pooled, pooled.speeds_mps)
    deviations = []
    for difference in differences_in_pool(pooled.stack, pooled.estimate):
        value, C = J @ difference.value[:_N_POLAR], difference.covariance[:_N_POLAR, :_N_POLAR]
        deviations.append((value, NORMAL_95 * np.sqrt(np.maximum(np.einsum("vi,ij,vj->v", J, C, J), 0.0))))
    return deviations


def _between_flights(pooled: JointPool) -> list[Scatter]:
    """Scatter of the flights' curves about the pooled one, and what their errors explain of it."""
    if len(pooled.flights) == 1:
        return []
    value, limit = (np.array(part) for part in zip(*_deviations(pooled), strict=True))
    observed, expected = np.sqrt(np.mean(value**2, axis=0)), np.sqrt(np.mean((limit / NORMAL_95) ** 2, axis=0))
    excess = np.sqrt(np.maximum(observed**2 - expected**2, 0.0))
    columns = (pooled.speeds_mps, observed, expected, excess)
    return [
        Scatter(speed_mps=v, observed_percent=o, expected_percent=e, excess_percent=x)
        for v, o, e, x in zip(*(column.tolist() for column in columns), strict=True)
    ]


def _flights(pooled: JointPool) -> list[PooledFlight]:
    n, V = len(pooled.flights), pooled.speeds_mps
    half = pooled.half_widths_percent([1] * n, V)
    without = pooled.half_widths_without_percent(V) if n > 1 else np.full((1, len(V)), np.inf)
    gains = np.maximum(np.mean(half**-2 - without**-2, axis=1), 0)
    shares = gains / gains.sum()
    flights = []
    for i, (flight, (value, limit)) in enumerate(zip(pooled.flights, _deviations(pooled), strict=True)):
        outlier = pooled.outliers.get(i)
        difference = outlier or (pooled.differences[i] if pooled.differences else None)
        flights.append(
            PooledFlight(
                log=flight.name,
                installation=flight.installation,
                test=_condition_result(flight.condition),
                drag_polar=_coefficients(flight.polar.A),
                half_width_percent=pooled.half_widths_alone_percent(i, V).tolist(),
                half_width_without_percent=without[i].tolist() if n > 1 else None,
                share_of_information=float(shares[i]),
                against_pool=[
                    Deviation(speed_mps=v, difference_percent=d, limit_percent=m)
                    for v, d, m in zip(V.tolist(), value.tolist(), limit.tolist(), strict=True)
                ],
                p=difference.p if difference else None,
                p_installation=difference.p_installation if difference else None,
                outlier=outlier is not None,
                reason=cause_text(likely_cause(outlier)) if outlier else "",
                trust=flight.content.trust,
                mounted_anew=i in pooled.anew,
                start_unix_s=flight.start_unix_s,
            )
        )
    return flights


def _one_more(pooled: JointPool, flights: Sequence[PooledFlight]) -> OneMore:
    """Half widths now, and with one more flight like the one that contributed most."""
    V, n = pooled.speeds_mps, len(flights)
    best = int(np.argmax([flight.share_of_information for flight in flights]))
    return OneMore(
        like=flights[best].log,
        speed_mps=V.tolist(),
        half_width_percent=pooled.half_widths_percent([1] * n, V).tolist(),
        half_width_then_percent=pooled.half_widths_percent([1 + (j == best) for j in range(n)], V).tolist(),
    )


def _trends(pooled: JointPool) -> list[Trend]:
    """At the speed where the flights alone are most certain."""
    J = _percent(pooled, pooled.speeds_mps)
    errors = error_parts(pooled.stack, pooled.prior)
    covariance = errors.own + errors.shared @ errors.shared.transpose(0, 2, 1)
    at = int(np.argmin(np.einsum("vi,fij,vj->v", J, covariance, J, optimize=True)))
    deviations = np.array([J[at] @ (flight.polar.A - pooled.polar.A) for flight in pooled.flights])
    of_power = J[at : at + 1]
    return trends(pooled.flights, deviations, ErrorParts(of_power @ errors.own @ of_power.T, of_power @ errors.shared))


def _undated(flights: Sequence[FlightStatistics]) -> list[str]:
    """A line on those that the trend over the date leaves out, where there are enough flights for one."""
    if len(flights) < POOLING.fewest_for_trend or all(one.dated for one in flights):
        return []
    return [undated_text(flights)]


def _refuse_repeated(flights: Sequence[FlightStatistics]) -> None:
    seen: dict[bytes, str] = {}
    for flight in flights:
        key = flight.parameters.value.tobytes()
        if key in seen:
            raise InputError(
                f"{flight.name} and {seen[key]} are the same flight: their estimates are equal to the digit; give each"
                " flight once"
            )
        seen[key] = flight.name
