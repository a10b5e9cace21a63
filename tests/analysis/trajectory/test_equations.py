"""Process and measurement equations agree with exact motions and first principles."""

import numpy as np
import pytest
from exact_motion import G, exact_motion

from flightpower.analysis.trajectory import equations
from flightpower.analysis.trajectory.block_means import BlockMeans
from flightpower.analysis.trajectory.equations import (
    MEASUREMENT_INPUTS,
    MEASUREMENTS,
    PROCESS_INPUTS,
    SENSOR_ERRORS,
    STATES,
    EquationInputs,
    NamedArrays,
    flow,
    measurement_model,
)
from flightpower.analysis.trajectory.inertial import InertialInputs
from flightpower.analysis.trajectory.linearized_equations import Equations
from flightpower.analysis.trajectory.priors import BENCH_SIGMA
from flightpower.analysis.trajectory.process import GustConditions, ProcessModel
from flightpower.flight.motion import body_from_earth, flow_of

NO_ERRORS = np.zeros(len(SENSOR_ERRORS))


@pytest.fixture(scope="module")
def exact():
    return exact_motion()


def process_residuals(motion, sensor_errors, table=None) -> dict[str, np.ndarray]:
    """Return the unweighted process residuals (n-1,) of the true states, by name of the state."""
    table, x = motion.table if table is None else table, motion.states
    blocks = BlockMeans(table)
    inertial = InertialInputs(table, blocks, BENCH_SIGMA)
    V = blocks["V_mps"]
    model = ProcessModel(inertial, blocks, GustConditions(blocks, V), 1e-6, V)
    inputs = model.with_corrections(inertial.coning_and_sculling(x[:, :3], sensor_errors))
    inputs[:, PROCESS_INPUTS.index("wind_ratio")] = 1.0  # the wind of this motion is the same at all heights
    nothing, ones = np.zeros((blocks.n, len(MEASUREMENTS))), np.ones((blocks.n, len(MEASUREMENT_INPUTS)))
    weight = np.ones((blocks.n - 1, len(STATES)))
    equation_inputs = EquationInputs(inputs, weight, nothing, nothing, ones, x, ones)
    linearization = Equations(blocks.n).linearize(x, sensor_errors, equation_inputs)
    return dict(
        zip((*STATES[:10], "v_once", "w_once", "v_twice", "w_twice"), linearization.process_residual.T, strict=True)
    )


def test_coning_and_sculling_leave_no_tilt(exact) -> None:
    """Bank and pitch swing in quadrature at half a hertz, in a turn, for a minute.

    Attitude from means of the exact rates over 40 ms stays within 0.01 deg of the truth (heading, which integrates the
    others, within 0.06 deg), and velocity from means of the force within 2.5 mm/s. The trapezoidal rule alone would be
    off by (2.9 0.04)^2/8 of the swing of 29 deg, 0.05 deg, and means over 0.2 s by 10 deg and 1 m/s.
    """
    residuals = process_residuals(exact, NO_ERRORS)
    for name, limit_deg in (("phi", 0.01), ("theta", 0.01), ("psi", 0.06)):
        assert np.degrees(np.abs(np.cumsum(residuals[name]))).max() < limit_deg, name
    for name in ("v_north", "v_east", "v_down"):
        assert np.abs(np.cumsum(residuals[name])).max() < 0.0025, name


def test_height_wind_and_gusts_of_an_exact_motion_have_no_residual(exact) -> None:
    residuals = process_residuals(exact, NO_ERRORS)
    assert np.abs(np.cumsum(residuals["height"])).max() < 0.01  # trapezoidal rule over 0.2 s
    for name in STATES[7:10]:
        assert residuals[name] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("index", range(6))
def test_a_bias_of_an_inertial_sensor_is_taken_out_before_and_within_the_correction(exact, index: int) -> None:
    """A biased channel, with that bias among the sensor errors, gives the residuals of the unbiased channel."""
    name = ("p_radps", "q_radps", "r_radps", "ax_mps2", "ay_mps2", "az_mps2")[index]
    errors = NO_ERRORS.copy()
    errors[index] = 0.3
    biased = process_residuals(exact, errors, exact.table.assign(**{name: exact.table[name] + 0.3}))
    for state, residual in process_residuals(exact, NO_ERRORS).items():
        assert biased[state] == pytest.approx(residual, abs=1e-9), state


def state_of(**values: float) -> NamedArrays:
    return NamedArrays(STATES, [values.get(name, 0.0) for name in STATES])


def errors_of(**values: float) -> NamedArrays:
    return NamedArrays(SENSOR_ERRORS, [values.get(name, 0.0) for name in SENSOR_ERRORS])


def inputs_of(**values: float) -> NamedArrays:
    return NamedArrays(MEASUREMENT_INPUTS, [values.get(name, 0.0) for name in MEASUREMENT_INPUTS])


STEADY = {"phi": 0.2, "theta": 0.15, "psi": 2.0, "v_north": -6.0, "v_east": 13.0, "v_down": -1.0,
          "height": 80.0, "wind_north": 1.0, "wind_east": -2.0}  # fmt: skip


def test_a_gust_changes_the_flow_as_air_that_moves_along_the_body_axes() -> None:
    """To first order, at zero sideslip, airspeed and flow angles are those of velocity minus gust velocity."""
    psi = np.arctan2(15.0, -7.0)
    x = {"theta": 0.2, "psi": psi, "v_north": -6.0, "v_east": 13.0, "v_down": 0.5, "wind_north": 1.0, "wind_east": -2.0}
    u, v, w = body_from_earth((-7.0, 15.0, 0.5), (0.0, 0.2, psi))
    V, alpha, beta = flow_of(u, v, w)
    predicted = inputs_of(V_predicted=V, alpha_predicted=alpha)
    assert abs(beta) < 1e-9
    assert tuple(flow(state_of(**x), predicted)) == pytest.approx((V, alpha, beta), abs=1e-6)
    size = 1e-4
    for gust in np.eye(3):
        exact = np.array(flow_of(*(np.array([u, v, w]) - size * gust)))
        named = dict(zip(("gust_u", "gust_v", "gust_w"), size * gust, strict=True))
        got = np.array(flow(state_of(**x, **named), predicted)) - np.array(flow(state_of(**x), predicted))
        assert got == pytest.approx(exact - (V, alpha, beta), abs=1e-8)


def test_rising_air_changes_the_flow_as_a_descent_through_still_air() -> None:
    """This is to first order, in level flight. In a turn, the rising air comes partly from the side."""
    x = {"theta": 0.05, "phi": 0.6, "v_north": 15.0}
    V, alpha, beta = flow(state_of(**x), inputs_of(V_predicted=15.0))
    rising = flow(state_of(**x), inputs_of(V_predicted=V), 0.01)
    assert rising[1:] == pytest.approx(flow(state_of(**x, v_down=0.01), inputs_of(V_predicted=V))[1:], abs=3e-6)
    assert rising[1] - alpha > 5e-4 and rising[2] - beta > 3e-4


def test_the_mean_square_of_transverse_gusts_has_its_sign_and_size() -> None:
    """Airspeed is smaller by the variance over 2 V."""
    x, V = state_of(v_north=15.0), 15.0
    calm, gusty = (flow(x, inputs_of(V_predicted=V, transverse_gust_variance=variance))[0] for variance in (0.0, 0.5))
    assert gusty - calm == pytest.approx(-0.5 / (2 * V))


@pytest.mark.parametrize("axis", ["v", "w"])
def test_the_increments_of_a_gust_are_those_of_drydens_filters(axis: str) -> None:
    """g = g2 + sqrt3 (g1 - g2), T g2' = g1 - g2. If g1 changes linearly over a step, g2 has no increment and the
    increment of g1 is its change minus the decay, to first order in step/T."""
    step_over_T, once, twice = 1e-3, np.array([0.4, 1.6]), 0.2
    decay = np.exp(-step_over_T)
    end = decay * twice + (1 - decay) * once.mean()  # exact to (step/T)^2

    def state(g1: float, g2: float) -> NamedArrays:
        return state_of(**{f"gust_{axis}": g2 + np.sqrt(3) * (g1 - g2), f"gust_{axis}_filtered_twice": g2})

    inputs = NamedArrays(PROCESS_INPUTS, [decay if name == f"decay_{axis}" else 0.0 for name in PROCESS_INPUTS])
    residuals = list(equations.process_residuals(state(once[0], twice), state(once[1], end), errors_of(), inputs))
    index = STATES.index(f"gust_{axis}"), STATES.index(f"gust_{axis}_filtered_twice")
    assert residuals[index[0]] == pytest.approx(once[1] - decay * once[0])
    assert residuals[index[1]] == pytest.approx(0.0, abs=1e-6)
    assert not np.any(np.delete(residuals, index))


def test_sensor_errors_act_on_pressures() -> None:
    """If dynamic pressure is high by 2 e, airspeed reads high by e and flow angles low by 2 e. A slope of the angle
    acts on the angle at the probe and, through the probe's calibration, on airspeed."""
    V, alpha = 15.0, 0.12
    inputs = inputs_of(V_mean=V, V_predicted=V, alpha_by_slope=alpha, alpha_by_V_scale=-2 * alpha, dlnV_dlndp_alpha=0.1)
    x = state_of(**STEADY)

    def change(**errors: float) -> dict[str, float]:
        before, after = (measurement_model(x, errors_of(**e), inputs) for e in ({}, errors))
        return {n: b - a for n, a, b in zip(MEASUREMENTS, before, after, strict=True) if abs(b - a) > 1e-12}

    assert change(V_scale=0.01) == pytest.approx({"V": (0.01 - 0.1 * 0.02) * V, "alpha": -0.02 * alpha})
    assert change(alpha_scale=0.01) == pytest.approx({"V": 0.1 * 0.01 * V, "alpha": 0.01 * alpha})
    assert change(alpha_bias=0.01) == pytest.approx({"alpha": 0.01})
    assert change(beta_bias=0.01) == pytest.approx({"beta": 0.01})


def test_zeros_of_pressures_are_scale_and_offset_by_dynamic_pressure() -> None:
    """A zero of 1 % of q_c acts as an airspeed scale of 0.5 %; a zero of dp_alpha acts as an offset of the angle."""
    V, alpha, qbar_Pa = 15.0, 0.12, 138.0
    inputs = inputs_of(
        V_mean=V, V_predicted=V, alpha_by_slope=alpha, alpha_by_V_scale=-2 * alpha, dlnV_dlndp_alpha=0.1,
        V_scale_per_Pa=1 / (2 * qbar_Pa), alpha_per_Pa=1 / (4.5 * qbar_Pa),
    )  # fmt: skip
    none, scale, zero, other = (
        np.array(measurement_model(state_of(**STEADY), errors_of(**e), inputs))
        for e in ({}, {"V_scale": 0.005}, {"q_c_zero": 0.01 * qbar_Pa}, {"dp_alpha_zero": 1.0})
    )
    assert zero == pytest.approx(scale, abs=1e-12)
    expected = {name: 0.0 for name in MEASUREMENTS} | {"alpha": 1 / (4.5 * qbar_Pa)}
    assert dict(zip(MEASUREMENTS, other - none, strict=True)) == pytest.approx(expected, abs=1e-12)


def test_a_mean_angle_over_a_block_is_that_in_its_middle_and_the_curvature() -> None:
    """A parabola that is 0.01 rad higher at both ends than in the middle has a mean 0.0033 rad above the middle."""
    x, c = state_of(**STEADY), 0.01 / 3
    straight, curved = (
        measurement_model(x, errors_of(), inputs_of(V_predicted=15.0, alpha_curvature=a)) for a in (0, c)
    )
    change = dict(zip(MEASUREMENTS, np.subtract(curved, straight), strict=True))
    assert change == pytest.approx({name: 0.0 for name in MEASUREMENTS} | {"alpha": c}, abs=1e-12)


def test_late_channels_show_what_was_a_lag_before() -> None:
    """Acceleration is 2 m/s^2 north and 1 m/s^2 down, and airspeed and angles rise, so a late channel reads less."""
    x = state_of(**STEADY)
    ax, ay, az = body_from_earth((2.0, 0.0, 1.0 - G), (STEADY["phi"], STEADY["theta"], STEADY["psi"]))
    bias = {"ax_bias": 0.2, "ay_bias": -0.1, "az_bias": 0.3}
    force = {"ax": ax + 0.2, "ay": ay - 0.1, "az": az + 0.3}
    inputs = inputs_of(V_predicted=15.0, V_rate=2.0, probe_alpha_rate=0.3, probe_beta_rate=0.1, **force)
    before, after = (
        measurement_model(x, errors_of(**bias, air_data_lag=lag, gps_latency=10 * lag), inputs) for lag in (0.0, 0.01)
    )
    late = dict(zip(MEASUREMENTS, np.subtract(after, before), strict=True))
    assert late == pytest.approx(
        {name: 0.0 for name in MEASUREMENTS}
        | {"V": -0.02, "alpha": -0.003, "beta": -0.001, "gps_north": -0.2, "gps_down": -0.1},
        abs=1e-12,
    )
