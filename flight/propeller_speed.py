"""Finds the speed of rotation at which a propeller gives a certain thrust, or that it reaches at full throttle.

Thrust is the table's thrust times 1 + thrust_scale + thrust_slope (J - J_REFERENCE), a correction that the dynamic
method estimates in flight. V in m/s, n in rev/s, thrust in N, rho in kg/m^3.
"""

from collections.abc import Callable

import numpy as np

from flightpower.flight.arrays import Array
from flightpower.flight.propeller import J_REFERENCE, Propeller

Floats = float | Array


def corrected_thrust(
    propeller: Propeller, V: Array, n: Array, rho: Floats, *, thrust_scale: Floats, thrust_slope: Floats
) -> Array:
    """The table's thrust [N] with the correction estimated in flight, elementwise."""
    thrust_N, _ = propeller.thrust_and_power(V, n, rho)
    J = V / (n * propeller.diameter_m)
    corrected: Array = thrust_N * (1 + thrust_scale + thrust_slope * (J - J_REFERENCE))
    return corrected


def revps_for_thrust(
    propeller: Propeller,
    V: Floats,
    thrust_N: Floats,
    rho: Floats,
    *,
    thrust_scale: Floats = 0.0,
    thrust_slope: Floats = 0.0,
) -> Array:
    """The speed of rotation [rev/s] at which the propeller gives a thrust [N] above zero, elementwise.

    NaN where even five times the speed of rotation of zero thrust does not give it.
    """
    V, thrust_N = np.broadcast_arrays(np.asarray(V, dtype=float), np.asarray(thrust_N, dtype=float))
    slowest: Array = V / (3 * propeller.diameter_m)  # J = 3, where no model propeller gives thrust any more

    def excess_over_n(n: Array) -> Array:
        """The excess of thrust, divided by n; nearly a straight line, because thrust is nearly a n^2 - b V n."""
        given_N = corrected_thrust(propeller, V, n, rho, thrust_scale=thrust_scale, thrust_slope=thrust_slope)
        return np.asarray((given_N - thrust_N) / n)

    return _root(excess_over_n, slowest, 15 * slowest + 100.0)


def full_throttle_revps(
    propeller: Propeller, V: Floats, rho: Floats, *, unloaded_revps: Floats, revps_per_Nm: Floats
) -> Array:
    """The speed of rotation [rev/s] at full throttle, elementwise.

    It solves n = n_0 - n_Q Q(V, n) with n_0 = unloaded_revps, n_Q = revps_per_Nm and the propeller's torque Q [N m].
    """
    V, unloaded_revps = np.asarray(V, dtype=float), np.asarray(unloaded_revps, dtype=float)
    shape = np.broadcast_shapes(V.shape, np.shape(rho), unloaded_revps.shape)

    def excess(n: Array) -> Array:
        _, shaft_W = propeller.thrust_and_power(V, n, rho)
        difference: Array = n + revps_per_Nm * shaft_W / (2 * np.pi * n) - unloaded_revps
        return difference

    return _root(excess, np.full(shape, 1.0), np.broadcast_to(1.5 * unloaded_revps, shape).astype(float))


def _root(excess: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Find the zero of a rising function between low and high by secants, elementwise, with a relative error of 1e-8.

    NaN where the function is not above zero at high, or was above zero at every point tried. Bisection takes over where
    a secant leaves the bounds, or where the secants do not converge.
    """
    low, n = np.broadcast_arrays(low, high)
    at_n, before, at_before = excess(n), low, excess(low)
    high, was_above, was_below = n, at_n > 0, at_before <= 0
    reached = ~was_above
    for step in range(60):
        with np.errstate(invalid="ignore", divide="ignore"):
            secant = n - at_n * (n - before) / (at_n - at_before)
        reached = reached | (at_n == 0)
        inside = (secant >= low) & (secant <= high) & (step < 20)
        after = np.where(reached, n, np.where(inside, secant, (low + high) / 2))
        reached = reached | (np.abs(after - n) <= 1e-9 * n)  # at a corner, the error is a few steps
        before, at_before, n = n, at_n, after
        if reached.all():
            break
        at_n = excess(n)
        above = at_n > 0
        was_below = was_below | (at_n <= 0)
        low, high = np.where(above, low, n), np.where(above, n, high)
    return np.where(was_above & was_below, n, np.nan)
