"""Figures over airspeed: power required by all methods, its interval, drag polar, endurance, range, efficiencies."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from flightpower.analysis.curve import Polar, drag_and_error
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.maneuvers.flown import TableLimit
from flightpower.analysis.maneuvers.kinds import LEVEL_RUNS
from flightpower.analysis.methods.interval_sources import Share
from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate
from flightpower.analysis.pages.charts.figure import Axis, Band, Bars, Cursor, Dash, Figure, Line, Mark, Points, Symbol
from flightpower.analysis.pages.charts.style import (
    ALL_RUNS,
    BLUE,
    GRAY,
    GREEN,
    INK,
    ORANGE,
    OTHER_RUN,
    PALETTE,
    RED,
    RUN_COLOR,
    SYMBOLS,
    band,
    curve_arrays,
    curve_lines,
    true_airspeed,
)
from flightpower.analysis.pages.predicted_polar import PredictedPolar, flown_at
from flightpower.analysis.pages.wording import capitalized_title, listed_methods
from flightpower.analysis.records.flight import (
    Interval,
    MethodResult,
    PerformanceResult,
    PowerPoint,
    Results,
    SpeedInterval,
)
from flightpower.flight.arrays import Array
from flightpower.flight.units import GRAVITY_MPS2


def measured_points(method: MethodResult, color: str, name: str) -> Points:
    """Return the points of a method with their 95 % intervals."""
    power = np.array([p.power_W for p in method.points])
    lo = np.array([p.power_W if p.power_lo_W is None else p.power_lo_W for p in method.points])
    hi = np.array([p.power_W if p.power_hi_W is None else p.power_hi_W for p in method.points])
    return Points(
        x=np.array([p.speed_mps for p in method.points]), y=power, y_ends=np.stack([lo, hi]), color=color, size=11,
        hollow=True, name=name, value="{y:.1f} W",
    )  # fmt: skip


REQUIRED = "power required"  # legend entry of curve, interval and continuation


def power_required(results: Results, predicted: PredictedPolar | None = None) -> Figure:
    """Draw power required against speed with its 95 % interval, steady points, and power available at full throttle."""
    V, P, lo, hi = curve_arrays(results.power_required)
    figure = Figure(x=true_airspeed())
    figure.add(band(V, (lo, hi), BLUE, 0.3, name=REQUIRED))
    figure.add(*curve_lines(results.power_required, REQUIRED, BLUE, width=5))
    with_points = [method for method in results.methods if method.points]
    if with_points:
        figure.add(measured_points(with_points[0], ORANGE, "steady points"))
    figure.add(*_continuation(results, float(V[-1])))
    top = float(np.max(hi)) * 1.12
    if results.use and results.use.available.power_available:
        available = results.use.available.power_available
        figure.add(*curve_lines(available, "available at full throttle", INK, width=3))
        top = max(top, min(float(np.max(curve_arrays(available)[1])) * 1.06, 2.2 * top))
    if predicted:
        wider = np.linspace(0.9 * V[0], 1.1 * V[-1], 60)
        figure.add(_predicted(wider, predicted.power_W(wider, flown_at(results)), predicted))
    for optimum, color, symbol, name in (
        (results.minimum_power_speed, GREEN, Symbol.CIRCLE, "least power"),
        (results.best_range_speed, RED, Symbol.DIAMOND, "least drag"),
    ):
        figure.add(*_speed(optimum, (V, P), color, symbol, name))
    figure.y = Axis("power", "W", limits=(0, top))
    return figure


def _predicted(x: Array, y: Array, predicted: PredictedPolar) -> Line:
    name = f"predicted, {predicted.name}"
    return Line(x=x, y=y, name=name, color=OTHER_RUN, width=4, dash=Dash.DOTTED)


def _continuation(results: Results, fastest: float) -> list[Mark]:
    """Return a dashed curve from the fastest speed flown to the highest level speed; none below the slowest."""
    top = results.use.available.maximum_speed_mps if results.use else None
    polar, condition, S = results.drag_polar, results.test, results.aircraft.wing_area_m2
    if polar is None or top is None or top.value <= fastest:
        return []
    V = np.linspace(fastest, top.value, 15)
    q = condition.air_density_kgpm3 * V**2 / 2
    CL = condition.weight_N / (q * S)
    power = q * S * V * (polar.A0 + polar.A1 * CL + polar.A2 * CL**2)
    return [Line(x=V, y=power, color=BLUE, width=3, dash=Dash.LONG, name=REQUIRED, value="{y:.1f} W, not flown")]


OF_TABLE = {
    TableLimit.MOTOR_SPEED: "at motor speeds that the propeller table does not reach",
    TableLimit.ADVANCE_RATIO: (
        "beyond the advance ratios J = V/(nD) of the propeller table (true airspeed V, motor speed n,"
        " propeller diameter D)"
    ),
}


def dashes(results: Results, limits: Sequence[TableLimit] = ()) -> str:
    """Return a sentence on the dashed parts of the figure of power required; empty if there are none.

    limits : limits of the propeller table that the flight exceeded where power required is dashed
    """
    required = results.power_required
    fastest = required[-1].speed_mps
    available = [point for point in results.use.available.power_available if point.extrapolated] if results.use else []
    reasons = []
    if _continuation(results, fastest) or any(_faster(point, fastest) for point in available):
        reasons.append("beyond the fastest speed flown")
    if any(point.extrapolated for point in required):
        reasons += [OF_TABLE[limit] for limit in limits] or ["outside the propeller table"]
    if any(not _faster(point, fastest) for point in available):
        reasons.append("at full throttle outside the propeller table")
    return f"Dashed: extrapolated {', or '.join(reasons)}." if reasons else ""


def _faster(point: PowerPoint, fastest_mps: float) -> bool:
    return point.speed_mps > fastest_mps * (1 + 1e-9)


def _speed(optimum: SpeedInterval, curve: tuple[Array, Array], color: str, symbol: Symbol, name: str) -> list[Mark]:
    """Return a mark on the curve (V, P) at an optimum speed inside the speeds flown, with that speed's interval."""
    V, P = curve
    speed = optimum.speed_mps
    if speed is None or not optimum.inside_flown_range:
        return []
    ends = np.array([[optimum.lo_mps or min(V[0], speed)], [optimum.hi_mps or speed]])
    return [
        Points(
            x=np.array([speed]), y=np.array([np.interp(speed, V, P)]), x_ends=ends, color=color, symbol=symbol, size=15,
            name=name, value="{x:.1f} m/s",
        )
    ]  # fmt: skip


SOURCE_COLOR = {
    Share.NOISE: GRAY, Share.AIRSPEED: BLUE, Share.ANGLE_OF_ATTACK: ORANGE, Share.ACCELEROMETER: "#6b4e00",
    Share.PROPELLER: OTHER_RUN, Share.WEIGHT: "#00735c", Share.DENSITY: "#0087b3", Share.UPDRAFT: "#5a7d00",
    Share.TRANSDUCERS: "#a3123f", Share.AIRCRAFT_FILE: "#b58900", Share.POLAR_SHAPE: "#5a3fc0",
    Share.OTHER_SENSORS: "#2f5d8c", Share.SHARED: ORANGE,
}  # fmt: skip


def interval_by_source(curve: Sequence[PowerPoint], V: Array, variances: Mapping[Share, Array]) -> Figure:
    """Draw a bar at each speed V (n,), as high as half the 95 % interval in percent of power. The bar is divided among
    the sources in proportion to their variances (n,)."""
    power = np.interp(V, *curve_arrays(curve)[:2])
    total = np.sum(list(variances.values()), axis=0)
    half_percent = 100 * NORMAL_95 * np.sqrt(total) / power
    figure = Figure(height_px=400, x=true_airspeed())
    width = 0.72 * float(np.min(np.diff(V), initial=np.ptp(V) or 1.0))
    base = np.zeros_like(V)
    for source, variance in variances.items():
        share = variance / total
        if np.max(share) < 0.005:  # thinner than a pixel
            continue
        figure.add(
            Bars(
                x=V, y=half_percent * share, base=base, name=source, width=width, color=SOURCE_COLOR[source],
                z=100 * share, value="{z:.0f} % of the variance",
            )
        )  # fmt: skip
        base = base + half_percent * share
    figure.x.ticks = {v: f"{v:.1f}" for v in V.tolist()}
    figure.y = Axis("± % of power", from_zero=True)
    return figure


def drag_polar(polar: Polar, flown_CL: tuple[float, float], predicted: PredictedPolar | None = None) -> Figure:
    """Draw the drag polar over the lift coefficients flown, with its 95 % interval."""
    CL = np.linspace(*flown_CL, 60)
    CD, error = drag_and_error(polar, CL)
    half_width = NORMAL_95 * error
    figure = Figure(height_px=420, cursor=Cursor.NEAREST, x=Axis("drag coefficient", from_zero=True))
    outline = np.r_[CD - half_width, (CD + half_width)[::-1]]
    figure.add(Band(x=outline, y=np.r_[CL, CL[::-1]], color=BLUE, opacity=0.25, name="95 % interval", value=""))
    value = "C_D {x:.4f}, C_L {y:.3f}"
    figure.add(Line(x=CD, y=CL, color=BLUE, width=4, name="drag polar", value=value))
    if predicted:
        near = (predicted.CL > 0) & (predicted.CL < 1.2 * flown_CL[1])
        figure.add(replace(_predicted(predicted.CD[near], predicted.CL[near], predicted), value=value))
    figure.y = Axis("lift coefficient", from_zero=True)
    return figure


def every_method(results: Results, shown_first: int = 2) -> Figure:
    """Draw the curve of every method; bars are its 95 % interval, symbols its measured points.

    The legend lists all methods. At first only the `shown_first` methods, the curve and its cross-check, are visible.
    """
    methods = [method for method in listed_methods(results) if method.power_required]
    V, _, lo, hi = curve_arrays(results.power_required)
    figure = Figure(height_px=560, cursor=Cursor.NEAREST, legend_reversed=True, x=true_airspeed())
    figure.add(band(V, (lo, hi), PALETTE[0], 0.25, name=capitalized_title(methods[0])))
    for i, method in reversed(list(enumerate(methods))):  # the first method on top
        color, title = PALETTE[i % len(PALETTE)], capitalized_title(method)
        symbol = None if i == 0 else SYMBOLS[i % len(SYMBOLS)]
        figure.add(*curve_lines(method.power_required, title, color, width=5 if i == 0 else 2.5, symbol=symbol))
        if i > 0:
            figure.add(_interval_bars(method, color, (i - 0.5) / len(methods)))
        if method.points:
            figure.add(measured_points(method, color, title))
    visible = {capitalized_title(method) for method in methods[:shown_first]}
    for mark in figure.marks:
        mark.hidden = mark.name not in visible
    figure.y = Axis("power required", "W", limits=(0, 1.3 * float(np.max(hi))))
    return figure


def _interval_bars(method: MethodResult, color: str, offset: float) -> Points:
    """Return a method's interval at a few speeds. offset: 0 to 1, shifts the bars so that methods do not overlap."""
    V, P, lo, hi = curve_arrays(method.power_required)
    bars = 4  # more bars per method would overlap
    bar_speeds = V[0] + (V[-1] - V[0]) * (np.arange(bars) + offset) / bars
    value, low, high = (np.interp(bar_speeds, V, values) for values in (P, lo, hi))
    ends = np.stack([low, high])
    return Points(x=bar_speeds, y=value, y_ends=ends, color=color, size=3, name=capitalized_title(method), value="")


def run_by_run(results: Results) -> Figure:
    """Draw the curve of every run fitted alone over the curve of all runs, and below the difference in percent."""
    V, P, lo, hi = curve_arrays(results.power_required)
    figure = Figure(2, height_px=620, cursor=Cursor.NEAREST, x=true_airspeed())
    for panel, ends in ((1, (lo, hi)), (2, (100 * (lo / P - 1), 100 * (hi / P - 1)))):
        figure.add(band(V, ends, ALL_RUNS, 0.3, panel=panel, name=ALL_RUNS_NAME))
    figure.add(*curve_lines(results.power_required, ALL_RUNS_NAME, ALL_RUNS, width=5))
    kinds = (run.kind for run in results.runs if run.kind in LEVEL_RUNS)
    for kind, run in zip(kinds, results.single_runs, strict=True):
        if run.power_required:
            speeds, alone, _, _ = curve_arrays(run.power_required[::3])
            percent = 100 * (alone / np.interp(speeds, V, P, left=np.nan, right=np.nan) - 1)
            for panel, values, value in ((1, alone, "{y:.1f} W"), (2, percent, "{y:+.1f} %")):
                figure.add(
                    Line(
                        panel=panel, x=speeds, y=values, name=kind, color=RUN_COLOR.get(kind, OTHER_RUN), 
                        label=run.title, value=value, run=run.title,
                    )
                )  # fmt: skip
    figure.zero_lines.add(2)
    figure.ys = [
        Axis("power required", "W", limits=(0, 1.3 * float(np.max(hi)))),
        Axis("from all runs", "%"),
    ]
    return figure


ALL_RUNS_NAME = "all runs"


def loadings(use: PerformanceResult) -> list[Figure]:
    """Draw best endurance [min] and range [km] against mass, a line for each air density."""
    return [
        _against_mass(use, [case.endurance_s.times(1 / 60) for case in use.loadings], Axis("endurance", "min"), 0),
        _against_mass(use, [case.range_m.times(1e-3) for case in use.loadings], Axis("range", "km"), 1),
    ]


def _against_mass(use: PerformanceResult, values: list[Interval], y: Axis, digits: int) -> Figure:
    """Draw `values`, which are in the order of `use.loadings`, against mass."""
    figure = Figure(x=Axis("mass", "kg"))
    figure.y = y
    pairs = list(zip(use.loadings, values, strict=True))
    densities = sorted({round(case.air_density_kgpm3, 5) for case in use.loadings}, reverse=True)
    for i, rho in enumerate(densities):
        at_density = sorted((p for p in pairs if round(p[0].air_density_kgpm3, 5) == rho), key=lambda p: p[0].weight_N)
        as_flown = rho == round(use.loadings[0].air_density_kgpm3, 5)
        name = f"density altitude {at_density[0][0].density_altitude_m:.0f} m{' (as flown)' if as_flown else ''}"
        mass = np.array([case.weight_N / GRAVITY_MPS2 for case, _ in at_density])
        value, lo, hi = np.array([(v.value, v.lo, v.hi) for _, v in at_density]).T
        color = PALETTE[i % len(PALETTE)]
        if as_flown:
            figure.add(band(mass, (lo, hi), color, 0.2, name=name))
        figure.add(
            Line(
                x=mass, y=value, name=name, color=color, width=4, dash=(Dash.SOLID, Dash.DASHED, Dash.DOTTED)[i % 3],
                symbol=SYMBOLS[i % len(SYMBOLS)], value=f"{{y:.{digits}f}} {y.unit}",
            )
        )  # fmt: skip
    return figure


def efficiency(use: PerformanceResult) -> Figure:
    """Draw efficiencies [%] of propeller, motor and both against speed in level flight, with the points measured."""
    figure = Figure(height_px=420, x=true_airspeed())
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
        figure.add(band(V, (lo, hi), color, 0.18, name=title))
        figure.add(*curve_lines(curve, title, color, width=4, value="{y:.0f} %"))
        if measured:
            x, y = (np.array([getattr(p, field) for p in measured]) for field in ("speed_mps", name))
            figure.add(Points(x=x, y=100 * y, size=8, hollow=True, color=color, name=title, value=""))
    figure.y = Axis("efficiency", "%", limits=(0, 105))
    return figure


def electrical_power(results: Results, estimate: ElectricalEstimate) -> Figure:
    """Draw electrical power against airspeed with its 95 % interval, and measurements reduced to level flight."""
    figure = Figure(height_px=420, cursor=Cursor.NEAREST, x=true_airspeed())
    V, _, lo, hi = curve_arrays(results.electrical_power)
    figure.add(
        band(V, (lo, hi), BLUE, 0.3, name="electrical power"),
        Points(
            x=estimate.measured_V_mps, y=estimate.measured_W, color=GRAY, size=7, opacity=0.6,
            name="the flight, reduced to level flight", value="{y:.0f} W",
        ),
        *curve_lines(results.electrical_power, "electrical power", BLUE, width=5),
    )  # fmt: skip
    figure.y = Axis("power", "W", limits=(0, 1.2 * float(np.max(hi))))
    return figure
