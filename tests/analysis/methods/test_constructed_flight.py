"""Tests forces, the methods' table and estimates on a flight in exact balance, with one error at a time."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from constructed import (
    AIRCRAFT,
    BLOCK,
    PROPELLER,
    STEP_S,
    W,
    accelerations_and_decelerations,
    measured,
    polar,
    same_everywhere,
)

from flightpower.analysis.curve import Condition, Polar, power_required
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods.causes import CAUSES, error_prior_sigma, estimate_errors
from flightpower.analysis.methods.consider import DENSITY
from flightpower.analysis.methods.dynamic import estimate_polar
from flightpower.analysis.methods.forces import FlightForces
from flightpower.analysis.methods.method import estimate_with, input_tables, method_inputs, path_along
from flightpower.analysis.methods.methods import ALL_METHODS
from flightpower.analysis.trajectory.block_means import BlockMeans
from flightpower.analysis.trajectory.dryden import GaussMarkov
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.aerodynamics import lift_slope, stability_axes
from flightpower.flight.aircraft import Aircraft, Uncertainty
from flightpower.flight.units import GRAVITY_MPS2 as g

AT = Condition(W, 1.15, AIRCRAFT.geometry.wing_area_m2)
V = np.array([12.0, 14.0, 17.0, 20.0, 22.5])
STILL_AIR = GaussMarkov(0.0, 1.0)


def power(A: np.ndarray) -> np.ndarray:
    return power_required(V, Polar(A, np.zeros((3, 3))), AT)[0]


@pytest.mark.parametrize("gamma", [0.0, 0.03])
def test_forces_along_an_exact_trajectory_are_those_flown(gamma: float) -> None:
    f, _ = accelerations_and_decelerations(gamma)
    trajectory = measured(f, ax_bias=0.2)
    forces = FlightForces(trajectory, AIRCRAFT, PROPELLER).forces(
        trajectory.states.to_numpy(), trajectory.sensor_errors
    )
    A = polar()
    assert forces["CD"].to_numpy() == pytest.approx((A[0] + A[1] * forces["CL"] + A[2] * forces["CL"] ** 2), rel=1e-4)
    for name in ("V", "alpha", "gamma", "climb", "Vdot", "qS_over_m_mps2"):
        assert forces[name].to_numpy() == pytest.approx(f[name].to_numpy(), rel=1e-4, abs=1e-6), name
    along_V = f["thrust_x_over_m_mps2"] * np.cos(f["alpha"])
    assert forces["thrust_along_V_over_m_mps2"].to_numpy() == pytest.approx(along_V.to_numpy(), rel=1e-4)


def test_a_downdraft_is_a_climb_through_the_air() -> None:
    """The aircraft flies level over the ground in a downdraft of 0.5 m/s."""
    f, _ = accelerations_and_decelerations()
    trajectory = measured(f)
    states = trajectory.states.assign(gust_w=0.5).to_numpy()
    forces = FlightForces(trajectory, AIRCRAFT, PROPELLER).forces(states, trajectory.sensor_errors)
    assert (np.sin(forces["gamma"]) * forces["V"]).to_numpy() == pytest.approx(np.full(len(f), 0.5), rel=1e-6)


@pytest.mark.parametrize(("scale", "slope"), [(0.03, 0.0), (-0.03, 0.0), (0.0, 0.2), (0.0, -0.2)])
def test_dynamic_method_finds_polar_and_thrust_of_a_propeller_unlike_its_table(scale: float, slope: float) -> None:
    """Thrust is table thrust times 1 + scale + slope (J - 0.5); specific force shows the difference as drag.

    Scale is found to 0.002 and slope to 0.01, no better because lift coefficients keep the table's T sin(alpha).
    """
    f, runs = accelerations_and_decelerations()
    trajectory = measured(f, scale, slope)
    result = estimate_polar(trajectory, runs, AIRCRAFT, PROPELLER)
    assert result.values[3] == pytest.approx(scale, abs=0.002)
    assert result.values[4] == pytest.approx(slope, abs=0.01)
    assert power(result.polar.A) == pytest.approx(power(polar()), rel=0.002)


@pytest.mark.parametrize(("scale", "slope"), [(0.03, 0.0), (0.0, -0.2)])
def test_sensor_errors_contain_scale_and_slope_of_thrust(scale: float, slope: float) -> None:
    f, _ = accelerations_and_decelerations()
    trajectory = measured(f, scale, slope)
    flight_forces = FlightForces(trajectory, AIRCRAFT, PROPELLER)
    errors = estimate_errors(flight_forces, trajectory, np.ones(len(f), dtype=bool))
    assert errors["thrust_scale"].value == pytest.approx(scale, abs=0.002)
    assert errors["thrust_slope"].value == pytest.approx(slope, abs=0.01)


def test_the_tight_prior_of_the_lag_is_replaced_by_one_of_0_3_s() -> None:
    """A reading of 0.2 s +- 0.01 s gives 0.2 s x 0.3^2/(0.3^2 + 0.01^2), whatever the trajectory's prior was."""
    f, _ = accelerations_and_decelerations()
    trajectory = measured(f)
    i, prior, reading = SENSOR_ERRORS.index("air_data_lag"), 0.012, 0.01
    variance = 1 / (1 / prior**2 + 1 / reading**2)
    values, C, priors = trajectory.sensor_errors.copy(), trajectory.covariance.copy(), trajectory.prior_sigma.copy()
    values[i], C[i, i], priors[i] = variance / reading**2 * 0.2, variance, prior
    tight = replace(trajectory, sensor_errors=values, covariance=C, prior_sigma=priors)
    flight_forces = FlightForces(tight, AIRCRAFT, PROPELLER)
    lag = estimate_errors(flight_forces, tight, np.ones(len(f), dtype=bool))["lag"]
    assert lag.value == pytest.approx(0.2 * 0.3**2 / (0.3**2 + reading**2), rel=1e-6)
    assert lag.standard_error == pytest.approx(0.3 * reading / np.hypot(0.3, reading), rel=1e-6)


def test_an_accelerometer_that_reads_high_levels_the_pitch_attitude_too_high() -> None:
    """At rest ax = g sin(theta), so a bias of 0.2 m/s^2 looks like a pitch of 0.2/g."""
    f, _ = accelerations_and_decelerations()
    trajectory = measured(f, ax_bias=0.2)
    flight_forces = FlightForces(trajectory, AIRCRAFT, PROPELLER)
    errors = estimate_errors(flight_forces, trajectory, np.ones(len(f), dtype=bool))
    assert errors["pitch"].value == pytest.approx(0.2 / g, rel=1e-6)


def inputs(trajectory: Trajectory, **removed: float) -> pd.DataFrame:
    flight_forces = FlightForces(trajectory, AIRCRAFT, PROPELLER)
    return table_of(flight_forces, flight_forces.nominal, removed)


def table_of(flight_forces: FlightForces, forces: pd.DataFrame, removed: Mapping[str, float] = {}) -> pd.DataFrame:
    """Return the methods' table in still air for all rows of a flight."""
    rows = np.arange(len(forces))
    path = path_along(flight_forces, forces, flight_forces.trajectory.sensor_errors, rows)
    table = input_tables(flight_forces, [path], [removed], (STILL_AIR, STILL_AIR)).first()
    return pd.DataFrame(table.columns, index=table.t_s)


def wrong(name: str, value: float) -> tuple[pd.DataFrame, Trajectory]:
    """Return the table without errors, and a trajectory whose measurements have one error."""
    f, _ = accelerations_and_decelerations(0.03)
    thrust = {key: value for key in ("scale", "slope") if name == f"thrust_{key}"}
    trajectory = measured(f, **thrust, **({"ax_bias": value * g} if name == "pitch" else {}))
    mean = trajectory.block_means.means
    late = {c: np.gradient(f[c], STEP_S) for c in ("V", "alpha", "height_measured")}
    if name == "alpha_bias":
        mean["alpha_rad"] += value
    elif name == "alpha_scale":
        mean["alpha_rad"] *= 1 + value
    elif name == "airspeed_scale":
        mean["V_mps"] *= 1 + value
    elif name == "lag":
        mean["V_mps"] -= value * late["V"]
        mean["alpha_rad"] -= value * late["alpha"]
        mean["height_m"] -= value * late["height_measured"]
    return f, trajectory


@pytest.mark.parametrize(
    ("name", "value", "shown_by"),
    [
        ("alpha_bias", 0.02, ["alpha_measured"]),
        ("alpha_scale", 0.05, ["alpha_measured"]),
        ("pitch", 0.02, ["theta_measured"]),
        ("airspeed_scale", 0.03, ["V_measured", "qS_over_m_measured_mps2", "thrust_x_over_m_measured_mps2"]),
        ("lag", 0.1, ["alpha_measured", "V_measured", "height_measured", "qS_over_m_lagged_mps2",
                      "thrust_x_over_m_lagged_mps2"]),
        ("thrust_scale", 0.03, ["thrust_x_over_m_mps2", "thrust_x_over_m_measured_mps2"]),
        ("thrust_slope", 0.2, ["thrust_x_over_m_mps2", "thrust_x_over_m_measured_mps2"]),
    ],
)  # fmt: skip
def test_an_error_taken_as_measured_shows_and_its_removal_restores_the_truth(name, value, shown_by) -> None:
    f, trajectory = wrong(name, value)
    f = f.assign(qS_over_m_lagged_mps2=f["qS_over_m_mps2"], thrust_x_over_m_lagged_mps2=f["thrust_x_over_m_mps2"])
    with_error, removed = inputs(trajectory), inputs(trajectory, **{name: value})
    bound = 0.01 * value if name == "alpha_scale" else 0.1 * value  # second-order terms: value^2 and value x rate^2
    for column in shown_by:
        size = np.abs(f[column]).max()
        assert np.abs(removed[column] - f[column]).max() < 0.2 * np.abs(with_error[column] - f[column]).max(), column
        assert np.abs(removed[column] - f[column]).max() < bound * size, column


def test_the_scale_of_airspeed_in_flow_angles_is_removed() -> None:
    """An airspeed 3 % high means a dynamic pressure 6 % high. Flow angles are divided by it, so they read 6 % low."""
    f, _ = accelerations_and_decelerations()
    trajectory = measured(f, V_scale=0.03)
    mean = trajectory.block_means.means
    mean["alpha_rad"] *= 1 - 2 * 0.03
    mean["V_mps"] *= 1.03
    result = inputs(trajectory)
    assert result["alpha_measured"].to_numpy() == pytest.approx(f["alpha"].to_numpy(), abs=1e-6)
    assert result["qS_over_m_lagged_mps2"].to_numpy() == pytest.approx(f["qS_over_m_mps2"].to_numpy(), rel=1e-6)
    assert result["V_measured"].to_numpy() == pytest.approx(1.03 * f["V"].to_numpy(), rel=1e-6)


def test_a_biased_accelerometer_levels_a_steep_attitude_more() -> None:
    """At rest ax = g sin(theta): at 50 deg of pitch, a bias b changes the angle by b/(g cos 50 deg).

    Removing the known part of the bias from the table leaves only the error of the rest.
    """
    f, _ = accelerations_and_decelerations()
    trajectory = measured(f, ax_bias=0.2)
    forces = FlightForces(trajectory, AIRCRAFT, PROPELLER)
    steep = forces.nominal.assign(theta=np.radians(50.0))
    for removed, left in (({}, 0.2), ({"pitch": 0.15 / g}, 0.05)):
        table = table_of(forces, steep, removed)
        assert table["theta_measured"].to_numpy() == pytest.approx(
            np.full(len(f), np.radians(50.0) + left / (g * np.cos(np.radians(50.0)))), rel=1e-9
        )
        assert table["ax"].to_numpy() == pytest.approx(f["ax"].to_numpy(), rel=1e-9)


def weighed_within(fraction: float) -> Aircraft:
    """Return the aircraft with this standard deviation of its weight, as a fraction."""
    return replace(AIRCRAFT, uncertainty=Uncertainty(weight_fraction=fraction))


def test_a_wrong_weight_changes_power_by_what_the_interval_has_for_it() -> None:
    """If the stated weight is 1 % too large, the flight gives the curve of the heavier aircraft."""
    f, runs = accelerations_and_decelerations()
    trajectory = measured(f)
    exact, unsure = (estimate_polar(trajectory, runs, weighed_within(x), PROPELLER) for x in (0.0, 0.01))
    heavier = estimate_polar(trajectory, runs, AIRCRAFT.weighing(1.01 * W), PROPELLER)
    at_its_weight, _ = power_required(V, heavier.polar, AT._replace(weight_N=1.01 * W))
    added = Polar(polar(), (unsure.systematic - exact.systematic)[:3, :3])
    assert power_required(V, added, AT)[1] == pytest.approx(np.abs(at_its_weight - power(exact.polar.A)), rel=1e-6)
    assert np.array_equal(unsure.values, exact.values)


def test_the_floor_is_a_direction_of_lift_known_to_0_02_deg() -> None:
    """It is W V tan(0.02 deg) of power at every speed, also for methods that take measurements as they are."""
    lift_direction_W = W * V * np.tan(np.radians(0.02))
    assert power_required(V, Polar(polar(), covariance.floor()), AT)[1] == pytest.approx(lift_direction_W, rel=1e-9)
    f, runs = accelerations_and_decelerations()
    same = same_everywhere(f, runs)
    for method in (item for item in ALL_METHODS if item.name in ("direct-speed", "energy")):
        systematic = Polar(polar(), estimate_with(method, same).systematic)
        assert power_required(V, systematic, AT)[1] == pytest.approx(lift_direction_W, rel=1e-9), method.name


def test_lift_that_gusts_tilt_within_a_block_is_drag() -> None:
    """Within each block, the angle of attack rises and falls by 0.6 deg and lift with it: CD and CL^2 are means over
    samples. Vibration of the accelerometer also enters the correction for upwash, and CD does not change."""
    f, _ = accelerations_and_decelerations()
    trajectory = measured(f)
    forces = FlightForces(trajectory, AIRCRAFT, PROPELLER).nominal
    pattern = np.tile([1.0, -1.0, 0.0, -1.0, 1.0], len(f))
    gust_rad = 0.01 * pattern
    by_gust = np.repeat(forces["qS_over_m_mps2"].to_numpy(), BLOCK) * lift_slope(AIRCRAFT.aspect_ratio) * gust_rad
    steady = trajectory.block_means._table
    upwash = AIRCRAFT.probe.upwash_per_CL_rad
    table = steady.assign(
        alpha_rad=steady["alpha_rad"] + gust_rad,
        alpha_by_upwash_rad=upwash * lift_slope(AIRCRAFT.aspect_ratio) * gust_rad,
        az_mps2=steady["az_mps2"] - by_gust,
    )
    results = FlightForces(replace(trajectory, block_means=BlockMeans(table)), AIRCRAFT, PROPELLER).nominal

    qS = np.repeat(forces["qS_over_m_mps2"].to_numpy(), BLOCK)
    along_V = np.repeat(forces["thrust_along_V_over_m_mps2"].to_numpy(), BLOCK) / np.cos(steady["alpha_rad"])
    sample_CL, sample_CD = stability_axes((table["ax_mps2"] - along_V) / qS, table["az_mps2"] / qS, table["alpha_rad"])
    assert results["CD"].to_numpy() == pytest.approx(np.asarray(sample_CD).reshape(-1, BLOCK).mean(axis=1), rel=2e-4)
    assert np.all(results["CD"] - forces["CD"] > 3e-4)
    of_gusts = FlightForces(replace(trajectory, block_means=BlockMeans(table)), AIRCRAFT, PROPELLER)
    f = table_of(of_gusts, of_gusts.nominal)
    drag_over_m = (f["thrust_x_over_m_mps2"] - f["ax"]) * np.cos(f["alpha"]) - f["az"] * np.sin(f["alpha"])
    assert drag_over_m.to_numpy() == pytest.approx((results["CD"] * results["qS_over_m_mps2"]).to_numpy(), rel=1e-6)

    # If each sample lies on a polar, the fit recovers that polar.
    A = polar()
    lacks = (A @ [1 + 0 * sample_CL, sample_CL, sample_CL**2] - sample_CD) * qS
    flown = table.assign(ax_mps2=table["ax_mps2"] - lacks / np.cos(table["alpha_rad"]))
    runs = accelerations_and_decelerations()[1]
    result = estimate_polar(replace(trajectory, block_means=BlockMeans(flown)), runs, AIRCRAFT, PROPELLER)
    assert power(result.polar.A) == pytest.approx(power(A), rel=1e-3)

    vibration_mps2 = 1.5 * np.tile([0.0, 1.0, 0.0, -1.0, 0.0], len(f))
    by_vibration = -upwash * vibration_mps2 / qS
    shaken = table.assign(
        az_mps2=table["az_mps2"] + vibration_mps2,
        alpha_rad=table["alpha_rad"] - by_vibration,
        alpha_by_upwash_rad=table["alpha_by_upwash_rad"] + by_vibration,
    )
    of_shaken = FlightForces(replace(trajectory, block_means=BlockMeans(shaken)), AIRCRAFT, PROPELLER).nominal
    assert of_shaken["CD"].to_numpy() == pytest.approx(results["CD"].to_numpy(), rel=1e-9)
    of_square = np.asarray(sample_CL**2).reshape(-1, BLOCK).mean(axis=1)
    assert results["CL_squared"].to_numpy() == pytest.approx(of_square, rel=1e-3)
    assert np.all(results["CL_squared"] - results["CL"] ** 2 > 1e-3)


def test_drag_with_a_quartic_term_is_a_doubt_and_the_interval_covers_it() -> None:
    """C_D rises by 0.02 C_L^4, 10 % at the slowest speed. A warning says so, and the interval contains the truth."""
    f, runs = accelerations_and_decelerations()
    forces = FlightForces(measured(f), AIRCRAFT, PROPELLER).forces(
        measured(f).states.to_numpy(), np.zeros(len(SENSOR_ERRORS))
    )
    more = 0.02 * forces["CL"] ** 4
    extra = f["qS_over_m_mps2"] * more
    alpha = f["alpha"]
    trajectory = measured(f.assign(ax=f["ax"] - extra * np.cos(alpha), az=f["az"] - extra * np.sin(alpha)))
    result = estimate_polar(trajectory, runs, AIRCRAFT, PROPELLER)
    (warning,) = (warning for warning in result.warnings if "Drag is no parabola" in warning)
    assert float(warning.partition("a quartic term is ")[2].split(" times")[0]) > 3, "too small for a warning"
    results, error = power_required(V, result.polar, AT)
    CL = 2 * W / (AT.rho * V**2 * AT.wing_area_m2)
    true = power(polar()) + AT.rho * V**3 * AT.wing_area_m2 / 2 * 0.02 * CL**4
    assert np.all(np.abs(results - true) < 1.96 * error + 0.003 * true)
    assert np.all(error < 0.1 * true), "the interval is wider, but only by the change due to the term"
    assert not estimate_polar(measured(f), runs, AIRCRAFT, PROPELLER).warnings


def test_a_propeller_far_from_its_table_is_a_doubt() -> None:
    """Thrust 9 % above the table, five prior standard deviations, gives a warning; 3 % does not."""
    f, runs = accelerations_and_decelerations()
    for scale, named in ((0.09, True), (0.03, False)):
        warnings = estimate_polar(measured(f, scale), runs, AIRCRAFT, PROPELLER).warnings
        assert any("thrust differs from its table" in warning for warning in warnings) is named


def test_the_interval_contains_the_updrafts_that_differ_from_run_to_run() -> None:
    """Air that rises at w saves the power W w at every speed."""
    f, runs = accelerations_and_decelerations()
    trajectory = measured(f)
    aircraft = replace(AIRCRAFT, uncertainty=Uncertainty(weight_fraction=0))
    for w in (0.004, 1.0):
        result = estimate_polar(replace(trajectory, eddies_mps=w), runs, aircraft, PROPELLER)
        systematic = Polar(polar(), result.systematic[:3, :3])
        assert power_required(V, systematic, AT)[1] == pytest.approx(np.full(len(V), W * w), rel=0.02)
        assert np.all(power_required(V, result.polar, AT)[1] > 0.98 * W * w)


def test_a_density_that_is_too_high_looks_like_thrust_and_airspeed_and_leaves_the_power() -> None:
    """The density is 2 % too high and airspeeds are right. Power is equal; polar and thrust change as predicted."""
    f, runs = accelerations_and_decelerations()
    aircraft = replace(AIRCRAFT, uncertainty=replace(AIRCRAFT.uncertainty, air_density_fraction=0.02))
    right, trajectory = estimate_polar(measured(f), runs, aircraft, PROPELLER), measured(f)
    trajectory.block_means.means["rho"] = 1.02 * trajectory.block_means["rho"]
    wrong = estimate_polar(trajectory, runs, aircraft, PROPELLER)
    assert right.joint is not None
    change = dict(zip(right.joint.names, right.joint.parameters.shared[DENSITY], strict=True))
    assert wrong.values - right.values == pytest.approx([change[name] for name in right.joint.names[:5]], rel=1e-3)
    assert change["thrust_scale"] == pytest.approx(-0.02, abs=0.001), "the true thrust is unchanged"
    assert change["V_scale"] == pytest.approx(-0.01), "V = sqrt(2 q / rho)"
    there = power_required(V, wrong.polar, AT._replace(rho=1.02 * AT.rho))[0]
    assert there == pytest.approx(power(right.values[:3]), rel=0.002)


@pytest.mark.parametrize(
    ("method", "name", "value"),
    [
        ("direct", "alpha_bias", 0.02),
        ("direct-speed", "pitch", 0.02),
        ("energy", "airspeed_scale", 0.03),
        ("accelerations", "lag", 0.1),
        ("decelerations", "lag", 0.1),
        ("direct", "thrust_scale", 0.03),
    ],
)
def test_a_method_s_sensitivity_predicts_the_error_of_its_power(method: str, name: str, value: float) -> None:
    """The estimate from wrong data plus sensitivity times the error is the true polar, up to second-order terms."""
    f, trajectory = wrong(name, value)
    _, runs = accelerations_and_decelerations()
    flight_forces = FlightForces(trajectory, AIRCRAFT, PROPELLER)
    errors = estimate_errors(flight_forces, trajectory, np.ones(len(f), dtype=bool))
    errors[name] = errors[name]._replace(value=value)
    (chosen,) = (item for item in ALL_METHODS if item.name == method)
    result = estimate_with(chosen, method_inputs(flight_forces, trajectory, runs, errors))
    assert result.polar is not None
    (cause,) = (cause for cause, names in CAUSES.items() if name in names)
    wrong_by = power(result.polar.A) - power(polar())
    assert np.abs(wrong_by / power(polar())).max() > 0.005, "the error is too small for a meaningful test"
    second_order = 0.3 * np.abs(wrong_by).max()
    corrected = power(result.polar.A + value * result.sensitivities[name])
    assert np.abs(corrected - power(polar())).max() < second_order
    assert power(result.cause_effects[cause]) == pytest.approx(wrong_by, abs=second_order)


FACTORS = {  # factor on the default standard deviation, and the name of the error
    "angle_of_attack_offset_rad": (2.0, "alpha_bias"),
    "angle_of_attack_slope_fraction": (2.2, "alpha_scale"),
    "airspeed_scale_fraction": (1.5, "airspeed_scale"),
    "air_data_lag_s": (1.7, "lag"),
    "accelerometer_offset_mps2": (1.3, "pitch"),
    "thrust_scale_fraction": (1.9, "thrust_scale"),
    "thrust_slope": (1.4, "thrust_slope"),
}


def test_a_method_s_interval_contains_the_errors_that_the_aircraft_file_states() -> None:
    """Where methods use measured quantities directly, systematic errors are sensitivities times stated sizes."""
    f, runs = accelerations_and_decelerations()
    trajectory = measured(f)
    sizes = {key: factor * getattr(Uncertainty(), key) for key, (factor, _) in FACTORS.items()}
    inputs = []
    for uncertainty in (Uncertainty(), replace(Uncertainty(), **sizes)):
        flight_forces = FlightForces(trajectory, replace(AIRCRAFT, uncertainty=uncertainty), PROPELLER)
        errors = estimate_errors(flight_forces, trajectory, np.ones(len(f), dtype=bool))
        inputs.append(method_inputs(flight_forces, trajectory, runs, errors))
    factors = {error: factor for factor, error in FACTORS.values()}
    for method in (item for item in ALL_METHODS if item.name in ("direct", "direct-speed", "energy", "accelerations")):
        default, uncertainty = (estimate_with(method, inputs) for inputs in inputs)
        parts = {
            error: factors[error] ** 2 * np.outer(s, s) * error_prior_sigma(Uncertainty())[error] ** 2
            for error, s in default.sensitivities.items()
        }
        expected = Polar(polar(), covariance.floor() + sum(parts.values()))
        error = power_required(V, Polar(polar(), uncertainty.systematic), AT)[1]
        assert error == pytest.approx(power_required(V, expected, AT)[1], rel=0.03), method.name


@pytest.mark.parametrize(("key", "name"), [("thrust_scale_fraction", "thrust_scale"), ("thrust_slope", "thrust_slope")])
def test_twice_the_stated_error_of_thrust_widens_the_interval(key: str, name: str) -> None:
    """A single noisy deceleration determines thrust poorly, so the prior matters."""
    f, runs = accelerations_and_decelerations()
    noise = 0.3 * np.random.default_rng(0).standard_normal(len(f))
    trajectory = measured(f.assign(ax=f["ax"] + noise))
    polars = []
    for factor in (1.0, 2.0):
        uncertainty = replace(Uncertainty(), **{key: factor * getattr(Uncertainty(), key)})
        polars.append(estimate_polar(trajectory, runs[1:2], replace(AIRCRAFT, uncertainty=uncertainty), PROPELLER))
    i = 3 + ("thrust_scale", "thrust_slope").index(name)
    before, after = (np.sqrt((polar.noise + polar.systematic)[i, i]) for polar in polars)
    assert after > 1.3 * before
    assert [polar.joint.prior_sigma[i] for polar in polars] == pytest.approx(
        getattr(Uncertainty(), key) * np.array([1, 2])
    )
    assert np.all(power_required(V, polars[1].polar, AT)[1] > power_required(V, polars[0].polar, AT)[1])
