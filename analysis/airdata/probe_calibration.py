"""A five-port probe's calibration from wind-tunnel measurements: their file, the fit, and whether speed matters.

The error of the slope of alpha is part of the calibration; whether it depends on speed shows in the slope of an
angle's residual at each tunnel speed.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.spatial import ConvexHull

from analysis.airdata.probe import FittedMap, Powers, ProbeCalibration, fit_map, polynomial_of_order, terms
from analysis.airdata.settings import TUNNEL
from analysis.log_checks.settings import UNITS
from analysis.settings import FLOWN
from analysis.signals.settings import STATISTICS
from flight.arrays import Array
from flight.atmosphere import density
from flight.errors import InputError
from flight.probe_maps import FORMAT
from flight.unit_columns import csv_rows, si_column


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


# Column of the file: (field, unit).
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
    """The measurements in a CSV file whose header names each column with its unit, `alpha [deg]`.

    Raises InputError naming file and cause.
    """
    path = Path(path)
    rows = csv_rows(path)
    if len(rows) < 2:
        raise InputError(f"{path}: holds no measurements")
    header, *lines = rows
    values: dict[str, Array] = {}
    for i, title in enumerate(header):
        match = re.fullmatch(r"\s*(\w+)\s*\[(.+)\]\s*", title)
        if match is None or match[1] not in _COLUMNS:
            raise InputError(f"{path}: column {title!r}: must be one of {', '.join(_COLUMNS)}, followed by its [unit]")
        name, unit = _COLUMNS[match[1]]
        values[name] = si_column(lines, i, match[2], unit, f"{path}: {title}")
        wrong = ~np.isfinite(values[name])
        if wrong.any():
            first = ",".join(lines[int(wrong.argmax())])
            raise InputError(f"{path}: column {title!r}: not a number in every line; the first without: {first}")
    missing = [title for title, (name, _) in _COLUMNS.items() if name not in values]
    if missing:
        raise InputError(f"{path}: no column {', '.join(missing)}")
    return TunnelData(**values)


def dynamic_pressure(tunnel: TunnelData) -> Array:
    """Dynamic pressure of the free stream from speed and density [Pa], (n,)."""
    return np.asarray(density(tunnel.static_Pa, tunnel.temperature_K) * tunnel.speed_mps**2 / 2)


class SlopeAtSpeed(NamedTuple):
    """A straight line through an angle's residual at one tunnel speed: offset at zero angle, slope and its error."""

    speed_mps: float
    points: int
    offset_rad: float
    slope: float
    slope_error: float


class SpeedDependence(NamedTuple):
    """Whether the slope of an angle depends on speed."""

    speeds: list[SlopeAtSpeed]
    chi_squared: float  # of the slopes about their mean
    spread: float  # standard deviation of the slope from speed to speed, without noise; 0 if noise explains it

    @property
    def significant(self) -> bool:
        return self.spread > 0


def speed_dependence(tunnel: TunnelData, residual_rad: Array, angle_rad: Array) -> SpeedDependence:
    """The slope of an angle's residual at each speed, within TUNNEL.slope_range_rad. residual_rad, angle_rad : (n,)."""
    small = np.abs(angle_rad) <= TUNNEL.slope_range_rad
    groups = _speed_groups(tunnel.speed_mps)
    at_speeds = []
    for group in range(groups.max() + 1):
        mine = small & (groups == group)
        x, y = angle_rad[mine], residual_rad[mine]
        if len(x) < STATISTICS.fewest_readings or np.ptp(x) == 0:
            continue
        x_mean = x - x.mean()
        slope = float(x_mean @ y / (x_mean @ x_mean))
        left = y - y.mean() - slope * x_mean
        error = float(np.sqrt(left @ left / (len(x) - 2) / (x_mean @ x_mean)))
        offset = float(y.mean() - slope * x.mean())
        at_speeds.append(SlopeAtSpeed(float(tunnel.speed_mps[mine].mean()), len(x), offset, slope, error))
    if len(at_speeds) < 2:
        return SpeedDependence(at_speeds, 0.0, 0.0)
    slopes, errors = np.array([f.slope for f in at_speeds]), np.array([f.slope_error for f in at_speeds])
    mean = np.average(slopes, weights=1 / errors**2)
    chi_squared = float(np.sum(((slopes - mean) / errors) ** 2))
    if chi_squared < special.chdtri(len(at_speeds) - 1, STATISTICS.false_alarm_rate):
        return SpeedDependence(at_speeds, chi_squared, 0.0)
    beyond = max(float(np.var(slopes, ddof=1) - np.mean(errors**2)), 0.0)
    return SpeedDependence(at_speeds, chi_squared, float(np.sqrt(beyond)))


def _speed_groups(speed_mps: Array) -> NDArray[np.int64]:
    """The number of the tunnel speed to which each point belongs, from 0; a new one begins after a step of speed."""
    order = np.argsort(speed_mps)
    steps = np.diff(speed_mps[order]) > FLOWN.nearby * speed_mps[order][:-1]
    group = np.empty(len(order), dtype=np.int64)
    group[order] = np.concatenate([[0], np.cumsum(steps)])
    return group


def calibrate(tunnel: TunnelData, source: str = "", *, angle_scale_sigma: float = 0.0) -> ProbeCalibration:
    """Smooth maps through a tunnel's measurements, the order of each chosen by cross-validation.

    angle_scale_sigma: relative standard error of the tunnel's own angles (turntable, blockage, walls). The measurements
    do not show it.
    Raises InputError if there are too few points, points without flow or at one angle only, or if they do not support
    a calibration: the maps predict too little of the variance of alpha or beta at points left out, or
    the standard error of the slope of alpha exceeds TUNNEL.largest_slope_sigma.
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
    x, y = C_alpha * ratio, C_beta * ratio  # dp_alpha/qbar, dp_beta/qbar
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
    slope, *other_slopes = (slope_of(one.powers) @ np.array(one.coefficients) for one in (alpha, *others))
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
    """A function of powers: by how much each coefficient changes the slope of alpha, (k,).

    The slope is that of a straight line over the angles of normal flight at dp_beta = 0, relative to the slope of
    `alpha` itself.
    """
    x = np.linspace(*x_range, 401)
    angle = alpha(x, np.zeros_like(x))
    x, angle = x[np.abs(angle) <= TUNNEL.slope_range_rad], angle[np.abs(angle) <= TUNNEL.slope_range_rad]
    centered = angle - angle.mean()
    return lambda powers: (centered / (centered @ centered)) @ terms(x, np.zeros_like(x), powers)


def _equal_orders(best: FittedMap, points: int) -> list[int]:
    """Other orders that predict as well as the best within the standard error of an rms of so many points."""
    limit = best.residual_rms * (1 + 1 / np.sqrt(2 * points))
    good = [k for k, rms in enumerate(best.tried_rms, start=1) if rms < limit]
    return [k for k in good if k != best.order]
