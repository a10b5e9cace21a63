"""Figures of endurance and range, and of the efficiencies of propeller and motor."""

import numpy as np

from analysis.report.figures.figure import Figure
from analysis.report.figures.style import (
    BLUE,
    INK,
    ORANGE,
    PALETTE,
    PAPER,
    SYMBOLS,
    add_band,
    add_curve,
    rounded,
    styled,
)
from analysis.results.schema import Interval, PerformanceResult, PowerPoint
from flight.units import GRAVITY_MPS2


def loadings(use: PerformanceResult) -> list[Figure]:
    """Longest endurance [min] and range [km] against mass, a line for each air density."""
    return [
        _against_mass(use, [case.endurance_s.times(1 / 60) for case in use.loadings], "endurance, min", "%{y:.0f} min"),
        _against_mass(use, [case.range_m.times(1e-3) for case in use.loadings], "range, km", "%{y:.1f} km"),
    ]


def _against_mass(use: PerformanceResult, values: list[Interval], title: str, hover: str) -> Figure:
    """values: of `use.loadings`, in their order."""
    figure = Figure()
    pairs = list(zip(use.loadings, values, strict=True))
    densities = sorted({round(case.air_density_kgpm3, 5) for case in use.loadings}, reverse=True)
    for i, rho in enumerate(densities):
        here = sorted((p for p in pairs if round(p[0].air_density_kgpm3, 5) == rho), key=lambda p: p[0].weight_N)
        as_flown = rho == round(use.loadings[0].air_density_kgpm3, 5)
        name = f"density altitude {here[0][0].density_altitude_m:.0f} m{' (as flown)' if as_flown else ''}"
        mass = np.array([case.weight_N / GRAVITY_MPS2 for case, _ in here])
        value, lo, hi = np.array([(v.value, v.lo, v.hi) for _, v in here]).T
        color = PALETTE[i % len(PALETTE)]
        if as_flown:
            add_band(figure, mass, lo, hi, color, 0.2)
        figure.add_scatter(
            x=rounded(mass), y=rounded(value), name=name, mode="lines+markers", hovertemplate=hover,
            line={"color": color, "width": 4, "dash": ("solid", "dash", "dot")[i % 3]},
            marker={"size": 11, "color": color, "symbol": SYMBOLS[i % len(SYMBOLS)]},
        )  # fmt: skip
    figure.update_xaxis(title="mass, kg")
    figure.update_yaxis(title=title)
    return styled(figure, 420)


def efficiency(use: PerformanceResult) -> Figure:
    """Efficiencies [%] of propeller, motor and both against speed in level flight, with the points measured."""
    figure = Figure()
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
    for trace in figure.data:
        if trace["mode"] == "lines":
            trace["hovertemplate"] = "%{y:.0f} %"
    figure.update_xaxis(title="true airspeed, m/s")
    figure.update_yaxis(title="efficiency, %", range=[0, 105])
    return styled(figure, 420)
