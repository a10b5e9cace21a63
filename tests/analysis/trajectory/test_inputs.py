"""Tests inputs and weights of the equations: noise, process model, measurements, priors, initial estimate."""

import numpy as np
import pandas as pd
import pytest
from exact_motion import RATE_HZ, RHO, exact_motion

from flightpower.analysis.air.magnetometer import Compass
from flightpower.analysis.sources.table import THRUST_AS_SPEED
from flightpower.analysis.trajectory.block_means import BLOCK, BlockMeans, block_mean
from flightpower.analysis.trajectory.equations import (
    MEASUREMENT_INPUTS,
    MEASUREMENTS,
    PROCESS_INPUTS,
    SENSOR_ERRORS,
    STATES,
)
from flightpower.analysis.trajectory.inertial import CHANNELS, InertialInputs
from flightpower.analysis.trajectory.measurements import LevelField, Measurements
from flightpower.analysis.trajectory.priors import (
    BENCH_SIGMA,
    PRIOR_SIGMA,
    ZEROS,
    SensorPriors,
    begins_at_rest,
    initial_state_sigma,
    noise_at_rest,
    sensor_error_prior,
    stated_sigma,
    zeros_at_rest,
)
from flightpower.analysis.trajectory.problem import TrajectoryProblem, _blocks_at_rest
from flightpower.analysis.trajectory.process import GustConditions, ProcessModel
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.motion import body_from_earth
from flightpower.flight.probe_maps import ALPHA_PORT_SLOPE
from flightpower.flight.propeller_files import load_propeller, parse_propeller

STEP_S = BLOCK / RATE_HZ


@pytest.fixture(scope="module")
def exact():
    return exact_motion()


@pytest.fixture(scope="module")
def problem(exact):
    return TrajectoryProblem(exact.table, [slice(0, 0)])


def test_a_block_mean_needs_more_than_half_of_its_samples() -> None:
    nan = np.nan
    series = pd.Series([1.0, 2, 3, 4, 5, 1, 2, 6, nan, nan, 1, 2, nan, nan, nan, 7])
    assert block_mean(series, 3) == pytest.approx([3.0, 3.0, nan], nan_ok=True)


def test_noise_at_rest_is_measured_where_there_is_rest_and_else_that_of_the_bench() -> None:
    rng = np.random.default_rng(0)
    n = 4000
    table = pd.DataFrame({name: rng.normal(5.0, 3 * sigma, n) for name, sigma in BENCH_SIGMA.items()})
    table.iloc[1000:3000] *= 100.0
    table["q_c_Pa"] = np.where(table.index < 1000, 0.0, 0.1 * table["q_c_Pa"])  # zero, then hardly noisy
    table["dp_alpha_Pa"] = 0.1 + 0.2  # constant until there is airspeed
    noise = noise_at_rest(table, [slice(0, 1000), slice(3000, 4000)])
    assert noise.pop("q_c_Pa") == pytest.approx(0.3 * BENCH_SIGMA["q_c_Pa"], rel=0.1)
    assert noise.pop("dp_alpha_Pa") == BENCH_SIGMA["dp_alpha_Pa"]
    table["q_c_Pa"] *= 1e-3  # mere quantization, or noise of a mean
    assert noise_at_rest(table, [slice(3000, 4000)])["q_c_Pa"] == pytest.approx(0.1 * BENCH_SIGMA["q_c_Pa"])
    for name, sigma in noise.items():
        assert sigma == pytest.approx(3 * BENCH_SIGMA[name], rel=0.07)  # 4 standard errors of 2000 samples
    assert noise_at_rest(table, []) == BENCH_SIGMA


def test_a_resolution_larger_than_the_noise_is_noise_and_a_smaller_one_is_in_it_already() -> None:
    """A reading that stands still between steps of 40 Pa is off by 11.5 Pa, rms."""
    rng = np.random.default_rng(0)
    table = pd.DataFrame({name: rng.normal(5.0, sigma, 2000) for name, sigma in BENCH_SIGMA.items()})
    quiet = noise_at_rest(table, [slice(0, 2000)])
    coarse = noise_at_rest(table, [slice(0, 2000)], {"q_c_Pa": 40.0, "static_Pa": 3.0})
    assert coarse["q_c_Pa"] == pytest.approx(np.hypot(quiet["q_c_Pa"], 40 / np.sqrt(12)))
    assert {name: coarse[name] for name in coarse if name != "q_c_Pa"} == {
        name: quiet[name] for name in quiet if name != "q_c_Pa"
    }


def test_the_error_of_a_zero_falls_with_the_time_at_rest_and_contains_slow_noise() -> None:
    """1,000 logs of 40 s at 25 Hz have white noise of 6 Pa, and noise of 1 Pa that lasts a second."""
    rng, seconds, logs = np.random.default_rng(5), 40, 1000
    slow = np.repeat(rng.standard_normal((logs, seconds)), 25, axis=1)
    zeros = 6.0 * rng.standard_normal((logs, seconds * 25)) + slow
    t = 0.04 * np.arange(seconds * 25)
    estimated = np.empty(100)
    for i, channel in enumerate(zeros[:100]):
        table = pd.DataFrame(dict.fromkeys(BENCH_SIGMA, channel), index=t)
        rest = [slice(0, len(t))]
        result = zeros_at_rest(table, rest, noise_at_rest(table, rest))
        assert set(result) == set(ZEROS)
        estimated[i] = result["q_c_zero"]
    actual = float(np.sqrt(np.mean(zeros.mean(axis=1) ** 2)))
    assert estimated.mean() == pytest.approx(actual, rel=0.08)  # 0.25 Pa; an rms of 1,000 is known to 2.2 %
    assert zeros_at_rest(table, [], BENCH_SIGMA) == {}


def test_pitch_and_heave_of_a_porpoise_are_integrated_without_loss() -> None:
    """Means over 40 ms of a rate that swings at 0.7 Hz give the change of the angle to a part in 10,000. The
    trapezoidal rule would lose 0.4 % of it, which would bias the slope of the angle of attack."""
    w, half, table = 2 * np.pi * 0.7, 0.02, exact_motion(20.0).table.copy()
    t_s = table.index.to_numpy()
    table["q_radps"] = (np.sin(w * (t_s + half)) - np.sin(w * (t_s - half))) / (2 * half)  # for an angle of sin(w t)
    table["az_mps2"] = table["q_radps"]
    blocks = BlockMeans(table)
    mean = InertialInputs(table, blocks, BENCH_SIGMA).mean
    change = np.diff(np.sin(w * blocks.t_s))
    assert mean[:, 1] * STEP_S == pytest.approx(change, abs=1e-4 * np.abs(change).max())
    assert mean[:, 5] == pytest.approx(mean[:, 1])


def test_angles_and_velocities_are_as_noisy_as_integrals_of_the_samples() -> None:
    """White bench noise is integrated over ten steps; 200 such integrals give a standard deviation within 5 %."""
    rng = np.random.default_rng(0)
    motion = exact_motion(400.0)
    table = motion.table.copy()
    for name in CHANNELS:
        table[name] = rng.normal(0, BENCH_SIGMA[name], len(table))
    inertial = InertialInputs(table, BlockMeans(table), BENCH_SIGMA)
    change = np.add.reduceat(inertial.mean[:, :6] * STEP_S, np.arange(0, len(inertial.mean), 10))[:-1]
    scatter = change.std(axis=0) / np.sqrt(10)
    assert np.median(inertial.angle_sigma, axis=0) == pytest.approx(scatter[:3], rel=0.15)
    assert np.median(inertial.velocity_sigma, axis=0) == pytest.approx(scatter[3:], rel=0.15)
    assert inertial.velocity_sigma[:, 0] == pytest.approx(inertial.velocity_sigma[:, 1])


def test_scale_errors_of_inertial_sensors_count_as_noise_in_proportion() -> None:
    """At 1 rad/s and 20 m/s^2 without noise, they are 0.5 % and 0.2 % of the change."""
    table = exact_motion(20.0).table.copy()
    table[list(CHANNELS)] = [1.0] * 3 + [20.0] * 3
    inertial = InertialInputs(table, BlockMeans(table), dict.fromkeys(BENCH_SIGMA, 0.0))
    assert inertial.angle_sigma == pytest.approx(np.full_like(inertial.angle_sigma, 0.005 * STEP_S), rel=0.02)
    assert inertial.velocity_sigma == pytest.approx(np.full_like(inertial.velocity_sigma, 0.04 * STEP_S), rel=0.02)


def test_a_gap_raises_the_noise_of_its_own_steps_only(exact) -> None:
    """During a step without a gyro, attitude may change by 0.5 rad/s, as in a usual maneuver."""
    table = exact.table.copy()
    table.loc[20.0:21.0, "p_radps"] = np.nan
    complete, holed = (InertialInputs(t, BlockMeans(t), BENCH_SIGMA) for t in (exact.table, table))
    more = (holed.angle_sigma - complete.angle_sigma)[:, 0]
    steps = BlockMeans(table).t_s[:-1]
    inside = (steps > 19.9) & (steps < 20.9)
    assert np.all(more[inside] > 0.09) and np.all(np.abs(more[(steps < 19.7) | (steps > 21.1)]) < 1e-4)
    gap = (holed.velocity_sigma - complete.velocity_sigma)[inside]
    assert np.all(gap > 0.9), "velocity depends on attitude"


def test_gusts_of_the_process_model_are_stationary_with_drydens_variance(exact, problem) -> None:
    """In the limit, the variance is sigma^2 for longitudinal gusts; for others, sigma^2/2 of g1 and sigma^2/4 of g2."""
    sigma_w = 0.7
    model = problem.process_model(problem.initial_states, sigma_w)
    decay = {axis: model.inputs[0, PROCESS_INPUTS.index(f"decay_{axis}")] for axis in "uvw"}
    sigma = {name: 1 / model.weight[0, STATES.index(name)] for name in STATES}
    at_50_m = 0.177 + 0.000823 * 100.0 / 0.3048
    sigma_u = sigma_w / at_50_m**0.4
    assert sigma["gust_u"] ** 2 / (1 - decay["u"] ** 2) == pytest.approx(sigma_u**2, rel=0.01)
    for axis, total in (("v", sigma_u), ("w", sigma_w)):
        assert sigma[f"gust_{axis}"] ** 2 / (1 - decay[axis] ** 2) == pytest.approx(total**2 / 2, rel=0.01)
        follow = (1 - decay[axis]) / 2
        A = np.array([[decay[axis], 0.0], [follow * (1 + decay[axis]), decay[axis]]])
        B = np.array([[1.0], [follow]]) * sigma[f"gust_{axis}"]
        Q = B @ B.T + np.diag([0.0, sigma[f"gust_{axis}_filtered_twice"] ** 2])
        P = np.linalg.solve(np.eye(4) - np.kron(A, A), Q.ravel()).reshape(2, 2)
        assert P[1, 1] == pytest.approx(total**2 / 4, rel=0.02)
    assert problem.conditions.transverse_variance(sigma_w) == pytest.approx(sigma_u**2 + sigma_w**2, rel=0.01)


def test_gusts_decay_with_the_distance_flown(exact) -> None:
    """A gust of length L decays by V dt/L in a step, twice as much at twice the speed. On the ground gusts decay as in
    cruise, and below 5 m/s as at 5 m/s."""
    blocks = BlockMeans(exact.table)
    conditions = GustConditions(blocks, np.full(blocks.n, 15.0))
    logs = {V: np.log(conditions.vertical_steps(1.0, np.full(blocks.n, V))[0]) for V in (2.0, 5.0, 10.0, 20.0)}
    assert logs[20.0] == pytest.approx(2 * logs[10.0])
    assert logs[2.0] == pytest.approx(logs[5.0]) and logs[10.0] == pytest.approx(2 * logs[5.0])
    parked = GustConditions(BlockMeans(exact.table.assign(height_m=0.0)), np.full(blocks.n, 15.0))
    assert parked.speed_mps(np.full(blocks.n, 2.0)) == pytest.approx(15.0)


def test_measured_airspeed_does_not_change_how_gusts_decay(exact) -> None:
    """Measured airspeed contains the gust. If it were used, head-on gusts would decay faster than others, and the mean
    of gusts would not be zero. The speed is that of the states, relative to the mean wind."""
    gusty = exact.table.assign(V_mps=exact.table["V_mps"] + np.sin(np.arange(len(exact.table)) / 50))
    first, second = (TrajectoryProblem(table, [slice(0, 0)]) for table in (exact.table, gusty))
    x = first.initial_states.copy()
    models = [problem.process_model(x, 0.5) for problem in (first, second)]
    decay_u = [model.inputs[:, PROCESS_INPUTS.index("decay_u")] for model in models]
    assert np.array_equal(*decay_u)
    x[:, [STATES.index("v_north"), STATES.index("wind_north")]] += 3.0
    assert first.process_model(x, 0.5).inputs == pytest.approx(models[0].inputs), "the same motion in another wind"


def test_the_wind_follows_the_profile_over_height_and_else_walks(exact) -> None:
    """Between two heights in a log layer, wind goes with the logarithm of height over roughness. It also does a random
    walk of 0.02 m/s in a second, 0.15 m/s in a minute."""
    table = exact.table.copy()
    table["height_m"] = np.linspace(20.0, 100.0, len(table))
    blocks = BlockMeans(table)
    V = blocks["V_mps"]
    model = ProcessModel(InertialInputs(table, blocks, BENCH_SIGMA), blocks, GustConditions(blocks, V), 0.1, V)
    ratio = model.inputs[:, PROCESS_INPUTS.index("wind_ratio")]
    height, roughness = blocks["height_m"], 0.15 * 0.3048
    assert np.prod(ratio[10:-10]) == pytest.approx(np.log(height[-11] / roughness) / np.log(height[10] / roughness))
    sigma = 1 / model.weight[:, STATES.index("wind_north")]
    assert np.sqrt(np.sum(sigma[:300] ** 2)) == pytest.approx(0.02 * np.sqrt(60.0), rel=0.01)
    height_sigma = 1 / model.weight[:, STATES.index("height")]
    assert np.sqrt(np.sum(height_sigma[:300] ** 2)) < 0.1, "height is the integral of velocity: centimeters in a minute"


def test_weights_are_those_of_pressure_noise(exact) -> None:
    """Noise acts through V = sqrt(2 q/rho), through a pair of ports with 9/4 qbar sin(2 alpha), and through p(h)."""
    blocks = BlockMeans(exact.table)
    noise = BENCH_SIGMA | {"q_c_Pa": 5.0, "dp_alpha_Pa": 4.0, "dp_beta_Pa": 3.0, "static_Pa": 7.0}
    V = np.full(blocks.n, 14.0)
    rest = np.zeros(blocks.n, dtype=bool)
    rest[:10] = True
    measurements = Measurements(exact.table, blocks, rest, noise, V_reference=V, field=LevelField(None, blocks))
    weight = dict(zip(MEASUREMENTS, measurements.weight.T, strict=True))
    q, few = RHO * 14.0**2 / 2, np.sqrt(BLOCK)
    dV = np.sqrt(2 * (q + 1.0) / RHO) - np.sqrt(2 * (q - 1.0) / RHO)
    assert 1 / weight["V"] == pytest.approx(np.full(blocks.n, 5.0 * dV / 2 / few), rel=1e-3)
    slope = 9 / 4 * q * np.sin(2e-4) / 1e-4
    assert 1 / weight["alpha"] == pytest.approx(np.full(blocks.n, 4.0 / slope / few), rel=1e-3)
    assert 1 / weight["beta"] == pytest.approx(np.full(blocks.n, 3.0 / slope / few), rel=1e-3)
    assert 1 / weight["height"] == pytest.approx(np.full(blocks.n, 7.0 / 11.8 / few), rel=0.03)
    assert 1 / weight["gps_north"][0] == pytest.approx(0.3) and 1 / weight["gps_down"][0] == pytest.approx(1.0)
    assert np.array_equal(weight["v_north"] > 0, rest) and 1 / weight["v_down"][0] == pytest.approx(0.1)
    assert not measurements.has_compass and not weight["compass"].any()


def test_gps_is_shifted_by_its_latency_and_left_out_in_gaps(problem, exact) -> None:
    table = exact.table.copy()
    late, t = 0.3, table.index.to_numpy()
    for name in ("gps_north_mps", "gps_east_mps", "gps_down_mps"):
        table[name] = np.interp(t - late, t, table[name])
    table.loc[30.0:32.0, "gps_north_mps"] = np.nan
    blocks = BlockMeans(table)
    nothing = np.zeros(blocks.n, dtype=bool)
    measurements = Measurements(
        table, blocks, nothing, BENCH_SIGMA, V_reference=blocks["V_mps"], field=LevelField(None, blocks)
    )
    values, weight = measurements.at_gps_latency(late)
    inside = slice(5, -5)
    for i, name in enumerate(("gps_east", "gps_down")):
        got = values[inside, MEASUREMENTS.index(name)]
        assert got == pytest.approx(exact.states[inside, 4 + i], abs=0.02)
    used = weight[:, MEASUREMENTS.index("gps_north")] > 0
    gap = (blocks.t_s > 30.0 - late) & (blocks.t_s < 32.0 - late)
    assert not used[gap].any() and abs(used[5:-5].sum() - (~gap)[5:-5].sum()) <= 2


def test_priors_are_those_of_the_study_and_north_is_the_compass_without_gps() -> None:
    mean, sigma = (
        dict(zip(SENSOR_ERRORS, part, strict=True)) for part in sensor_error_prior(SensorPriors(0.04), gps=True)
    )
    assert mean.pop("gps_latency") == 0.1 and set(mean.values()) == {0.0}
    assert sigma["alpha_scale"] == pytest.approx(0.05)
    assert sigma["ax_bias"] == sigma["az_bias"] == 0.19
    assert np.degrees([sigma["alpha_bias"], sigma["beta_bias"]]) == pytest.approx([1.0, 1.0])
    assert np.degrees(sigma["heading_bias"]) == pytest.approx(10.0)
    without = dict(zip(SENSOR_ERRORS, sensor_error_prior(SensorPriors(0.04), gps=False)[1], strict=True))
    assert without.pop("heading_bias") == pytest.approx(0.01)
    sigma.pop("heading_bias")
    assert without == sigma


STATED = Uncertainty(
    angle_of_attack_offset_rad=0.03,
    angle_of_attack_slope_fraction=0.05,
    airspeed_scale_fraction=0.02,
    air_data_lag_s=0.04,
    accelerometer_offset_mps2=0.4,
)


def test_priors_are_those_that_the_aircraft_file_states(exact) -> None:
    """A calibration of the transducers replaces the priors of its own errors, and no others."""
    error_sigma = TrajectoryProblem(
        exact.table, [slice(0, 0)], SensorPriors(file_sigma=stated_sigma(STATED))
    ).error_sigma
    sigma = dict(zip(SENSOR_ERRORS, error_sigma, strict=True))
    assert (sigma["alpha_bias"], sigma["alpha_scale"], sigma["V_scale"]) == (0.03, 0.05, 0.02)
    assert (sigma["air_data_lag"], sigma["ax_bias"], sigma["ay_bias"], sigma["az_bias"]) == (0.04, 0.4, 0.4, 0.4)
    assert {name for name in sigma if sigma[name] == PRIOR_SIGMA[name]} >= {"p_bias", "beta_bias", "gps_latency"}
    with_file = sensor_error_prior(
        SensorPriors(0.0, stated_sigma(STATED), {"V_scale": 0.004, "alpha_scale": 0.012}), gps=True
    )[1]
    changed = {
        name for name, before, after in zip(SENSOR_ERRORS, error_sigma, with_file, strict=True) if before != after
    }
    assert {"V_scale", "alpha_scale"} == changed - {"heading_bias"}
    assert with_file[SENSOR_ERRORS.index("V_scale")] == pytest.approx(0.005)


def test_the_initial_state_is_known_only_at_rest() -> None:
    """Velocity is known to 0.3 m/s if the log begins at rest; a heading that nothing measures is zero by definition."""
    free, held = (
        dict(zip(STATES, initial_state_sigma(0.5, heading_measured=m, at_rest=r), strict=True))
        for m, r in ((True, False), (False, True))
    )
    assert free["psi"] > np.radians(90) and held["psi"] == pytest.approx(0.01)
    assert [free[f"v_{axis}"] for axis in ("north", "east", "down")] == [10.0] * 3
    assert [held[f"v_{axis}"] for axis in ("north", "east", "down")] == [0.3] * 3
    assert free["gust_w"] == 0.5 and free["wind_north"] == 8.0
    rest = np.zeros(300, dtype=bool)
    assert not begins_at_rest(rest)
    rest[30:60] = True
    assert not begins_at_rest(rest), "the log began six seconds before"
    rest[24] = True
    assert begins_at_rest(rest)


@pytest.mark.parametrize("gps", [True, False])
def test_the_initial_estimate_is_near_enough_to_converge(exact, gps: bool) -> None:
    """Heading is the ground track with GPS, to 15 deg at any time, and the compass without, to 10 deg in the mean."""
    attitude = exact.states[:, :3]
    field = np.column_stack(body_from_earth((22e-6, 0.0, 40e-6), np.repeat(attitude, BLOCK, axis=0).T))
    table = exact.table if gps else exact.table.assign(gps_north_mps=np.nan, gps_east_mps=np.nan, gps_down_mps=np.nan)
    compass = Compass(field, 1e-6)
    x = TrajectoryProblem(table, [slice(0, 0)], compass=compass).initial_states
    off = (x[:, 2] - attitude[:, 2] + np.pi) % (2 * np.pi) - np.pi
    assert np.degrees(np.abs(off[10:-10])).max() < 15 if gps else np.degrees(np.abs(off.mean())) < 10
    assert x[10:-10, 5] == pytest.approx(exact.states[10:-10, 5], abs=0.1)
    assert x[10:-10, 6] == pytest.approx(exact.states[10:-10, 6], abs=0.1)


def test_regressors_of_an_exact_motion(problem, exact) -> None:
    """Actual regressors are the angle of attack without its sensor errors, its derivative, and the mean over a block
    less the value at its center; predicted vertical velocity continues that of the three seconds before."""
    errors = np.zeros(len(SENSOR_ERRORS))
    for name, value in (("alpha_bias", 0.02), ("alpha_scale", 0.1), ("V_scale", 0.03)):
        errors[SENSOR_ERRORS.index(name)] = value
    actual, _ = problem.regressors.measurement_inputs(exact.states, errors, 0.1)
    columns = dict(zip(MEASUREMENT_INPUTS, actual.T, strict=True))
    blocks = problem.blocks
    by_slope = (blocks["dalpha_dlndp_alpha_rad"] - 0.02) / (1 + 0.1 - 0.06)
    assert columns["alpha_by_slope"] == pytest.approx(by_slope)
    angle = blocks["alpha_rad"] - 0.02 - (0.1 - 0.06) * by_slope
    inner = slice(10, -10)
    assert columns["probe_alpha_rate"][inner] == pytest.approx(np.gradient(angle, blocks.t_s)[inner], abs=0.05)
    qbar_Pa = blocks["rho"] * columns["V_predicted"] ** 2 / 2
    assert columns["V_scale_per_Pa"] == pytest.approx(1 / (2 * qbar_Pa))
    assert columns["alpha_per_Pa"] == pytest.approx(1 / (ALPHA_PORT_SLOPE * qbar_Pa))
    center = exact.table["alpha_rad"].to_numpy()[blocks.rows]
    curvature = blocks["alpha_rad"] - center
    assert np.std((columns["alpha_curvature"] - curvature)[inner]) < 0.25 * np.std(curvature[inner])
    for name in ("ax", "ay", "az"):
        assert columns[name] == pytest.approx(blocks[f"{name}_mps2"])
    ramp = exact.states.copy()
    ramp[:, 5] = 0.3 * blocks.t_s
    x = problem.regressors.predicted_states(ramp)
    assert x[20:, 5] == pytest.approx(ramp[20:, 5]) and np.array_equal(np.delete(x, 5, 1), np.delete(ramp, 5, 1))
    jump = ramp.copy()
    jump[100, 5] += 5.0
    assert problem.regressors.predicted_states(jump)[100, 5] == pytest.approx(ramp[100, 5])


def test_all_blocks_of_a_compass_count_as_four_measurements(exact) -> None:
    """Errors of the compass repeat with every leg, so a longer flight does not average them out."""
    blocks = BlockMeans(exact.table)
    rest = np.zeros(blocks.n, dtype=bool)
    field = LevelField(Compass(np.full((len(exact.table), 3), 2e-5), 1e-6), blocks)
    measurements = Measurements(exact.table, blocks, rest, BENCH_SIGMA, V_reference=blocks["V_mps"], field=field)
    weight = measurements.weight[:, MEASUREMENTS.index("compass")]
    assert np.sqrt(np.sum(weight**2)) == pytest.approx(np.sqrt(4) / 1e-6)


def test_gps_is_left_out_in_gaps_of_several_of_its_intervals(exact) -> None:
    """0.8 s without GPS is a gap for a 5 Hz receiver, but shorter than the interval of a 1 Hz receiver."""
    blocks = BlockMeans(exact.table)
    rest = np.zeros(blocks.n, dtype=bool)
    for every_s, gap_s, left_out in ((0.2, 0.4, False), (0.2, 0.8, True), (1.0, 0.8, False), (1.0, 4.0, True)):
        table = exact.table.copy()
        table.loc[np.arange(len(table)) % round(every_s / 0.04) > 0, "gps_north_mps"] = np.nan
        table.loc[30.0 : 30.0 + gap_s - 0.05, "gps_north_mps"] = np.nan
        measurements = Measurements(
            table, blocks, rest, BENCH_SIGMA, V_reference=blocks["V_mps"], field=LevelField(None, blocks)
        )
        weight = measurements.at_gps_latency(0.0)[1][:, MEASUREMENTS.index("gps_north")]
        assert (weight[5:-5] == 0.0).any() == left_out


def test_only_blocks_wholly_within_a_rest_are_at_rest() -> None:
    """With blocks of five rows, rows 3 to 17 contain all of the second and the third block only."""
    assert np.flatnonzero(_blocks_at_rest([slice(3, 17)], 6)).tolist() == [1, 2]
    assert np.flatnonzero(_blocks_at_rest([slice(5, 20), slice(25, 30)], 6)).tolist() == [1, 2, 3, 5]


def test_heading_offset_of_the_compass(exact) -> None:
    """If the field points 20 deg east of the reference north, the compass reads 20 deg less."""
    attitude = np.repeat(exact.states[:, :3], BLOCK, axis=0)
    east = np.radians(20.0)
    level = 22e-6 * np.cos(east), 22e-6 * np.sin(east)
    field = np.column_stack(body_from_earth((*level, 40e-6), attitude.T))
    leveled = LevelField(Compass(field, 1e-6), BlockMeans(exact.table))
    phi, theta, psi = exact.states[:, :3].T
    offset = np.degrees(leveled.heading_offset(psi, phi, theta))
    assert (offset + 180) % 360 - 180 == pytest.approx(np.full(len(psi), -20.0), abs=0.1)


def test_a_latency_of_gps_up_to_half_a_second_is_within_two_standard_deviations() -> None:
    """log-format.md says that a constant latency of up to about half a second is estimated; receivers take 0.1 s."""
    mean, sigma = (part[SENSOR_ERRORS.index("gps_latency")] for part in sensor_error_prior(SensorPriors(), gps=True))
    assert mean == 0.1 and mean + 2 * sigma == pytest.approx(0.5)


def test_the_prior_of_a_zero_contains_its_change_between_rest_and_flight() -> None:
    at_rest = {"dp_alpha_zero": 0.1, "q_c_zero": 0.2}
    for change in (0.0, 2.5):
        file_sigma = stated_sigma(Uncertainty(transducer_zero_Pa=change))
        with_rest = dict(
            zip(
                SENSOR_ERRORS,
                sensor_error_prior(SensorPriors(file_sigma=file_sigma), at_rest, gps=True)[1],
                strict=True,
            )
        )
        without = dict(
            zip(SENSOR_ERRORS, sensor_error_prior(SensorPriors(file_sigma=file_sigma), gps=True)[1], strict=True)
        )
        for name, error in at_rest.items():
            assert with_rest[name] == pytest.approx(np.hypot(error, change))
            assert without[name] == pytest.approx(np.hypot(1.0, change)), "a zero of another day is known to 1 Pa"


def test_a_thrust_column_makes_no_vibration() -> None:
    """Motor speed follows the square root of thrust, so an offset from vibration would look like an error of thrust."""
    column, real = parse_propeller(THRUST_AS_SPEED, "thrust"), load_propeller("apc-10x5e")
    assert column.is_thrust_column and not real.is_thrust_column
    usual, none = (stated_sigma(STATED, motor_speed=motor_speed) for motor_speed in (True, False))
    assert usual["ax_vibration"] > 0 and usual["az_vibration"] > 0
    assert none["ax_vibration"] < 1e-5 and none["az_vibration"] < 1e-5  # m/s^2 at 100 rev/s
    assert {name for name in usual if usual[name] != none[name]} == {"ax_vibration", "az_vibration"}


def test_noise_of_the_height_in_flight_weighs_the_height_less_and_nothing_else(exact) -> None:
    quiet, noisy = (
        TrajectoryProblem(exact.table, [slice(0, 0)], SensorPriors(height_noise=factor)).measurements.weight
        for factor in (1.0, 5.0)
    )
    height = MEASUREMENTS.index("height")
    assert noisy[:, height] == pytest.approx(quiet[:, height] / 5)
    assert np.delete(noisy, height, axis=1) == pytest.approx(np.delete(quiet, height, axis=1))
