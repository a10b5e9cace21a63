"""The report's drawings, from arrays and tables to Plotly figures. Large type, dark colours: it is read in the sun."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from analysis.maneuvers.kinds import LEVEL_RUNS, Maneuver
from analysis.results.schema import MethodResult, PerformanceResult, PowerPoint, RejectedResult, Results, SpeedInterval
from analysis.trajectory.consistency import ANGLES, SPEED, Consistency
from flight.units import GRAVITY_MPS2

Array = NDArray[np.float64]

INK, GRID, PAPER, GREY = "#000000", "#c9d1d8", "#ffffff", "#5b6b78"
BLUE, RED, GREEN = "#004a99", "#c22a1a", "#00693e"
# For methods, in the order of the results: dark enough on white, told apart also by those who see no red and green.
PALETTE = (
    BLUE, "#c64b00", "#00735c", "#8a2f8f", "#6b4e00", "#3d3d3d", "#0087b3", "#a3123f", "#5a7d00", "#b58900", "#5a3fc0",
    "#d4007f",
)  # fmt: skip
KIND_COLOUR = {"acceleration": RED, "deceleration": BLUE, "steady": GREEN}
FILL = {"acceleration": 0.16, "deceleration": 0.16, "steady": 0.22}
POINTS_DRAWN = 3000


def _styled(figure: go.Figure, height: int, *, hover: str = "x unified") -> go.Figure:
    figure.update_layout(
        height=height,
        margin={"l": 84, "r": 24, "t": 16, "b": 64},
        paper_bgcolor=PAPER,
        plot_bgcolor=PAPER,
        font={"family": "system-ui, sans-serif", "size": 18, "color": INK},
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.02, "x": 0, "font": {"size": 17}},
        hovermode=hover,
    )
    axis = {"gridcolor": GRID, "zeroline": False, "linecolor": INK, "linewidth": 2, "ticks": "outside"}
    figure.update_xaxes(**axis)
    figure.update_yaxes(**axis)
    return figure


def _curve(points: Sequence[PowerPoint]) -> tuple[Array, Array, Array, Array]:
    V, P, lo, hi = np.array([(p.speed_mps, p.power_W, p.power_lo_W, p.power_hi_W) for p in points]).T
    return V, P, lo, hi


def _faint(colour: str, share: float) -> str:
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red}, {green}, {blue}, {share})"


def _band(figure: go.Figure, x: Array, lo: Array, hi: Array, colour: str, share: float, **where) -> None:
    figure.add_scatter(
        x=_rounded(np.r_[x, x[::-1]]),
        y=_rounded(np.r_[hi, lo[::-1]]),
        mode="lines",
        fill="toself",
        fillcolor=_faint(colour, share),
        line={"width": 0},
        hoverinfo="skip",
        showlegend=False,
        **where,
    )


def _line(figure: go.Figure, points: Sequence[PowerPoint], name: str, colour: str, width: float, **more) -> None:
    """Solid where it was measured, dashed where it was not."""
    V, P, _, _ = _curve(points)
    outside = np.array([p.extrapolated for p in points])
    # A dashed piece reaches to the solid one beside it.
    beside = np.r_[outside[1:], False] | np.r_[False, outside[:-1]]
    for flag, dash, first in ((~outside, "solid", True), (outside | beside, "9px,6px", outside.all())):
        if flag.any() and (dash == "solid" or outside.any()):
            figure.add_scatter(
                x=_rounded(V),
                y=_rounded(np.where(flag, P, np.nan)),
                mode="lines",
                line={"color": colour, "width": width, "dash": dash},
                name=name,
                legendgroup=name,
                showlegend=bool(first),
                hovertemplate="%{y:.1f} W",
                **more,
            )


def methods_of(results: Results) -> list[MethodResult]:
    """Every method there is, the one whose curve is the product first."""
    if not any(run.kind in LEVEL_RUNS for run in results.runs):
        polar = results.drag_polar  # the curve is that of one of them
        return sorted(results.methods, key=lambda m: m.drag_polar != [polar.A0, polar.A1, polar.A2])
    ours = (
        MethodResult(
            name="dynamic", title="dynamic, two steps", equations="(3.45), path and forces",
            power_required=results.power_required,
        ),
        MethodResult(
            name="cross-check", title=f"{results.cross_check_by}, runs alone", equations="(3.24-3.45)",
            power_required=results.cross_check,
        ),
    )  # fmt: skip
    return [*(m for m in ours if m.name not in {other.name for other in results.methods}), *results.methods]


def power_required(results: Results) -> go.Figure:
    """The product: power against speed with its interval, steady points beside it, and what full throttle gives."""
    figure = go.Figure()
    V, P, lo, hi = _curve(results.power_required)
    _band(figure, V, lo, hi, BLUE, 0.3)
    _line(figure, results.power_required, "power required", BLUE, 5)
    with_points = [method for method in results.methods if method.points]
    if with_points:
        _measured(figure, with_points[0], PALETTE[1], "steady points, with the table's thrust")
    _continued(figure, results, float(V[0]), float(V[-1]))
    top = float(np.max(hi)) * 1.12
    if results.use and results.use.available.power_available:
        _line(figure, results.use.available.power_available, "Full throttle", INK, 3)
        top = max(top, min(float(np.max(_curve(results.use.available.power_available)[1])) * 1.06, 2.2 * top))
    for special, name, colour, symbol in (
        (results.minimum_power_speed, "least power", GREEN, "circle"),
        (results.best_range_speed, "least drag", RED, "diamond"),
    ):
        _special(figure, special, name, colour, symbol, V, P)
    figure.update_xaxes(title="true airspeed, m/s")
    figure.update_yaxes(title="power, W", range=[0, top])
    return _styled(figure, 400)


def methods(results: Results) -> go.Figure:
    """Every method's curve; upright bars here and there are its 95 % interval, circles its points."""
    figure = go.Figure()
    drawn = [method for method in methods_of(results) if method.power_required]
    V, _, lo, hi = _curve(results.power_required)
    _band(figure, V, lo, hi, PALETTE[0], 0.25, legendgroup=_title(drawn[0]))
    for i, method in reversed(list(enumerate(drawn))):  # the leading one on top
        colour = PALETTE[i % len(PALETTE)]
        _line(figure, method.power_required, _title(method), colour, 5 if i == 0 else 2.5)
        if i > 0:
            _bars(figure, method, colour, (i - 0.5) / len(drawn))
        if method.points:
            _measured(figure, method, colour, _title(method))
    figure.update_xaxes(title="true airspeed, m/s")
    figure.update_yaxes(title="power required, W", range=[0, 1.3 * float(np.max(hi))])
    figure = _styled(figure, 640 + 13 * len(drawn), hover="closest")
    legend = {"traceorder": "reversed", "y": -0.16, "yanchor": "top"}
    figure.update_layout(legend=legend, margin={"b": 120})
    return figure


def one_by_one(results: Results) -> go.Figure:
    """Every run's own curve over that of all of them."""
    figure = go.Figure()
    V, _, lo, hi = _curve(results.power_required)
    _band(figure, V, lo, hi, PALETTE[5], 0.3)
    _line(figure, results.power_required, "all runs", PALETTE[5], 5)
    named = set()
    for method in results.one_by_one:
        if method.power_required:
            kind = next((kind for kind in KIND_COLOUR if kind in method.title), "run")
            style = {"color": KIND_COLOUR.get(kind, PALETTE[3]), "width": 2}
            V, P, _, _ = _curve(method.power_required)
            figure.add_scatter(
                x=_rounded(V), y=_rounded(P), mode="lines", line=style, name=kind, showlegend=kind not in named,
                legendgroup=kind, hovertemplate=f"{method.title}: %{{y:.1f}} W<extra></extra>",
            )  # fmt: skip
            named.add(kind)
    figure.update_xaxes(title="true airspeed, m/s")
    figure.update_yaxes(title="power required, W", range=[0, 1.3 * float(np.max(hi))])
    return _styled(figure, 460, hover="closest")


def _title(method: MethodResult) -> str:
    return method.title[:1].upper() + method.title[1:]


def _bars(figure: go.Figure, method: MethodResult, colour: str, offset: float) -> None:
    """A method's interval at four speeds, each method's beside the others'."""
    V, P, lo, hi = _curve(method.power_required)
    at = V[0] + (V[-1] - V[0]) * (np.arange(4) + offset) / 4
    value, low, high = (np.interp(at, V, values) for values in (P, lo, hi))
    figure.add_scatter(
        x=_rounded(at),
        y=_rounded(value),
        error_y={"symmetric": False, "array": _rounded(high - value), "arrayminus": _rounded(value - low), "width": 5},
        mode="markers",
        marker={"color": colour, "size": 3},
        legendgroup=_title(method),
        showlegend=False,
        hoverinfo="skip",
    )


def _continued(figure: go.Figure, results: Results, slowest: float, fastest: float) -> None:
    """The curve beyond what was flown, dashed: down to the speed of least power, up to the highest level speed."""
    use, least = results.use, results.minimum_power_speed.speed_mps
    top = use.available.maximum_speed_mps if use else None
    polar, at, S = results.drag_polar, results.test, results.aircraft.wing_area_m2
    for start, end in ((least or slowest, slowest), (fastest, top.value if top else fastest)):
        if 0.8 * slowest <= start < end:
            V = np.linspace(start, end, 15)
            q = at.air_density_kgpm3 * V**2 / 2
            CL = at.weight_N / (q * S)
            power = q * S * V * (polar.A0 + polar.A1 * CL + polar.A2 * CL**2)
            figure.add_scatter(
                x=_rounded(V), y=_rounded(power), mode="lines", line={"color": PALETTE[0], "width": 3, "dash": "dash"},
                showlegend=False, hovertemplate="%{y:.1f} W, not flown", name="power required",
            )  # fmt: skip


def _measured(figure: go.Figure, method: MethodResult, colour: str, name: str) -> None:
    power = np.array([p.power_W for p in method.points])
    lo = np.array([p.power_W if p.power_lo_W is None else p.power_lo_W for p in method.points])
    hi = np.array([p.power_W if p.power_hi_W is None else p.power_hi_W for p in method.points])
    figure.add_scatter(
        x=_rounded(np.array([p.speed_mps for p in method.points])),
        y=_rounded(power),
        error_y={"symmetric": False, "array": _rounded(hi - power), "arrayminus": _rounded(power - lo), "thickness": 2},
        mode="markers",
        marker={"color": PAPER, "size": 10, "line": {"color": colour, "width": 3}},
        name=name,
        legendgroup=name,
        showlegend=name != _title(method),
        hovertemplate="%{y:.1f} W",
    )


def _special(
    figure: go.Figure, special: SpeedInterval, name: str, colour: str, symbol: str, V: Array, P: Array
) -> None:
    if special.speed_mps is None or not special.inside_flown_range:
        return
    at = special.speed_mps
    errors = {
        "symmetric": False,
        "array": [(special.hi_mps or at) - at],
        "arrayminus": [at - (special.lo_mps or at)],
        "thickness": 3,
        "width": 7,
    }
    figure.add_scatter(
        x=[at],
        y=[float(np.interp(at, V, P))],
        error_x=errors,
        mode="markers",
        name=name,
        marker={"color": colour, "size": 15, "symbol": symbol, "line": {"color": PAPER, "width": 2}},
        hovertemplate="%{x:.1f} m/s",
    )


def loadings(use: PerformanceResult) -> go.Figure:
    """Longest endurance and range against weight, a line for each air."""
    figure = make_subplots(rows=1, cols=2, horizontal_spacing=0.12)
    airs = sorted({round(case.air_density_kgpm3, 5) for case in use.loadings}, reverse=True)
    for i, rho in enumerate(airs):
        cases = sorted((c for c in use.loadings if round(c.air_density_kgpm3, 5) == rho), key=lambda c: c.weight_N)
        name = f"density altitude {cases[0].density_altitude_m:.0f} m"
        as_flown = rho == round(use.loadings[0].air_density_kgpm3, 5)
        name += " (as flown)" if as_flown else ""
        mass = np.array([case.weight_N / GRAVITY_MPS2 for case in cases])
        for column, values, form in (
            (1, [case.endurance_s.times(1 / 60) for case in cases], "%{y:.0f} min"),
            (2, [case.range_m.times(1e-3) for case in cases], "%{y:.1f} km"),
        ):
            value, lo, hi = np.array([(v.value, v.lo, v.hi) for v in values]).T
            colour = PALETTE[i % len(PALETTE)]
            if as_flown:
                _band(figure, mass, lo, hi, colour, 0.2, row=1, col=column)
            figure.add_scatter(
                x=mass, y=_rounded(value), row=1, col=column, name=name, legendgroup=name, showlegend=column == 1,
                mode="lines+markers", line={"color": colour, "width": 4, "dash": ("solid", "dash", "dot")[i % 3]},
                marker={"size": 11}, hovertemplate=form,
            )  # fmt: skip
    figure.update_xaxes(title="mass, kg")
    figure.update_yaxes(title="endurance, min", col=1)
    figure.update_yaxes(title="range, km", col=2)
    return _styled(figure, 420)


def efficiency(use: PerformanceResult) -> go.Figure:
    """Propeller, motor and both together against speed in level flight, and what was measured."""
    figure = go.Figure()
    points = use.power_train.efficiency
    V = np.array([p.speed_mps for p in points])
    for name, title, colour in (
        ("propeller", "propeller", BLUE),
        ("motor", "motor and controller", "#c64b00"),
        ("overall", "overall", INK),
    ):
        value, lo, hi = 100 * np.array([(i.value, i.lo, i.hi) for i in (getattr(p, name) for p in points)]).T
        curve = [
            PowerPoint(speed_mps=v, power_W=p, power_lo_W=p, power_hi_W=p, extrapolated=point.extrapolated)
            for v, p, point in zip(V.tolist(), value.tolist(), points, strict=True)
        ]
        _band(figure, V, lo, hi, colour, 0.18)
        _line(figure, curve, title, colour, 4)
        if use.power_train.points:
            figure.add_scatter(
                x=_rounded(np.array([p.speed_mps for p in use.power_train.points])),
                y=_rounded(100 * np.array([getattr(p, name) for p in use.power_train.points])),
                mode="markers",
                marker={"size": 8, "color": PAPER, "line": {"color": colour, "width": 2}},
                showlegend=False,
                hoverinfo="skip",
            )
    figure.update_traces(hovertemplate="%{y:.0f} %", selector={"mode": "lines"})
    figure.update_xaxes(title="true airspeed, m/s")
    figure.update_yaxes(title="efficiency, %", range=[0, 105])
    return _styled(figure, 420)


def interval_parts(results: Results) -> go.Figure:
    """What the interval is made of: noise, and what all runs share."""
    V, noise, systematic = np.array([(p.speed_mps, p.noise_W, p.systematic_W) for p in results.interval_parts]).T
    power = np.interp(V, *_curve(results.power_required)[:2])
    figure = go.Figure()
    for values, name, colour, width, dash in (
        (np.hypot(noise, systematic), "whole interval", INK, 4, "solid"),
        (systematic, "what all runs share", "#c64b00", 3, "dash"),
        (noise, "noise", BLUE, 3, "dot"),
    ):
        figure.add_scatter(
            x=_rounded(V), y=_rounded(100 * values / power), mode="lines", name=name,
            line={"color": colour, "width": width, "dash": dash}, hovertemplate="±%{y:.1f} %",
        )  # fmt: skip
    figure.update_xaxes(title="true airspeed, m/s")
    figure.update_yaxes(title="± % of power", rangemode="tozero")
    return _styled(figure, 360)


def timeline(table: pd.DataFrame, runs: Sequence[Maneuver], rejected: Sequence[RejectedResult] = ()) -> go.Figure:
    """The whole flight: speed, height, motor; runs shaded by kind, what was rejected hatched in grey."""
    rows = (("V_mps", "speed, m/s", 1.0), ("height_m", "height, m", 1.0), ("n_revps", "motor, rpm", 60.0))
    figure = make_subplots(rows=len(rows), cols=1, shared_xaxes=True, vertical_spacing=0.05)
    thin = table.iloc[:: max(1, len(table) // POINTS_DRAWN)]
    for i, (name, title, scale) in enumerate(rows, start=1):
        figure.add_scatter(
            x=_rounded(thin.index.to_numpy()),
            y=_rounded(thin[name].to_numpy() * scale),
            row=i,
            col=1,
            line={"color": INK, "width": 1.8},
            showlegend=False,
            name=title,
        )
        figure.update_yaxes(title=title, row=i, col=1)
    shades = [(run.kind, run.start_s, run.end_s) for run in runs if run.kind not in ("standing", "flying")]
    bands = [
        {"x0": start, "x1": end, "fillcolor": KIND_COLOUR.get(kind, PALETTE[3]), "opacity": FILL.get(kind, 0.18),
         "line": {"width": 0}}
        for kind, start, end in shades
    ] + [
        {"x0": stretch.start_s, "x1": stretch.end_s, "fillcolor": "rgba(0,0,0,0.04)",
         "line": {"color": GREY, "width": 1.5, "dash": "dot"}}
        for stretch in rejected
    ]  # fmt: skip
    # All at once: `add_vrect` looks through every shape again for each, a minute of a flight's report.
    axes = ["" if i == 1 else str(i) for i in range(1, len(rows) + 1)]
    places = [{"type": "rect", "xref": f"x{i}", "yref": f"y{i} domain", "y0": 0, "y1": 1} for i in axes]
    figure.update_layout(shapes=[place | band for band in bands for place in places])
    present = {kind: KIND_COLOUR.get(kind, PALETTE[3]) for kind, _, _ in shades}
    if rejected:
        present["rejected"] = GREY
    for kind, colour in present.items():
        marker = {"color": colour, "size": 14, "symbol": "square", "opacity": 0.6}
        figure.add_scatter(x=[None], y=[None], mode="markers", marker=marker, name=kind, row=1, col=1)
    figure.update_xaxes(title="time since the log began, s", row=len(rows), col=1)
    return _styled(figure, 620)


def consistency(agreement: Consistency) -> go.Figure:
    """What should be zero over the flight, before and after the sensors' errors were taken out."""
    degrees = float(np.degrees(1.0))
    rows = ((ANGLES, "θ - α - γ, deg", degrees), (SPEED, "V - GPS, m/s", 1.0))
    figure = make_subplots(rows=len(rows), cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for i, (column, title, scale) in enumerate(rows, start=1):
        for name, differences, colour in zip(("before", "after"), agreement, (GREY, BLUE), strict=True):
            thin = differences[column].iloc[:: -(-len(differences) // POINTS_DRAWN)]
            figure.add_scatter(
                x=_rounded(thin.index.to_numpy()), y=_rounded(scale * thin.to_numpy()), mode="lines", row=i, col=1,
                line={"color": colour, "width": 1.8}, name=name, legendgroup=name, showlegend=i == 1,
            )  # fmt: skip
        figure.add_hline(y=0, line={"color": INK, "width": 1}, row=i, col=1)
        figure.update_yaxes(title=title, row=i, col=1)
    figure.update_xaxes(title="time since the log began, s", row=len(rows), col=1)
    return _styled(figure, 520)


def fit(name: str, t_s: Array, measured: dict[str, Array], modelled: dict[str, Array]) -> go.Figure:
    """One run: what was measured and what the fitted model says, and beside it what is left between them."""
    names = list(measured)
    figure = make_subplots(
        rows=len(names), cols=2, shared_xaxes=True, vertical_spacing=0.04, horizontal_spacing=0.09,
        column_widths=[0.6, 0.4],
    )  # fmt: skip
    for i, quantity in enumerate(names, start=1):
        first = i == 1
        left = measured[quantity] - modelled[quantity]
        dots = {"size": 6, "color": GREY}
        for column, values in ((1, measured[quantity]), (2, left)):
            figure.add_scatter(
                x=_rounded(t_s), y=_rounded(values), mode="markers", row=i, col=column, marker=dots, name="measured",
                legendgroup="measured", showlegend=first and column == 1,
            )  # fmt: skip
        figure.add_scatter(
            x=_rounded(t_s),
            y=_rounded(modelled[quantity]),
            mode="lines",
            row=i,
            col=1,
            line={"color": RED, "width": 3},
            name="model",
            showlegend=first,
        )
        figure.add_hline(y=0, row=i, col=2, line={"color": RED, "width": 3})
        figure.update_yaxes(title=quantity, row=i, col=1)
        figure.update_yaxes(title="difference", row=i, col=2)
    figure.update_xaxes(title=f"time, s ({name})", row=len(names), col=1)
    figure.update_xaxes(title="time, s", row=len(names), col=2)
    figure = _styled(figure, 170 * len(names) + 80)
    figure.update_layout(font={"size": 15})
    return figure


def polar(results: Results, CL: Array, CD: Array, lo: Array, hi: Array) -> go.Figure:
    """The drag polar over the flown lift coefficients, with its interval."""
    figure = go.Figure()
    figure.add_scatter(
        x=_rounded(np.r_[lo, hi[::-1]]),
        y=_rounded(np.r_[CL, CL[::-1]]),
        fill="toself",
        fillcolor=_faint(BLUE, 0.25),
        line={"width": 0},
        name="95 % interval",
        hoverinfo="skip",
    )
    figure.add_scatter(x=_rounded(CD), y=_rounded(CL), line={"color": BLUE, "width": 4}, name="drag polar")
    figure.update_xaxes(title="drag coefficient", rangemode="tozero")
    figure.update_yaxes(title="lift coefficient", rangemode="tozero")
    return _styled(figure, 420, hover="closest")


def _rounded(values: Array) -> Array:
    """Five digits are enough to draw with, and a third of the page's size."""
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 10.0 ** (4 - np.floor(np.log10(np.nanmax(np.abs(values)) or 1.0))) if np.isfinite(values).any() else 1.0
    return np.round(values * scale) / scale
