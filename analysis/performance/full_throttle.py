"""The motor at full throttle, fitted to the flight's full-throttle stretches.

Model: n = n_0 - n_Q Q. The speed of rotation falls in proportion to the motor's torque Q, because the voltage left for
the back-EMF falls with the current. Just below full throttle n_0 is smaller in proportion to the throttle. Q is the
propeller's torque by its table at the measured n, plus the torque that accelerates the rotor.

Limits: n_0 holds for the battery's charge in those stretches (it is lower with an empty battery) and for the motor's
temperature in them.

Units: torque in N m, n in rev/s.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.performance.power_train import torque_constant
from flightpower.analysis.performance.propagation import ParameterVector
from flightpower.analysis.performance.settings import FULL_THROTTLE, POWER_TRAIN
from flightpower.analysis.settings import EVIDENCE
from flightpower.analysis.sources.grid import stretches
from flightpower.flight.aircraft import Propulsion
from flightpower.flight.complete_aircraft import CompletePropulsion
from flightpower.flight.propeller import Propeller


@dataclass(frozen=True)
class FullThrottle:
    """The motor at full throttle.

    parameters : n_0 (`unloaded_revps` [rev/s]) and n_Q (`revps_per_Nm` [rev/s/(N m)]); None where they are not known
    basis : what they were fitted to, in words     reason : why they are not known, in words; else empty
    """

    parameters: ParameterVector | None
    basis: str = ""
    reason: str = ""


def fit_full_throttle(data: pd.DataFrame, propulsion: CompletePropulsion, propeller: Propeller) -> FullThrottle:
    """Fit n_0 and n_Q to the flight.

    data : index t_s, even steps; columns V [m/s], n [rev/s], rho [kg/m^3], throttle (0 to 1), covered (by the
    propeller's table)
    """
    if data["throttle"].isna().all():
        return FullThrottle(None, reason="The log has no throttle position.")
    step_s = float(data.index[1] - data.index[0])
    segments = _full_throttle_stretches(data, step_s, propulsion, propeller)
    seconds = sum(len(segment) * segment.step_s for segment in segments)
    if seconds < FULL_THROTTLE.needed_s:
        return FullThrottle(
            None,
            reason=f"The flight has only {seconds:.0f} s of settled full throttle within the propeller's table;"
            f" {FULL_THROTTLE.needed_s:.0f} s are needed.",
        )
    k = torque_constant(propulsion)
    slope = (propulsion.motor_resistance_ohm + propulsion.battery_resistance_ohm) / (2 * np.pi * k**2)
    unloaded = propulsion.motor_kv_rpm_per_volt * propulsion.battery_voltage_V / 60
    fit = fit_output_error(
        Model(
            name="full throttle",
            inputs=("torque", "throttle"),
            outputs=("n",),
            output_function=lambda x, u, p: (p.unloaded_revps * u.throttle - p.revps_per_Nm * u.torque,),
            parameters=(
                Parameter(name="unloaded_revps", start=unloaded, unit="rev/s"),
                Parameter(name="revps_per_Nm", start=slope, prior_sigma=POWER_TRAIN.loss_sigma_share * slope + 1e-3),
            ),
        ),
        segments,
    )
    unloaded_revps, revps_per_Nm = fit.values
    basis = (
        f"From {seconds:.0f} s of full throttle: the motor would turn {60 * unloaded_revps:.0f} rpm unloaded and loses"
        f" {60 * revps_per_Nm:.0f} rpm for each N m, with the battery as charged as it was then."
    )
    return FullThrottle(ParameterVector(fit.names, fit.values, covariance.of_noise(fit)), basis=basis)


def speed_over_motor_constant(table: pd.DataFrame, propulsion: Propulsion) -> float | None:
    """Median of motor speed at full throttle over kV (V - I R); it is 1 if speed, meter and constants are right.

    table: from `air_data`. None without throttle, voltage, current, or these constants.
    """
    kv, resistance = propulsion.motor_kv_rpm_per_volt, propulsion.motor_resistance_ohm
    columns = ["n_revps", "throttle", "battery_V", "battery_A"]
    if kv is None or resistance is None or not set(columns) <= set(table.columns):
        return None
    at_full = table[columns].dropna()
    at_full = at_full[at_full["throttle"] >= FULL_THROTTLE.least]
    if len(at_full) < FULL_THROTTLE.needed_s / float(table.index[1] - table.index[0]):
        return None
    allowed_revps = kv * (at_full["battery_V"] - at_full["battery_A"] * resistance) / 60
    return float((at_full["n_revps"] / allowed_revps).median())


def _full_throttle_stretches(
    data: pd.DataFrame, step_s: float, propulsion: CompletePropulsion, propeller: Propeller
) -> list[Segment]:
    """Stretches at full throttle, without the time that the motor needs to settle, with the motor's torque [N m]."""
    full = float(data["throttle"].max())
    at_full = data["throttle"] >= max(FULL_THROTTLE.least, full - EVIDENCE.negligible)
    at_full &= data[["V", "n", "rho"]].notna().all(axis=1) & data["covered"]
    segments = []
    for stretch in stretches(at_full.to_numpy()):
        rows = slice(stretch.start + round(FULL_THROTTLE.settling_s / step_s), stretch.stop)
        if (rows.stop - rows.start) * step_s < FULL_THROTTLE.shortest_s:
            continue
        piece = data.iloc[rows]
        V, n, rho, throttle = (piece[name].to_numpy() for name in ("V", "n", "rho", "throttle"))
        _, shaft_W = propeller.thrust_and_power(V, n, rho)
        accelerating_Nm = 2 * np.pi * propulsion.propeller_inertia_kgm2 * np.gradient(n, step_s)
        u = {"torque": shaft_W / (2 * np.pi * n) + accelerating_Nm, "throttle": throttle / full}
        segments.append(Segment(name=f"{piece.index[0]:.1f} s", t_s=piece.index.to_numpy(), u=u, z={"n": n}))
    return segments
