"""Pairs of methods that disagree: where, by how much, and which sensor error causes it.

The two methods of a pair differ in the quantities that they do not correct, so only errors of these quantities can make
them disagree:

dynamic, direct               alignment of the angle of attack
dynamic, speed                pitch attitude
dynamic, energy               airspeed; pitch attitude of the trajectory if no estimated error explains the difference
dynamic, steady points        propeller table
accelerations, decelerations  lag of the air data, or thrust

The cause reported is the one whose estimated errors explain most of the difference.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from flightpower.analysis.curve import Condition, Polar, polar_part, power_required, speed_at
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.causes import CAUSES, ErrorEstimate
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.methods.method import MethodEstimate
from flightpower.analysis.methods.settings import COMPARISON
from flightpower.analysis.methods.thrust_prior import J_REFERENCE
from flightpower.analysis.records.flight import Cause, DisagreementResult
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.flight.arrays import Array

DYNAMIC = "dynamic"
PAIRS = (
    (DYNAMIC, "direct"),
    (DYNAMIC, "direct-speed"),
    (DYNAMIC, "energy"),
    (DYNAMIC, "piw-viw"),
    ("decelerations", "accelerations"),
)
# The cause of a difference that no estimated error explains, by name of the second method.
CAUSE_BY_EXCLUSION = {"energy": Cause.PITCH_ATTITUDE}


class ComparedMethod(NamedTuple):
    """One of the two methods compared; fields as in `MethodEstimate`.

    covariance : (3, 3) of A due to noise; for the dynamic method, due to noise and systematic errors
    trajectory_deviations : None for the dynamic method, whose covariance contains them
    """

    name: str
    title: str
    A: Array
    covariance: Array
    sensitivities: Mapping[str, Array]
    cause_effects: Mapping[Cause, Array]
    trajectory_deviations: Array | None
    flown_CL: tuple[float, float]


def disagreements(
    dynamic: DynamicEstimate | None,
    dynamic_CL: tuple[float, float],
    estimates: list[MethodEstimate],
    errors: Mapping[str, ErrorEstimate],
    condition: Condition,
) -> list[DisagreementResult]:
    """Compare all PAIRS at one weight and density, and return those that disagree. errors: from `estimate_errors`"""
    methods = {
        e.method.name: ComparedMethod(
            e.method.name,
            e.method.title,
            e.polar.A,
            e.noise,
            e.sensitivities,
            e.cause_effects,
            e.trajectory_deviations,
            e.flown_CL,
        )
        for e in estimates
        if e.polar is not None
    }
    if dynamic is not None:
        A, total = dynamic.polar.A, polar_part(dynamic.noise + dynamic.systematic)
        methods[DYNAMIC] = ComparedMethod(DYNAMIC, "the dynamic method", A, total, {}, {}, None, dynamic_CL)
        # Methods are not compared where gusts raise the lift coefficient above its value at the slowest speed flown.
        methods = {
            name: estimate._replace(flown_CL=(estimate.flown_CL[0], min(estimate.flown_CL[1], dynamic_CL[1])))
            for name, estimate in methods.items()
        }
    compared = (_compare(methods[a], methods[b], errors, condition) for a, b in PAIRS if a in methods and b in methods)
    return [disagreement for disagreement in compared if disagreement is not None]


def _compare(
    first: ComparedMethod, second: ComparedMethod, errors: Mapping[str, ErrorEstimate], condition: Condition
) -> DisagreementResult | None:
    low, high = max(first.flown_CL[0], second.flown_CL[0]), min(first.flown_CL[1], second.flown_CL[1])
    if high < COMPARISON.least_speed_ratio**2 * low:
        return None
    V = speed_at(np.linspace(low, high, 31), condition)
    _, error = power_required(V, Polar(first.A, _allowed_covariance(first, second)), condition)
    differences = _power(V, second.A - first.A, condition)
    excess = np.abs(differences) / (COMPARISON.different * error)
    worst = int(np.argmax(excess))
    if excess[worst] <= 1:
        return None
    V_worst = V[worst : worst + 1]
    shares = {
        cause: float(_power(V_worst, _cause_effect(second, cause) - _cause_effect(first, cause), condition)[0])
        for cause in CAUSES
        if cause in first.cause_effects or cause in second.cause_effects
    }
    difference, allowed = float(differences[worst]), float(COMPARISON.different * error[worst])
    shares[Cause.UNEXPLAINED] = difference - sum(shares.values())
    cause = _cause(second.name, difference, allowed, shares, errors)
    if cause is None:
        return None
    speed, power = float(V_worst[0]), float(_power(V_worst, first.A, condition)[0])
    quoted = Difference(speed, power, difference, cause, shares.get(cause), shares[Cause.UNEXPLAINED])
    return DisagreementResult(
        methods=(first.name, second.name),
        speed_mps=speed,
        difference_W=difference,
        allowed_W=allowed,
        culprit=cause,
        text=sentences((first.title, second.title), quoted, errors, condition),
        shares_W=shares,
    )


def _cause(
    second: str,
    difference: float,
    allowed: float,
    shares: Mapping[Cause, float],
    errors: Mapping[str, ErrorEstimate],
) -> Cause | None:
    """The cause with the largest share of a difference [W]; None if there is none to name.

    If the unexplained share is the largest but not above `allowed`, the cause is the largest significant error.
    """
    largest = max(shares, key=lambda cause: shares[cause] * np.sign(difference))
    if largest is not Cause.UNEXPLAINED:
        return largest
    if abs(shares[Cause.UNEXPLAINED]) > allowed:
        return CAUSE_BY_EXCLUSION.get(second, Cause.UNEXPLAINED)
    significant = [cause for cause in shares if _significant(cause, errors) and shares[cause] * difference > 0]
    return max(significant, key=lambda cause: abs(shares[cause]), default=None)


def _significant(cause: Cause, errors: Mapping[str, ErrorEstimate]) -> bool:
    estimates = [errors[name] for name in CAUSES.get(cause, ())]
    return any(abs(error.value) > STATISTICS.sigmas * error.standard_error for error in estimates)


def _allowed_covariance(first: ComparedMethod, second: ComparedMethod) -> Array:
    """Covariance (3, 3) of the difference of two faultless methods, due to noise and COMPARISON.installation_sigma."""
    C = first.covariance + second.covariance
    for name in sorted(set(first.sensitivities) | set(second.sensitivities)):
        sensitivity = second.sensitivities.get(name, np.zeros(3)) - first.sensitivities.get(name, np.zeros(3))
        C = C + np.outer(sensitivity, sensitivity) * COMPARISON.installation_sigma[name] ** 2
    if first.trajectory_deviations is not None and second.trajectory_deviations is not None:
        deviations = second.trajectory_deviations - first.trajectory_deviations
        C = C + deviations @ deviations.T
    return C


def _cause_effect(method: ComparedMethod, cause: Cause) -> Array:
    return method.cause_effects.get(cause, np.zeros(3))


def _power(V: Array, A: Array, condition: Condition) -> Array:
    """Power required [W] (n,) by polar coefficients A (3,), or its difference by a difference of coefficients."""
    power, _ = power_required(V, Polar(A, np.zeros((3, 3))), condition)
    return power


class Difference(NamedTuple):
    """Difference of the second method from the first at one speed, and the part that the cause explains.

    power_W : by the first method     share_W : part due to the cause; None where its errors were not estimated
    """

    speed_mps: float
    power_W: float
    difference_W: float
    cause: Cause
    share_W: float | None
    unexplained_W: float


def sentences(
    titles: tuple[str, str], quoted: Difference, errors: Mapping[str, ErrorEstimate], condition: Condition
) -> str:
    """Sentences on the difference of the second method from the first, its cause, and the part that this explains."""
    V, power_W, difference_W, cause, share_W, unexplained_W = quoted
    first, second = titles
    size, where = abs(difference_W), "above" if difference_W > 0 else "below"
    difference = (
        f"{second[0].upper()}{second[1:]}: {100 * size / power_W:.0f} % ({size:.1f} W) {where} {first} at {V:.1f} m/s."
    )
    if cause is Cause.UNEXPLAINED:
        return f"{difference} No estimated error of the sensors or the propeller table explains it."
    if share_W is None:
        # Only the pair dynamic and energy has a cause by exclusion. If the pitch attitude is too high, the dynamic
        # method counts a part of lift as drag, and its power is too high by W V tilt.
        tilt = np.degrees(-unexplained_W / (condition.weight_N * V))
        return (
            f"{difference} Errors of airspeed, lag and thrust do not explain it: the trajectory's pitch attitude is"
            f" {abs(tilt):.2f} deg too {'high' if tilt > 0 else 'low'}."
        )
    return (
        f"{difference} {_error_sentence(cause, errors)} This explains {abs(share_W):.1f} W of the difference;"
        f" {abs(unexplained_W):.1f} W remain unexplained."
    )


def _error_sentence(cause: Cause, errors: Mapping[str, ErrorEstimate]) -> str:
    """A sentence on the estimated errors of a cause."""
    if cause is Cause.ANGLE_OF_ATTACK:
        bias, scale = errors["alpha_bias"], errors["alpha_scale"]
        sentence = f"The measured angle of attack is {_degrees(bias)} relative to the IMU axes"
        if abs(scale.value) > 2 * scale.standard_error:
            sentence += f", and its slope is {_percent(scale, 'too high', 'too low')}"
        return f"{sentence}."
    if cause is Cause.PITCH_ATTITUDE:
        return f"An accelerometer bias makes the pitch attitude {_degrees(errors['pitch'])}."
    if cause is Cause.AIRSPEED:
        return f"The measured airspeed is {_percent(errors['airspeed_scale'], 'too high', 'too low')}."
    if cause is Cause.AIR_DATA_LAG:
        lag = errors["lag"]
        return f"The air data lag by {lag.value:.3f} ± {NORMAL_95 * lag.standard_error:.3f} s."
    scale, slope = errors["thrust_scale"], errors["thrust_slope"]
    return (
        f"Thrust is {_percent(scale, 'more', 'less')} than the propeller table gives at J = {J_REFERENCE:g}, changing"
        f" by {10 * slope.value:+.1f} % per 0.1 of J (a wrong motor speed or weight looks the same)."
    )


def _degrees(error: ErrorEstimate) -> str:
    value, half = np.degrees(error.value), np.degrees(NORMAL_95 * error.standard_error)
    return f"{abs(value):.2f} ± {half:.2f} deg too {'high' if value > 0 else 'low'}"


def _percent(error: ErrorEstimate, more: str, less: str) -> str:
    half = 100 * NORMAL_95 * error.standard_error
    return f"{100 * abs(error.value):.1f} ± {half:.1f} % {more if error.value > 0 else less}"
