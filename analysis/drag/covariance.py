"""What every method's covariance of the polar (A0, A1, A2) has to contain."""

import numpy as np
from numpy.typing import NDArray

from analysis.drag.polar import Polar
from analysis.estimation import uncertainty
from analysis.estimation.output_error import Fit

Array = NDArray[np.float64]
# The method's study had 0.05 deg, for errors twice as large. In simulation calm intervals cover without any.
FLOOR_RAD = np.radians(0.02)


def of_noise(fit: Fit) -> Array:
    """Covariance of all estimates: the larger of what white and what coloured residuals give.

    Coloured residuals make estimates several times less certain than white ones of the same size (method section 4),
    but a short record can also hide its colour: so the larger one counts.
    """
    white, coloured = uncertainty.cramer_rao(fit).covariance, uncertainty.morelli_klein(fit).covariance
    scale = np.maximum(1.0, np.sqrt(np.diag(white) / np.diag(coloured)))
    return coloured * np.outer(scale, scale)


def floor(fit: Fit) -> Array:
    """The covariance of what no fit can see: a direction known to FLOOR_RAD.

    Force across it, D = L tan(FLOOR_RAD), is a C_D proportional to C_L, so it is a variance of A1.
    """
    covariance = np.zeros((len(fit.names), len(fit.names)))
    A1 = fit.names.index("A1")
    covariance[A1, A1] = np.tan(FLOOR_RAD) ** 2
    return covariance


def polar_of(fit: Fit) -> Polar:
    """The drag polar of a fit that has A0, A1, A2 among its shared numbers, with the covariance of noise and floor."""
    where = [fit.names.index(name) for name in ("A0", "A1", "A2")]
    whole = of_noise(fit) + floor(fit)
    return Polar(fit.values[where], whole[np.ix_(where, where)])
