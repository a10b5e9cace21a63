"""Figures of a probe calibration: residuals, sections, dependence on speed, validity, polynomial orders.

C_alpha and C_beta are the pressure differences of the two pairs of ports over the indicated dynamic pressure q_c.
"""

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from analysis.airdata.probe import ProbeCalibration
from analysis.airdata.speed_dependence import SpeedDependence
from analysis.airdata.tunnel import TunnelData
from analysis.report.figures.style import BLUE, INK, PALETTE, RED, Array, rounded, styled

DEG = float(np.degrees(1.0))
NEAR_ZERO_RAD = np.radians(1.0)  # of the other angle, for a section through the calibration
COLOR_RANGE_PERCENTILE = 99.0  # of the residuals, at the ends of the color scale
QUANTITIES = ("alpha, deg", "beta, deg", "q<sub>c</sub>/q, %")
COLOR_BAR_X = (0.265, 0.635, 1.005)


def residual_maps(tunnel: TunnelData, residuals: tuple[Array, Array, Array]) -> go.Figure:
    """Residuals of QUANTITIES over the two angles; the speeds of a setting are drawn side by side."""
    figure = make_subplots(rows=1, cols=3, subplot_titles=list(QUANTITIES), horizontal_spacing=0.11)
    speeds = np.unique(np.round(tunnel.speed_mps, 1))
    aside = np.interp(tunnel.speed_mps, speeds, np.linspace(-0.9, 0.9, len(speeds))) if len(speeds) > 1 else 0.0
    for i, (name, residual) in enumerate(zip(QUANTITIES, residuals, strict=True), start=1):
        end = float(np.percentile(np.abs(residual), COLOR_RANGE_PERCENTILE))
        figure.add_scatter(
            x=rounded(DEG * tunnel.alpha_rad + aside), y=rounded(DEG * tunnel.beta_rad), mode="markers",
            row=1, col=i, showlegend=False, name=name, customdata=rounded(residual),
            hovertemplate="%{customdata}<extra></extra>",
            marker={"size": 5, "color": rounded(residual), "colorscale": "RdBu", "cmin": -end, "cmax": end,
                    "colorbar": {"x": COLOR_BAR_X[i - 1], "thickness": 10, "tickfont": {"size": 13}}},
        )  # fmt: skip
        figure.update_xaxes(title="alpha, deg", row=1, col=i)
    figure.update_yaxes(title="beta, deg", row=1, col=1)
    figure = styled(figure, 400, hover="closest")
    figure.update_layout(margin={"t": 46})
    return figure


def sections(tunnel: TunnelData, calibration: ProbeCalibration) -> go.Figure:
    """C_alpha against alpha and C_beta against beta near zero of the other angle (the source's Figs 5.8, 5.9)."""
    figure = make_subplots(rows=1, cols=2, horizontal_spacing=0.12)
    speeds = np.round(tunnel.speed_mps).astype(int)
    for col, (angle, other, dp, name) in enumerate(
        (
            (tunnel.alpha_rad, tunnel.beta_rad, tunnel.dp_alpha_Pa, "alpha"),
            (tunnel.beta_rad, tunnel.alpha_rad, tunnel.dp_beta_Pa, "beta"),
        ),
        start=1,
    ):
        near = np.abs(other) <= NEAR_ZERO_RAD
        C = dp / tunnel.q_c_Pa
        for k, speed in enumerate(np.unique(speeds)):
            at_speed = near & (speeds == speed)
            figure.add_scatter(
                x=rounded(DEG * angle[at_speed]), y=rounded(C[at_speed]), mode="markers", row=1, col=col,
                name=f"{speed} m/s", showlegend=col == 1, marker={"size": 7, "color": PALETTE[k % len(PALETTE)]},
            )  # fmt: skip
        if near.any():
            line = np.linspace(C[near].min(), C[near].max(), 80)
            zero = np.zeros_like(line)
            predicted = calibration.maps(line, zero)[0] if name == "alpha" else calibration.maps(zero, line)[1]
            figure.add_scatter(
                x=rounded(DEG * predicted), y=rounded(line), mode="lines", row=1, col=col, name="calibration",
                showlegend=col == 1, line={"color": INK, "width": 1.5},
            )  # fmt: skip
        figure.update_xaxes(title=f"{name}, deg", row=1, col=col)
        figure.update_yaxes(title=f"C<sub>{name}</sub>", row=1, col=col)
    return styled(figure, 420, hover="closest")


def by_speed(dependence: SpeedDependence) -> go.Figure:
    """Residual of alpha at each tunnel speed: error of the slope with its 95 % interval, and offset at zero."""
    V = np.array([at.speed_mps for at in dependence.speeds])
    offset = np.array([DEG * at.offset_rad for at in dependence.speeds])
    slope = np.array([100 * at.slope for at in dependence.speeds])
    half_width = np.array([196 * at.slope_error for at in dependence.speeds])
    figure = make_subplots(rows=1, cols=2, horizontal_spacing=0.14)
    bars = {"array": rounded(half_width), "thickness": 2, "color": BLUE} if len(V) else None
    figure.add_scatter(x=V, y=rounded(slope), error_y=bars, mode="markers", row=1, col=1,
                       marker={"size": 10, "color": BLUE}, showlegend=False, name="slope")  # fmt: skip
    figure.add_scatter(x=V, y=rounded(offset), mode="markers", row=1, col=2,
                       marker={"size": 10, "color": BLUE}, showlegend=False, name="offset")  # fmt: skip
    figure.add_hline(y=0, line={"color": INK, "width": 1})
    figure.update_yaxes(title="error of slope, %", row=1, col=1)
    figure.update_yaxes(title="offset of alpha, deg", row=1, col=2)
    figure.update_xaxes(title="tunnel speed, m/s", rangemode="tozero")
    return styled(figure, 340, hover="closest")


def valid_range(C_alpha: Array, C_beta: Array, calibration: ProbeCalibration) -> go.Figure:
    """The measured points and the convex hull within which the calibration holds."""
    corners = np.array([*calibration.hull, calibration.hull[0]])
    figure = go.Figure()
    figure.add_scatter(x=rounded(C_alpha), y=rounded(C_beta), mode="markers", name="measured",
                       marker={"size": 5, "color": BLUE})  # fmt: skip
    figure.add_scatter(x=corners[:, 0], y=corners[:, 1], mode="lines", name="results outside this line are flagged",
                       line={"color": RED, "width": 2})  # fmt: skip
    figure.update_xaxes(title="C<sub>alpha</sub>", constrain="domain")
    figure.update_yaxes(title="C<sub>beta</sub>", scaleanchor="x")
    return styled(figure, 460, hover="closest")


def polynomial_orders(calibration: ProbeCalibration) -> go.Figure:
    """Cross-validation error of each polynomial order that was tried; a diamond marks the chosen one."""
    figure = go.Figure()
    surfaces = (calibration.alpha_rad, calibration.beta_rad, calibration.q_ratio)
    for name, surface, factor, color in zip(QUANTITIES, surfaces, (DEG, DEG, 100.0), PALETTE, strict=False):
        tried = factor * np.array(surface.tried_rms)
        orders = np.arange(1, len(tried) + 1)
        figure.add_scatter(x=orders, y=rounded(tried), name=name, line={"color": color, "width": 2})
        figure.add_scatter(x=[surface.order], y=[tried[surface.order - 1]], mode="markers", showlegend=False,
                           name="chosen", marker={"size": 13, "color": color, "symbol": "diamond"})  # fmt: skip
    figure.update_xaxes(title="order of the polynomial (diamond: chosen)", dtick=1)
    figure.update_yaxes(title="error of left-out points, rms", type="log")
    return styled(figure, 380)
