"""Inertial sensors as inputs of the process equations: means between instants, their noise, coning and sculling."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.sources.grid import CubicSpline, without_gaps
from flightpower.analysis.trajectory.block_means import BLOCK, BlockMeans
from flightpower.analysis.trajectory.equations import (
    SENSOR_ERRORS,
    NamedArrays,
    corrected_force,
    corrected_rates,
    vibration,
)
from flightpower.analysis.trajectory.extrapolation import extrapolated
from flightpower.analysis.trajectory.settings import SENSORS
from flightpower.flight import motion
from flightpower.flight.arrays import Array

CHANNELS = ("p_radps", "q_radps", "r_radps", "ax_mps2", "ay_mps2", "az_mps2")
_RATES, _FORCE = ("p", "q", "r"), ("ax", "ay", "az", "vibration")


class InertialInputs:
    """Rates and specific force between instants.

    mean : (n-1, 7) means of CHANNELS and of `vibration` from each instant to the next
    predicted : (n-1, 5) the means that have a scale error, predicted from past data
    angle_sigma, velocity_sigma : (n-1, 3) process noise over a step of Euler angles [rad] and of velocity [m/s]
    """

    def __init__(self, table: pd.DataFrame, blocks: BlockMeans, noise: dict[str, float]):
        """table: the table that `blocks` averages. noise: standard deviation of one sample of each of CHANNELS."""
        self._t_s, self._rate_Hz = blocks.t_s, blocks.rate_Hz
        between = slice(blocks.rows[0], blocks.rows[-1] + 1)
        self._sample_rows = np.arange(blocks.n) * BLOCK
        self._sample_t_s = table.index.to_numpy()[between]
        means, samples, missing = [], [], np.zeros(blocks.n - 1, dtype=bool)
        for name in CHANNELS:
            measured = table[name].to_numpy()
            values = _at_instants(np.nan_to_num(without_gaps(measured)))
            samples.append(values[between])
            means.append(np.diff(_integral(values)[blocks.rows]) / BLOCK)
            missing |= np.diff(np.cumsum(np.isnan(measured))[blocks.rows]) > 0
        shaken = vibration(table["n_revps"].to_numpy())
        samples.append(shaken[between])
        means.append(np.diff(_integral(shaken)[blocks.rows]) / BLOCK)
        self._samples, self.mean = np.array(samples), np.column_stack(means)
        everywhere = np.ones(len(self.mean), dtype=bool)
        scaled = [CHANNELS.index(name) for name in CHANNELS if name != "ay_mps2"]
        self.predicted = np.column_stack(
            [extrapolated(column, everywhere, blocks.step_s)[0] for column in self.mean[:, scaled].T]
        )
        self.angle_sigma, self.velocity_sigma = _process_noise(self.mean, missing, blocks, noise)

    def coning_and_sculling(self, attitude: Array, sensor_errors: Array) -> Array:
        """Corrections (n-1, 6) of the changes of Euler angles [rad] and of velocity [m/s], order of CONING_SCULLING.

        A correction is the change integrated sample by sample along the attitude (n, 3) of the current iteration, less
        the change by mean rates and mean force at the mean attitude. Without corrections turns would tilt the whole
        trajectory by 0.05 deg.
        """
        errors = NamedArrays(SENSOR_ERRORS, sensor_errors)
        at_samples = _derivatives(CubicSpline(self._t_s, attitude)(self._sample_t_s).T, self._samples, errors)
        integral = _integral(at_samples)[self._sample_rows]
        of_means = _derivatives(((attitude[1:] + attitude[:-1]) / 2).T, self.mean.T, errors)
        return np.asarray((np.diff(integral, axis=0) / BLOCK - of_means) * BLOCK / self._rate_Hz)


def _at_instants(means: Array) -> Array:
    """Values (n,) in the middle of the intervals whose means (n,) the IMU reports (log-format.md), by a parabola."""
    values = means.copy()
    values[1:-1] -= np.diff(means, 2) / 24
    return values


def _integral(values: Array) -> Array:
    """Integral from the first sample to each, in units of the sample interval; along the first axis.

    Uses the trapezoidal rule and the first term of its error, a twelfth of the change of the derivative (Euler and
    Maclaurin). Applied to the means themselves, that rule made pitch and heave of a 0.7 Hz porpoise 0.4 % too small,
    and the slope of the angle of attack 0.4 % too large.
    """
    trapezoids = np.cumsum((values[1:] + values[:-1]) / 2, axis=0)
    return np.concatenate([np.zeros_like(values[:1]), trapezoids]) - np.gradient(values, axis=0) / 12


def _derivatives(attitude: Array, channels: Array, errors: NamedArrays) -> Array:
    """Derivatives of the Euler angles, and specific force in earth axes (n, 6). attitude: (3, n). channels: (7, n)."""
    phi, theta, psi = attitude
    rates = motion.attitude_derivative(phi, theta, *corrected_rates(NamedArrays(_RATES, channels[:3]), errors))
    force = motion.earth_from_body(corrected_force(NamedArrays(_FORCE, channels[3:]), errors), (phi, theta, psi))
    return np.column_stack([*rates, *force])


def _process_noise(
    mean: Array, missing: NDArray[np.bool_], blocks: BlockMeans, noise: dict[str, float]
) -> tuple[Array, Array]:
    dt = blocks.step_s
    integrated = np.sqrt(dt / blocks.rate_Hz)  # noise of a sum of samples over the step
    rates, forces = np.abs(mean[:, :3]), np.abs(mean[:, 3:6])
    gyro, accelerometer = ([noise[name] * integrated for name in names] for names in (CHANNELS[:3], CHANNELS[3:]))
    gyro_scale, accelerometer_scale = SENSORS.scale
    angle = np.hypot(gyro, gyro_scale * rates * dt) + 1e-5
    velocity = np.hypot(accelerometer, accelerometer_scale * forces * dt) + 1e-4
    # The noise of body axes is used for earth axes here. North and east get the same, so that the weights do not
    # depend on the heading.
    velocity[:, :2] = np.sqrt(np.mean(velocity[:, :2] ** 2, axis=1, keepdims=True))
    missing_radps, missing_mps2 = SENSORS.missing
    angle[missing] += missing_radps * dt
    velocity[missing] += missing_mps2 * dt
    return angle, velocity
