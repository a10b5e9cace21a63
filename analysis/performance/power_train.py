"""Losses between propeller shaft and battery: motor and speed controller, fitted to slow stretches of a flight.

Shaft power comes from the speed of rotation and the propeller's table (3.48). Where the log has voltage and current of
the battery, the losses are fitted to them. Where it has not, they are those of the aircraft file's motor, with wide
standard errors, and `basis` says so.

Units: power in W, thrust in N, torque in N m, V in m/s, n in rev/s.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag import covariance
from analysis.estimation import output_error
from analysis.estimation.data import Segment
from analysis.estimation.model import Model, Parameter
from analysis.performance.propagation import ParameterVector, SigmaPoints, combine_independent
from analysis.performance.propeller_speed import corrected_thrust
from analysis.signals.stretches import stretches
from flight.complete_aircraft import CompletePropulsion
from flight.propeller import Propeller

Array = NDArray[np.float64]

# Standard deviations of the priors. Two sources of one propeller differ by 10 % in cP (docs/propellers.md). A motor's
# constants leave out the speed controller and half of the iron and bearing losses. Current sensors of autopilots are
# set up to a few per cent, and nothing on board measures it better.
SHAFT_SCALE_SIGMA, LOSS_SIGMA_SHARE, METER_SCALE_SIGMA = 0.05, 0.5, 0.02
SMOOTHING_S = 1.0
SLOW_PER_S = 0.04  # largest change of n per second, as a share of n, of a slow stretch
SHORTEST_S, NEEDED_S = 3.0, 10.0  # of one stretch, and of all together
POINT_S = 5.0  # a measured efficiency is a mean over this
SLOWEST_REVPS = 10.0


@dataclass(frozen=True)
class MeasuredEfficiency:
    """Efficiencies (0 to 1) measured in a few seconds of steady or slowly changing flight."""

    time_s: float
    speed_mps: float
    propeller: float  # thrust power over shaft power, both of the corrected table
    motor: float  # with its speed controller: shaft power over battery power
    overall: float


@dataclass(frozen=True)
class PowerTrainModel:
    """Losses from the shaft to the battery: P_battery = (s P_shaft + f n + c (Q + Q_0)^2) / (1 + meter_scale).

    parameters : s `shaft_scale`, true shaft power over the table's; f `friction` [W s/rev]; c `copper` [W/(N m)^2];
    `meter_scale`, relative error of the measured battery power, which is also in s, f and c
    no_load_torque_Nm : Q_0, of the motor's no-load current
    measured : whether s, f and c are fitted to battery data     basis : where they come from, in words
    """

    parameters: ParameterVector
    no_load_torque_Nm: float
    measured: bool
    basis: str
    efficiencies: tuple[MeasuredEfficiency, ...]

    def battery_power(self, shaft_W: Array, n: Array, parameters: SigmaPoints) -> Array:
        """Battery power [W], (2m + 1, k), at the table's shaft power [W] and n [rev/s]. parameters : those above"""
        s, f, c = (parameters[name] for name in ("shaft_scale", "friction", "copper"))
        measured_W: Array = _measured_battery_power(shaft_W, n, self.no_load_torque_Nm, s, f, c)
        return measured_W / (1 + parameters["meter_scale"])

    def shaft_power(self, shaft_W: Array, parameters: SigmaPoints) -> Array:
        """True shaft power [W], (2m + 1, k), of the table's [W]. parameters : shaft_scale, meter_scale"""
        return shaft_W * parameters["shaft_scale"] / (1 + parameters["meter_scale"])


def _measured_battery_power(
    shaft_W: Any, n: Any, no_load_Nm: float, shaft_scale: Any, friction: Any, copper: Any
) -> Any:
    """Battery power [W] as its meter shows it: shaft power, friction in proportion to n, heat of the current.

    Of arrays, or of CasADi symbols.
    """
    torque_Nm = shaft_W / (2 * np.pi * n) + no_load_Nm
    return shaft_scale * shaft_W + friction * n + copper * torque_Nm**2


def fit_power_train(
    data: pd.DataFrame,
    propulsion: CompletePropulsion,
    propeller: Propeller,
    *,
    thrust_scale: float,
    thrust_slope: float,
    motor_source: str = "those of the aircraft file, an assumption",
) -> PowerTrainModel:
    """Fit the losses between shaft and battery to slow stretches of a flight.

    data : index t_s, even steps; columns V, n, rho, covered (by the propeller's table), battery_W (NaN: not measured)
    thrust_scale, thrust_slope : correction of the table's thrust as estimated, for the measured efficiencies
    """
    k = 60 / (2 * np.pi * propulsion.motor_kv_rpm_per_volt)  # N m/A and V s/rad
    friction = 2 * np.pi * k * propulsion.motor_no_load_current_A
    copper = propulsion.motor_resistance_ohm / k**2
    no_load_Nm = k * propulsion.motor_no_load_current_A
    model = Model(
        name="motor losses",
        inputs=("shaft", "n"),
        outputs=("battery",),
        output_function=lambda x, u, p: (
            _measured_battery_power(u.shaft, u.n, no_load_Nm, p.shaft_scale, p.friction, p.copper),
        ),
        parameters=(
            Parameter(name="shaft_scale", start=1.0, prior_sigma=SHAFT_SCALE_SIGMA),
            Parameter(name="friction", start=friction, prior_sigma=LOSS_SIGMA_SHARE * friction + 1e-3),
            Parameter(name="copper", start=copper, prior_sigma=LOSS_SIGMA_SHARE * copper + 1e-3),
        ),
    )
    names = tuple(q.name for q in model.parameters)
    meter = ParameterVector(("meter_scale",), np.zeros(1), np.array([[METER_SCALE_SIGMA**2]]))
    segments = _slow_stretches(data, propulsion, propeller)
    seconds = sum(len(segment) * segment.step_s for segment in segments)
    if seconds < NEEDED_S:
        prior = np.diag([q.prior_sigma**2 for q in model.parameters])
        losses = ParameterVector(names, np.array([q.start for q in model.parameters]), prior)
        why = (
            "The log has no battery voltage and current"
            if data["battery_W"].isna().all()
            else f"Only {seconds:.0f} s of slow flight with battery data"
        )
        basis = (
            f"{why}: motor and controller are {motor_source}"
            f" ({propulsion.motor_kv_rpm_per_volt:g} rpm/V, {propulsion.motor_resistance_ohm:g} ohm,"
            f" {propulsion.motor_no_load_current_A:g} A unloaded),"
            f" losses ±{100 * LOSS_SIGMA_SHARE:.0f} %, shaft power ±{100 * SHAFT_SCALE_SIGMA:.0f} %"
            " (one standard deviation)."
        )
        return PowerTrainModel(combine_independent(losses, meter), no_load_Nm, False, basis, ())
    fit = output_error.estimate(model, segments)
    losses = ParameterVector(names, fit.values, covariance.of_noise(fit))
    basis = (
        f"Motor and controller from {seconds:.0f} s of steady or slowly changing flight with battery data; its meter is"
        f" taken as good to {100 * METER_SCALE_SIGMA:.0f} % (one standard deviation)."
    )
    shaft_scale = fit.parameters["shaft_scale"].value
    efficiencies = tuple(
        efficiency
        for segment in segments
        for efficiency in _efficiencies(segment, propeller, shaft_scale, thrust_scale, thrust_slope)
    )
    return PowerTrainModel(combine_independent(losses, meter), no_load_Nm, True, basis, efficiencies)


def _slow_stretches(data: pd.DataFrame, propulsion: CompletePropulsion, propeller: Propeller) -> list[Segment]:
    """Stretches in which the motor drives the propeller and n hardly changes; inputs shaft [W], n, V, rho."""
    step_s = float(data.index[1] - data.index[0])
    smooth = data["n"].rolling(max(1, round(SMOOTHING_S / step_s)), center=True, min_periods=1).mean()
    acceleration = pd.Series(np.gradient(smooth.to_numpy(), step_s), data.index)  # rev/s^2
    complete = data[["V", "n", "rho", "battery_W"]].notna().all(axis=1) & data["covered"]
    slow = complete & (smooth > SLOWEST_REVPS) & (acceleration.abs() < SLOW_PER_S * smooth)
    segments = []
    for rows in stretches(slow.to_numpy()):
        if (rows.stop - rows.start) * step_s < SHORTEST_S:
            continue
        piece = data.iloc[rows]
        V, n, rho = (piece[name].to_numpy() for name in ("V", "n", "rho"))
        thrust_N, shaft_W = propeller.thrust_and_power(V, n, rho)
        # The power that accelerates the rotor comes from the battery too.
        inertia_kgm2 = propulsion.propeller_inertia_kgm2
        shaft_W = shaft_W + (2 * np.pi) ** 2 * inertia_kgm2 * n * acceleration.iloc[rows].to_numpy()
        if np.min(shaft_W) > 0 and np.min(thrust_N) > 0:
            u = {"shaft": shaft_W, "n": n, "V": V, "rho": rho}
            z = {"battery": piece["battery_W"].to_numpy()}
            segments.append(Segment(name=f"{piece.index[0]:.1f} s", t_s=piece.index.to_numpy(), u=u, z=z))
    return segments


def _efficiencies(
    segment: Segment, propeller: Propeller, shaft_scale: float, thrust_scale: float, thrust_slope: float
) -> list[MeasuredEfficiency]:
    """Means over parts of a slow stretch of POINT_S each."""
    efficiencies = []
    parts = max(1, round(len(segment) * segment.step_s / POINT_S))
    for rows in np.array_split(np.arange(len(segment)), parts):
        V, n, rho = (segment.u[name][rows] for name in ("V", "n", "rho"))
        thrust_N = corrected_thrust(propeller, V, n, rho, thrust_scale=thrust_scale, thrust_slope=thrust_slope)
        _, table_shaft_W = propeller.thrust_and_power(V, n, rho)
        thrust_power_W = float((thrust_N * V).mean())
        shaft_W = shaft_scale * float(table_shaft_W.mean())
        battery_W = float(segment.z["battery"][rows].mean())
        if battery_W > 0 and shaft_W > 0:
            efficiencies.append(
                MeasuredEfficiency(
                    time_s=float(segment.t_s[rows].mean()),
                    speed_mps=float(V.mean()),
                    propeller=thrust_power_W / shaft_W,
                    motor=shaft_W / battery_W,
                    overall=thrust_power_W / battery_W,
                )
            )
    return efficiencies
