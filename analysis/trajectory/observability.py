"""Find which sensor errors a flight determined, what it lacked for the others, and whether they fit their priors.

A flight determines a sensor error when the standard error is clearly below the prior standard deviation. What it
lacked follows from its excitation: headings, speeds, gusts, recorded channels.

Where estimated errors do not fit their priors, the priors are too narrow, and so are the intervals. That test expresses
all errors in prior standard deviations, so that the prior's information is 1 in every direction. In a direction in
which the data have the information j, the data alone would give x = y (1 + j)/j in place of the estimate y. If the
prior is right, x is normal with variance 1 + 1/j. If all sensor errors are larger than their priors by the same factor
s, the variance is s^2 + 1/j; s is estimated by maximum likelihood (empirical Bayes; Box 1980, J. R. Stat. Soc. A 143,
383, for the test).
"""

import math
from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from scipy import special

from flightpower.analysis.records.flight import SensorError
from flightpower.analysis.settings import EVIDENCE
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.trajectory.consistency import time_shift_notes
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.priors import PRIOR_MEAN, PRIOR_SIGMA, ZEROS
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.analysis.trajectory.settings import GUSTS, PRIOR_CHECK, SHOWN
from flightpower.analysis.trajectory.smoother import StatesGivenErrors
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError


class SensorErrorKind(NamedTuple):
    """How a sensor error is named to the reader, and its SI unit; the unit of a ratio is empty."""

    title: str
    unit: str

    @property
    def display_unit(self) -> tuple[float, str]:
        """Factor from SI to the unit in which reports show the error, and that unit."""
        match self.unit:
            case "":
                return 100.0, "%"
            case "rad" | "rad/s":
                return math.degrees(1.0), self.unit.replace("rad", "deg")
            case "s":
                return 1000.0, "ms"
        return 1.0, self.unit.replace("^2", "²")


SENSOR_ERROR_KINDS = {
    "alpha_bias": SensorErrorKind("offset of angle of attack", "rad"),
    "alpha_scale": SensorErrorKind("slope of angle of attack", ""),
    "V_scale": SensorErrorKind("scale of airspeed", ""),
    "beta_bias": SensorErrorKind("offset of sideslip", "rad"),
    "air_data_lag": SensorErrorKind("lag of the probe", "s"),
    "gps_latency": SensorErrorKind("latency of GPS", "s"),
    "heading_bias": SensorErrorKind("offset of the compass, declination included", "rad"),
    "ax_bias": SensorErrorKind("bias of the accelerometer, forward", "m/s^2"),
    "ay_bias": SensorErrorKind("bias of the accelerometer, right", "m/s^2"),
    "az_bias": SensorErrorKind("bias of the accelerometer, down", "m/s^2"),
    "p_bias": SensorErrorKind("bias of the roll gyro", "rad/s"),
    "q_bias": SensorErrorKind("bias of the pitch gyro", "rad/s"),
    "r_bias": SensorErrorKind("bias of the yaw gyro", "rad/s"),
    "dp_alpha_zero": SensorErrorKind("zero of the angle-of-attack pressure", "Pa"),
    "q_c_zero": SensorErrorKind("zero of the airspeed pressure", "Pa"),
    "ax_vibration": SensorErrorKind("offset of the accelerometer by vibration at 100 rev/s, forward", "m/s^2"),
    "az_vibration": SensorErrorKind("offset of the accelerometer by vibration at 100 rev/s, down", "m/s^2"),
    "updraft": SensorErrorKind("mean updraft", "m/s"),
    "alpha_per_g": SensorErrorKind("angle of attack for each g of load factor", "rad"),
    "p_scale": SensorErrorKind("scale of the roll gyro", ""),
    "q_scale": SensorErrorKind("scale of the pitch gyro", ""),
    "r_scale": SensorErrorKind("scale of the yaw gyro", ""),
    "ax_scale": SensorErrorKind("scale of the accelerometer, forward", ""),
    "az_scale": SensorErrorKind("scale of the accelerometer, down", ""),
    "probe_ahead": SensorErrorKind("distance of the probe ahead, beyond `probe.position`", "m"),
}
MATTERS = ("alpha_bias", "alpha_scale", "V_scale")  # sensor errors with a large effect on the power curve


class FlightExcitation(NamedTuple):
    """What a flight contains that determines sensor errors.

    mean_heading_vector : length of the mean of unit vectors along the headings: 1 on one heading, 0 back and forth
    speed_ratio : 95th over 5th percentile of airspeed       gust_mps : vertical, 1 sigma
    """

    gps: bool
    sideslip: bool
    mean_heading_vector: float
    speed_ratio: float
    gust_mps: float


class MissingExcitation(StrEnum):
    """What a flight lacks to determine a sensor error. The value is the advice for the reader."""

    GPS = "no GPS"
    SIDESLIP = "sideslip was not measured"
    HEADINGS = "nearly one heading throughout; fly opposite headings, with turns between"
    SPEEDS = "nearly one speed throughout; fly slow and fast"
    CALM_AIR = "gusts; fly longer, or on a calmer day"
    PORPOISING = "gusts; porpoise for a minute (stick back and forth, 1.5 s a cycle), or fly on a calmer day"
    DURATION = "too few changes of speed and attitude; fly longer, with quick changes of both"


def undetermined_text(error: SensorError) -> str:
    """Return "This flight does not determine the scale of airspeed: …"."""
    return (
        f"This flight does not determine the {error.title}: standard deviation {error.assumed_sigma:.2g} {error.unit}"
        f" before the flight, {error.standard_error:.2g} {error.unit} after it. Reason: {'; '.join(error.missing)}."
        " The interval includes this uncertainty."
    )


def excitation(trajectory: Trajectory) -> FlightExcitation:
    """Find what the flight contains that determines sensor errors."""
    blocks = trajectory.block_means
    flying = blocks.flying
    heading, V = trajectory.states["psi"].to_numpy()[flying], blocks["V_mps"][flying]
    slow, fast = np.percentile(V, (5, 95)) if flying.any() else (1.0, 1.0)
    return FlightExcitation(
        gps="gps_north" in trajectory.residuals and blocks.measured("gps_north_mps"),
        sideslip=blocks.measured("beta_rad"),
        mean_heading_vector=float(abs(np.mean(np.exp(1j * heading)))) if flying.any() else 1.0,
        speed_ratio=float(fast / slow),
        gust_mps=trajectory.gust_mps,
    )


_AIR_DATA = frozenset({"alpha_bias", "alpha_scale", "beta_bias", "V_scale", "air_data_lag"})
_CROSSWIND = frozenset({"V_scale", "beta_bias", "ay_bias", "r_bias"})  # a steady wind on one heading acts like these
# For each: whether a flight lacks it, and the sensor errors that are then not determined.
_MISSING_EXCITATION: dict[MissingExcitation, tuple[Callable[[FlightExcitation], bool], frozenset[str]]] = {
    MissingExcitation.GPS: (lambda flight: not flight.gps, _CROSSWIND | {"gps_latency", "heading_bias"}),
    MissingExcitation.SIDESLIP: (lambda flight: not flight.sideslip, frozenset({"beta_bias"})),
    MissingExcitation.HEADINGS: (lambda flight: flight.mean_heading_vector > SHOWN.one_heading, _CROSSWIND),
    MissingExcitation.SPEEDS: (
        lambda flight: flight.speed_ratio < SHOWN.one_speed,
        frozenset({"alpha_scale", "air_data_lag", "V_scale"}),
    ),
    MissingExcitation.CALM_AIR: (lambda flight: flight.gust_mps > GUSTS.dominate_mps, _AIR_DATA - {"alpha_scale"}),
    MissingExcitation.PORPOISING: (lambda flight: flight.gust_mps > GUSTS.dominate_mps, frozenset({"alpha_scale"})),
}


def missing(name: str, flight: FlightExcitation) -> tuple[MissingExcitation, ...]:
    """What the flight lacks to determine a sensor error. name: one of SENSOR_ERRORS."""
    reasons = tuple(what for what, (holds, errors) in _MISSING_EXCITATION.items() if name in errors and holds(flight))
    return reasons or (MissingExcitation.DURATION,)


def sensor_error_estimates(trajectory: Trajectory) -> list[SensorError]:
    """Return the estimates of SENSOR_ERRORS, determined or not, those with the largest effect on power first.

    Excludes the zeros of the pressures, which only rest shows, the compass if none was used, and the position of the
    probe if the aircraft file has it.
    """
    flight = excitation(trajectory)
    left_out = {*ZEROS} if "compass" in trajectory.residuals else {*ZEROS, "heading_bias"}
    if trajectory.prior_standard_error("probe_ahead") <= 2 * PRIOR_SIGMA["probe_ahead"]:
        left_out.add("probe_ahead")
    estimates = []
    for name, kind in SENSOR_ERROR_KINDS.items():
        if name in left_out:
            continue
        title, (factor, unit) = kind.title, kind.display_unit
        sigma, prior = trajectory.standard_error(name), trajectory.prior_standard_error(name)
        determined = sigma < STATISTICS.determined_share * prior
        reasons = () if determined else missing(name, flight)
        value = factor * trajectory.value(name)
        estimates.append(
            SensorError(
                name=name,
                title=title,
                value=value,
                standard_error=factor * sigma,
                assumed_sigma=factor * prior,
                unit=unit,
                determined=determined,
                missing=[*reasons],
            )
        )
    return estimates


def trajectory_notes(
    trajectory: Trajectory,
    errors: list[SensorError],
    runs: int,
    *,
    magnetometer_calibrated: bool,
    log: str,
) -> list[str]:
    """Notes for the reader of the power curve on gusts, lost attitude, time shifts, heading and sensor errors.

    runs: number of accelerations and decelerations. Raises InputError as `gust_notes`.
    """
    return (
        gust_notes(trajectory, runs, log)
        + lost_notes(trajectory)
        + time_shift_notes(trajectory)
        + heading_notes(trajectory, calibrated=magnetometer_calibrated)
        + sensor_error_notes(errors)
    )


def gust_notes(trajectory: Trajectory, runs: int, log: str) -> list[str]:
    """Return a note on the effect of turbulence on the angle of attack, where it is large.

    Raises InputError for a single run in gusts that leave the angle of attack more uncertain than allowed:
    a degree is 20 % of power near the stall.
    """
    sigma_deg = float(np.degrees(trajectory.standard_error("alpha_bias")))
    if sigma_deg < SHOWN.uncertain_alpha_deg or trajectory.gust_mps < SHOWN.turbulent_mps:
        return []
    effect = (
        f"vertical gusts of {trajectory.gust_mps:.1f} m/s leave the angle of attack uncertain by {sigma_deg:.1f} deg"
    )
    if runs == 1:
        raise InputError(f"{log}: one run alone, and {effect}; fly more runs, longer, or on a calmer day")
    return [f"{effect[0].upper()}{effect[1:]}: the interval is wide. A longer or calmer flight narrows it."]


def lost_notes(trajectory: Trajectory) -> list[str]:
    """Return a note on where the attitude could not be followed."""
    if not trajectory.lost_s:
        return []
    first, last = trajectory.lost_s[0], trajectory.lost_s[-1] + trajectory.block_means.step_s
    return [
        f"Between {first:.1f} and {last:.1f} s the attitude cannot be followed: the aircraft pitched through the"
        " vertical, as after a stall in gusts, or the gyros failed. Leave out runs next to it, and fly faster in gusts."
    ]


def sensor_error_notes(errors: list[SensorError]) -> list[str]:
    """Return notes on sensor errors with a large effect on power that the flight did not determine."""
    return [undetermined_text(error) for error in errors if error.name in MATTERS and not error.determined]


def heading_notes(trajectory: Trajectory, *, calibrated: bool) -> list[str]:
    """Return a note on how the heading was determined without GPS, or that the compass disagrees. calibrated: whether
    the log has a calibration of the magnetometer."""
    gps, residual = excitation(trajectory).gps, trajectory.residuals.get("compass")
    if residual is not None:
        offset = trajectory.value("heading_bias")
        largest = STATISTICS.sigmas * trajectory.prior_standard_error("heading_bias")
        if residual > STATISTICS.largest_misfit or abs(offset) > largest:
            return [
                f"The magnetometer contradicts {'GPS' if gps else 'the gyros'}: mean heading error"
                f" {math.degrees(1.0) * offset:+.0f} deg, rms residual {residual:.1f} standard deviations."
                " Check how it is mounted against the tray file."
            ]
        if gps:
            return []
        error = math.degrees(1.0) * float(np.median(trajectory.states_error()["psi"]))
        return [f"No GPS: the magnetometer held the heading; standard error {error:.1f} deg from magnetic north."]
    if gps:
        return []
    notes = ["No GPS: the heading was not determined; it is relative to the initial heading."]
    if not calibrated and trajectory.block_means.measured("mag_x_T"):
        notes.append("A magnetometer was recorded, but not its calibration; `analyze --magnetometer` takes one.")
    return [" ".join(notes)]


MISFIT = {
    "V": "airspeed",
    "alpha": "angle of attack",
    "beta": "sideslip",
    "height": "height",
    "gps_north": "GPS north",
    "gps_east": "GPS east",
}


class JointConflict(NamedTuple):
    """The two sensor errors that are least probable together, or all of them if all together are even less probable.

    errors : by sensor error, its estimate less the prior's mean, in units of the standard deviation that this
        difference has if the prior is right; empty where the probability is above EVIDENCE.false_alarms
    probability : upper bound of the probability that one flight with correct priors shows errors this improbable
    """

    errors: dict[str, float]
    probability: float


class PriorConflict(NamedTuple):
    """Conflict of the sensor errors with their priors.

    factor : (m,) factors on the prior standard deviations, order of SENSOR_ERRORS; 1 where there is no conflict
    z : by sensor error, the estimate less the prior's mean, in units of the standard deviation that this difference has
        if the prior is right; only the large ones
    common_factor : factor by which all sensor errors are larger than their priors; 1 where there is no conflict
    jointly : the conflict of two errors, or of all, taken together
    """

    factor: Array
    z: dict[str, float]
    common_factor: float
    jointly: JointConflict = JointConflict({}, 1.0)

    @property
    def conflicting(self) -> bool:
        """Whether any sensor error conflicts with its prior."""
        return bool(np.any(self.factor > 1))


def prior_conflict(trajectory: Trajectory) -> PriorConflict:
    """The conflict of a trajectory's sensor errors with their priors."""
    sigma = trajectory.prior_sigma
    y = (trajectory.sensor_errors - [PRIOR_MEAN.get(name, 0.0) for name in SENSOR_ERRORS]) / sigma
    covariance = trajectory.covariance / np.outer(sigma, sigma)
    posterior, directions = np.linalg.eigh(covariance)
    j = 1 / np.clip(posterior, 1e-12, 1.0) - 1
    informed = 1 - 1 / (1 + j) > PRIOR_CHECK.informed[0]
    variance, x_squared = 1 / j[informed], ((directions.T @ y)[informed] * (1 + 1 / j[informed])) ** 2
    size, z = _worst_first(y, covariance)
    conflicting = {SENSOR_ERRORS[i]: z[i] for i in sorted(z)}
    common_factor = 1.0
    if conflicting or np.sum(x_squared / (1 + variance)) > special.chdtri(
        max(informed.sum(), 1), STATISTICS.false_alarm_rate
    ):
        factors = np.linspace(1.0, 6.0, 501)
        total = factors[:, None] ** 2 + variance
        common_factor = float(factors[np.argmin(np.sum(np.log(total) + x_squared / total, axis=1))])
    factor = np.maximum(common_factor, size)
    factor[SENSOR_ERRORS.index("updraft")] = 1.0  # belongs to the air: its prior says nothing about the installation
    return PriorConflict(factor, conflicting, common_factor, joint_conflict(y, covariance))


def joint_conflict(y: Array, covariance: Array) -> JointConflict:
    """Test whether errors that are plausible one by one, such as an offset and a slope at 3.4 standard deviations, are
    too improbable together.

    y, covariance : estimates (m,) in prior standard deviations, and their posterior covariance (m, m)

    If the priors are right, estimates are normal with the covariance K, the prior's less the posterior's. So y' K^-1 y
    is chi-square distributed: for any two errors with two degrees of freedom, for all of them with as many as there are
    directions that the data determine. The probability of the worst pair is multiplied by the number of pairs; this
    and the probability of all are doubled, as there are two tests. That bounds the rate of false alarms (Bonferroni):
    in 20,000 draws from the covariances of 24 flights it was 0.20 %, with 0.3 % allowed.
    """
    gained = np.eye(len(y)) - covariance
    variance = np.diag(gained)
    indices = np.flatnonzero(variance > PRIOR_CHECK.informed[0])
    if len(indices) < 2:
        return JointConflict({}, 1.0)
    z = y[indices] / np.sqrt(variance[indices])
    correlation = gained[np.ix_(indices, indices)] / np.sqrt(np.outer(variance[indices], variance[indices]))
    first, second = np.triu_indices(len(indices), 1)
    r = correlation[first, second]
    apart = 1 - r**2 > PRIOR_CHECK.informed[0]  # otherwise both are one error under two names
    first, second, r = first[apart], second[apart], r[apart]
    squared = (z[first] ** 2 - 2 * r * z[first] * z[second] + z[second] ** 2) / (1 - r**2)
    eigenvalue, directions = np.linalg.eigh(correlation)
    informed = eigenvalue > PRIOR_CHECK.informed[0]
    of_all = special.chdtrc(informed.sum(), np.sum((directions.T @ z)[informed] ** 2 / eigenvalue[informed]))
    worst = int(np.argmax(squared)) if len(squared) else 0
    of_pair = len(squared) * special.chdtrc(2, squared[worst]) if len(squared) else 1.0
    members = range(len(indices)) if of_all < of_pair else (int(first[worst]), int(second[worst]))
    probability = float(min(1.0, 2 * min(of_all, of_pair)))
    if probability > EVIDENCE.false_alarms:
        return JointConflict({}, probability)
    return JointConflict({SENSOR_ERRORS[indices[i]]: float(z[i]) for i in members}, probability)


def against_prior(trajectory: Trajectory, name: str) -> tuple[float, float]:
    """Test one sensor error alone. Return its estimate in units of the standard deviation that it has if the prior,
    with mean zero, is right; and the size that the data give it, 1 sigma, which is no less than the prior's."""
    sigma = trajectory.prior_standard_error(name)
    y, share = trajectory.value(name) / sigma, (trajectory.standard_error(name) / sigma) ** 2
    (z,), (size,) = _each_against_prior(np.array([y]), np.array([share]))
    return float(z), float(size * sigma)


def _worst_first(y: Array, covariance: Array) -> tuple[Array, dict[int, float]]:
    """Find the sensor errors that contradict their priors, the worst first.

    Returns the size (m,) that the data give each of them, in prior standard deviations, 1 for all other errors; and by
    number of the error its estimate, in units of the standard deviation that it has if the prior is right.

    y, covariance : estimates in prior standard deviations, and their covariance
    The worst error gets a prior of its size and the others are estimated again, so an error that only compensated for
    the worst is not reported. The model is linear about the estimate. An error about which the data say little must be
    larger than noise rarely makes any error, because little is known about it once its prior has been widened.
    """
    size, contradicted = np.ones(len(y)), dict[int, float]()
    rare = -special.ndtri(EVIDENCE.rare_false_alarms / (2 * len(y)))
    information = np.linalg.inv(covariance)
    of_data = information @ y  # the prior's mean is 0
    while len(contradicted) < len(y):
        z, sizes = _each_against_prior(y, np.diag(covariance))
        z[[*contradicted]] = 0.0
        enough = 1 - np.diag(covariance) > PRIOR_CHECK.informed[1]
        contradicts = np.abs(z) > np.where(enough, EVIDENCE.contradiction, rare)
        if not contradicts.any():
            break
        worst = int(np.argmax(np.where(contradicts, np.abs(z), 0.0)))
        contradicted[worst], size[worst] = float(z[worst]), sizes[worst]
        information[worst, worst] -= 1 - 1 / sizes[worst] ** 2
        covariance = np.linalg.inv(information)
        y = covariance @ of_data
    return size, contradicted


def _each_against_prior(y: Array, share: Array) -> tuple[Array, Array]:
    """For each error alone, (m,): the estimate, in units of the standard deviation that it has if the prior is right;
    and the size that the data give it, in prior standard deviations.

    y : estimates in prior standard deviations     share : posterior over prior variance
    With a narrow prior an estimate stays near zero whatever the data say: its variance is only 1 - share. Where that is
    so small that the solver's last step matters, the error is not tested.
    """
    information = 1 - np.clip(share, 0.0, 1.0)
    informed = information > PRIOR_CHECK.informed[0]
    information = np.where(informed, information, 1.0)
    z = np.where(informed, y / np.sqrt(information), 0.0)
    return z, np.sqrt(np.maximum((y / information) ** 2 - (1 - information) / information, 1.0))


def conflict_notes(conflict: PriorConflict, trajectory: Trajectory) -> list[str]:
    """Return a note that describes the conflict. trajectory: the trajectory that has the conflict."""
    if not conflict.conflicting:
        return []
    named = [
        f"the {kind.title} is {value:+.1f} standard deviations"
        f" ({factor * trajectory.prior_standard_error(name):.2g} {unit})"
        for name, value in conflict.z.items()
        for kind in [SENSOR_ERROR_KINDS[name]]
        for factor, unit in [kind.display_unit]
    ]
    what = "; ".join(named) or f"by a factor of {conflict.common_factor:.1f} in all"
    return [
        f"The sensor errors are larger than assumed before the flight: {what}. The estimate was repeated with larger"
        " standard deviations, and the interval is wider. Check probe, tubes, tray, and the files that describe them."
    ]


def misfit(trajectory: Trajectory) -> dict[str, float]:
    """Measurements whose residuals are too large: rms in standard deviations."""
    return {name: rms for name, rms in trajectory.residuals.items() if name in MISFIT and rms > PRIOR_CHECK.largest_rms}


def misfit_in_words(trajectory: Trajectory) -> str:
    """Name the residuals that are larger than noise and gusts allow, in parentheses after a space; empty if none."""
    misfits = misfit(trajectory)
    named = "; ".join(f"{MISFIT[name]} by {rms:.0f}" for name, rms in misfits.items())
    return f" (residuals too large: {named})" if named else ""


def with_misfit(trajectory: Trajectory) -> tuple[Trajectory, list[str]]:
    """Return the trajectory, less certain if residuals are larger than noise and gusts allow, and a warning if so."""
    misfits = misfit(trajectory)
    if not misfits:
        return trajectory, []
    worst = max(misfits.values())
    wider = replace(
        trajectory,
        covariance=trajectory.covariance * worst**2,
        prior_sigma=trajectory.prior_sigma * worst,  # so that the prior remains part of the estimate's information
        draws=trajectory.draws * worst,
        states_given_errors=StatesGivenErrors(trajectory.states_given_errors.factor / worst),
    )
    named = "; ".join(f"{MISFIT[name]} by {rms:.1f}" for name, rms in misfits.items())
    return wider, [
        f"Residuals of the flight path are larger than noise and gusts allow: {named}. The interval has been widened by"
        " that factor. Check the sensor, its line and its calibration."
    ]
