"""Suggests the next twenty minutes of flight, based on what one flight left uncertain.

At the speed where the interval is largest, its variance is split into the parts of `methods.interval_sources`, which
the report draws, and the largest part is named. If that is the angle of attack, its offset or its slope is named,
whichever has the larger effect on power P = D V. With lift L = W, an offset turns the lift vector and adds W V to the
power per radian. A relative error s of the slope acts like an offset s alpha. A scale error of airspeed gives the drag
of a different speed, and twice that relative error in angle of attack.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from flightpower.analysis.curve import Condition, Polar, power_required, speed_at
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.interval_sources import Share
from flightpower.analysis.records.flight import NextFlightLowers
from flightpower.analysis.settings import EVIDENCE
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.observability import MATTERS
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.analysis.trajectory.settings import GUSTS
from flightpower.flight.arrays import Array

FLIGHT, GROUND = "The next twenty minutes", "Before the next flight"


class Remedy(NamedTuple):
    """when: FLIGHT or GROUND. sentence: what narrows the interval. part: which part of the share, if it has several."""

    when: str
    sentence: str
    share: Share
    part: str = ""


REMEDIES = {
    NextFlightLowers.NOISE: Remedy(
        FLIGHT,
        "fly more accelerations and decelerations, the throttle opened slowly, down to the slowest speed that is safe",
        Share.NOISE,
    ),
    NextFlightLowers.ALPHA_BIAS: Remedy(
        FLIGHT,
        "fly fast for long, back and forth or in circles both ways: the mean of vertical gusts becomes smaller with"
        " distance, and their angle with speed",
        Share.ANGLE_OF_ATTACK,
        "its offset",
    ),
    NextFlightLowers.ALPHA_SCALE: Remedy(
        FLIGHT,
        "porpoise for several minutes: stick fore and aft, 1.3 to 1.8 s a cycle, with the load factor between 0 and 2",
        Share.ANGLE_OF_ATTACK,
        "its slope",
    ),
    NextFlightLowers.V_SCALE: Remedy(
        FLIGHT,
        "fly fast in circles both ways, or back and forth on opposite headings, where GPS shows the airspeed",
        Share.AIRSPEED,
    ),
    NextFlightLowers.UPDRAFT: Remedy(
        FLIGHT,
        "fly on another day, early in the morning over even ground, and pool both flights: air that rises or sinks"
        " all the time looks like less or more drag",
        Share.UPDRAFT,
    ),
    NextFlightLowers.PROPELLER: Remedy(
        GROUND,
        "have a table measured with this propeller and motor, or decelerate with the propeller folded or stopped",
        Share.PROPELLER,
    ),
    NextFlightLowers.ACCELEROMETER: Remedy(
        GROUND, "calibrate the accelerometer on six sides, and its vibration in a run-up", Share.ACCELEROMETER
    ),
    NextFlightLowers.WEIGHT: Remedy(
        GROUND, "weigh the aircraft as it flies, and enter the error of the scale", Share.WEIGHT
    ),
    NextFlightLowers.DENSITY: Remedy(
        GROUND, "measure pressure and temperature of the air better, and enter their error", Share.DENSITY
    ),
    NextFlightLowers.TRANSDUCERS: Remedy(
        GROUND, "calibrate the pressure transducers, and let them warm up before take-off", Share.TRANSDUCERS
    ),
    NextFlightLowers.AIRCRAFT_FILE: Remedy(
        GROUND, "enter the keys that the aircraft file lacks: the assumptions name them", Share.AIRCRAFT_FILE
    ),
    NextFlightLowers.POLAR_SHAPE: Remedy(
        FLIGHT, "fly more runs over the whole range of speeds: the drag is no parabola", Share.POLAR_SHAPE
    ),
    NextFlightLowers.OTHER_SENSORS: Remedy(
        FLIGHT, "fly longer, with turns to both sides and legs on opposite headings", Share.OTHER_SENSORS
    ),
    NextFlightLowers.SHARED: Remedy(
        FLIGHT, "fly on another day with the instruments mounted again, and pool both flights", Share.SHARED
    ),
}
BY_SHARE = {remedy.share: lowers for lowers, remedy in REMEDIES.items() if not remedy.part}
GUSTS_HIDE = {NextFlightLowers.ALPHA_BIAS, NextFlightLowers.ALPHA_SCALE, NextFlightLowers.V_SCALE}


class MissingInformation(NamedTuple):
    """speed_mps: where the interval is largest. percent: its half width. cause: the largest part of its variance.
    percent_without: the half width if the cause were known twice as well."""

    speed_mps: float
    percent: float
    cause: NextFlightLowers
    percent_without: float


Sources = Callable[[Array], dict[Share, Array]]


def missing_information(
    trajectory: Trajectory, polar: Polar, condition: Condition, flown_CL: tuple[float, float], sources: Sources
) -> MissingInformation | None:
    """Find what made the interval wide; None if power is not positive or the covariance is not finite.

    sources : function that returns variance (n,) of power at speeds (n,) by source, as the report draws it:
    `variance_by_source`
    """
    V = np.linspace(speed_at(flown_CL[1], condition), speed_at(flown_CL[0], condition), 9)
    power, sigma = power_required(V, polar, condition)
    if not (np.isfinite(sigma).all() and (power > 0).all()):
        return None
    i = int(np.argmax(sigma / power))
    variances = {source: float(part[0]) for source, part in sources(V[i : i + 1]).items()}
    largest = max(variances, key=lambda source: variances[source])
    cause = (
        _error_of_angle(trajectory, polar.A, condition, float(V[i]))
        if largest is Share.ANGLE_OF_ATTACK
        else BY_SHARE[largest]
    )
    total_W2 = float(sigma[i] ** 2)
    left = total_W2 - (1 - 0.5**2) * min(variances[largest], total_W2)
    percent = 100 * NORMAL_95 / float(power[i])
    return MissingInformation(float(V[i]), percent * float(sigma[i]), cause, percent * float(np.sqrt(left)))


def _error_of_angle(trajectory: Trajectory, A: Array, condition: Condition, V: float) -> NextFlightLowers:
    """Return the error of the angle of attack whose knowledge would remove the larger part of power's variance."""
    effect, which = _effects_W(trajectory, A, condition, V)
    covariance = trajectory.covariance[np.ix_(which, which)]
    with_each = (covariance @ effect) ** 2 / np.diag(covariance)
    parts = dict(zip(MATTERS, with_each.tolist(), strict=True))
    angle = (NextFlightLowers.ALPHA_BIAS, NextFlightLowers.ALPHA_SCALE)
    return max(angle, key=lambda error: parts[error])


class Advice(NamedTuple):
    """What to fly next, in sentences, and what it lowers; both are empty if no information is missing."""

    lowers: NextFlightLowers = NextFlightLowers.NOTHING
    sentences: Sequence[str] = ()


def next_flight(
    trajectory: Trajectory, polar: Polar, condition: Condition, flown_CL: tuple[float, float], sources: Sources
) -> Advice:
    """Suggest what to fly next; nothing if the error is already negligible. sources: as in `missing_information`."""
    missing = missing_information(trajectory, polar, condition, flown_CL, sources)
    if missing is None or missing.percent < 100 * NORMAL_95 * EVIDENCE.negligible:
        return Advice()
    remedy = REMEDIES[missing.cause]
    cause = f"{remedy.share} ({remedy.part})" if remedy.part else remedy.share
    sentences = [
        f"{remedy.when}: {remedy.sentence}. The interval is widest at {missing.speed_mps:.1f} m/s,"
        f" ±{missing.percent:.1f} %, the largest part of it from {cause}; if that were known twice as well, it would be"
        f" ±{missing.percent_without:.1f} %."
    ]
    if trajectory.gust_mps > GUSTS.dominate_mps and missing.cause in GUSTS_HIDE:
        sentences.append("A calmer day gives the same in less time.")
    return Advice(missing.cause, sentences)


def _effects_W(trajectory: Trajectory, A: Array, condition: Condition, V: float) -> tuple[Array, list[int]]:
    """Return the change of power [W] per unit of each of MATTERS, and their indices among the sensor errors."""
    blocks = trajectory.block_means
    flown = blocks.flying & np.isfinite(blocks["alpha_rad"])
    CL = 2 * condition.weight_N / (condition.rho * blocks["V_mps"][flown] ** 2 * condition.wing_area_m2)
    level_CL = 2 * condition.weight_N / (condition.rho * V**2 * condition.wing_area_m2)
    alpha = float(np.polyval(np.polyfit(CL, blocks["alpha_rad"][flown], 1), level_CL)) - trajectory.value("alpha_bias")
    step = 0.01 * V
    drag = [float(power_required([v], Polar(A, np.zeros((3, 3))), condition)[0][0]) / v for v in (V - step, V + step)]
    lift_W = condition.weight_N * V
    effects = {
        "alpha_bias": lift_W,
        "alpha_scale": lift_W * alpha,
        "V_scale": -(V**2) * (drag[1] - drag[0]) / (2 * step) - 2 * lift_W * alpha,
    }
    return np.array([effects[name] for name in MATTERS]), [SENSOR_ERRORS.index(name) for name in MATTERS]
