"""The speed of rotation for a thrust or at full throttle: right to 1e-8 at any point of a table, in few evaluations."""

from collections.abc import Callable

import numpy as np
import pytest

from flightpower.flight.number import Number
from flightpower.flight.propeller import Propeller, Row
from flightpower.flight.propeller_speed import corrected_thrust, full_throttle_revps, revps_for_thrust

RHO = 1.2


class Counted(Propeller):
    """A propeller that counts its calls."""

    calls = 0

    def thrust_and_power(self, V: Number, n: Number, rho: Number) -> tuple[Number, Number]:
        self.calls += 1
        return super().thrust_and_power(V, n, rho)


@pytest.fixture
def propeller() -> Counted:
    """A table with corners at J = 0.4 and 0.6, where the slope of cT doubles, and at 6000 rpm."""
    J = (0.0, 0.4, 0.6, 0.8)
    slow = Row(4000.0, J, (0.10, 0.08, 0.05, 0.0), (0.045, 0.045, 0.04, 0.02))
    fast = Row(6000.0, J, (0.11, 0.09, 0.06, 0.01), (0.047, 0.047, 0.042, 0.021))
    return Counted("test", 0.3, (slow, fast))


def turning(propeller: Counted) -> tuple[np.ndarray, np.ndarray]:
    """Airspeeds and speeds of rotation at the corners of the table and between them."""
    J, n = np.meshgrid([0.1, 0.4, 0.4001, 0.5, 0.6, 0.7, 0.79], [50.0, 66.7, 90.0, 100.0, 100.01, 140.0])
    return J * n * propeller.diameter_m, n


def test_the_speed_of_rotation_comes_back_from_its_thrust(propeller: Counted) -> None:
    V, n = turning(propeller)
    correction = {"thrust_scale": 0.02, "thrust_slope": -0.1}
    thrust_N = corrected_thrust(propeller, V, n, RHO, **correction)
    assert revps_for_thrust(propeller, V, thrust_N, RHO, **correction) == pytest.approx(n, rel=1e-8)


def test_the_speed_of_rotation_at_full_throttle_balances_the_motor(propeller: Counted) -> None:
    V, n = turning(propeller)
    _, shaft_W = propeller.thrust_and_power(V, n, RHO)
    unloaded_revps = n + 30.0 * shaft_W / (2 * np.pi * n)
    revps = full_throttle_revps(propeller, V, RHO, unloaded_revps=unloaded_revps, revps_per_Nm=30.0)
    assert revps == pytest.approx(n, rel=1e-8)


@pytest.mark.parametrize(
    "solved",
    [
        lambda propeller, V: revps_for_thrust(propeller, V, 3.0, RHO),
        lambda propeller, V: full_throttle_revps(propeller, V, RHO, unloaded_revps=140.0, revps_per_Nm=30.0),
    ],
    ids=["thrust", "full throttle"],
)
def test_a_dozen_evaluations_do(propeller: Counted, solved: Callable[[Propeller, np.ndarray], np.ndarray]) -> None:
    """For 400 speeds at once the slowest to converge decides; bisection takes 30 evaluations for as many digits."""
    n = solved(propeller, np.linspace(1.0, 25.0, 400))
    assert np.isfinite(n).all() and propeller.calls <= 12


def test_a_thrust_that_does_not_change_with_rotation_has_no_speed_of_rotation(propeller: Counted) -> None:
    """Nor has an unknown thrust, nor one that is never reached."""
    idle = Propeller("idle", 0.3, (Row(4000.0, (0.0, 0.5), (0.0, 0.0), (0.0, 0.0)),))
    assert np.isnan(revps_for_thrust(idle, 15.0, 0.5, RHO))
    assert np.isnan(revps_for_thrust(propeller, np.array([15.0, np.nan]), np.array([1e5, 2.0]), RHO)).all()
