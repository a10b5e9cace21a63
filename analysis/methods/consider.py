"""The parts of the covariance of the drag polar, in the order in which `dynamic.estimate_polar` adds them.

Errors of thrust are in the first part, because scale, slope, and thrust beyond the table are parameters of the
regression, with their priors as measurements (`dynamic.drag_model`, `analysis.methods.thrust_prior`).

1. Noise (`noise_covariance`): errors of the reconstructed states, propagated to first order, and other residuals of the
   runs. The residuals also contain the errors of the states. The spectrum of these errors is estimated from random
   draws and subtracted, so that they do not count twice.
2. Sensor errors: each independent direction of their covariance is passed through trajectory and regression
   (`dynamic`).
3. Errors that no residual of the flight shows, called consider terms (Schmidt 1966; Tapley et al. 2004, ch. 6):
   `UPDRAFT`, `WEIGHT`, `DENSITY`. UPDRAFT stands for eddies that differ from run to run; [uncertainty] in the aircraft
   file gives the sizes of the others. The estimate is repeated with each error set to one standard deviation, and the
   outer product of the change is added.
4. Assumptions that the runs reject: the propeller's table, a parabolic polar (`rejected_assumptions`).
5. Values assumed for keys that the aircraft file lacks, and hysteresis and drift of zero of the pressure transducers
   (`assumed_values`).

The covariance of the other methods starts from the noise of their regression (`of_noise`) and a `floor`.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import fft

from flightpower.analysis.curve import POLAR, Polar
from flightpower.analysis.estimation import uncertainty
from flightpower.analysis.estimation.colored_residuals import (
    Autoregression,
    noise_spectrum,
    score_covariance,
    spectrum_order,
)
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.fit import Fit
from flightpower.analysis.estimation.model import NamedValues, PriorMeasurement
from flightpower.analysis.methods.forces import FlightForces
from flightpower.analysis.methods.settings import COVARIANCE
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.priors import PRIOR_MEAN
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.analysis.uncertain import Uncertain
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array


def of_noise(fit: Fit) -> Array:
    """Covariance of all estimates due to noise, with the larger standard error of white or colored residuals for each.

    Colored residuals make estimates several times less certain than white residuals of the same size, but a short
    record may not show that its residuals are colored.
    """
    white, colored = uncertainty.cramer_rao(fit).covariance, uncertainty.morelli_klein(fit).covariance
    scale = np.maximum(1.0, np.sqrt(np.diag(white) / np.diag(colored)))
    return np.asarray(colored * np.outer(scale, scale))


def floor() -> Array:
    """Covariance (3, 3) of A that follows if the direction of lift is known no better than `COVARIANCE.floor_rad`.

    No residual shows this error. Lift tilted by that angle adds the drag L tan(`COVARIANCE.floor_rad`). Its C_D is
    proportional to C_L, so it contributes a variance of A1.
    """
    covariance = np.zeros((len(POLAR), len(POLAR)))
    A1 = POLAR.index("A1")
    covariance[A1, A1] = np.tan(COVARIANCE.floor_rad) ** 2
    return covariance


def polar_of(fit: Fit) -> Polar:
    """The drag polar of a fit with parameters A0, A1, A2; its covariance contains noise and floor."""
    where = [fit.names.index(name) for name in POLAR]
    return Polar(fit.values[where], of_noise(fit)[np.ix_(where, where)] + floor())


UPDRAFT, WEIGHT, DENSITY = "updraft", "weight", "air density"  # names of consider errors


def changes(values_of: Callable[[pd.DataFrame], Array], values: Array, flight_forces: FlightForces) -> dict[str, Array]:
    """Change of an estimate (m,), which begins with A0, A1, A2, by the consider errors UPDRAFT and WEIGHT.

    values_of : makes the estimate from forces     values : the estimate from the nominal forces
    """
    aircraft = flight_forces.aircraft
    in_still_air = values_of(without_updraft(flight_forces.nominal, flight_forces.trajectory.eddies_mps))
    values_with_more_weight = values_of(forces_with_more_weight(flight_forces).nominal)
    return {UPDRAFT: in_still_air - values, WEIGHT: at_nominal_weight(values_with_more_weight, aircraft) - values}


def without_updraft(forces: pd.DataFrame, updraft_mps: float) -> pd.DataFrame:
    """Correct the forces for air that rose at `updraft_mps` in the runs. forces: from `FlightForces.forces`

    Air that rises at w carries the aircraft, so the true drag exceeds the measured drag by lift times w/V.
    """
    return forces.assign(CD=forces["CD"] + forces["CL"] * updraft_mps / forces["V"])


def forces_with_more_weight(flight_forces: FlightForces) -> FlightForces:
    """The forces of the aircraft `weighing_more`."""
    f = flight_forces
    return FlightForces(f.trajectory, weighing_more(f.aircraft), f.propeller, motor_speed=f.motor_speed)


def weighing_more(aircraft: Aircraft) -> Aircraft:
    """The aircraft heavier by one standard deviation of its weight."""
    return aircraft.weighing(_weight_factor(aircraft) * aircraft.mass.weight_N)


def at_nominal_weight(values: Array, aircraft: Aircraft) -> Array:
    """Convert an estimate (m,), A0, A1, A2 first, from `weighing_more` to nominal weight, at equal power and speed.

    The lift coefficient at a given speed is larger by the same factor as the weight.
    """
    factor = _weight_factor(aircraft)
    return np.asarray(values * np.concatenate([[1.0, factor, factor**2], np.ones(len(values) - 3)]))


def by_density(values_of: Callable[[pd.DataFrame], Array], values: Array, flight_forces: FlightForces) -> Array:
    """Change of an estimate (m,) by a density that is one standard deviation too high, while airspeeds are right.

    With such a density, airspeed computed from dynamic pressure is too low by half the relative error. In one flight
    this is a scale error of airspeed, and is estimated as such.
    """
    return values_of(forces_in_denser_air(flight_forces).nominal) - values


def forces_in_denser_air(flight_forces: FlightForces) -> FlightForces:
    """The forces in air that is denser by one standard deviation."""
    f = flight_forces
    factor = _density_factor(f.aircraft)
    return FlightForces(f.trajectory, f.aircraft, f.propeller, density_factor=factor, motor_speed=f.motor_speed)


def at_nominal_density(values: Array, aircraft: Aircraft) -> Array:
    """Convert an estimate (m,), A0, A1, A2 first, from denser air to nominal density, at equal power and speed.

    At a given speed, dynamic pressure is larger by the same factor as the density, and the lift coefficient is smaller.
    """
    factor = _density_factor(aircraft)
    return np.asarray(values * np.concatenate([[factor, 1.0, 1 / factor], np.ones(len(values) - 3)]))


def airspeed_scale_by_density(aircraft: Aircraft) -> float:
    """Change of the estimated airspeed scale by a density that is one standard deviation too high."""
    return -aircraft.uncertainty.air_density_fraction / 2


def _density_factor(aircraft: Aircraft) -> float:
    return 1 + aircraft.uncertainty.air_density_fraction


def _weight_factor(aircraft: Aircraft) -> float:
    return 1 + aircraft.uncertainty.weight_fraction


STATE_STEP = 1e-4  # step for derivatives with respect to the states [rad], [m/s]


def noise_covariance(fit: Fit, trajectory: Trajectory, segments_along: Callable[[Array], list[Segment]]) -> Array:
    """Covariance (m, m) of a fit with one output, due to errors of the states and to other noise.

    segments_along: makes the segments of the fit along other states (n, nx) than the most probable states
    """
    return _by_states(fit, trajectory, segments_along) + _by_rest(fit, trajectory, segments_along)


def _by_states(fit: Fit, trajectory: Trajectory, segments_along: Callable[[Array], list[Segment]]) -> Array:
    """Covariance (m, m) due to errors of the states at fixed sensor errors, propagated to first order."""
    states, t_s = trajectory.states.to_numpy(), trajectory.states.index.to_numpy()
    gradient = np.zeros((*states.shape, len(fit.names)))
    for i, step in enumerate(STATE_STEP * np.eye(states.shape[1])):
        for change, segment_fit in zip(_changes(fit, segments_along(states + step)), fit.segment_fits, strict=True):
            rows = np.searchsorted(t_s, segment_fit.segment.t_s)
            by_state = change[:, None] * segment_fit.white.S[:, 0] / STATE_STEP
            gradient[rows[:, None], i, segment_fit.columns] = by_state
    D = fit.covariance
    return np.asarray(D @ trajectory.states_given_errors.covariance_of(gradient) @ D)


def _by_rest(fit: Fit, trajectory: Trajectory, segments_along: Callable[[Array], list[Segment]]) -> Array:
    """Covariance (m, m) due to the part of the residuals that errors of the states do not explain.

    Each variance is at least the one that white noise with the power of this part would give, as in `of_noise`.
    """
    states = trajectory.states.to_numpy()
    changes = [change for draw in trajectory.draws for change in _changes(fit, segments_along(states + draw))]
    samples, order = sum(len(change) for change in changes), spectrum_order(fit)
    gamma = np.zeros((order, 1, 1))
    for change in changes:
        for lag in range(min(order, len(change))):
            gamma[lag] += change[lag:] @ change[: len(change) - lag] / samples
    size = fft.next_fast_len(4 * max(len(segment_fit.segment) for segment_fit in fit.segment_fits))
    of_residuals = noise_spectrum(fit, size).real
    rest = of_residuals
    if gamma[0, 0, 0] > 0:
        rest = np.maximum(of_residuals - Autoregression.fitted(gamma, samples).spectrum(size).real, 0.0)
    D = fit.covariance
    prior = D @ fit.prior_information @ D
    colored = D @ score_covariance(fit, rest.astype(complex), size) @ D + prior
    white = D @ (fit.information * rest.mean() / of_residuals.mean()) @ D + prior
    scale = np.sqrt(np.maximum(1.0, np.diag(white) / np.diag(colored)))
    return np.asarray(colored * np.outer(scale, scale))


def _changes(fit: Fit, segments: list[Segment]) -> list[Array]:
    """Change of the whitened residuals (n,) in each segment; 0 where a sample is missing."""
    (output,), p = fit.model.outputs, fit.shared()
    sigma = float(np.sqrt(fit.noise_covariance.item()))
    residuals = fit.residuals
    changes = []
    for segment in segments:
        (modeled,) = fit.model.output_function(NamedValues("state", {}), NamedValues("input", segment.u), p)
        changes.append(np.nan_to_num(segment.z[output] - modeled - residuals[segment.name][:, 0]) / sigma)
    return changes


class JointEstimate(NamedTuple):
    """The estimate of one flight, for the joint estimate of several flights.

    names : (m,) parameters of the drag model, then SENSOR_ERRORS
    parameters : (m,); own covariance due to noise and sensor errors, with priors; shared errors are those that no
        residual shows
    weighting_covariance : (k, k) of the drag model's parameters at fixed sensor errors, due to white residuals and
        priors; its inverse weighs data and priors in the estimate, whatever color the residuals have
    prior_mean, prior_sigma : (m,); prior_sigma is infinite where there is no prior
    prior_measurements : measurements that are also part of the prior
    """

    names: tuple[str, ...]
    parameters: Uncertain
    weighting_covariance: Array
    prior_mean: Array
    prior_sigma: Array
    prior_measurements: tuple[PriorMeasurement, ...] = ()

    def with_value(self, name: str, value: float) -> "JointEstimate":
        """This estimate with another value of one parameter, for instance an error already corrected in the data."""
        values = np.where(np.array(self.names) == name, value, self.parameters.value)
        return self._replace(parameters=replace(self.parameters, value=values))

    def with_changes(self, changes: Mapping[str, Array]) -> "JointEstimate":
        """Add consider errors. changes: changes of the leading parameters; the other parameters do not change"""
        return self._with_changes({name: self._padded(change) for name, change in changes.items()})

    def with_density_error(self, change: Array, airspeed_scale: float) -> "JointEstimate":
        """Add the error of density. change: change of the leading parameters. airspeed_scale: change of V_scale."""
        full_change = self._padded(change)
        full_change[self.names.index("V_scale")] = airspeed_scale
        return self._with_changes({DENSITY: full_change})

    def _padded(self, change: Array) -> Array:
        return np.pad(change, (0, len(self.names) - len(change)))

    def _with_changes(self, changes: Mapping[str, Array]) -> "JointEstimate":
        return self._replace(parameters=replace(self.parameters, shared={**self.parameters.shared, **changes}))


def joint_estimate(
    fit: Fit, noise: Array, prior_sigma: Array, changes_by_sensor_errors: Array, trajectory: Trajectory
) -> JointEstimate:
    """The joint estimate of the parameters of the drag model (k,) and of the sensor errors.

    noise : (k, k) covariance of the parameters at fixed sensor errors     prior_sigma : (k,)
    changes_by_sensor_errors : (k, s) changes of the parameters by each column of the Cholesky factor of the sensor
        errors' covariance
    """
    names, values = fit.names, fit.values
    factor = np.linalg.cholesky(trajectory.covariance)
    cross = changes_by_sensor_errors @ factor.T
    parameters = noise + changes_by_sensor_errors @ changes_by_sensor_errors.T
    return JointEstimate(
        names=(*names, *SENSOR_ERRORS),
        parameters=Uncertain(
            np.concatenate([values, trajectory.sensor_errors]),
            np.block([[parameters, cross], [cross.T, trajectory.covariance]]),
        ),
        weighting_covariance=fit.covariance,
        prior_mean=np.array([PRIOR_MEAN.get(name, 0.0) for name in (*names, *SENSOR_ERRORS)]),
        prior_sigma=np.concatenate([prior_sigma, trajectory.prior_sigma]),
    )
