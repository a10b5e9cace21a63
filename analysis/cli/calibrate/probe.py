"""`calibrate probe`"""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from analysis.cli.calibrate.runner import Calibrated, CalibrationFile, calibration
from flight.command_line import quantity
from flight.errors import InputError
from flight.files import check_new_file

if TYPE_CHECKING:
    from analysis.airdata.probe import ProbeCalibration


@calibration(CalibrationFile, "probe.json")
def probe(
    tunnel: Annotated[
        Path, typer.Argument(metavar="TUNNEL", help="CSV with a header such as `speed [m/s],alpha [deg],…`")
    ],
    output: Path,
    replace: bool,
    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="FILE", help="Report page to write; default: beside the calibration, .html"),
    ] = None,
    angle_scale: Annotated[
        float,
        typer.Option(
            "--angle-scale",
            parser=quantity("--angle-scale", "%", '"0.5 %"', least=0, most=20.0),
            metavar="PERCENT",
            help="Standard error of the tunnel's own angles, in percent.",
        ),
    ] = 0.5,
) -> Calibrated:
    """Calibrate a five-port probe from wind-tunnel measurements.

    The tunnel file has the columns speed, alpha, beta, dp_alpha (lower minus upper port), dp_beta (right minus left),
    q_c (center minus static), static and temperature, each with its unit in brackets. Measure at three speeds or more,
    so that a dependence on speed shows. Measure at angles beyond those that will be flown: the analysis leaves out
    results outside the measured range.

    The report page shows the residuals of the calibration, the effect of speed, and the range of validity. The file
    contains the standard error of the slope of alpha (alpha_scale_sigma). Errors of the turntable and of the tunnel
    walls are part of it; the measurements do not show them: give them by --angle-scale. Nothing is written if the
    points do not support a calibration: less than 90 % of the variance of alpha or beta is predicted at points left
    out, or the slope is uncertain by more than 10 % (1 sigma).

    To rehearse it: `sim tunnel -o tunnel.csv`.

    \b
    Example:
      calibrate probe tunnel.csv -o probe.json --angle-scale 1
    with tunnel.csv such as
      speed [m/s],alpha [deg],beta [deg],dp_alpha [Pa],dp_beta [Pa],q_c [Pa],
      static [hPa],temperature [degC]     (on one line; then a line a point)
    """
    from analysis.airdata.probe_calibration import calibrate, read_tunnel
    from analysis.report import calibration_page as page

    where = report or output.with_suffix(".html")
    if where == output:
        raise InputError(f"{where}: report and calibration cannot be the same file; name another with --report")
    check_new_file(where, replace=replace)
    measured = read_tunnel(tunnel)
    found = calibrate(measured, tunnel.name, angle_scale_sigma=angle_scale / 100)
    html = page.render(measured, found, angle_scale_sigma=angle_scale / 100)
    return Calibrated(summary(found), found, pages={where: html})


def summary(calibration: "ProbeCalibration") -> list[str]:
    """The result in lines."""
    lines = [f"{calibration.points} points, order of the polynomials by cross-validation:"]
    for name, fitted, scale, unit in (
        ("alpha", calibration.alpha_rad, math.degrees(1), "deg"),
        ("beta", calibration.beta_rad, math.degrees(1), "deg"),
        ("q_c/qbar", calibration.q_ratio, 100, "%"),
    ):
        rms = f"{fitted.residual_rms * scale:.3f} {unit}"
        lines.append(f"  {name:9} order {fitted.order}, error of left-out points {rms} weighted rms")
    return [*lines, f"standard error of the slope of alpha: {100 * calibration.alpha_scale_sigma:.2f} %"]
