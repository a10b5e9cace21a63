"""In a steady motion, a climbing circle with and without GPS, the first trajectory is the motion itself."""

from typing import Any

import numpy as np
import pytest

from flightpower.analysis.air.transducers import play
from flightpower.analysis.trajectory.block_means import moving_average
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS, STATES
from flightpower.analysis.trajectory.priors import (
    initial_sensor_errors,
    initial_state_sigma,
    initial_states,
    mean_wind,
    stated_sigma,
)
from flightpower.flight.aircraft import Uncertainty

STEP_S, N = 0.2, 300
V, CLIMB, ALPHA, BANK, TURN = 15.0, 1.5, 0.06, 0.3, 0.2  # m/s, m/s, rad, rad, rad/s
T_S = 50.0 + STEP_S * np.arange(N)
HEADING = 0.4 + TURN * STEP_S * (np.arange(N) + 1)


class Blocks(dict):
    """The block means that the first trajectory needs."""

    def __init__(self, flying: np.ndarray, speed_scale: float = 1.0, **columns: Any):
        super().__init__({name: np.broadcast_to(np.asarray(x, dtype=float), N) for name, x in columns.items()})
        self.n, self.t_s, self.flying, self.speed_scale = N, T_S, flying, speed_scale


FLYING = np.ones(N, dtype=bool)
PRIOR = np.full(2, 8.0)  # m/s


def circling(flying: np.ndarray = FLYING, ground_mps: float = V, scale: float = 1.0, gps: bool = True) -> Blocks:
    north, east = ground_mps * np.cos(HEADING), ground_mps * np.sin(HEADING)
    return Blocks(
        flying, scale, height_m=100 + CLIMB * (T_S - T_S[0]), alpha_rad=ALPHA, r_radps=TURN * np.cos(BANK),
        gps_north_mps=north if gps else np.nan, gps_east_mps=east if gps else np.nan,
    )  # fmt: skip


def states(blocks: Blocks, field: Any = None, airspeed_mps: Any = V) -> dict[str, np.ndarray]:
    """Return the states by name, without the ends, where averages are over fewer blocks."""
    V_reference = np.broadcast_to(np.asarray(airspeed_mps, dtype=float), N)
    x = initial_states(blocks, np.full(N, BANK), V_reference, field)  # type: ignore[arg-type]
    return dict(zip(STATES, x[10:-10].T, strict=True))


def ground_speed(blocks: Blocks) -> np.ndarray:
    """Return the ground speed of the first trajectory (n,), which is the airspeed without wind."""
    return np.asarray(np.hypot(*(moving_average(blocks[f"gps_{axis}_mps"], 3) for axis in ("north", "east"))))


INSIDE = slice(10, -10)


def test_attitude_is_angle_of_attack_and_climb_and_the_heading_the_ground_track() -> None:
    result = states(circling())
    assert result["phi"] == pytest.approx(np.full(N - 20, BANK))
    assert result["theta"] == pytest.approx(np.full(N - 20, ALPHA + np.arcsin(CLIMB / V)))
    still = states(circling(), airspeed_mps=ground_speed(circling()))
    assert np.unwrap(still["psi"]) == pytest.approx(HEADING[INSIDE], abs=1e-9)
    assert result["v_down"] == pytest.approx(np.full(N - 20, -CLIMB))
    assert result["height"] == pytest.approx((100 + CLIMB * (T_S - T_S[0]))[INSIDE])
    # Velocity turns by 0.04 rad from block to block and is averaged over three blocks.
    shrunk = V * (1 + 2 * np.cos(TURN * STEP_S)) / 3
    assert result["v_north"] == pytest.approx(shrunk * np.cos(HEADING)[INSIDE], abs=1e-9)
    assert result["v_east"] == pytest.approx(shrunk * np.sin(HEADING)[INSIDE], abs=1e-9)


@pytest.mark.parametrize("wind", [(0.0, 0.0), (-4.0, 9.0), (-12.0, 12.0)])
def test_the_ground_speed_tells_the_wind_also_one_faster_than_the_aircraft(wind: tuple[float, float]) -> None:
    """An airspeed that reads 5 % high, 0.75 m/s, moves the wind by less than 0.1 m/s."""
    air = V * np.column_stack([np.cos(HEADING), np.sin(HEADING)])
    for scale in (1.0, 1.05):
        assert mean_wind(air + wind, np.full(N, scale * V), PRIOR) == pytest.approx(np.array(wind), abs=0.1)
    blocks = circling()
    for i, axis in enumerate(("gps_north_mps", "gps_east_mps")):
        blocks[axis] = blocks[axis] + wind[i]
    result = states(blocks)
    # The true wind does not change over the 90 m of climb; in the first trajectory, it changes by 6 %.
    assert np.unwrap(result["psi"]) == pytest.approx(HEADING[INSIDE], abs=0.06 * np.hypot(*wind) / V + 1e-5)
    assert (result["wind_north"].mean(), result["wind_east"].mean()) == pytest.approx(wind, abs=0.1)
    assert np.ptp(result["wind_east"]) == pytest.approx(abs(wind[1]) * 0.07, rel=0.2, abs=1e-3), "grows with height"


def test_one_heading_tells_no_wind_across_it_and_a_flight_without_air_data_none() -> None:
    """Changes of speed show 3 m/s of headwind, but hardly in gusts of 1 m/s, so the result is between that and zero."""
    rng = np.random.default_rng(0)
    speed, gust, drift = rng.normal(15.0, 1.0, N), rng.normal(0.0, 1.0, N), rng.normal(0.0, 0.3, N)
    along, across = mean_wind(np.column_stack([speed - 3.0, drift]), speed + gust, PRIOR)
    assert -3.0 < along < 0.0 and abs(across) < 0.5
    assert mean_wind(np.empty((0, 2)), np.empty(0), PRIOR).tolist() == [0.0, 0.0]


def test_without_gps_the_heading_is_the_integral_of_the_yaw_rate_and_the_compass_turns_it() -> None:
    class Field:
        def heading_offset(self, heading: np.ndarray, phi: np.ndarray, theta: np.ndarray) -> np.ndarray:
            assert phi[20] == BANK and theta[20] == pytest.approx(ALPHA + np.arcsin(CLIMB / V))
            return np.full(N, 0.4)

    drifting, turned = states(circling(gps=False)), states(circling(gps=False), Field())
    assert drifting["psi"] == pytest.approx(HEADING[INSIDE] - 0.4) and turned["psi"] == pytest.approx(HEADING[INSIDE])
    assert turned["v_north"] == pytest.approx(V * np.cos(HEADING[INSIDE]))
    assert turned["v_east"] == pytest.approx(V * np.sin(HEADING[INSIDE]))


def test_on_the_ground_the_aircraft_is_level_and_stands() -> None:
    parked = np.arange(N) < 100
    result = states(circling(~parked, gps=False))
    before = slice(0, 80)
    for name in ("phi", "theta", "v_north", "v_east"):
        assert np.abs(result[name][before]).max() == 0.0
    assert result["theta"][120] == pytest.approx(ALPHA + np.arcsin(CLIMB / V))


@pytest.mark.parametrize(("ground_mps", "scale", "tracked"), [(5.2, 1.0, True), (4.8, 1.0, False), (2.6, 0.5, True),
                                                              (2.4, 0.5, False)])  # fmt: skip
def test_a_ground_track_is_a_heading_from_5_meters_a_second_on(ground_mps: float, scale: float, tracked: bool) -> None:
    """The limit goes with the speed scale. Below it, heading is the integral; an offset needs a fast block at least."""
    blocks = circling(ground_mps=ground_mps, scale=scale)
    result = states(blocks, airspeed_mps=ground_speed(blocks))
    offset = 0.0 if tracked else -0.4
    assert result["psi"] == pytest.approx(HEADING[INSIDE] + offset, abs=1e-6)


def test_a_few_fast_blocks_give_the_integrated_heading_its_offset() -> None:
    """Up to thirty blocks give an offset; more are a track, outside which the heading is held constant."""
    for fast, tracked in ((30, False), (31, True)):
        blocks = circling()
        # The mean over three blocks makes two more blocks fast.
        slow = (np.arange(N) < 151) | (np.arange(N) >= 149 + fast)
        for axis in ("gps_north_mps", "gps_east_mps"):
            blocks[axis] = np.where(slow, 0.01 * blocks[axis], blocks[axis])
        speed = np.hypot(*(np.convolve(blocks[a], np.ones(3) / 3, "same") for a in ("gps_north_mps", "gps_east_mps")))
        assert (speed > 5.0).sum() == fast
        psi = states(blocks, airspeed_mps=np.maximum(speed, 0.1))["psi"]
        if tracked:
            assert np.ptp(psi[:100]) == 0.0
        else:
            assert psi == pytest.approx(HEADING[INSIDE], abs=0.02)


def test_the_compass_offset_is_the_mean_direction_in_flight() -> None:
    """Directions are averaged, not numbers, since 3.1 and -3.1 rad are near each other."""

    class Field:
        def heading_offset(self, heading: np.ndarray, phi: np.ndarray, theta: np.ndarray) -> np.ndarray:
            return np.where(FLYING_HALF, np.where(np.arange(N) % 2, 3.1, -3.1), 0.5)

    prior = np.linspace(0.1, 0.2, len(SENSOR_ERRORS))
    x = np.zeros((N, len(STATES)))
    errors = initial_sensor_errors(prior, circling(FLYING_HALF), x, Field())  # type: ignore[arg-type]
    i = SENSOR_ERRORS.index("heading_bias")
    assert abs(errors[i]) == pytest.approx(np.pi, abs=1e-6)
    assert np.delete(errors, i) == pytest.approx(np.delete(prior, i))
    assert initial_sensor_errors(prior, circling(), x, None) == pytest.approx(prior)  # type: ignore[arg-type]


FLYING_HALF = np.arange(N) >= 100


@pytest.mark.parametrize(
    ("heading_measured", "at_rest", "heading_rad", "velocity_mps"),
    [(True, True, 3.0, 0.3), (True, False, 3.0, 10.0), (False, True, 0.01, 0.3)],
)
def test_the_initial_state_is_known_only_where_it_defines_north_or_the_aircraft_stands(
    heading_measured: bool, at_rest: bool, heading_rad: float, velocity_mps: float
) -> None:
    """Attitude may be any; height is known to 3 m, wind to 8 m/s, gusts to their standard deviation or 1 cm/s."""
    for gust_mps, expected_sigma in ((0.4, 0.4), (0.001, 0.01)):
        sigma = initial_state_sigma(gust_mps, heading_measured=heading_measured, at_rest=at_rest)
        result = dict(zip(STATES, sigma, strict=True))
        assert (result.pop("phi"), result.pop("theta"), result.pop("psi")) == (1.0, 0.5, heading_rad)
        assert [result.pop(f"v_{axis}") for axis in ("north", "east", "down")] == [velocity_mps] * 3
        assert result.pop("height") == 3.0 and [result.pop(f"wind_{axis}") for axis in ("north", "east")] == [8.0] * 2
        assert list(result.values()) == [expected_sigma] * 5


def test_sensor_errors_that_no_file_states_have_their_priors() -> None:
    """They are those of gyros about their zeros at rest, of mounted sideslip and compass, and of the GPS latency."""
    sigma = stated_sigma(Uncertainty())
    assert [sigma[f"{axis}_bias"] for axis in "pqr"] == [0.002] * 3
    assert (sigma["beta_bias"], sigma["heading_bias"]) == pytest.approx((np.radians(1), np.radians(10)))
    assert sigma["gps_latency"] == 0.2


def test_hysteresis_that_is_stated_may_look_like_a_lag_as_long_as_it_does_in_runs() -> None:
    t = np.arange(0.0, 200.0, 0.04)
    pressure = np.abs((t / 20.0 + 1) % 2 - 1)  # up in a run of 20 s and down in the next
    rate = np.gradient(pressure, t)
    late_s = float(rate @ (pressure - play(pressure, 0.01)) / (rate @ rate))
    usual_s = Uncertainty().air_data_lag_s
    assert stated_sigma(Uncertainty())["air_data_lag"] == usual_s
    stated_s = stated_sigma(Uncertainty(hysteresis_fraction=0.01))["air_data_lag"]
    assert stated_s == pytest.approx(np.hypot(usual_s, late_s), rel=0.05) and stated_s > 5 * usual_s
