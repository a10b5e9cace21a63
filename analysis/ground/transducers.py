"""Slope and offset of the differential pressure transducers, from pressures applied to all three of them."""

from collections.abc import Sequence

import numpy as np
from scipy import special

from analysis.airdata.settings import GROUND
from analysis.airdata.transducers import CHANNELS, Plateau, TransducerCalibration, TransducerLine, in_words
from analysis.estimation.noise import NORMAL_95
from analysis.signals.settings import STATISTICS
from flight.aircraft import Uncertainty
from flight.errors import InputError


def calibrate(
    plateaus: Sequence[Plateau], pressures_Pa: Sequence[float], reference_error: float, source: str
) -> tuple[TransducerCalibration, str]:
    """The lines of the three transducers, and why the data do not support them (empty if they do).

    pressures_Pa : of the plateaus with pressure, in order; those at zero are known
    reference_error : standard deviation of the reference's scale
    Raises InputError if the pressures are not those of the plateaus.
    """
    pressed = [plateau for plateau in plateaus if not plateau.open]
    if len(pressed) != len(pressures_Pa):
        raise InputError(
            f"{source}: {len(pressures_Pa)} pressures for {len(pressed)} plateaus: give one for each, in order, without"
            f" those at zero. Plateaus: {in_words(plateaus)}"
        )
    levels, (fewest, _) = len(set(pressures_Pa)), GROUND.fewest
    if levels < fewest:
        raise InputError(f"{source}: {levels} pressures beside zero are too few; hold {fewest} at least, up to 400 Pa")
    remaining = iter(pressures_Pa)
    p = np.array([0.0 if plateau.open else next(remaining) for plateau in plateaus])
    readings = np.array([plateau.readings_Pa for plateau in plateaus])
    X = np.column_stack([np.ones(len(p)), p])
    coefficients, *_ = np.linalg.lstsq(X, readings, rcond=None)
    residuals = readings - X @ coefficients
    dof = len(p) - 2
    # Few residuals determine their own size poorly: Student's distribution, so that 95 % intervals are such.
    factor = float(special.stdtrit(dof, 0.975)) / NORMAL_95
    sigma = factor * np.sqrt(np.sum(residuals**2, axis=0) / dof * np.linalg.inv(X.T @ X)[1, 1])
    slopes = coefficients[1]
    for name, slope in zip(CHANNELS, slopes.tolist(), strict=True):
        if slope < 0:
            raise InputError(
                f"{source}: /probe/{name} falls as the pressure rises: connect the pressure to the port that it counts"
                " as positive (lower, right, center), or give negative pressures for all three"
            )
        if abs(slope - 1) > GROUND.largest_gain_error:
            raise InputError(
                f"{source}: /probe/{name} reads {slope:.2f} times the pressures given: check their unit and order, and"
                " the T-piece"
            )
    lines = {
        name: TransducerLine(
            slope=float(slopes[i]),
            slope_error=float(np.hypot(sigma[i], reference_error * slopes[i])),
            offset_Pa=float(coefficients[0, i]),
            largest_residual_Pa=float(np.max(np.abs(residuals[:, i]))),
            largest_Pa=float(np.max(np.abs(p))),
        )
        for i, name in enumerate(CHANNELS)
    }
    speed = lines["airspeed"]
    calibration = TransducerCalibration(
        source=source,
        plateaus=len(p),
        reference_error=reference_error,
        alpha=lines["alpha"],
        beta=lines["beta"],
        airspeed=speed,
        # Airspeed is as the root of its pressure.
        airspeed_scale=float(np.sqrt(speed.slope) - 1),
        airspeed_scale_error=speed.slope_error / speed.slope / 2,
    )
    return calibration, _why_not_supported(calibration)


def _why_not_supported(calibration: TransducerCalibration) -> str:
    """Empty if the slopes are known clearly better than a flight without calibration assumes."""
    prior = Uncertainty()
    largest_V_scale, largest_alpha_scale = (
        STATISTICS.determined_share * sigma
        for sigma in (prior.airspeed_scale_fraction, prior.angle_of_attack_slope_fraction)
    )
    errors = [
        ("airspeed", calibration.airspeed_scale_error, largest_V_scale),
        *(
            (f"the slope of /probe/{name}", line.slope_error / line.slope, largest_alpha_scale)
            for name, line in (("alpha", calibration.alpha), ("beta", calibration.beta))
        ),
    ]
    for what, error, largest in errors:
        if error > largest:
            line = calibration.airspeed if what == "airspeed" else calibration.line(what.rpartition("/")[2])
            return (
                f"the standard error of {what} is {100 * error:.1f} %, more than {100 * largest:.1f} %: the reference"
                f" is known to {100 * calibration.reference_error:.1f} %, and readings are up to"
                f" {line.largest_residual_Pa:.1f} Pa off a straight line; hold more pressures, up to 400 Pa, and look"
                " for a leak, a wrong reading or a wrong order"
            )
    return ""
