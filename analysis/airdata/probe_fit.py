"""Fits a probe's calibration to a tunnel's measurements, and estimates the error of the slope of alpha."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from analysis.airdata.polynomial_map import PolynomialMap, Powers, fit_map, polynomial_of_order, terms
from analysis.airdata.probe import FORMAT, ProbeCalibration
from analysis.airdata.speed_dependence import SLOPE_RANGE_RAD, speed_dependence
from analysis.airdata.tunnel import TunnelData, dynamic_pressure
from flight.errors import InputError

Array = NDArray[np.float64]
FEWEST_POINTS = 30
HIGHEST_SPEED_MPS = 150.0  # the air is taken as incompressible
LEAST_PREDICTED = 0.9  # of the angles' variance, at points left out (predictive R^2)
LARGEST_SLOPE_SIGMA = 0.1  # relative standard error of the slope of alpha, beyond which it is not determined


def calibrate(tunnel: TunnelData, source: str = "", *, angle_scale_sigma: float = 0.0) -> ProbeCalibration:
    """Smooth maps through a tunnel's measurements, the order of each chosen by cross-validation.

    angle_scale_sigma: relative standard error of the tunnel's own angles (turntable, blockage, walls). The measurements
    do not show it.
    Raises InputError if there are too few points, points without flow or at one angle only, or if they do not support
    a calibration: the maps predict less than LEAST_PREDICTED of the variance of alpha or beta at points left out, or
    the standard error of the slope of alpha exceeds LARGEST_SLOPE_SIGMA.
    """
    if np.any(tunnel.speed_mps > HIGHEST_SPEED_MPS):
        raise InputError(f"{source}: speeds above {HIGHEST_SPEED_MPS:.0f} m/s; is their unit right?")
    qbar = dynamic_pressure(tunnel)
    if len(qbar) < FEWEST_POINTS:
        raise InputError(f"{source}: {len(qbar)} points are too few to calibrate a probe; {FEWEST_POINTS} are needed")
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
        if fitted.residual_rms**2 > (1 - LEAST_PREDICTED) * spread**2:
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
    if sigma > LARGEST_SLOPE_SIGMA and angle_scale_sigma <= LARGEST_SLOPE_SIGMA:
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


def _slope_by_coefficient(alpha: PolynomialMap, x_range: tuple[float, float]) -> Callable[[Powers], Array]:
    """A function of powers: by how much each coefficient changes the slope of alpha, (k,).

    The slope is that of a straight line over SLOPE_RANGE_RAD at dp_beta = 0, relative to the slope of `alpha` itself.
    """
    x = np.linspace(*x_range, 401)
    angle = alpha(x, np.zeros_like(x))
    x, angle = x[np.abs(angle) <= SLOPE_RANGE_RAD], angle[np.abs(angle) <= SLOPE_RANGE_RAD]
    centered = angle - angle.mean()
    return lambda powers: (centered / (centered @ centered)) @ terms(x, np.zeros_like(x), powers)


def _equal_orders(best: PolynomialMap, points: int) -> list[int]:
    """Other orders that predict as well as the best within the standard error of an rms of so many points."""
    limit = best.residual_rms * (1 + 1 / np.sqrt(2 * points))
    good = [k for k, rms in enumerate(best.tried_rms, start=1) if rms < limit]
    return [k for k in good if k != best.order]
