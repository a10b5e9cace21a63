"""What speaks against a pool or a comparison: the evidence against each flight, and against flights as one."""

from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from analysis.pooling.agreement import Difference, Test, likely_cause
from analysis.pooling.flight_statistics import FlightStatistics
from analysis.pooling.wording import cause_text, installations_text, polars_text
from analysis.results.settings import TRUST
from analysis.results.trust import worst_first
from analysis.schema import ElectricalFlight, Evidence, EvidenceKind, PartOfResult, Trust


def against_flights(flights: Sequence[FlightStatistics]) -> Iterator[Evidence]:
    """The evidence of each flight's own results, with its name."""
    for flight in flights:
        yield from _of_results(flight.name, flight.content.evidence)


def against_electrical(flights: Sequence[ElectricalFlight]) -> list[Evidence]:
    """The same of flights that give electrical power only, the worst first."""
    return worst_first(one for flight in flights for one in _of_results(flight.log, flight.evidence))


def _of_results(log: str, evidence: list[Evidence] | None) -> Iterator[Evidence]:
    if evidence is None:
        yield Evidence(
            kind=EvidenceKind.NO_VERDICT,
            level=Trust.DOUBTFUL,
            part=PartOfResult.CURVE,
            log=log,
            text="Its results are of an earlier version, which gave no verdict: analyze the log again.",
        )
    for one in evidence or ():
        yield replace(one, log=log)


def against_polars(test: Test | None) -> Iterator[Evidence]:
    """Of the test of whether the curves of the flights agree; None for one flight."""
    if test and test.doubtful:
        yield _doubt(EvidenceKind.FLIGHTS_DIFFER, test.p, polars_text(test))


def against_installation(test: Test | None) -> Iterator[Evidence]:
    """Of the test of whether the flights have one installation; None where they do not say so."""
    if test and test.doubtful:
        yield _doubt(EvidenceKind.INSTALLATIONS_DIFFER, test.p, installations_text(test))


def against_outliers(flights: Sequence[FlightStatistics], outliers: dict[int, Difference]) -> Iterator[Evidence]:
    """Flights that differ from all others. outliers: of `agreement.outliers`."""
    limit = TRUST.false_alarm_rate / (2 * len(flights))
    for i, difference in sorted(outliers.items()):
        kind = EvidenceKind.FLIGHTS_DIFFER if difference.p < limit else EvidenceKind.INSTALLATIONS_DIFFER
        text = f"It differs from the other flights: {cause_text(likely_cause(difference))}"
        p = min(difference.p, difference.p_installation)
        yield _doubt(kind, p, text, log=flights[i].name, limit=limit)


def _doubt(
    kind: EvidenceKind, p: float, text: str, *, log: str = "", limit: float = TRUST.false_alarm_rate
) -> Evidence:
    return Evidence(
        kind=kind,
        level=Trust.DOUBTFUL,
        part=PartOfResult.CURVE,
        log=log,
        figure=p,
        limit=limit,
        false_alarm_rate=TRUST.false_alarm_rate,
        text=text,
    )
