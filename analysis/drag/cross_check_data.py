"""The cross-check's data and priors: runs as segments for estimators that integrate the equations of motion."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag.assumed_values import alpha_scale_sigma
from analysis.estimation.aircraft_models import Priors
from analysis.estimation.data import Segment
from analysis.maneuvers.kinds import Maneuver
from analysis.signals.aircraft_size import speed_scale_of
from analysis.signals.gaps import without_gaps
from flight.aircraft import Aircraft
from flight.propeller import Propeller

Array = NDArray[np.float64]

INPUTS = {
    "elevator": "elevator_rad",
    "q": "q_radps",
    "p": "p_radps",
    "r": "r_radps",
    "beta": "beta_rad",
    "rho": "rho",
}
OUTPUTS = {"V": "V_mps", "alpha": "alpha_rad", "ax": "ax_mps2", "az": "az_mps2", "h": "height_m"}
SMOOTHING_S = 0.5  # of V_ref, at which thrust is read from the table; the model adds thrust_per_speed (V - V_ref)
SPEED_STEP_MPS = 0.3  # for the slope of thrust over speed
LEAST_SPEED_MPS = 5.0  # times the speed scale
SHORTEST = 12  # blocks of a run

V_BIAS_MPS = 0.15
UNZEROED_GYRO_RADPS = 0.02  # an MPU9250's zero-rate output at room temperature, uncalibrated


def priors(aircraft: Aircraft, *, zeroed: bool) -> Priors:
    """Priors of the sensor errors and of thrust. zeroed: the gyro biases at rest were subtracted."""
    stated = aircraft.uncertainty
    known = Priors(
        alpha_bias_rad=stated.angle_of_attack_offset_rad,
        alpha_scale=math.hypot(stated.angle_of_attack_slope_fraction, alpha_scale_sigma(aircraft)),
        accelerometer_bias_mps2=stated.accelerometer_offset_mps2,
        V_scale=stated.airspeed_scale_fraction,
        V_bias_mps=V_BIAS_MPS,
        thrust_scale=stated.thrust_scale_fraction,
        thrust_slope=stated.thrust_slope,
    )
    return known if zeroed else replace(known, gyro_bias_radps=UNZEROED_GYRO_RADPS)


def segments_of(table: pd.DataFrame, runs: list[Maneuver], propeller: Propeller, *, block: int) -> list[Segment]:
    """Inputs and outputs of `models.level_run`, means over `block` samples. table: from `air_data`.

    Gaps in inputs are interpolated. Blocks without a sample of an output are left out, and so are runs of fewer than
    SHORTEST blocks.
    """
    step_s = float(table.index[1] - table.index[0])
    width = max(1, round(SMOOTHING_S / step_s))
    V_ref = table["V_mps"].interpolate(limit_direction="both").rolling(width, center=True, min_periods=1).mean()
    least_mps = LEAST_SPEED_MPS * speed_scale_of(table)
    V_ref = V_ref.fillna(least_mps).clip(lower=least_mps)
    n, rho = table["n_revps"].where(table["n_revps"] > 1).to_numpy(), table["rho"].to_numpy()
    measured = {name: table[column].to_numpy() for name, column in (INPUTS | {"phi": "bank_rad"}).items()}
    measured["V_ref"] = V_ref.to_numpy()
    outputs = {name: table[column].to_numpy() for name, column in OUTPUTS.items()}
    t_s = table.index.to_numpy()
    segments = []
    for run in runs:
        count = (run.rows.stop - run.rows.start) // block
        if count < SHORTEST:
            continue
        rows = slice(run.rows.start, run.rows.start + count * block)
        inputs = {name: signal[rows] for name, signal in measured.items()}
        inputs |= _propulsion(inputs["V_ref"], n[rows], rho[rows], propeller)
        segments.append(
            Segment(
                name=run.name,
                t_s=t_s[rows].reshape(count, block).mean(axis=1),
                u={name: _means(_filled(signal), block) for name, signal in inputs.items()},
                z={name: _means(signal[rows], block) for name, signal in outputs.items()},
            )
        )
    return segments


def _propulsion(V_ref: Array, n: Array, rho: Array, propeller: Propeller) -> dict[str, Array]:
    """Thrust of the table at V_ref, its slope over speed, and the advance ratio, each (n,)."""
    thrust_N, faster_N, slower_N = (
        np.asarray(propeller.thrust_and_power(V, n, rho)[0])
        for V in (V_ref, V_ref + SPEED_STEP_MPS, V_ref - SPEED_STEP_MPS)
    )
    slope = (faster_N - slower_N) / (2 * SPEED_STEP_MPS)
    return {"thrust": thrust_N, "thrust_per_speed": slope, "J": V_ref / (n * propeller.diameter_m)}


def _means(signal: Array, block: int) -> Array:
    """Of the samples of each block that exist; NaN where none does."""
    blocks = signal.reshape(-1, block)
    count = np.isfinite(blocks).sum(axis=1)
    return np.asarray(np.nansum(blocks, axis=1) / np.where(count > 0, count, np.nan))


def _filled(signal: Array) -> Array:
    """Gaps interpolated linearly; zero where nothing was measured at all."""
    return np.nan_to_num(without_gaps(signal))
