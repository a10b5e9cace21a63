"""The parts of the covariance of the drag polar, in the order in which `dynamic.estimate_polar` adds them.

Errors of thrust are in the first part: scale, slope, and thrust beyond the table are parameters of the regression, with
their priors as measurements (`dynamic.drag_model`, `analysis.methods.thrust_prior`).

1. Noise (`noise_covariance`): from errors of the reconstructed states, propagated to first order, and from the rest of
   the residuals of the runs. The residuals contain the errors of the states too, whose spectrum is estimated from
   random draws and subtracted: the two must not simply be added.
2. Sensor errors: each independent direction of their covariance, through trajectory and regression (in `dynamic`).
3. Errors that no residual of the flight shows, consider terms (Schmidt 1966; Tapley et al. 2004, ch. 6): `UPDRAFT`,
   `WEIGHT`, `DENSITY`. UPDRAFT stands for eddies that differ from run to run; [uncertainty] in the aircraft
   file gives the sizes of the others. The estimate is repeated with each error of one standard deviation,
   and the outer product of its change is added.
4. What the runs reject: the propeller's table, a parabolic polar (`rejected_assumptions`).
5. Values assumed for keys that the aircraft file lacks, and the pressure transducers' hysteresis and drift of zero
   (`assumed_values`).

The other methods have the noise of their regression (`of_noise`) and a `floor`.
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
    """Covariance of all estimates by noise: per parameter the larger of those for white and for colored residuals.

    Colored residuals make estimates several times less certain than white ones of the same size,
    but a short record can fail to show its color.
    """
    white, colored = uncertainty.cramer_rao(fit).covariance, uncertainty.morelli_klein(fit).covariance
    scale = np.maximum(1.0, np.sqrt(np.diag(white) / np.diag(colored)))
    return np.asarray(colored * np.outer(scale, scale))


def floor() -> Array:
    """Covariance (3, 3) of A for a direction of lift that is known no better than `COVARIANCE.floor_rad`, which no
    residual shows.

    Lift tilted by that angle adds D = L tan(`COVARIANCE.floor_rad`), a C_D proportional to C_L: a variance of A1.
    """
    covariance = np.zeros((len(POLAR), len(POLAR)))
    A1 = POLAR.index("A1")
    covariance[A1, A1] = np.tan(COVARIANCE.floor_rad) ** 2
    return covariance


def polar_of(fit: Fit) -> Polar:
    """The drag polar of a fit with parameters A0, A1, A2; its covariance contains noise and floor."""
    where = [fit.names.index(name) for name in POLAR]
    return Polar(fit.values[where], of_noise(fit)[np.ix_(where, where)] + floor())


UPDRAFT, WEIGHT, DENSITY = "updraft", "weight", "air density"  # names of these errors


def changes(values_of: Callable[[pd.DataFrame], Array], values: Array, flight_forces: FlightForces) -> dict[str, Array]:
    """Change of an estimate (m,), A0, A1, A2 first, by each consider error, UPDRAFT and WEIGHT among them.

    values_of : the estimate from forces, `values` from the nominal ones
    """
    aircraft = flight_forces.aircraft
    in_still_air = values_of(without_updraft(flight_forces.nominal, flight_forces.trajectory.eddies_mps))
    values_with_more_weight = values_of(forces_with_more_weight(flight_forces).nominal)
    return {UPDRAFT: in_still_air - values, WEIGHT: at_nominal_weight(values_with_more_weight, aircraft) - values}


def without_updraft(forces: pd.DataFrame, updraft_mps: float) -> pd.DataFrame:
    """Forces as in still air, if the air rose in the runs. forces: of `FlightForces.forces`.

    Air that rises by w carries the aircraft: drag is larger than measured by lift times w/V.
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
    """An estimate (m,) of A0, A1, A2 and others for `weighing_more`, so that it gives the same power at each speed.

    The lift coefficient at a speed is larger by the same factor as the weight.
    """
    factor = _weight_factor(aircraft)
    return np.asarray(values * np.concatenate([[1.0, factor, factor**2], np.ones(len(values) - 3)]))


def by_density(values_of: Callable[[pd.DataFrame], Array], values: Array, flight_forces: FlightForces) -> Array:
    """Change of an estimate (m,) by a measured density that is one standard deviation too high, at right airspeeds.

    Airspeed computed from dynamic pressure is too low by half the relative error. This is a scale error of airspeed in
    this flight, and is estimated as one.
    """
    return values_of(forces_in_denser_air(flight_forces).nominal) - values


def forces_in_denser_air(flight_forces: FlightForces) -> FlightForces:
    """The forces in air that is denser by one standard deviation."""
    f = flight_forces
    factor = _density_factor(f.aircraft)
    return FlightForces(f.trajectory, f.aircraft, f.propeller, density_factor=factor, motor_speed=f.motor_speed)


def at_nominal_density(values: Array, aircraft: Aircraft) -> Array:
    """An estimate (m,) of A0, A1, A2 and others in that denser air, so that it gives the same power at each speed.

    Dynamic pressure at a speed is larger by the factor of the density, the lift coefficient smaller.
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


STATE_STEP = 1e-4  # derivatives with respect to the states [rad], [m/s]


def noise_covariance(fit: Fit, trajectory: Trajectory, segments_along: Callable[[Array], list[Segment]]) -> Array:
    """Covariance (m, m) of a fit with one output by errors of the states and by other noise.

    segments_along: the segments of the fit along states (n, nx) other than the most probable ones.
    """
    return _by_states(fit, trajectory, segments_along) + _by_rest(fit, trajectory, segments_along)


def _by_states(fit: Fit, trajectory: Trajectory, segments_along: Callable[[Array], list[Segment]]) -> Array:
    """Covariance (m, m) by the errors of the states for given sensor errors, propagated to first order."""
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
    """Covariance (m, m) by the residuals, less what errors of the states explain of these.

    Per parameter it is at least that by the white part of the rest, as in `covariance.of_noise`.
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
    """Change of the whitened residuals (n,) by segment, 0 where a sample is missing."""
    (output,), p = fit.model.outputs, fit.shared()
    sigma = float(np.sqrt(fit.noise_covariance.item()))
    residuals = fit.residuals
    changes = []
    for segment in segments:
        (modeled,) = fit.model.output_function(NamedValues("state", {}), NamedValues("input", segment.u), p)
        changes.append(np.nan_to_num(segment.z[output] - modeled - residuals[segment.name][:, 0]) / sigma)
    return changes


class JointEstimate(NamedTuple):
    """The estimate of one flight before the errors that no residual shows.

    names : (m,) parameters of the drag model, then SENSOR_ERRORS
    parameters : (m,) by noise and sensor errors, priors included; shared are the errors that no residual shows
    weighting_covariance : (k, k) of the parameters of the drag model for given sensor errors, by white residuals and
        the priors; its inverse weighs data and priors in the estimate, whatever color the residuals have
    prior_mean, prior_sigma : (m,); infinite where there is no prior
    prior_measurements : that are part of the prior, too
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
        """Adds consider errors; `changes` covers the leading parameters, the rest are zero."""
        return self._with_changes({name: self._padded(change) for name, change in changes.items()})

    def with_density_error(self, change: Array, airspeed_scale: float) -> "JointEstimate":
        """Adds the error of density. change: of the leading parameters. airspeed_scale: change of V_scale."""
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

    noise : (k, k) covariance of the parameters for given sensor errors     prior_sigma : (k,)
    changes_by_sensor_errors : (k, s) of the parameters along the columns of the Cholesky factor of the sensor errors'
    covariance
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
