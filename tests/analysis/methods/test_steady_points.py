"""Means over a steady run give the power, lift and standard error that mechanics and statistics require."""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.analysis.maneuvers.kinds import STEADY, Maneuver
from flightpower.analysis.methods.regression import Tables
from flightpower.analysis.methods.steady_points import (
    SteadyMeans,
    _error_of_mean,
    mean_gust_mps,
    require_speeds,
    steady_means,
    steady_method,
    steady_points,
)
from flightpower.flight.aircraft import Aircraft, load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2 as g

NEXSTAR = load_aircraft("nexstar")
M, AREA = NEXSTAR.mass_kg, NEXSTAR.geometry.wing_area_m2
STEP_S, SECONDS, RHO, SPEED = 0.2, 40.0, 1.1, 15.0
RUN = Maneuver(STEADY, slice(None), 0.0, SECONDS, SPEED, SPEED, 0.0)


def table(**columns) -> Tables:
    """Return a level, steady flight along the body's x axis; `columns` replaces its columns."""
    t = np.arange(0.0, SECONDS + STEP_S / 2, STEP_S)
    still = {
        "thrust_x_over_m_mps2": 1.0, "alpha": 0.0, "V": SPEED, "Vdot": 0.0, "gamma": 0.0, "climb": 0.0, "bank": 0.0,
        "rho": RHO, "static_Pa": 95e3, "temperature_K": 290.0, "gust_mps": 0.0, "gust_s": 1.0,
    }  # fmt: skip
    return Tables(t, {name: np.broadcast_to(x, t.shape) for name, x in (still | columns).items()})


def test_power_is_that_of_thrust_less_the_rates_of_kinetic_and_potential_energy() -> None:
    """Thrust is inclined by alpha, with a climb of 0.3 m/s and an acceleration of 0.01 m/s^2, all constant."""
    t = table().t_s
    V = SPEED + 0.01 * (t - t.mean())
    means = steady_means(table(V=V, Vdot=0.01, climb=0.3, alpha=0.1, thrust_x_over_m_mps2=1.5), [RUN], NEXSTAR)
    expected = M * (1.5 * np.cos(0.1) * SPEED - 0.01 * SPEED - g * 0.3)
    assert means.V == pytest.approx([SPEED]) and means.power_W == pytest.approx([expected])


def test_lift_carries_the_weight_in_a_turn_less_what_thrust_carries() -> None:
    means = steady_means(table(bank=0.5, alpha=0.1), [RUN], NEXSTAR)
    lift_N = M * (g / np.cos(0.5) - 1.0 * np.sin(0.1))
    assert means.lift_N == pytest.approx([lift_N])
    assert means.lift_coefficient(NEXSTAR) == pytest.approx([lift_N / (RHO / 2 * SPEED**2 * AREA)])


def test_the_standard_error_is_that_of_table_gusts_and_scatter() -> None:
    """It is 0.5 % of power for the table alone, and adds slow vertical gusts and the white scatter of drag."""
    power_W = M * SPEED
    exact = steady_means(table(), [RUN], NEXSTAR)
    assert exact.power_error_W == pytest.approx([0.005 * power_W])
    gusty = steady_means(table(gust_mps=0.2, gust_s=3.0), [RUN], NEXSTAR)
    gust_W = M * g * 0.2 * np.sqrt(2 * 3.0 / SECONDS)
    assert gusty.power_error_W == pytest.approx([np.hypot(gust_W, 0.005 * power_W)])
    n = len(table().t_s)
    errors = [
        float(steady_means(table(Vdot=np.random.default_rng(seed).normal(0, 0.3, n)), [RUN], NEXSTAR).power_error_W[0])
        for seed in range(100)
    ]
    scatter_W = np.sqrt(np.mean(np.square(errors)) - (0.005 * power_W) ** 2)
    assert scatter_W == pytest.approx(M * SPEED * 0.3 / np.sqrt(n), rel=0.06)


def test_a_pilot_s_speed_changes_and_climbs_are_no_scatter_of_drag() -> None:
    """If thrust exactly makes up for them, the point is as certain as one without, wherever the log's time begins."""
    wave = np.sin(np.arange(len(table().t_s)) / 9.0)
    flown = table(Vdot=0.3 * wave, gamma=0.02 * wave, thrust_x_over_m_mps2=1.0 + 0.3 * wave + g * np.sin(0.02 * wave))
    flown = replace(flown, t_s=flown.t_s + 500.0)
    late = Maneuver(STEADY, slice(None), 500.0, 500.0 + SECONDS, SPEED, SPEED, 0.0)
    means = steady_means(flown, [late], NEXSTAR)
    assert means.power_error_W == pytest.approx(0.005 * means.power_W)
    scattered = table(thrust_x_over_m_mps2=1.0 + 0.3 * wave)
    before = steady_means(scattered, [RUN], NEXSTAR).power_error_W
    scattered = replace(scattered, t_s=scattered.t_s + 500.0)
    assert steady_means(scattered, [late], NEXSTAR).power_error_W == pytest.approx(before)


def test_a_mean_over_less_than_twice_the_time_constant_scatters_as_the_gust_itself() -> None:
    assert mean_gust_mps(0.4, 5.0, 8.0) == pytest.approx(0.4)
    assert mean_gust_mps(0.4, 5.0, 40.0) == pytest.approx(0.2)


def test_coefficients_are_power_over_that_of_unit_drag_coefficient() -> None:
    (point,) = steady_points(table(), [RUN], NEXSTAR)
    unit_W = RHO / 2 * SPEED**3 * AREA
    assert tuple(point) == pytest.approx(
        (M * g / (RHO / 2 * SPEED**2 * AREA), M * SPEED / unit_W, 0.005 * M * SPEED / unit_W, 0.0)
    )


def test_speeds_less_than_8_per_cent_apart_are_one_and_power_must_be_positive() -> None:
    def points(*speeds: float, thrust: float = 1.0):
        columns = [steady_means(table(V=V, thrust_x_over_m_mps2=thrust), [RUN], NEXSTAR) for V in speeds]
        return type(columns[0])(*(np.concatenate(x) for x in zip(*columns, strict=True)))

    require_speeds(points(16.3, 15.0), 2)
    with pytest.raises(InputError, match="2 different speeds are needed, there are 1"):
        require_speeds(points(15.0, 16.1), 2)
    with pytest.raises(InputError, match="no positive power"):
        require_speeds(points(15.0, 20.0, thrust=-0.1), 2)


def test_a_run_with_fewer_than_ten_thrust_values_is_no_point() -> None:
    thrust = np.full(len(table().t_s), np.nan)
    thrust[20:30] = 1.0
    assert steady_means(table(thrust_x_over_m_mps2=thrust), [RUN], NEXSTAR).power_W == pytest.approx([M * SPEED])
    thrust[29] = np.nan
    with pytest.raises(InputError, match="no steady point has thrust data"):
        steady_means(table(thrust_x_over_m_mps2=thrust), [RUN], NEXSTAR)


@pytest.mark.parametrize("n", [5, 40])
def test_the_error_of_a_mean_adds_the_correlations_of_two_seconds(n: int) -> None:
    """Bartlett's weights fall to zero just beyond ten readings, or beyond the end of a shorter record."""
    x = np.random.default_rng(2).normal(0, 1, n).cumsum()
    e, window = x - x.mean(), min(n - 1, 10)
    sums = [sum(e[i] * e[i + k] for i in range(n - k)) for k in range(window + 1)]
    variance = (sums[0] + 2 * sum((1 - k / (window + 1)) * sums[k] for k in range(1, window + 1))) / n
    assert _error_of_mean(x, STEP_S) == pytest.approx(np.sqrt(variance / n))


def test_the_error_of_what_is_regressed_is_as_large_a_share_as_that_of_power() -> None:
    seen: list[SteadyMeans] = []

    def drag(points: SteadyMeans, aircraft: Aircraft) -> tuple[np.ndarray, np.ndarray]:
        seen.append(points)
        return np.ones((len(points.V), 3)), points.power_W / points.V

    method = steady_method("test", "test", "", np.array([[1.0], [0.0], [0.0]]), drag)
    noisy = 1.0 + np.random.default_rng(0).normal(0, 0.1, len(table().t_s))
    assert method.regression is not None
    regression = method.regression(table(thrust_x_over_m_mps2=noisy), [RUN], NEXSTAR)
    assert regression.sigma / regression.z == pytest.approx(seen[0].power_error_W / seen[0].power_W)
    assert (regression.sigma > 0).all()
