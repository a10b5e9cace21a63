"""What the next twenty minutes should be, from what one flight left uncertain.

The interval is largest somewhere on the curve. There its variance is that of noise, which more runs lower, and that of
sensor errors. The effect of the three that matter on power P = D V follows from lift L = W: an offset of the angle of
attack turns the lift and adds W V to the power for each radian, a slope that is wrong by a share s does so with
s alpha, and a scale of airspeed takes D of another speed, and an angle of attack that is wrong by twice its share.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flightpower.analysis.curve import Condition, Polar, polar_part, power_required, speed_at
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.records.flight import NextFlightLowers
from flightpower.analysis.settings import EVIDENCE
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.observability import MATTERS
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.analysis.trajectory.settings import GUSTS
from flightpower.flight.arrays import Array

FLY = {
    NextFlightLowers.NOISE: "fly more accelerations and decelerations, the throttle opened slowly, down to the slowest"
    " speed that is safe",
    NextFlightLowers.ALPHA_BIAS: "fly fast for long, back and forth or in circles both ways: the mean of vertical gusts"
    " becomes smaller with distance, and their angle with speed",
    NextFlightLowers.ALPHA_SCALE: "porpoise for several minutes: stick fore and aft, 1.3 to 1.8 s a cycle, with the"
    " load factor between 0 and 2",
    NextFlightLowers.V_SCALE: "fly fast in circles both ways, or back and forth on opposite headings, where GPS shows"
    " the airspeed",
}
TITLES = {
    NextFlightLowers.NOISE: "noise of the runs",
    NextFlightLowers.ALPHA_BIAS: "the offset of angle of attack",
    NextFlightLowers.ALPHA_SCALE: "the slope of angle of attack",
    NextFlightLowers.V_SCALE: "the scale of airspeed",
}


class MissingInformation(NamedTuple):
    """speed_mps: where the interval is largest. percent: its half width. cause: whose halving narrows it
    most. percent_without: the half width then."""

    speed_mps: float
    percent: float
    cause: NextFlightLowers
    percent_without: float


def missing_information(
    trajectory: Trajectory, estimate: DynamicEstimate, condition: Condition, flown_CL: tuple[float, float]
) -> MissingInformation | None:
    """What made the interval wide; None where power is not known or the covariance is not finite."""
    V = np.linspace(speed_at(flown_CL[1], condition), speed_at(flown_CL[0], condition), 9)
    power, sigma = power_required(V, estimate.polar, condition)
    if not (np.isfinite(sigma).all() and (power > 0).all()):
        return None
    i = int(np.argmax(sigma / power))
    _, (noise,) = power_required(V[i : i + 1], Polar(estimate.polar.A, polar_part(estimate.noise)), condition)
    variances = {NextFlightLowers.NOISE: float(noise**2)}
    effect, which = _effects_W(trajectory, estimate.polar.A, condition, float(V[i]))
    covariance = trajectory.covariance[np.ix_(which, which)]
    whole = float(effect @ covariance @ effect)
    for k, name in enumerate(MATTERS):
        # What is left of the variance when this error is known: conditional on it.
        others = covariance - np.outer(covariance[k], covariance[k]) / covariance[k, k]
        variances[NextFlightLowers(name)] = max(whole - float(effect @ others @ effect), 0.0)
    cause = max(variances, key=lambda variance: variances[variance])
    # Correlation with other errors can make the part larger than the whole; half an error halves no interval further.
    left = float(sigma[i] ** 2) - (1 - 0.5**2) * min(variances[cause], float(sigma[i] ** 2))
    percent = 100 * NORMAL_95 / float(power[i])
    return MissingInformation(float(V[i]), percent * float(sigma[i]), cause, percent * float(np.sqrt(left)))


class Advice(NamedTuple):
    """What to fly next, in sentences, and what it lowers; both empty where nothing is lacking."""

    lowers: NextFlightLowers = NextFlightLowers.NOTHING
    sentences: Sequence[str] = ()


def next_flight(
    trajectory: Trajectory, estimate: DynamicEstimate, condition: Condition, flown_CL: tuple[float, float]
) -> Advice:
    """What to fly next; nothing where the standard error is negligible already."""
    missing = missing_information(trajectory, estimate, condition, flown_CL)
    if missing is None or missing.percent < 100 * NORMAL_95 * EVIDENCE.negligible:
        return Advice()
    sentences = [
        f"The next twenty minutes: {FLY[missing.cause]}. The interval is widest at {missing.speed_mps:.1f} m/s,"
        f" ±{missing.percent:.1f} %, most of all by {TITLES[missing.cause]}; known twice as well it would leave"
        f" ±{missing.percent_without:.1f} %."
    ]
    if trajectory.gust_mps > GUSTS.dominate_mps and missing.cause is not NextFlightLowers.NOISE:
        sentences.append("A calmer day does the same in less time.")
    return Advice(missing.cause, sentences)


def _effects_W(trajectory: Trajectory, A: Array, condition: Condition, V: float) -> tuple[Array, list[int]]:
    """Change of power [W] by each of MATTERS, and their places among the sensor errors."""
    blocks = trajectory.block_means
    flown = blocks.flying & np.isfinite(blocks["alpha_rad"])
    CL = 2 * condition.weight_N / (condition.rho * blocks["V_mps"][flown] ** 2 * condition.wing_area_m2)
    at = 2 * condition.weight_N / (condition.rho * V**2 * condition.wing_area_m2)
    alpha = float(np.polyval(np.polyfit(CL, blocks["alpha_rad"][flown], 1), at)) - trajectory.value("alpha_bias")
    step = 0.01 * V
    drag = [float(power_required([v], Polar(A, np.zeros((3, 3))), condition)[0][0]) / v for v in (V - step, V + step)]
    lift_W = condition.weight_N * V
    effects = {
        "alpha_bias": lift_W,
        "alpha_scale": lift_W * alpha,
        "V_scale": -(V**2) * (drag[1] - drag[0]) / (2 * step) - 2 * lift_W * alpha,
    }
    return np.array([effects[name] for name in MATTERS]), [SENSOR_ERRORS.index(name) for name in MATTERS]
