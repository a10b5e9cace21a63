"""The balance of forces along the path: polar, thrust and sensor errors in one posterior."""

import numpy as np
import pytest

from analysis.maneuvers.kinds import Maneuver
from analysis.methods.force_balance import Balance, ForceBalance, posterior, windows

G_MPS2, LOADING = 9.8, 81.0  # weight over mass; weight over rho S / 2 [m^2/s^2]
A = np.array([0.045, -0.02, 0.065])
THRUST = ("thrust_scale", "thrust_slope", "thrust_beyond")
SIGMA = np.array([0.018, 0.15, 1.0])
RUNS, PER_RUN = 6, 20  # seconds in windows of one


def balance(
    rng: np.random.Generator, *, path: float = 0.0, thrust: float = 0.0, white: float = 0.01, colored: float = 0.0
) -> Balance:
    """Accelerations and decelerations in turns. path: of the only direction of the sensor errors, an angle of attack
    0.2 deg off, which acts as lift times that; thrust: the table's error. white, colored [m/s^2]: noise over 4 s."""
    t = np.arange(RUNS * PER_RUN, dtype=float)
    run = np.repeat(np.arange(RUNS), PER_RUN)
    share = (t % PER_RUN) / (PER_RUN - 1)
    V = 12.0 + 14.0 * np.where(run % 2 == 0, share, 1 - share)
    q = G_MPS2 * V**2 / LOADING
    CL = LOADING / V**2
    X = np.column_stack([q, q * CL, q * CL**2])
    along = np.where(run % 2 == 0, X @ A + 0.7, 0.2)
    J = V / 26.0
    columns = -np.column_stack([along, along * (J - 0.5), np.zeros_like(t)])
    by_angle = (q * CL * np.radians(0.2))[:, None]
    noise = white * rng.normal(size=len(t))
    for i in range(RUNS):
        x = 0.0
        for k in np.flatnonzero(run == i):
            x = np.exp(-1 / 4) * x + np.sqrt(1 - np.exp(-1 / 2)) * rng.normal()
            noise[k] += colored * x
    Y = X @ A + columns[:, 0] * thrust + by_angle[:, 0] * path + noise
    by_states = np.zeros((len(t), len(t)))
    return Balance(Y, X, columns, by_angle, by_states, t, run, THRUST, np.diag(SIGMA**-2.0), np.zeros(3))


def at_speeds(values: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Drag over mass at three speeds, and its standard error."""
    V = np.array([13.0, 18.0, 24.0])
    q, CL = G_MPS2 * V**2 / LOADING, LOADING / V**2
    rows = np.column_stack([q, q * CL, q * CL**2])
    return rows @ values[:3], np.sqrt(np.einsum("ij,jk,ik->i", rows, covariance[:3, :3], rows))


def solved(one: Balance, *, considered: bool = False) -> ForceBalance:
    return posterior(one, np.zeros(1), np.array([[np.radians(0.2)]]), considered=considered)


def test_polar_and_thrust_are_found_where_nothing_else_is_wrong() -> None:
    found = solved(balance(np.random.default_rng(0), thrust=0.02, white=1e-4))
    assert found.value("thrust_scale") == pytest.approx(0.02, abs=0.003)
    true, _ = at_speeds(A, np.zeros((6, 6)))
    assert at_speeds(found.values, found.covariance)[0] == pytest.approx(true, rel=0.01)
    assert found.unexplained.white_mps2 < 1e-3


@pytest.mark.parametrize("seed", range(3))
def test_an_error_of_the_path_is_not_taken_for_one_of_thrust(seed: int) -> None:
    """Where the data tell them apart. A direction of lift is a C_D in proportion to C_L, which only A1 is: it stays in
    the interval, and thrust is left alone."""
    found = solved(balance(np.random.default_rng(seed), path=3.0))
    assert abs(found.value("thrust_scale")) < 3 * found.standard_error("thrust_scale") < 3 * SIGMA[0]
    (moved,) = found.sensor_errors
    assert abs(moved) < np.radians(0.2)
    true, _ = at_speeds(A, np.zeros((6, 6)))
    drag, error = at_speeds(found.values, found.covariance)
    assert np.all(np.abs(drag - true) < 3.5 * error)


@pytest.mark.parametrize("considered", [False, True])
@pytest.mark.parametrize("colored", [0.0, 0.05])
def test_intervals_cover_with_white_and_with_colored_noise(colored: float, considered: bool) -> None:
    """Of 25 flights whose path, thrust and noise are drawn from what is assumed, 95 % intervals cover 84 to 100 %."""
    inside = []
    true, _ = at_speeds(A, np.zeros((6, 6)))
    for seed in range(25):
        rng = np.random.default_rng(seed)
        one = balance(rng, path=rng.normal(), thrust=SIGMA[0] * rng.normal(), colored=colored)
        found = solved(one, considered=considered)
        drag, error = at_speeds(found.values, found.covariance)
        inside.append(np.abs(drag - true) < 1.96 * error)
    assert 0.84 <= np.mean(inside) <= 1.0


def test_colored_noise_is_found_with_its_size_and_duration() -> None:
    sizes, times = [], []
    for seed in range(8):
        unexplained = solved(balance(np.random.default_rng(seed), white=0.01, colored=0.06)).unexplained
        sizes.append(unexplained.correlated_mps2)
        times.append(unexplained.time_s)
    assert np.median(sizes) == pytest.approx(0.06, rel=0.3)
    assert 2.0 < np.median(times) < 8.0


def test_considered_sensor_errors_stay_those_of_the_path_and_widen_the_interval_as_much() -> None:
    one = balance(np.random.default_rng(1), path=2.0)
    moved, kept = solved(one), solved(one, considered=True)
    assert kept.sensor_errors == pytest.approx([0.0]) and kept.directions == pytest.approx([0.0])
    assert np.diag(kept.covariance)[-1] == pytest.approx(np.radians(0.2) ** 2)
    assert np.diag(moved.covariance)[-1] <= np.diag(kept.covariance)[-1] * (1 + 1e-9)
    assert np.linalg.eigvalsh(moved.covariance).min() > -1e-15
    assert kept.given_sensor_errors == pytest.approx(moved.given_sensor_errors)


def test_windows_are_a_second_long_and_longer_where_there_is_much() -> None:
    def run(start_s: float, end_s: float) -> Maneuver:
        return Maneuver("deceleration", slice(0, 1), start_s, end_s, 10.0, 20.0, 0.0)

    t = np.arange(0, 1000, 0.2)
    usable = np.ones(len(t), dtype=bool)
    usable[60:65] = False
    few = list(windows(t, usable, [run(10.0, 20.0), run(30.0, 40.0)]))
    assert [len(one.rows) for one in few][:3] == [5, 5, 5] and {one.run for one in few} == {0, 1}
    assert not any(60 <= row < 65 for one in few for row in one.rows) and 18 <= len(few) <= 22
    many = list(windows(t, usable, [run(0.0, 900.0)]))
    assert 90 <= len(many) <= 101
