"""Speed of rotation at which a propeller gives a thrust, or takes full throttle.

Thrust is that of the table times 1 + thrust_scale + thrust_slope (J - J_REFERENCE), the correction that the dynamic
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
    """Thrust [N] of the table with the correction estimated in flight, elementwise."""
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

    NaN where five times the speed of rotation of zero thrust does not give it.
    """
    V, thrust_N = np.broadcast_arrays(np.asarray(V, dtype=float), np.asarray(thrust_N, dtype=float))
    slowest: Array = V / (3 * propeller.diameter_m)  # J = 3: beyond zero thrust of any model propeller

    def excess(n: Array) -> Array:
        given_N = corrected_thrust(propeller, V, n, rho, thrust_scale=thrust_scale, thrust_slope=thrust_slope)
        return given_N - thrust_N

    return _root(excess, slowest, 15 * slowest + 100.0)


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
    """The zero of a rising function between low and high, elementwise; NaN where it is not above zero at high."""
    is_above = excess(high) > 0
    low, high = np.broadcast_arrays(low, high)
    for _ in range(18):  # to 0.001 rev/s; linear interpolation does the rest
        middle = (low + high) / 2
        above = excess(middle) > 0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    at_low, at_high = excess(low), excess(high)
    rise = at_high - at_low
    no_root = np.where(high > low, np.nan, 0.0)  # a constant excess has none; bounds that have met are the root
    step = np.divide((high - low) * at_low, rise, out=no_root, where=rise != 0)
    return np.where(is_above, low - step, np.nan)
