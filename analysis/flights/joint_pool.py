"""The pool of several flights: its curve, how the flights agree with it, what each contributed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.curve import POLAR, Condition, Polar, PolarCurve, lift_coefficient, polar_curve, power_required
from analysis.estimation.noise import NORMAL_95
from analysis.flights.agreement import INSTALLATION_PART, Difference, Test, differences_to_others, homogeneity, outliers
from analysis.flights.evidence import (
    NOT_NAMED,
    against_flights,
    against_installation,
    against_outliers,
    against_polars,
    installations_text,
)
from analysis.flights.flight_statistics import FlightStatistics
from analysis.flights.joint import FlightStack, PooledEstimate, Prior, pooled_estimate, without_each
from analysis.flights.pool_settings import POOLING
from analysis.methods import consider as covariance
from analysis.records.flight import Evidence, EvidenceKind
from analysis.records.pool import Agreement
from analysis.results.evidence import worst_first
from analysis.results.settings import TRUST
from flight.arrays import Array

_N_POLAR = len(POLAR)


@dataclass(frozen=True)
class JointPool:
    """The joint estimate of one or more flights of one aircraft, propeller and installation.

    as_stated, stack : with the installation that the files state; with the flights `anew` mounted anew
    anew : numbers of the flights that deny having the same installation as the others
    condition : mean weight and density of the flights, at which curves are given
    flown_CL : lift coefficients that at least one flight covers
    """

    flights: tuple[FlightStatistics, ...]
    as_stated: FlightStack
    stack: FlightStack
    anew: frozenset[int]
    prior: Prior
    estimate: PooledEstimate
    polar: Polar
    condition: Condition
    flown_CL: tuple[float, float]

    @cached_property
    def curve(self) -> PolarCurve:
        """At the flights' mean weight and density; extrapolated where no flight that reaches it knows the thrust."""
        curve = polar_curve(self.polar, self.condition, self.flown_CL)
        return replace(curve, extrapolated=~thrust_known(self.flights, lift_coefficient(curve.V_mps, self.condition)))

    @cached_property
    def speeds_mps(self) -> Array:
        """Speeds (`POOLING.compared_speeds`,) of comparisons [m/s]."""
        return np.linspace(self.curve.V_mps[0], self.curve.V_mps[-1], POOLING.compared_speeds)

    @cached_property
    def differences(self) -> list[Difference]:
        """Each flight against the pool of all others; empty for one flight. Installations are compared as stated."""
        if len(self.flights) < 2:
            return []
        found, stated = (differences_to_others(one, self.prior) for one in (self.stack, self.as_stated))
        return [one._replace(p_installation=as_said.p_installation) for one, as_said in zip(found, stated, strict=True)]

    @cached_property
    def outliers(self) -> dict[int, Difference]:
        """By number, flights that differ from the pool of those that agree."""
        return outliers(self.as_stated, self.prior, TRUST.false_alarm_rate)

    @property
    def outlying_curves(self) -> list[str]:
        """Names of the flights whose curve differs from those of the others."""
        level = TRUST.false_alarm_rate / (2 * len(self.flights))
        return [self.flights[i].name for i, one in sorted(self.outliers.items()) if one.p < level]

    @cached_property
    def homogeneity(self) -> Test | None:
        """Test of whether the polars of the flights agree; None for one flight."""
        return homogeneity(self.stack, self.prior) if len(self.flights) > 1 else None

    @cached_property
    def installation_homogeneity(self) -> Test | None:
        """Test of whether the errors of the installation are as the same as stated; None for one flight."""
        return homogeneity(self.as_stated, self.prior, INSTALLATION_PART) if len(self.flights) > 1 else None

    @cached_property
    def evidence(self) -> list[Evidence]:
        """Against the flights and the pool, the worst first."""
        return worst_first(
            [
                *against_flights(self.flights),
                *against_polars(self.homogeneity),
                *against_installation(self.installation_homogeneity),
                *against_outliers(self.flights, self.outliers),
            ]
        )

    @property
    def notes(self) -> list[str]:
        """What the reader has to know beside the evidence."""
        installations = self.installation_homogeneity
        notes = [NOT_NAMED] if len(self.flights) > 1 and not self.flights[0].installation else []
        if self.anew and installations and not installations.doubtful:
            notes.append(installations_text(installations))
        return notes

    @cached_property
    def agreement(self) -> Agreement | None:
        """Whether the flights agree, by the evidence; None for one flight."""
        kinds = {one.kind for one in self.evidence}
        if len(self.flights) < 2:
            return None
        if EvidenceKind.FLIGHTS_DIFFER in kinds:
            return Agreement.NOT_THE_CURVES
        return Agreement.NOT_THE_INSTALLATION if EvidenceKind.INSTALLATIONS_DIFFER in kinds else Agreement.YES

    def power(self, V: Array) -> tuple[Array, Array]:
        """Power required and its standard error [W], each (n,), at speeds V (n,) [m/s]."""
        return power_required(V, self.polar, self.condition)

    def half_widths_percent(self, counts: Sequence[int], V: Array) -> Array:
        """Half width (n,) of the 95 % interval at speeds V (n,), in percent of the pooled power.

        counts : how many flights like each flight there are
        """
        if len(self.flights) == 1 and counts[0] == 1:
            return self.half_widths_alone_percent(0, V)
        return self._half_width_percent(
            pooled_covariance(pooled_estimate(self.stack, self.prior, counts).parameters.covariance), V
        )

    def half_widths_alone_percent(self, number: int, V: Array) -> Array:
        """The same of one of the flights by number."""
        return self._half_width_percent(self.flights[number].polar_covariance, V)

    def half_widths_without_percent(self, V: Array) -> Array:
        """Half widths (flights, n) without each of two flights or more, at speeds V (n,), as `half_widths_percent`."""
        if len(self.flights) == 2:  # the other alone
            covariances = [flight.polar_covariance for flight in reversed(self.flights)]
        else:
            total = without_each(self.stack, self.prior).total(self.prior.covariance)
            covariances = [pooled_covariance(one) for one in total]
        return np.stack([self._half_width_percent(C, V) for C in covariances])

    def _half_width_percent(self, polar_covariance: Array, V: Array) -> Array:
        power, error = power_required(V, Polar(self.polar.A, polar_covariance), self.condition)
        return np.asarray(100 * NORMAL_95 * error / power)


def thrust_known(flights: Sequence[FlightStatistics], CL: Array) -> NDArray[np.bool_]:
    """Whether the propeller's table covers the thrust of at least one flight that covers this lift coefficient (n,)."""
    known = np.zeros(len(CL), dtype=bool)
    for flight in flights:
        points = flight.content.power_required
        low, high = flight.flown_CL
        inside = (CL >= low * (1 - 1e-9)) & (CL <= high * (1 + 1e-9))
        if not points:
            known |= inside
            continue
        CL_of_points = lift_coefficient(np.array([point.speed_mps for point in points]), flight.condition)
        nearest = np.abs(CL_of_points[:, None] / CL - 1).argmin(axis=0)
        sure = np.array([not point.extrapolated for point in points])
        known |= inside & sure[nearest]
    return known


def mean_condition(flights: Sequence[FlightStatistics]) -> Condition:
    """Mean weight and density of the flights."""
    weight, rho, area = (float(np.mean(values)) for values in zip(*(f.condition for f in flights), strict=True))
    return Condition(weight, rho, area)


def pooled_polar(flights: Sequence[FlightStatistics], estimate: PooledEstimate) -> Polar:
    """For one flight its own polar: the joint estimate equals it but for rounding."""
    if len(flights) == 1:
        return flights[0].polar
    return Polar(estimate.parameters.value[:_N_POLAR], pooled_covariance(estimate.parameters.covariance))


def pooled_covariance(total: Array) -> Array:
    """Covariance (3, 3) of the pooled polar, everything together. total: of all shared parameters, (M, M)."""
    return np.asarray(total[:_N_POLAR, :_N_POLAR] + covariance.floor())
