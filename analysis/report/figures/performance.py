"""Figures of endurance and range, and of the efficiencies of propeller and motor."""

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from analysis.report.figures.style import (
    BLUE,
    INK,
    ORANGE,
    PALETTE,
    PAPER,
    add_band,
    add_curve,
    rounded,
    styled,
)
from analysis.results.schema import PerformanceResult, PowerPoint
from flight.units import GRAVITY_MPS2


def loadings(use: PerformanceResult) -> go.Figure:
    """Longest endurance [min] and range [km] against mass, a line for each air density."""
    figure = make_subplots(rows=1, cols=2, horizontal_spacing=0.12)
    densities = sorted({round(case.air_density_kgpm3, 5) for case in use.loadings}, reverse=True)
    for i, rho in enumerate(densities):
        cases = sorted((c for c in use.loadings if round(c.air_density_kgpm3, 5) == rho), key=lambda c: c.weight_N)
        as_flown = rho == round(use.loadings[0].air_density_kgpm3, 5)
        name = f"density altitude {cases[0].density_altitude_m:.0f} m{' (as flown)' if as_flown else ''}"
        mass = np.array([case.weight_N / GRAVITY_MPS2 for case in cases])
        for column, intervals, hover in (
            (1, [case.endurance_s.times(1 / 60) for case in cases], "%{y:.0f} min"),
            (2, [case.range_m.times(1e-3) for case in cases], "%{y:.1f} km"),
        ):
            value, lo, hi = np.array([(v.value, v.lo, v.hi) for v in intervals]).T
            color = PALETTE[i % len(PALETTE)]
            if as_flown:
                add_band(figure, mass, lo, hi, color, 0.2, row=1, col=column)
            figure.add_scatter(
                x=mass, y=rounded(value), row=1, col=column, name=name, legendgroup=name, showlegend=column == 1,
                mode="lines+markers", line={"color": color, "width": 4, "dash": ("solid", "dash", "dot")[i % 3]},
                marker={"size": 11}, hovertemplate=hover,
            )  # fmt: skip
    figure.update_xaxes(title="mass, kg")
    figure.update_yaxes(title="endurance, min", col=1)
    figure.update_yaxes(title="range, km", col=2)
    return styled(figure, 420)


def efficiency(use: PerformanceResult) -> go.Figure:
    """Efficiencies [%] of propeller, motor and both against speed in level flight, with the points measured."""
    figure = go.Figure()
    points, measured = use.power_train.efficiency, use.power_train.points
    V = np.array([p.speed_mps for p in points])
    for name, title, color in (
        ("propeller", "propeller", BLUE),
        ("motor", "motor and controller", ORANGE),
        ("overall", "overall", INK),
    ):
        value, lo, hi = 100 * np.array([(i.value, i.lo, i.hi) for i in (getattr(p, name) for p in points)]).T
        curve = [
            PowerPoint(speed_mps=v, power_W=p, power_lo_W=p, power_hi_W=p, extrapolated=point.extrapolated)
            for v, p, point in zip(V.tolist(), value.tolist(), points, strict=True)
        ]
        add_band(figure, V, lo, hi, color, 0.18)
        add_curve(figure, curve, title, color, 4)
        if measured:
            figure.add_scatter(
                x=rounded(np.array([p.speed_mps for p in measured])),
                y=rounded(100 * np.array([getattr(p, name) for p in measured])),
                mode="markers",
                marker={"size": 8, "color": PAPER, "line": {"color": color, "width": 2}},
                showlegend=False,
                hoverinfo="skip",
            )
    figure.update_traces(hovertemplate="%{y:.0f} %", selector={"mode": "lines"})
    figure.update_xaxes(title="true airspeed, m/s")
    figure.update_yaxes(title="efficiency, %", range=[0, 105])
    return styled(figure, 420)
