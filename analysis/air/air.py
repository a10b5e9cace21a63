"""Air data at the center of gravity from the probe's pressures: speed, flow angles, density, height, thrust, bank."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.air.probe import ProbeCalibration, flow_at_probe
from flightpower.analysis.air.settings import AIR
from flightpower.analysis.sources.daemon import COLUMNS, SPEED_SCALE
from flightpower.analysis.sources.grid_settings import CHANNELS, STATISTICS
from flightpower.analysis.sources.rest import FORCES
from flightpower.flight import runs
from flightpower.flight.aircraft import VIBRATION_REVPS, Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import density, height_at, temperature_at
from flightpower.flight.motion import specific_force_at
from flightpower.flight.propeller import Propeller
from flightpower.flight.runs import AIRCRAFT_SIZE, LEVEL_RUN, STANDING, flying_Pa
from flightpower.flight.units import GRAVITY_MPS2


def specific_force_at_cg(table: pd.DataFrame, aircraft: Aircraft) -> pd.DataFrame:
    """Replace the specific force at the IMU in the table by that at the center of gravity, corrected for the offsets,
    scales and vibration effects of the accelerometers that the aircraft file states."""
    extra = _force_by_rotation(table, aircraft.imu_position_m)
    square = np.nan_to_num(table["n_revps"].to_numpy(dtype=float) / VIBRATION_REVPS) ** 2  # 0 where the motor stands
    mounted = aircraft.installation
    aircraft_errors = (
        mounted.accelerometer_offset_mps2,
        mounted.accelerometer_scale_fraction,
        mounted.accelerometer_vibration_mps2,
    )
    return table.assign(
        **{
            name: (table[name] - offset - at_100 * square) / (1 + scale) - more
            for name, more, offset, scale, at_100 in zip(FORCES, extra, *aircraft_errors, strict=True)
        }
    )


def _force_by_rotation(table: pd.DataFrame, position_m: tuple[float, float, float]) -> tuple[Array, ...]:
    """Specific force, three arrays (n,), that rotation adds at a position relative to the center of gravity."""
    p, q, r = (table[f"{axis}_radps"].to_numpy() for axis in "pqr")
    step_s = float(table.index[1] - table.index[0])
    zero = np.zeros_like(p)
    rates_dot = tuple(derivative(rate, step_s) for rate in (p, q, r))
    return tuple(specific_force_at((zero, zero, zero), (p, q, r), rates_dot, position_m))


def with_sensors_elsewhere(air: pd.DataFrame, aircraft: Aircraft, other: Aircraft) -> pd.DataFrame:
    """Convert air data (`air_data`) of `aircraft` to what the same readings give with another aircraft file's positions
    of probe and IMU, and its upwash."""
    ahead_m = other.probe.position_m[0] - aircraft.probe.position_m[0]
    moved_m = np.subtract(other.imu_position_m, aircraft.imu_position_m)
    by_rotation = _force_by_rotation(air, (float(moved_m[0]), float(moved_m[1]), float(moved_m[2])))
    force = {name: air[name] - more for name, more in zip(FORCES, by_rotation, strict=True)}
    CL_per_az = -aircraft.mass_kg / (air["qbar_Pa"] * aircraft.geometry.wing_area_m2)
    upwash_before_rad = aircraft.probe.upwash_per_CL_rad * CL_per_az * air["az_mps2"]
    changes = {
        "alpha_by_upwash_rad": other.probe.upwash_per_CL_rad * CL_per_az * force["az_mps2"] - upwash_before_rad,
        "alpha_by_rotation_rad": -air["q_radps"] * ahead_m / air["V_mps"],
        "beta_by_rotation_rad": air["r_radps"] * ahead_m / air["V_mps"],
    }
    return air.assign(
        alpha_rad=air["alpha_rad"] - changes["alpha_by_upwash_rad"] - changes["alpha_by_rotation_rad"],
        beta_rad=air["beta_rad"] - changes["beta_by_rotation_rad"],
        **{name: air.get(name, 0.0) + change for name, change in changes.items()},
        **force,
    )


def derivative(signal: Array, step_s: float) -> Array:
    """Central difference of a uniformly sampled signal's mean over AIR.derivative_s, (n,) [its unit per second]."""
    window = max(1, round(AIR.derivative_s / step_s))
    smooth = pd.Series(signal).rolling(window, center=True, min_periods=1).mean().to_numpy()
    return np.asarray(np.gradient(smooth, step_s), dtype=float)


def bank_angle(table: pd.DataFrame) -> Array:
    """Bank angle in nearly straight flight [rad], (n,), positive with the right wing down.

    table: air data at the center of gravity with V_mps, alpha_rad, beta_rad, p_radps, r_radps, ay_mps2.
    (3.7) solved for phi with v = V sin(beta) and cos(theta) = 1: g sin(phi) = vdot - p w + r u - ay. The accelerometer
    alone would not show the vertical in a turn. In gaps the angle returns to zero.
    """
    step_s = float(table.index[1] - table.index[0])
    V, alpha, beta = (table[c].to_numpy() for c in ("V_mps", "alpha_rad", "beta_rad"))
    p, r, ay = (table[c].to_numpy() for c in ("p_radps", "r_radps", "ay_mps2"))
    v = V * np.sin(np.nan_to_num(beta))  # unknown sideslip is taken as zero
    balance = (derivative(v, step_s) - p * V * np.sin(alpha) + r * V * np.cos(alpha) - ay) / GRAVITY_MPS2
    slow = np.arcsin(np.clip(np.nan_to_num(balance), -1, 1))
    return _complementary(slow, np.nan_to_num(p), step_s)


def _complementary(slow: Array, rate: Array, step_s: float) -> Array:
    """Low-passed `slow` plus high-passed integral of `rate`, averaged over passes forward and backward: no lag."""
    keep = np.exp(-step_s / LEVEL_RUN.bank_time_constant_s)

    def one_way(angle: Array, rate: Array) -> Array:
        out = np.empty_like(angle)
        state = float(np.mean(angle[: max(1, round(LEVEL_RUN.bank_time_constant_s / step_s))]))
        for i, (a, w) in enumerate(zip(angle, rate, strict=True)):
            state = keep * (state + w * step_s) + (1 - keep) * a
            out[i] = state
        return out

    return (one_way(slow, rate) + one_way(slow[::-1], -rate[::-1])[::-1]) / 2


class AirData(NamedTuple):
    """The synchronized table with air data columns, and notes on what was lost, assumed or corrected."""

    table: pd.DataFrame
    notes: list[str]


def air_data(
    table: pd.DataFrame, aircraft: Aircraft, probe: ProbeCalibration, propeller: Propeller, speed_scale: float
) -> AirData:
    """The table with speed, angles, density, height, thrust, bank and `flying` added.

    table: with zeros at rest subtracted, and specific forces at the center of gravity. speed_scale: of the aircraft, at
    most 1.
    Angles hold at the center of gravity: they are corrected for upwash, for the probe's velocity due to rotation, and
    for the bending of its boom.
    """
    notes: list[str] = []
    out = table.copy()
    out[SPEED_SCALE] = runs.speed_ratio(aircraft.mass.weight_N, aircraft.geometry.wing_area_m2)
    least_Pa = flying_Pa(speed_scale)
    for name in ("dp_alpha_Pa", "dp_beta_Pa", "q_c_Pa"):
        if _stuck(out[name], out["q_c_Pa"], least_Pa):
            out[name] = np.nan
            notes.append(
                f"{COLUMNS[name][0]} never changed in flight and is left out: a broken transducer or a blocked tube."
            )
    sideslip = out["dp_beta_Pa"].to_numpy(dtype=float)
    if np.isnan(sideslip).all():
        notes.append("No sideslip pressure in this log: sideslip is not known; the other air data assume zero.")
        out["dp_beta_Pa"] = 0.0
    start_Pa, start_K = _where_it_began(out)
    above_start_m = height_at(out["static_Pa"], ground_pressure_Pa=start_Pa, ground_temperature_K=start_K)
    start_m, of_start = _height_of_start(above_start_m, out["q_c_Pa"], least_Pa)
    notes += of_start
    out["height_m"] = above_start_m + start_m
    out["temperature_K"] = temperature_at(above_start_m, start_K)
    rho = density(out["static_Pa"], out["temperature_K"])

    dp_beta = np.nan_to_num(sideslip)  # the maps take missing sideslip as zero
    # Division by a noisy number biases the mean, and so does a root: near the stall by 0.5 % of angle and 0.07 % of
    # speed. So quotients use the mean of q_c, and speed is linear in the deviation of q_c from its mean. The bias is in
    # proportion to the variance of noise over dynamic pressure, so to one over the fourth power of speed: for slower
    # aircraft, pressure differences are averaged over that many more samples.
    step_s = table.index[1] - table.index[0]
    window = max(1, round(CHANNELS.smoothing_s / speed_scale**2 / step_s))
    mean_q_c = out["q_c_Pa"].rolling(window, center=True, min_periods=1).mean().to_numpy()
    known_q_c = np.where(out["q_c_Pa"].notna(), mean_q_c, np.nan)
    flow = flow_at_probe(probe, out["dp_alpha_Pa"].to_numpy(), dp_beta, known_q_c, samples=round(speed_scale**-4))
    deviation = out["q_c_Pa"].to_numpy() / np.where(mean_q_c == 0, np.nan, mean_q_c) - 1
    flying = (flow.qbar_Pa > least_Pa) & flow.inside
    nan_on_ground = np.where(flying, 1.0, np.nan)
    V = np.sqrt(2 * flow.qbar_Pa * nan_on_ground / rho) * (1 + deviation / 2)

    CL = -aircraft.mass_kg * out["az_mps2"] / (flow.qbar_Pa * nan_on_ground * aircraft.geometry.wing_area_m2)
    x_probe = aircraft.probe.position_m[0]  # ahead of the center of gravity
    out["flying"] = flying
    out["qbar_Pa"] = flow.qbar_Pa * (1 + deviation) * nan_on_ground
    out["rho"] = rho
    out["V_mps"] = V
    out["dalpha_dlndp_alpha_rad"] = flow.dalpha_dlndp_alpha_rad * nan_on_ground
    out["dlnV_dlndp_alpha"] = flow.dlnV_dlndp_alpha * nan_on_ground
    # Rotation moves a probe ahead of the center of gravity upwards at q x and to the right at r x.
    out["alpha_by_upwash_rad"] = aircraft.probe.upwash_per_CL_rad * CL
    out["alpha_by_rotation_rad"] = -out["q_radps"] * x_probe / V
    bent_rad = aircraft.probe.boom_bending_rad * -out["az_mps2"] / GRAVITY_MPS2
    at_probe_rad = flow.alpha_rad * nan_on_ground - bent_rad
    out["alpha_rad"] = at_probe_rad - out["alpha_by_upwash_rad"] - out["alpha_by_rotation_rad"]
    measured = np.where(np.isfinite(sideslip), flow.beta_rad * nan_on_ground, np.nan)
    out["beta_by_rotation_rad"] = out["r_radps"] * x_probe / V
    out["beta_rad"] = measured - out["beta_by_rotation_rad"]
    out["bank_rad"] = bank_angle(out)
    _add_thrust(out, propeller)
    notes += _slow_flight(out["height_m"].to_numpy(), flow.qbar_Pa, least_Pa, speed_scale)
    outside = ~flow.inside[flow.qbar_Pa > least_Pa]
    if len(outside) and np.mean(outside) > STATISTICS.unmentioned_share:
        notes.append(
            f"{100 * np.mean(outside):.0f} % of the flight lies outside the probe's calibrated range of angles"
            " and is left out."
        )
    return AirData(out, notes)


def _slow_flight(height_m: Array, qbar_Pa: Array, least_Pa: float, speed_scale: float) -> list[str]:
    """A note where much of the time aloft has too little dynamic pressure to count as flight."""
    aloft = height_m > AIRCRAFT_SIZE.least_height_m * speed_scale
    share = float(np.mean(qbar_Pa[aloft] <= least_Pa)) if aloft.any() else 0.0
    if share <= STATISTICS.unmentioned_share:
        return []
    return [
        f"{100 * share:.0f} % of the time above {AIRCRAFT_SIZE.least_height_m * speed_scale:.0f} m has a dynamic"
        f" pressure below {least_Pa:.0f} Pa, too little for this aircraft to fly level, and is left out."
    ]


def _stuck(pressure: pd.Series, q_c: pd.Series, least_Pa: float) -> bool:
    """Whether a transducer read the same value throughout the flight; a working one shows at least noise."""
    flown = pressure[q_c > least_Pa].dropna() if pressure.name != "q_c_Pa" else pressure.dropna()
    return len(flown) > CHANNELS.fewest_samples and float(flown.max() - flown.min()) < AIR.stuck_Pa


def _where_it_began(table: pd.DataFrame) -> tuple[float, float]:
    """Pressure [Pa] and air temperature [K] where the log began.

    Electronics warm the tray by ten degrees within minutes, which would be three percent of density. At power-on they
    have the temperature of the air. So the transducer's first reading gives the air temperature there; the standard
    lapse rate gives the temperature at height.
    """
    start = table[["static_Pa", "static_temperature_K"]].dropna()
    first = start.loc[: start.index[0] + AIR.cold_s]
    return float(first["static_Pa"].mean()), float(first["static_temperature_K"].mean())


def _height_of_start(above_start_m: pd.Series, q_c_Pa: pd.Series, least_Pa: float) -> tuple[float, list[str]]:
    """Height [m] above the ground where the log began, and a note; 0 where it began on the ground.

    An aircraft that has its airspeed from the first second on is in the air, as in a segment that was cut out of a
    flight. If there is no airspeed at the end, the aircraft has landed. Otherwise the ground is assumed below the
    lowest point by twice the least height of runs: an aircraft that flies maneuvers is far above the ground.
    """
    pressure = q_c_Pa.dropna()
    if pressure.empty or pressure.loc[: pressure.index[0] + AIR.cold_s].min() <= least_Pa:
        return 0.0, []
    last = pressure.loc[pressure.index[-1] - AIR.cold_s :]
    if last.max() <= least_Pa:
        return -float(above_start_m.loc[last.index[0] :].mean()), [
            "This log begins in the air. Heights are above the ground where it ends."
        ]
    assumed_m = 2 * AIRCRAFT_SIZE.least_height_m
    return assumed_m - float(above_start_m.min()), [
        f"This log begins and ends in the air: heights are above a ground assumed {assumed_m:.0f} m below its lowest"
        " point."
    ]


def _add_thrust(table: pd.DataFrame, propeller: Propeller) -> None:
    """Add thrust, shaft power, advance ratio and whether the propeller table covers them, in place (3.48).

    The advance ratio uses the whole airspeed.
    """
    n = table["n_revps"].to_numpy()
    turning = n > STANDING.motor_revps
    n_safe = np.where(turning, n, 1.0)
    V = table["V_mps"].to_numpy()
    thrust, shaft = propeller.thrust_and_power(V, n_safe, table["rho"].to_numpy())
    J = V / (n_safe * propeller.diameter_m)
    table["J"] = np.where(turning, J, np.nan)
    table["thrust_N"] = np.where(turning, thrust, np.nan)
    table["shaft_power_W"] = np.where(turning, shaft, np.nan)
    table["propeller_covered"] = turning & propeller.covers(J, 60 * n_safe)
