"""Effects of a transducer's hysteresis, and of a step of its zero, on air data."""

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.air.transducers import play, with_hysteresis, with_zero_step
from flightpower.sim.sensors.tray import with_hysteresis as of_the_simulator


def up_and_down() -> pd.DataFrame:
    """Airspeed 12 to 24 and back to 12 m/s; angle of attack falls and rises with it."""
    t = np.arange(0, 40, 0.04)
    V = 18 - 6 * np.cos(2 * np.pi * t / 40)
    alpha = np.radians(12.0) * (12 / V) ** 2
    q = 0.6 * V**2
    return pd.DataFrame(
        {"V_mps": V, "alpha_rad": alpha, "qbar_Pa": q, "q_c_Pa": q, "dp_alpha_Pa": 4.5 * q * alpha},
        index=pd.Index(t, name="t_s"),
    )


def test_play_is_that_of_the_simulator() -> None:
    x = np.random.default_rng(0).standard_normal(500).cumsum()
    assert play(x, 0.05 * np.ptp(x)) == pytest.approx(of_the_simulator(x, 0.05))


def test_airspeed_lags_half_the_width_of_the_loop() -> None:
    """Half of 1 % of 259 Pa is 1.3 Pa, an error of V 1.3 / (2 q): too slow while accelerating, too fast while
    decelerating."""
    air = up_and_down()
    other = with_hysteresis(air, "q_c_Pa", 0.01)
    half_Pa = 0.005 * np.ptp(air["q_c_Pa"])
    for row, sign in ((250, -1), (750, 1)):
        expected = sign * air["V_mps"].iloc[row] * half_Pa / (2 * air["q_c_Pa"].iloc[row])
        assert (other["V_mps"] - air["V_mps"]).iloc[row] == pytest.approx(expected, rel=0.02)
        assert (other["alpha_rad"] / air["alpha_rad"] - 1).iloc[row] == pytest.approx(
            -sign * half_Pa / air["q_c_Pa"].iloc[row], rel=0.02
        )


def test_angle_of_attack_lags_by_its_own_transducer() -> None:
    air = up_and_down()
    assert with_hysteresis(air, "dp_alpha_Pa", 0.0)["alpha_rad"].to_numpy() == pytest.approx(
        air["alpha_rad"].to_numpy()
    )
    bent = air.assign(
        dp_alpha_Pa=4.5 * air["q_c_Pa"] * air["alpha_rad"] + 0.5 * air["q_c_Pa"]
    )  # an offset of the probe
    other = with_hysteresis(bent, "dp_alpha_Pa", 0.02)
    half_Pa = 0.01 * np.ptp(bent["dp_alpha_Pa"])
    off = (other["alpha_rad"] - bent["alpha_rad"]).to_numpy() * 4.5 * air["q_c_Pa"].to_numpy()
    assert np.abs(off).max() == pytest.approx(half_Pa, rel=0.02)
    assert np.sign(off[250]) == -np.sign(off[750])
    assert other["V_mps"].equals(bent["V_mps"])


def test_zero_step_changes_sign_in_the_middle_of_the_flight() -> None:
    """A step of 2 Pa is 1 Pa too low before and 1 Pa too high after; V errs by 1/(2 q), angle of attack by 1/q the
    other way."""
    air = up_and_down()
    still = air.assign(V_mps=air["V_mps"].where(air.index > 10))  # at rest for 10 s: flight is from 10 to 40 s
    for row, sign in ((260, -1), (620, -1), (630, 1), (990, 1)):  # the middle is at 25 s
        other, q_c = with_zero_step(still, "q_c_Pa", 2.0), still["q_c_Pa"].iloc[row]
        assert (other["V_mps"] / still["V_mps"] - 1).iloc[row] == pytest.approx(sign / (2 * q_c), rel=0.02)
        assert (other["alpha_rad"] / still["alpha_rad"] - 1).iloc[row] == pytest.approx(-sign / q_c, rel=0.02)
        of_angle = with_zero_step(still, "dp_alpha_Pa", 2.0)
        assert (of_angle["alpha_rad"] - still["alpha_rad"]).iloc[row] == pytest.approx(sign / (4.5 * q_c), rel=0.02)
        assert of_angle["V_mps"].equals(still["V_mps"])
