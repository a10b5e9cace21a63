"""Air data at the centre of gravity from the probe's pressures: speed, flow angles, density, height, thrust, bank."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.probe import ProbeCalibration, flow_at_probe
from analysis.airdata.rigid_body import bank_angle
from analysis.signals.aircraft_size import LEAST_HEIGHT_M, SPEED_SCALE, flying_Pa
from analysis.signals.synchronize import COLUMNS
from flight.aircraft import Aircraft
from flight.atmosphere import density, height_at, temperature_at
from flight.propeller import Propeller

Array = NDArray[np.float64]

SMOOTHING_S = 0.2  # of q_c in quotients; short against the seconds in which an aircraft's speed changes
STUCK_PA = 0.02  # a tenth of a count of the finest transducer
FEWEST_SAMPLES = 250  # to judge whether a transducer is stuck
COLD_S = 2.0  # after power-on, in which electronics have the temperature of the air
LARGEST_UNMENTIONED_SHARE = 0.02


class AirData(NamedTuple):
    """The synchronized table with air data columns, and notes on what was lost, assumed or corrected."""

    table: pd.DataFrame
    notes: list[str]


def air_data(
    table: pd.DataFrame, aircraft: Aircraft, probe: ProbeCalibration, propeller: Propeller, scale: float
) -> AirData:
    """The table with speed, angles, density, height, thrust, bank and `flying` added.

    table: the zeros at rest subtracted, specific forces at the centre of gravity. scale: the aircraft's `speed_scale`.
    Angles are those at the centre of gravity: corrected for upwash and for the velocity of the probe by rotation.
    """
    notes: list[str] = []
    out = table.copy()
    out[SPEED_SCALE] = scale
    least_Pa = flying_Pa(scale)
    for name in ("dp_alpha_Pa", "dp_beta_Pa", "q_c_Pa"):
        if _stuck(out[name], out["q_c_Pa"], least_Pa):
            out[name] = np.nan
            notes.append(
                f"{COLUMNS[name][0]} never changed in flight and is left out: a broken transducer or a blocked tube."
            )
    sideslip = out["dp_beta_Pa"].to_numpy(dtype=float)
    if np.isnan(sideslip).all():
        notes.append("No sideslip pressure in this log: sideslip is not known; the other air data take it as zero.")
        out["dp_beta_Pa"] = 0.0
    ground_Pa, ground_K = _ground(out)
    out["height_m"] = height_at(out["static_Pa"], ground_pressure_Pa=ground_Pa, ground_temperature_K=ground_K)
    out["temperature_K"] = temperature_at(out["height_m"], ground_K)
    rho = density(out["static_Pa"], out["temperature_K"])

    dp_beta = np.nan_to_num(sideslip)  # the maps take missing sideslip as zero
    # The mean of a quotient by a noisy number is biased, and so is that of a root: near the stall by 0.5 % of angle and
    # 0.07 % of speed. So quotients use the mean of q_c, and speed is linear in the deviation of q_c from its mean. The
    # bias is as the square of noise over dynamic pressure: means of slower aircraft are over more samples.
    step_s = table.index[1] - table.index[0]
    window = max(1, round(SMOOTHING_S / scale**2 / step_s))
    mean_q_c = out["q_c_Pa"].rolling(window, center=True, min_periods=1).mean().to_numpy()
    known_q_c = np.where(out["q_c_Pa"].notna(), mean_q_c, np.nan)
    flow = flow_at_probe(probe, out["dp_alpha_Pa"].to_numpy(), dp_beta, known_q_c, samples=round(scale**-4))
    deviation = out["q_c_Pa"].to_numpy() / mean_q_c - 1
    flying = (flow.qbar_Pa > least_Pa) & flow.inside
    nan_on_ground = np.where(flying, 1.0, np.nan)
    V = np.sqrt(2 * flow.qbar_Pa * nan_on_ground / rho) * (1 + deviation / 2)

    CL = -aircraft.mass_kg * out["az_mps2"] / (flow.qbar_Pa * nan_on_ground * aircraft.geometry.wing_area_m2)
    x_probe = aircraft.probe.position_m[0]  # ahead of the centre of gravity
    out["flying"] = flying
    out["qbar_Pa"] = flow.qbar_Pa * (1 + deviation) * nan_on_ground
    out["rho"] = rho
    out["V_mps"] = V
    out["dalpha_dlndp_alpha_rad"] = flow.dalpha_dlndp_alpha_rad * nan_on_ground
    out["dlnV_dlndp_alpha"] = flow.dlnV_dlndp_alpha * nan_on_ground
    # Rotation moves a probe ahead of the centre of gravity upwards at q x and to the right at r x.
    out["alpha_by_upwash_rad"] = aircraft.probe.upwash_per_CL_rad * CL
    out["alpha_by_rotation_rad"] = -out["q_radps"] * x_probe / V
    out["alpha_rad"] = flow.alpha_rad * nan_on_ground - out["alpha_by_upwash_rad"] - out["alpha_by_rotation_rad"]
    measured = np.where(np.isfinite(sideslip), flow.beta_rad * nan_on_ground, np.nan)
    out["beta_by_rotation_rad"] = out["r_radps"] * x_probe / V
    out["beta_rad"] = measured - out["beta_by_rotation_rad"]
    out["bank_rad"] = bank_angle(out)
    _add_thrust(out, propeller)
    notes += _slow_flight(out["height_m"].to_numpy(), flow.qbar_Pa, least_Pa, scale)
    outside = ~flow.inside[flow.qbar_Pa > least_Pa]
    if len(outside) and np.mean(outside) > LARGEST_UNMENTIONED_SHARE:
        notes.append(
            f"{100 * np.mean(outside):.0f} % of the flight lies outside the probe's calibrated range of angles"
            " and is left out."
        )
    return AirData(out, notes)


def _slow_flight(height_m: Array, qbar_Pa: Array, least_Pa: float, scale: float) -> list[str]:
    """A note where much of the time aloft has too little dynamic pressure to count as flight."""
    aloft = height_m > LEAST_HEIGHT_M * scale
    share = float(np.mean(qbar_Pa[aloft] <= least_Pa)) if aloft.any() else 0.0
    if share <= LARGEST_UNMENTIONED_SHARE:
        return []
    return [
        f"{100 * share:.0f} % of the time above {LEAST_HEIGHT_M * scale:.0f} m has a dynamic pressure below"
        f" {least_Pa:.0f} Pa, too little for this aircraft to fly level, and is left out."
    ]


def _stuck(pressure: pd.Series, q_c: pd.Series, least_Pa: float) -> bool:
    """Whether a transducer read the same value throughout the flight; a working one shows at least noise."""
    flown = pressure[q_c > least_Pa].dropna() if pressure.name != "q_c_Pa" else pressure.dropna()
    return len(flown) > FEWEST_SAMPLES and float(flown.max() - flown.min()) < STUCK_PA


def _ground(table: pd.DataFrame) -> tuple[float, float]:
    """Pressure [Pa] and air temperature [K] on the ground, where the log began.

    Electronics warm the tray by ten degrees within minutes, which would be three per cent of density. At power-on they
    have the temperature of the air. So the transducer's first reading gives the air temperature on the ground; the
    standard lapse rate gives that at height.
    """
    start = table[["static_Pa", "static_temperature_K"]].dropna()
    first = start.loc[: start.index[0] + COLD_S]
    return float(first["static_Pa"].mean()), float(first["static_temperature_K"].mean())


def _add_thrust(table: pd.DataFrame, propeller: Propeller) -> None:
    """Adds thrust, shaft power, advance ratio and whether the propeller table covers them, in place.

    (3.48); the advance ratio uses the whole airspeed.
    """
    n = table["n_revps"].to_numpy()
    turning = n > 1.0
    n_safe = np.where(turning, n, 1.0)
    V = table["V_mps"].to_numpy()
    thrust, shaft = propeller.thrust_and_power(V, n_safe, table["rho"].to_numpy())
    J = V / (n_safe * propeller.diameter_m)
    table["J"] = np.where(turning, J, np.nan)
    table["thrust_N"] = np.where(turning, thrust, np.nan)
    table["shaft_power_W"] = np.where(turning, shaft, np.nan)
    table["propeller_covered"] = turning & propeller.covers(J, 60 * n_safe)
