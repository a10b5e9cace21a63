"""Finds slope and offset of the differential pressure transducers from pressures applied to all three of them."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from scipy import special

from flightpower.analysis.air.settings import GROUND
from flightpower.analysis.air.transducers import CHANNELS, Plateau, TransducerCalibration, TransducerLine, in_words
from flightpower.analysis.calibrations.runner import Calibrated, CalibrationFile, LogFile, calibration
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.sources.autopilot_settings import READABLE
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.command_line import Quantity, numbers_and_unit
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2, to_si

if TYPE_CHECKING:
    from flightpower.analysis.air.transducers import TransducerCalibration


def calibrate(
    plateaus: Sequence[Plateau], pressures_Pa: Sequence[float], reference_error: float, source: str
) -> tuple[TransducerCalibration, str]:
    """Fit a line to each of the three transducers; also return why the data do not support them (empty if they do).

    pressures_Pa : of the plateaus with pressure, in order; plateaus at zero need none
    reference_error : standard deviation of the reference's scale, as a fraction
    Raises InputError if the pressures do not match the plateaus.
    """
    pressed = [plateau for plateau in plateaus if not plateau.open]
    if len(pressed) != len(pressures_Pa):
        raise InputError(
            f"{source}: {len(pressures_Pa)} pressures for {len(pressed)} plateaus: give one for each, in order, without"
            f" those at zero. Plateaus: {in_words(plateaus)}"
        )
    levels, (fewest, _) = len(set(pressures_Pa)), GROUND.fewest
    if levels < fewest:
        raise InputError(f"{source}: {levels} pressures besides zero are too few; hold {fewest} at least, up to 400 Pa")
    remaining = iter(pressures_Pa)
    p = np.array([0.0 if plateau.open else next(remaining) for plateau in plateaus])
    readings = np.array([plateau.readings_Pa for plateau in plateaus])
    X = np.column_stack([np.ones(len(p)), p])
    coefficients, *_ = np.linalg.lstsq(X, readings, rcond=None)
    residuals = readings - X @ coefficients
    dof = len(p) - 2
    # Few residuals give their standard deviation poorly, so Student's distribution keeps the 95 % intervals correct.
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
        # Airspeed is proportional to the square root of its pressure.
        airspeed_scale=float(np.sqrt(speed.slope) - 1),
        airspeed_scale_error=speed.slope_error / speed.slope / 2,
    )
    return calibration, _why_not_supported(calibration)


def _why_not_supported(calibration: TransducerCalibration) -> str:
    """Return why the slopes are not known clearly better than a flight without calibration assumes, or empty text."""
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


EXAMPLE = '--pressures "10 20 30 40 mm" (a water column) or "100 200 300 400 Pa"'


@calibration(CalibrationFile, "transducers.json")
def transducers(
    log: LogFile,
    pressures: Annotated[
        str,
        typer.Option(
            "--pressures",
            metavar="LIST",
            help="Pressures held, in order, without those at zero, with their unit at the end: a unit of pressure, or"
            ' of length for the height of a water column (20 °C): "10 20 30 40 mm", "100 200 300 400 Pa".',
        ),
    ] = "",
    reference_error: Annotated[
        float,
        Quantity("--reference-error", "%", '"0.5%"', least=0, most=10).as_option(
            "Error of the reference's scale, 1 sigma, in %: 0.5 for a water column at 10 to 35 °C; for a manometer"
            " by its data sheet. The scatter of the readings gives their own errors."
        ),
    ] = 0.5,  # water density varies by -0.4 to 0.2 % between 10 and 35 degC, local gravity by up to 0.3 %
) -> Calibrated:
    """Measure slope and offset of the three differential transducers, by the same pressures on all of them.

    Join the positive ports of the three transducers (lower, right, center) by T-pieces to one tube: a water column on a
    ruler, or a syringe with a reference manometer. Leave the negative ports open, in still air. Start the daemon, leave
    the tube open for ten seconds, then hold pressures up and down for ten seconds each and write them down, eight or
    more, up to 80 % of the smallest range (400 Pa, 40 mm of water). Open the tube for ten seconds at the end.

    Run this command without --pressures first: it lists the plateaus found. Then give the pressures, in order.

    The file goes beside the tray file (`transducer_calibration`), which attaches it to every log; `analyze
    --transducers FILE` uses it for older ones. The error of the airspeed scale and that of the slope of angle of attack
    are then priors of the analysis. Exit code 1 and no file if airspeed stays uncertain by 1 % or a slope by 2.4 %
    (1 sigma); exit code 2 if the pressures are not those of the log.

    To rehearse it: `sim fly --plan transducer-column -o out/column`.

    \b
    Examples:
      calibrate transducers log.mcap
      calibrate transducers log.mcap --pressures "10 20 30 40 35 25 15 5 mm"
      calibrate transducers log.mcap --pressures "100 200 300 400 Pa" -o new.json
    """
    from flightpower.analysis.air.transducers import in_words, plateaus, readings
    from flightpower.flight.log_reader import read_log

    entered_Pa = pressures_Pa(pressures) if pressures.strip() else None
    steps = plateaus(readings(read_log(log)), str(log))
    if not any(not plateau.open for plateau in steps):
        raise InputError(f"{log}: no pressure was held for five seconds; begin with open tubes, hold each for ten")
    if entered_Pa is None:
        return Calibrated([f"plateaus: {in_words(steps)}. Now give {EXAMPLE}."])
    calibrated, unsupported = calibrate(steps, entered_Pa, reference_error / 100, log.name)
    return Calibrated(summary(calibrated), calibrated, unsupported=unsupported)


def pressures_Pa(text: str) -> list[float]:
    """Return nonzero pressures [Pa] from a list that ends with its unit. Raises InputError naming --pressures."""
    numbers, unit = numbers_and_unit(text, "--pressures", EXAMPLE)
    factor = _unit_Pa(unit, text)
    values = [factor * float(number) for number in numbers if number != "-"]
    highest = READABLE.possible["pitot_Pa"][1]
    if not all(abs(value) <= highest for value in values):
        raise InputError(f"--pressures {text!r}: not within {highest:g} Pa; give a list such as {EXAMPLE}")
    return [value for value in values if value]


def _unit_Pa(unit: str, text: str) -> float:
    water_kgpm3 = 998.2  # at 20 degC
    for base_unit, factor in (("Pa", 1.0), ("m", water_kgpm3 * GRAVITY_MPS2)):
        try:
            return factor * to_si(f"1 {unit}", base_unit, "")
        except InputError:
            continue
    raise InputError(f"--pressures {text!r}: {unit!r} is no unit of pressure or length; give a list such as {EXAMPLE}")


def summary(fit: "TransducerCalibration") -> list[str]:
    """Return the result as lines of text."""
    lines = [
        f"/probe/{name}: slope {line.slope:.4f} ± {NORMAL_95 * line.slope_error:.4f} (95 % interval), offset"
        f" {line.offset_Pa:+.1f} Pa, {line.largest_residual_Pa:.1f} Pa at most off the line"
        for name, line in (("alpha", fit.alpha), ("beta", fit.beta), ("airspeed", fit.airspeed))
    ]
    side = "high" if fit.airspeed_scale >= 0 else "low"
    half = NORMAL_95 * fit.airspeed_scale_error
    lines.append(
        f"airspeed reads {100 * abs(fit.airspeed_scale):.2f} ± {100 * half:.2f} % too {side} without this calibration"
    )
    return lines
