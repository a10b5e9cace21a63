"""Tests whether configuration B differs from A, by the difference of two pools without the errors they share.

Two pools of drag are compared in one joint estimate with two polars. Flights of one installation share its errors, and
flights with one propeller share errors of thrust: such an error moves both curves alike and cancels in the
difference. The errors that flights of one aircraft share cancel likewise between two pools of electrical power.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import msgspec
import numpy as np

from flightpower.analysis.curve import POLAR, Condition, power_gradient, speed_at
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.flights.agreement import (
    INSTALLATION_PART,
    THRUST_PART,
    LargestDifference,
    Test,
    homogeneity,
    of_difference,
)
from flightpower.analysis.flights.curve_pool import CurvePool, curve_difference, curve_pool
from flightpower.analysis.flights.evidence import (
    NOT_ONE_VEHICLE,
    SharedErrors,
    against_installation,
    against_thrust,
    installations_text,
    one_vehicle,
    thrust_text,
    vehicle_notes,
)
from flightpower.analysis.flights.flight_statistics import FlightStatistics
from flightpower.analysis.flights.joint import shared_prior, stacked
from flightpower.analysis.flights.joint_pool import JointPool, joint_polars
from flightpower.analysis.flights.pool import of_kind
from flightpower.analysis.flights.pool_settings import POOLING
from flightpower.analysis.flights.pooled import OfAKind, Pool, first_of_kinds, plans_to_see
from flightpower.analysis.records.flight import Evidence, EvidenceKind, Kind
from flightpower.analysis.records.pool import ComparisonResults, Configuration, PowerDifference
from flightpower.analysis.results.curves import condition_result
from flightpower.analysis.results.evidence import trust_by, worst_first
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.units import DAY_S
from flightpower.flight.version import version

_N_POLAR = len(POLAR)


class Relation(NamedTuple):
    """The errors and conditions that two pools have in common.

    same_installation, same_propeller : for electrical power, whether both pools are from one aircraft
    contradicted : test by which the flights contradict the common installation named in both pools' files; else None
    thrust_contradicted : test by which the flights contradict a common thrust for one propeller and table; else None
    shared : which errors cancel in the difference
    same_day : whether all flights are from one day, so that motor speed and propeller had no night in which to change
    """

    same_installation: bool
    same_propeller: bool
    shared: SharedErrors
    contradicted: Test | None = None
    thrust_contradicted: Test | None = None
    same_day: bool = False


class _Powers(NamedTuple):
    """Powers of A and B at V_mps (n,), and covariances (n, n) of their difference in percent of A: with the shared
    errors canceled, and as if none were shared."""

    V_mps: Array
    a_W: Array
    b_W: Array
    covariance: Array
    independent: Array


@dataclass(frozen=True)
class Comparison(OfAKind["Comparison"]):
    """Power of B minus power of A at one weight and density, arrays (n,) at speeds_mps.

    difference_percent, half_width_percent : difference in percent of the power of A, and half width of its 95 %
    interval
    independent_half_width_percent : the half width if the two shared no error
    test : whether the two curves differ at all
    """

    a: Pool
    b: Pool
    relation: Relation
    speeds_mps: Array
    power_a_W: Array
    power_b_W: Array
    difference_percent: Array
    half_width_percent: Array
    independent_half_width_percent: Array
    test: LargestDifference

    @property
    def differs(self) -> bool:
        """Whether the curves differ, with a false-alarm rate of at most 5 %."""
        return self.test.differs

    def evidence(self, a_name: str = "", b_name: str = "") -> list[Evidence]:
        """Evidence against the flights and what files say they share, worst first. a_name, b_name: of A and B."""
        named = [
            msgspec.structs.replace(evidence, log="/".join(filter(None, (name, evidence.log))))
            for pool, name in ((self.a, a_name), (self.b, b_name))
            for evidence in pool.evidence
        ]
        relation = self.relation
        of_both = (*against_installation(relation.contradicted), *against_thrust(relation.thrust_contradicted))
        return worst_first([*named, *of_both])

    def results(self, a_name: str = "", b_name: str = "") -> ComparisonResults:
        """Return the contents of the comparison's results.json. a_name, b_name: names of the two configurations."""
        evidence = self.evidence(a_name, b_name)
        return ComparisonResults(
            trust=trust_by(evidence),
            evidence=evidence,
            notes=self._notes((a_name, b_name), evidence),
            software_version=version(),
            kind=self.a.kind,
            a=_configuration(self.a, a_name),
            b=_configuration(self.b, b_name),
            test=condition_result(self.a.condition),
            same_installation=self.relation.same_installation,
            same_propeller=self.relation.same_propeller,
            differences=self._differences,
            quoted=self._differences[self._quoted],
            p=self.test.p,
            differs=self.differs,
            text=self._text(),
            flights_to_see=plans_to_see(self.a),
            other_kind=self.other_kind.results(a_name, b_name) if self.other_kind else None,
        )

    @cached_property
    def _differences(self) -> list[PowerDifference]:
        columns = (self.speeds_mps, self.power_a_W, self.power_b_W, self.difference_percent, self.half_width_percent)
        rows = zip(*(column.tolist() for column in (*columns, self.independent_half_width_percent)), strict=True)
        return [
            PowerDifference(
                speed_mps=speed,
                power_a_W=power_a,
                power_b_W=power_b,
                difference_percent=difference,
                lo_percent=difference - half_width,
                hi_percent=difference + half_width,
                independent_half_width_percent=independent,
            )
            for speed, power_a, power_b, difference, half_width, independent in rows
        ]

    @property
    def _quoted(self) -> int:
        """Index of the difference to quote: the clearest, or the best known one if all intervals contain zero."""
        clear = any(row.excludes_zero for row in self._differences)
        return self.test.speed_index if clear else int(np.argmin(self.half_width_percent))

    def _text(self) -> str:
        row, p = self._differences[self._quoted], self.test.p
        verdict = f"B differs from A (p = {p:.2g})" if self.differs else f"No difference is seen (p = {p:.2g})"
        where = ", where that is clearest," if self.differs else ""
        by_chance = f"; errors alone make one as clear in {100 * p:.0f} of 100 comparisons at so many speeds"
        return (
            f"{verdict}: at {row.speed_mps:.1f} m/s{where} the {self.a.kind.words} of B is"
            f" {row.difference_percent:+.1f} ± {(row.hi_percent - row.lo_percent) / 2:.1f} % from that of A"
            f"{by_chance if row.excludes_zero and not self.differs else ''}. {self.relation.shared.value}"
        )

    def _notes(self, names: tuple[str, str], evidence: list[Evidence]) -> list[str]:
        return [*self._notes_of_kind(names, evidence), *([self.refused] if self.refused else [])]

    def _notes_of_kind(self, names: tuple[str, str], evidence: list[Evidence]) -> list[str]:
        if self.a.kind is Kind.ELECTRICAL:  # both sides together, since one board may have flown on both
            contents = [flight.content for pool in (self.a, self.b) for flight in pool.flights]
            apart = one_name(self.a, self.b) and not self.relation.same_installation
            return [*vehicle_notes(contents), *([NOT_ONE_VEHICLE] if apart else [])]
        notes = [
            f"{name}: {note}" if name else note
            for pool, name in zip((self.a, self.b), names, strict=True)
            for note in pool.notes
        ]
        for contradicted, text, kind in (
            (self.relation.contradicted, installations_text, EvidenceKind.INSTALLATIONS_DIFFER),
            (self.relation.thrust_contradicted, thrust_text, EvidenceKind.THRUST_TABLE),
        ):
            if contradicted and kind not in {piece.kind for piece in evidence if not piece.log}:
                notes.append(text(contradicted))
        return notes


def compare(a: Pool, b: Pool) -> Comparison:
    """Compare B with A at the weight and density of A, at speeds that both flew, by a kind of power that both have.

    Pools that have only one kind, the same in both, are compared by it. Otherwise both kinds are tried: power required
    first if it is the kind of both pools, else electrical power first. The second comparison is `other_kind`. Raises
    InputError if there is no common kind of power, if a flight is in both pools, or if they have no speeds in common.
    """
    if a.kind is b.kind and not a.other_kind and not b.other_kind:
        return _of_one_kind(a, b)

    def by(kind: Kind) -> Comparison:
        of_a, of_b = of_kind(a, kind), of_kind(b, kind)
        if not of_a or not of_b:
            side = "B" if of_a else "A"
            raise InputError(f"no flight of {side} gives {kind.words}; add one to compare by it")
        return _of_one_kind(of_a, of_b)

    drag_first = a.kind is b.kind is Kind.POWER_REQUIRED
    return first_of_kinds([Kind.POWER_REQUIRED, Kind.ELECTRICAL][:: 1 if drag_first else -1], by)


def _of_one_kind(a: Pool, b: Pool) -> Comparison:
    """Compare the pools by the kind of power that both have. Raises InputError as `compare` does."""
    in_both_pools = {flight.key for flight in a.flights} & {flight.key for flight in b.flights}
    if in_both_pools:
        name = next(flight.name for flight in a.flights if flight.key in in_both_pools)
        raise InputError(f"{name} is in both pools of the comparison; a flight belongs to one configuration: remove it")
    if isinstance(a, JointPool) and isinstance(b, JointPool):
        relation = _of_installations(a, b)
        powers = _by_joint_estimate(a, b, relation)
    else:
        assert isinstance(a, CurvePool) and isinstance(b, CurvePool)  # both pools are of this kind
        relation = _of_aircraft(a, b)
        powers = _by_curves(a, b, relation)
    V, a_W, b_W, covariance, independent = powers
    difference = 100 * (b_W / a_W - 1)
    half, apart = (np.asarray(NORMAL_95 * np.sqrt(np.diag(C))) for C in (covariance, independent))
    return Comparison(a, b, relation, V, a_W, b_W, difference, half, apart, of_difference(difference, covariance))


def _by_curves(a: CurvePool, b: CurvePool, relation: Relation) -> _Powers:
    at_a = curve_pool(b.flights, a.condition)
    difference, apart = (curve_difference(at_a, a, shared) for shared in (relation.same_installation, False))
    percent = np.diag(100 / difference.power_W)
    V, power_a, covariance = difference.V_mps, difference.power_W, difference.value_W.through(percent).covariance
    return _Powers(
        V, power_a, power_a + difference.value_W.value, covariance, apart.value_W.through(percent).covariance
    )


def one_name(a: Pool, b: Pool) -> bool:
    return a.flights[0].aircraft.title == b.flights[0].aircraft.title


def _of_aircraft(a: CurvePool, b: CurvePool) -> Relation:
    """Return which errors cancel: flights share errors if name and autopilot show that they are from one aircraft."""
    same = one_name(a, b) and one_vehicle(*([flight.content for flight in pool.flights] for pool in (a, b)))
    return Relation(same, same, SharedErrors.AIRCRAFT if same else SharedErrors.NO_AIRCRAFT)


def _by_joint_estimate(a: JointPool, b: JointPool, relation: Relation) -> _Powers:
    condition_b = Condition(a.condition.weight_N, a.condition.rho, b.condition.wing_area_m2)
    V = _common_speeds(a, b, condition_b)
    polars = joint_polars(a, b, relation.same_installation, relation.same_propeller, same_day=relation.same_day)
    A, B = polars.A[:_N_POLAR], polars.A[_N_POLAR:]
    gradients = [power_gradient(V, a.condition), power_gradient(V, condition_b)]
    power_a, power_b = gradients[0] @ A, gradients[1] @ B
    J = 100 * np.hstack([-(power_b / power_a**2)[:, None] * gradients[0], gradients[1] / power_a[:, None]])
    alone = np.zeros((2 * _N_POLAR, 2 * _N_POLAR))
    alone[:_N_POLAR, :_N_POLAR], alone[_N_POLAR:, _N_POLAR:] = a.polar.covariance, b.polar.covariance
    return _Powers(V, power_a, power_b, J @ polars.covariance @ J.T, J @ alone @ J.T)


def _of_installations(a: JointPool, b: JointPool) -> Relation:
    same = _same_installation(a, b)
    contradicted = _contradicted(a, b, INSTALLATION_PART) if same else None
    one_propeller = _same_propeller(a, b)
    of_thrust = _contradicted(a, b, THRUST_PART) if one_propeller else None
    same_installation, same_propeller = same and contradicted is None, one_propeller and of_thrust is None
    shared = SharedErrors.PROPELLER if same_propeller else SharedErrors.NEITHER if of_thrust else SharedErrors.NONE
    if same_installation:
        shared = SharedErrors.INSTALLATION_AND_PROPELLER if same_propeller else SharedErrors.INSTALLATION
        if of_thrust:
            shared = SharedErrors.NOT_THRUST
        if not a.flights[0].installation and not of_thrust:
            shared = SharedErrors.COMMON_PART
    return Relation(same_installation, same_propeller, shared, contradicted, of_thrust, _same_day(a, b))


def _same_installation(a: JointPool, b: JointPool) -> bool:
    """Compare installations by name; without names, flights of one aircraft share an installation."""
    first, other = a.flights[0], b.flights[0]
    if first.installation != other.installation or first.probe_calibration != other.probe_calibration:
        return False
    return bool(first.installation) or first.aircraft.name == other.aircraft.name


def _same_day(a: JointPool, b: JointPool) -> bool:
    """Whether all flights were made within half a day, with no night between them; False if any flight has no date."""
    starts = [flight.start_unix_s if flight.dated else None for pool in (a, b) for flight in pool.flights]
    start_times = [start for start in starts if start is not None]
    return len(start_times) == len(starts) and max(start_times) - min(start_times) < DAY_S / 2


def _contradicted(a: JointPool, b: JointPool, part: slice) -> Test | None:
    """Return the test by which flights of A and B contradict common errors of a part; None if they do not.

    part: INSTALLATION_PART or THRUST_PART. The other errors are free on each side, so changes in them do not count.
    Flights that contradict the common installation within their own pool have separate errors, and are left out.
    """
    own, others = ([flight for i, flight in enumerate(pool.flights) if i not in pool.remounted] for pool in (a, b))
    if not own or not others:
        if part == THRUST_PART:
            return None
        return a.installation_homogeneity if not own else b.installation_homogeneity
    test = homogeneity(stacked([*own, *others]), shared_prior([*own, *others]), part)
    return test if test.differs else None


def _same_propeller(a: JointPool, b: JointPool) -> bool:
    first, other = a.flights[0], b.flights[0]
    return (first.propeller_table, first.prior_measurements) == (other.propeller_table, other.prior_measurements)


def _common_speeds(a: JointPool, b: JointPool, condition_b: Condition) -> Array:
    slow, fast = (
        [float(speed_at(CL, condition)) for CL, condition in zip(limits, (a.condition, condition_b), strict=True)]
        for limits in ((a.flown_CL[1], b.flown_CL[1]), (a.flown_CL[0], b.flown_CL[0]))
    )
    if max(slow) >= min(fast):
        raise InputError(
            f"the two pools have no speeds in common: {slow[0]:.1f} to {fast[0]:.1f} m/s, and {slow[1]:.1f} to"
            f" {fast[1]:.1f} m/s; fly both over the same speeds"
        )
    return np.linspace(max(slow), min(fast), POOLING.compared_speeds)


def _configuration(pooled: Pool, name: str) -> Configuration:
    first = pooled.flights[0]
    installation = first.installation if isinstance(first, FlightStatistics) else ""
    logs = [flight.name for flight in pooled.flights]
    return Configuration(
        aircraft=first.aircraft, installation=installation, logs=logs, name=name, left_out=list(pooled.left_out)
    )
