"""Where two methods disagree, by how much, and what that points at.

Each pair differs in what it takes as measured, so only certain faults can part it: dynamic and direct the
alignment of the angle of attack; dynamic and speed the pitch attitude; dynamic and energy the airspeed or, if nothing
that was found explains it, the pitch attitude of the path; accelerations and decelerations lag or thrust; dynamic and
steady points the propeller's table. The culprit is the cause that accounts for most of the gap, by what path and
dynamic method found of it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.drag import polar as curve
from analysis.drag import sensor_errors as as_measured
from analysis.drag.dynamic import DynamicEstimate
from analysis.drag.forces import J_REFERENCE
from analysis.drag.method import MethodEstimate
from analysis.drag.polar import Condition, Polar
from analysis.drag.sensor_errors import Error
from analysis.estimation.intervals import NORMAL_95

Array = NDArray[np.float64]

SURE = 3.0  # standard errors: five pairs are compared, each at many speeds
SPEEDS = 31
LEAST_COMMON = 1.15  # highest over lowest speed that both methods saw
UNEXPLAINED = "unexplained"
NOTHING: Array = np.zeros((3, 3))

# What is left over when everything found is taken out, pair by pair.
LEFT_OVER = {"energy": "pitch attitude"}
DYNAMIC = "dynamic"


class Side(NamedTuple):
    """One of two methods compared: its polar and what may part it from the other."""

    name: str
    title: str
    A: Array
    noise: Array
    slopes: Mapping[str, Array]
    faults: Mapping[str, Array]
    moves: Array | None
    flown_CL: tuple[float, float]


@dataclass(frozen=True)
class Disagreement:
    """At `speed_mps` the second method gives `difference_W` more than the first; `allowed_W` would be no surprise.

    shares_W : how much of the difference each cause accounts for; UNEXPLAINED what none does
    """

    first: str
    second: str
    speed_mps: float
    difference_W: float
    allowed_W: float
    culprit: str
    shares_W: dict[str, float]
    text: str


def disagreements(
    dynamic: DynamicEstimate | None,
    dynamic_CL: tuple[float, float],
    answers: list[MethodEstimate],
    errors: Mapping[str, Error],
    at: Condition,
) -> list[Disagreement]:
    """All pairs that disagree, at one weight and density. errors: as `as_measured.found` has them."""
    sides = {answer.method.name: _side(answer) for answer in answers if answer.polar is not None}
    if dynamic is not None:
        whole = dynamic.noise + dynamic.systematic
        sides[DYNAMIC] = Side(
            DYNAMIC, "the dynamic method", dynamic.values[:3], whole[:3, :3], {}, {}, None, dynamic_CL
        )
    pairs = [(DYNAMIC, name) for name in ("direct", "direct-speed", "energy", "piw-viw")]
    pairs.append(("decelerations", "accelerations"))
    found = (_compared(sides[a], sides[b], errors, at) for a, b in pairs if a in sides and b in sides)
    return [one for one in found if one is not None]


def _side(answer: MethodEstimate) -> Side:
    assert answer.polar is not None
    return Side(
        answer.method.name,
        answer.method.title,
        answer.polar.A,
        answer.noise,
        answer.slopes,
        answer.faults,
        answer.moves,
        answer.flown_CL,
    )


def _compared(first: Side, second: Side, errors: Mapping[str, Error], at: Condition) -> Disagreement | None:
    low, high = max(first.flown_CL[0], second.flown_CL[0]), min(first.flown_CL[1], second.flown_CL[1])
    if high < LEAST_COMMON**2 * low:
        return None
    V = curve.speed_at(np.linspace(low, high, SPEEDS), at)
    gap, _ = curve.power_required(V, Polar(second.A - first.A, NOTHING), at)
    _, error = curve.power_required(V, Polar(first.A, _allowed(first, second)), at)
    excess = np.abs(gap) / (SURE * error)
    worst = int(np.argmax(excess))
    if excess[worst] <= 1:
        return None
    here = V[worst : worst + 1]
    power, _ = curve.power_required(here, Polar(first.A, NOTHING), at)
    shares = {
        cause: float(curve.power_required(here, Polar(_of(second, cause) - _of(first, cause), NOTHING), at)[0][0])
        for cause in as_measured.CAUSES
        if cause in first.faults or cause in second.faults
    }
    difference = float(gap[worst])
    shares[UNEXPLAINED] = difference - sum(shares.values())
    culprit = max(shares, key=lambda cause: shares[cause] * np.sign(difference))
    allowed = float(SURE * error[worst])
    if culprit == UNEXPLAINED and abs(shares[UNEXPLAINED]) > allowed:
        culprit = LEFT_OVER.get(second.name, UNEXPLAINED)
    elif culprit == UNEXPLAINED:
        # What is left over would be no surprise: a fault that was surely found is named, though it be the smaller part.
        surely = [cause for cause in shares if _surely_found(cause, errors) and shares[cause] * difference > 0]
        if not surely:
            return None
        culprit = max(surely, key=lambda cause: abs(shares[cause]))
    text = _in_words(first, second, float(V[worst]), difference, float(power[0]), culprit, shares, errors, at)
    return Disagreement(first.name, second.name, float(V[worst]), difference, allowed, culprit, shares, text)


def _surely_found(cause: str, errors: Mapping[str, Error]) -> bool:
    found = [errors[name] for name in as_measured.CAUSES.get(cause, ())]
    return any(abs(error.value) > SURE * error.standard_error for error in found)


def _allowed(first: Side, second: Side) -> Array:
    """Covariance (3, 3) of the difference between the two if nothing is wrong: noise, and a careful installation."""
    C = first.noise + second.noise
    for name in set(first.slopes) | set(second.slopes):
        slope = second.slopes.get(name, np.zeros(3)) - first.slopes.get(name, np.zeros(3))
        C = C + np.outer(slope, slope) * as_measured.CAREFUL[name] ** 2
    if first.moves is not None and second.moves is not None:
        moves = second.moves - first.moves
        C = C + moves @ moves.T
    return C


def _of(side: Side, cause: str) -> Array:
    return side.faults.get(cause, np.zeros(3))


def _in_words(
    first: Side,
    second: Side,
    V: float,
    difference_W: float,
    power_W: float,
    culprit: str,
    shares: Mapping[str, float],
    errors: Mapping[str, Error],
    at: Condition,
) -> str:
    where = "above" if difference_W > 0 else "below"
    left = shares[UNEXPLAINED]
    size = abs(difference_W)
    said = (
        f"{second.title[0].upper()}{second.title[1:]}: {100 * size / power_W:.0f} % ({size:.1f} W) {where}"
        f" {first.title} at {V:.1f} m/s. "
    )
    if culprit == UNEXPLAINED:
        return said + "Nothing that was found in the sensors or the propeller's table explains it."
    if LEFT_OVER.get(second.name) == culprit and culprit not in shares:
        # A nose held too high by the path turns lift into drag of the dynamic method: W V tilt above the energy's.
        tilt = np.degrees(-left / (at.weight_N * V))
        return (
            said + f"Airspeed, lag and thrust do not explain it: the path's pitch attitude is {abs(tilt):.2f} deg too"
            f" {'high' if tilt > 0 else 'low'}."
        )
    explained = f" That accounts for {abs(shares[culprit]):.1f} W of it; {abs(left):.1f} W remain unexplained."
    return said + _fault_in_words(culprit, errors) + explained


def _fault_in_words(cause: str, errors: Mapping[str, Error]) -> str:
    """What was found of a cause, with its size."""
    if cause == "angle of attack":
        bias, scale = errors["alpha_bias"], errors["alpha_scale"]
        words = f"The angle of attack reads {_degrees(bias)} against the IMU's axes"
        return words + (
            f", and {_percent(scale)} in its slope." if abs(scale.value) > 2 * scale.standard_error else "."
        )
    if cause == "pitch attitude":
        return f"The pitch attitude that the accelerometer levels is {_degrees(errors['pitch'])}: it is biased."
    if cause == "airspeed":
        return f"The airspeed reads {_percent(errors['airspeed_scale'])}."
    if cause == "air-data lag":
        lag = errors["lag"]
        return f"The air data come {lag.value:.3f} ± {NORMAL_95 * lag.standard_error:.3f} s late."
    scale, slope = errors["thrust_scale"], errors["thrust_slope"]
    return (
        f"The propeller gives {_percent(scale, 'more', 'less')} thrust than its table says at J = {J_REFERENCE:g},"
        f" changing by {10 * slope.value:+.1f} % for each 0.1 of J (or the motor's speed or the weight is wrong)."
    )


def _degrees(error: Error) -> str:
    value, half = np.degrees(error.value), np.degrees(NORMAL_95 * error.standard_error)
    return f"{abs(value):.2f} ± {half:.2f} deg too {'high' if value > 0 else 'low'}"


def _percent(error: Error, more: str = "high", less: str = "low") -> str:
    half = 100 * NORMAL_95 * error.standard_error
    return f"{100 * abs(error.value):.1f} ± {half:.1f} % {more if error.value > 0 else less}"
