"""What contradicts a result: the evidence, and the verdict that follows from it (docs/understand/trust.md).

Each item has its own figure and limit. Limits for noise follow from a rate of false alarms; limits from physics apply
without noise. A result that is not to be trusted ends `analyze` with exit code 1; a doubtful result is announced first.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import msgspec
import numpy as np
from scipy import special

from flightpower.analysis.curve import POLAR, Condition, Polar, drag_and_error, drag_terms, lift_coefficient
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.consider import UPDRAFT
from flightpower.analysis.methods.motor_lag import PARAMETER as MOTOR_LAG_PARAMETER
from flightpower.analysis.methods.motor_speed import PARAMETER as MOTOR_SPEED_PARAMETER
from flightpower.analysis.methods.rejected_assumptions import THRUST_TITLES
from flightpower.analysis.methods.settings import MOTOR_SPEED
from flightpower.analysis.methods.thrust_prior import STAND
from flightpower.analysis.methods.whole_flight.settings import PRIOR as POWER_TRAIN
from flightpower.analysis.methods.whole_flight.settings import THRUST
from flightpower.analysis.records.flight import (
    CurveStatus,
    Evidence,
    EvidenceKind,
    Interval,
    MethodRejection,
    PartOfResult,
    PoolingStatistics,
    PowerPoint,
    Results,
    RunAgainstOthers,
    Trust,
)
from flightpower.analysis.results.settings import TRUST
from flightpower.analysis.settings import CURVES, EVIDENCE, FLOWN
from flightpower.analysis.trajectory.observability import SENSOR_ERROR_KINDS
from flightpower.flight.messages import Comparison
from flightpower.flight.units import GRAVITY_MPS2

_WORST_FIRST = (Trust.NOT_TO_BE_TRUSTED, Trust.DOUBTFUL, Trust.TRUSTED)

# The usual reason why a sensor error is larger than assumed, by the error's name in `path`.
CULPRIT = {
    "alpha_bias": "the probe is mounted at an angle to the IMU, or the IMU is not level with the aircraft",
    "alpha_scale": "the boom bends, or upwash or the probe's calibration is wrong",
    "beta_bias": "the probe or the IMU is turned sideways",
    "V_scale": "the airspeed line leaks, or the calibration of probe or transducer is wrong",
    "air_data_lag": "the tubes are long or narrow, or a clock is late",
    "gps_latency": "a clock is late",
    "heading_bias": "the IMU is turned to the side, or the compass is not calibrated",
    "ax_bias": "vibration of the motor or temperature moves the accelerometer's zero, or the IMU is not level",
    "ay_bias": "vibration of the motor or temperature moves the accelerometer's zero, or the IMU is not level",
    "az_bias": "vibration of the motor or temperature moves the accelerometer's zero, or its scale is wrong",
    "p_bias": "the gyro drifts with temperature, or vibrates",
    "q_bias": "the gyro drifts with temperature, or vibrates",
    "r_bias": "the gyro drifts with temperature, or vibrates",
    "dp_alpha_zero": "the transducer's zero drifts, or water is in the line",
    "q_c_zero": "the transducer's zero drifts, water is in the line, or the static ports are in the wing's flow",
    "ax_vibration": "vibration of the motor: balance the propeller, and mount the tray softly",
    "az_vibration": "vibration of the motor: balance the propeller, and mount the tray softly",
    "alpha_per_g": "the boom of the probe bends under its weight",
    "updraft": "the air rose or sank over the flight: state [uncertainty] updraft",
    "p_scale": "the gyro is of another range or badly scaled: turn the tray by 360 degrees on a table and compare",
    "q_scale": "the gyro is of another range or badly scaled: turn the tray by 360 degrees on a table and compare",
    "r_scale": "the gyro is of another range or badly scaled: turn the tray by 360 degrees on a table and compare",
    "ax_scale": "the accelerometer is of another range or badly scaled: it must read 1 g with that axis up, -1 g down",
    "probe_ahead": "the probe sits elsewhere than assumed: enter `probe.position`",
    "az_scale": "the accelerometer is of another range or badly scaled: it must read 1 g with that axis up, -1 g down",
}


def evidence_against(results: Results) -> list[Evidence]:
    """Return evidence, worst first, causes before consequences; empty if the result can be used within its interval."""
    evidence = [
        *_estimation(results),
        *_failed_methods(results),
        *_counted_speed(results.pooling),
        *_motor_lag(results.pooling),
        *_folding_or_windmilling(results),
        *_thrust(results.pooling),
        *_kinds_of_runs(results.accelerations_against_decelerations),
        *_motor_speed(results),
        *_efficiencies(results),
        *_shaft(results),
        *_thrust_efficiency(results),
        *_lift_coefficient(results),
        *_implausible(results),
        *_sensor_errors(results),
        *_sensor_errors_together(results),
        *_runs(results),
        *_outside_table(results),
        *_curve(results),
    ]
    return worst_first(evidence)


def worst_first(evidence: Iterable[Evidence]) -> list[Evidence]:
    """Sort evidence by level, causes before their consequences."""
    kinds = list(EvidenceKind)
    return sorted(evidence, key=lambda evidence: (_WORST_FIRST.index(evidence.level), kinds.index(evidence.kind)))


def trust_by(evidence: Iterable[Evidence]) -> Trust:
    """Return the verdict, which is as bad as the worst evidence."""
    return min((piece.level for piece in evidence), key=_WORST_FIRST.index, default=Trust.TRUSTED)


def with_trust(results: Results) -> Results:
    """Return the results with their evidence and the verdict."""
    evidence = evidence_against(results)
    return msgspec.structs.replace(results, evidence=evidence, trust=trust_by(evidence))


def reasons_not_to_trust(results: Results) -> list[str]:
    """Return a sentence or two per item; empty if the result, even if doubtful, can be used within its interval."""
    return [evidence.text for evidence in results.evidence if evidence.level is Trust.NOT_TO_BE_TRUSTED]


def sentence(evidence: Evidence) -> str:
    """Say what is in doubt and why, and name the flight if there are several."""
    return f"{evidence.part}. {_reason(evidence)}"


def sentences(evidence: Iterable[Evidence]) -> list[str]:
    """Return sentences for all evidence, to go below a heading; each change in what is doubtful is announced."""
    sentences, part = list[str](), None
    for statement in evidence:
        also = "Also doubtful: " if sentences else ""
        sentences.append(_reason(statement) if statement.part is part else f"{also}{sentence(statement)}")
        part = statement.part
    return sentences


def _reason(evidence: Evidence) -> str:
    return f"{evidence.log}: {evidence.text}" if evidence.log else evidence.text


def _estimation(results: Results) -> Iterator[Evidence]:
    if results.status and not results.status.usable:
        yield Evidence(
            kind=EvidenceKind.TRAJECTORY_NOT_CONVERGED
            if results.status is CurveStatus.TRAJECTORY_NOT_CONVERGED
            else EvidenceKind.NOT_CONVERGED,
            level=Trust.NOT_TO_BE_TRUSTED,
            text=f"The estimation did not converge: {results.verdict}.",
        )
    elif (
        results.path is not None
        and not results.path.converged
        and results.status is not CurveStatus.BY_ANOTHER_METHOD  # that method does not need a trajectory
    ):
        yield Evidence(
            kind=EvidenceKind.TRAJECTORY_NOT_CONVERGED,
            level=Trust.NOT_TO_BE_TRUSTED,
            text="The trajectory did not converge.",
        )


def _failed_methods(results: Results) -> Iterator[Evidence]:
    """Judge runs that should give drag when every method finds an impossible polar: the energy balance uses the same
    aircraft file and sensors, so it is in doubt as well."""
    tried = results.methods_tried
    failed = [
        method_tried
        for method_tried in tried
        if method_tried.reason not in (MethodRejection.NONE, MethodRejection.NOT_FLOWN)
    ]
    if not failed or tried[-1].reason is MethodRejection.NONE:
        return
    yield Evidence(
        kind=EvidenceKind.METHOD_FAILED,
        level=Trust.DOUBTFUL,
        subject=failed[0].name,
        text=(
            f"The runs give no drag ({failed[0].title}: {failed[0].text}); the curve is that of the energy balance"
            " instead, with the same weight and wing area. Check these, the propeller and its table,"
            " `propulsion.pole_pairs`, and units and delays of the log."
        ),
    )


def noise_limit(tests: int) -> float:
    """Return the limit [standard deviations] that the largest of `tests` normal errors exceeds at the stated rate."""
    return float(-special.ndtri(TRUST.false_alarm_rate / (2 * max(tests, 1))))


def _level(figure: float, limit: float) -> Trust:
    """Return the level of evidence: beyond twice its limit, even errors twice as large as stated are rejected."""
    return Trust.NOT_TO_BE_TRUSTED if abs(figure) > TRUST.beyond_doubt * limit else Trust.DOUBTFUL


@dataclass(frozen=True)
class _Deviation:
    """A deviating quantity: title, name in the file, and deviation in standard deviations."""

    title: str
    subject: str
    sigmas: float


def _thrust(statistics: PoolingStatistics | None) -> Iterator[Evidence]:
    """Judge corrections of thrust that contradict the priors of the table, as one item, since they share one cause."""
    if statistics is None:
        return
    deviations = _thrust_deviations(statistics)
    worst = max(deviations, key=lambda deviation: abs(deviation.sigmas), default=None)
    limit = noise_limit(len(deviations))
    if worst is None or abs(worst.sigmas) <= limit:
        return
    yield _off_the_table(
        worst.subject,
        (worst.sigmas, limit, "standard deviations"),
        f"Thrust differs from the propeller's table by {worst.sigmas:+.1f} times the standard deviation assumed"
        f" ({worst.title}; limit {limit:.1f}): check the weight, `propulsion.pole_pairs`, the pulses of the motor"
        " speed, the propeller and its table, and analyze again.",
    )


def _off_the_table(subject: str, extreme: tuple[float, float, str], text: str) -> Evidence:
    """Return the evidence against the thrust of a table. extreme: figure, the limit that it exceeds, and their unit"""
    figure, limit, unit = extreme
    return Evidence(
        kind=EvidenceKind.THRUST_TABLE,
        level=_level(figure, limit),
        subject=subject,
        figure=figure,
        unit=unit,
        limit=limit,
        false_alarm_rate=TRUST.false_alarm_rate,
        text=text,
    )


def _thrust_deviations(statistics: PoolingStatistics) -> list[_Deviation]:
    values = dict(zip(statistics.names, statistics.values, strict=True))
    sigmas = dict(zip(statistics.names, statistics.prior_sigma, strict=True))
    deviations = [
        _Deviation(title, name, values[name] / s) for name, title in THRUST_TITLES.items() if (s := sigmas.get(name))
    ]
    for measured in statistics.prior_measurements or []:
        estimated = sum(factor * values[name] for name, factor in measured.coefficients.items())
        deviations.append(
            _Deviation(THRUST_TITLES[STAND], measured.name, (estimated - measured.value) / measured.sigma)
        )
    return deviations


def _kinds_of_runs(compared: RunAgainstOthers | msgspec.UnsetType) -> Iterator[Evidence]:
    """Compare acceleration with deceleration runs if the curve is by their energy, which does not correct thrust."""
    limit = noise_limit(1)
    if compared is msgspec.UNSET or abs(compared.z) <= limit:
        return
    yield _off_the_table(
        compared.run,
        (compared.z, limit, "standard errors"),
        f"By energy the {compared.run} give {100 * (compared.power_W / compared.others_W - 1):+.0f} % of power"
        f" against the decelerations at {compared.speed_mps:.1f} m/s, {abs(compared.z):.1f} standard errors (limit"
        f" {limit:.1f}): thrust or the lag of the airspeed differs by more than assumed. Check motor speed,"
        " propeller and table.",
    )


def _counted_speed(statistics: PoolingStatistics | None) -> Iterator[Evidence]:
    """Judge an error of motor speed that the runs showed and for which the curve is corrected."""
    if statistics is None or MOTOR_SPEED_PARAMETER not in statistics.names:
        return
    share, error = _estimate(statistics, MOTOR_SPEED_PARAMETER)
    poles, limit = abs(share) > MOTOR_SPEED.least_pole_share, MOTOR_SPEED.least_errors * error
    check = "check `propulsion.pole_pairs`, and analyze again" if poles else "check its signal and wires"
    yield Evidence(
        kind=EvidenceKind.COUNTED_SPEED,
        level=Trust.NOT_TO_BE_TRUSTED if poles else _level(share, limit),
        subject=MOTOR_SPEED_PARAMETER,
        figure=100 * share,
        unit="%",
        limit=100 * limit,
        text=(
            f"The motor turns {abs(100 * share):.1f} ± {100 * NORMAL_95 * error:.1f} %"
            f" {'faster' if share > 0 else 'slower'} than counted, since accelerations and decelerations differ in drag"
            f" at one speed. The curve is corrected for it; {check}."
        ),
    )


def _estimate(statistics: PoolingStatistics, name: str) -> tuple[float, float]:
    """Return the estimate of a parameter and its standard error."""
    i = statistics.names.index(name)
    return statistics.values[i], math.sqrt(statistics.covariance[i][i])


def _motor_lag(statistics: PoolingStatistics | None) -> Iterator[Evidence]:
    """Judge a lag of the motor speed that the runs showed and for which the curve is corrected."""
    if statistics is None or MOTOR_LAG_PARAMETER not in statistics.names:
        return
    lag_s, error_s = _estimate(statistics, MOTOR_LAG_PARAMETER)
    limit_s = MOTOR_SPEED.least_errors * error_s
    yield Evidence(
        kind=EvidenceKind.MOTOR_LAG,
        level=_level(lag_s, limit_s),
        subject=MOTOR_LAG_PARAMETER,
        figure=lag_s,
        unit="s",
        limit=limit_s,
        text=(
            f"The motor speed is {abs(1000 * lag_s):.0f} ± {1000 * NORMAL_95 * error_s:.0f} ms"
            f" {'late' if lag_s > 0 else 'early'} against the IMU, by the acceleration that thrust gives. The curve is"
            " corrected for it. Check what smooths the motor speed or delays it, and the clocks of counter and IMU;"
            " `specific_force_group_delay_s` and the counter's period state known delays."
        ),
    )


def _folding_or_windmilling(results: Results) -> Iterator[Evidence]:
    """Judge whether the propeller's other behavior beyond zero thrust (folding, windmilling) fits the runs better."""
    gain, limit = results.other_blades_gain, MOTOR_SPEED.least_errors**2 / 2
    if gain is msgspec.UNSET or gain <= limit:
        return
    yield Evidence(
        kind=EvidenceKind.OTHER_BLADES,
        level=Trust.NOT_TO_BE_TRUSTED,
        figure=gain,
        limit=limit,
        text=(
            "The runs with little thrust fit a propeller that folds far better than one that windmills, or the other"
            f" way around (log likelihood {gain:+.0f}, limit {limit:.0f}): set `propulsion.beyond_zero_thrust` to what"
            " the blades do, and analyze again."
        ),
    )


def _motor_speed(results: Results) -> Iterator[Evidence]:
    ratio = results.speed_over_motor_constant
    if ratio is None or abs(ratio - 1) <= TRUST.motor_constant:
        return
    yield Evidence(
        kind=EvidenceKind.MOTOR_SPEED,
        level=_level(ratio - 1, TRUST.motor_constant),
        figure=ratio,
        limit=1 + TRUST.motor_constant if ratio > 1 else 1 - TRUST.motor_constant,
        text=(
            f"Motor speed at full throttle is {ratio:.2f} times what the motor's kV, voltage and current give: check"
            " `propulsion.pole_pairs` first, then kV, resistance and the power module."
        ),
    )


def _efficiencies(results: Results) -> Iterator[Evidence]:
    """Judge the efficiencies in level flight within the table; a value above one is impossible."""
    if results.use is None:
        return
    train = results.use.power_train
    inside_table = [point for point in train.efficiency if not point.extrapolated]
    yield from _efficiency(EvidenceKind.PROPELLER_EFFICIENCY, [p.propeller for p in inside_table], TRUST.best_propeller)
    if train.measured:
        yield from _efficiency(EvidenceKind.MOTOR_EFFICIENCY, [p.motor for p in inside_table], 1.0)


_CHECK_EFFICIENCY: Mapping[EvidenceKind, str] = {
    EvidenceKind.PROPELLER_EFFICIENCY: "Propeller efficiency in level flight is {:.2f}, more than any propeller has:"
    " check `propulsion.pole_pairs`, the propeller and its table, and the weight.",
    EvidenceKind.MOTOR_EFFICIENCY: "Shaft power is {:.2f} times the power from the battery: check"
    " `propulsion.pole_pairs`, the propeller's table, and the power module.",
}


def _efficiency(kind: EvidenceKind, values: list[Interval], best: float) -> Iterator[Evidence]:
    """Judge efficiencies: not to be trusted if the interval at any speed is above one; doubtful if an interval is above
    `best`, or a value above one."""
    impossible = [interval for interval in values if interval.lo > 1]
    doubtful = [interval for interval in values if interval.lo > best or interval.value > 1]
    if not doubtful:
        return
    figure = max(interval.value for interval in doubtful)
    yield Evidence(
        kind=kind,
        level=Trust.NOT_TO_BE_TRUSTED if impossible else Trust.DOUBTFUL,
        part=PartOfResult.CURVE if kind is EvidenceKind.PROPELLER_EFFICIENCY else PartOfResult.POWER_TRAIN,
        figure=figure,
        limit=1.0 if figure > 1 else best,
        text=_CHECK_EFFICIENCY[kind].format(figure),
    )


def _shaft(results: Results) -> Iterator[Evidence]:
    """Judge shaft power in the energy balance; if it is implausible, drag from the propeller's table is withheld."""
    share = results.balance.shaft_over_electrical if results.balance else None
    least, greatest = THRUST.motor_efficiency
    if share is None or least < share < greatest:
        return
    yield Evidence(
        kind=EvidenceKind.MOTOR_EFFICIENCY,
        level=Trust.DOUBTFUL,
        figure=share,
        limit=least if share <= least else greatest,
        text=(
            f"By the propeller's table and motor speed the shaft takes {100 * share:.0f} % of the electrical power;"
            f" motors with their controllers have {100 * least:.0f} to {100 * greatest:.0f} %. Check the propeller and"
            " its table, the pole pairs that the speed was counted with, and the scale of the current sensor."
        ),
    )


def _thrust_efficiency(results: Results) -> Iterator[Evidence]:
    """Judge the efficiency from battery to thrust that the flight's energy alone determines.

    A wrong scale of the current gives an efficiency that no power train has, or hardly any. For such an efficiency, a
    deviation at the 95 % level is enough; other efficiencies need a deviation at the false-alarm rate.
    """
    eta = results.balance.thrust_efficiency if results.balance else None
    if eta is None or eta.lo <= 0:
        return
    usual, T = POWER_TRAIN.efficiency, TRUST
    error = math.hypot(math.log(eta.hi / eta.lo) / (2 * NORMAL_95), usual.sigma * (1 - usual.mean))
    z_limit = -float(special.ndtri(T.false_alarm_rate))  # both sides: too little or too much current

    def efficiency_at(sigmas: float) -> float:
        return usual.mean * math.exp(sigmas * error)

    least = max(efficiency_at(-z_limit), min(T.least_power_train, efficiency_at(-NORMAL_95)))
    most = min(efficiency_at(z_limit), max(T.best_propeller, efficiency_at(NORMAL_95)))
    if least <= eta.value <= most:
        return
    impossible = eta.value > T.best_propeller and eta.lo > T.best_power_train
    certain = impossible or not efficiency_at(-T.beyond_doubt * z_limit) <= eta.value <= efficiency_at(
        T.beyond_doubt * z_limit
    )
    yield Evidence(
        kind=EvidenceKind.THRUST_EFFICIENCY,
        level=Trust.NOT_TO_BE_TRUSTED if certain else Trust.DOUBTFUL,
        figure=eta.value,
        limit=least if eta.value < least else most,
        false_alarm_rate=T.false_alarm_rate,
        text=(
            "Climbs, changes of speed and drag show an efficiency from battery to thrust of"
            f" {eta.value:.2f} ({eta.lo:.2f} to {eta.hi:.2f}), where small aircraft have 0.4 to 0.7, as if the"
            f" current were shown {usual.mean / eta.value:.2g} times as large as it is: check the scale of the"
            " current sensor against a charger or a clamp meter, then voltage, mass and wing area."
        ),
    )


def _lift_coefficient(results: Results) -> Iterator[Evidence]:
    """Judge the lift coefficient of level flight at the slowest speed flown: a wrong mass or area distorts it."""
    measured = [point.speed_mps for point in results.curves[results.kind].points if not point.extrapolated]
    if not measured:
        return
    condition = Condition(results.test.weight_N, results.test.air_density_kgpm3, results.aircraft.wing_area_m2)
    CL = float(lift_coefficient(measured[0], condition))
    if CL <= FLOWN.doubtful_CL:
        return
    yield Evidence(
        kind=EvidenceKind.LIFT_COEFFICIENT,
        level=Trust.DOUBTFUL,
        figure=CL,
        limit=FLOWN.doubtful_CL,
        text=(
            f"At the slowest speed flown, {measured[0]:.1f} m/s, {results.test.weight_N / GRAVITY_MPS2:.3g} kg on"
            f" {results.aircraft.wing_area_m2:.3g} m² require a lift coefficient of {CL:.1f}; clean wings reach 1.6,"
            f" wings with slotted flaps {FLOWN.doubtful_CL:g}. Check mass and wing area, then the airspeed."
        ),
    )


def _sensor_errors(results: Results) -> Iterator[Evidence]:
    """Judge sensor errors that were beyond their priors in the first estimate.

    The estimate was repeated with wider priors, so that the interval allows for an error of that size. Another defect
    may look like a sensor error: if the interval does not contain the uncorrected curve, it is not to be trusted.
    """
    if results.path is None or results.pooling is None:
        return
    of_installation = noise_limit(len(results.pooling.names))
    for name, sigmas in results.path.prior_conflicts.items():
        limit = EVIDENCE.contradiction if name == UPDRAFT else of_installation  # the curve is corrected for an updraft
        if abs(sigmas) <= limit:
            continue
        subject, level, reason = SENSOR_ERROR_KINDS[name].title, _level(sigmas, limit), ""
        if level is Trust.NOT_TO_BE_TRUSTED:
            reason = f"; not to be trusted beyond {TRUST.beyond_doubt:g} times that"
        elif not _effect(name, results.pooling) < 1:
            level, reason = Trust.NOT_TO_BE_TRUSTED, "; its correction moves the curve out of the interval"
        yield Evidence(
            kind=EvidenceKind.SENSOR_ERROR,
            level=level,
            subject=name,
            figure=sigmas,
            unit="standard deviations",
            limit=limit,
            false_alarm_rate=float(2 * special.ndtr(-limit)) if name == UPDRAFT else TRUST.false_alarm_rate,
            text=(
                f"The {subject} is {sigmas:+.1f} times the standard deviation assumed (limit {limit:.1f}{reason})."
                f" Usually {CULPRIT[name]}. If it cannot be fixed, enter a larger value in [uncertainty] of the"
                " aircraft file."
            ),
        )


def _effect(name: str, statistics: PoolingStatistics) -> float:
    """Return how far the correction of a sensor error moves the curve at most, in half widths of its interval; 0 for an
    error that is not among the statistics."""
    if name not in statistics.names:
        return 0.0
    i = statistics.names.index(name)
    with_polar, variance = np.array(statistics.covariance[i][: len(POLAR)]), statistics.covariance[i][i]
    change = with_polar / variance * (statistics.values[i] - statistics.prior_mean[i])
    CL = np.linspace(*statistics.flown_CL, CURVES.points)
    _, error = drag_and_error(Polar(np.zeros(3), np.array(statistics.polar_covariance)), CL)
    return float(np.max(np.abs(drag_terms(CL) @ change) / (NORMAL_95 * error)))


def _sensor_errors_together(results: Results) -> Iterator[Evidence]:
    """Judge errors that are within their own limits but that a common cause appears to move together."""
    test = results.path.joint_conflict if results.path else None
    if test is None or test.probability > TRUST.false_alarm_rate or any(_sensor_errors(results)):
        return
    worst = sorted(test.errors, key=lambda name: -abs(test.errors[name]))[:2]
    named = " and ".join(f"the {SENSOR_ERROR_KINDS[name].title} ({test.errors[name]:+.1f})" for name in worst)
    causes = "; or ".join(dict.fromkeys(CULPRIT[name] for name in worst))
    yield Evidence(
        kind=EvidenceKind.SENSOR_ERRORS_TOGETHER,
        level=Trust.DOUBTFUL,
        subject=" ".join(worst),
        figure=test.probability,
        limit=TRUST.false_alarm_rate,
        false_alarm_rate=TRUST.false_alarm_rate,
        text=(
            "No sensor error alone is beyond its limit, but together they are improbable (probability"
            f" {test.probability:.1g}, limit"
            f" {TRUST.false_alarm_rate:g}), most of all {named} in the standard deviations assumed. They may have one"
            f" cause: the air sank or rose, or an instrument is mounted wrong ({causes})."
        ),
    )


# The measurement that each of these comparisons by the daemon puts in doubt. Other comparisons need no item: GPS is
# only an aid, and the trajectory shows its faults.
_DOUBTED = {
    Comparison.AIRSPEED: "airspeed, which the speed over the ground contradicts by more than any wind",
    Comparison.ANGLE_OF_ATTACK: "angle of attack, which attitude and climb contradict",
    Comparison.BAROMETERS: "static pressure, which the barometer in the fuselage contradicts",
    Comparison.MOTOR: "motor speed, which the current contradicts",
}


def _implausible(results: Results) -> Iterator[Evidence]:
    """Judge runs that were flown while the daemon found readings that contradict each other."""
    readings = results.provenance.implausible if results.provenance else []
    for compared, doubted in _DOUBTED.items():
        periods = [(reading.start_s, reading.end_s) for reading in readings if reading.compared is compared]
        shared_s = sum(
            max(0.0, min(end_s, run.end_s) - max(start_s, run.start_s))
            for run in results.runs
            for start_s, end_s in periods
        )
        if shared_s > 0:
            yield Evidence(
                kind=EvidenceKind.IMPLAUSIBLE_READINGS,
                level=Trust.DOUBTFUL,
                subject=compared,
                figure=shared_s,
                unit="s",
                limit=0.0,
                text=(
                    f"In {shared_s:.0f} s of the runs the daemon flagged the {doubted}: check it in those runs, and"
                    " leave them out (runs.toml) if it was wrong."
                ),
            )


def _runs(results: Results) -> Iterator[Evidence]:
    """Judge the run that differs most from the others of its kind."""
    compared = results.runs_against_others
    worst = max(compared, key=lambda runs_against_other: abs(runs_against_other.z), default=None)
    limit = noise_limit(len(compared))
    if worst is None or abs(worst.z) <= limit:
        return
    deviating = sum(abs(runs_against_other.z) > limit for runs_against_other in compared)
    yield Evidence(
        kind=EvidenceKind.RUN_AGAINST_OTHERS,
        level=_level(worst.z, limit),
        part=PartOfResult.CURVE if deviating > 1 else PartOfResult.AT_SPEED,
        subject=worst.run,
        figure=worst.z,
        unit="standard errors",
        limit=limit,
        false_alarm_rate=TRUST.false_alarm_rate,
        text=(
            f"The {worst.run} gives {100 * (worst.power_W / worst.others_W - 1):+.0f} % of power against the others of"
            f" its kind at {worst.speed_mps:.1f} m/s, {abs(worst.z):.1f} standard errors (limit {limit:.1f};"
            f" {deviating} of {len(compared)} runs are beyond it). Check that run for gear or flaps, a thermal, or lost"
            " pulses; leave it out of runs.toml if it had one."
        ),
    )


def _outside_table(results: Results) -> Iterator[Evidence]:
    curve = results.power_required
    share = sum(point.extrapolated for point in curve) / max(len(curve), 1)
    if share <= 1 - FLOWN.least_covered:
        return
    yield Evidence(
        kind=EvidenceKind.OUTSIDE_TABLE,
        level=Trust.DOUBTFUL,
        figure=share,
        limit=1 - FLOWN.least_covered,
        text=(
            f"{100 * share:.0f} % of the curve's speeds lie outside the propeller's table: use a table that reaches to"
            " windmilling, or fly with power on."
        ),
    )


def _curve(results: Results) -> Iterator[Evidence]:
    curve = results.power_required or results.electrical_power
    if any(point.power_lo_W <= 0 for point in curve):
        yield Evidence(
            kind=EvidenceKind.INTERVAL_REACHES_ZERO,
            level=Trust.NOT_TO_BE_TRUSTED,
            figure=_least(curve).power_lo_W,
            unit="W",
            limit=0.0,
            text=f"The 95 % interval reaches zero at {_least(curve).speed_mps:.1f} m/s.",
        )
    if results.drag_polar is not None and results.drag_polar.A2 <= 0:
        yield Evidence(
            kind=EvidenceKind.POLAR_CURVES_DOWNWARD,
            level=Trust.NOT_TO_BE_TRUSTED,
            figure=results.drag_polar.A2,
            limit=0.0,
            text="The drag polar curves downward (A2 is not above zero), which would make drag by lift negative: the"
            " range of lift coefficients flown is too narrow.",
        )
    if results.cross_check_differs:
        yield Evidence(
            kind=EvidenceKind.CROSS_CHECK,
            level=Trust.DOUBTFUL,
            text="The cross-check by output error differs from the curve by more than their intervals allow.",
        )


def _least(curve: list[PowerPoint]) -> PowerPoint:
    return min(curve, key=lambda point: point.power_lo_W)
