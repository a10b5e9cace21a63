"""Predicted regressors of sensor errors are right in motions in which they are known."""

import numpy as np
import pytest
from exact_motion import exact_motion
from scipy.interpolate import CubicSpline

from flightpower.analysis.trajectory.block_means import BLOCK, BlockMeans
from flightpower.analysis.trajectory.equations import (
    MEASUREMENT_INPUTS,
    MEASUREMENTS,
    SENSOR_ERRORS,
    STATES,
    NamedArrays,
    measurement_model,
)
from flightpower.analysis.trajectory.priors import initial_states
from flightpower.analysis.trajectory.problem import TrajectoryProblem

INSIDE = slice(20, -20)
NO_ERRORS = np.zeros(len(SENSOR_ERRORS))


@pytest.fixture(scope="module")
def exact():
    return exact_motion()


def straight_flight(exact, V, bank=0.0, wind=(3.0, -2.0), **columns):
    """Return problem and states of level flight to the north in wind, at airspeed V (one value per row)."""
    angle = columns.get("alpha_rad", exact.table["alpha_rad"])
    table = exact.table.assign(V_mps=V, dalpha_dlndp_alpha_rad=angle, **columns)
    problem = TrajectoryProblem(table, [slice(0, 0)])
    values = {"phi": bank, "v_north": problem.blocks["V_mps"] + wind[0], "v_east": wind[1]}
    values |= {"wind_north": wind[0], "wind_east": wind[1]}
    states = np.column_stack([values.get(name, 0.0) + np.zeros(problem.blocks.n) for name in STATES])
    return problem, states


def predicted(problem, states, errors=NO_ERRORS) -> dict[str, np.ndarray]:
    _, inputs = problem.regressors.measurement_inputs(states, errors, 0.1)
    return dict(zip(MEASUREMENT_INPUTS, inputs.T, strict=True))


def test_predicted_airspeed_is_that_of_the_motion_through_the_wind(exact) -> None:
    """In a steady acceleration, a straight line through the past predicts speed and acceleration exactly."""
    t = exact.table.index.to_numpy()
    result = predicted(*straight_flight(exact, 10.0 + 0.2 * t))
    V = (10.0 + 0.2 * t)[BLOCK // 2 :: BLOCK]
    assert result["V_predicted"][INSIDE] == pytest.approx(V[INSIDE], abs=1e-3)
    assert result["V_rate"][INSIDE] == pytest.approx(0.2, abs=1e-3)


def test_the_angle_of_attack_of_level_flight_is_predicted_from_speed_and_its_change(exact) -> None:
    """alpha = a + k/V^2, so alphadot = -2 k Vdot/V^3. Nothing else can predict it: the states have no angle.

    Acceleration is the mean over the last second, half a second late: a phase of 1/8 rad, 2 % of the variance.
    """
    t = exact.table.index.to_numpy()
    V, Vdot = 15.0 + 6.0 * np.sin(0.25 * t), 1.5 * np.cos(0.25 * t)
    alpha, rate = -0.05 + 25.0 / V**2, -50.0 * Vdot / V**3
    result = predicted(*straight_flight(exact, V, alpha_rad=alpha))
    for name, true in (("V_rate", Vdot), ("alpha_by_slope", alpha), ("probe_alpha_rate", rate)):
        at_blocks = true[BLOCK // 2 :: BLOCK]
        share = np.var((result[name] - at_blocks)[INSIDE]) / np.var(at_blocks[INSIDE])
        assert share < 0.04, name


def test_turns_are_flown_at_the_lift_coefficient_of_their_bank(exact) -> None:
    """Bank swings to 60 deg, where lift doubles; alpha and the probe's d ln V/d ln dp are proportional to lift."""
    t = exact.table.index.to_numpy()
    bank, V = np.radians(60.0) * np.sin(0.2 * t), 15.0 + 4.0 * np.sin(0.13 * t)
    lift = (15.0 / V) ** 2 / np.cos(bank)
    problem, states = straight_flight(
        exact, V, bank[BLOCK // 2 :: BLOCK], alpha_rad=0.1 * lift, dlnV_dlndp_alpha=0.05 * lift
    )
    result = predicted(problem, states)
    for name, true in (("alpha_by_slope", 0.1 * lift), ("dlnV_dlndp_alpha", 0.05 * lift)):
        at_blocks = true[BLOCK // 2 :: BLOCK]
        share = np.var((result[name] - at_blocks)[INSIDE]) / np.var(at_blocks[INSIDE])
        assert share < 0.05, name


@pytest.mark.parametrize("fast_blocks", [5, 20])
def test_a_short_ground_track_gives_the_heading_its_offset(exact, fast_blocks: int) -> None:
    """The integral of the yaw rate, 0.1 rad/s, begins at north; a short, fast GPS track shows that heading is 2 rad
    more. With few fast blocks, the first estimate has the right heading all the time; with many, at those blocks."""
    t = exact.table.index.to_numpy()
    heading = 2.0 + 0.1 * t
    start = len(t) // 2 // BLOCK * BLOCK
    speed = np.full(len(t), 0.5)
    speed[start : start + fast_blocks * BLOCK] = 15.0
    gps = {"gps_north_mps": speed * np.cos(heading), "gps_east_mps": speed * np.sin(heading)}
    blocks = BlockMeans(exact.table.assign(r_radps=0.1, **gps))
    psi = initial_states(blocks, np.zeros(blocks.n), speed[BLOCK // 2 :: BLOCK], None)[:, STATES.index("psi")]
    fast = slice(start // BLOCK + 1, start // BLOCK + fast_blocks - 1) if fast_blocks > 10 else slice(None)
    off = psi - heading[BLOCK // 2 :: BLOCK]
    assert (off[fast] + np.pi) % (2 * np.pi) - np.pi == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize(("curvature", "within"), [(0.0, 0.03), (0.9, 0.05)])
@pytest.mark.parametrize(("name", "value"), [("alpha_scale", 0.05), ("V_scale", 0.02), ("air_data_lag", 0.02)])
def test_sensor_errors_act_on_the_angle_of_attack_at_the_probe(exact, name, value, curvature, within) -> None:
    """The ports also measure upwash and rotation, which are subtracted after lag and slope, in proportion to 1/V^2 and
    1/V. With the true states and error, the modeled angle is the measured one. With a curved calibration (at 12 deg, a
    pressure that is 5 % high raises the angle by 4.6 %), this is so to first order in the error."""
    true, t = exact.table, exact.table.index.to_numpy()
    upwash, rotation = 0.02 * (1 - true["az_mps2"] / 10), -0.5 * true["q_radps"] / true["V_mps"]
    at_probe = true["alpha_rad"] + upwash + rotation
    V_scale = value if name == "V_scale" else 0.0
    slope = {"alpha_scale": value, "V_scale": -2 * value}.get(name, 0.0)
    C = at_probe  # the pressure's coefficient: the angle is C - curvature C^3
    for _ in range(20):
        C = at_probe + curvature * C**3
    more = (1 + slope) * C
    spline = CubicSpline(t, at_probe)  # a first-order lag, expanded to second order
    late = value * spline(t, 1) - value**2 * spline(t, 2) if name == "air_data_lag" else 0.0
    upwash, rotation = upwash * (1 - 2 * V_scale), rotation * (1 - V_scale)
    measured = more - curvature * more**3 - late - upwash - rotation
    table = true.assign(
        dalpha_dlndp_alpha_rad=more - 3 * curvature * more**3 - late,
        alpha_rad=measured,
        alpha_by_upwash_rad=upwash,
        alpha_by_rotation_rad=rotation,
    )
    problem = TrajectoryProblem(table, [slice(0, 0)])
    errors = np.where(np.array(SENSOR_ERRORS) == name, value, 0.0)
    actual, _ = problem.regressors.measurement_inputs(exact.states, errors, 0.1)
    named = NamedArrays(MEASUREMENT_INPUTS, actual.T)
    model = measurement_model(NamedArrays(STATES, exact.states.T), NamedArrays(SENSOR_ERRORS, errors), named)
    off = model[MEASUREMENTS.index("alpha")] - problem.blocks["alpha_rad"]
    by_error = (measured - true["alpha_rad"]).to_numpy()[BLOCK // 2 :: BLOCK]
    assert np.std(off[INSIDE]) < within * np.std(by_error[INSIDE])


@pytest.mark.parametrize("climb_mps", [3.0, -3.0])
def test_the_first_trajectory_pitches_up_by_alpha_and_the_climb_and_turns_by_the_yaw_rate(exact, climb_mps) -> None:
    """There is no GPS. In a steady turn with bank phi, yaw rate about the body axis is cos(phi) of the turn rate."""
    t = exact.table.index.to_numpy()
    bank, turn = 0.5, 0.2
    table = exact.table.assign(
        alpha_rad=0.08, height_m=500.0 + climb_mps * t, r_radps=turn * np.cos(bank),
        gps_north_mps=np.nan, gps_east_mps=np.nan, gps_down_mps=np.nan,
    )  # fmt: skip
    blocks = BlockMeans(table)
    x = initial_states(blocks, np.full(blocks.n, bank), np.full(blocks.n, 15.0), None)
    named = dict(zip(STATES, x[10:-10].T, strict=True))
    assert named["theta"] == pytest.approx(0.08 + np.arcsin(climb_mps / 15.0))
    assert named["phi"] == pytest.approx(bank) and named["v_down"] == pytest.approx(-climb_mps)
    assert np.gradient(named["psi"], blocks.step_s) == pytest.approx(turn)
    assert named["v_north"] == pytest.approx(15.0 * np.cos(named["psi"]))
    assert named["v_east"] == pytest.approx(15.0 * np.sin(named["psi"]))
    assert named["height"] == pytest.approx(500.0 + climb_mps * blocks.t_s[10:-10])
