"""What pools of drag and of electrical power have in common, and how results are written (docs/understand/pooling.md).

Drag: the joint estimate of polar, thrust and installation (`joint_pool`). Electrical power: curves, without an
installation (`curve_pool`). Each kind of pool supplies the power at any speed from any of its flights, and the
difference of each flight from the others. Tests, outliers, trends, plans and the record are computed here.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtri

from flightpower.analysis.curve import Condition, Curve
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.flights.agreement import Compared, ErrorParts, Test, largest_of_errors, least_p, trends
from flightpower.analysis.flights.evidence import (
    against_flights,
    against_installation,
    against_outliers,
    against_polars,
    installations_text,
    polars_text,
    undated_text,
)
from flightpower.analysis.flights.flight_statistics import PoolFlight
from flightpower.analysis.flights.pool_settings import POOLING
from flightpower.analysis.performance.request import Request
from flightpower.analysis.records.flight import AirFound, BatteryResult, CurveResult, Evidence, EvidenceKind, Kind
from flightpower.analysis.records.pool import (
    Agreement,
    AgreementTest,
    Deviation,
    FlightsToSee,
    LeftOut,
    OneMore,
    Outlier,
    PooledFlight,
    PooledResults,
    Scatter,
    Trend,
)
from flightpower.analysis.results.curves import condition_result
from flightpower.analysis.results.evidence import trust_by, worst_first
from flightpower.analysis.results.settings import TRUST
from flightpower.analysis.settings import EVIDENCE
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.version import version

AnyKind = TypeVar("AnyKind")


@dataclass(frozen=True)
class OfAKind(Generic[AnyKind]):
    """An estimate by one kind of power, plus the estimate by the other kind if that has flights which this one lacks.

    refused : why the other estimate cannot be made although there are such flights; else empty
    """

    other_kind: AnyKind | None = field(default=None, kw_only=True)
    refused: str = field(default="", kw_only=True)


Estimate = TypeVar("Estimate", bound=OfAKind[Any])


def first_of_kinds(kinds: Sequence[Kind], made_by: Callable[[Kind], Estimate]) -> Estimate:
    """Estimate by the first kind of power, and by the other kind as `other_kind`. A kind for which InputError is
    raised is left out, and the reason is kept. Raises the first InputError if every kind fails.
    """
    estimates, refused = [], []
    for kind in kinds:
        try:
            estimates.append(made_by(kind))
        except InputError as error:
            refused.append((kind, error))
    if not estimates:
        raise refused[0][1]
    why = "; ".join(f"{kind.words.capitalize()} gives no estimate here: {error}." for kind, error in refused)
    return replace(estimates[0], other_kind=estimates[1] if len(estimates) > 1 else None, refused=why)


@dataclass(frozen=True)
class Pool(OfAKind["Pool"], ABC):
    """The joint estimate of one or more flights of one aircraft.

    condition : weight and density at which curves are given     curve : of all flights
    left_out : the flights that lack this kind of power
    differences : each flight minus the pool of all others; empty for one flight, or if any flight cannot be compared
    outliers : flights, by number, that differ from the pool of the flights that agree
    """

    kind: ClassVar[Kind]
    flights: tuple[PoolFlight, ...]
    condition: Condition
    left_out: tuple[LeftOut, ...] = field(default=(), kw_only=True)

    @property
    @abstractmethod
    def curve(self) -> Curve: ...

    @property
    @abstractmethod
    def speeds_mps(self) -> Array:
        """Speeds (`POOLING.compared_speeds`,) [m/s] at which flights are compared."""

    @abstractmethod
    def power(self, V: Array) -> tuple[Array, Array]:
        """Return power and its standard error [W], each (n,), at speeds V (n,) [m/s]."""

    @property
    @abstractmethod
    def differences(self) -> Sequence[Compared]: ...

    @property
    @abstractmethod
    def outliers(self) -> dict[int, Compared]: ...

    @property
    @abstractmethod
    def homogeneity(self) -> Test | None:
        """Test of whether the curves of the flights agree; None for one flight."""

    @property
    def installation_homogeneity(self) -> Test | None:
        """Test of whether the errors of the installation are as equal as stated; None if there are no such errors."""
        return None

    @abstractmethod
    def reason(self, difference: Compared) -> str:
        """Say why a flight is likely to differ from the others."""

    @abstractmethod
    def half_widths_percent(self, counts: Sequence[int], V: Array) -> Array:
        """Return the half width (n,) of the 95 % interval at speeds V (n,), in percent of the pooled power.

        counts : how many flights like each flight there are
        """

    @abstractmethod
    def half_widths_alone_percent(self, number: int, V: Array) -> Array:
        """Return half widths [%] of one flight, by number; NaN at speeds outside its range."""

    @abstractmethod
    def half_widths_without_percent(self, V: Array) -> Array:
        """Return half widths (flights, n) [%] at speeds V (n,) without each flight in turn; infinite where unknown."""

    @abstractmethod
    def deviations(self) -> list[tuple[Array, Array]]:
        """Return each flight's deviation from the pool in percent and its 95 % limits, each (n,), at `speeds_mps`."""

    @abstractmethod
    def deviations_for_trends(self) -> tuple[Array, ErrorParts]:
        """Return each flight's deviation in power (flights,) [%] at the speed with the least errors, and these
        errors."""

    @abstractmethod
    def planned_difference(self, flights: int) -> Array:
        """Return the covariance (n, n) at `speeds_mps` of the difference in power, as a share, between two such
        configurations with so many flights each; the two share all errors that flights share."""

    @property
    def notes(self) -> list[str]:
        """What the reader has to know besides the evidence."""
        return []

    @abstractmethod
    def curve_result(self) -> CurveResult:
        """Return the curve of all flights in the form of the results."""

    def _form(self, results: PooledResults, request: Request) -> PooledResults:
        """Return the results with the fields that only this kind of pool has."""
        return results

    def _form_of_flight(self, _: int, flight: PooledFlight) -> PooledFlight:
        """Return the row of one flight, by number, with the fields that only this kind of pool has."""
        return flight

    @cached_property
    def evidence(self) -> list[Evidence]:
        """Evidence against the flights and the pool, worst first."""
        reasons = {i: (outlier, self.reason(outlier)) for i, outlier in self.outliers.items()}
        return worst_first(
            [
                *against_flights(self.flights),
                *against_polars(self.homogeneity),
                *against_installation(self.installation_homogeneity),
                *against_outliers(self.flights, reasons),
            ]
        )

    @property
    def outlying_curves(self) -> list[str]:
        """Names of the flights whose curve differs from the other flights' curves."""
        tests = 1 if self.installation_homogeneity is None else len(("curve", "installation"))
        level = TRUST.false_alarm_rate / (tests * len(self.flights))
        return [self.flights[i].name for i, outlier in sorted(self.outliers.items()) if outlier.p < level]

    @cached_property
    def agreement(self) -> Agreement | None:
        """Whether the flights agree according to the evidence; None for one flight."""
        kinds = {evidence.kind for evidence in self.evidence}
        if len(self.flights) < 2:
            return None
        if EvidenceKind.FLIGHTS_DIFFER in kinds:
            return Agreement.NOT_THE_CURVES
        return Agreement.NOT_THE_INSTALLATION if EvidenceKind.INSTALLATIONS_DIFFER in kinds else Agreement.YES

    def results(self, failures: Sequence[str] = (), request: Request = Request()) -> PooledResults:
        """Return the contents of the pooled results.json. failures: lines about logs that cannot be used

        request: weights and density altitudes to compute
        """
        flights = self._flights()
        curves, installations = self.homogeneity, self.installation_homogeneity
        return self._form(
            PooledResults(
                trust=trust_by(self.evidence),
                evidence=self.evidence,
                software_version=version(),
                aircraft=self.flights[0].aircraft,
                test=condition_result(self.condition),
                kind=self.kind,
                curves={self.kind: self.curve_result()},
                air=mean_air(self.flights),
                battery=self.battery,
                between_flights=self._between_flights(),
                agreement=self.agreement,
                homogeneity=_agreement(curves, polars_text(curves, self.outlying_curves)) if curves else None,
                installation_homogeneity=(
                    _agreement(installations, installations_text(installations)) if installations else None
                ),
                flights=flights,
                outliers=[
                    Outlier(log=flights[i].log, p=least_p(outlier), reason=flights[i].reason)
                    for i, outlier in sorted(self.outliers.items())
                ],
                one_more=self._one_more(flights),
                flights_to_see=plans_to_see(self),
                trends=self._trends(),
                notes=[*self.notes, *self._undated(), *([self.refused] if self.refused else [])],
                left_out=list(self.left_out),
                failures=list(failures),
                other_kind=self.other_kind.results(request=request) if self.other_kind else None,
            ),
            request,
        )

    @property
    def battery(self) -> BatteryResult | None:
        """The battery of the last flight that has one."""
        return next((flight.content.battery for flight in reversed(self.flights) if flight.content.battery), None)

    def _between_flights(self) -> list[Scatter]:
        """Return the scatter of the flights' curves about the pooled curve, and how much of it their errors explain."""
        if len(self.flights) == 1:
            return []
        value, limit = (np.array(part) for part in zip(*self.deviations(), strict=True))
        observed, expected = (np.sqrt(np.nanmean(part**2, axis=0)) for part in (value, limit / NORMAL_95))
        excess = np.sqrt(np.maximum(observed**2 - expected**2, 0.0))
        columns = (self.speeds_mps, observed, expected, excess)
        return [
            Scatter(speed_mps=v, observed_percent=o, expected_percent=e, excess_percent=x)
            for v, o, e, x in zip(*(column.tolist() for column in columns), strict=True)
        ]

    def _flights(self) -> list[PooledFlight]:
        n, V = len(self.flights), self.speeds_mps
        half = self.half_widths_percent([1] * n, V)
        without = self.half_widths_without_percent(V) if n > 1 else np.full((1, len(V)), np.inf)
        gains = np.maximum(np.mean(half**-2 - without**-2, axis=1), 0)
        shares = gains / gains.sum()
        flights = []
        for i, (flight, (value, limit)) in enumerate(zip(self.flights, self.deviations(), strict=True)):
            outlier = self.outliers.get(i)
            difference = outlier or (self.differences[i] if self.differences else None)
            row = PooledFlight(
                log=flight.name,
                vehicle=flight.content.vehicle,
                test=flight.content.test,
                half_width_percent=_finite_or_none(self.half_widths_alone_percent(i, V)),
                half_width_without_percent=_finite_or_none(without[i]) if n > 1 else None,
                share_of_information=float(shares[i]),
                against_pool=[
                    Deviation(speed_mps=v, difference_percent=d, limit_percent=m)
                    for v, d, m in zip(V.tolist(), _finite_or_none(value), _finite_or_none(limit), strict=True)
                ],
                p=difference.p if difference else None,
                p_installation=difference.p_installation if difference else None,
                outlier=outlier is not None,
                reason=self.reason(outlier) if outlier else "",
                trust=flight.content.trust,
                start_unix_s=flight.start_unix_s,
            )
            flights.append(self._form_of_flight(i, row))
        return flights

    def _one_more(self, flights: Sequence[PooledFlight]) -> OneMore:
        """Return half widths as they are, and with one more flight like the one that contributed most."""
        V, n = self.speeds_mps, len(flights)
        best = int(np.argmax([flight.share_of_information for flight in flights]))
        return OneMore(
            like=flights[best].log,
            speed_mps=V.tolist(),
            half_width_percent=self.half_widths_percent([1] * n, V).tolist(),
            half_width_then_percent=self.half_widths_percent([1 + (j == best) for j in range(n)], V).tolist(),
        )

    def _trends(self) -> list[Trend]:
        if len(self.flights) < POOLING.fewest_for_trend:
            return []
        return trends(self.flights, *self.deviations_for_trends())

    def _undated(self) -> list[str]:
        """Return a line on undated flights, which the trend over date leaves out, if flights suffice for a trend."""
        if len(self.flights) < POOLING.fewest_for_trend or all(flight.dated for flight in self.flights):
            return []
        return [undated_text(self.flights)]


def _finite_or_none(values: Array) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values.tolist()]


def _agreement(test: Test, text: str) -> AgreementTest:
    return AgreementTest(chi_square=test.chi_square, degrees_of_freedom=test.degrees_of_freedom, p=test.p, text=text)


def refuse_repeated(flights: Sequence[PoolFlight]) -> None:
    """Raise InputError if two of the flights are the same flight."""
    seen: dict[bytes, str] = {}
    for flight in flights:
        if flight.key in seen:
            raise InputError(
                f"{flight.name} and {seen[flight.key]} are the same flight: their estimates are identical;"
                " give each flight once"
            )
        seen[flight.key] = flight.name


def mean_air(flights: Sequence[PoolFlight]) -> AirFound:
    """Return mean temperature and pressure of the flights that have them."""
    of_flights = [flight.content.air for flight in flights]
    temperatures_K = [air.temperature_K for air in of_flights if air.temperature_K is not None]
    pressures_Pa = [air.pressure_Pa for air in of_flights if air.pressure_Pa is not None]
    return AirFound(
        temperature_K=float(np.mean(temperatures_K)) if temperatures_K else None,
        pressure_Pa=float(np.mean(pressures_Pa)) if pressures_Pa else None,
    )


def flights_to_see(pool: Pool, difference: float) -> int | None:
    """Return how many flights each of two configurations needs to show a difference in power in 9 of 10 campaigns.

    difference : fraction of power, at every lift coefficient. These flights are assumed to be like the flights of the
    pool, all with the same shared errors. Returns None if that takes more than `EVIDENCE.most_repetitions`. Raises
    InputError if the difference is not positive.
    """
    if not difference > 0:
        raise InputError(f"a difference of {difference:g} to be seen; give a fraction above 0, such as 0.02")
    needed = _needed_errors(pool.planned_difference(1))

    def seen(n: int) -> bool:
        return bool(difference >= needed * np.sqrt(np.min(np.diag(pool.planned_difference(n)))))

    if not seen(EVIDENCE.most_repetitions):
        return None
    low, high = 0, EVIDENCE.most_repetitions
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if seen(middle) else (middle, high)
    return high


def plans_to_see(pool: Pool) -> list[FlightsToSee]:
    """Return `flights_to_see` for each of `POOLING.differences_to_see`."""
    return [
        FlightsToSee(difference_percent=100 * share, flights_each=flights_to_see(pool, share))
        for share in POOLING.differences_to_see
    ]


def _needed_errors(covariance: Array) -> float:
    """Return the difference, equal at all speeds, that `agreement.of_difference` detects with the probability
    `POOLING.detection`, in standard errors at the speed known best. covariance : (n, n); the correlation between speeds
    hardly depends on the number of flights"""
    probability = largest_of_errors(covariance)
    limit = brentq(lambda z: probability(z) - EVIDENCE.false_alarms, NORMAL_95 - 0.1, 5.0, xtol=0.01)
    return float(limit + ndtri(POOLING.detection))
