"""The five-port probe: a tunnel's measurements to smooth maps, and the maps to flow angles and dynamic pressure.

C_alpha = dp_alpha/q_c and C_beta = dp_beta/q_c, with q_c = p_centre - p_static, do not depend on speed. A polynomial in
the two gives (qbar/q_c)^2, and polynomials in dp_alpha/qbar and dp_beta/qbar the angles. Why these: what the centre
loses at an angle the pairs gain, so qbar^2 is nearly a sum of the squares of the three pressures. That takes a
polynomial of second order, where q_c/qbar takes one of eighth. How nearly, and the rest, comes from the tunnel alone.
"""

import csv
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from msgspec import structs
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.spatial import ConvexHull
from scipy.stats import chi2

from flight.atmosphere import density
from flight.errors import InputError
from flight.json_file import decoded
from flight.units import to_si

Array = NDArray[np.float64]
PAIR_STEP = 0.01  # of a central difference, which is off by a sixth of its square times the third derivative
FORMAT = "flightpower-probe-2"
FIRST_FORMAT = "flightpower-probe-1"  # its angles are polynomials in C_alpha and C_beta, its q_c/qbar is one itself
ORDERS = range(1, 10)
FOLDS = 10
SLOPE_RANGE_RAD = np.radians(10.0)  # flown angles: there the slope of alpha counts
SPEED_STEP = 0.04
LEAST_SUM = 1e-3
ROUNDING_RAD = np.radians(0.5)  # noise beyond the last angle of the tunnel is no other angle


class Surface(msgspec.Struct, frozen=True, kw_only=True):
    """A polynomial in two variables, to a power: (sum of coefficient * x^i * y^j)^exponent."""

    powers: list[tuple[int, int]]
    coefficients: list[float]
    residual_rms: float  # cross-validated; of q_c/qbar as a fraction of it
    order: int
    tried_rms: list[float] = []  # cross-validated, of orders 1, 2, …
    exponent: float = 1.0

    def __call__(self, x: Array, y: Array) -> Array:
        sums: Array = _terms(x, y, self.powers) @ np.array(self.coefficients)
        # Far outside of what was measured a sum may be anything; a power of it stays a number.
        return sums if self.exponent == 1 else np.maximum(sums, LEAST_SUM) ** self.exponent


class ProbeCalibration(msgspec.Struct, frozen=True, kw_only=True):
    """What travels in `probe.json`."""

    format: str
    source: str
    points: int
    alpha_rad: Surface  # over (dp_alpha, dp_beta)/qbar
    beta_rad: Surface
    q_ratio: Surface  # q_c/qbar, over (C_alpha, C_beta)
    alpha_scale_sigma: float  # relative standard error of alpha's slope over +-10 deg, the tunnel's own angles included
    hull: list[tuple[float, float]]  # corners of the calibrated region in (C_alpha, C_beta)
    # The measured region is hollow between its corners, the hull is not: the angles themselves are bounded too.
    alpha_limits_rad: tuple[float, float] | None = None
    beta_limits_rad: tuple[float, float] | None = None

    def maps(self, C_alpha: Array, C_beta: Array) -> tuple[Array, Array, Array]:
        """(alpha [rad], beta [rad], q_c/qbar)."""
        ratio = self.q_ratio(C_alpha, C_beta)
        per_C = 1.0 if self.format == FIRST_FORMAT else ratio
        x, y = C_alpha * per_C, C_beta * per_C
        return self.alpha_rad(x, y), self.beta_rad(x, y), ratio


class Flow(NamedTuple):
    """Flow at the probe; arrays (n,)."""

    qbar_Pa: Array
    alpha_rad: Array
    beta_rad: Array
    inside: NDArray[np.bool_]  # the calibration covers this point
    V_per_pair: Array  # d ln V/d ln(pressure of the pair for angle of attack): a wrong angle takes a wrong q_c/qbar


@dataclass(frozen=True)
class Tunnel:
    """A tunnel calibration's measurements, SI, arrays (n,)."""

    speed_mps: Array
    alpha_rad: Array
    beta_rad: Array
    dp_alpha_Pa: Array
    dp_beta_Pa: Array
    q_c_Pa: Array
    static_Pa: Array
    temperature_K: Array


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


def read_tunnel(path: str | Path) -> Tunnel:
    """A tunnel file: CSV whose header names each column with its unit, `alpha [deg]`.

    Raises InputError naming file and cause.
    """
    path = Path(path)
    try:
        rows = list(csv.reader(path.read_text("utf-8").splitlines()))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    if len(rows) < 2:
        raise InputError(f"{path}: holds no measurements")
    header, *lines = rows
    values: dict[str, Array] = {}
    for i, title in enumerate(header):
        match = re.fullmatch(r"\s*(\w+)\s*\[(.+)\]\s*", title)
        if match is None or match[1] not in _COLUMNS:
            raise InputError(f"{path}: column {title!r}: want one of {', '.join(_COLUMNS)}, each with its [unit]")
        name, unit = _COLUMNS[match[1]]
        zero, one = (to_si(f"{x} {match[2]}", unit, f"{path}: {title}") for x in (0, 1))
        try:
            values[name] = zero + (one - zero) * np.array([float(line[i]) for line in lines])
        except (ValueError, IndexError):
            raise InputError(f"{path}: column {title!r}: not a number in every line") from None
    missing = [title for title, (name, _) in _COLUMNS.items() if name not in values]
    if missing:
        raise InputError(f"{path}: no column {', '.join(missing)}")
    return Tunnel(**values)


def calibrate(tunnel: Tunnel, source: str = "", *, angle_scale_sigma: float = 0.0) -> ProbeCalibration:
    """Smooth maps through a tunnel's measurements, the order of each chosen by cross-validation.

    angle_scale_sigma: how well the tunnel's angles themselves are known, as a fraction (turntable, blockage, walls);
    no measurement in the file shows it.
    Raises InputError when there are too few points, or points without flow.
    """
    qbar = dynamic_pressure(tunnel)
    if len(qbar) < 30:
        raise InputError(f"{source}: {len(qbar)} points are too few to calibrate a probe; 30 at least")
    if np.any(tunnel.q_c_Pa <= 0) or np.any(qbar <= 0):
        raise InputError(f"{source}: q_c and speed must be positive at every point")
    C_alpha, C_beta = tunnel.dp_alpha_Pa / tunnel.q_c_Pa, tunnel.dp_beta_Pa / tunnel.q_c_Pa
    q_ratio, *_ = _fit(C_alpha, C_beta, tunnel.q_c_Pa / qbar, qbar, exponent=-0.5)
    ratio = q_ratio(C_alpha, C_beta)
    x, y = C_alpha * ratio, C_beta * ratio
    alpha, alpha_covariance, weight = _fit(x, y, tunnel.alpha_rad, qbar)
    beta, *_ = _fit(x, y, tunnel.beta_rad, qbar)
    corners = np.column_stack([C_alpha, C_beta])[ConvexHull(np.column_stack([C_alpha, C_beta])).vertices]
    by_coefficient = _slope_of(alpha, (float(x.min()), float(x.max())))
    noise = np.sqrt(by_coefficient(alpha.powers) @ alpha_covariance @ by_coefficient(alpha.powers))
    others = [_polynomial(x, y, tunnel.alpha_rad, weight, order)[0] for order in _neighbours(alpha, len(qbar))]
    slope, *other_slopes = (by_coefficient(s.powers) @ np.array(s.coefficients) for s in (alpha, *others))
    form = max((abs(other - slope) for other in other_slopes), default=0.0)
    with_speed = speed_dependence(tunnel, alpha(x, y) - tunnel.alpha_rad, tunnel.alpha_rad)
    return ProbeCalibration(
        format=FORMAT,
        source=source,
        points=len(qbar),
        alpha_rad=alpha,
        beta_rad=beta,
        q_ratio=q_ratio,
        alpha_scale_sigma=float(np.sqrt(noise**2 + form**2 + with_speed.spread**2 + angle_scale_sigma**2)),
        hull=[(float(a), float(b)) for a, b in corners],
        alpha_limits_rad=(float(tunnel.alpha_rad.min()), float(tunnel.alpha_rad.max())),
        beta_limits_rad=(float(tunnel.beta_rad.min()), float(tunnel.beta_rad.max())),
    )


def dynamic_pressure(tunnel: Tunnel) -> Array:
    """The free stream's, from speed and density [Pa]."""
    return np.asarray(density(tunnel.static_Pa, tunnel.temperature_K) * tunnel.speed_mps**2 / 2)


class AtSpeed(NamedTuple):
    """What an angle's residual does at one tunnel speed: at zero angle [rad], and with the angle, with its error."""

    speed_mps: float
    points: int
    offset_rad: float
    slope: float
    slope_error: float


class SpeedDependence(NamedTuple):
    """Whether the slope of an angle depends on speed."""

    speeds: list[AtSpeed]
    chi_squared: float  # of the slopes about their mean
    spread: float  # standard deviation of the slope from speed to speed, beyond noise; 0 where that explains it

    @property
    def significant(self) -> bool:
        return self.spread > 0


def speed_dependence(tunnel: Tunnel, residual_rad: Array, angle_rad: Array) -> SpeedDependence:
    """The residual of an angle's map, speed by speed, within SLOPE_RANGE."""
    small = np.abs(angle_rad) <= SLOPE_RANGE_RAD
    groups = _speeds(tunnel.speed_mps)
    found = []
    for group in range(groups.max() + 1):
        mine = small & (groups == group)
        x, y = angle_rad[mine], residual_rad[mine]
        if len(x) < 5 or np.ptp(x) == 0:
            continue
        x_mean = x - x.mean()
        slope = float(x_mean @ y / (x_mean @ x_mean))
        left = y - y.mean() - slope * x_mean
        error = float(np.sqrt(left @ left / (len(x) - 2) / (x_mean @ x_mean)))
        offset = float(y.mean() - slope * x.mean())
        found.append(AtSpeed(float(tunnel.speed_mps[mine].mean()), len(x), offset, slope, error))
    if len(found) < 2:
        return SpeedDependence(found, 0.0, 0.0)
    slopes, errors = np.array([f.slope for f in found]), np.array([f.slope_error for f in found])
    mean = np.average(slopes, weights=1 / errors**2)
    chi_squared = float(np.sum(((slopes - mean) / errors) ** 2))
    if chi_squared < chi2.ppf(0.99, len(found) - 1):
        return SpeedDependence(found, chi_squared, 0.0)
    beyond = max(float(np.var(slopes, ddof=1) - np.mean(errors**2)), 0.0)
    return SpeedDependence(found, chi_squared, float(np.sqrt(beyond)))


def _speeds(speed_mps: Array) -> NDArray[np.int64]:
    """Which of the tunnel's speeds each point belongs to: a step of SPEED_STEP begins another."""
    order = np.argsort(speed_mps)
    steps = np.diff(speed_mps[order]) > SPEED_STEP * speed_mps[order][:-1]
    group = np.empty(len(order), dtype=np.int64)
    group[order] = np.concatenate([[0], np.cumsum(steps)])
    return group


def _slope_of(alpha: Surface, x_range: tuple[float, float]) -> Callable[[list[tuple[int, int]]], Array]:
    """What coefficients of given powers make of alpha's slope: of a straight line over SLOPE_RANGE without dp_beta.

    Relative to the slope of `alpha` itself, which is taken for one.
    """
    x = np.linspace(*x_range, 401)
    angle = alpha(x, np.zeros_like(x))
    x, angle = x[np.abs(angle) <= SLOPE_RANGE_RAD], angle[np.abs(angle) <= SLOPE_RANGE_RAD]
    centred = angle - angle.mean()
    return lambda powers: (centred / (centred @ centred)) @ _terms(x, np.zeros_like(x), powers)


def _neighbours(surface: Surface, points: int) -> list[int]:
    """Orders whose error is larger by less than an rms of so many points is known to: what they differ by is open."""
    limit = surface.residual_rms * (1 + 1 / np.sqrt(2 * points))
    good = [k for k, rms in enumerate(surface.tried_rms, start=1) if rms < limit]
    return [k for k in good if k != surface.order]


def flow_at_probe(probe: ProbeCalibration, dp_alpha_Pa: Array, dp_beta_Pa: Array, q_c_Pa: Array) -> Flow:
    """Dynamic pressure and flow angles from the three pressures; NaN where there is no flow (q_c <= 0)."""
    q_c = np.where(q_c_Pa > 0, q_c_Pa, np.nan)
    C_alpha, C_beta = dp_alpha_Pa / q_c, dp_beta_Pa / q_c
    inside = _inside(np.array(probe.hull), C_alpha, C_beta)
    alpha, beta, ratio = probe.maps(C_alpha, C_beta)
    for angle, limits in ((alpha, probe.alpha_limits_rad), (beta, probe.beta_limits_rad)):
        if limits is not None:
            inside &= (angle > limits[0] - ROUNDING_RAD) & (angle < limits[1] + ROUNDING_RAD)
    less, more = (probe.q_ratio(C_alpha * factor, C_beta) for factor in (1 - PAIR_STEP, 1 + PAIR_STEP))
    return Flow(q_c / ratio, alpha, beta, inside, -(more - less) / (4 * PAIR_STEP * ratio))


def parse_probe(data: bytes, where: str) -> ProbeCalibration:
    """The calibration of a `probe.json`. Raises InputError naming `where`."""
    return decoded(data, ProbeCalibration, (FORMAT, FIRST_FORMAT), where, "a probe calibration")


def load_probe(path: Path) -> ProbeCalibration:
    """The calibration of a file. Raises InputError naming it."""
    try:
        return parse_probe(path.read_bytes(), str(path))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def _powers(order: int) -> list[tuple[int, int]]:
    return [(i, total - i) for total in range(order + 1) for i in range(total, -1, -1)]


def _terms(x: Array, y: Array, powers: list[tuple[int, int]]) -> Array:
    return np.stack([x**i * y**j for i, j in powers], axis=-1)


def _fit(x: Array, y: Array, target: Array, qbar_Pa: Array, exponent: float = 1.0) -> tuple[Surface, Array, Array]:
    """The surface whose order predicts left-out points best, the covariance of its coefficients, and its weights.

    exponent: of a surface other than a plain polynomial; its errors count as fractions of the target.
    """
    sums = target ** (1 / exponent)
    unit = _unit(sums, exponent)
    first, _ = _of_best_order(x, y, sums, _even(qbar_Pa) / unit)
    smooth = structs.replace(first, exponent=1.0)(x, y)
    unit = _unit(smooth, exponent)  # by the measured ones, those that happen to be small would count for more
    weight = _even(1 / _noise((sums - smooth) / unit, qbar_Pa)) / unit
    surface, covariance = _of_best_order(x, y, sums, weight)
    return structs.replace(surface, exponent=exponent), covariance, weight


def _unit(sums: Array, exponent: float) -> Array:
    """By how much a sum changes for an error of one: of the target, or of a fraction of it where it is a power."""
    return np.ones_like(sums) if exponent == 1 else np.abs(sums / exponent)


def _even(weight: Array) -> Array:
    """Weights whose mean square is one."""
    return weight / np.sqrt(np.mean(weight**2))


def _noise(residual: Array, qbar_Pa: Array) -> Array:
    """Standard deviation of each point: the tunnel's settings, the same everywhere, and pressures, constant in pascals.

    Maximum likelihood of the two variances, for normal residuals.
    """
    parts = np.stack([np.ones_like(qbar_Pa), (np.mean(qbar_Pa) / qbar_Pa) ** 2], axis=-1)
    variance: Array = np.full_like(residual, np.mean(residual**2))
    for _ in range(5):
        variance = parts @ nnls(parts / variance[:, None], residual**2 / variance)[0]
    return np.sqrt(variance)


def _of_best_order(x: Array, y: Array, target: Array, weight: Array) -> tuple[Surface, Array]:
    """The polynomial whose order predicts left-out points best, and the covariance of its coefficients."""
    fold = np.random.default_rng(0).permutation(len(target)) % FOLDS
    best, best_rms, tried = 0, np.inf, []
    for order in ORDERS:
        X = _terms(x, y, _powers(order)) * weight[:, None]
        if X.shape[1] > 0.5 * len(target):
            break
        rms = _left_out_rms(X, target * weight, fold)
        tried.append(rms)
        if rms < 0.99 * best_rms:  # a higher order has to earn its keep
            best, best_rms = order, rms
    surface, covariance = _polynomial(x, y, target, weight, best)
    return structs.replace(surface, residual_rms=best_rms, tried_rms=tried), covariance


def _polynomial(x: Array, y: Array, target: Array, weight: Array, order: int) -> tuple[Surface, Array]:
    """The polynomial of an order, and the covariance of its coefficients whatever the noise of each point is (HC1)."""
    powers = _powers(order)
    X = _terms(x, y, powers) * weight[:, None]
    coefficients, *_ = np.linalg.lstsq(X, target * weight, rcond=None)
    residual = X @ coefficients - target * weight
    spread = np.linalg.pinv(X) * residual
    covariance = spread @ spread.T * (len(target) / (len(target) - len(powers)))
    rms = float(np.sqrt(np.mean(residual**2)))
    return Surface(powers=powers, coefficients=coefficients.tolist(), residual_rms=rms, order=order), covariance


def _left_out_rms(X: Array, y: Array, fold: NDArray[np.int64]) -> float:
    """Rms error of each fold's prediction by a fit to the others: residuals over I - H, exact without refitting."""
    Q, _ = np.linalg.qr(X)
    residual = y - Q @ (Q.T @ y)
    total = 0.0
    for k in range(FOLDS):
        mine = Q[fold == k]
        left_out = np.linalg.solve(np.eye(len(mine)) - mine @ mine.T, residual[fold == k])
        total += float(left_out @ left_out)
    return float(np.sqrt(total / len(y)))


def _inside(corners: Array, x: Array, y: Array) -> NDArray[np.bool_]:
    """Whether points lie in a convex polygon given counter-clockwise (as ConvexHull gives it)."""
    inside = np.isfinite(x) & np.isfinite(y)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside &= (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) >= 0
    return inside
