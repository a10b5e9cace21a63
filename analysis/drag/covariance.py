"""What every method's covariance of the drag polar (A0, A1, A2) has to contain."""

import numpy as np
from numpy.typing import NDArray

from analysis.drag.polar import Polar
from analysis.estimation import uncertainty
from analysis.estimation.output_error import Fit

Array = NDArray[np.float64]
# Intervals in still air have the right coverage without any floor.
FLOOR_RAD = np.radians(0.02)


def of_noise(fit: Fit) -> Array:
    """Covariance of all estimates by noise: per parameter the larger of those for white and for colored residuals.

    Colored residuals make estimates several times less certain than white ones of the same size,
    but a short record can fail to show its color.
    """
    white, colored = uncertainty.cramer_rao(fit).covariance, uncertainty.morelli_klein(fit).covariance
    scale = np.maximum(1.0, np.sqrt(np.diag(white) / np.diag(colored)))
    return np.asarray(colored * np.outer(scale, scale))


def floor() -> Array:
    """Covariance (3, 3) of A for a direction of lift that is known no better than FLOOR_RAD, which no residual shows.

    Lift tilted by that angle adds D = L tan(FLOOR_RAD), a C_D proportional to C_L: a variance of A1.
    """
    covariance = np.zeros((3, 3))
    covariance[1, 1] = np.tan(FLOOR_RAD) ** 2
    return covariance


def polar_of(fit: Fit) -> Polar:
    """The drag polar of a fit with parameters A0, A1, A2; its covariance contains noise and floor."""
    where = [fit.names.index(name) for name in ("A0", "A1", "A2")]
    return Polar(fit.values[where], of_noise(fit)[np.ix_(where, where)] + floor())
