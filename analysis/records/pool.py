"""The contents of `results.json` of several flights together, and of a comparison (docs/understand/pooling.md).

Percentages of a pool are of its power; those of a comparison are of the power of A. Pools of drag and of electrical
power have the same fields: what only the joint estimate of drag has is empty or null in the others.
"""

from enum import StrEnum
from typing import TypeVar

import msgspec

from flightpower.analysis.records.flight import (
    AircraftResult,
    ComputationModel,
    ConditionResult,
    Evidence,
    Kind,
    PerformanceResult,
    Trust,
    WithCurves,
)

POOLED_FORMAT = "flightpower-pooled-3"
EARLIER_POOLED_FORMATS = ("flightpower-pooled-2", "flightpower-electrical-pooled-1")
COMPARISON_FORMAT = "flightpower-comparison-3"


class Agreement(StrEnum):
    """Whether the flights of a pool agree."""

    YES = "yes"
    NOT_THE_INSTALLATION = "the curves, not the installation"
    NOT_THE_CURVES = "no"


class PolarCoefficients(msgspec.Struct, frozen=True, kw_only=True):
    """C_D = A0 + A1 C_L + A2 C_L^2."""

    A0: float
    A1: float
    A2: float


class SharedParameter(msgspec.Struct, frozen=True, kw_only=True):
    """A correction of thrust, or an error of the installation, that all flights of a pool share."""

    name: str
    value: float
    standard_error: float
    unit: str


class Scatter(msgspec.Struct, frozen=True, kw_only=True):
    """Scatter of the flights' curves about the pooled one at one speed, and what their errors explain of it."""

    speed_mps: float
    observed_percent: float  # root mean square
    expected_percent: float
    excess_percent: float  # the part that the errors do not explain


class AgreementTest(msgspec.Struct, frozen=True, kw_only=True):
    """Chi-square test of whether all flights have the same values."""

    chi_square: float
    degrees_of_freedom: int
    p: float
    text: str  # the same for a reader


class Deviation(msgspec.Struct, frozen=True, kw_only=True):
    """One flight's curve minus the pooled one at one speed, with the 95 % limit that its errors allow."""

    speed_mps: float
    difference_percent: float | None  # null where the flight did not fly this speed
    limit_percent: float | None


class PooledFlight(msgspec.Struct, frozen=True, kw_only=True):
    """One flight of a pool. Half widths are at the speeds of `against_pool`."""

    log: str
    vehicle: str = ""  # as in the flight's results
    installation: str = ""
    test: ConditionResult
    drag_polar: PolarCoefficients | None = None  # of this flight alone
    half_width_percent: list[float | None]  # of this flight alone; null at speeds that it did not fly
    half_width_without_percent: list[float | None] | None  # of the pool without it; null in a pool of one flight
    share_of_information: float
    against_pool: list[Deviation]
    # Probability of a larger difference from the other flights, of the curve and of the errors of the installation;
    # null in a pool of one flight, and where the flight shares no speeds with the others.
    p: float | None
    p_installation: float | None = None
    outlier: bool
    reason: str  # the likely one, where it is an outlier
    trust: Trust  # of its own results
    mounted_anew: bool = False  # it contradicts the installation that the files state
    start_unix_s: float | None = None  # start of its log; null where that is not known


class Outlier(msgspec.Struct, frozen=True, kw_only=True):
    """A flight that differs from the others by more than its errors explain."""

    log: str
    p: float
    reason: str


class OneMore(msgspec.Struct, frozen=True, kw_only=True):
    """Half widths of the pool now, and with one more flight like the one that contributed most."""

    like: str
    speed_mps: list[float]
    half_width_percent: list[float]
    half_width_then_percent: list[float]


class FlightsToSee(msgspec.Struct, frozen=True, kw_only=True):
    """Flights of each of two configurations by which a difference of drag is seen in 9 of 10 campaigns."""

    difference_percent: float
    flights_each: int | None  # null where it takes more than `EVIDENCE.most_repetitions`


class TrendQuantity(StrEnum):
    """Quantities over which power may have a trend."""

    DATE = "date"
    TEMPERATURE = "air temperature"
    BATTERY = "battery voltage"


class Trend(msgspec.Struct, frozen=True, kw_only=True):
    """Change of power over the range of a quantity that was flown."""

    quantity: TrendQuantity
    unit: str
    lowest: float
    highest: float
    change_percent: float  # from lowest to highest
    standard_error_percent: float
    p: float  # probability of a change this far from zero without a trend
    flights: int  # with this quantity


class LeftOutReason(StrEnum):
    """Why a flight is not in a pool."""

    ELECTRICAL_ONLY = "electrical power only"
    NO_BATTERY = "no battery"
    NO_STATISTICS = "not by the dynamic method"


class LeftOut(msgspec.Struct, frozen=True, kw_only=True):
    """A flight that is not in the pool."""

    log: str
    reason: LeftOutReason
    text: str  # the reason as a clause


class PooledUse(msgspec.Struct, frozen=True, kw_only=True):
    """What the energy of a mission is computed from (`flightpower route`)."""

    losses_of: list[str]  # logs; the losses of the power train are the mean of theirs
    losses_measured: bool  # and not assumed
    model: ComputationModel


class PooledResults(WithCurves, frozen=True, kw_only=True):
    """The contents of the `results.json` of a pool.

    Weight and density of `test` are the mean of the flights, `battery` is that of the last one.
    """

    format: str = POOLED_FORMAT
    installation: str = ""
    drag_polar: PolarCoefficients | None = None
    polar_covariance: list[list[float]] = msgspec.field(default_factory=list)  # (3, 3)
    parameters: list[SharedParameter] = msgspec.field(default_factory=list)
    between_flights: list[Scatter]  # empty in a pool of one flight
    agreement: Agreement | None  # of the flights, by the tests and the outliers; null in a pool of one flight
    homogeneity: AgreementTest | None  # of the curves; null in a pool of one flight
    installation_homogeneity: AgreementTest | None = None
    flights: list[PooledFlight]
    outliers: list[Outlier]
    one_more: OneMore
    flights_to_see: list[FlightsToSee]
    trends: list[Trend]
    notes: list[str]
    left_out: list[LeftOut]
    failures: list[str]  # logs that cannot be used, and why
    use: PooledUse | None = None  # null where no flight has a power train
    # By the pooled polar, the mean power train and the last flight's battery; null where one of these is not known.
    performance: PerformanceResult | None = None
    # The pool by the other kind of power, where it has flights that this one lacks; null where it has none.
    other_kind: "PooledResults | None" = None

    @property
    def source(self) -> str:
        """What the results are of, for a message."""
        return f"{len(self.flights)} flights together"


class Configuration(msgspec.Struct, frozen=True, kw_only=True):
    """One side of a comparison."""

    aircraft: AircraftResult
    installation: str
    logs: list[str]
    name: str = ""  # of its folder
    left_out: list[LeftOut] = []


class PowerDifference(msgspec.Struct, frozen=True, kw_only=True):
    """Power of B minus power of A at one speed, with its 95 % interval."""

    speed_mps: float
    power_a_W: float
    power_b_W: float
    difference_percent: float
    lo_percent: float
    hi_percent: float
    independent_half_width_percent: float  # what it would be if A and B shared no error

    @property
    def excludes_zero(self) -> bool:
        """Whether the interval does."""
        return self.lo_percent * self.hi_percent > 0


class ComparisonResults(msgspec.Struct, frozen=True, kw_only=True):
    """The contents of the `results.json` of a comparison."""

    format: str = COMPARISON_FORMAT
    kind: Kind  # of the power that is compared
    trust: Trust  # as bad as the worst of:
    evidence: list[Evidence]  # against the flights of both, and against what the files say they share, the worst first
    software_version: str
    a: Configuration
    b: Configuration
    test: ConditionResult  # those of A, at which both curves are given
    same_installation: bool  # as the files say, unless the flights contradict it; of electrical power one aircraft
    same_propeller: bool
    differences: list[PowerDifference]
    # One of these, which answers and sentence quote: the clearest where an interval excludes zero, else the best known.
    quoted: PowerDifference
    p: float  # that errors alone make a difference as clear at any of these speeds
    differs: bool  # with at most 5 % of false alarms; an interval does not contain zero then
    text: str
    notes: list[str]
    flights_to_see: list[FlightsToSee]
    # The comparison by the other kind of power, where it has flights that this one lacks; null where it has none.
    other_kind: "ComparisonResults | None" = None


Estimate = TypeVar("Estimate", PooledResults, ComparisonResults)


def of_each_kind(results: Estimate) -> list[Estimate]:
    """The results, and those by the other kind of power where there are any."""
    return [results, results.other_kind] if results.other_kind else [results]
