"""Calibrates a five-port probe from wind-tunnel measurements: reads the file, fits maps, and tests the effect of speed.

The calibration includes the error of the slope of alpha. The slopes of the residuals at each tunnel speed show whether
this slope depends on speed.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray
from scipy import special
from scipy.spatial import ConvexHull

from flightpower.analysis.air.probe import FittedMap, Powers, ProbeCalibration, fit_map, polynomial_of_order, terms
from flightpower.analysis.air.settings import TUNNEL
from flightpower.analysis.calibrations.runner import Calibrated, CalibrationFile, calibration
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.pages.charts.figure import Axis, Cursor, Figure, Line, Points, Symbol
from flightpower.analysis.pages.charts.style import BLUE, GRAY, INK, ORANGE, PALETTE, RED, SYMBOLS
from flightpower.analysis.pages.html_page import HtmlTable, html_figure, render_page
from flightpower.analysis.settings import FLOWN
from flightpower.analysis.sources.check_settings import UNITS
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import density
from flightpower.flight.command_line import Quantity
from flightpower.flight.errors import InputError
from flightpower.flight.files import check_new_file
from flightpower.flight.probe_maps import FORMAT
from flightpower.flight.unit_columns import read_unit_columns


@dataclass(frozen=True)
class TunnelData:
    """Measurements of a tunnel calibration in SI units, arrays (n,).

    dp_alpha_Pa : lower minus upper port     dp_beta_Pa : right minus left port     q_c_Pa : center minus static
    """

    speed_mps: Array
    alpha_rad: Array
    beta_rad: Array
    dp_alpha_Pa: Array
    dp_beta_Pa: Array
    q_c_Pa: Array
    static_Pa: Array
    temperature_K: Array

    @property
    def C_alpha(self) -> Array:
        """dp_alpha/q_c [-], (n,)."""
        return self.dp_alpha_Pa / self.q_c_Pa

    @property
    def C_beta(self) -> Array:
        """dp_beta/q_c [-], (n,)."""
        return self.dp_beta_Pa / self.q_c_Pa


# Columns of the file, each with its (field, unit).
_COLUMNS = {
    "speed": ("speed_mps", "m/s"),
    "alpha": ("alpha_rad", "rad"),
    "beta": ("beta_rad", "rad"),
    "dp_alpha": ("dp_alpha_Pa", "Pa"),
    "dp_beta": ("dp_beta_Pa", "Pa"),
    "q_c": ("q_c_Pa", "Pa"),
    "static": ("static_Pa", "Pa"),
    "temperature": ("temperature_K", "K"),
}


def read_tunnel(path: str | Path) -> TunnelData:
    """Read measurements from a CSV file whose header gives each column's name and unit, such as `alpha [deg]`.

    Raises InputError naming file and cause.
    """
    return TunnelData(**read_unit_columns(Path(path), _COLUMNS, tuple(_COLUMNS), "speed [m/s], alpha [deg], …"))


def dynamic_pressure(tunnel: TunnelData) -> Array:
    """Return the dynamic pressure of the free stream [Pa], (n,), from speed and density."""
    return np.asarray(density(tunnel.static_Pa, tunnel.temperature_K) * tunnel.speed_mps**2 / 2)


class SlopeAtSpeed(NamedTuple):
    """A straight line through an angle's residuals at one tunnel speed: offset at zero angle, slope and slope error."""

    speed_mps: float
    points: int
    offset_rad: float
    slope: float
    slope_error: float


class SpeedDependence(NamedTuple):
    """Slopes of an angle's residuals at each speed, and whether they differ."""

    speeds: list[SlopeAtSpeed]
    chi_squared: float  # chi squared of the slopes about their mean
    spread: float  # standard deviation of the slope between speeds, less noise; 0 if noise explains it

    @property
    def significant(self) -> bool:
        return self.spread > 0


def speed_dependence(tunnel: TunnelData, residual_rad: Array, angle_rad: Array) -> SpeedDependence:
    """Fit the slope of an angle's residuals (n,) at each speed, for angles (n,) within TUNNEL.slope_range_rad."""
    small = np.abs(angle_rad) <= TUNNEL.slope_range_rad
    groups = _speed_groups(tunnel.speed_mps)
    at_speeds = []
    for group in range(groups.max() + 1):
        in_group = small & (groups == group)
        x, y = angle_rad[in_group], residual_rad[in_group]
        if len(x) < STATISTICS.fewest_readings or np.ptp(x) == 0:
            continue
        x_mean = x - x.mean()
        slope = float(x_mean @ y / (x_mean @ x_mean))
        left = y - y.mean() - slope * x_mean
        error = float(np.sqrt(left @ left / (len(x) - 2) / (x_mean @ x_mean)))
        offset = float(y.mean() - slope * x.mean())
        at_speeds.append(SlopeAtSpeed(float(tunnel.speed_mps[in_group].mean()), len(x), offset, slope, error))
    if len(at_speeds) < 2:
        return SpeedDependence(at_speeds, 0.0, 0.0)
    slopes, errors = np.array([f.slope for f in at_speeds]), np.array([f.slope_error for f in at_speeds])
    mean = np.average(slopes, weights=1 / errors**2)
    chi_squared = float(np.sum(((slopes - mean) / errors) ** 2))
    if chi_squared < special.chdtri(len(at_speeds) - 1, STATISTICS.false_alarm_rate):
        return SpeedDependence(at_speeds, chi_squared, 0.0)
    excess_variance = max(float(np.var(slopes, ddof=1) - np.mean(errors**2)), 0.0)
    return SpeedDependence(at_speeds, chi_squared, float(np.sqrt(excess_variance)))


def _speed_groups(speed_mps: Array) -> NDArray[np.int64]:
    """Return the number, from 0, of each point's tunnel speed; a gap between sorted speeds starts a new number."""
    order = np.argsort(speed_mps)
    steps = np.diff(speed_mps[order]) > FLOWN.nearby * speed_mps[order][:-1]
    group = np.empty(len(order), dtype=np.int64)
    group[order] = np.concatenate([[0], np.cumsum(steps)])
    return group


def calibrate(tunnel: TunnelData, source: str = "", *, angle_scale_sigma: float = 0.0) -> ProbeCalibration:
    """Fit smooth maps to a tunnel's measurements; cross-validation chooses the order of each.

    angle_scale_sigma: relative standard error of the tunnel's own angles (turntable, blockage, walls). This error does
    not show in the measurements. Raises InputError if there are too few points, a point without flow or only one angle,
    or if the points do not support a calibration: the maps predict too little of the variance of alpha or beta at
    points left out, or the standard error of the slope of alpha exceeds TUNNEL.largest_slope_sigma.
    """
    if np.any(tunnel.speed_mps > UNITS.plausible.tip_mps[1]):
        raise InputError(f"{source}: speeds above {UNITS.plausible.tip_mps[1]:.0f} m/s; is their unit right?")
    qbar = dynamic_pressure(tunnel)
    if len(qbar) < STATISTICS.fewest_values:
        raise InputError(
            f"{source}: {len(qbar)} points are too few to calibrate a probe; {STATISTICS.fewest_values} are needed"
        )
    if np.any(tunnel.q_c_Pa <= 0) or np.any(qbar <= 0):
        raise InputError(f"{source}: q_c and speed must be positive at every point")
    if min(np.ptp(tunnel.alpha_rad), np.ptp(tunnel.beta_rad)) == 0:
        raise InputError(f"{source}: alpha and beta must both vary; measure over a grid of angles")
    C_alpha, C_beta = tunnel.C_alpha, tunnel.C_beta
    q_ratio = fit_map(C_alpha, C_beta, tunnel.q_c_Pa / qbar, qbar, exponent=-0.5).map
    ratio = q_ratio(C_alpha, C_beta)
    x, y = C_alpha * ratio, C_beta * ratio  # these are dp_alpha/qbar and dp_beta/qbar
    alpha, alpha_covariance, weight = fit_map(x, y, tunnel.alpha_rad, qbar)
    beta = fit_map(x, y, tunnel.beta_rad, qbar).map
    for name, fitted, measured in (("alpha", alpha, tunnel.alpha_rad), ("beta", beta, tunnel.beta_rad)):
        spread = float(np.std(measured))
        if fitted.residual_rms**2 > (1 - TUNNEL.least_predicted) * spread**2:
            raise InputError(
                f"{source}: the pressures do not determine {name}: points left out are predicted within"
                f" {np.degrees(fitted.residual_rms):.2f} deg rms, of {np.degrees(spread):.2f} deg that they vary by;"
                f" measure at more angles {name}, and check the tubes"
            )

    slope_of = _slope_by_coefficient(alpha, (float(x.min()), float(x.max())))
    noise = np.sqrt(slope_of(alpha.powers) @ alpha_covariance @ slope_of(alpha.powers))
    others = [
        polynomial_of_order(x, y, tunnel.alpha_rad, weight, order)[0] for order in _equal_orders(alpha, len(qbar))
    ]
    slope, *other_slopes = (
        slope_of(direction.powers) @ np.array(direction.coefficients) for direction in (alpha, *others)
    )
    form = max((abs(other - slope) for other in other_slopes), default=0.0)
    with_speed = speed_dependence(tunnel, alpha(x, y) - tunnel.alpha_rad, tunnel.alpha_rad)

    sigma = float(np.sqrt(noise**2 + form**2 + with_speed.spread**2 + angle_scale_sigma**2))
    if sigma > TUNNEL.largest_slope_sigma and angle_scale_sigma <= TUNNEL.largest_slope_sigma:
        raise InputError(
            f"{source}: the slope of alpha is uncertain by {100 * sigma:.0f} % (1 sigma): measure at more angles and"
            " longer at each"
        )
    corners = np.column_stack([C_alpha, C_beta])[ConvexHull(np.column_stack([C_alpha, C_beta])).vertices]
    return ProbeCalibration(
        format=FORMAT,
        source=source,
        points=len(qbar),
        alpha_rad=alpha,
        beta_rad=beta,
        q_ratio=q_ratio,
        alpha_scale_sigma=sigma,
        hull=[(float(a), float(b)) for a, b in corners],
        alpha_limits_rad=(float(tunnel.alpha_rad.min()), float(tunnel.alpha_rad.max())),
        beta_limits_rad=(float(tunnel.beta_rad.min()), float(tunnel.beta_rad.max())),
    )


def _slope_by_coefficient(alpha: FittedMap, x_range: tuple[float, float]) -> Callable[[Powers], Array]:
    """Return a function of powers (k terms) that gives how much each coefficient changes the slope of alpha, (k,).

    The slope is from a straight line over the angles of normal flight at dp_beta = 0, relative to the slope of `alpha`
    itself.
    """
    x = np.linspace(*x_range, 401)
    angle = alpha(x, np.zeros_like(x))
    x, angle = x[np.abs(angle) <= TUNNEL.slope_range_rad], angle[np.abs(angle) <= TUNNEL.slope_range_rad]
    centered = angle - angle.mean()
    return lambda powers: (centered / (centered @ centered)) @ terms(x, np.zeros_like(x), powers)


def _equal_orders(best: FittedMap, points: int) -> list[int]:
    """Return other orders that predict as well as the best, within the standard error of an rms over `points`."""
    limit = best.residual_rms * (1 + 1 / np.sqrt(2 * points))
    good = [k for k, rms in enumerate(best.tried_rms, start=1) if rms < limit]
    return [k for k in good if k != best.order]


@calibration(CalibrationFile, "probe.json")
def probe(
    tunnel: Annotated[
        Path, typer.Argument(metavar="TUNNEL", help="CSV with a header such as `speed [m/s],alpha [deg],…`")
    ],
    output: Path,
    replace: bool,
    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="FILE", help="Report page to write; default: beside the calibration, .html"),
    ] = None,
    angle_scale: Annotated[
        float,
        Quantity("--angle-scale", "%", '"0.5 %"', least=0, most=20.0).as_option(
            "Standard error of the tunnel's own angles, in percent."
        ),
    ] = 0.5,
) -> Calibrated:
    """Calibrate a five-port probe from wind-tunnel measurements.

    The tunnel file has the columns speed, alpha, beta, dp_alpha (lower minus upper port), dp_beta (right minus left),
    q_c (center minus static), static and temperature, each with its unit in brackets. Measure at three speeds or more,
    so that a dependence on speed shows. Measure at angles beyond those that will be flown: the analysis leaves out
    results outside the measured range.

    The report page shows the residuals of the calibration, the effect of speed, and the range of validity. The file
    contains the standard error of the slope of alpha (alpha_scale_sigma). Errors of the turntable and of the tunnel
    walls are part of it; the measurements do not show them: give them by --angle-scale. Nothing is written if the
    points do not support a calibration: less than 90 % of the variance of alpha or beta is predicted at points left
    out, or the slope is uncertain by more than 10 % (1 sigma).

    To rehearse it: `sim tunnel -o tunnel.csv`.

    \b
    Example:
      calibrate probe tunnel.csv -o probe.json --angle-scale 1
    with tunnel.csv such as
      speed [m/s],alpha [deg],beta [deg],dp_alpha [Pa],dp_beta [Pa],q_c [Pa],
      static [hPa],temperature [degC]     (on one line; then a line a point)
    """

    where = report or output.with_suffix(".html")
    if where == output:
        raise InputError(f"{where}: report and calibration cannot be the same file; name another with --report")
    check_new_file(where, replace=replace)
    measured = read_tunnel(tunnel)
    calibration = calibrate(measured, tunnel.name, angle_scale_sigma=angle_scale / 100)
    html = render(measured, calibration, angle_scale_sigma=angle_scale / 100)
    return Calibrated(summary(calibration), calibration, pages={where: html})


def summary(calibration: "ProbeCalibration") -> list[str]:
    """Return the result as lines of text."""
    lines = [f"{calibration.points} points, order of the polynomials by cross-validation:"]
    for name, fitted, scale, unit in (
        ("alpha", calibration.alpha_rad, math.degrees(1), "deg"),
        ("beta", calibration.beta_rad, math.degrees(1), "deg"),
        ("q_c/qbar", calibration.q_ratio, 100, "%"),
    ):
        rms = f"{fitted.residual_rms * scale:.3f} {unit}"
        lines.append(f"  {name:9} order {fitted.order}, error of left-out points {rms} weighted rms")
    return [*lines, f"standard error of the slope of alpha: {100 * calibration.alpha_scale_sigma:.2f} %"]


def render(tunnel: TunnelData, calibration: ProbeCalibration, *, angle_scale_sigma: float) -> str:
    """Return the page as one HTML file. angle_scale_sigma: relative standard error of the tunnel's own angles."""
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
    figures: dict[str, Figure | Sequence[Figure]] = {
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
        figures={name: html_figure(figure, name) for name, figure in figures.items()},
    )


def slope_parts(calibration: ProbeCalibration, dependence: SpeedDependence, angle_scale_sigma: float) -> str:
    """Return the parts of the error of the slope of alpha as text; their squares add up."""
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
    """Return a sentence on whether the slope of alpha depends on tunnel speed."""
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
    """Return a sentence on where the calibration holds."""
    within = [
        f"{name} from {np.degrees(limits[0]):.0f} to {np.degrees(limits[1]):.0f} deg"
        for name, limits in (("alpha", calibration.alpha_limits_rad), ("beta", calibration.beta_limits_rad))
        if limits is not None
    ]
    angles = f", for {' and '.join(within)}" if within else ""
    return f"The calibration holds inside the line{angles}."


QUANTITIES = (Axis("alpha", "deg"), Axis("beta", "deg"), Axis("q_c/q", "%"))
LEVELS = (RED, ORANGE, GRAY, "#0087b3", BLUE)  # colors for a residual, starting with the most negative


def residual_maps(tunnel: TunnelData, residuals: tuple[Array, Array, Array]) -> list[Figure]:
    """Plot residuals of QUANTITIES over the two angles; points at different speeds are drawn side by side."""
    figures = []
    speeds = np.unique(np.round(tunnel.speed_mps, 1))
    aside = np.interp(tunnel.speed_mps, speeds, np.linspace(-0.9, 0.9, len(speeds))) if len(speeds) > 1 else 0.0
    for axis, residual in zip(QUANTITIES, residuals, strict=True):
        end = float(np.percentile(np.abs(residual), 99))  # end of the color scale; outliers get its last color
        figure = Figure(cursor=Cursor.NEAREST, heading=axis.title, x=Axis("alpha", "deg"))
        figure.y = Axis("beta", "deg")
        edges = np.linspace(-end, end, len(LEVELS) + 1)
        level = np.clip(np.searchsorted(edges, residual) - 1, 0, len(LEVELS) - 1)
        for k, (color, lo, hi) in enumerate(zip(LEVELS, edges, edges[1:], strict=False)):
            at_level = level == k
            figure.add(
                Points(
                    x=(np.degrees(tunnel.alpha_rad) + aside)[at_level], y=np.degrees(tunnel.beta_rad)[at_level], size=5,
                    color=color, z=residual[at_level], value=f"{{z:+.2f}} {axis.unit}", name=f"{lo:+.2g} to {hi:+.2g}",
                )
            )  # fmt: skip
        figures.append(figure)
    return figures


def sections(tunnel: TunnelData, calibration: ProbeCalibration) -> list[Figure]:
    """Plot C_alpha against alpha and C_beta against beta, the other angle near zero (the source's Figs 5.8, 5.9)."""
    figures = []
    speeds = np.round(tunnel.speed_mps).astype(int)
    for angle, other, dp, name in (
        (tunnel.alpha_rad, tunnel.beta_rad, tunnel.dp_alpha_Pa, "alpha"),
        (tunnel.beta_rad, tunnel.alpha_rad, tunnel.dp_beta_Pa, "beta"),
    ):
        figure = Figure(height_px=420, cursor=Cursor.NEAREST, x=Axis(name, "deg"))
        figure.y = Axis(f"C_{name}")
        near = np.abs(other) <= np.radians(1)
        C = dp / tunnel.q_c_Pa
        for k, speed in enumerate(np.unique(speeds)):
            at_speed = near & (speeds == speed)
            figure.add(
                Points(
                    x=np.degrees(angle[at_speed]), y=C[at_speed], name=f"{speed} m/s", size=7,
                    color=PALETTE[k % len(PALETTE)], symbol=SYMBOLS[k % len(SYMBOLS)],
                )
            )  # fmt: skip
        if near.any():
            line = np.linspace(C[near].min(), C[near].max(), 80)
            zero = np.zeros_like(line)
            predicted = calibration.maps(line, zero)[0] if name == "alpha" else calibration.maps(zero, line)[1]
            figure.add(Line(x=np.degrees(predicted), y=line, name="calibration", color=INK, width=1.5))
        figures.append(figure)
    return figures


def by_speed(dependence: SpeedDependence) -> list[Figure]:
    """Plot alpha's residual at each tunnel speed: error of the slope with its 95 % interval, and offset at zero."""
    V = np.array([point.speed_mps for point in dependence.speeds])
    offset = np.array([np.degrees(point.offset_rad) for point in dependence.speeds])
    slope = np.array([100 * point.slope for point in dependence.speeds])
    half_width = np.array([100 * NORMAL_95 * point.slope_error for point in dependence.speeds])
    figures = []
    for values, axis, ends in (
        (slope, Axis("error of slope", "%"), np.stack([slope - half_width, slope + half_width])),
        (offset, Axis("offset of alpha", "deg"), None),
    ):
        figure = Figure(height_px=340, cursor=Cursor.NEAREST, x=Axis("tunnel speed", "m/s", from_zero=True))
        figure.y = axis
        figure.add(Points(x=V, y=values, color=BLUE, size=10, y_ends=ends))
        figure.zero_lines.add(1)
        figures.append(figure)
    return figures


def valid_range(C_alpha: Array, C_beta: Array, calibration: ProbeCalibration) -> Figure:
    """Plot the measured points and the convex hull within which the calibration holds."""
    x, y = np.array([*calibration.hull, calibration.hull[0]]).T
    figure = Figure(equal=True, cursor=Cursor.NEAREST, x=Axis("C_alpha"))
    figure.y = Axis("C_beta")
    figure.add(
        Points(x=C_alpha, y=C_beta, name="measured", size=5, color=BLUE, value="{x:.3f}, {y:.3f}"),
        Line(x=x, y=y, name="results outside this line are flagged", color=RED, value=""),
    )
    return figure


def polynomial_orders(calibration: ProbeCalibration) -> Figure:
    """Plot the cross-validation error of each polynomial order that was tried; a diamond marks the chosen order."""
    figure = Figure(height_px=380, x=Axis("order of the polynomial (diamond: chosen)", step=1))
    figure.y = Axis("error of left-out points, rms", logarithmic=True)
    surfaces = (calibration.alpha_rad, calibration.beta_rad, calibration.q_ratio)
    for axis, surface, factor, color in zip(QUANTITIES, surfaces, (*np.degrees([1, 1]), 100.0), PALETTE, strict=False):
        tried, name = factor * np.array(surface.tried_rms), axis.title
        chosen = np.array([surface.order]), tried[surface.order - 1 : surface.order]
        value = f"{{y:.3f}} {axis.unit}"
        figure.add(
            Line(x=np.arange(1.0, len(tried) + 1), y=tried, name=name, color=color, value=value),
            Points(x=chosen[0], y=chosen[1], name=name, color=color, size=13, symbol=Symbol.DIAMOND, value=""),
        )
    return figure
