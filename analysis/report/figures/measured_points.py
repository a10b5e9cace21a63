"""Points measured in steady flight, as power and methods figures show them."""

import numpy as np

from analysis.report.figures.figure import Figure
from analysis.report.figures.style import PAPER, rounded
from analysis.results.schema import MethodResult


def add_measured_points(figure: Figure, method: MethodResult, color: str, name: str, *, in_legend: bool = True) -> None:
    """The points of a method with their 95 % intervals."""
    power = np.array([p.power_W for p in method.points])
    lo = np.array([p.power_W if p.power_lo_W is None else p.power_lo_W for p in method.points])
    hi = np.array([p.power_W if p.power_hi_W is None else p.power_hi_W for p in method.points])
    figure.add_scatter(
        x=rounded(np.array([p.speed_mps for p in method.points])),
        y=rounded(power),
        error_y={"symmetric": False, "array": rounded(hi - power), "arrayminus": rounded(power - lo), "thickness": 2},
        mode="markers",
        marker={"color": PAPER, "size": 10, "line": {"color": color, "width": 3}},
        name=name,
        legendgroup=name,
        showlegend=in_legend,
        hovertemplate="%{y:.1f} W",
    )
