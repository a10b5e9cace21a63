"""Inputs and weights of the process equations for an intensity of gusts."""

from collections.abc import Sequence

import numpy as np

from flightpower.analysis.trajectory import dryden
from flightpower.analysis.trajectory.block_means import BlockMeans, moving_average
from flightpower.analysis.trajectory.equations import CONING_SCULLING, PROCESS_INPUTS, STATES, NamedArrays
from flightpower.analysis.trajectory.inertial import InertialInputs
from flightpower.analysis.trajectory.settings import PROCESS
from flightpower.flight.arrays import Array


def airspeed_without_gusts(state: NamedArrays) -> Array:
    """Speed relative to the mean wind (n,) [m/s] at STATES (n,)."""
    return np.asarray(
        np.sqrt((state.v_north - state.wind_north) ** 2 + (state.v_east - state.wind_east) ** 2 + state.v_down**2)
    )


class GustConditions:
    """Heights and speeds at which the aircraft meets gusts; on the ground, where gusts have no effect, those of cruise.

    height_m : (n-1,) of each step                cruise_height_m, cruise_mps : medians in flight
    length : scale length of the gusts over the standard's, 1 unless the flight's spectra contradict it
    """

    def __init__(self, blocks: BlockMeans, V_reference: Array):
        """V_reference: (n,) smoothed airspeed."""
        flown = blocks.flying if blocks.flying.any() else slice(None)
        self.cruise_mps = float(np.median(V_reference[flown]))
        self.cruise_height_m = float(np.nanmedian(blocks["height_m"][flown]))
        self._flying, self._slowest_mps = blocks.flying[:-1], PROCESS.slowest_mps * blocks.speed_scale
        self.height_m = np.where(self._flying, blocks["height_m"][:-1], self.cruise_height_m)
        self._step_s = blocks.step_s
        self.length = 1.0

    def speed_mps(self, without_gusts_mps: Array) -> Array:
        """Speed at which each step passes through the gusts (n-1,), from `airspeed_without_gusts` (n,).

        Measured airspeed contains the gusts: they would decay faster against the wind than with it, and their mean
        would not be zero (0.3 % of airspeed at 17 m/s in gusts of 1.3 m/s).
        """
        V = np.maximum(without_gusts_mps[:-1], self._slowest_mps)
        return np.where(self._flying, V, self.cruise_mps)

    def passed(self, sigma_w_mps: float, without_gusts_mps: Array) -> tuple[float, Array, Array]:
        """Arguments of Dryden's processes for each step. Gusts twice as long act like half the speed."""
        return sigma_w_mps, self.height_m, self.speed_mps(without_gusts_mps) / self.length

    def vertical_steps(self, sigma_w_mps: float, without_gusts_mps: Array) -> tuple[Array, Array]:
        """Decay factor of vertical gusts over each step (n-1,), and standard deviation of their increment [m/s]."""
        decay, once, twice = dryden.vertical(*self.passed(sigma_w_mps, without_gusts_mps)).discretize(self._step_s)
        return decay, np.hypot(once, twice)

    def longitudinal_steps(self, sigma_w_mps: float, without_gusts_mps: Array) -> tuple[Array, Array]:
        """Decay factor of longitudinal gusts over each step (n-1,), and standard deviation of their increment [m/s]."""
        return dryden.longitudinal(*self.passed(sigma_w_mps, without_gusts_mps)).discretize(self._step_s)

    def in_cruise(self, sigma_w_mps: float) -> Sequence[dryden.GaussMarkov | dryden.SecondOrderGust]:
        """Longitudinal, lateral and vertical gusts in cruise where the vertical ones have this standard deviation."""
        gust_arguments = sigma_w_mps, self.cruise_height_m, self.cruise_mps / self.length
        return dryden.longitudinal(*gust_arguments), dryden.lateral(*gust_arguments), dryden.vertical(*gust_arguments)

    def transverse_variance(self, sigma_w_mps: float) -> float:
        """Variance of lateral and vertical gusts together [m^2/s^2], in cruise."""
        lateral = dryden.lateral(sigma_w_mps, self.cruise_height_m, self.cruise_mps)
        return float(lateral.sigma_mps**2 + sigma_w_mps**2)


class ProcessModel:
    """PROCESS_INPUTS (n-1, ·) without coning and sculling, and weights 1/sigma (n-1, nx) of the process residuals."""

    def __init__(
        self,
        inertial: InertialInputs,
        blocks: BlockMeans,
        conditions: GustConditions,
        sigma_w_mps: float,
        without_gusts_mps: Array,
    ):
        """without_gusts_mps: (n,) `airspeed_without_gusts`."""
        dt, steps = blocks.step_s, blocks.n - 1
        profile = dryden.mean_wind_profile(moving_average(blocks["height_m"], 3))
        inputs = np.zeros((steps, len(PROCESS_INPUTS)))
        inertial_inputs = np.hstack([inertial.mean, inertial.predicted])
        inputs[:, : inertial_inputs.shape[1]] = inertial_inputs
        sigma = np.empty((steps, len(STATES)))
        sigma[:, :3], sigma[:, 3:6] = inertial.angle_sigma, inertial.velocity_sigma
        sigma[:, STATES.index("height")] = PROCESS.height_sigma_m

        def set_input(name: str, values: Array | float) -> None:
            inputs[:, PROCESS_INPUTS.index(name)] = values

        def set_sigma(name: str, values: Array | float) -> None:
            sigma[:, STATES.index(name)] = values

        set_input("dt", dt)
        set_input("wind_ratio", profile[1:] / profile[:-1])
        for axis in ("north", "east"):
            set_sigma(f"wind_{axis}", PROCESS.wind_walk_mps * np.sqrt(dt))
        gust_arguments = conditions.passed(sigma_w_mps, without_gusts_mps)
        decay, increment = dryden.longitudinal(*gust_arguments).discretize(dt)
        set_input("decay_u", decay)
        set_sigma("gust_u", increment)
        for axis, gust in (("v", dryden.lateral(*gust_arguments)), ("w", dryden.vertical(*gust_arguments))):
            decay, once, twice = gust.discretize(dt)
            set_input(f"decay_{axis}", decay)
            set_sigma(f"gust_{axis}", once)
            set_sigma(f"gust_{axis}_filtered_twice", twice)
        self.inputs, self.weight = inputs, 1 / sigma

    def with_corrections(self, coning_and_sculling: Array) -> Array:
        """Return PROCESS_INPUTS with these corrections (n-1, 6) inserted."""
        inputs = self.inputs.copy()
        first = PROCESS_INPUTS.index(CONING_SCULLING[0])
        inputs[:, first : first + len(CONING_SCULLING)] = coning_and_sculling
        return inputs
