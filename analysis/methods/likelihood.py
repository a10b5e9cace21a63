"""The source's own estimators on the runs of a log: two maximum-likelihood estimators by output error.

Two states (3.37)-(3.44): airspeed and angle of attack are integrated; pitch attitude, thrust, elevator and body rates
are inputs; biases and scales of Table 3.1 are estimated. Force models (2.14)-(2.17): CX and CZ are polynomials, and the
pitch attitude is a third state. The source used the pitch attitude of its autopilot. Here pitch attitude and the errors
of the pitch rate gyro, which are corrected, come from the reconstructed trajectory. The pitch rate is also smoothed,
because white noise of an input enters the response through the equations of motion: with the gyro's noise as measured,
the power from six runs together was 14 to 62 % too high. More smoothing would lag behind fast runs. C_Lq is estimated
with the unsmoothed pitch rate, as in the source, because it would absorb the errors of a smoothed one.

The estimates depend on inputs that have errors: the trajectory, the propeller table, and the airspeed at which the
table is read. Each is changed by one standard deviation, and a few more iterations give the change of the estimates.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd

from flightpower.analysis.curve import Polar
from flightpower.analysis.estimation import uncertainty
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.fit import Fit
from flightpower.analysis.estimation.model import NamedValues
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.problem import FitOptions
from flightpower.analysis.flight import Reconstructed
from flightpower.analysis.maneuvers.kinds import LEVEL_RUNS, Maneuver
from flightpower.analysis.methods import aircraft_models
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods.causes import CAUSES, error_prior_sigma
from flightpower.analysis.methods.cross_check import priors, segments_of
from flightpower.analysis.methods.method import MethodDescription, MethodEstimate, not_flown
from flightpower.analysis.methods.settings import CROSS_CHECK, LIKELIHOOD
from flightpower.analysis.methods.thrust_prior import J_REFERENCE
from flightpower.analysis.records.flight import Cause, PitchRateResult
from flightpower.analysis.settings import FLOWN
from flightpower.analysis.sources.grid import without_gaps
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS, STATES
from flightpower.flight.aerodynamics import stability_axes
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError

PolarOf = Callable[[NamedValues], Array]

AS_MEASURED = ("airspeed_scale", *CAUSES[Cause.PROPELLER_TABLE])
TWO_STATE = MethodDescription(
    "two-state", "maximum likelihood, two states", "(3.37)-(3.45), Table 3.1", LEVEL_RUNS, AS_MEASURED
)
FORCE_MODELS = MethodDescription(
    "force-models", "maximum likelihood, force models", "(2.14)-(2.17)", LEVEL_RUNS, AS_MEASURED
)
AS_MEASURED_FIT, CLQ_FIT = "two-state, rate as measured", "two-state with C_Lq"
METHODS = (TWO_STATE, FORCE_MODELS)
# The source has no errors of thrust among its parameters (Table 3.1).
TABLE_AS_IT_IS = {"thrust_scale": {"free": False}, "thrust_slope": {"free": False}}


@dataclass(frozen=True)
class LikelihoodEstimates:
    """Estimates by TWO_STATE and FORCE_MODELS. pitch_rate : None where its estimation failed

    fits : the fits by name of the method, where there is one, and for C_Lq those named AS_MEASURED_FIT and CLQ_FIT
    """

    methods: list[MethodEstimate]
    pitch_rate: PitchRateResult | None
    fits: dict[str, Fit]


def estimate(flight: Reconstructed, wanted: tuple[MethodDescription, ...] = METHODS) -> LikelihoodEstimates:
    """Apply the estimators to all level runs at once. wanted: one or both of METHODS

    If one estimator fails, no estimate has a polar, and each has a note instead.
    """
    aircraft, level = flight.aircraft, flight.maneuvers.level_runs
    fits: dict[str, Fit] = {}
    pitch_rate = None
    if not level:
        return LikelihoodEstimates([not_flown(method) for method in wanted], None, fits)
    try:
        data = _Data(flight)
        file_priors = priors(aircraft, zeroed=flight.data.zeroed)
        two_state = aircraft_models.two_state(aircraft, priors=file_priors, J_ref=J_REFERENCE).changed(**TABLE_AS_IT_IS)
        start = aircraft_models.starting_values(aircraft, data.segments)
        fits[TWO_STATE.name] = fit_output_error(two_state, data.segments, start=start)
        fits[AS_MEASURED_FIT] = fit_output_error(two_state, data.rate_as_measured, start=start)
        without_prior = {"free": True, "start": 0.0, "prior_sigma": np.inf}
        fits[CLQ_FIT] = fit_output_error(
            two_state.changed(CLq=without_prior), data.rate_as_measured, start=_values(fits[AS_MEASURED_FIT])
        )
        pitch_rate = pitch_rate_of(flight.table, level, fits[CLQ_FIT])
        if FORCE_MODELS in wanted:
            model = aircraft_models.force_models(aircraft, priors=file_priors, J_ref=J_REFERENCE).changed(
                **TABLE_AS_IT_IS
            )
            fits[FORCE_MODELS.name] = fit_output_error(model, data.segments)
        polars: dict[str, PolarOf] = {
            TWO_STATE.name: lambda p: np.array([p.A0, p.A1, p.A2]),
            FORCE_MODELS.name: partial(_polar_of_forces, *_alpha_and_elevator(data.segments)),
        }
        methods = [
            _method_estimate(method, fits[method.name], polars[method.name], data, flight.flown_CL) for method in wanted
        ]
    except (InputError, np.linalg.LinAlgError) as error:
        methods = [MethodEstimate(method, notes=(str(error),)) for method in wanted]
    return LikelihoodEstimates(methods, pitch_rate, fits)


class _Data:
    """The runs as segments with the pitch attitude of the trajectory, and the same segments with other errors."""

    def __init__(self, flight: Reconstructed):
        table, runs, propeller = flight.table, flight.maneuvers.level_runs, flight.propeller
        self.error_sigma = error_prior_sigma(flight.aircraft.uncertainty)
        as_measured = segments_of(table, runs, propeller, block=CROSS_CHECK.block)
        if not as_measured:
            raise InputError("no run has all the required data")
        q = without_gaps(table["q_radps"].to_numpy())
        from scipy.signal import savgol_filter  # takes 0.3 s to import

        window = round(LIKELIHOOD.smoothing_s / float(table.index[1] - table.index[0]))
        smooth = savgol_filter(q, window + 1 - window % 2, 3)
        self._smoothed = segments_of(table.assign(q_radps=smooth), runs, propeller, block=CROSS_CHECK.block)
        self._trajectory = flight.trajectory
        no_error = np.zeros(len(SENSOR_ERRORS))
        self.rate_as_measured = self._along(no_error, as_measured)
        self.segments = self._along(no_error, self._smoothed)

    def _along(self, error: Array, segments: list[Segment]) -> list[Segment]:
        """Segments along the trajectory with sensor errors that are larger by `error` (m,)."""
        states = self._trajectory.states
        theta = states["theta"].to_numpy() + self._trajectory.state_sensitivity[:, STATES.index("theta")] @ error
        bias, scale = (
            self._trajectory.value(name) + error[SENSOR_ERRORS.index(name)] for name in ("q_bias", "q_scale")
        )
        changed = []
        for segment in segments:
            pitch = np.interp(segment.t_s, states.index, theta)
            u = {**segment.u, "theta": pitch, "q": (segment.u["q"] - bias) / (1 + scale)}
            changed.append(replace(segment, u=u, z={**segment.z, "theta": pitch}))
        return changed

    def along_other_trajectories(self) -> list[list[Segment]]:
        """Segments along the trajectory perturbed by each independent error of one standard deviation."""
        return [self._along(error, self._smoothed) for error in np.linalg.cholesky(self._trajectory.covariance).T]

    def with_error_removed(self, name: str) -> list[Segment]:
        """Segments corrected for one error of AS_MEASURED, as if it were one standard deviation large."""
        return [
            replace(segment, u={**segment.u, "thrust": _thrust_without(name, self.error_sigma[name], segment)})
            for segment in self.segments
        ]


# Derivative of the true thrust (n,) [N] with respect to each error of AS_MEASURED, from the inputs of a segment.
THRUST_BY: dict[str, Callable[[Mapping[str, Array]], Array]] = {
    "airspeed_scale": lambda u: -u["thrust_per_speed"] * u["V_ref"],
    "thrust_scale": lambda u: u["thrust"],
    "thrust_slope": lambda u: u["thrust"] * (u["J"] - J_REFERENCE),
}


def _thrust_without(name: str, sigma: float, segment: Segment) -> Array:
    return np.asarray(segment.u["thrust"] + sigma * THRUST_BY[name](segment.u))


def _method_estimate(
    method: MethodDescription, fit: Fit, polar_of: PolarOf, data: _Data, flown_CL: tuple[float, float]
) -> MethodEstimate:
    """The polar of a fit, with a covariance due to noise, floor and the errors of its inputs."""
    derived = uncertainty.delta_method(
        replace(uncertainty.cramer_rao(fit), covariance=covariance.of_noise(fit)), polar_of
    )

    def change(segments: list[Segment]) -> Array:
        once_more = fit_output_error(
            fit.model,
            segments,
            start=_values(fit),
            # Inputs change by one standard deviation, and R with them. One start, which is an optimum, is enough.
            options=FitOptions(max_iterations=3, second_start=False),
        )
        return np.asarray(polar_of(once_more.shared()) - derived.value)

    deviations = np.stack([change(segments) for segments in data.along_other_trajectories()], axis=1)
    by_error = {name: change(data.with_error_removed(name)) for name in AS_MEASURED}
    systematic = covariance.floor() + deviations @ deviations.T
    for changed in by_error.values():
        systematic += np.outer(changed, changed)
    return MethodEstimate(
        method,
        Polar(derived.value, derived.covariance + systematic),
        derived.covariance,
        systematic,
        {name: changed / data.error_sigma[name] for name, changed in by_error.items()},
        deviations,
        flown_CL=flown_CL,
        notes=() if fit.verdict.ok else (str(fit.verdict),),
    )


def _values(fit: Fit) -> dict[str, float]:
    return dict(zip(fit.names, fit.values.tolist(), strict=True))


def _alpha_and_elevator(segments: list[Segment]) -> tuple[Array, Array]:
    """Angles of attack over the range flown, and the elevator at each, by a straight line through all samples."""
    alpha = np.concatenate([segment.z["alpha"] for segment in segments])
    elevator = np.concatenate([segment.u["elevator"] for segment in segments])
    finite = np.isfinite(alpha)
    slope, offset = np.polyfit(alpha[finite], elevator[finite], 1)
    low, high = np.percentile(alpha[finite], FLOWN.robust_percentiles)
    grid = np.linspace(low, high, 31)
    return grid, offset + slope * grid


def _polar_of_forces(alpha_measured: Array, elevator: Array, p: NamedValues) -> Array:
    """The least-squares parabola (3,) of C_D (2.16) over C_L at measured angles of attack."""
    alpha = (alpha_measured - p.alpha_bias) / (1 + p.alpha_scale)
    CL, CD = stability_axes(*aircraft_models.force_coefficients(alpha, elevator, p), alpha)
    return np.asarray(np.polyfit(CL, CD, 2)[::-1])


def pitch_rate_of(table: pd.DataFrame, runs: list[Maneuver], fit: Fit) -> PitchRateResult:
    """Signal-to-noise ratio of the measured pitch rate, and the significance of C_Lq in its fit."""
    rates = {run.name: table["q_radps"].to_numpy()[run.rows] for run in runs}
    noise = float(np.sqrt(np.mean([sample_variance(q) for q in rates.values()])))
    white, corrected = uncertainty.cramer_rao(fit), covariance.of_noise(fit)
    test = uncertainty.t_tests(white)["CLq"]
    return PitchRateResult(
        signal_to_noise={name: max(float(np.nanvar(q)) / noise**2 - 1, 0.0) for name, q in rates.items()},
        noise_radps=noise,
        CLq=fit.parameters["CLq"].value,
        standard_error=white.standard_errors["CLq"],
        standard_error_corrected=float(np.sqrt(np.diag(corrected)[fit.names.index("CLq")])),
        t=test.t,
        critical_t=test.critical,
        significant=abs(test.t) > test.critical,
    )


def sample_variance(signal: Array) -> float:
    """Variance of white noise in a smooth signal (n,); a sample less its neighbors' mean has 1.5 times as much."""
    return float(np.nanmean((signal[1:-1] - (signal[:-2] + signal[2:]) / 2) ** 2) / 1.5)
