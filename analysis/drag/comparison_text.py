"""A disagreement of two methods in sentences."""

from collections.abc import Mapping

import numpy as np

from analysis.drag.forces import J_REFERENCE
from analysis.drag.polar import Condition
from analysis.drag.sensor_errors import UNEXPLAINED, ErrorEstimate
from analysis.estimation.intervals import NORMAL_95


def sentences(
    titles: tuple[str, str],
    V: float,
    power_W: float,
    difference_W: float,
    cause: str,
    share_W: float | None,
    unexplained_W: float,
    errors: Mapping[str, ErrorEstimate],
    condition: Condition,
) -> str:
    """The difference of the second method from the first at speed V [m/s], its cause, and what that explains of it.

    power_W : by the first method        share_W : of the cause; None where its errors were not estimated
    """
    first, second = titles
    size, where = abs(difference_W), "above" if difference_W > 0 else "below"
    difference = (
        f"{second[0].upper()}{second[1:]}: {100 * size / power_W:.0f} % ({size:.1f} W) {where} {first} at {V:.1f} m/s."
    )
    if cause == UNEXPLAINED:
        return f"{difference} No estimated error of the sensors or the propeller table explains it."
    if share_W is None:
        # Of the pairs compared only dynamic and energy have a cause by exclusion. A pitch attitude that is too high
        # tilts lift into drag for the dynamic method: its power is higher by W V tilt.
        tilt = np.degrees(-unexplained_W / (condition.weight_N * V))
        return (
            f"{difference} Errors of airspeed, lag and thrust do not explain it: the trajectory's pitch attitude is"
            f" {abs(tilt):.2f} deg too {'high' if tilt > 0 else 'low'}."
        )
    return (
        f"{difference} {_error_sentence(cause, errors)} This explains {abs(share_W):.1f} W of the difference;"
        f" {abs(unexplained_W):.1f} W remain unexplained."
    )


def _error_sentence(cause: str, errors: Mapping[str, ErrorEstimate]) -> str:
    """The estimated errors of a cause."""
    if cause == "angle of attack":
        bias, scale = errors["alpha_bias"], errors["alpha_scale"]
        sentence = f"The measured angle of attack is {_degrees(bias)} relative to the IMU axes"
        if abs(scale.value) > 2 * scale.standard_error:
            sentence += f", and its slope is {_percent(scale, 'too high', 'too low')}"
        return f"{sentence}."
    if cause == "pitch attitude":
        return f"An accelerometer bias makes the pitch attitude that it levels {_degrees(errors['pitch'])}."
    if cause == "airspeed":
        return f"The measured airspeed is {_percent(errors['airspeed_scale'], 'too high', 'too low')}."
    if cause == "air-data lag":
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
