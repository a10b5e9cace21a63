"""Forces along a reconstructed trajectory, from which all methods that use the trajectory start.

All quantities are means over the blocks of the trajectory, five per second. The trajectory is passed as states and
sensor errors, so that a method can be repeated along a perturbed trajectory. Forces are divided by mass [m/s^2].

Gusts within a block push the aircraft forward, because lift tilts forward while it is largest (Katzmayr effect). The
accelerometer measures this force. So drag is larger than the means of force and angle of attack give, by the covariance
of lift and angle, which is 0.7 % in 15 kt.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.sources.grid import without_gaps
from flightpower.analysis.trajectory.block_means import BlockMeans
from flightpower.analysis.trajectory.equations import (
    PREDICTED_FLOW,
    SENSOR_ERRORS,
    STATES,
    NamedArrays,
    corrected_force,
    flow,
    vibration,
)
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.aerodynamics import lift_slope, stability_axes
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.propeller import Propeller

THRUST_BY_MOTOR_SPEED = "thrust_by_motor_speed"
THRUST_RATE = "thrust_rate"


class MotorSpeedError(NamedTuple):
    """Above the counted speed `above_revps` the motor turns faster than counted by the fraction `share`.

    If `above_revps` is 0, the error is a wrong number of poles.
    """

    above_revps: float
    share: float

    def corrected(self, counted_revps: Array) -> Array:
        """Correct a counted motor speed (n,)."""
        return np.where(counted_revps > self.above_revps, (1 + self.share) * counted_revps, counted_revps)

    @property
    def by_poles(self) -> bool:
        """Whether the error is a wrong number of poles rather than lost pulses."""
        return self.above_revps == 0


class FlightForces:
    """Forces of one flight, along the reconstructed trajectory and along perturbed ones.

    block_means : the measurements, (n,) by name     t_s : (n,) centers of the blocks [s]
    density_factor : factor on the measured air density     motor_speed : error to correct; None if there is none
    cov_az_alpha : (n,) covariance of vertical specific force and angle of attack within a block [m/s^2 rad], due to
        gusts
    """

    def __init__(
        self,
        trajectory: Trajectory,
        aircraft: Aircraft,
        propeller: Propeller,
        *,
        density_factor: float = 1.0,
        motor_speed: MotorSpeedError | None = None,
    ):
        self.trajectory, self.block_means = trajectory, trajectory.block_means
        self.t_s = trajectory.states.index.to_numpy()
        self.aircraft, self.propeller, self.density_factor = aircraft, propeller, density_factor
        self.motor_speed = motor_speed
        self._predicted_flow = NamedArrays(PREDICTED_FLOW, trajectory.predicted_flow.T)
        means = trajectory.block_means
        self._measured_force = NamedArrays(
            ("ax", "ay", "az", "vibration"),
            (means["ax_mps2"], means["ay_mps2"], means["az_mps2"], vibration(means["n_revps"])),
        )
        self.cov_az_alpha = _gust_covariance(trajectory.block_means, aircraft)

    @cached_property
    def nominal(self) -> pd.DataFrame:
        """`forces` along the reconstructed trajectory."""
        return self.forces(self.trajectory.states.to_numpy(), self.trajectory.sensor_errors)

    def corrected_force(self, errors: NamedArrays) -> tuple[Array, Array]:
        """Specific force (n,) along body x and z [m/s^2] less the accelerometers' errors. errors: all SENSOR_ERRORS"""
        ax, _, az = corrected_force(self._measured_force, errors)
        return ax, az

    def forces(self, states: Array, sensor_errors: Array) -> pd.DataFrame:
        """One row per block, for states (n, len(STATES)) and sensor errors (len(SENSOR_ERRORS),).

        CL, CD : from specific force minus the propeller table's thrust (2.16); CD excludes the push of gusts
        CL_squared : mean of the square of CL over the block
        qS_over_m_mps2 : dynamic pressure times wing area over mass
        thrust_along_V_over_m_mps2 : T cos(alpha) over mass, with T from the propeller table
        thrust_rate : rate of change of thrust_along_V_over_m_mps2 [m/s^3]
        thrust_beyond_over_m_mps2 : standard deviation of that thrust due to the continuation beyond the table's last J
        V, alpha, gamma, climb : true airspeed [m/s], angles relative to the air [rad], rate of climb [m/s]
        bank, theta : attitude [rad]
        Vdot [m/s^2], n [rev/s], J, rho [kg/m^3] : rate of airspeed, motor speed, advance ratio, air density
        """
        x, error = NamedArrays(STATES, states.T), NamedArrays(SENSOR_ERRORS, sensor_errors)
        V, alpha, _ = flow(x, self._predicted_flow, error.updraft)
        m, rho = self.aircraft.mass_kg, self.density_factor * self.block_means["rho"]
        qS_N = rho * V**2 / 2 * self.aircraft.geometry.wing_area_m2
        counted = np.where(self.block_means["n_revps"] > 1, self.block_means["n_revps"], np.nan)
        n = counted if self.motor_speed is None else self.motor_speed.corrected(counted)
        thrust_N, _ = self.propeller.thrust_and_power(V, n, rho)  # (3.48): J uses the whole airspeed
        ax, az = self.corrected_force(error)
        CL, CD = stability_axes((m * ax - thrust_N) / qS_N, m * az / qS_N, alpha)
        cov_CL_alpha = -m * self.cov_az_alpha / qS_N
        J = V / (n * self.propeller.diameter_m)
        continuation_N = self.propeller.continuation_error(J, 60 * n) * rho * n**2 * self.propeller.diameter_m**4
        columns = {
            "CL": CL,
            "CD": CD + cov_CL_alpha * np.cos(alpha),
            "CL_squared": CL**2 + lift_slope(self.aircraft.aspect_ratio) * cov_CL_alpha,
            "qS_over_m_mps2": qS_N / m,
            "thrust_along_V_over_m_mps2": thrust_N * np.cos(alpha) / m,
            THRUST_RATE: np.gradient(without_gaps(thrust_N * np.cos(alpha) / m), self.t_s),
            "thrust_beyond_over_m_mps2": continuation_N * np.cos(alpha) / m,
            "J": J,
            "V": V,
            "alpha": alpha,
            "gamma": np.arcsin(np.clip((x.gust_w - x.v_down - error.updraft) / V, -1, 1)),
            "bank": x.phi,
            "theta": x.theta,
            "climb": -x.v_down,
            "Vdot": np.gradient(V, self.t_s),
            "n": n,
            "rho": rho,
        }
        forces = pd.DataFrame(columns, index=self.t_s)
        if self.motor_speed is not None:
            forces[THRUST_BY_MOTOR_SPEED] = self.by_motor_speed(forces) * (counted > self.motor_speed.above_revps)
        return forces

    def by_motor_speed(self, forces: pd.DataFrame) -> Array:
        """Derivative (n,) of thrust along the flight path over mass [m/s^2] with respect to ln(motor speed)."""
        V, n, rho, alpha = (forces[name].to_numpy() for name in ("V", "n", "rho", "alpha"))
        step = 1e-3  # fraction of motor speed: far above rounding, and far below the spacing of the table
        slow, fast = (self.propeller.thrust_and_power(V, n * factor, rho)[0] for factor in (1 - step, 1 + step))
        return np.asarray((fast - slow) / (2 * step) * np.cos(alpha) / self.aircraft.mass_kg)


def _gust_covariance(block_means: BlockMeans, aircraft: Aircraft) -> Array:
    """Covariance (n,) of the vertical specific force [m/s^2] and the angle of attack [rad] within blocks; 0 if unknown.

    The angle at the probe, upwash included, contains no noise of the accelerometer, so vibration does not count. Where
    lift follows the angle with slope a, upwash enlarges the changes of that angle by the factor 1 + a (upwash per C_L).
    """
    at_probe = sum(block_means.covariance("az_mps2", name) for name in ("alpha_rad", "alpha_by_upwash_rad"))
    by_upwash = lift_slope(aircraft.aspect_ratio) * aircraft.probe.upwash_per_CL_rad
    return np.nan_to_num(at_probe / (1 + by_upwash))
