"""The five-port probe: a tunnel's measurements to smooth maps, and the maps to flow angles and dynamic pressure.

C_alpha = dp_alpha/q_c and C_beta = dp_beta/q_c, with q_c = p_centre - p_static, do not depend on speed; polynomials in
the two give alpha, beta and q_c/qbar. Nothing here knows how a probe works: the form comes from the tunnel alone.
"""

import csv
import re
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from flight.atmosphere import density
from flight.errors import InputError
from flight.units import to_si

Array = NDArray[np.float64]
FORMAT = "flightpower-probe-1"
ORDERS = range(1, 10)
FOLDS = 10


class Surface(msgspec.Struct, frozen=True, kw_only=True):
    """A polynomial in (C_alpha, C_beta): sum of coefficient * C_alpha^i * C_beta^j."""

    powers: list[tuple[int, int]]
    coefficients: list[float]
    residual_rms: float  # cross-validated
    order: int

    def __call__(self, C_alpha: Array, C_beta: Array) -> Array:
        return _terms(C_alpha, C_beta, self.powers) @ np.array(self.coefficients)


class ProbeCalibration(msgspec.Struct, frozen=True, kw_only=True):
    """What travels in `probe.json`."""

    format: str
    source: str
    points: int
    alpha_rad: Surface
    beta_rad: Surface
    q_ratio: Surface  # q_c/qbar
    alpha_scale_sigma: float  # relative standard error of the slope of alpha at small angles
    hull: list[tuple[float, float]]  # corners of the calibrated region in (C_alpha, C_beta)


class Flow(NamedTuple):
    """Flow at the probe; arrays (n,)."""

    qbar_Pa: Array
    alpha_rad: Array
    beta_rad: Array
    inside: NDArray[np.bool_]  # the calibration covers this point


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


def calibrate(tunnel: Tunnel, source: str = "") -> ProbeCalibration:
    """Smooth maps through a tunnel's measurements, the order of each chosen by cross-validation.

    Raises InputError when there are too few points, or points without flow.
    """
    qbar = density(tunnel.static_Pa, tunnel.temperature_K) * tunnel.speed_mps**2 / 2
    if len(qbar) < 30:
        raise InputError(f"{source}: {len(qbar)} points are too few to calibrate a probe; 30 at least")
    if np.any(tunnel.q_c_Pa <= 0) or np.any(qbar <= 0):
        raise InputError(f"{source}: q_c and speed must be positive at every point")
    C_alpha, C_beta = tunnel.dp_alpha_Pa / tunnel.q_c_Pa, tunnel.dp_beta_Pa / tunnel.q_c_Pa
    # Pressure noise is constant in pascals, so coefficients are worth as much as their dynamic pressure.
    weight = tunnel.q_c_Pa / np.mean(tunnel.q_c_Pa)
    alpha, alpha_covariance = _fit(C_alpha, C_beta, tunnel.alpha_rad, weight)
    beta, _ = _fit(C_alpha, C_beta, tunnel.beta_rad, weight)
    q_ratio, _ = _fit(C_alpha, C_beta, tunnel.q_c_Pa / qbar, weight)
    slope = alpha.powers.index((1, 0))
    corners = np.column_stack([C_alpha, C_beta])[ConvexHull(np.column_stack([C_alpha, C_beta])).vertices]
    return ProbeCalibration(
        format=FORMAT,
        source=source,
        points=len(qbar),
        alpha_rad=alpha,
        beta_rad=beta,
        q_ratio=q_ratio,
        alpha_scale_sigma=float(np.sqrt(alpha_covariance[slope, slope]) / abs(alpha.coefficients[slope])),
        hull=[(float(a), float(b)) for a, b in corners],
    )


def flow_at_probe(probe: ProbeCalibration, dp_alpha_Pa: Array, dp_beta_Pa: Array, q_c_Pa: Array) -> Flow:
    """Dynamic pressure and flow angles from the three pressures; NaN where there is no flow (q_c <= 0)."""
    q_c = np.where(q_c_Pa > 0, q_c_Pa, np.nan)
    C_alpha, C_beta = dp_alpha_Pa / q_c, dp_beta_Pa / q_c
    inside = _inside(np.array(probe.hull), C_alpha, C_beta)
    return Flow(
        qbar_Pa=q_c / probe.q_ratio(C_alpha, C_beta),
        alpha_rad=probe.alpha_rad(C_alpha, C_beta),
        beta_rad=probe.beta_rad(C_alpha, C_beta),
        inside=inside,
    )


def parse_probe(data: bytes, where: str) -> ProbeCalibration:
    """The calibration of a `probe.json`. Raises InputError naming `where`."""
    try:
        probe = msgspec.json.decode(data, type=ProbeCalibration)
    except msgspec.MsgspecError as error:
        raise InputError(f"{where}: not a probe calibration ({error})") from None
    if probe.format != FORMAT:
        raise InputError(f"{where}: format {probe.format!r} is not understood here ({FORMAT} is)")
    return probe


def _powers(order: int) -> list[tuple[int, int]]:
    return [(i, total - i) for total in range(order + 1) for i in range(total, -1, -1)]


def _terms(C_alpha: Array, C_beta: Array, powers: list[tuple[int, int]]) -> Array:
    return np.stack([C_alpha**i * C_beta**j for i, j in powers], axis=-1)


def _fit(C_alpha: Array, C_beta: Array, target: Array, weight: Array) -> tuple[Surface, Array]:
    """The polynomial whose order predicts left-out points best, and the covariance of its coefficients."""
    fold = np.random.default_rng(0).permutation(len(target)) % FOLDS
    best, best_rms = 0, np.inf
    for order in ORDERS:
        X = _terms(C_alpha, C_beta, _powers(order))
        if X.shape[1] > 0.5 * len(target):
            break
        error = np.empty_like(target)
        for k in range(FOLDS):
            train, test = fold != k, fold == k
            c, *_ = np.linalg.lstsq(X[train] * weight[train, None], target[train] * weight[train], rcond=None)
            error[test] = X[test] @ c - target[test]
        rms = float(np.sqrt(np.average(error**2, weights=weight**2)))
        if rms < 0.99 * best_rms:  # a higher order has to earn its keep
            best, best_rms = order, rms
    powers = _powers(best)
    X = _terms(C_alpha, C_beta, powers) * weight[:, None]
    coefficients, *_ = np.linalg.lstsq(X, target * weight, rcond=None)
    variance = np.sum((X @ coefficients - target * weight) ** 2) / (len(target) - len(powers))
    covariance = variance * np.linalg.pinv(X.T @ X)
    surface = Surface(powers=powers, coefficients=coefficients.tolist(), residual_rms=best_rms, order=best)
    return surface, covariance


def _inside(corners: Array, x: Array, y: Array) -> NDArray[np.bool_]:
    """Whether points lie in a convex polygon given counter-clockwise (as ConvexHull gives it)."""
    inside = np.isfinite(x) & np.isfinite(y)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside &= (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) >= 0
    return inside
