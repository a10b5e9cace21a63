"""Figures over airspeed: power required by all methods, its interval, drag polar, endurance, range, efficiencies."""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.curve import Polar
from analysis.estimation.noise import NORMAL_95
from analysis.maneuvers.kinds import LEVEL_RUNS
from analysis.methods.interval_sources import Source
from analysis.pages.charts.style import (
    ALL_RUNS,
    BLUE,
    GRAY,
    GREEN,
    INK,
    ORANGE,
    OTHER_RUN,
    PALETTE,
    PAPER,
    RED,
    RUN_COLOR,
    SYMBOLS,
    Figure,
    add_band,
    add_curve,
    curve_arrays,
    rounded,
    styled,
    translucent,
)
from analysis.pages.predicted_polar import PredictedPolar, flown_at
from analysis.pages.wording import capitalized_title, listed_methods
from analysis.records.flight import Interval, MethodResult, PerformanceResult, PowerPoint, Results, SpeedInterval
from flight.arrays import Array
from flight.units import GRAVITY_MPS2


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


REQUIRED = "power required"  # entry of the legend that shows and hides curve, interval and continuation


PREDICTED = {"color": OTHER_RUN, "width": 4, "dash": "dot"}


def power_required(results: Results, predicted: PredictedPolar | None = None) -> Figure:
    """Power required against speed with its 95 % interval, steady points, and power available at full throttle."""
    figure = Figure()
    V, P, lo, hi = curve_arrays(results.power_required)
    add_band(figure, V, (lo, hi), BLUE, 0.3, legendgroup=REQUIRED)
    add_curve(figure, results.power_required, REQUIRED, BLUE, width=5)
    with_points = [method for method in results.methods if method.points]
    if with_points:
        add_measured_points(figure, with_points[0], ORANGE, "steady points")
    _add_continuation(figure, results, float(V[-1]))
    top = float(np.max(hi)) * 1.12
    if results.use and results.use.available.power_available:
        available = results.use.available.power_available
        add_curve(figure, available, "available at full throttle", INK, width=3)
        top = max(top, min(float(np.max(curve_arrays(available)[1])) * 1.06, 2.2 * top))
    if predicted:
        wider = np.linspace(0.9 * V[0], 1.1 * V[-1], 60)
        figure.add_scatter(
            x=rounded(wider), y=rounded(predicted.power_W(wider, flown_at(results))), mode="lines",
            name=f"predicted, {predicted.name}", line=PREDICTED, hovertemplate="%{y:.1f} W",
        )  # fmt: skip
    _add_speed(figure, (V, P), results.minimum_power_speed, {"color": GREEN, "symbol": "circle"}, "least power")
    _add_speed(figure, (V, P), results.best_range_speed, {"color": RED, "symbol": "diamond"}, "least drag")
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
        showlegend=False, hovertemplate="%{y:.1f} W, not flown", name=REQUIRED, legendgroup=REQUIRED,
    )  # fmt: skip


def _add_speed(
    figure: Figure, curve: tuple[Array, Array], optimum: SpeedInterval, marker: dict[str, str], name: str
) -> None:
    """A mark on the curve (V, P) at an optimum speed inside the speeds flown, with the interval of that speed."""
    V, P = curve
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
        marker={**marker, "size": 15, "line": {"color": PAPER, "width": 2}},
        hovertemplate="%{x:.1f} m/s",
    )


SOURCE_COLOR = {
    Source.NOISE: GRAY, Source.AIRSPEED: BLUE, Source.ANGLE_OF_ATTACK: ORANGE, Source.ACCELEROMETER: "#6b4e00",
    Source.PROPELLER: OTHER_RUN, Source.WEIGHT: "#00735c", Source.DENSITY: "#0087b3", Source.UPDRAFT: "#5a7d00",
    Source.TRANSDUCERS: "#a3123f", Source.AIRCRAFT_FILE: "#b58900", Source.POLAR_SHAPE: "#5a3fc0",
    Source.OTHER_SENSORS: "#2f5d8c", Source.SHARED: ORANGE,
}  # fmt: skip


def interval_by_source(curve: Sequence[PowerPoint], V: Array, variances: Mapping[Source, Array]) -> Figure:
    """A bar at each of the speeds V (n,), as high as half the 95 % interval in percent of power; each source has the
    part of the bar that it has of the variance (n,)."""
    power = np.interp(V, *curve_arrays(curve)[:2])
    total = np.sum(list(variances.values()), axis=0)
    half_percent = 100 * NORMAL_95 * np.sqrt(total) / power
    figure = Figure()
    width = 0.72 * float(np.min(np.diff(V), initial=np.ptp(V) or 1.0))
    for source, variance in variances.items():
        share = variance / total
        if np.max(share) < 0.005:  # thinner than a pixel
            continue
        figure.add_bars(
            x=rounded(V), y=rounded(half_percent * share), name=source, width=width,
            marker={"color": SOURCE_COLOR[source]}, customdata=np.round(100 * share),
            hovertemplate="%{customdata} % of the variance",
        )  # fmt: skip
    figure.update_layout(barmode="stack")
    figure.update_xaxis(title="true airspeed, m/s", tickvals=rounded(V), tickformat=".1f")
    figure.update_yaxis(title="± % of power")
    return styled(figure, 400 + 18 * len(variances))


def drag_polar(polar: Polar, flown_CL: tuple[float, float], predicted: PredictedPolar | None = None) -> Figure:
    """The drag polar over the flown lift coefficients, with its 95 % interval."""
    CL = np.linspace(*flown_CL, 60)
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
    if predicted:
        near = (predicted.CL > 0) & (predicted.CL < 1.2 * flown_CL[1])
        figure.add_scatter(
            x=rounded(predicted.CD[near]), y=rounded(predicted.CL[near]), line=PREDICTED, mode="lines",
            name=f"predicted, {predicted.name}",
        )  # fmt: skip
    figure.update_xaxis(title="drag coefficient", rangemode="tozero")
    figure.update_yaxis(title="lift coefficient", rangemode="tozero")
    return styled(figure, 420, hover="closest")


def every_method(results: Results, shown_first: int = 2) -> Figure:
    """The curve of every method; bars are its 95 % interval, circles the points it measured.

    The legend has all; the curve and its cross-check, `shown_first`, are drawn until the reader asks for others.
    """
    figure = Figure()
    drawn = [method for method in listed_methods(results) if method.power_required]
    V, _, lo, hi = curve_arrays(results.power_required)
    add_band(figure, V, (lo, hi), PALETTE[0], 0.25, legendgroup=capitalized_title(drawn[0]))
    for i, method in reversed(list(enumerate(drawn))):  # the first one on top
        color, title = PALETTE[i % len(PALETTE)], capitalized_title(method)
        symbol = "" if i == 0 else SYMBOLS[i % len(SYMBOLS)]
        add_curve(figure, method.power_required, title, color, width=5 if i == 0 else 2.5, symbol=symbol)
        if i > 0:
            _add_interval_bars(figure, method, color, (i - 0.5) / len(drawn))
        if method.points:
            add_measured_points(figure, method, color, title, in_legend=False)
    shown = {capitalized_title(method) for method in drawn[:shown_first]}
    for trace in figure.data:
        if trace["legendgroup"] not in shown:
            trace["visible"] = "legendonly"
    figure.update_xaxis(title="true airspeed, m/s")
    figure.update_yaxis(title="power required, W", range=[0, 1.3 * float(np.max(hi))])
    figure = styled(figure, 640 + 13 * len(drawn), hover="closest")
    legend = {"traceorder": "reversed", "y": -0.16, "yanchor": "top"}
    figure.update_layout(legend=legend, margin={"b": 120})
    return figure


def _add_interval_bars(figure: Figure, method: MethodResult, color: str, offset: float) -> None:
    """The interval of a method at a few speeds. offset: 0 to 1, shifts the bars so that methods do not overlap."""
    V, P, lo, hi = curve_arrays(method.power_required)
    bars = 4  # more of each method would overlap
    at = V[0] + (V[-1] - V[0]) * (np.arange(bars) + offset) / bars
    value, low, high = (np.interp(at, V, values) for values in (P, lo, hi))
    figure.add_scatter(
        x=rounded(at),
        y=rounded(value),
        error_y={"symmetric": False, "array": rounded(high - value), "arrayminus": rounded(value - low), "width": 5},
        mode="markers",
        marker={"color": color, "size": 3},
        legendgroup=capitalized_title(method),
        showlegend=False,
        hoverinfo="skip",
    )


def run_by_run(results: Results) -> Figure:
    """The curve of every run fitted alone, over the curve of all runs; below, in percent of that."""
    figure = Figure(2, 0.06)
    V, P, lo, hi = curve_arrays(results.power_required)
    for panel, ends in ((1, (lo, hi)), (2, (100 * (lo / P - 1), 100 * (hi / P - 1)))):
        add_band(figure, V, ends, ALL_RUNS, 0.3, panel=panel, legendgroup=ALL_RUNS_NAME)
    add_curve(figure, results.power_required, ALL_RUNS_NAME, ALL_RUNS, width=5)
    in_legend = set()
    kinds = (run.kind for run in results.runs if run.kind in LEVEL_RUNS)
    for kind, run in zip(kinds, results.one_by_one, strict=True):
        if run.power_required:
            at, alone, _, _ = curve_arrays(run.power_required[::3])
            percent = 100 * (alone / np.interp(at, V, P, left=np.nan, right=np.nan) - 1)
            for panel, values, unit in ((1, alone, "%{y:.1f} W"), (2, percent, "%{y:+.1f} %")):
                figure.add_scatter(
                    panel=panel, x=rounded(at), y=rounded(values), mode="lines", name=kind, legendgroup=kind,
                    line={"color": RUN_COLOR.get(kind, OTHER_RUN), "width": 2},
                    showlegend=panel == 1 and kind not in in_legend,
                    hovertemplate=f"{run.title}: {unit}<extra></extra>", meta={"run": run.title},
                )  # fmt: skip
            in_legend.add(kind)
    figure.add_zero_line({"color": ALL_RUNS, "width": 2}, panel=2)
    figure.update_xaxis(title="true airspeed, m/s")
    figure.update_yaxis(title="power required, W", range=[0, 1.3 * float(np.max(hi))])
    figure.update_yaxis(title="from all runs, %", panel=2)
    return styled(figure, 620, hover="closest")


ALL_RUNS_NAME = "all runs"


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
            add_band(figure, mass, (lo, hi), color, 0.2)
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
        add_band(figure, V, (lo, hi), color, 0.18)
        add_curve(figure, curve, title, color, width=4)
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
