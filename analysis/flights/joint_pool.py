"""The pool of flights with runs: the joint estimate of drag, thrust and installation, and its curve."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from msgspec import structs
from numpy.typing import NDArray
from scipy.linalg import block_diag

from flightpower.analysis.curve import (
    POLAR,
    Condition,
    Polar,
    PolarCurve,
    inside,
    lift_coefficient,
    polar_curve,
    power_gradient,
    power_required,
)
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.flights.agreement import (
    INSTALLATION_PART,
    Compared,
    Difference,
    ErrorParts,
    Test,
    differences_in_pool,
    differences_to_others,
    error_parts,
    homogeneity,
    likely_cause,
    outliers,
)
from flightpower.analysis.flights.evidence import NOT_NAMED, cause_text, installations_text
from flightpower.analysis.flights.flight_statistics import POOLED, THRUST_CORRECTIONS, FlightStatistics, M
from flightpower.analysis.flights.joint import (
    FlightStack,
    Group,
    PooledEstimate,
    Prior,
    pooled_estimate,
    shared_prior,
    solve,
    take,
    without_each,
)
from flightpower.analysis.flights.pool_settings import POOLING
from flightpower.analysis.flights.pooled import Pool
from flightpower.analysis.flights.power_train import pooled_performance, pooled_use, slowest_flown
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods.rejected_assumptions import Assumption
from flightpower.analysis.performance.autopilot_parameters import of_power_required
from flightpower.analysis.performance.other_weights import NO_BATTERY, NO_MODEL
from flightpower.analysis.performance.request import Request
from flightpower.analysis.records.flight import CurveResult, Kind
from flightpower.analysis.records.pool import PolarCoefficients, PooledFlight, PooledResults, SharedParameter
from flightpower.analysis.results.curves import curve_result, two_term_polar
from flightpower.analysis.results.settings import TRUST
from flightpower.analysis.uncertain import variances
from flightpower.flight.arrays import Array

_N_POLAR = len(POLAR)
_INSTALLATION_FROM = len(POLAR + THRUST_CORRECTIONS)
_UNITS = {"alpha_bias": "rad", "beta_bias": "rad", "air_data_lag": "s"}


@dataclass(frozen=True)
class JointPool(Pool):
    """The joint estimate of one or more flights of one aircraft, propeller and installation.

    as_stated : the flights with the installation that their files state
    stack : the same, with the flights `remounted` treated as remounted
    remounted : numbers of the flights that contradict having the same installation as the others
    condition : mean weight and density of the flights, at which curves are given
    flown_CL : lift coefficients that at least one flight covers
    """

    kind = Kind.POWER_REQUIRED
    flights: tuple[FlightStatistics, ...]
    as_stated: FlightStack
    stack: FlightStack
    remounted: frozenset[int]
    prior: Prior
    estimate: PooledEstimate
    polar: Polar
    flown_CL: tuple[float, float]

    @cached_property
    def curve(self) -> PolarCurve:
        """The curve at mean weight and density; extrapolated where the thrust is outside the table in every flight."""
        curve = polar_curve(self.polar, self.condition, self.flown_CL)
        return replace(curve, extrapolated=~thrust_known(self.flights, lift_coefficient(curve.V_mps, self.condition)))

    @cached_property
    def speeds_mps(self) -> Array:
        """Speeds (`POOLING.compared_speeds`,) [m/s] at which flights are compared."""
        return np.linspace(self.curve.V_mps[0], self.curve.V_mps[-1], POOLING.compared_speeds)

    @cached_property
    def differences(self) -> list[Difference]:
        """Each flight minus the pool of all others; empty for one flight. Installations are compared as stated."""
        if len(self.flights) < 2:
            return []
        differences, as_declared = (
            differences_to_others(flight_stack, self.prior) for flight_stack in (self.stack, self.as_stated)
        )
        return [
            difference._replace(p_installation=as_said.p_installation)
            for difference, as_said in zip(differences, as_declared, strict=True)
        ]

    @cached_property
    def outliers(self) -> dict[int, Compared]:
        def compared(some: list[int]) -> list[Difference]:
            return differences_to_others(take(self.as_stated, some), self.prior)

        return dict(outliers(len(self.flights), compared, TRUST.false_alarm_rate))

    def reason(self, difference: Compared) -> str:
        assert isinstance(difference, Difference)  # the type that these flights give
        return cause_text(likely_cause(difference))

    @cached_property
    def homogeneity(self) -> Test | None:
        """Test of whether the polars of the flights agree; None for one flight."""
        return homogeneity(self.stack, self.prior) if len(self.flights) > 1 else None

    @cached_property
    def installation_homogeneity(self) -> Test | None:
        """Test of whether the errors of the installation are as equal as stated; None for one flight."""
        return homogeneity(self.as_stated, self.prior, INSTALLATION_PART) if len(self.flights) > 1 else None

    @property
    def notes(self) -> list[str]:
        """What the reader has to know besides the evidence."""
        installations = self.installation_homogeneity
        notes = [NOT_NAMED] if len(self.flights) > 1 and not self.flights[0].installation else []
        if self.remounted and installations and not installations.doubtful:
            notes.append(installations_text(installations))
        return notes

    def power(self, V: Array) -> tuple[Array, Array]:
        """Return power required and its standard error [W], each (n,), at speeds V (n,) [m/s]."""
        return power_required(V, self.polar, self.condition)

    def half_widths_percent(self, counts: Sequence[int], V: Array) -> Array:
        if len(self.flights) == 1 and counts[0] == 1:
            return self.half_widths_alone_percent(0, V)
        return self._half_width_percent(
            pooled_covariance(pooled_estimate(self.stack, self.prior, counts).parameters.covariance), V
        )

    def half_widths_alone_percent(self, number: int, V: Array) -> Array:
        return self._half_width_percent(self.flights[number].polar_covariance, V)

    def half_widths_without_percent(self, V: Array) -> Array:
        if len(self.flights) == 2:  # leaves the other flight alone
            covariances = [flight.polar_covariance for flight in reversed(self.flights)]
        else:
            total = without_each(self.stack, self.prior).total(self.prior.covariance)
            covariances = [pooled_covariance(covariance) for covariance in total]
        return np.stack([self._half_width_percent(C, V) for C in covariances])

    def _half_width_percent(self, polar_covariance: Array, V: Array) -> Array:
        power, error = power_required(V, Polar(self.polar.A, polar_covariance), self.condition)
        return np.asarray(100 * NORMAL_95 * error / power)

    def deviations(self) -> list[tuple[Array, Array]]:
        if len(self.flights) == 1:
            return [(np.zeros(len(self.speeds_mps)), np.zeros(len(self.speeds_mps)))]
        J = self._percent(self.speeds_mps)
        deviations = []
        for difference in differences_in_pool(self.stack, self.estimate):
            value, C = J @ difference.value[:_N_POLAR], difference.covariance[:_N_POLAR, :_N_POLAR]
            deviations.append((value, NORMAL_95 * np.sqrt(np.maximum(variances(J, C), 0.0))))
        return deviations

    def deviations_for_trends(self) -> tuple[Array, ErrorParts]:
        J = self._percent(self.speeds_mps)
        errors = error_parts(self.stack, self.prior)
        covariance = errors.own + errors.shared @ errors.shared.transpose(0, 2, 1)
        index = int(np.argmin(np.einsum("vi,fij,vj->v", J, covariance, J, optimize=True)))
        deviations = np.array([J[index] @ (flight.polar.A - self.polar.A) for flight in self.flights])
        of_power = J[index : index + 1]
        return deviations, ErrorParts(of_power @ errors.own @ of_power.T, of_power @ errors.shared)

    def planned_difference(self, flights: int) -> Array:
        n = len(self.flights)
        counts = np.array([len(range(i, flights, n)) for i in range(n)], dtype=float)
        C = joint_polars(self, self, same_installation=True, same_propeller=True, counts=(counts, counts)).covariance
        J = self._percent(self.speeds_mps) / 100 @ np.hstack([-np.eye(_N_POLAR), np.eye(_N_POLAR)])
        return np.asarray(J @ C @ J.T)

    def curve_result(self) -> CurveResult:
        return curve_result(self.curve, parts=[])

    def _percent(self, V: Array) -> Array:
        """Return the derivative (n, 3) of the power at V with respect to the polar, in percent of the pooled power."""
        power, _ = self.power(V)
        return np.asarray(100 * power_gradient(V, self.condition) / power[:, None])

    def _form(self, results: PooledResults, request: Request) -> PooledResults:
        error = self.estimate.parameters.standard_error
        use = pooled_use(self)
        performance = pooled_performance(self, use, results.air, request) if use else None
        missing = []
        if performance is None and (request.weights_N or request.density_altitudes_m):
            missing = [NO_MODEL if self.battery else NO_BATTERY]
        shared = zip(POOLED[_N_POLAR:], self.estimate.parameters.value[_N_POLAR:], error[_N_POLAR:], strict=True)
        parameters, withheld = of_power_required(results, performance, *two_term_polar(self.polar, self.flown_CL))
        return structs.replace(
            results,
            autopilot_parameters=parameters,
            autopilot_parameters_withheld=withheld,
            installation=self.flights[0].installation,
            drag_polar=_coefficients(self.polar.A),
            polar_covariance=self.polar.covariance.tolist(),
            parameters=[
                SharedParameter(name=name, value=float(x), standard_error=float(e), unit=_UNITS.get(name, ""))
                for name, x, e in shared
            ],
            slowest_flown=slowest_flown(self),
            use=use,
            performance=performance,
            notes=[*results.notes, *missing, *request.questions(self.condition.weight_N)],
        )

    def _form_of_flight(self, number: int, flight: PooledFlight) -> PooledFlight:
        pooled = self.flights[number]
        return structs.replace(
            flight,
            installation=pooled.installation,
            drag_polar=_coefficients(pooled.polar.A),
            mounted_anew=number in self.remounted,
        )


def _coefficients(A: Array) -> PolarCoefficients:
    return PolarCoefficients(**dict(zip(POLAR, A.tolist(), strict=True)))


def joint_polars(
    a: "JointPool",
    b: "JointPool",
    same_installation: bool,
    same_propeller: bool,
    counts: tuple[Array, Array] | None = None,
    same_day: bool = True,
) -> Polar:
    """Return the polars of A and B (6,) with their joint covariance (6, 6). counts: as in `Group`, for A and for B.

    same_day : whether the errors of thrust are exactly the same. From one flying day to another a share
    POOLING.remounted of their prior standard deviation changes, as when a probe is remounted: motor pulse errors, dirt
    on the propeller, the entered weight.
    """
    prior_a = _prior_of_a(a, b, same_installation, same_propeller)
    at_a, end = np.r_[0:_N_POLAR, 2 * _N_POLAR : _N_POLAR + M], _N_POLAR + M
    thrust = slice(_N_POLAR, _INSTALLATION_FROM)
    installation = slice(_INSTALLATION_FROM, M)
    at_b = at_a.copy()
    at_b[:_N_POLAR] += _N_POLAR
    priors = [Prior(np.zeros((_N_POLAR, _N_POLAR)), np.zeros(_N_POLAR)), prior_a]
    for shared, part in ((same_propeller and same_day, thrust), (same_installation, installation)):
        if not shared:
            priors.append(Prior(b.prior.information[part, part], b.prior.vector[part]))
            at_b[part] = np.arange(end, end + len(at_b[part]))
            end += len(at_b[part])

    def cancels(error: str) -> bool:
        """Whether this error, which no residual shows, is the same in A and in B."""
        return error not in (Assumption.PARABOLIC_POLAR, Assumption.MOTOR_SPEED) and (
            same_propeller if error == Assumption.THRUST_TABLE else same_installation
        )

    changes_b = {name if cancels(name) else f"{name}, B": change for name, change in b.stack.changes.items()}
    stack_b = b.stack._replace(changes=changes_b)
    of_a, of_b = counts or (np.ones(len(a.flights)), np.ones(len(b.flights)))
    prior = Prior(block_diag(*(p.information for p in priors)), np.concatenate([p.vector for p in priors]))
    if same_propeller and not same_day:
        prior = _alike(prior, at_a[thrust], at_b[thrust], 1 - POOLING.remounted**2)
    joint = solve([Group(a.stack, at_a, of_a), Group(stack_b, at_b, of_b)], prior)
    polars = slice(0, 2 * _N_POLAR)
    floor = np.kron(np.ones((2, 2)) if same_installation else np.eye(2), covariance.floor())
    return Polar(joint.parameters.value[polars], joint.parameters.covariance[polars, polars] + floor)


def _alike(prior: Prior, at_a: NDArray[np.intp], at_b: NDArray[np.intp], correlation: float) -> Prior:
    """Return the prior in which the parameters of B are correlated with those of A; both have the prior of A."""
    J, vector = prior.information[np.ix_(at_a, at_a)], prior.vector[at_a]
    information, vector_sum = prior.information.copy(), prior.vector.copy()
    for rows, columns, factor in ((at_a, at_a, 1.0), (at_b, at_b, 1.0), (at_a, at_b, -correlation),
                                  (at_b, at_a, -correlation)):  # fmt: skip
        information[np.ix_(rows, columns)] = factor / (1 - correlation**2) * J
    vector_sum[at_a] = vector_sum[at_b] = vector / (1 + correlation)
    return Prior(information, vector_sum)


def _prior_of_a(a: "JointPool", b: "JointPool", same_installation: bool, same_propeller: bool) -> Prior:
    """Return the prior (M,) of the parameters of A; parameters that B shares have the prior of both pools."""
    of_both = shared_prior([*a.flights, *b.flights])
    shared = np.zeros(M, dtype=bool)
    shared[_N_POLAR:_INSTALLATION_FROM], shared[_INSTALLATION_FROM:] = (
        same_propeller,
        same_installation,
    )
    return Prior(
        np.where(np.outer(shared, shared), of_both.information, np.where(shared, 0.0, a.prior.information)),
        np.where(shared, of_both.vector, a.prior.vector),
    )


def thrust_known(flights: Sequence[FlightStatistics], CL: Array) -> NDArray[np.bool_]:
    """Whether the propeller's table covers the thrust at CL (n,) in at least one flight that reached it."""
    covered_at = np.zeros(len(CL), dtype=bool)
    for flight in flights:
        points = flight.content.power_required
        covered = inside(CL, flight.flown_CL)
        if not points:
            covered_at |= covered
            continue
        CL_of_points = lift_coefficient(np.array([point.speed_mps for point in points]), flight.condition)
        nearest = np.abs(CL_of_points[:, None] / CL - 1).argmin(axis=0)
        sure = np.array([not point.extrapolated for point in points])
        covered_at |= covered & sure[nearest]
    return covered_at


def mean_condition(flights: Sequence[FlightStatistics]) -> Condition:
    """Return mean weight and density of the flights."""
    weight, rho, area = (float(np.mean(values)) for values in zip(*(f.condition for f in flights), strict=True))
    return Condition(weight, rho, area)


def pooled_polar(flights: Sequence[FlightStatistics], estimate: PooledEstimate) -> Polar:
    """Return the pool's polar; a single flight keeps its own, which the joint estimate equals except for rounding."""
    if len(flights) == 1:
        return flights[0].polar
    return Polar(estimate.parameters.value[:_N_POLAR], pooled_covariance(estimate.parameters.covariance))


def pooled_covariance(total: Array) -> Array:
    """Return the covariance (3, 3) of the pooled polar, including the floor. total: (M, M) of all shared parameters."""
    return np.asarray(total[:_N_POLAR, :_N_POLAR] + covariance.floor())
