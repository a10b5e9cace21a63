"""The contents of `results.json` of several flights together, and of a comparison (docs/understand/pooling.md).

Percentages of a pool refer to its power; percentages of a comparison refer to the power of A. Pools of drag and of
electrical power have the same fields; a field that only the joint estimate of drag fills is empty or null in others.
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
    """Coefficients of C_D = A0 + A1 C_L + A2 C_L^2."""

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
    """Scatter of the flights' curves about the pooled curve at one speed, and the part that their errors explain."""

    speed_mps: float
    observed_percent: float  # root mean square
    expected_percent: float
    excess_percent: float  # the part that the errors do not explain


class AgreementTest(msgspec.Struct, frozen=True, kw_only=True):
    """Chi-square test of whether all flights have the same values."""

    chi_square: float
    degrees_of_freedom: int
    p: float
    text: str  # the result of the test in words


class Deviation(msgspec.Struct, frozen=True, kw_only=True):
    """One flight's curve minus the pooled curve at one speed, with the 95 % limit that their errors set."""

    speed_mps: float
    difference_percent: float | None  # null where the flight did not fly this speed
    limit_percent: float | None


class PooledFlight(msgspec.Struct, frozen=True, kw_only=True):
    """One flight of a pool. Half widths are at the speeds of `against_pool`."""

    log: str
    vehicle: str = ""  # as in the flight's results
    installation: str = ""
    test: ConditionResult
    drag_polar: PolarCoefficients | None = None  # from this flight alone
    half_width_percent: list[float | None]  # from this flight alone; null at speeds that it did not fly
    half_width_without_percent: list[float | None] | None  # from the pool without it; null in a pool of one flight
    share_of_information: float
    against_pool: list[Deviation]
    # Probability of a larger difference from the other flights: p for the curve, p_installation for the errors of the
    # installation. Null in a pool of one flight, and where the flight shares no speeds with the others.
    p: float | None
    p_installation: float | None = None
    outlier: bool
    reason: str  # the likely reason, if the flight is an outlier
    trust: Trust  # trust in the flight's own results
    mounted_anew: bool = False  # the flight contradicts the installation that the files state
    start_unix_s: float | None = None  # start of its log; null where that is not known


class Outlier(msgspec.Struct, frozen=True, kw_only=True):
    """A flight that differs from the others by more than its errors explain."""

    log: str
    p: float
    reason: str


class OneMore(msgspec.Struct, frozen=True, kw_only=True):
    """Half widths of the pool now, and after another flight like the one that contributed most."""

    like: str
    speed_mps: list[float]
    half_width_percent: list[float]
    half_width_then_percent: list[float]


class FlightsToSee(msgspec.Struct, frozen=True, kw_only=True):
    """Number of flights that each of two configurations needs to show a difference of power in 9 of 10 campaigns."""

    difference_percent: float
    flights_each: int | None  # null if more than `EVIDENCE.most_repetitions` are needed


class TrendQuantity(StrEnum):
    """The quantity over which a trend of power is tested."""

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
    p: float  # probability of a change this far from zero if there is no trend
    flights: int  # number of flights for which this quantity is known


class LeftOutReason(StrEnum):
    """The reason why a flight is not in a pool."""

    ELECTRICAL_ONLY = "electrical power only"
    NO_BATTERY = "no battery"
    NO_STATISTICS = "not by the dynamic method"


class LeftOut(msgspec.Struct, frozen=True, kw_only=True):
    """A flight that is not in the pool."""

    log: str
    reason: LeftOutReason
    text: str  # the reason as a clause


class PooledUse(msgspec.Struct, frozen=True, kw_only=True):
    """The model that gives the energy of a mission (`flightpower route`), and its source."""

    losses_of: list[str]  # logs whose mean gives the losses of the power train
    losses_measured: bool  # true if the losses were measured, not assumed
    model: ComputationModel


class PooledResults(WithCurves, frozen=True, kw_only=True):
    """The contents of the `results.json` of a pool.

    Weight and density of `test` are the means over the flights; `battery` is the last flight's.
    """

    format: str = POOLED_FORMAT
    installation: str = ""
    drag_polar: PolarCoefficients | None = None
    polar_covariance: list[list[float]] = msgspec.field(default_factory=list)  # (3, 3)
    parameters: list[SharedParameter] = msgspec.field(default_factory=list)
    between_flights: list[Scatter]  # empty in a pool of one flight
    agreement: Agreement | None  # whether flights agree, by the tests and the outliers; null in a pool of one flight
    homogeneity: AgreementTest | None  # test of the curves; null in a pool of one flight
    installation_homogeneity: AgreementTest | None = None
    flights: list[PooledFlight]
    outliers: list[Outlier]
    one_more: OneMore
    flights_to_see: list[FlightsToSee]
    trends: list[Trend]
    notes: list[str]
    left_out: list[LeftOut]
    failures: list[str]  # logs that cannot be used, each with the reason
    use: PooledUse | None = None  # null where no flight has a power train
    # From the pooled polar, the mean power train and the last flight's battery; null where one of these is not known.
    performance: PerformanceResult | None = None
    # The pool for the other kind of power, if it has flights that this one lacks; otherwise null.
    other_kind: "PooledResults | None" = None

    @property
    def source(self) -> str:
        """The flights that the results describe, as words for a message."""
        return f"{len(self.flights)} flights together"


class Configuration(msgspec.Struct, frozen=True, kw_only=True):
    """One side of a comparison."""

    aircraft: AircraftResult
    installation: str
    logs: list[str]
    name: str = ""  # name of its folder
    left_out: list[LeftOut] = []


class PowerDifference(msgspec.Struct, frozen=True, kw_only=True):
    """Power of B minus power of A at one speed, with its 95 % interval."""

    speed_mps: float
    power_a_W: float
    power_b_W: float
    difference_percent: float
    lo_percent: float
    hi_percent: float
    independent_half_width_percent: float  # half width that the difference would have if A and B shared no error

    @property
    def excludes_zero(self) -> bool:
        """Whether the interval excludes zero."""
        return self.lo_percent * self.hi_percent > 0


class ComparisonResults(msgspec.Struct, frozen=True, kw_only=True):
    """The contents of the `results.json` of a comparison."""

    format: str = COMPARISON_FORMAT
    kind: Kind  # kind of the power that is compared
    trust: Trust  # as bad as the worst evidence
    evidence: list[Evidence]  # against flights of both, and against what the files say they share, the worst first
    software_version: str
    a: Configuration
    b: Configuration
    test: ConditionResult  # weight and density of A, at which both curves are given
    same_installation: bool  # as files say, unless flights contradict it; for electrical power, the same aircraft
    same_propeller: bool
    differences: list[PowerDifference]
    # The difference that answers and text quote: the clearest if an interval excludes zero, else the best known one.
    quoted: PowerDifference
    p: float  # probability that errors alone make a difference this clear at any of these speeds
    differs: bool  # whether A and B differ, with at most 5 % false alarms; an interval then excludes zero
    text: str
    notes: list[str]
    flights_to_see: list[FlightsToSee]
    # The comparison for the other kind of power, if it has flights that this one lacks; otherwise null.
    other_kind: "ComparisonResults | None" = None


Estimate = TypeVar("Estimate", PooledResults, ComparisonResults)


def of_each_kind(results: Estimate) -> list[Estimate]:
    """The results, followed by those for the other kind of power if there are any."""
    return [results, results.other_kind] if results.other_kind else [results]
