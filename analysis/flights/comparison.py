"""Is configuration B different from A? The difference of two pools at each speed, without the errors they share.

Both pools are one joint estimate with two polars. Flights of one installation share its errors, and flights with one
propeller those of thrust: such an error moves both curves alike and cancels in the difference.
"""

from dataclasses import dataclass
from functools import cache

import msgspec
import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import brentq
from scipy.stats import chi2, ncx2

from analysis.curve import POLAR, Condition, Polar, power_gradient, speed_at
from analysis.estimation.noise import NORMAL_95
from analysis.flights.agreement import INSTALLATION_PART, Test, homogeneity, quadratic_form
from analysis.flights.evidence import SharedErrors, against_installation, installations_text
from analysis.flights.flight_statistics import THRUST_CORRECTIONS, M
from analysis.flights.joint import Group, Prior, shared_prior, solve, stacked
from analysis.flights.joint_pool import JointPool
from analysis.flights.pool_settings import POOLING
from analysis.methods import consider as covariance
from analysis.methods.rejected_assumptions import Assumption
from analysis.records.flight import ConditionResult, Evidence, EvidenceKind
from analysis.records.pool import ComparisonResults, Configuration, FlightsToSee, PowerDifference
from analysis.results.evidence import trust_by, worst_first
from analysis.settings import EVIDENCE
from flight.arrays import Array
from flight.errors import InputError
from flight.version import version

_N_POLAR, _N_THRUST = len(POLAR), len(THRUST_CORRECTIONS)


@dataclass(frozen=True)
class Comparison:
    """Power of B minus power of A at one weight and density, arrays (n,) at speeds_mps.

    difference_percent, half_width_percent : of the power of A, with its 95 % interval
    independent_half_width_percent : what it would be if the two shared no error
    test : whether the two curves differ at all
    denied : by which the flights deny the one installation that the files of both name; None where they do not
    """

    a: JointPool
    b: JointPool
    condition: Condition
    speeds_mps: Array
    power_a_W: Array
    power_b_W: Array
    difference_percent: Array
    half_width_percent: Array
    independent_half_width_percent: Array
    same_installation: bool
    same_propeller: bool
    test: Test
    denied: Test | None

    @property
    def differs(self) -> bool:
        """Whether the curves differ, with at most 5 % of false alarms."""
        return self.test.differs

    @property
    def shared_errors(self) -> SharedErrors:
        """Which errors cancel in the difference."""
        if self.same_installation and not self.a.flights[0].installation:
            return SharedErrors.COMMON_PART
        if self.same_installation:
            return SharedErrors.INSTALLATION_AND_PROPELLER if self.same_propeller else SharedErrors.INSTALLATION
        return SharedErrors.PROPELLER if self.same_propeller else SharedErrors.NONE

    def evidence(self, a_name: str = "", b_name: str = "") -> list[Evidence]:
        """Against the flights of both and what they are said to share, the worst first. a_name, b_name: of the two."""
        named = [
            msgspec.structs.replace(one, log="/".join(filter(None, (name, one.log))))
            for pool, name in ((self.a, a_name), (self.b, b_name))
            for one in pool.evidence
        ]
        return worst_first([*named, *against_installation(self.denied)])

    def results(self, a_name: str = "", b_name: str = "") -> ComparisonResults:
        """The contents of the comparison's results.json. a_name, b_name: of the two configurations."""
        evidence = self.evidence(a_name, b_name)
        notes = [
            f"{name}: {note}" if name else note
            for pool, name in ((self.a, a_name), (self.b, b_name))
            for note in pool.notes
        ]
        if self.denied and EvidenceKind.INSTALLATIONS_DIFFER not in {one.kind for one in evidence}:
            notes.append(installations_text(self.denied))
        return ComparisonResults(
            trust=trust_by(evidence),
            evidence=evidence,
            notes=notes,
            software_version=version(),
            a=_configuration(self.a, a_name),
            b=_configuration(self.b, b_name),
            test=ConditionResult(weight_N=self.condition.weight_N, air_density_kgpm3=self.condition.rho),
            same_installation=self.same_installation,
            same_propeller=self.same_propeller,
            differences=_differences(self),
            chi_square=self.test.chi_square,
            degrees_of_freedom=self.test.degrees_of_freedom,
            p=self.test.p,
            differs=self.differs,
            text=_text(self),
            flights_to_see=plans_to_see(self.a),
        )


def compare(a: JointPool, b: JointPool) -> Comparison:
    """B against A at the weight and density of A, over the speeds that both flew.

    Raises InputError where a flight is in both pools, and where they have no speeds in common.
    """
    both = {flight.parameters.value.tobytes() for flight in a.flights} & {
        flight.parameters.value.tobytes() for flight in b.flights
    }
    if both:
        name = next(flight.name for flight in a.flights if flight.parameters.value.tobytes() in both)
        raise InputError(f"{name} is in both pools of the comparison; a flight belongs to one configuration: remove it")
    stated_same = _same_installation(a, b)
    denied = _denied(a, b) if stated_same else None
    same_installation, same_propeller = stated_same and denied is None, _same_propeller(a, b)
    condition_b = Condition(a.condition.weight_N, a.condition.rho, b.condition.wing_area_m2)
    V = _common_speeds(a, b, condition_b)
    polars = _joint_polars(a, b, same_installation, same_propeller)
    A, B = polars.A[:_N_POLAR], polars.A[_N_POLAR:]
    gradients = [power_gradient(V, a.condition), power_gradient(V, condition_b)]
    power_a, power_b = gradients[0] @ A, gradients[1] @ B
    J = 100 * np.hstack([-(power_b / power_a**2)[:, None] * gradients[0], gradients[1] / power_a[:, None]])
    difference = 100 * (power_b / power_a - 1)
    alone = np.zeros((2 * _N_POLAR, 2 * _N_POLAR))
    alone[:_N_POLAR, :_N_POLAR], alone[_N_POLAR:, _N_POLAR:] = a.polar.covariance, b.polar.covariance
    three = [0, len(V) // 2, -1]  # the curves have three parameters: three speeds contain all of the difference
    chi_square = float(quadratic_form(difference[three], J[three] @ polars.covariance @ J[three].T))
    return Comparison(
        a=a,
        b=b,
        condition=a.condition,
        speeds_mps=V,
        power_a_W=power_a,
        power_b_W=power_b,
        difference_percent=difference,
        half_width_percent=_half_width(J, polars.covariance),
        independent_half_width_percent=_half_width(J, alone),
        same_installation=same_installation,
        same_propeller=same_propeller,
        test=Test(chi_square, _N_POLAR, float(chi2.sf(chi_square, _N_POLAR))),
        denied=denied,
    )


def flights_to_see(pooled: JointPool, difference: float) -> int | None:
    """Flights of each of two configurations by which a difference of drag is seen in 9 of 10 campaigns.

    difference : fraction of drag, at every lift coefficient. The flights are taken to be like those of the pool, with
    the same installation and propeller throughout. None for more than `EVIDENCE.most_repetitions`.
    Raises InputError where the difference is not positive.
    """
    if not difference > 0:
        raise InputError(f"a difference of {difference:g} to be seen; give a fraction above 0, such as 0.02")
    needed = _needed_noncentrality()
    d = difference * pooled.polar.A

    def seen(n: int) -> bool:
        counts = np.array([len(range(i, n, len(pooled.flights))) for i in range(len(pooled.flights))], dtype=float)
        C = _joint_polars(
            pooled, pooled, same_installation=True, same_propeller=True, counts=(counts, counts)
        ).covariance
        T = np.hstack([-np.eye(_N_POLAR), np.eye(_N_POLAR)])
        return bool(quadratic_form(d, T @ C @ T.T) >= needed)

    if not seen(EVIDENCE.most_repetitions):
        return None
    low, high = 0, EVIDENCE.most_repetitions
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if seen(middle) else (middle, high)
    return high


def plans_to_see(pooled: JointPool) -> list[FlightsToSee]:
    """Of `flights_to_see`, for each of `POOLING.differences_to_see`."""
    return [
        FlightsToSee(difference_percent=100 * share, flights_each=flights_to_see(pooled, share))
        for share in POOLING.differences_to_see
    ]


@cache
def _needed_noncentrality() -> float:
    limit = chi2.isf(EVIDENCE.false_alarms, _N_POLAR)
    return float(brentq(lambda x: ncx2.sf(limit, _N_POLAR, x) - POOLING.detection, 1e-3, 100.0))


def _same_installation(a: JointPool, b: JointPool) -> bool:
    """By name; without names, the installation of one aircraft, of which each flight has its own deviations."""
    first, other = a.flights[0], b.flights[0]
    if first.installation != other.installation or first.probe_calibration != other.probe_calibration:
        return False
    return bool(first.installation) or first.aircraft.name == other.aircraft.name


def _denied(a: JointPool, b: JointPool) -> Test | None:
    """The test by which flights of A and B deny having one installation; None where they do not deny it.

    Flights that deny it in their own pool have errors of their own, and are left out.
    """
    own, others = ([one for i, one in enumerate(pool.flights) if i not in pool.anew] for pool in (a, b))
    if not own or not others:
        return a.installation_homogeneity if not own else b.installation_homogeneity
    test = homogeneity(stacked([*own, *others]), shared_prior([*own, *others]), INSTALLATION_PART)
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


def _joint_polars(
    a: JointPool,
    b: JointPool,
    same_installation: bool,
    same_propeller: bool,
    counts: tuple[Array, Array] | None = None,
) -> Polar:
    """Polars of A and B (6,) with their joint covariance (6, 6). counts: of `Group`, of A and of B."""
    prior_a = _prior_of_a(a, b, same_installation, same_propeller)
    at_a, end = np.r_[0:_N_POLAR, 2 * _N_POLAR : _N_POLAR + M], _N_POLAR + M
    thrust = slice(_N_POLAR, _N_POLAR + _N_THRUST)
    installation = slice(_N_POLAR + _N_THRUST, M)
    at_b = at_a.copy()
    at_b[:_N_POLAR] += _N_POLAR
    priors = [Prior(np.zeros((_N_POLAR, _N_POLAR)), np.zeros(_N_POLAR)), prior_a]
    for shared, part in ((same_propeller, thrust), (same_installation, installation)):
        if not shared:
            priors.append(Prior(b.prior.information[part, part], b.prior.vector[part]))
            at_b[part] = np.arange(end, end + len(at_b[part]))
            end += len(at_b[part])

    def cancels(error: str) -> bool:
        """Whether this error, which no residual shows, is the same in A and in B."""
        return error not in (Assumption.PARABOLIC_POLAR, Assumption.COUNTED_SPEED) and (
            same_propeller if error == Assumption.THRUST_TABLE else same_installation
        )

    changes_b = {name if cancels(name) else f"{name}, B": change for name, change in b.stack.changes.items()}
    stack_b = b.stack._replace(changes=changes_b)
    of_a, of_b = counts or (np.ones(len(a.flights)), np.ones(len(b.flights)))
    joint = solve(
        [Group(a.stack, at_a, of_a), Group(stack_b, at_b, of_b)],
        Prior(block_diag(*(p.information for p in priors)), np.concatenate([p.vector for p in priors])),
    )
    polars = slice(0, 2 * _N_POLAR)
    floor = np.kron(np.ones((2, 2)) if same_installation else np.eye(2), covariance.floor())
    return Polar(joint.parameters.value[polars], joint.parameters.covariance[polars, polars] + floor)


def _prior_of_a(a: JointPool, b: JointPool, same_installation: bool, same_propeller: bool) -> Prior:
    """The prior (M,) of the parameters of A; of those that B shares, the prior of both."""
    of_both = shared_prior([*a.flights, *b.flights])
    shared = np.zeros(M, dtype=bool)
    shared[_N_POLAR : _N_POLAR + _N_THRUST], shared[_N_POLAR + _N_THRUST :] = same_propeller, same_installation
    return Prior(
        np.where(np.outer(shared, shared), of_both.information, np.where(shared, 0.0, a.prior.information)),
        np.where(shared, of_both.vector, a.prior.vector),
    )


def _half_width(J: Array, C: Array) -> Array:
    return np.asarray(NORMAL_95 * np.sqrt(np.einsum("vi,ij,vj->v", J, C, J)))


def _configuration(pooled: JointPool, name: str) -> Configuration:
    first = pooled.flights[0]
    logs = [flight.name for flight in pooled.flights]
    return Configuration(aircraft=first.aircraft, installation=first.installation, logs=logs, name=name)


def _differences(c: Comparison) -> list[PowerDifference]:
    columns = (c.speeds_mps, c.power_a_W, c.power_b_W, c.difference_percent, c.half_width_percent)
    rows = zip(*(column.tolist() for column in (*columns, c.independent_half_width_percent)), strict=True)
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


def _text(c: Comparison) -> str:
    least = int(np.argmin(c.half_width_percent))
    difference, half_width = c.difference_percent[least], c.half_width_percent[least]
    said = f"at {c.speeds_mps[least]:.1f} m/s the power of B is {difference:+.1f} ± {half_width:.1f} % from that of A"
    verdict = f"B differs from A (p = {c.test.p:.2g})" if c.differs else f"No difference is seen (p = {c.test.p:.2g})"
    return f"{verdict}: {said}. {c.shared_errors.value}"
