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

# Standard deviations over many probes, IMUs and propeller tables.
PRIORS = Priors(
    alpha_bias_rad=np.radians(1.0),
    accelerometer_bias_mps2=0.19,  # uniform within 0.3 m/s^2, and half a degree of misalignment under 1 g
    V_scale=0.0125,
    V_bias_mps=0.15,
    thrust_scale=0.018,
)
UNZEROED_GYRO_RADPS = 0.02  # an MPU9250's zero-rate output at room temperature, uncalibrated


def priors(aircraft: Aircraft, *, zeroed: bool) -> Priors:
    """Priors of the sensor errors. zeroed: the gyro biases at rest were subtracted."""
    alpha_scale = math.hypot(PRIORS.alpha_scale, alpha_scale_sigma(aircraft))
    gyro_bias = PRIORS.gyro_bias_radps if zeroed else UNZEROED_GYRO_RADPS
    return replace(PRIORS, alpha_scale=alpha_scale, gyro_bias_radps=gyro_bias)


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
    n, rho = table["n_revps"].where(table["n_revps"] > 1), table["rho"]

    def thrust(V: pd.Series) -> pd.Series:
        thrust_N: pd.Series = propeller.thrust_and_power(V, n, rho)[0]
        return thrust_N

    signals = {name: table[column] for name, column in INPUTS.items()}
    signals["thrust"] = thrust(V_ref)
    signals["thrust_per_speed"] = (thrust(V_ref + SPEED_STEP_MPS) - thrust(V_ref - SPEED_STEP_MPS)) / (
        2 * SPEED_STEP_MPS
    )
    signals["J"] = V_ref / (n * propeller.diameter_m)
    signals["V_ref"] = V_ref
    signals["phi"] = table["bank_rad"]
    segments = []
    for run in runs:
        count = (run.rows.stop - run.rows.start) // block
        if count < SHORTEST:
            continue
        rows = slice(run.rows.start, run.rows.start + count * block)
        segments.append(
            Segment(
                name=run.name,
                t_s=table.index.to_numpy()[rows].reshape(count, block).mean(axis=1),
                u={name: _means(_filled(signal.iloc[rows]), block) for name, signal in signals.items()},
                z={name: _means(table[column].iloc[rows], block) for name, column in OUTPUTS.items()},
            )
        )
    return segments


def _means(signal: pd.Series, block: int) -> Array:
    return signal.groupby(np.arange(len(signal)) // block).mean().to_numpy()


def _filled(signal: pd.Series) -> pd.Series:
    """Gaps interpolated linearly; zero where nothing was measured at all."""
    return signal.interpolate(limit_direction="both").fillna(0.0)
