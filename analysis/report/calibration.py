"""The page of a probe's calibration: how well the maps fit, where they hold, and whether speed matters."""

import html

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from analysis.airdata.probe import ProbeCalibration
from analysis.airdata.speed_dependence import SpeedDependence, speed_dependence
from analysis.airdata.tunnel import TunnelData, dynamic_pressure
from analysis.report.figures import BLUE, INK, PALETTE, RED, _rounded, _styled
from analysis.report.page import _embedded, _table, filled

Array = NDArray[np.float64]
DEG = float(np.degrees(1.0))
NEAR_ZERO_RAD = np.radians(1.0)  # of the other angle, for a section through the calibration
SHOWN_PERCENTILE = 99.0  # of residuals, at the ends of the colours


def render(tunnel: TunnelData, calibration: ProbeCalibration, *, angle_scale_sigma: float) -> str:
    """One HTML file that opens anywhere without a network."""
    C_alpha, C_beta = tunnel.dp_alpha_Pa / tunnel.q_c_Pa, tunnel.dp_beta_Pa / tunnel.q_c_Pa
    ratio = tunnel.q_c_Pa / dynamic_pressure(tunnel)
    alpha, beta, told = calibration.maps(C_alpha, C_beta)
    residuals = {
        "alpha, deg": DEG * (alpha - tunnel.alpha_rad),
        "beta, deg": DEG * (beta - tunnel.beta_rad),
        "q<sub>c</sub>/q, %": 100 * (told / ratio - 1),
    }
    speeds = speed_dependence(tunnel, residuals["alpha, deg"] / DEG, tunnel.alpha_rad)
    return filled(
        "calibration.html",
        title="Probe calibration",
        source=html.escape(f"{calibration.source}, {calibration.points} points"),
        answer=_answer(calibration, speeds, angle_scale_sigma),
        quality=_quality(calibration, residuals),
        residuals=_embedded(_maps(tunnel, residuals), "residuals"),
        sections=_embedded(_sections(tunnel, calibration), "sections"),
        speed=_embedded(_by_speed(speeds), "speed"),
        speed_in_words=_speed_in_words(speeds),
        limits=_limits(calibration),
        hull=_embedded(_hull(C_alpha, C_beta, calibration), "hull"),
        orders=_embedded(_orders(calibration), "orders"),
    )


def _answer(calibration: ProbeCalibration, speeds: SpeedDependence, angle_scale_sigma: float) -> str:
    parts = [f"the tunnel's own angles {100 * angle_scale_sigma:.2f} %"] if angle_scale_sigma else []
    parts += [f"speed {100 * speeds.spread:.2f} %"] if speeds.significant else []
    own = np.sqrt(max(calibration.alpha_scale_sigma**2 - angle_scale_sigma**2 - speeds.spread**2, 0.0))
    parts.append(f"noise and form of the map {100 * own:.2f} %")
    return (
        f"The slope of the angle of attack is known to <b>{100 * calibration.alpha_scale_sigma:.2f} %</b> (1 sigma: "
        + ", ".join(parts)
        + "). It travels in the probe file, for the analysis to allow for."
    )


def _quality(calibration: ProbeCalibration, residuals: dict[str, Array]) -> str:
    maps = (calibration.alpha_rad, calibration.beta_rad, calibration.q_ratio)
    rows = []
    for (name, residual), surface, unit in zip(residuals.items(), maps, ("deg", "deg", "%"), strict=True):
        scale = DEG if unit == "deg" else 100.0
        rows.append(
            (
                name.partition(",")[0].replace("<sub>", "").replace("</sub>", ""),
                f"{surface.order}",
                f"{scale * surface.residual_rms:.3f} {unit}",
                f"{np.sqrt(np.mean(residual**2)):.3f} {unit}",
                f"{np.max(np.abs(residual)):.3f} {unit}",
            )
        )
    return _table(("map", "order", "predicts left-out points to", "residual, rms", "largest"), rows, numbers=True)


def _maps(tunnel: TunnelData, residuals: dict[str, Array]) -> go.Figure:
    """Residuals over the two angles; points of several speeds stand side by side."""
    figure = make_subplots(rows=1, cols=3, subplot_titles=list(residuals), horizontal_spacing=0.11)
    speeds = np.unique(np.round(tunnel.speed_mps, 1))
    aside = np.interp(tunnel.speed_mps, speeds, np.linspace(-0.9, 0.9, len(speeds))) if len(speeds) > 1 else 0.0
    for i, (name, residual) in enumerate(residuals.items(), start=1):
        end = float(np.percentile(np.abs(residual), SHOWN_PERCENTILE))
        figure.add_scatter(
            x=_rounded(DEG * tunnel.alpha_rad + aside), y=_rounded(DEG * tunnel.beta_rad), mode="markers",
            row=1, col=i, showlegend=False, name=name, customdata=_rounded(residual),
            hovertemplate="%{customdata}<extra></extra>",
            marker={"size": 5, "color": _rounded(residual), "colorscale": "RdBu", "cmin": -end, "cmax": end,
                    "colorbar": {"x": [0.265, 0.635, 1.005][i - 1], "thickness": 10, "tickfont": {"size": 13}}},
        )  # fmt: skip
        figure.update_xaxes(title="alpha, deg", row=1, col=i)
    figure.update_yaxes(title="beta, deg", row=1, col=1)
    figure = _styled(figure, 400, hover="closest")
    figure.update_layout(margin={"t": 46})
    return figure


def _sections(tunnel: TunnelData, calibration: ProbeCalibration) -> go.Figure:
    """C_alpha over alpha and C_beta over beta, a colour a speed, and what the maps say: the source's Figs 5.8, 5.9."""
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
            mine = near & (speeds == speed)
            figure.add_scatter(
                x=_rounded(DEG * angle[mine]), y=_rounded(C[mine]), mode="markers", row=1, col=col,
                name=f"{speed} m/s", showlegend=col == 1, marker={"size": 7, "color": PALETTE[k % len(PALETTE)]},
            )  # fmt: skip
        if near.any():
            line = np.linspace(C[near].min(), C[near].max(), 80)
            zero = np.zeros_like(line)
            told = calibration.maps(line, zero)[0] if name == "alpha" else calibration.maps(zero, line)[1]
            figure.add_scatter(
                x=_rounded(DEG * told), y=_rounded(line), mode="lines", row=1, col=col, name="calibration",
                showlegend=col == 1, line={"color": INK, "width": 1.5},
            )  # fmt: skip
        figure.update_xaxes(title=f"{name}, deg", row=1, col=col)
        figure.update_yaxes(title=f"C<sub>{name}</sub>", row=1, col=col)
    return _styled(figure, 420, hover="closest")


def _by_speed(speeds: SpeedDependence) -> go.Figure:
    """What is left of alpha at each speed: at zero angle, and in the slope."""
    V = np.array([at.speed_mps for at in speeds.speeds])
    offset = np.array([DEG * at.offset_rad for at in speeds.speeds])
    slope = np.array([100 * at.slope for at in speeds.speeds])
    error = np.array([196 * at.slope_error for at in speeds.speeds])
    figure = make_subplots(rows=1, cols=2, horizontal_spacing=0.14)
    bars = {"array": _rounded(error), "thickness": 2, "color": BLUE} if len(error) else None
    figure.add_scatter(x=V, y=_rounded(slope) if len(V) else slope, error_y=bars, mode="markers", row=1, col=1,
                       marker={"size": 10, "color": BLUE}, showlegend=False, name="slope")  # fmt: skip
    figure.add_scatter(x=V, y=_rounded(offset) if len(V) else offset, mode="markers", row=1, col=2,
                       marker={"size": 10, "color": BLUE}, showlegend=False, name="offset")  # fmt: skip
    figure.add_hline(y=0, line={"color": INK, "width": 1})
    figure.update_yaxes(title="slope of alpha, % off", row=1, col=1)
    figure.update_yaxes(title="alpha at zero, deg off", row=1, col=2)
    figure.update_xaxes(title="tunnel speed, m/s", rangemode="tozero")
    return _styled(figure, 340, hover="closest")


def _speed_in_words(speeds: SpeedDependence) -> str:
    if len(speeds.speeds) < 2:
        return "Measured at one speed only: whether the calibration depends on speed cannot be said. Measure at three."
    if not speeds.significant:
        return "The slope is the same at all speeds within its noise: one calibration for all of them."
    return (
        f"The slope differs from speed to speed by {100 * speeds.spread:.1f} %, more than noise explains: look"
        " for Reynolds-number effects, a leak, or a tunnel that is not as fast as it says. Part of the error above."
    )


def _limits(calibration: ProbeCalibration) -> str:
    within = [
        f"{name} from {DEG * limits[0]:.0f} to {DEG * limits[1]:.0f} deg"
        for name, limits in (("alpha", calibration.alpha_limits_rad), ("beta", calibration.beta_limits_rad))
        if limits is not None
    ]
    return "Inside the line" + (f", and for {' and '.join(within)}." if within else ".")


def _hull(C_alpha: Array, C_beta: Array, calibration: ProbeCalibration) -> go.Figure:
    corners = np.array([*calibration.hull, calibration.hull[0]])
    figure = go.Figure()
    figure.add_scatter(x=_rounded(C_alpha), y=_rounded(C_beta), mode="markers", name="measured",
                       marker={"size": 5, "color": BLUE})  # fmt: skip
    figure.add_scatter(x=corners[:, 0], y=corners[:, 1], mode="lines", name="beyond this line results are flagged",
                       line={"color": RED, "width": 2})  # fmt: skip
    figure.update_xaxes(title="C<sub>alpha</sub>", constrain="domain")
    figure.update_yaxes(title="C<sub>beta</sub>", scaleanchor="x")
    return _styled(figure, 460, hover="closest")


def _orders(calibration: ProbeCalibration) -> go.Figure:
    figure = go.Figure()
    for (name, surface, scale), colour in zip(
        (
            ("alpha, deg", calibration.alpha_rad, DEG),
            ("beta, deg", calibration.beta_rad, DEG),
            ("q<sub>c</sub>/q, %", calibration.q_ratio, 100.0),
        ),
        PALETTE,
        strict=False,
    ):
        tried = scale * np.array(surface.tried_rms)
        orders = np.arange(1, len(tried) + 1)
        figure.add_scatter(x=orders, y=_rounded(tried), name=name, line={"color": colour, "width": 2})
        figure.add_scatter(x=[surface.order], y=[tried[surface.order - 1]], mode="markers", showlegend=False,
                           name="chosen", marker={"size": 13, "color": colour, "symbol": "diamond"})  # fmt: skip
    figure.update_xaxes(title="order of the polynomial (diamond: chosen)", dtick=1)
    figure.update_yaxes(title="error of left-out points, rms", type="log")
    return _styled(figure, 380)
