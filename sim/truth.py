"""Makes the table of a flight's true values (states, forces, coefficients, thrust), and the true power curve."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.motion import body_from_earth, flow_of, velocity_derivative
from flightpower.sim.air import ambient, mean_wind
from flightpower.sim.ground import Motion
from flightpower.sim.plant import AircraftState, Commands, Plant
from flightpower.sim.propulsion import power_train, throttle_for
from flightpower.sim.trim import Trimmer, power_required

Columns = dict[str, NDArray[Any]]
METADATA_KEY = b"flightpower"


class Prescribed(NamedTuple):
    """Prescribed motion; controls and motor speed are `share` (n,) times those at its airborne end, if it has one."""

    motion: Motion
    share: Array
    end: tuple[AircraftState, Commands] | None = None


def airborne_rows(plant: Plant, states: Array, commands: Array, white: Array | None) -> Columns:
    """Columns of a flown segment. states: (n, n_states); commands: (n, 4); white: in turbulence, noises (n, 4)."""
    x, c = AircraftState(*states.T), Commands(*commands.T)
    noises = (0.0, 0.0, 0.0, 0.0) if white is None else tuple(white.T)
    now, _ = plant.instant(x, c, noises)
    udot, vdot, wdot = velocity_derivative((x.u, x.v, x.w), (x.p, x.q, x.r), x.phi, x.theta, now.specific_force)
    m, S = plant.mass_kg, plant.aircraft.geometry.wing_area_m2
    q_bar = now.density * now.V**2 / 2
    ca, sa = np.cos(now.alpha), np.sin(now.alpha)
    CX, CZ = now.CL * sa - now.CD * ca, -now.CL * ca - now.CD * sa
    geometry = plant.aircraft.geometry
    columns = {
        "phase": "flight",
        "north_m": x.north,
        "east_m": x.east,
        "height_m": -x.down,
        "velocity_north_mps": now.ground_velocity[0],
        "velocity_east_mps": now.ground_velocity[1],
        "velocity_down_mps": now.ground_velocity[2],
        "u_mps": x.u,
        "v_mps": x.v,
        "w_mps": x.w,
        "udot_mps2": udot,
        "vdot_mps2": vdot,
        "wdot_mps2": wdot,
        "roll_rad": x.phi,
        "pitch_rad": x.theta,
        "yaw_rad": x.psi,
        "p_radps": x.p,
        "q_radps": x.q,
        "r_radps": x.r,
        "pdot_radps2": now.angular_acceleration[0],
        "qdot_radps2": now.angular_acceleration[1],
        "rdot_radps2": now.angular_acceleration[2],
        "V_mps": now.V,
        "alpha_rad": now.alpha,
        "beta_rad": now.beta,
        "dynamic_pressure_Pa": q_bar,
        "static_pressure_Pa": now.pressure,
        "temperature_K": now.temperature,
        "density_kgpm3": now.density,
        "wind_north_mps": now.wind[0],
        "wind_east_mps": now.wind[1],
        "wind_down_mps": now.wind[2],
        "gust_u_mps": now.gust.u,
        "gust_v_mps": now.gust.v,
        "gust_w_mps": now.gust.w,
        "gust_p_radps": now.gust.p,
        "gust_q_radps": now.gust.q,
        "gust_r_radps": now.gust.r,
        "elevator_rad": x.elevator,
        "aileron_rad": x.aileron,
        "rudder_rad": x.rudder,
        "elevator_command_rad": c.elevator,
        "aileron_command_rad": c.aileron,
        "rudder_command_rad": c.rudder,
        "throttle": c.throttle,
        "motor_speed_revps": x.motor,
        "advance_ratio": now.V / (np.maximum(x.motor, 1e-3) * plant.propeller.diameter_m),
        "thrust_N": now.train.thrust_N,
        "shaft_power_W": now.train.shaft_power_W,
        "battery_voltage_V": now.train.battery_voltage_V,
        "battery_current_A": now.train.battery_current_A,
        "battery_energy_J": x.energy,
        "CL": now.CL,
        "CD": now.CD,
        "CY": now.CY,
        "Cl": now.Cl,
        "Cm": now.Cm,
        "Cn": now.Cn,
        "CX": CX,
        "CZ": CZ,
        "lift_N": now.CL * q_bar * S,
        "drag_N": now.CD * q_bar * S,
        "force_x_N": now.specific_force[0] * m,
        "force_y_N": now.specific_force[1] * m,
        "force_z_N": now.specific_force[2] * m,
        "moment_x_Nm": now.Cl * q_bar * S * geometry.span_m,
        "moment_y_Nm": now.Cm * q_bar * S * geometry.chord_m,
        "moment_z_Nm": now.Cn * q_bar * S * geometry.span_m,
        "specific_force_x_mps2": now.specific_force[0],
        "specific_force_y_mps2": now.specific_force[1],
        "specific_force_z_mps2": now.specific_force[2],
        "upwash_rad": plant.aircraft.probe.upwash_per_CL_rad * now.CL,
    }
    return {name: np.broadcast_to(value, len(states)) for name, value in columns.items()}


def kinematic_rows(plant: Plant, prescribed: Prescribed, *, phase: str, energy_J: float, dt: float) -> Columns:
    """Columns of prescribed motion on the ground, in take-off and landing. energy_J: energy already taken from the
    battery.

    There are no columns of aerodynamic coefficients and moments, which are unknown here: the wheels carry part of the
    load.
    """
    motion, share, end = prescribed
    n = len(share)
    north, east, down = motion.position.T
    air = ambient(plant.air, -down)
    wind = mean_wind(plant.air, north, east, -down, plant.deviations.updraft_mps)
    phi, theta, psi = motion.attitude.T
    u, v, w = motion.body_velocity.T
    wind_body = body_from_earth(wind, (phi, theta, psi))
    # At zero airspeed the flow angles are undefined; 1e-9 m/s defines them.
    gusts, upwash_rad = _at_the_end(plant, end)
    state, commands = end or (None, None)
    flow = flow_of(
        u - wind_body[0] - share * gusts["gust_u_mps"] + 1e-9,
        v - wind_body[1] - share * gusts["gust_v_mps"],
        w - wind_body[2] - share * gusts["gust_w_mps"],
    )
    p, q, r = motion.rates.T
    force = motion.specific_force.T
    udot, vdot, wdot = velocity_derivative((u, v, w), (p, q, r), phi, theta, force)
    motor = share * (state.motor if state else 0.0)
    train = _steady_train(plant, flow.V, motor, air.density)
    rows: dict[str, Any] = dict(
        phase=phase,
        north_m=north,
        east_m=east,
        height_m=-down,
        velocity_north_mps=motion.velocity[:, 0],
        velocity_east_mps=motion.velocity[:, 1],
        velocity_down_mps=motion.velocity[:, 2],
        u_mps=u,
        v_mps=v,
        w_mps=w,
        udot_mps2=udot,
        vdot_mps2=vdot,
        wdot_mps2=wdot,
        roll_rad=phi,
        pitch_rad=theta,
        yaw_rad=psi,
        p_radps=p,
        q_radps=q,
        r_radps=r,
        pdot_radps2=motion.angular_acceleration[:, 0],
        qdot_radps2=motion.angular_acceleration[:, 1],
        rdot_radps2=motion.angular_acceleration[:, 2],
        V_mps=flow.V,
        alpha_rad=flow.alpha,
        beta_rad=flow.beta,
        dynamic_pressure_Pa=air.density * flow.V**2 / 2,
        static_pressure_Pa=air.pressure,
        temperature_K=air.temperature,
        density_kgpm3=air.density,
        wind_north_mps=wind[0],
        wind_east_mps=wind[1],
        wind_down_mps=wind[2],
        elevator_rad=share * (state.elevator if state else 0.0),
        aileron_rad=share * (state.aileron if state else 0.0),
        rudder_rad=share * (state.rudder if state else 0.0),
        elevator_command_rad=share * (commands.elevator if commands else 0.0),
        aileron_command_rad=share * (commands.aileron if commands else 0.0),
        rudder_command_rad=share * (commands.rudder if commands else 0.0),
        motor_speed_revps=motor,
        advance_ratio=flow.V / (np.maximum(motor, 1e-3) * plant.propeller.diameter_m),
        battery_energy_J=energy_J + np.cumsum(train["battery_voltage_V"] * train["battery_current_A"]) * dt,
        force_x_N=force[0] * plant.mass_kg,
        force_y_N=force[1] * plant.mass_kg,
        force_z_N=force[2] * plant.mass_kg,
        specific_force_x_mps2=force[0],
        specific_force_y_mps2=force[1],
        specific_force_z_mps2=force[2],
        upwash_rad=share * upwash_rad,
        **{name: share * value for name, value in gusts.items()},
        **train,
    )
    return {name: np.broadcast_to(value, n) for name, value in rows.items()}


def table_of(parts: Sequence[Columns], dt: float) -> pd.DataFrame:
    """Join the parts of a flight in sequence, `dt` apart; values are NaN where a part lacks a column."""
    lengths = [len(part["segment"]) for part in parts]
    columns: dict[str, NDArray[Any]] = {"time_s": np.arange(sum(lengths)) * dt}
    for name in dict.fromkeys(name for part in parts for name in part):
        columns[name] = np.concatenate(
            [part[name] if name in part else np.full(n, np.nan) for part, n in zip(parts, lengths, strict=True)]
        )
    for name in ("phase", "kind"):
        columns[name] = columns[name].astype(object)
    return pd.DataFrame(columns)


def _at_the_end(plant: Plant, end: tuple[AircraftState, Commands] | None) -> tuple[dict[str, float], float]:
    """Gust and upwash at the airborne end of prescribed motion, from where both decrease to zero at the ground."""
    names = ("gust_u_mps", "gust_v_mps", "gust_w_mps", "gust_p_radps", "gust_q_radps", "gust_r_radps")
    if end is None:
        return dict.fromkeys(names, 0.0), 0.0
    now, _ = plant.instant(*end)
    gust = {name: float(value) for name, value in zip(names, now.gust, strict=True)}
    return gust, float(plant.aircraft.probe.upwash_per_CL_rad * now.CL)


def _steady_train(plant: Plant, V: Array, n: Array, rho: Array) -> dict[str, Array]:
    """Power train along prescribed motion, with the throttle that holds the motor speed of each instant."""
    propulsion, propeller = plant.aircraft.propulsion, plant.propeller
    needed = throttle_for(propulsion, propeller, V=V, n=np.maximum(n, 1.0), rho=rho)
    throttle = np.where(n > 1.0, np.minimum(needed, 1.0), 0.0)
    turning = n > 0
    train = power_train(propulsion, propeller, V=V, n=n, throttle=throttle, rho=rho)
    return {
        "throttle": throttle,
        "thrust_N": np.where(turning, train.thrust_N, 0.0),
        "shaft_power_W": np.where(turning, train.shaft_power_W, 0.0),
        "battery_voltage_V": train.battery_voltage_V,
        "battery_current_A": train.battery_current_A,
    }


def power_required_table(plant: Plant, trimmer: Trimmer, density: float, points: int = 60) -> pd.DataFrame:
    """Table of the true P_req(V) = D V at lift = weight, from the stall to the highest level speed, at one density."""
    V = np.linspace(1.02 * trimmer.V_stall, trimmer.V_max, points)
    power, CL, CD = power_required(plant, V, density=density)
    return pd.DataFrame(
        {
            "speed_mps": V,
            "power_W": power,
            "drag_N": power / V,
            "CL": CL,
            "CD": CD,
            "density_kgpm3": density,
            "weight_N": plant.mass_kg * plant.aircraft.mass.weight_N / plant.aircraft.mass_kg,
        }
    )


def write_truth(path: Path, truth: pd.DataFrame, metadata: dict[str, Any], power_required_curve: pd.DataFrame) -> None:
    """Write the truth as Parquet, with the flight's inputs and the true curve in the file's metadata."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.Table.from_pandas(truth, preserve_index=False)
    content = {**metadata, "power_required": power_required_curve.to_dict(orient="list")}
    table = table.replace_schema_metadata({**(table.schema.metadata or {}), METADATA_KEY: json.dumps(content).encode()})
    pq.write_table(table, path, compression="zstd")


def read_truth(path: Path) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Read the truth and its metadata. Raises InputError if the file is no truth file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not path.is_file():
        raise InputError(f"{path}: no such file; give truth.parquet of a simulated flight, or its folder")
    try:
        table = pq.read_table(path)
        metadata = json.loads(table.schema.metadata[METADATA_KEY])
    except (OSError, pa.ArrowException, KeyError, TypeError, ValueError):
        raise InputError(f"{path}: not the truth of a simulated flight, which `sim fly` writes") from None
    return table.to_pandas(), metadata
