"""A flight of a small aircraft as a table of consistent columns: what its sensors would show, with their noise."""

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import csv

from flightpower.flight.atmosphere import density, pressure_at, temperature_at
from flightpower.flight.units import GRAVITY_MPS2 as g

MASS_KG, AREA_M2, SPAN_M = 3.0, 0.5, 2.0
STEP_S, LASTS_S = 0.1, 420.0
CD0, K, EFFICIENCY, IDLE_W = 0.05, 0.06, 0.6, 4.0
WIND_MPS = (3.0, -4.0)

MAP = {
    "time": ("t_s", "s"), "true_airspeed": ("tas_mps", "m/s"), "height": ("height_m", "m"),
    "static_pressure": ("ps_Pa", "Pa"), "air_temperature": ("oat_K", "K"),
    "angle_of_attack": ("alpha_deg", "deg"), "specific_force_forward": ("ax_mps2", "m/s^2"),
    "specific_force_right": ("ay_mps2", "m/s^2"), "specific_force_down": ("az_mps2", "m/s^2"),
    "roll_rate": ("gyro_p_degps", "deg/s"), "pitch_rate": ("gyro_q_degps", "deg/s"),
    "yaw_rate": ("gyro_r_degps", "deg/s"), "roll": ("roll_deg", "deg"), "pitch": ("pitch_deg", "deg"),
    "heading": ("heading_deg", "deg"), "velocity_north": ("vn_mps", "m/s"), "velocity_east": ("ve_mps", "m/s"),
    "velocity_down": ("vd_mps", "m/s"), "battery_voltage": ("voltage_V", "V"), "battery_current": ("current_A", "A"),
    "motor_speed": ("motor_rpm", "rpm"), "throttle": ("throttle_percent", "percent"),
}  # fmt: skip


def level_power_W(V: np.ndarray, rho: float) -> np.ndarray:
    """Electrical power of level flight."""
    q = rho * V**2 / 2
    return q * AREA_M2 * V * (CD0 + K * (MASS_KG * g / q / AREA_M2) ** 2) / EFFICIENCY + IDLE_W


def flown_table(seed: int = 1) -> pd.DataFrame:
    """Circles, speed changes, climbs and descents over 400 s; columns of MAP."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, LASTS_S, STEP_S)

    def rate(x: np.ndarray) -> np.ndarray:
        return np.gradient(x, STEP_S)

    V = 16 + 2.5 * np.sin(0.11 * t) + 1.0 * np.sin(0.31 * t + 1)
    h = 120 + 15 * np.sin(0.05 * t) + 6 * np.sin(0.17 * t + 2)
    roll = np.radians(20 * np.sin(0.07 * t) + 12 * np.sin(0.23 * t))
    heading = np.cumsum(g * np.tan(roll) / V) * STEP_S
    path = np.arcsin(rate(h) / V)
    rho = density(pressure_at(h), temperature_at(h))
    load = np.cos(path) / np.cos(roll)
    q_S = rho * V**2 / 2 * AREA_M2
    CL = load * MASS_KG * g / q_S
    alpha = (CL - 0.3) / 4.5
    pitch = path + alpha * np.cos(roll)
    drag = q_S * (CD0 + K * CL**2)
    along = rate(V) + g * np.sin(path)
    thrust_power_W = np.maximum(drag * V + MASS_KG * V * along, 0.0)
    power = thrust_power_W / EFFICIENCY + IDLE_W
    voltage = 16.0 - 0.02 * power / 16
    revps = 20 + 14 * np.cbrt(power)
    normal = load * g
    force_x = along * np.cos(alpha) + normal * np.sin(alpha)
    force_z = along * np.sin(alpha) - normal * np.cos(alpha)
    turn, roll_rate, pitch_rate = rate(heading), rate(roll), rate(pitch)
    p = roll_rate - turn * np.sin(pitch)
    q = pitch_rate * np.cos(roll) + turn * np.cos(pitch) * np.sin(roll)
    r = turn * np.cos(pitch) * np.cos(roll) - pitch_rate * np.sin(roll)
    columns = {
        "t_s": t, "tas_mps": V, "height_m": h, "ps_Pa": pressure_at(h), "oat_K": temperature_at(h),
        "alpha_deg": np.degrees(alpha), "ax_mps2": force_x, "ay_mps2": 0 * t, "az_mps2": force_z,
        "gyro_p_degps": np.degrees(p), "gyro_q_degps": np.degrees(q), "gyro_r_degps": np.degrees(r),
        "roll_deg": np.degrees(roll), "pitch_deg": np.degrees(pitch), "heading_deg": np.degrees(heading) % 360,
        "vn_mps": V * np.cos(path) * np.cos(heading) + WIND_MPS[0],
        "ve_mps": V * np.cos(path) * np.sin(heading) + WIND_MPS[1], "vd_mps": -rate(h),
        "voltage_V": voltage, "current_A": power / voltage, "motor_rpm": 60 * revps,
        "throttle_percent": np.clip(0.9 * (revps - 20), 0, 100),
    }  # fmt: skip
    noise = {"tas_mps": 0.2, "ax_mps2": 0.2, "ay_mps2": 0.2, "az_mps2": 0.3, "ps_Pa": 2.0, "current_A": 0.1}
    for name, sigma in noise.items():
        columns[name] = columns[name] + sigma * rng.normal(size=len(t))
    return pd.DataFrame(columns)


def map_text(entries: dict[str, tuple[str, str]] | None = None, **extra: str) -> str:
    """The text of a map; `extra` adds lines to the entry of a quantity."""
    lines = []
    for quantity, (column, unit) in (MAP if entries is None else entries).items():
        lines += [f"[{quantity}]", f'column = "{column}"', f'unit = "{unit}"', extra.get(quantity, "")]
    return "\n".join(lines) + "\n"


def written(folder: Path, table: pd.DataFrame, text: str | None = None) -> Path:
    """Write a CSV file with its map beside it."""
    path = folder / "flight.csv"
    write_csv(path, table)
    (folder / "flight.csv.columns.toml").write_text(map_text() if text is None else text)
    return path


def write_csv(path: Path, table: pd.DataFrame) -> None:
    """Write what `table.to_csv` writes for columns of numbers, in an eighth of the time."""
    with path.open("wb") as file:
        file.write(table.head(0).to_csv(index=False).encode())
        csv.write_csv(pa.Table.from_pandas(table, preserve_index=False), file, csv.WriteOptions(include_header=False))
