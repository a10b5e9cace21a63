"""The page of a probe calibration: how well the polynomials fit, where they hold, and whether speed matters.

C_alpha and C_beta are the pressure differences of the two pairs of ports over the indicated dynamic pressure q_c.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.airdata.probe import ProbeCalibration
from analysis.airdata.probe_calibration import SpeedDependence, TunnelData, dynamic_pressure, speed_dependence
from analysis.estimation.noise import NORMAL_95
from analysis.report.figures.style import BLUE, INK, PALETTE, RED, SYMBOLS, Figure, rounded, styled
from analysis.report.html_page import HtmlTable, html_figure, render_page
from flight.arrays import Array


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
        "residuals": residual_maps(tunnel, residuals),
        "sections": sections(tunnel, calibration),
        "speed": by_speed(dependence),
        "hull": valid_range(C_alpha, C_beta, calibration),
        "orders": polynomial_orders(calibration),
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


QUANTITIES = ("alpha, deg", "beta, deg", "q<sub>c</sub>/q, %")


def residual_maps(tunnel: TunnelData, residuals: tuple[Array, Array, Array]) -> list[Figure]:
    """Residuals of QUANTITIES over the two angles; the speeds of a setting are drawn side by side."""
    figures = []
    speeds = np.unique(np.round(tunnel.speed_mps, 1))
    aside = np.interp(tunnel.speed_mps, speeds, np.linspace(-0.9, 0.9, len(speeds))) if len(speeds) > 1 else 0.0
    for name, residual in zip(QUANTITIES, residuals, strict=True):
        figure = Figure()
        end = float(np.percentile(np.abs(residual), 99))  # of the color scale: outliers saturate
        figure.add_scatter(
            x=rounded(np.degrees(tunnel.alpha_rad) + aside), y=rounded(np.degrees(tunnel.beta_rad)), mode="markers",
            showlegend=False, name=name, customdata=rounded(residual), hovertemplate="%{customdata}<extra></extra>",
            marker={"size": 5, "color": rounded(residual), "colorscale": "RdBu", "cmin": -end, "cmax": end,
                    "colorbar": {"thickness": 10, "tickfont": {"size": 13}}},
        )  # fmt: skip
        figure.update_xaxis(title="alpha, deg")
        figure.update_yaxis(title="beta, deg")
        figures.append(styled(figure, 400, hover="closest"))
        figure.update_layout(margin={"l": 64, "r": 8, "t": 46, "b": 64}, title={"text": name, "font": {"size": 18}})
    return figures


def sections(tunnel: TunnelData, calibration: ProbeCalibration) -> list[Figure]:
    """C_alpha against alpha and C_beta against beta near zero of the other angle (the source's Figs 5.8, 5.9)."""
    figures = []
    speeds = np.round(tunnel.speed_mps).astype(int)
    for angle, other, dp, name in (
        (tunnel.alpha_rad, tunnel.beta_rad, tunnel.dp_alpha_Pa, "alpha"),
        (tunnel.beta_rad, tunnel.alpha_rad, tunnel.dp_beta_Pa, "beta"),
    ):
        figure = Figure()
        near = np.abs(other) <= np.radians(1)
        C = dp / tunnel.q_c_Pa
        for k, speed in enumerate(np.unique(speeds)):
            at_speed = near & (speeds == speed)
            marker = {"size": 7, "color": PALETTE[k % len(PALETTE)], "symbol": SYMBOLS[k % len(SYMBOLS)]}
            figure.add_scatter(
                x=rounded(np.degrees(angle[at_speed])), y=rounded(C[at_speed]), mode="markers", name=f"{speed} m/s",
                marker=marker,
            )  # fmt: skip
        if near.any():
            line = np.linspace(C[near].min(), C[near].max(), 80)
            zero = np.zeros_like(line)
            predicted = calibration.maps(line, zero)[0] if name == "alpha" else calibration.maps(zero, line)[1]
            figure.add_scatter(
                x=rounded(np.degrees(predicted)), y=rounded(line), mode="lines", name="calibration",
                line={"color": INK, "width": 1.5},
            )  # fmt: skip
        figure.update_xaxis(title=f"{name}, deg")
        figure.update_yaxis(title=f"C<sub>{name}</sub>")
        figures.append(styled(figure, 420, hover="closest"))
    return figures


def by_speed(dependence: SpeedDependence) -> list[Figure]:
    """Residual of alpha at each tunnel speed: error of the slope with its 95 % interval, and offset at zero."""
    V = np.array([at.speed_mps for at in dependence.speeds])
    offset = np.array([np.degrees(at.offset_rad) for at in dependence.speeds])
    slope = np.array([100 * at.slope for at in dependence.speeds])
    half_width = np.array([100 * NORMAL_95 * at.slope_error for at in dependence.speeds])
    bars = {"array": rounded(half_width), "thickness": 2, "color": BLUE} if len(V) else None
    figures = []
    for values, name, title, error in (
        (slope, "slope", "error of slope, %", bars),
        (offset, "offset", "offset of alpha, deg", None),
    ):
        figure = Figure()
        interval: dict[str, Any] = {"error_y": error} if error else {}
        figure.add_scatter(
            x=V, y=rounded(values), mode="markers", marker={"size": 10, "color": BLUE}, showlegend=False, name=name,
            **interval,
        )  # fmt: skip
        figure.add_zero_line({"color": INK, "width": 1})
        figure.update_yaxis(title=title)
        figure.update_xaxis(title="tunnel speed, m/s", rangemode="tozero")
        figures.append(styled(figure, 340, hover="closest"))
    return figures


def valid_range(C_alpha: Array, C_beta: Array, calibration: ProbeCalibration) -> Figure:
    """The measured points and the convex hull within which the calibration holds."""
    corners = np.array([*calibration.hull, calibration.hull[0]])
    figure = Figure()
    figure.add_scatter(x=rounded(C_alpha), y=rounded(C_beta), mode="markers", name="measured",
                       marker={"size": 5, "color": BLUE})  # fmt: skip
    figure.add_scatter(x=corners[:, 0], y=corners[:, 1], mode="lines", name="results outside this line are flagged",
                       line={"color": RED, "width": 2})  # fmt: skip
    figure.update_xaxis(title="C<sub>alpha</sub>", constrain="domain")
    figure.update_yaxis(title="C<sub>beta</sub>", scaleanchor="x")
    return styled(figure, 460, hover="closest")


def polynomial_orders(calibration: ProbeCalibration) -> Figure:
    """Cross-validation error of each polynomial order that was tried; a diamond marks the chosen one."""
    figure = Figure()
    surfaces = (calibration.alpha_rad, calibration.beta_rad, calibration.q_ratio)
    for name, surface, factor, color in zip(QUANTITIES, surfaces, (*np.degrees([1, 1]), 100.0), PALETTE, strict=False):
        tried = factor * np.array(surface.tried_rms)
        orders = np.arange(1, len(tried) + 1)
        figure.add_scatter(x=orders, y=rounded(tried), name=name, line={"color": color, "width": 2})
        figure.add_scatter(x=[surface.order], y=[tried[surface.order - 1]], mode="markers", showlegend=False,
                           name="chosen", marker={"size": 13, "color": color, "symbol": "diamond"})  # fmt: skip
    figure.update_xaxis(title="order of the polynomial (diamond: chosen)", dtick=1)
    figure.update_yaxis(title="error of left-out points, rms", type="log")
    return styled(figure, 380)
