"""Hard and soft iron of a magnetometer, from turning it about: a sphere that became an ellipsoid, made a sphere again.

The earth's field has one strength whichever way the aircraft points. Magnets aboard add a constant vector (hard iron),
steel and currents' loops stretch the field (soft iron): A (m - b) has one length again, |A (m - b)| = F. A rotation in
A cannot be seen by lengths alone, so A is symmetric; its mean diagonal is one, so that F is in tesla.
"""

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from flight.errors import InputError

Array = NDArray[np.float64]

FORMAT = "flightpower-magnetometer-1"
# What is assumed before anything is seen: a turn alone shows a circle of the sphere, which many ellipsoids share.
HARD_IRON_T, SOFT_IRON = 30e-6, 0.05
FIELD_T, FIELD_SIGMA_T = 48e-6, 10e-6  # anywhere on earth it is 22 to 67 uT (World Magnetic Model)
EARTH_T = (18e-6, 75e-6)
FEWEST = 100
CORRELATED = 5  # neighbouring samples share the errors of the model: count so many as one


class MagnetometerCalibration(msgspec.Struct, frozen=True, kw_only=True):
    """What stands in `magnetometer.json`: corrected = soft_iron (measured - hard_iron), body axes."""

    format: str = FORMAT
    source: str
    samples: int
    hard_iron_T: tuple[float, float, float]
    hard_iron_error_T: tuple[float, float, float]  # 1 sigma
    soft_iron: tuple[tuple[float, float, float], ...]  # (3, 3), symmetric
    soft_iron_error: float  # largest 1 sigma among its elements
    field_T: float
    residual_before_T: float  # rms of the field's strength about its mean, as measured
    residual_T: float  # and corrected
    directions: float  # smallest spread of the measured directions along any axis; 0.58 is all round, 0 a plane

    def corrected(self, field_T: Array) -> Array:
        """Flux density without the aircraft's own iron; (n, 3) to (n, 3)."""
        return (field_T - np.array(self.hard_iron_T)) @ np.array(self.soft_iron).T


def calibrate(field_T: Array, source: str = "") -> MagnetometerCalibration:
    """Hard and soft iron from measurements in many directions, (n, 3) [T].

    Raises InputError when there are too few, or when they are no magnetic field.
    """
    field = field_T[np.isfinite(field_T).all(axis=1)]
    if len(field) < FEWEST:
        raise InputError(
            f"{source}: {len(field)} magnetometer samples are too few; {FEWEST} at least, in many directions"
        )
    strength = np.linalg.norm(field, axis=1)
    sigma = 1e-6
    for _ in range(2):  # the second time with the noise that the first one found
        start = np.concatenate([np.zeros(8), [np.median(strength) / HARD_IRON_T]])
        fit = least_squares(_residuals, start, args=(field, sigma), x_scale="jac")
        left = _lengths(fit.x, field) - fit.x[8] * HARD_IRON_T
        sigma = max(float(np.std(left)) * np.sqrt(CORRELATED), 1e-9)
    jacobian = np.asarray(fit.jac)
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    error = np.sqrt(np.diag(covariance))
    F = float(fit.x[8] * HARD_IRON_T)
    if not EARTH_T[0] < F < EARTH_T[1]:
        raise InputError(
            f"{source}: the field comes out as {1e6 * F:.0f} uT, which is nowhere on earth ({1e6 * EARTH_T[0]:.0f} to"
            f" {1e6 * EARTH_T[1]:.0f}): turn the aircraft through more directions, away from iron and motors"
        )
    A, b = _matrix(fit.x), fit.x[:3] * HARD_IRON_T
    unit = (field - b) @ A.T / np.linalg.norm((field - b) @ A.T, axis=1)[:, None]
    return MagnetometerCalibration(
        source=source,
        samples=len(field),
        hard_iron_T=tuple(b.tolist()),
        hard_iron_error_T=tuple((error[:3] * HARD_IRON_T).tolist()),
        soft_iron=tuple(tuple(row) for row in A.tolist()),
        soft_iron_error=float(error[3:8].max() * SOFT_IRON),
        field_T=F,
        residual_before_T=float(np.std(strength)),
        residual_T=float(np.std(left)),
        directions=float(np.sqrt(np.linalg.eigvalsh(np.cov(unit.T))[0])),
    )


def _residuals(x: Array, field: Array, sigma: float) -> Array:
    """How far each sample lies from the ellipsoid, in sigmas, and the assumptions.

    Divided by the length's gradient: else a matrix that shrinks the noise would pass for one that fits.
    """
    A = _matrix(x)
    lengths = _lengths(x, field)
    outward = (field - x[:3] * HARD_IRON_T) @ A.T @ A / lengths[:, None]
    lengths = (lengths - x[8] * HARD_IRON_T) / (sigma * np.linalg.norm(outward, axis=1))
    assumed = np.append(x[:8], (x[8] * HARD_IRON_T - FIELD_T) / FIELD_SIGMA_T)  # in their standard deviations
    return np.concatenate([lengths, assumed])


def _lengths(x: Array, field: Array) -> Array:
    return np.linalg.norm((field - x[:3] * HARD_IRON_T) @ _matrix(x).T, axis=1)


def _matrix(x: Array) -> Array:
    xx, yy, xy, xz, yz = x[3:8] * SOFT_IRON
    return np.eye(3) + np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, -xx - yy]])
