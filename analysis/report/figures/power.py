"""Figures of the power-required curve, of its interval, and of the drag polar."""

import numpy as np

from analysis.drag.polar import Polar
from analysis.estimation.intervals import NORMAL_95
from analysis.report.figures.figure import Figure
from analysis.report.figures.measured_points import add_measured_points
from analysis.report.figures.style import (
    BLUE,
    GREEN,
    INK,
    ORANGE,
    PAPER,
    RED,
    Array,
    add_band,
    add_curve,
    curve_arrays,
    rounded,
    styled,
    translucent,
)
from analysis.results.schema import Results, SpeedInterval

POLAR_POINTS = 60


def power_required(results: Results) -> Figure:
    """Power required against speed with its 95 % interval, steady points, and power available at full throttle."""
    figure = Figure()
    V, P, lo, hi = curve_arrays(results.power_required)
    add_band(figure, V, lo, hi, BLUE, 0.3)
    add_curve(figure, results.power_required, "power required", BLUE, 5)
    with_points = [method for method in results.methods if method.points]
    if with_points:
        add_measured_points(figure, with_points[0], ORANGE, "steady points")
    _add_continuation(figure, results, float(V[-1]))
    top = float(np.max(hi)) * 1.12
    if results.use and results.use.available.power_available:
        available = results.use.available.power_available
        add_curve(figure, available, "available at full throttle", INK, 3)
        top = max(top, min(float(np.max(curve_arrays(available)[1])) * 1.06, 2.2 * top))
    _add_speed(figure, results.minimum_power_speed, "least power", GREEN, "circle", V, P)
    _add_speed(figure, results.best_range_speed, "least drag", RED, "diamond", V, P)
    figure.update_xaxis(title="true airspeed, m/s")
    figure.update_yaxis(title="power, W", range=[0, top])
    return styled(figure, 400)


def _add_continuation(figure: Figure, results: Results, fastest: float) -> None:
    """The curve from the fastest speed flown up to the highest level speed, dashed. There is none below the slowest."""
    top = results.use.available.maximum_speed_mps if results.use else None
    polar, at, S = results.drag_polar, results.test, results.aircraft.wing_area_m2
    if polar is None or top is None or top.value <= fastest:
        return
    V = np.linspace(fastest, top.value, 15)
    q = at.air_density_kgpm3 * V**2 / 2
    CL = at.weight_N / (q * S)
    power = q * S * V * (polar.A0 + polar.A1 * CL + polar.A2 * CL**2)
    figure.add_scatter(
        x=rounded(V), y=rounded(power), mode="lines", line={"color": BLUE, "width": 3, "dash": "dash"},
        showlegend=False, hovertemplate="%{y:.1f} W, not flown", name="power required",
    )  # fmt: skip


def _add_speed(figure: Figure, optimum: SpeedInterval, name: str, color: str, symbol: str, V: Array, P: Array) -> None:
    """A mark on the curve (V, P) at an optimum speed inside the speeds flown, with the interval of that speed."""
    speed = optimum.speed_mps
    if speed is None or not optimum.inside_flown_range:
        return
    figure.add_scatter(
        x=[speed],
        y=[float(np.interp(speed, V, P))],
        error_x={
            "symmetric": False,
            "array": [(optimum.hi_mps or speed) - speed],
            "arrayminus": [speed - (optimum.lo_mps or min(V[0], speed))],
            "thickness": 3,
            "width": 7,
        },
        mode="markers",
        name=name,
        marker={"color": color, "size": 15, "symbol": symbol, "line": {"color": PAPER, "width": 2}},
        hovertemplate="%{x:.1f} m/s",
    )


def interval_parts(results: Results) -> Figure:
    """Half width of the 95 % interval against speed: its noise part and the part that all runs share."""
    V, noise, systematic = np.array([(p.speed_mps, p.noise_W, p.systematic_W) for p in results.interval_parts]).T
    power = np.interp(V, *curve_arrays(results.power_required)[:2])
    figure = Figure()
    for half_width, name, color, width, dash in (
        (np.hypot(noise, systematic), "whole interval", INK, 4, "solid"),
        (systematic, "shared by all runs", ORANGE, 3, "dash"),
        (noise, "noise", BLUE, 3, "dot"),
    ):
        figure.add_scatter(
            x=rounded(V), y=rounded(100 * half_width / power), mode="lines", name=name,
            line={"color": color, "width": width, "dash": dash}, hovertemplate="±%{y:.1f} %",
        )  # fmt: skip
    figure.update_xaxis(title="true airspeed, m/s")
    figure.update_yaxis(title="± % of power", rangemode="tozero")
    return styled(figure, 360)


def drag_polar(polar: Polar, flown_CL: tuple[float, float]) -> Figure:
    """The drag polar over the flown lift coefficients, with its 95 % interval."""
    CL = np.linspace(*flown_CL, POLAR_POINTS)
    powers = np.stack([np.ones_like(CL), CL, CL**2], axis=1)
    CD = powers @ polar.A
    half_width = NORMAL_95 * np.sqrt(np.einsum("ni,ij,nj->n", powers, polar.covariance, powers))
    figure = Figure()
    figure.add_scatter(
        x=rounded(np.r_[CD - half_width, (CD + half_width)[::-1]]),
        y=rounded(np.r_[CL, CL[::-1]]),
        fill="toself",
        fillcolor=translucent(BLUE, 0.25),
        line={"width": 0},
        name="95 % interval",
        hoverinfo="skip",
    )
    figure.add_scatter(x=rounded(CD), y=rounded(CL), line={"color": BLUE, "width": 4}, name="drag polar")
    figure.update_xaxis(title="drag coefficient", rangemode="tozero")
    figure.update_yaxis(title="lift coefficient", rangemode="tozero")
    return styled(figure, 420, hover="closest")
