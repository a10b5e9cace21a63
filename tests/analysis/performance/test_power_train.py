"""Power from thrust to battery agrees with the simulator's motor, which is written independently."""

from dataclasses import replace

import numpy as np
import pytest
from motor_data import NO_CORRECTION, RHO, STEP_S, recorded, steady_points

from flightpower.analysis.performance.power_train import PowerTrainModel, fit_power_train
from flightpower.analysis.performance.propagation import exact, from_sigma_points
from flightpower.flight.propeller_speed import corrected_thrust, revps_for_thrust
from flightpower.sim.propulsion import throttle_for


def test_the_speed_of_rotation_found_gives_the_thrust_asked_for(propeller) -> None:
    V, thrust = np.meshgrid(np.linspace(8, 28, 9), np.linspace(0.5, 12, 8))
    scale, slope = 0.03, -0.1
    n = revps_for_thrust(propeller, V, thrust, RHO, thrust_scale=scale, thrust_slope=slope)
    actual = corrected_thrust(propeller, V, n, RHO, thrust_scale=scale, thrust_slope=slope)
    _, shaft = propeller.thrust_and_power(V, n, RHO)
    assert actual == pytest.approx(thrust, rel=1e-8)
    assert np.all(shaft > thrust * V * 0.9), "thrust power exceeds shaft power by at most the thrust correction"


def test_the_thrust_correction_at_the_reference_advance_ratio_is_the_scale_alone(propeller) -> None:
    n, J = 100.0, np.array([0.5, 0.6])
    V = J * n * propeller.diameter_m
    table, _ = propeller.thrust_and_power(V, n, RHO)
    thrust = corrected_thrust(propeller, V, n, RHO, thrust_scale=0.03, thrust_slope=-0.2)
    assert thrust / table == pytest.approx([1.03, 1.03 - 0.2 * 0.1])


def test_a_thrust_no_speed_of_rotation_gives_has_none(propeller) -> None:
    assert np.isnan(revps_for_thrust(propeller, 15.0, 1e5, RHO))


def predicted(train, propeller, V, n):
    """Return the battery power and its standard error at air speeds V [m/s] and motor speeds n [rev/s]."""
    _, shaft = propeller.thrust_and_power(V, n, RHO)
    return from_sigma_points(train.battery_power(shaft, n, train.parameters.sigma_points()))


def elsewhere(nexstar, propeller):
    """Return V [m/s] and n [rev/s] that differ from all steady points, and the true battery power [W] there."""
    V = np.array([11.0, 15.0, 18.0, 21.0, 23.5])
    n = V / (np.array([0.50, 0.64, 0.60, 0.68, 0.64]) * propeller.diameter_m)
    truth = recorded(nexstar, propeller, V, n, throttle_for(nexstar.propulsion, propeller, V=V, n=n, rho=RHO))
    return V, n, truth["battery_W"].to_numpy()


def test_losses_fitted_to_steady_points_hold_at_other_points(nexstar, propeller) -> None:
    """Without noise, the priors move power by less than a watt."""
    train = fit_power_train(steady_points(nexstar, propeller), nexstar.propulsion, propeller, **NO_CORRECTION)
    assert train.measured
    V, n, truth = elsewhere(nexstar, propeller)
    assert predicted(train, propeller, V, n).value == pytest.approx(truth, rel=0.005)
    for point in train.points:
        assert point.overall == pytest.approx(point.propeller * point.motor, rel=1e-9)
        assert 0.4 < point.overall < point.motor < 1


def test_the_power_that_accelerates_the_rotor_is_not_called_loss(nexstar, propeller) -> None:
    """At each point the motor speeds up by 1 %/s, which costs 8 W at 100 rev/s; the losses equal those of steady
    flight."""
    heavy = replace(nexstar.propulsion, propeller_inertia_kgm2=2e-3)
    data = steady_points(nexstar, propeller)
    per_point = len(data) // 5
    n = data["n"].to_numpy() * np.tile(np.linspace(0.9, 1.1, per_point), 5)
    throttle = throttle_for(nexstar.propulsion, propeller, V=data["V"].to_numpy(), n=n, rho=RHO)
    moving = recorded(nexstar, propeller, data["V"].to_numpy(), n, throttle)
    acceleration = np.concatenate([np.gradient(part, STEP_S) for part in np.split(n, 5)])
    moving["battery_W"] += (2 * np.pi) ** 2 * heavy.propeller_inertia_kgm2 * n * acceleration
    V, elsewhere_n, truth = elsewhere(nexstar, propeller)
    train = fit_power_train(moving, heavy, propeller, **NO_CORRECTION)
    assert train.measured and "its meter is taken as good to 2 %" in train.basis
    assert predicted(train, propeller, V, elsewhere_n).value == pytest.approx(truth, rel=0.01)


def test_measured_efficiencies_use_the_true_shaft_power(nexstar, propeller) -> None:
    """If the table's power is 5 % too small, shaft power is table power times the fitted scale."""
    data, low = steady_points(nexstar, propeller), replace_power(propeller, 0.95)
    train = fit_power_train(data, nexstar.propulsion, low, **NO_CORRECTION)
    point, row = train.points[0], data.iloc[0]
    thrust_N, table_W = low.thrust_and_power(row["V"], row["n"], RHO)
    shaft_W = train.parameters.values[0] * table_W
    assert train.parameters.values[0] > 1.01
    assert point.propeller == pytest.approx(thrust_N * row["V"] / shaft_W, rel=1e-6)
    assert point.motor == pytest.approx(shaft_W / row["battery_W"], rel=1e-6)


def test_fast_changes_of_motor_speed_are_left_out(nexstar, propeller) -> None:
    """If motor speed swings by 20 % every 6 s, it changes by less than 4 %/s for less than 3 s at a time."""
    data = steady_points(nexstar, propeller)
    swinging = data.assign(n=data["n"] * (1 + 0.2 * np.sin(np.arange(len(data)) * STEP_S)))
    train = fit_power_train(swinging, nexstar.propulsion, propeller, **NO_CORRECTION)
    assert not train.measured and "Only 0 s" in train.basis


def test_battery_power_is_shaft_power_friction_and_copper_losses() -> None:
    """100 W at 100 rev/s are 0.159 N m, so the sum is 1.1 x 100 + 0.3 x 100 + 500 (0.159 + 0.02)^2 = 156.05 W."""
    parameters = exact(shaft_scale=1.1, friction=0.3, copper=500.0, meter_scale=0.0)
    train = PowerTrainModel(parameters, 0.02, True, "", ())
    battery_W = train.battery_power(np.array([100.0]), np.array([100.0]), parameters.sigma_points())
    assert battery_W[0] == pytest.approx([140 + 500 * (100 / (2 * np.pi * 100) + 0.02) ** 2])


def test_a_meter_that_reads_high_makes_the_fitted_powers_too_large() -> None:
    """A meter reading 2 % high makes a lossless power train seem to draw 2 % more; the table has the true powers."""
    parameters = exact(shaft_scale=1.02, friction=0.0, copper=0.0, meter_scale=0.02)
    train, points = PowerTrainModel(parameters, 0.0, True, "", ()), parameters.sigma_points()
    table_W = np.array([60.0])
    assert train.battery_power(table_W, np.array([100.0]), points)[0] == pytest.approx(table_W)
    assert train.shaft_power(table_W, points)[0] == pytest.approx(table_W)


def test_intervals_cover_as_often_as_they_say(nexstar, propeller) -> None:
    """In 40 flights, table power has an error of 5 % (1 sigma), the meter of 2 %, and noise of 0.5 A lasts 1 s.

    At least 95 % are covered, less 3 standard errors of a share; each flight's 5 points err together and count as one.
    """
    data = steady_points(nexstar, propeller)
    V, n, truth = elsewhere(nexstar, propeller)
    rng = np.random.default_rng(3)
    hits = []
    for _ in range(40):
        table_scale, meter = 1 + 0.05 * rng.standard_normal(), 1 + 0.02 * rng.standard_normal()
        off = replace_power(propeller, 1 / table_scale)
        noise = np.convolve(rng.standard_normal(len(data) + 4), np.ones(5) / np.sqrt(5), mode="valid") * 0.5 * 14
        seen = data.assign(battery_W=data["battery_W"] * meter + noise)
        train = fit_power_train(seen, nexstar.propulsion, off, **NO_CORRECTION)
        result = predicted(train, off, V, n)
        hits.append((result.lo <= truth) & (truth <= result.hi))
    assert np.mean(hits) >= 0.95 - 3 * np.sqrt(0.95 * 0.05 / 40)


def replace_power(propeller, factor):
    """Return the propeller with all power coefficients of its table multiplied by a factor."""
    rows = tuple(replace(row, cP=tuple(factor * c for c in row.cP)) for row in propeller.rows)
    return type(propeller)("off", propeller.diameter_m, rows)


def test_without_battery_data_the_aircraft_file_is_believed_and_that_is_reported(nexstar, propeller) -> None:
    blind = steady_points(nexstar, propeller).assign(battery_W=np.nan)
    train = fit_power_train(blind, nexstar.propulsion, propeller, **NO_CORRECTION)
    assert not train.measured and train.points == ()
    assert "no battery voltage" in train.basis and "560 rpm/V" in train.basis
    shaft_scale, friction, copper, meter_scale = np.sqrt(np.diag(train.parameters.covariance))
    assert (shaft_scale, meter_scale) == pytest.approx((0.05, 0.02)), "docs/use/results.md promises these"
    assert [friction, copper] == pytest.approx(0.5 * train.parameters.values[1:3], abs=0.002)
    V, n, truth = elsewhere(nexstar, propeller)
    result = predicted(train, propeller, V, n)
    assert np.all((result.lo <= truth) & (truth <= result.hi))
    assert result.value == pytest.approx(truth, rel=0.01), "the simulator's motor is the one in the aircraft file"
    measured = fit_power_train(steady_points(nexstar, propeller), nexstar.propulsion, propeller, **NO_CORRECTION)
    assert np.all(result.standard_error > 1.5 * predicted(measured, propeller, V, n).standard_error)


def test_a_few_seconds_are_no_measurement(nexstar, propeller) -> None:
    data = steady_points(nexstar, propeller, seconds=5.0).iloc[:20]
    train = fit_power_train(data, nexstar.propulsion, propeller, **NO_CORRECTION)
    assert not train.measured and "Only" in train.basis
    assert "losses ±50 %, shaft power ±5 %" in train.basis, "must match the settings"


def test_efficiencies_are_means_of_five_seconds_and_a_windmilling_propeller_has_none(nexstar, propeller) -> None:
    data = steady_points(nexstar, propeller)
    train = fit_power_train(data, nexstar.propulsion, propeller, **NO_CORRECTION)
    times = np.array([point.time_s for point in train.points])
    assert len(times) == 20, "four means in each of five points of 20 s"
    assert np.diff(times.reshape(5, 4)) == pytest.approx(5.0, abs=0.5)
    late = np.arange(len(data)) >= len(data) - round(10 / STEP_S)
    windmilling = data.assign(V=data["V"] * np.where(late, 2.0, 1.0))  # in the last 10 s, at the same motor speed
    assert propeller.thrust_and_power(45.0, data["n"].iloc[-1], RHO)[0] < 0
    points = fit_power_train(windmilling, nexstar.propulsion, propeller, **NO_CORRECTION).points
    assert max(point.time_s for point in points) < 80.0, "windmilling must be left out altogether"
