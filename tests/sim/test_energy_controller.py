"""The autopilot's control of total energy: it holds what it should, and answers the gusts that its airspeed feels."""

import dataclasses
from functools import lru_cache
from itertools import repeat

import numpy as np
import pandas as pd
import pytest

from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.sim.energy_controller import Cruise, EnergyController
from flightpower.sim.fly import fly
from flightpower.sim.integration import Observation
from flightpower.sim.plan import load_plan

LEVEL = Observation(
    V=15.0, alpha=0.05, beta=0.0, height=80.0, climb=0.0, phi=0.0, theta=0.05, psi=0.0, p=0.0, q=0.0, r=0.0,
    load_factor=1.0, forward_mps2=9.80665 * np.sin(0.05),
)  # fmt: skip
CRUISE = Cruise(0.05, 0.5, 10.0, 25.0)
DT = 0.02


def settled(*seen: Observation, height_m: float = 80.0, speed_mps: float = 15.0) -> tuple[float, float]:
    """Pitch and throttle after observations that last two seconds each."""
    controller, command = EnergyController(CRUISE, DT), (0.0, 0.0)
    for item in seen:
        for observation in repeat(item, round(2 / DT)):
            command = controller.command(observation, height_m, 0.0, speed_mps)
    return command


def test_level_flight_at_the_wanted_speed_is_the_trim_of_cruise() -> None:
    assert settled(LEVEL, LEVEL) == pytest.approx((0.05, 0.5), abs=1e-6)


def test_height_is_exchanged_for_airspeed_by_pitch_and_both_are_paid_by_throttle() -> None:
    pitch, throttle = settled(LEVEL, LEVEL._replace(V=16.0))
    assert pitch > 0.06 and throttle < 0.49  # fast: nose up, throttle back
    pitch, throttle = settled(LEVEL, LEVEL._replace(height=78.0))
    assert pitch > 0.06 and throttle > 0.51  # low: nose up, more throttle
    # An aircraft that is fast and low by the same energy needs only pitch.
    low_m = (16.0**2 - 15.0**2) / 2 / 9.80665
    both = LEVEL._replace(V=16.0, height=80.0 - low_m)
    _, alone = settled(LEVEL, LEVEL._replace(height=80.0 - low_m))
    pitch, throttle = settled(LEVEL, both)
    assert pitch > 0.07 and abs(throttle - 0.5) < 0.5 * abs(alone - 0.5)


def test_a_gust_is_answered_with_throttle_though_the_accelerometer_feels_nothing() -> None:
    """The filtered airspeed follows the sensor within a second (TECS_SPD_OMEGA 2 rad/s)."""
    controller = EnergyController(CRUISE, DT)
    throttle = []
    for i in range(round(6 / DT)):
        seen = LEVEL._replace(V=15.0 + (1.0 if i >= 3 / DT else 0.0))
        throttle.append(controller.command(seen, 80.0, 0.0, 15.0)[1])
    before, after = throttle[round(3 / DT) - 1], throttle[round(4.5 / DT)]
    assert before == pytest.approx(0.5) and after < 0.47


@lru_cache(maxsize=2)
def laps(turbulence_mps: float) -> pd.DataFrame:
    plan = load_plan("laps")
    air = dataclasses.replace(plan.air, turbulence_mps=turbulence_mps, wind_mps=turbulence_mps)
    few = dataclasses.replace(plan, air=air, segments=plan.segments[:10])
    return fly(load_complete_aircraft("nexstar"), few, seed=5).truth


def test_laps_in_calm_air_are_level_at_the_speed_of_the_plan() -> None:
    truth = laps(0.0)
    held = truth[truth["segment"] == 9]  # the leg after the turn
    end = held.iloc[-100:]
    assert end["V_mps"].std() < 0.1 and abs(end["height_m"] - 80.0).max() < 0.6
    assert end["throttle"].between(0.2, 0.9).all()


def test_throttle_answers_the_energy_that_gusts_give_and_take() -> None:
    """This energy is that of height and of the airspeed that the sensor feels."""
    truth = laps(4.0)
    held = truth[truth["segment"].isin((3, 5, 7, 9))].assign(
        energy=lambda x: 9.81 * x["height_m"] + x["V_mps"] ** 2 / 2
    )
    groups = held.groupby("segment")
    throttle, energy = (held[name] - groups[name].transform("mean") for name in ("throttle", "energy"))
    assert throttle.std() > 0.02
    assert np.corrcoef(throttle, energy)[0, 1] < -0.3
