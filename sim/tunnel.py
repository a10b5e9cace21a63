"""Simulates a wind-tunnel calibration of the probe, in the format of a user's own tunnel data.

The simulated aircraft's probe is mounted on a sting. It has no upwash, no lag and less noise (long averages); the
tunnel has small systematic errors: flow angularity, and a reference speed accurate to a quarter of a percent.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from flightpower.flight.atmosphere import density
from flightpower.flight.files import check_new_file, write_file
from flightpower.sim.sensors.noise import rng_of
from flightpower.sim.sensors.probe import port_pressures

HEADER = (
    "speed [m/s]",
    "alpha [deg]",
    "beta [deg]",
    "dp_alpha [Pa]",
    "dp_beta [Pa]",
    "q_c [Pa]",
    "static [Pa]",
    "temperature [K]",
)


@dataclass(frozen=True, kw_only=True)
class WindTunnel:
    """The measured grid, and the standard deviations of the tunnel's errors."""

    speeds_mps: tuple[float, ...] = (12.0, 18.0, 25.0, 32.0)
    largest_angle_deg: float = 20.0
    step_deg: float = 4.0
    pressure_noise_Pa: float = 0.6  # noise of a mean over some seconds
    angle_setting_deg: float = 0.03
    speed_setting: float = 0.0025
    static_Pa: float = 100_300.0
    temperature_K: float = 294.0


def simulated_measurements(tunnel: WindTunnel = WindTunnel(), seed: int = 0) -> pd.DataFrame:
    """The calibration as a table with the columns of `HEADER` and one row per point."""
    n = round(tunnel.largest_angle_deg / tunnel.step_deg)
    angles = np.arange(-n, n + 1) * tunnel.step_deg
    speed, alpha, beta = (a.ravel() for a in np.meshgrid(tunnel.speeds_mps, angles, angles, indexing="ij"))
    rng = rng_of(seed, "tunnel")
    size = len(speed)
    # The true flow differs from the set one by the setting errors.
    true_alpha = alpha + tunnel.angle_setting_deg * rng.standard_normal(size)
    true_beta = beta + tunnel.angle_setting_deg * rng.standard_normal(size)
    true_speed = speed * (1 + tunnel.speed_setting * rng.standard_normal(size))
    static = tunnel.static_Pa + 15 * rng.standard_normal(size)
    temperature = tunnel.temperature_K + np.linspace(0, 1.5, size)  # the tunnel warms up
    q = density(static, temperature) * true_speed**2 / 2
    ports = port_pressures(q, np.deg2rad(true_alpha), np.deg2rad(true_beta))
    noise = tunnel.pressure_noise_Pa * rng.standard_normal((3, size))
    columns = (
        speed,
        alpha,
        beta,
        ports.lower_minus_upper + noise[0],
        ports.right_minus_left + noise[1],
        ports.center - ports.static + noise[2],
        static,
        temperature,
    )
    return pd.DataFrame(dict(zip(HEADER, columns, strict=True)))


def write_calibration(path: Path, table: pd.DataFrame, *, replace: bool = False) -> None:
    """Write the table as CSV. Raises InputError if the file exists and is not to be replaced."""
    check_new_file(path, replace=replace)
    write_file(path, table.to_csv(index=False, float_format="%.4f"))
