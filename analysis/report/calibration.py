"""The page of a probe calibration: how well the polynomials fit, where they hold, and whether speed matters."""

from collections.abc import Sequence

import numpy as np

from analysis.airdata.probe import ProbeCalibration
from analysis.airdata.probe_calibration import SpeedDependence, TunnelData, dynamic_pressure, speed_dependence
from analysis.report.figures import probe_calibration as figures
from analysis.report.figures.style import Array, Figure
from analysis.report.html_page import HtmlTable, html_figure, render_page


def render(tunnel: TunnelData, calibration: ProbeCalibration, *, angle_scale_sigma: float) -> str:
    """The page as one HTML file. angle_scale_sigma: relative standard error of the angles of the tunnel itself."""
    C_alpha, C_beta = tunnel.dp_alpha_Pa / tunnel.q_c_Pa, tunnel.dp_beta_Pa / tunnel.q_c_Pa
    ratio = tunnel.q_c_Pa / dynamic_pressure(tunnel)
    alpha, beta, predicted_ratio = calibration.maps(C_alpha, C_beta)
    alpha_error_rad = alpha - tunnel.alpha_rad
    residuals = (
        np.degrees(alpha_error_rad),
        np.degrees(beta - tunnel.beta_rad),
        100 * (predicted_ratio / ratio - 1),
    )
    dependence = speed_dependence(tunnel, alpha_error_rad, tunnel.alpha_rad)
    drawn: dict[str, Figure | Sequence[Figure]] = {
        "residuals": figures.residual_maps(tunnel, residuals),
        "sections": figures.sections(tunnel, calibration),
        "speed": figures.by_speed(dependence),
        "hull": figures.valid_range(C_alpha, C_beta, calibration),
        "orders": figures.polynomial_orders(calibration),
    }
    return render_page(
        "probe_calibration.html",
        source=f"{calibration.source}, {calibration.points} points",
        slope_percent=f"{100 * calibration.alpha_scale_sigma:.2f}",
        slope_parts=slope_parts(calibration, dependence, angle_scale_sigma),
        quality=_quality(calibration, residuals),
        speed_effect=speed_effect(dependence),
        validity=validity(calibration),
        figures={name: html_figure(figure, name) for name, figure in drawn.items()},
    )


def slope_parts(calibration: ProbeCalibration, dependence: SpeedDependence, angle_scale_sigma: float) -> str:
    """What the error of the slope of alpha consists of; the parts add as squares."""
    parts = [f"angles of the tunnel {100 * angle_scale_sigma:.2f} %"] if angle_scale_sigma else []
    parts += [f"speed {100 * dependence.spread:.2f} %"] if dependence.significant else []
    rest = calibration.alpha_scale_sigma**2 - angle_scale_sigma**2 - dependence.spread**2
    parts.append(f"noise and fit of the polynomial {100 * np.sqrt(max(rest, 0.0)):.2f} %")
    return ", ".join(parts)


def _quality(calibration: ProbeCalibration, residuals: tuple[Array, Array, Array]) -> HtmlTable:
    surfaces = (calibration.alpha_rad, calibration.beta_rad, calibration.q_ratio)
    quantities = (("alpha", "deg", np.degrees(1.0)), ("beta", "deg", np.degrees(1.0)), ("q_c/q", "%", 100.0))
    rows = [
        (
            name,
            f"{surface.order}",
            f"{factor * surface.residual_rms:.3f} {unit}",
            f"{np.sqrt(np.mean(residual**2)):.3f} {unit}",
            f"{np.max(np.abs(residual)):.3f} {unit}",
        )
        for (name, unit, factor), surface, residual in zip(quantities, surfaces, residuals, strict=True)
    ]
    header = ("quantity", "polynomial order", "error of left-out points, rms", "residual, rms", "largest residual")
    return HtmlTable(header, rows, numbers=True)


def speed_effect(dependence: SpeedDependence) -> str:
    """Whether the slope of alpha depends on tunnel speed, in a sentence."""
    if len(dependence.speeds) < 2:
        return (
            "Measured at one speed only, so that a dependence on speed cannot be seen. Measure at three speeds or more."
        )
    if not dependence.significant:
        return "The slope is the same at all speeds within its noise: one calibration for all of them."
    return (
        f"The slope differs between speeds by {100 * dependence.spread:.1f} %, more than noise explains. Suspect"
        " Reynolds-number effects, a leak, or a wrong tunnel speed. The error of the slope above includes this."
    )


def validity(calibration: ProbeCalibration) -> str:
    """Where the calibration holds, in a sentence."""
    within = [
        f"{name} from {np.degrees(limits[0]):.0f} to {np.degrees(limits[1]):.0f} deg"
        for name, limits in (("alpha", calibration.alpha_limits_rad), ("beta", calibration.beta_limits_rad))
        if limits is not None
    ]
    angles = f", for {' and '.join(within)}" if within else ""
    return f"The calibration holds inside the line{angles}."
