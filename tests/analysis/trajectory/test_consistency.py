"""Tests consistency, time shifts and airspeed calibration with trajectories that are known exactly."""

import numpy as np
import pandas as pd
import pytest
from exact_motion import exact_motion

from flightpower.analysis.trajectory.consistency import (
    ANGLES,
    SPEED,
    Consistency,
    TimeShift,
    _moving_average,
    calibrate,
    consistency,
    consistency_checks,
    time_shift_notes,
    time_shifts,
)
from flightpower.analysis.trajectory.equations import (
    MEASUREMENT_INPUTS,
    MEASUREMENTS,
    PREDICTED_FLOW,
    SENSOR_ERRORS,
    STATES,
    NamedArrays,
    measurement_model,
)
from flightpower.analysis.trajectory.observability import (
    FlightExcitation,
    MissingExcitation,
    excitation,
    gust_notes,
    heading_notes,
    missing,
)
from flightpower.analysis.trajectory.priors import PRIOR_SIGMA
from flightpower.analysis.trajectory.problem import TrajectoryProblem
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.analysis.trajectory.smoother import StatesGivenErrors
from flightpower.flight.errors import InputError

ERRORS = {"alpha_bias": 0.02, "alpha_scale": 0.05, "beta_bias": -0.02, "V_scale": 0.03, "air_data_lag": 0.1,
          "gps_latency": 0.3}  # fmt: skip


def trajectory_of(table: pd.DataFrame, states: np.ndarray, errors: dict[str, float], sigma=0.1, **other) -> Trajectory:
    """Return a trajectory with these states, and with these sensor errors known to `sigma` of their priors."""
    problem = TrajectoryProblem(table, [slice(0, 0)])
    values = np.array([errors.get(name, 0.0) for name in SENSOR_ERRORS])
    inputs, _ = problem.regressors.measurement_inputs(states, values, 0.1)
    prior = np.array([PRIOR_SIGMA[name] for name in SENSOR_ERRORS])
    n, nx, m = *states.shape, len(SENSOR_ERRORS)
    named = {
        "states": pd.DataFrame(states, pd.Index(problem.blocks.t_s, name="t_s"), list(STATES)),
        "sensor_errors": values,
        "covariance": np.diag((sigma * prior) ** 2),
        "prior_sigma": prior,
        "state_sensitivity": np.zeros((n, nx, m)),
        "states_given_errors": StatesGivenErrors(np.full((1, n * nx), 1e16)),
        "draws": np.zeros((16, n, nx)),
        "predicted_flow": inputs[:, [MEASUREMENT_INPUTS.index(name) for name in PREDICTED_FLOW]],
        "gust_mps": 0.1,
        "residuals": {"gps_north": 1.0},
        "converged": True,
        "block_means": problem.blocks,
    }
    return Trajectory(**named | other)


@pytest.fixture(scope="module")
def exact():
    return exact_motion()


def test_what_the_measurement_model_adds_is_taken_out(exact) -> None:
    """For a flight in gusts with all sensor errors, differences after correction are those of perfect sensors in calm
    air. Before correction, airspeed is off by its scale error."""
    states = exact.states.copy()
    rng = np.random.default_rng(0)
    for gust in ("gust_u", "gust_v", "gust_w"):
        states[:, STATES.index(gust)] = np.convolve(rng.normal(0, 0.5, len(states) + 20), np.ones(21) / 21, "valid")
    perfect = trajectory_of(exact.table, exact.states, {})
    corrected = trajectory_of(exact.table, states, ERRORS)
    inputs = np.zeros((len(states), len(MEASUREMENT_INPUTS)))
    for name, column in zip(PREDICTED_FLOW, corrected.predicted_flow.T, strict=True):
        inputs[:, MEASUREMENT_INPUTS.index(name)] = column
    inputs[:, MEASUREMENT_INPUTS.index("V_mean")] = corrected.predicted_flow[:, PREDICTED_FLOW.index("V_predicted")]
    alpha = corrected.predicted_flow[:, PREDICTED_FLOW.index("alpha_predicted")]  # no upwash, no rotation
    inputs[:, MEASUREMENT_INPUTS.index("alpha_by_slope")] = alpha
    inputs[:, MEASUREMENT_INPUTS.index("alpha_by_V_scale")] = -2 * alpha
    without_lags = ERRORS | {"air_data_lag": 0.0, "gps_latency": 0.0}
    shown = measurement_model(
        NamedArrays(STATES, states.T),
        NamedArrays(SENSOR_ERRORS, [without_lags.get(name, 0.0) for name in SENSOR_ERRORS]),
        NamedArrays(MEASUREMENT_INPUTS, inputs.T),
    )
    t = perfect.block_means.t_s
    measured = dict(zip(MEASUREMENTS, np.broadcast_arrays(*shown), strict=True))
    columns = {"V": ("V_mps", 0.1), "alpha": ("alpha_rad", 0.1), "beta": ("beta_rad", 0.1),
               "gps_north": ("gps_north_mps", 0.3), "gps_east": ("gps_east_mps", 0.3)}  # fmt: skip
    for name, (column, lag) in columns.items():
        corrected.block_means.means[column] = np.interp(t - lag, t, measured[name])
    calm, (before, after) = consistency(perfect).before, consistency(corrected)
    inside = slice(30, -30)
    off = (after - calm).iloc[inside].dropna()
    assert len(off) > 30, "wings must be level for some of the time"
    assert np.degrees(off[ANGLES].abs().max()) < 0.25 and off[SPEED].abs().max() < 0.1
    was = (before - calm).iloc[inside].dropna()
    assert np.degrees(was[ANGLES].abs().mean()) > 0.7
    assert was[SPEED].mean() == pytest.approx(0.03 * 15.0, abs=0.1)


@pytest.mark.parametrize(("bias", "gust"), [(0.1, 0.0), (-0.1, 0.0), (0.0, 1.5), (0.0, -1.5)])
def test_bias_and_gust_are_taken_out_of_sideslip(exact, bias: float, gust: float) -> None:
    """At 9 deg of bank, a sideslip 0.1 rad too large turns the climb angle by 0.1 sin(9 deg), 0.9 deg.

    A gust to the right comes from the left, so sideslip is smaller by gust over airspeed.
    """
    states = exact.states.copy()
    states[:, STATES.index("phi")] = np.radians(9.0)
    calm = consistency(trajectory_of(exact.table, states, {})).before[ANGLES]
    states[:, STATES.index("gust_v")] = gust
    sensed = trajectory_of(exact.table, states, {"beta_bias": bias})
    V = sensed.predicted_flow[:, PREDICTED_FLOW.index("V_predicted")]
    sensed.block_means.means["beta_rad"] = sensed.block_means["beta_rad"] + bias - gust / V
    before, after = consistency(sensed)
    assert np.degrees((before[ANGLES] - calm).abs().mean()) > 0.7
    assert after[ANGLES].dropna().to_numpy() == pytest.approx(calm.dropna().to_numpy(), abs=1e-5)


@pytest.mark.parametrize(
    ("gust_u", "gust_w", "bias", "scale"), [(5.0, 0, 0, 0), (-5.0, 0, 0, 0), (0, 1.5, 0, 0), (0, -1.5, 0, 0),
                                            (0, 0, 0.03, 0), (0, 0, 0, 0.4)]
)  # fmt: skip
def test_bias_slope_and_gust_are_taken_out_of_alpha_and_airspeed(exact, gust_u, gust_w, bias, scale) -> None:
    """Air that moves forward reduces the airspeed; sinking air reduces both airspeed and angle of attack.

    Both components are in body axes, so a gust from ahead (air moving aft) lowers the angle.
    """
    calm = consistency(trajectory_of(exact.table, exact.states, {})).before
    states = exact.states.copy()
    states[:, STATES.index("gust_u")], states[:, STATES.index("gust_w")] = gust_u, gust_w
    sensed = trajectory_of(exact.table, states, {"alpha_bias": bias, "alpha_scale": scale})
    V, alpha, variance, dlnV = (sensed.predicted_flow[:, PREDICTED_FLOW.index(name)] for name in PREDICTED_FLOW)
    means = sensed.block_means.means
    turned = (gust_u * np.sin(alpha) - gust_w * np.cos(alpha)) / V
    means["alpha_rad"] = means["alpha_rad"] + turned + bias + scale * alpha
    slower = gust_u * np.cos(alpha) + gust_w * np.sin(alpha) + variance / (2 * V)
    means["V_mps"] = means["V_mps"] - slower + dlnV * scale * V
    _, after = consistency(sensed)
    for column, error in ((ANGLES, 2e-3), (SPEED, 1e-6)):
        assert after[column].dropna().to_numpy() == pytest.approx(calm[column].dropna().to_numpy(), abs=error)


def test_perfect_sensors_agree(exact) -> None:
    """Airspeeds agree. Angles are not compared here, since climb angles in a turn are means over three seconds."""
    before, after = consistency(trajectory_of(exact.table, exact.states, {}))
    assert before[SPEED].abs().max() < 0.02 and after[SPEED].abs().max() < 0.02


def test_excitation_of_a_circle_and_of_a_straight_flight(exact) -> None:
    circle = excitation(trajectory_of(exact.table, exact.states, {}))
    assert circle.gps and circle.sideslip and circle.mean_heading_vector < 0.3
    straight = exact.states.copy()
    straight[:, STATES.index("psi")] = 3.1 * np.sign(np.sin(np.arange(len(straight))))  # either side of south
    blind = exact.table.assign(gps_north_mps=np.nan, gps_east_mps=np.nan, gps_down_mps=np.nan, beta_rad=np.nan)
    blind["V_mps"] = np.linspace(10.0, 20.0, len(blind))
    one_way = excitation(trajectory_of(blind, straight, {}))
    assert not one_way.gps and not one_way.sideslip and one_way.mean_heading_vector > 0.99
    assert one_way.speed_ratio == pytest.approx(19.5 / 10.5, rel=0.01)


def test_a_time_shift_is_significant_beyond_three_standard_errors_and_four_milliseconds() -> None:
    assert TimeShift("air_data_lag", 0.0061, 0.002, True).significant
    assert not TimeShift("air_data_lag", 0.0059, 0.002, True).significant
    assert not TimeShift("air_data_lag", -0.0039, 0.0001, True).significant
    assert TimeShift("air_data_lag", -0.0041, 0.0001, True).in_words() == "The probe is 4 ± 0 ms early against the IMU."
    assert "does not show how late GPS is" in TimeShift("gps_latency", 0.1, 0.001, False).in_words()


def test_a_late_probe_is_noted_and_late_gps_is_not(exact) -> None:
    late = trajectory_of(exact.table, exact.states, {"air_data_lag": 0.03, "gps_latency": 0.2})
    (note,) = time_shift_notes(late)
    assert note.startswith("The probe is 30 ± 1 ms late against the IMU.")
    undetermined = trajectory_of(exact.table, exact.states, {"air_data_lag": 0.03}, sigma=0.81)
    assert time_shift_notes(undetermined) == [] and not any(s.determined for s in time_shifts(undetermined))
    assert all(s.determined for s in time_shifts(trajectory_of(exact.table, exact.states, {}, sigma=0.79)))


def test_an_airspeed_scale_that_the_flight_hardly_determines_is_said_to_be(exact) -> None:
    """That is a standard error above 0.8 of the one assumed before the flight."""
    sure, unsure = (calibrate(exact.table, trajectory_of(exact.table, exact.states, {}, s)) for s in (0.79, 0.81))
    assert sure.notes == []
    (note,) = unsure.notes
    assert "hardly determines the scale" in note
    assert sure.wind_mps == pytest.approx(np.hypot(2.0, 1.0))
    assert sure.wind_from_deg == pytest.approx(np.degrees(np.arctan2(1.0, -2.0)) % 360), "wind toward north-north-west"
    one_way = exact.states.copy()
    one_way[:, STATES.index("psi")] = 0.5
    (note,) = calibrate(exact.table, trajectory_of(exact.table, one_way, {})).notes
    assert "one direction" in note


def test_the_standard_error_of_a_state_has_a_random_and_a_systematic_part(exact) -> None:
    n, nx, m = *exact.states.shape, len(SENSOR_ERRORS)
    sensitivity = np.zeros((n, nx, m))
    sensitivity[:, 1, SENSOR_ERRORS.index("ax_bias")] = 2.0
    draws = np.random.default_rng(0).normal(0, 0.3, (100, n, nx))
    error = trajectory_of(exact.table, exact.states, {}, 0.5, draws=draws, state_sensitivity=sensitivity).states_error()
    assert error["phi"].mean() == pytest.approx(0.3, rel=0.01)
    assert error["theta"].mean() == pytest.approx(np.hypot(0.3, 2 * 0.5 * 0.19), rel=0.01)


@pytest.mark.parametrize("bank_deg", [0.0, 11.0, 13.0])
def test_angles_are_compared_with_wings_nearly_level_only(exact, bank_deg: float) -> None:
    states = exact.states.copy()
    states[:, STATES.index("phi")] = np.radians(bank_deg)
    compared = consistency(trajectory_of(exact.table, states, {})).before[ANGLES].notna().any()
    assert compared == (bank_deg < 12.0)


def test_a_climb_counts_in_the_airspeed_from_gps(exact) -> None:
    """At 3 m/s down and 15 m/s over ground, the airspeed from GPS is the length of all three components."""
    states = exact.states.copy()
    states[:, STATES.index("v_down")] = 3.0
    flat, steep = (consistency(trajectory_of(exact.table, x, {})).before[SPEED] for x in (exact.states, states))
    V = exact_airspeed_without_climb(exact)
    assert (flat - steep).mean() == pytest.approx(np.mean(np.hypot(V, 3.0) - V), abs=0.05)


def exact_airspeed_without_climb(exact) -> np.ndarray:
    north, east = (
        exact.states[:, STATES.index(f"v_{a}")] - exact.states[:, STATES.index(f"wind_{a}")] for a in ("north", "east")
    )
    return np.hypot(north, east)


def test_reasons_begin_where_a_flight_lacks_excitation() -> None:
    """The reasons are headings within a quarter circle, a speed ratio below 1.25, and gusts above 0.1 m/s."""
    enough = FlightExcitation(gps=True, sideslip=True, mean_heading_vector=0.65, speed_ratio=1.3, gust_mps=0.09)
    cases = {
        "mean_heading_vector": (0.75, MissingExcitation.HEADINGS),
        "speed_ratio": (1.2, MissingExcitation.SPEEDS),
        "gust_mps": (0.11, MissingExcitation.CALM_AIR),
    }
    assert missing("V_scale", enough) == (MissingExcitation.DURATION,)
    for name, (value, reason) in cases.items():
        assert missing("V_scale", enough._replace(**{name: value})) == (reason,)


@pytest.mark.parametrize(
    ("residual", "offset_deg", "contradicts"), [(1.9, 29, False), (2.1, 0, True), (1.0, -31, True)]
)
def test_a_compass_contradicts_beyond_twice_its_error_or_thirty_degrees(
    exact, residual, offset_deg, contradicts
) -> None:
    errors = {"heading_bias": np.radians(offset_deg)}
    notes = heading_notes(
        trajectory_of(exact.table, exact.states, errors, residuals={"gps_north": 1.0, "compass": residual}),
        calibrated=True,
    )
    assert bool(notes) == contradicts and all("contradicts GPS" in note for note in notes)


@pytest.mark.filterwarnings("ignore:Mean of empty slice", "ignore:invalid value")
def test_an_aircraft_that_never_flew_has_one_heading_and_one_speed(exact) -> None:
    still = exact.table.assign(flying=False)
    assert calibrate(still, trajectory_of(exact.table, exact.states, {})).one_way == 1.0
    parked = excitation(trajectory_of(exact.table.assign(height_m=0.0), exact.states, {}))
    assert (parked.mean_heading_vector, parked.speed_ratio) == (1.0, 1.0)


@pytest.mark.parametrize(("error_deg", "gust_mps", "expected"), [(0.31, 0.31, True), (0.29, 0.31, False),
                                                             (0.31, 0.29, False), (0.55, 0.5, True)])  # fmt: skip
def test_gusts_are_said_to_limit_the_angle_of_attack_from_0_3_deg_in_0_3_mps(
    exact, error_deg, gust_mps, expected
) -> None:
    """For a single run this is an error, since a degree is 20 % of power near the stall."""
    prior_share = np.radians(error_deg) / PRIOR_SIGMA["alpha_bias"]
    trajectory = trajectory_of(exact.table, exact.states, {}, prior_share, gust_mps=gust_mps)
    assert bool(gust_notes(trajectory, 4, "log")) == expected
    if expected:
        with pytest.raises(InputError, match=f"gusts of {gust_mps:.1f} m/s .* uncertain by {error_deg:.1f} deg"):
            gust_notes(trajectory, 1, "log")


def test_results_tell_differences_in_degrees_and_meters_a_second(exact) -> None:
    trajectory = trajectory_of(exact.table, exact.states, {})
    t = trajectory.block_means.t_s
    before = pd.DataFrame({ANGLES: np.radians(2.0) + 0 * t, SPEED: 0.5 + 0 * t}, index=t)
    angles, speed = consistency_checks(Consistency(before, before / 2))
    assert (angles.before.unit, speed.before.unit) == ("deg", "m/s")
    assert (angles.before.mean, angles.after.mean) == pytest.approx((2.0, 1.0))
    assert (speed.before.mean, speed.after.mean) == pytest.approx((0.5, 0.25))


def test_means_over_seconds_do_not_depend_on_when_the_log_begins() -> None:
    t_s, values = np.arange(0, 60, 0.25), np.random.default_rng(0).normal(0, 1, 240)
    mean, later = (_moving_average(values, t_s + begin_s) for begin_s in (0.0, 1000.0))
    np.testing.assert_array_equal(mean, later)
    assert np.nanstd(mean) == pytest.approx(1 / np.sqrt(13), rel=0.4)  # 13 values in 3 s
