"""The text on a disagreement of two methods has the right sizes, signs, and 95 % intervals."""

import numpy as np
import pytest

from flightpower.analysis.curve import Condition
from flightpower.analysis.methods.causes import ErrorEstimate
from flightpower.analysis.methods.comparison import Difference, sentences
from flightpower.analysis.records.flight import Cause

AT = Condition(40.0, 1.2, 0.6)
TITLES = ("the dynamic method", "direct method")


def text_of(
    cause: str, share_W: float | None = 3.0, *, difference_W: float = 5.0, unexplained_W: float = 2.0, **errors
):
    results = {name: ErrorEstimate(*error) for name, error in errors.items()}
    quoted = Difference(15.0, 100.0, difference_W, Cause(cause), share_W, unexplained_W)
    return sentences(TITLES, quoted, results, AT)


def test_the_difference_is_a_share_of_the_first_power_and_its_side_is_named() -> None:
    assert text_of(Cause.UNEXPLAINED).startswith(
        "Direct method: 5 % (5.0 W) above the dynamic method at 15.0 m/s. No estimated"
    )
    assert text_of(Cause.UNEXPLAINED, difference_W=-7.0).startswith(
        "Direct method: 7 % (7.0 W) below the dynamic method at"
    )


@pytest.mark.parametrize(("tilt_deg", "side"), [(0.25, "high"), (-0.25, "low")])
def test_a_cause_by_exclusion_is_a_tilt_that_turns_lift_into_drag(tilt_deg: float, side: str) -> None:
    """A pitch attitude that is too high raises the dynamic method's power by W V tilt, so the other method is lower."""
    unexplained_W = -40.0 * 15.0 * np.radians(tilt_deg)
    text = text_of("pitch attitude", None, unexplained_W=unexplained_W)
    assert text.endswith(f"do not explain it: the trajectory's pitch attitude is 0.25 deg too {side}.")


@pytest.mark.parametrize(
    ("cause", "errors", "text"),
    [
        ("angle of attack", {"alpha_bias": (0.01, 0.001), "alpha_scale": (0.01, 0.0051)},
         "The measured angle of attack is 0.57 ± 0.11 deg too high relative to the IMU axes. This"),
        ("angle of attack", {"alpha_bias": (-0.01, 0.001), "alpha_scale": (0.05, 0.02)},
         "is 0.57 ± 0.11 deg too low relative to the IMU axes, and its slope is 5.0 ± 3.9 % too high. This"),
        ("angle of attack", {"alpha_bias": (0.01, 0.001), "alpha_scale": (-0.05, 0.02)},
         "and its slope is 5.0 ± 3.9 % too low. This"),
        ("pitch attitude", {"pitch": (-0.005, 0.001)},
         "An accelerometer bias makes the pitch attitude 0.29 ± 0.11 deg too low. This"),
        ("airspeed", {"airspeed_scale": (0.03, 0.005)}, "The measured airspeed is 3.0 ± 1.0 % too high. This"),
        ("air-data lag", {"lag": (0.1, 0.02)}, "The air data lag by 0.100 ± 0.039 s. This"),
        ("propeller table", {"thrust_scale": (-0.04, 0.01), "thrust_slope": (0.3, 0.1)},
         "Thrust is 4.0 ± 2.0 % less than the propeller table gives at J = 0.5, changing by +3.0 % per 0.1 of J"),
    ],
)  # fmt: skip
def test_errors_of_a_cause_have_their_sizes_sides_and_intervals(cause: str, errors: dict, text: str) -> None:
    result = text_of(cause, -3.0, unexplained_W=-2.0, **errors)
    assert text in result
    assert result.endswith("This explains 3.0 W of the difference; 2.0 W remain unexplained.")
