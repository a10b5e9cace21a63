"""The trajectory agrees with the simulator's truth, for random sensor errors from the study's budget."""

import dataclasses

import flights
import numpy as np
import pytest
from scipy.stats import chi2

from flightpower.analysis.trajectory.equations import (
    MEASUREMENT_INPUTS,
    MEASUREMENTS,
    PROCESS_INPUTS,
    SENSOR_ERRORS,
    STATES,
    EquationInputs,
)
from flightpower.analysis.trajectory.linearized_equations import Equations
from flightpower.analysis.trajectory.priors import PRIOR_SIGMA, SensorPriors
from flightpower.analysis.trajectory.reconstruction import reconstruct
from flightpower.flight.aircraft import Uncertainty, load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.runs import AIRCRAFT_SIZE
from flightpower.sim.fly import fly
from flightpower.sim.plan import load_plan
from flightpower.sim.sensors import FlightSensorTruth, load_budget
from flightpower.sim.world import load_world

pytestmark = pytest.mark.xdist_group("calm")

SEEDS = (0, 1, 2)


def flown(seed: int, probe, plan: str, *, without: tuple[str, ...] = (), turbulence_kt: float = 0.0):
    """Return truth, drawn errors, air data and stretches at rest of a flight with the study's budget."""
    aircraft, errors = load_aircraft("nexstar"), flights.draw_errors(load_budget("study"), seed)
    flight, _, table = flights.flown(aircraft, errors, plan, seed, turbulence_kt)
    for name in without:
        table[name] = np.nan
    air, still, _ = flights.air_of(table, aircraft, probe)
    return flight.truth, errors, air, still


@pytest.fixture(scope="module")
def hop(probe):
    """Return air data, stretches at rest, and the trajectory of a short calm flight on one heading."""
    _, _, air, still = flown(0, probe, "accel-decel")
    return air, still, reconstruct(air, still)


def test_a_wind_as_fast_as_the_aircraft_is_found(probe) -> None:
    """It is 11 m/s at an airspeed of 10. Iterations that began without wind ended at gusts that stop the aircraft."""
    aircraft, errors = load_aircraft("light-1kg"), flights.draw_errors(load_budget("study"), 2)
    flight, _, table = flights.flown(aircraft, errors, "steady-points", 2, 14.0, wind_too=True)
    air, still, _ = flights.air_of(table, aircraft, probe)
    trajectory, truth = reconstruct(air, still), flight.truth
    assert trajectory.converged and trajectory.gust_mps == pytest.approx(0.1 * 14 * 0.514444, rel=0.25)
    high = truth[truth["height_m"] > 0.9 * truth["height_m"].max()]
    flown = trajectory.states[trajectory.states["height"] > 0.9 * truth["height_m"].max()]
    for axis in ("north", "east"):
        assert flown[f"wind_{axis}"].mean() == pytest.approx(high[f"wind_{axis}_mps"].mean(), abs=0.7)


@pytest.mark.thorough
@pytest.mark.slow
def test_short_gusts_are_reconstructed_with_their_own_length(probe) -> None:
    """In this flight in 15 kt, airspeed scale is off 0.7 % with the standard's length, 0.2 % with the gusts' own."""
    world, plan, aircraft = load_world("short-gusts"), load_plan("full-test-flight"), load_aircraft("nexstar")
    errors = flights.draw_errors(world.errors, 203)
    plan = world.plan(dataclasses.replace(plan, air=dataclasses.replace(plan.air, turbulence_mps=15 * 0.514444)), 203)
    flight = fly(aircraft, plan, seed=203, deviations=errors.deviations)
    air, still, _ = flights.air_of(flights.sensor_table(FlightSensorTruth(flight, errors), aircraft), aircraft, probe)
    trajectory = reconstruct(air, still)
    assert trajectory.gust_length == pytest.approx(0.4, rel=0.25)
    assert trajectory.gust_mps == pytest.approx(0.1 * 15 * 0.514444, rel=0.25)
    assert abs(trajectory.value("V_scale") - errors.values.V_scale) < 2 * trajectory.standard_error("V_scale")


@pytest.mark.parametrize(
    ("world", "scale"), [pytest.param("study", 0.0, marks=pytest.mark.thorough), ("imu-scale", 0.02)]
)
def test_turns_and_runs_show_the_scales_of_the_imu(probe, world: str, scale: float) -> None:
    """GPS shows how far the aircraft turned and accelerated, so an error of twice the prior is noticed."""
    aircraft, errors = load_aircraft("nexstar"), flights.draw_errors(load_world(world).errors, 2)
    _, _, table = flights.flown(aircraft, errors, "two-pairs", 2, 3.0)
    air, still, _ = flights.air_of(table, aircraft, probe)
    trajectory = reconstruct(air, still)
    for name in ("p_scale", "q_scale", "r_scale", "ax_scale", "az_scale"):
        sigma = trajectory.standard_error(name)
        assert sigma < 0.007, name
        drawn_to_zero = scale * (1 - (sigma / trajectory.prior_standard_error(name)) ** 2)
        assert abs(trajectory.value(name) - drawn_to_zero) < 3 * sigma, name


def test_priors_are_those_of_the_study():
    """Priors are the budget's errors over the square root of three, or up to 20 % more."""
    s, ratio = load_budget("study").systematic, 3**0.5
    sizes = {"alpha_bias": s.alpha_offset_rad, "alpha_scale": s.alpha_scale, "V_scale": s.V_scale}
    for name, size in (sizes | {"ax_bias": s.accel_bias_mps2}).items():
        assert 1.0 <= PRIOR_SIGMA[name] / (size / ratio) <= 1.2
    assert Uncertainty().thrust_scale_fraction == pytest.approx(s.thrust_scale / ratio, rel=0.1)
    assert Uncertainty().thrust_slope == pytest.approx(s.thrust_slope_J / ratio, rel=0.1)


@pytest.mark.thorough
@pytest.mark.slow
def test_a_long_flight_without_gps_converges_with_an_unmeasured_heading(probe) -> None:
    gps = ("gps_north_mps", "gps_east_mps", "gps_down_mps")
    _, errors, air, still = flown(0, probe, "full-test-flight", without=gps)
    trajectory = reconstruct(air, still)
    assert trajectory.converged
    slope = 1 + errors.values.alpha_scale - 2 * errors.values.V_scale
    offset = (errors.values.alpha_offset_rad + errors.imu_rotation[0, 2]) * slope
    assert trajectory.value("alpha_bias") == pytest.approx(offset, abs=np.radians(0.1))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [SEEDS[0], *(pytest.param(seed, marks=pytest.mark.thorough) for seed in SEEDS[1:])])
def test_a_whole_calm_flight_is_found_again(calm, seed: int) -> None:
    """Pitch and angle of attack of the IMU's axes are right to 0.1 deg, airspeed scale to 0.5 %, and wind to 0.3 m/s at
    heights where it can be measured.

    The IMU is misaligned with the body by a fixed rotation that nothing on board can tell from an offset of angle of
    attack; forces are taken in the IMU's axes, so these are the angles that count.
    """
    truth, errors, _, trajectory = calm(seed)
    assert trajectory.converged
    t = trajectory.states.index.to_numpy()
    flight = np.interp(t, truth["time_s"], truth["height_m"]) > 30
    tilt = errors.imu_rotation[0, 2]  # sensor axes relative to body axes, about y: sin of minus the pitch
    pitch = np.interp(t, truth["time_s"], truth["pitch_rad"]) - tilt
    assert abs(np.degrees((trajectory.states["theta"] - pitch)[flight].mean())) < 0.1
    assert np.degrees((trajectory.states["theta"] - pitch)[flight].std()) < 0.15
    slope = 1 + errors.values.alpha_scale - 2 * errors.values.V_scale  # errors of pressures also scale the offset
    offset = (errors.values.alpha_offset_rad + tilt) * slope
    assert trajectory.value("alpha_bias") == pytest.approx(offset, abs=np.radians(0.1))
    assert trajectory.value("V_scale") == pytest.approx(errors.values.V_scale, abs=0.005)
    assert trajectory.value("gps_latency") == pytest.approx(errors.values.gps_latency_s, abs=0.02)
    assert trajectory.gust_mps <= 0.05
    high = np.interp(t, truth["time_s"], truth["height_m"]) > AIRCRAFT_SIZE.least_height_m
    for axis in ("north", "east"):
        wind = np.interp(t, truth["time_s"], truth[f"wind_{axis}_mps"])
        assert np.abs(trajectory.states[f"wind_{axis}"] - wind)[high].max() < 0.3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plan", "flights"), [("laps", 1), pytest.param("full-test-flight", 4, marks=pytest.mark.thorough)]
)
def test_gusts_are_not_attributed_to_sensor_errors(probe, plan: str, flights: int) -> None:
    """In W20 = 15 kt, each error stays within its stated uncertainty over all flights, and none is one-sided.

    The aircraft responds to gusts; a smoother that mistakes the response for a sensor error is off by 0.6 deg in every
    flight. If it does not, z = error / standard error is normal with unit variance: for n flights, its sum is within
    2.6 sqrt(n), and its sum of squares within the 99.9 % of chi-square.
    """
    z = []
    for seed in range(flights):
        _, errors, air, still = flown(seed, probe, plan, turbulence_kt=15.0)
        trajectory = reconstruct(air, still)
        assert trajectory.converged
        assert 0.4 < trajectory.gust_mps / (0.1 * 15 * 0.514444) < 1.6
        assert trajectory.gust_length == 1, "the assumed gusts must not be rejected"
        slope = 1 + errors.values.alpha_scale - 2 * errors.values.V_scale
        truth = {
            "alpha_bias": (errors.values.alpha_offset_rad + errors.imu_rotation[0, 2]) * slope,
            "alpha_scale": errors.values.alpha_scale,
            "V_scale": errors.values.V_scale,
        }
        assert trajectory.standard_error("alpha_bias") < np.radians(0.3)
        assert trajectory.standard_error("V_scale") < 0.01 < PRIOR_SIGMA["V_scale"]
        z.append([(trajectory.value(name) - value) / trajectory.standard_error(name) for name, value in truth.items()])
    assert np.all(np.abs(np.sum(z, axis=0)) < 2.6 * np.sqrt(flights))
    assert np.all(np.sum(np.square(z), axis=0) < chi2.isf(0.001, flights))


def test_without_gps_the_reconstruction_converges_with_larger_errors(probe, hop) -> None:
    gps = ("gps_north_mps", "gps_east_mps", "gps_down_mps")
    _, still, with_gps = hop
    _, _, table_without_gps, _ = flown(0, probe, "accel-decel", without=gps)
    without = reconstruct(table_without_gps, still)
    assert without.converged
    assert without.standard_error("r_bias") > 2 * with_gps.standard_error("r_bias"), "nothing shows the heading drift"
    assert without.standard_error("gps_latency") == pytest.approx(PRIOR_SIGMA["gps_latency"], rel=1e-3)
    assert np.isfinite(without.states.to_numpy()).all()


def test_a_channel_without_data_at_rest_gets_the_noise_of_the_bench(hop) -> None:
    """Sideslip data begin late, so noise at rest is unknown and the usual noise is assumed; the path hardly changes."""
    air, still, undamaged = hop
    late = air.copy()
    late.iloc[: still[0].stop, late.columns.get_loc("dp_beta_Pa")] = np.nan
    trajectory = reconstruct(late, still)
    assert trajectory.converged
    moved = (trajectory.sensor_errors - undamaged.sensor_errors) / np.sqrt(np.diag(undamaged.covariance))
    assert np.abs(moved).max() < 0.5


def test_a_gap_of_the_imu_has_only_a_local_effect(hop) -> None:
    air, still, undamaged = hop
    holed = air.copy()
    holed.loc[40.0:42.0, ["p_radps", "q_radps", "r_radps", "ax_mps2", "ay_mps2", "az_mps2"]] = np.nan
    trajectory = reconstruct(holed, still)
    assert trajectory.converged
    elsewhere = (trajectory.states.index < 35) | (trajectory.states.index > 47)
    difference = np.degrees(trajectory.states["theta"] - undamaged.states["theta"])[elsewhere]
    assert np.abs(difference).max() < 0.5


def test_a_saturated_airspeed_transducer_raises_standard_errors_without_bias(hop) -> None:
    """It is clipped above 19 m/s, so neither speed nor angles are measured there; slow flight is as before."""
    air, still, undamaged = hop
    clipped = air.copy()
    clipped.loc[air["V_mps"] > 19.0, ["V_mps", "alpha_rad", "beta_rad", "dlnV_dlndp_alpha"]] = np.nan
    trajectory = reconstruct(clipped, still)
    assert trajectory.converged and np.isfinite(trajectory.states.to_numpy()).all()
    for name in ("V_scale", "alpha_scale", "alpha_bias"):
        assert trajectory.standard_error(name) > undamaged.standard_error(name)
        assert abs(trajectory.value(name) - undamaged.value(name)) < 3 * trajectory.standard_error(name)


def test_the_uncertainty_of_the_probes_slope_widens_prior_and_posterior(hop) -> None:
    air, still, sure = hop
    doubtful = reconstruct(air, still, SensorPriors(alpha_scale_sigma=0.04))
    assert doubtful.prior_standard_error("alpha_scale") == pytest.approx(np.hypot(PRIOR_SIGMA["alpha_scale"], 0.04))
    assert doubtful.standard_error("alpha_scale") > sure.standard_error("alpha_scale")


@pytest.mark.slow
@pytest.mark.parametrize(
    "missing",
    [
        pytest.param(["ax_mps2", "ay_mps2", "az_mps2"], marks=pytest.mark.thorough),
        ["V_mps", "alpha_rad", "beta_rad"],
    ],
)
def test_a_log_without_enough_channels_is_refused_or_reported_as_uncertain(hop, missing) -> None:
    """Without accelerometers or any air data, there is an InputError or a large uncertainty, and no other exception."""
    air, still, _ = hop
    blind = air.copy()
    blind[missing] = np.nan
    try:
        trajectory = reconstruct(blind, still)
    except InputError as error:
        assert "path" in str(error)
    else:
        assert trajectory.standard_error("alpha_bias") > np.radians(0.3)


def test_derivatives_are_those_of_the_equations() -> None:
    """They agree with central differences at the best step, (3 eps)^(1/3), whose error is about 1e-10."""
    rng = np.random.default_rng(0)
    n, nx, m = 4, len(STATES), len(SENSOR_ERRORS)
    equations = Equations(n)
    x, shared = rng.normal(0, 0.1, (n, nx)), rng.normal(0, 0.01, m)
    x[:, 3] += 15.0
    move, inputs = rng.normal(0, 0.3, (n - 1, len(PROCESS_INPUTS))), rng.normal(size=(n, len(MEASUREMENT_INPUTS)))
    inputs[:, MEASUREMENT_INPUTS.index("V_predicted")] += 15.0
    shown = rng.normal(size=(n, len(MEASUREMENTS))), np.ones((n, len(MEASUREMENTS)))
    data = EquationInputs(move, np.ones((n - 1, nx)), *shown, inputs, predicted_states=x, predicted_inputs=inputs)
    linearization = equations.linearize(x, shared, data)
    h = 4e-6
    for j in range(nx):
        more, less = x.copy(), x.copy()
        more[1, j] += h
        less[1, j] -= h
        up, down = equations.linearize(more, shared, data), equations.linearize(less, shared, data)
        assert linearization.measurement_jacobian.dense()[1, :, j] == pytest.approx(
            (up.measurement_residual - down.measurement_residual)[1] / (2 * h), abs=1e-7
        )
        assert linearization.process_jacobian.dense()[1, :, j] == pytest.approx(
            (up.process_residual - down.process_residual)[1] / (2 * h), abs=1e-7
        )
        assert linearization.process_jacobian.dense()[0, :, nx + j] == pytest.approx(
            (up.process_residual - down.process_residual)[0] / (2 * h), abs=1e-7
        )
    for j in range(m):
        up, down = (equations.linearize(x, shared + sign * h * np.eye(m)[j], data) for sign in (1, -1))
        assert linearization.measurement_jacobian.dense()[:, :, nx + j] == pytest.approx(
            (up.measurement_residual - down.measurement_residual) / (2 * h), abs=1e-7
        )
        assert linearization.process_jacobian.dense()[:, :, 2 * nx + j] == pytest.approx(
            (up.process_residual - down.process_residual) / (2 * h), abs=1e-7
        )

    # Predicted states and inputs change only the derivatives.
    elsewhere, other = x + rng.normal(0, 0.1, x.shape), inputs + rng.normal(0, 0.1, inputs.shape)
    foretold = equations.linearize(
        x, shared, dataclasses.replace(data, predicted_states=elsewhere, predicted_inputs=other)
    )
    there = equations.linearize(
        elsewhere,
        shared,
        dataclasses.replace(data, measurement_inputs=other, predicted_inputs=other, predicted_states=elsewhere),
    )
    assert foretold.measurement_residual == pytest.approx(linearization.measurement_residual, abs=0)
    assert foretold.measurement_jacobian.values == pytest.approx(there.measurement_jacobian.values, abs=0)
