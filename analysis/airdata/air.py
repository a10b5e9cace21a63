"""From the probe's pressures to speed, flow angles and density at the centre of gravity, and thrust from them."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.probe import ProbeCalibration, flow_at_probe
from analysis.signals.rest import Zeros
from analysis.signals.synchronize import COLUMNS
from flight.aircraft import Aircraft
from flight.atmosphere import GRAVITY_MPS2, density, height_at, temperature_at
from flight.motion import specific_force_at
from flight.propeller import Propeller

FLYING_PA = 30.0  # dynamic pressure above which there is flow enough to speak of angles: 7 m/s at sea level
LEAST_HEIGHT_M = 20.0  # above the ground; below, wind changes with every metre, and ground effect begins
SMOOTHING_S = 0.2  # of what quotients are made of: short against the seconds in which an aircraft's speed changes
STUCK_PA, FEWEST_TO_JUDGE = 0.02, 250  # a tenth of a count of the finest transducer; samples
COLD_S = 2.0  # after power-on
LARGEST_UNMENTIONED_SHARE = 0.02


class AirData(NamedTuple):
    """Columns added to the synchronised table, and what was assumed on the way."""

    table: pd.DataFrame
    notes: list[str]


def air_data(
    table: pd.DataFrame, aircraft: Aircraft, probe: ProbeCalibration, propeller: Propeller, zeros: Zeros | None
) -> AirData:
    """Adds speed, angles, air, height, thrust and `flying` to the table; takes zeros and lever arms out.

    Angles and forces are those at the centre of gravity: upwash and the rotation of the boom are taken out of the
    angles (method section 7), the lever arm out of the accelerations (method section 3).
    """
    notes: list[str] = []
    out = table.copy()
    if zeros is None:
        notes.append("The aircraft never stood still in this log: transducer and gyro zeros are taken as they come.")
    else:
        notes += zeros.notes
        for name in zeros.value:
            out[name] -= zeros.at(name, table.index.to_numpy())
    for name in ("dp_alpha_Pa", "dp_beta_Pa", "q_c_Pa"):
        if _stuck(out[name], out["q_c_Pa"]):
            out[name] = np.nan
            notes.append(
                f"{COLUMNS[name][0]} never changed in flight: a broken transducer or a blocked tube, left out."
            )
    sideslip = out["dp_beta_Pa"].to_numpy(dtype=float)
    if np.isnan(sideslip).all():
        notes.append("No sideslip pressure in this log: sideslip is not known; the other angles are those without it.")
        out["dp_beta_Pa"] = 0.0

    dp_beta = np.nan_to_num(sideslip)  # where it is missing: straight flow, for the maps
    # A quotient by a noisy number, and its root, are off on average: near the stall by 0.5 % of angle and 0.07 %
    # of speed. So the quotients take the mean, and speed is straight in what differs from it.
    step_s = table.index[1] - table.index[0]
    window = max(1, round(SMOOTHING_S / step_s))
    steady = out["q_c_Pa"].rolling(window, center=True, min_periods=1).mean().to_numpy()
    flow = flow_at_probe(probe, out["dp_alpha_Pa"].to_numpy(), dp_beta, np.where(out["q_c_Pa"].notna(), steady, np.nan))
    quick = out["q_c_Pa"].to_numpy() / steady - 1
    flying = (flow.qbar_Pa > FLYING_PA) & flow.inside
    blank = np.where(flying, 1.0, np.nan)
    ground_Pa, ground_K = _ground(out)
    out["height_m"] = height_at(out["static_Pa"], ground_pressure_Pa=ground_Pa, ground_temperature_K=ground_K)
    out["temperature_K"] = temperature_at(out["height_m"], ground_K)
    rho = density(out["static_Pa"], out["temperature_K"])
    V = np.sqrt(2 * flow.qbar_Pa * blank / rho) * (1 + quick / 2)

    _move_imu(out, aircraft)
    CL = -aircraft.mass_kg * out["az_mps2"] / (flow.qbar_Pa * blank * aircraft.geometry.wing_area_m2)
    CL = CL.rolling(window, center=True).mean()
    x_probe = aircraft.probe.position_m[0]
    out["flying"] = flying
    out["qbar_Pa"] = flow.qbar_Pa * (1 + quick) * blank
    out["rho"] = rho
    out["V_mps"] = V
    out["V_per_pair"] = flow.V_per_pair * blank
    out["alpha_rad"] = flow.alpha_rad * blank - aircraft.probe.upwash_per_CL_rad * CL + out["q_radps"] * x_probe / V
    measured = np.where(np.isfinite(sideslip), flow.beta_rad * blank, np.nan)
    out["beta_rad"] = measured - out["r_radps"] * x_probe / V
    _add_thrust(out, propeller)
    outside = ~flow.inside[flow.qbar_Pa > FLYING_PA]
    if len(outside) and np.mean(outside) > LARGEST_UNMENTIONED_SHARE:
        notes.append(
            f"{100 * np.mean(outside):.0f} % of the flight lies outside the probe's calibrated range of angles"
            " and is left out."
        )
    return AirData(out, notes)


def _stuck(pressure: pd.Series, q_c: pd.Series) -> bool:
    """Whether a transducer gave one and the same number in all of the flight; noise alone moves a sound one."""
    flown = pressure[q_c > FLYING_PA].dropna() if pressure.name != "q_c_Pa" else pressure.dropna()
    return len(flown) > FEWEST_TO_JUDGE and float(flown.max() - flown.min()) < STUCK_PA


def _ground(table: pd.DataFrame) -> tuple[float, float]:
    """Pressure [Pa] and air temperature [K] where the log began.

    Electronics warm themselves and the tray by ten degrees within minutes, three per cent of density; at power-on they
    are as warm as the air they waited in. So the transducer's first reading is the air's temperature, and the standard
    lapse rate carries it to height.
    """
    start = table[["static_Pa", "static_temperature_K"]].dropna()
    first = start.loc[: start.index[0] + COLD_S]
    return float(first["static_Pa"].mean()), float(first["static_temperature_K"].mean())


def _move_imu(table: pd.DataFrame, aircraft: Aircraft) -> None:
    """Specific force at the centre of gravity from that at the IMU, in place."""
    x, y, z = aircraft.imu_position_m
    p, q, r = (table[f"{axis}_radps"].to_numpy() for axis in "pqr")
    step_s = float(table.index[1] - table.index[0])
    pdot, qdot, rdot = (_slope(rate, step_s) for rate in (p, q, r))
    zero = np.zeros_like(p)
    for axis, extra in zip(
        "xyz", specific_force_at(zero, zero, zero, p, q, r, pdot, qdot, rdot, (x, y, z)), strict=True
    ):
        table[f"a{axis}_mps2"] -= extra


def _slope(rate: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
    """Derivative of a noisy rate: central difference of its half-second mean."""
    window = max(1, round(0.5 / step_s))
    smooth = pd.Series(rate).rolling(window, center=True, min_periods=1).mean().to_numpy()
    return np.gradient(smooth, step_s)


def _add_thrust(table: pd.DataFrame, propeller: Propeller) -> None:
    """Thrust [N], advance ratio and whether the propeller's table covers it, in place (3.48; J of the whole speed)."""
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


def bank_rad(table: pd.DataFrame, time_constant_s: float = 3.0) -> NDArray[np.float64]:
    """Bank angle in near-straight flight from the lateral balance, quick parts from the roll rate.

    (3.7) solved for phi with v = V beta: g cos(theta) sin(phi) = vdot - p w + r u - ay. It never takes the
    accelerometer for the vertical. Blended with the integral of p at `time_constant_s`; in gaps it returns to level.
    """
    step_s = float(table.index[1] - table.index[0])
    V, alpha, beta = (table[c].to_numpy() for c in ("V_mps", "alpha_rad", "beta_rad"))
    p, r, ay = (table[c].to_numpy() for c in ("p_radps", "r_radps", "ay_mps2"))
    v = V * np.sin(np.nan_to_num(beta))  # where sideslip is not known, none
    balance = (_slope(v, step_s) - p * V * np.sin(alpha) + r * V * np.cos(alpha) - ay) / GRAVITY_MPS2
    slow = np.arcsin(np.clip(np.nan_to_num(balance), -1, 1))
    rate = np.nan_to_num(p)
    return _complementary(slow, rate, step_s, time_constant_s)


def _complementary(
    slow: NDArray[np.float64], rate: NDArray[np.float64], step_s: float, time_constant_s: float
) -> NDArray[np.float64]:
    """Low-passed `slow` plus high-passed integral of `rate`, run forward and backward and averaged: no lag."""
    keep = np.exp(-step_s / time_constant_s)

    def one_way(angle: NDArray[np.float64], rate: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.empty_like(angle)
        state = float(np.mean(angle[: max(1, round(time_constant_s / step_s))]))
        for i, (a, w) in enumerate(zip(angle, rate, strict=True)):
            state = keep * (state + w * step_s) + (1 - keep) * a
            out[i] = state
        return out

    return (one_way(slow, rate) + one_way(slow[::-1], -rate[::-1])[::-1]) / 2
