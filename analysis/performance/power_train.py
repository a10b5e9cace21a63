"""From power required to what the battery gives: thrust, shaft power, losses of motor and speed controller.

Thrust and shaft power come from speed of rotation and the propeller's table (3.48). Thrust is the table's times
1 + scale + slope (J - J_REFERENCE), as the dynamic method estimated it in flight. Where the log has voltage and current
of the battery, what lies between shaft and battery is fitted to them; where it has not, it is what the aircraft file
says of the motor, with wide margins, and the result says so.

In level flight drag determines thrust (see `balance`), so a speed determines the speed of rotation, that the shaft
power, and that the battery's power, at any weight and density.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag import covariance
from analysis.drag.forces import J_REFERENCE
from analysis.estimation import output_error
from analysis.estimation.data import Segment
from analysis.estimation.model import Model, Parameter
from analysis.performance.propagation import Numbers, joined
from analysis.signals.stretches import stretches
from flight.aircraft import Propulsion
from flight.propeller import PropellerModel

Array = NDArray[np.float64]

# One standard deviation each. Two sources of one propeller differ by a tenth in cP (docs/propellers.md); the constants
# of a motor leave out its controller and half of what iron and bearings take; current sensors of autopilots are set up
# to a few per cent, which no measurement on board can better.
SHAFT_SCALE, LOSS_SHARE, METER_SCALE = 0.05, 0.5, 0.02
SMOOTHING_S = 1.0
SLOWLY_PER_S = 0.04  # change of motor speed a second, as a share of it, up to which a stretch counts as slow
SHORTEST_S, NEEDED_S = 3.0, 10.0  # of one stretch, and of all
POINT_S = 5.0  # a measured point of efficiency is a mean over this
TURNING_REVPS = 10.0
HALVINGS = 18  # of the interval in which a speed of rotation is sought: to 0.001 rev/s, then a straight line


def thrust_and_power(propeller: PropellerModel, V, n, rho, *, thrust_scale=0.0, thrust_slope=0.0):
    """Thrust [N], corrected as estimated in flight, and shaft power [W] of the table, elementwise."""
    thrust, shaft = propeller.thrust_and_power(V, n, rho)
    J = V / (n * propeller.diameter_m)
    return thrust * (1 + thrust_scale + thrust_slope * (J - J_REFERENCE)), shaft


def revps_for(propeller: PropellerModel, V, thrust_N, rho, *, thrust_scale=0.0, thrust_slope=0.0) -> Array:
    """The speed of rotation [rev/s] at which the propeller gives a thrust [N] above zero, elementwise.

    NaN where not even five times the speed of rotation of zero thrust gives it.
    """
    V, thrust_N = np.broadcast_arrays(np.asarray(V, dtype=float), np.asarray(thrust_N, dtype=float))
    slowest = V / (3 * propeller.diameter_m)  # J = 3: no model propeller pulls there

    def excess(n: Array) -> Array:
        thrust, _ = thrust_and_power(propeller, V, n, rho, thrust_scale=thrust_scale, thrust_slope=thrust_slope)
        return thrust - thrust_N

    return _root(excess, slowest, 15 * slowest + 100.0)


def full_throttle_revps(propeller: PropellerModel, V, rho, *, unloaded_revps, revps_per_Nm) -> Array:
    """The speed of rotation [rev/s] at full throttle; the propeller's torque slows the motor by `revps_per_Nm`."""
    V = np.asarray(V, dtype=float)
    shape = np.broadcast_shapes(V.shape, np.shape(rho), np.shape(unloaded_revps))

    def excess(n: Array) -> Array:
        _, shaft = propeller.thrust_and_power(V, n, rho)
        return n + revps_per_Nm * shaft / (2 * np.pi * n) - unloaded_revps

    return _root(excess, np.full(shape, 1.0), np.broadcast_to(1.5 * unloaded_revps, shape).astype(float))


def _root(excess: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Where a rising function passes zero between low and high: halving, at last a straight line; NaN where nowhere."""
    found = excess(high) > 0
    low, high = np.broadcast_arrays(low, high)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        above = excess(middle) > 0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    at_low, at_high = excess(low), excess(high)
    return np.where(found, low - (high - low) * at_low / (at_high - at_low), np.nan)


@dataclass(frozen=True)
class EfficiencyPoint:
    """What was measured in a few seconds of steady or slowly changing flight; efficiencies 0 to 1."""

    time_s: float
    speed_mps: float
    propeller: float  # thrust power over shaft power, both of the corrected table
    motor: float  # with its speed controller: shaft power over the battery's
    overall: float


@dataclass(frozen=True)
class PowerTrain:
    """What is known of propeller, motor and controller.

    numbers : shaft_scale, the true shaft power over the table's; friction [W s/rev] and copper [W/(N m)^2] of the
    motor's losses; meter_scale of the battery's meter. What thrust is off by belongs to the polar's estimate.
    """

    numbers: Numbers
    no_load_torque_Nm: float
    measured: bool
    basis: str  # where the numbers come from, in words
    points: tuple[EfficiencyPoint, ...]

    def battery_power(self, shaft_W, n, *, shaft_scale, friction, copper, meter_scale):
        """What the battery gives [W] for a shaft power of the table [W] at n [rev/s], elementwise."""
        return _battery(shaft_W, n, self.no_load_torque_Nm, shaft_scale, friction, copper) / (1 + meter_scale)


def _battery(shaft_W, n, no_load_Nm, shaft_scale, friction, copper):
    """Shaft power, friction that grows with speed, and the heat of a current that grows with torque."""
    torque = shaft_W / (2 * np.pi * n) + no_load_Nm
    return shaft_scale * shaft_W + friction * n + copper * torque**2


def power_train(
    data: pd.DataFrame, propulsion: Propulsion, propeller: PropellerModel, thrust: tuple[float, float]
) -> PowerTrain:
    """Fit the losses between shaft and battery to slow stretches of a flight.

    data : index t_s, even steps; columns V, n, rho, covered (by the propeller's table), battery_W (NaN: not measured)
    thrust : thrust_scale and thrust_slope as estimated, for the measured points
    """
    k = 60 / (2 * np.pi * propulsion.motor_kv_rpm_per_volt)  # N m/A and V s/rad
    friction = 2 * np.pi * k * propulsion.motor_no_load_current_A
    copper = propulsion.motor_resistance_ohm / k**2
    no_load_Nm = k * propulsion.motor_no_load_current_A
    model = Model(
        name="motor losses",
        inputs=("shaft", "n"),
        outputs=("battery",),
        output_function=lambda x, u, p: (_battery(u.shaft, u.n, no_load_Nm, p.shaft_scale, p.friction, p.copper),),
        parameters=(
            Parameter(name="shaft_scale", start=1.0, prior_sigma=SHAFT_SCALE),
            Parameter(name="friction", start=friction, prior_sigma=LOSS_SHARE * friction + 1e-3),
            Parameter(name="copper", start=copper, prior_sigma=LOSS_SHARE * copper + 1e-3),
        ),
    )
    names = tuple(q.name for q in model.parameters)
    meter = Numbers(("meter_scale",), np.zeros(1), np.array([[METER_SCALE**2]]))
    segments = _slow_stretches(data, propulsion, propeller)
    seconds = sum(len(segment) * segment.step_s for segment in segments)
    if seconds < NEEDED_S:
        prior = np.diag([q.prior_sigma**2 for q in model.parameters])
        numbers = Numbers(names, np.array([q.start for q in model.parameters]), prior)
        why = (
            "The log has no battery voltage and current"
            if data["battery_W"].isna().all()
            else f"Only {seconds:.0f} s of slow flight with battery data"
        )
        basis = (
            f"{why}: motor and controller are those of the aircraft file, an assumption"
            f" ({propulsion.motor_kv_rpm_per_volt:g} rpm/V, {propulsion.motor_resistance_ohm:g} ohm,"
            f" {propulsion.motor_no_load_current_A:g} A unloaded),"
            f" losses ±{100 * LOSS_SHARE:.0f} %, shaft power ±{100 * SHAFT_SCALE:.0f} % (one standard deviation)."
        )
        return PowerTrain(joined(numbers, meter), no_load_Nm, False, basis, ())
    fit = output_error.estimate(model, segments)
    numbers = Numbers(names, fit.values, covariance.of_noise(fit))
    basis = (
        f"Motor and controller from {seconds:.0f} s of steady or slowly changing flight with battery data; its meter is"
        f" taken as good to {100 * METER_SCALE:.0f} % (one standard deviation)."
    )
    points = _points(segments, no_load_Nm, fit, propeller, thrust)
    return PowerTrain(joined(numbers, meter), no_load_Nm, True, basis, points)


def _slow_stretches(data: pd.DataFrame, propulsion: Propulsion, propeller: PropellerModel) -> list[Segment]:
    """Where the motor drives the propeller and its speed hardly changes."""
    step_s = float(data.index[1] - data.index[0])
    smooth = data["n"].rolling(max(1, round(SMOOTHING_S / step_s)), center=True, min_periods=1).mean()
    slope = pd.Series(np.gradient(smooth.to_numpy(), step_s), data.index)
    known = data[["V", "n", "rho", "battery_W"]].notna().all(axis=1) & data["covered"]
    slow = known & (smooth > TURNING_REVPS) & (slope.abs() < SLOWLY_PER_S * smooth)
    segments = []
    for rows in stretches(slow.to_numpy()):
        if (rows.stop - rows.start) * step_s < SHORTEST_S:
            continue
        piece = data.iloc[rows]
        V, n, rho = (piece[name].to_numpy() for name in ("V", "n", "rho"))
        thrust, shaft = propeller.thrust_and_power(V, n, rho)
        # What turns the propeller faster comes from the battery too.
        shaft = shaft + (2 * np.pi) ** 2 * propulsion.propeller_inertia_kgm2 * n * slope.iloc[rows].to_numpy()
        if np.min(shaft) > 0 and np.min(thrust) > 0:
            u = {"shaft": shaft, "n": n, "V": V, "rho": rho}
            z = {"battery": piece["battery_W"].to_numpy()}
            segments.append(Segment(name=f"{piece.index[0]:.1f} s", t_s=piece.index.to_numpy(), u=u, z=z))
    return segments


def _points(
    segments: list[Segment],
    no_load_Nm: float,
    fit: output_error.Fit,
    propeller: PropellerModel,
    thrust: tuple[float, float],
) -> tuple[EfficiencyPoint, ...]:
    shaft_scale = fit.parameters["shaft_scale"].value
    points = []
    for segment in segments:
        parts = max(1, round(len(segment) * segment.step_s / POINT_S))
        for rows in np.array_split(np.arange(len(segment)), parts):
            V, n, rho = (segment.u[name][rows] for name in ("V", "n", "rho"))
            pull, shaft = thrust_and_power(propeller, V, n, rho, thrust_scale=thrust[0], thrust_slope=thrust[1])
            given, useful = float(segment.z["battery"][rows].mean()), float((pull * V).mean())
            turned = shaft_scale * float(shaft.mean())
            if given > 0 and turned > 0:
                time_s, speed = float(segment.t_s[rows].mean()), float(V.mean())
                points.append(EfficiencyPoint(time_s, speed, useful / turned, turned / given, useful / given))
    return tuple(points)
