"""Models of motor and battery: losses between propeller shaft and battery, fitted to the flight or assumed.

Thrust is the table's thrust times 1 + thrust_scale + thrust_slope (J - J_REFERENCE), the correction that the dynamic
method estimates in flight. Shaft power comes from the speed of rotation and the propeller's table (3.48). Where the log
has voltage and current of the battery, the losses between shaft and battery are fitted to slow stretches of the flight.
Otherwise they come from the motor in the aircraft file, with wide standard errors, and `basis` says so. If the file has
no motor, a typical motor is assumed, which loses a tenth of the highest power to friction and iron and another tenth to
copper.

Units: V in m/s, n in rev/s, thrust in N, power in W, torque in N m, rho in kg/m^3.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.maneuvers.settings import LOADS, STEADY_POINT
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.performance.propagation import ParameterVector, SigmaPoints, combine_independent
from flightpower.analysis.performance.settings import ASSUMED_MOTOR, POWER_TRAIN
from flightpower.analysis.records.flight import MeasuredEfficiencyPoint, ParameterResult
from flightpower.analysis.sources.grid import stretches
from flightpower.flight.aircraft import Propulsion
from flightpower.flight.arrays import Array
from flightpower.flight.complete_aircraft import CompletePropulsion
from flightpower.flight.propeller import Propeller, PropellerModel
from flightpower.flight.propeller_speed import corrected_thrust
from flightpower.flight.runs import STANDING


def torque_constant(propulsion: CompletePropulsion) -> float:
    """Torque per current [N m/A], which is also voltage per speed of rotation [V s/rad]."""
    return float(60 / (2 * np.pi * propulsion.motor_kv_rpm_per_volt))


@dataclass(frozen=True)
class PowerTrainModel:
    """Losses from the shaft to the battery: P_battery = (s P_shaft + f n + c (Q + Q_0)^2) / (1 + meter_scale).

    parameters : s `shaft_scale`, true shaft power over the table's; f `friction` [W s/rev]; c `copper` [W/(N m)^2];
        `meter_scale`, relative error of the measured battery power, which s, f and c contain too
    no_load_torque_Nm : Q_0, torque of the motor's no-load current
    measured : whether s, f and c are fitted to battery data     basis : where they come from, in words
    """

    parameters: ParameterVector
    no_load_torque_Nm: float
    measured: bool
    basis: str
    points: tuple[MeasuredEfficiencyPoint, ...]

    def parameter_results(self) -> list[ParameterResult]:
        """The parameters with standard errors, as results.json has them."""
        units = {"friction": "W s/rev", "copper": "W/(N m)^2"}
        errors = np.sqrt(np.diag(self.parameters.covariance))
        return [
            ParameterResult(name=name, value=float(value), standard_error=float(error), unit=units.get(name, ""))
            for name, value, error in zip(self.parameters.names, self.parameters.values, errors, strict=True)
        ]

    def battery_power(self, shaft_W: Array, n: Array, parameters: SigmaPoints) -> Array:
        """Battery power [W], (2m + 1, k), at the table's shaft power [W] and n [rev/s]. parameters : this model's"""
        losses = (parameters[name] for name in ("shaft_scale", "friction", "copper"))
        torque_Nm = shaft_W / (2 * np.pi * n) + self.no_load_torque_Nm
        measured_W: Array = _measured_battery_power(shaft_W, torque_Nm, n, losses)
        return measured_W / (1 + parameters["meter_scale"])

    def shaft_power(self, shaft_W: Array, parameters: SigmaPoints) -> Array:
        """True shaft power [W], (2m + 1, k), from the table's [W]. parameters : shaft_scale, meter_scale"""
        return shaft_W * parameters["shaft_scale"] / (1 + parameters["meter_scale"])


def _measured_battery_power(shaft_W: Any, torque_Nm: Any, n: Any, losses: Any) -> Any:
    """Battery power [W] as the meter shows it: shaft power, friction in proportion to n, and heat of the current.

    It works on arrays or CasADi symbols. torque_Nm: includes the torque of the no-load current. losses: shaft_scale,
    friction, copper
    """
    shaft_scale, friction, copper = losses
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
    thrust_scale, thrust_slope : estimated correction of the table's thrust, used for the measured efficiencies
    motor_source : where the motor's constants come from, as words for `basis`
    """
    k = torque_constant(propulsion)
    friction = 2 * np.pi * k * propulsion.motor_no_load_current_A
    copper = propulsion.motor_resistance_ohm / k**2
    no_load_Nm = k * propulsion.motor_no_load_current_A
    model = Model(
        name="motor losses",
        inputs=("shaft", "n"),
        outputs=("battery",),
        output_function=lambda x, u, p: (
            _measured_battery_power(
                u.shaft, u.shaft / (2 * np.pi * u.n) + no_load_Nm, u.n, (p.shaft_scale, p.friction, p.copper)
            ),
        ),
        parameters=(
            Parameter(name="shaft_scale", start=1.0, prior_sigma=POWER_TRAIN.shaft_scale_sigma),
            Parameter(name="friction", start=friction, prior_sigma=POWER_TRAIN.loss_sigma_share * friction + 1e-3),
            Parameter(name="copper", start=copper, prior_sigma=POWER_TRAIN.loss_sigma_share * copper + 1e-3),
        ),
    )
    names = tuple(q.name for q in model.parameters)
    meter = ParameterVector(("meter_scale",), np.zeros(1), np.array([[POWER_TRAIN.meter_scale_sigma**2]]))
    segments = _slow_stretches(data, propulsion, propeller)
    seconds = sum(len(segment) * segment.step_s for segment in segments)
    if seconds < POWER_TRAIN.needed_s:
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
            f" losses ±{100 * POWER_TRAIN.loss_sigma_share:.0f} %,"
            f" shaft power ±{100 * POWER_TRAIN.shaft_scale_sigma:.0f} % (one standard deviation)."
        )
        return PowerTrainModel(combine_independent(losses, meter), no_load_Nm, False, basis, ())
    fit = fit_output_error(model, segments)
    losses = ParameterVector(names, fit.values, covariance.of_noise(fit))
    basis = (
        f"Motor and controller from {seconds:.0f} s of steady or slowly changing flight with battery data; its meter is"
        f" taken as good to {100 * POWER_TRAIN.meter_scale_sigma:.0f} % (one standard deviation)."
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
    smooth = data["n"].rolling(max(1, round(LOADS.smoothing_s / step_s)), center=True, min_periods=1).mean()
    acceleration = pd.Series(np.gradient(smooth.to_numpy(), step_s), data.index)  # rev/s^2
    complete = data[["V", "n", "rho", "battery_W"]].notna().all(axis=1) & data["covered"]
    slow = complete & (smooth > STANDING.motor_revps) & (acceleration.abs() < POWER_TRAIN.slow_per_s * smooth)
    segments = []
    for rows in stretches(slow.to_numpy()):
        if (rows.stop - rows.start) * step_s < POWER_TRAIN.shortest_s:
            continue
        piece = data.iloc[rows]
        V, n, rho = (piece[name].to_numpy() for name in ("V", "n", "rho"))
        thrust_N, shaft_W = propeller.thrust_and_power(V, n, rho)
        # The power that accelerates the rotor also comes from the battery.
        inertia_kgm2 = propulsion.propeller_inertia_kgm2
        shaft_W = shaft_W + (2 * np.pi) ** 2 * inertia_kgm2 * n * acceleration.iloc[rows].to_numpy()
        if np.min(shaft_W) > 0 and np.min(thrust_N) > 0:
            u = {"shaft": shaft_W, "n": n, "V": V, "rho": rho}
            z = {"battery": piece["battery_W"].to_numpy()}
            segments.append(Segment(name=f"{piece.index[0]:.1f} s", t_s=piece.index.to_numpy(), u=u, z=z))
    return segments


def _efficiencies(
    segment: Segment, propeller: Propeller, shaft_scale: float, thrust_scale: float, thrust_slope: float
) -> list[MeasuredEfficiencyPoint]:
    """Mean efficiencies over parts of a slow stretch, each a few seconds long."""
    efficiencies = []
    parts = max(1, round(len(segment) * segment.step_s / STEADY_POINT.smoothing_s))
    for rows in np.array_split(np.arange(len(segment)), parts):
        V, n, rho = (segment.u[name][rows] for name in ("V", "n", "rho"))
        thrust_N = corrected_thrust(propeller, V, n, rho, thrust_scale=thrust_scale, thrust_slope=thrust_slope)
        _, table_shaft_W = propeller.thrust_and_power(V, n, rho)
        thrust_power_W = float((thrust_N * V).mean())
        shaft_W = shaft_scale * float(table_shaft_W.mean())
        battery_W = float(segment.z["battery"][rows].mean())
        if battery_W > 0 and shaft_W > 0:
            efficiencies.append(
                MeasuredEfficiencyPoint(
                    time_s=float(segment.t_s[rows].mean()),
                    speed_mps=float(V.mean()),
                    propeller=thrust_power_W / shaft_W,
                    motor=shaft_W / battery_W,
                    overall=thrust_power_W / battery_W,
                )
            )
    return efficiencies


MOTOR = ("motor_kv_rpm_per_volt", "motor_resistance_ohm", "motor_no_load_current_A")
WHY_ASSUMED = (
    "assumed, because the aircraft file lacks motor_kv_rpm_per_volt, motor_resistance or motor_no_load_current; with"
    " them, or with battery voltage and current in the log, the intervals would be narrower"
)


def motor_is_known(propulsion: Propulsion) -> bool:
    """Whether the aircraft file has all three constants of the motor."""
    return all(getattr(propulsion, name) is not None for name in MOTOR)


def with_assumed_motor(propulsion: Propulsion, data: pd.DataFrame, propeller: PropellerModel) -> CompletePropulsion:
    """The power train of the aircraft file, with assumed values for keys that it lacks.

    data : columns V [m/s], n [rev/s], rho [kg/m^3], covered (by the propeller's table)
    """
    voltage = propulsion.battery_voltage_V or 10.0  # any value will do for losses in watts
    assumed: dict[str, float] = {"battery_voltage_V": voltage, "battery_resistance_ohm": 0.0}
    assumed["propeller_inertia_kgm2"] = ASSUMED_MOTOR.inertia_over_diameter_5 * propeller.diameter_m**5
    if not motor_is_known(propulsion):
        power_W, n = _highest_power(data, propeller)
        unloaded_revps = ASSUMED_MOTOR.unloaded_over_highest * n
        k = voltage / (2 * np.pi * unloaded_revps)  # N m/A and V s/rad
        torque_Nm = power_W / (2 * np.pi * n)
        assumed["motor_kv_rpm_per_volt"] = 60 * unloaded_revps / voltage
        assumed["motor_no_load_current_A"] = ASSUMED_MOTOR.loss_share * power_W / (2 * np.pi * n * k)
        assumed["motor_resistance_ohm"] = ASSUMED_MOTOR.loss_share * power_W * (k / torque_Nm) ** 2
    given_values = {name: value for name, value in vars(propulsion).items() if value is not None}
    if not motor_is_known(propulsion):  # one constant is of little use without the others
        given_values = {name: value for name, value in given_values.items() if name not in MOTOR}
    unused = {"propeller": "", "max_rpm": 0.0, "pole_pairs": 1, "battery_energy_Wh": 0.0}
    return CompletePropulsion(**{**unused, **assumed, **given_values})


def _highest_power(data: pd.DataFrame, propeller: PropellerModel) -> tuple[float, float]:
    """Highest shaft power in the flight by the propeller's table [W], and the speed of rotation there [rev/s]."""
    turning = data[data["covered"] & (data["n"] > STANDING.motor_revps)]
    if turning.empty:
        return 100.0, 100.0
    V, n, rho = (turning[name].to_numpy() for name in ("V", "n", "rho"))
    _, shaft_W = propeller.thrust_and_power(V, n, rho)
    i = int(np.nanargmax(shaft_W))
    return float(shaft_W[i]), float(n[i])
