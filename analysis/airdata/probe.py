"""The calibration of a five-port probe: the file `probe.json`, and the flow at the probe from its pressures.

C_alpha = dp_alpha/q_c and C_beta = dp_beta/q_c, with q_c = p_center - p_static, do not depend on speed. A polynomial in
the two gives (qbar/q_c)^2; polynomials in dp_alpha/qbar and dp_beta/qbar give the angles. The reason: the pressure that
the center port loses at an angle appears at the pairs of side ports, so qbar^2 is nearly a sum of squares of the three
pressures. That takes a polynomial of second order, q_c/qbar itself would take one of eighth order. The coefficients and
all deviations come from the tunnel.
"""

from typing import NamedTuple

import msgspec
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.polynomial_map import FittedMap
from analysis.airdata.settings import MAP
from flight.files import JsonFormat
from flight.probe_maps import FIRST_FORMAT, FORMATS

Array = NDArray[np.float64]


class ProbeCalibration(msgspec.Struct, frozen=True, kw_only=True):
    """The content of `probe.json`."""

    format: str
    source: str
    points: int
    alpha_rad: FittedMap  # over (dp_alpha, dp_beta)/qbar
    beta_rad: FittedMap
    q_ratio: FittedMap  # q_c/qbar, over (C_alpha, C_beta)
    alpha_scale_sigma: float  # relative standard error of alpha's slope over +-10 deg, the tunnel's own angles included
    hull: list[tuple[float, float]]  # corners of the calibrated region in (C_alpha, C_beta)
    # The hull is convex, the measured region is not. So the angles themselves are limited, too.
    alpha_limits_rad: tuple[float, float] | None = None
    beta_limits_rad: tuple[float, float] | None = None

    def maps(self, C_alpha: Array, C_beta: Array) -> tuple[Array, Array, Array]:
        """(alpha [rad], beta [rad], q_c/qbar), each (n,)."""
        ratio = self.q_ratio(C_alpha, C_beta)
        per_C = 1.0 if self.format == FIRST_FORMAT else ratio
        x, y = C_alpha * per_C, C_beta * per_C
        return self.alpha_rad(x, y), self.beta_rad(x, y), ratio


PROBE_FILE = JsonFormat(ProbeCalibration, FORMATS, "a probe calibration")


class ProbeFlow(NamedTuple):
    """Flow at the probe; arrays (n,)."""

    qbar_Pa: Array
    alpha_rad: Array
    beta_rad: Array
    inside: NDArray[np.bool_]  # the calibration covers this point
    dalpha_dlndp_alpha_rad: Array  # an error of dp_alpha changes the angle of attack,
    dlnV_dlndp_alpha: Array  # and q_c/qbar, and so the airspeed


def flow_at_probe(
    probe: ProbeCalibration, dp_alpha_Pa: Array, dp_beta_Pa: Array, q_c_Pa: Array, samples: int = 1
) -> ProbeFlow:
    """Dynamic pressure and flow angles from the three pressures, (n,); NaN where there is no flow (q_c <= 0).

    The maps are curved, and the mean of a curved function of a noisy number is biased. So they are evaluated at the
    mean of dp_alpha and dp_beta over so many samples, and angles are linear in the deviation from it. `inside` is that
    of the means: leaving out what only noise takes out of the calibrated range would lower the angle of slow flight.
    """
    q_c = np.where(q_c_Pa > 0, q_c_Pa, np.nan)
    C_alpha, C_beta = (_moving_mean(dp, samples) / q_c for dp in (dp_alpha_Pa, dp_beta_Pa))
    inside = _inside(np.array(probe.hull), C_alpha, C_beta)
    alpha, beta, ratio = probe.maps(C_alpha, C_beta)
    if samples > 1:
        inside &= np.isfinite(dp_alpha_Pa) & np.isfinite(dp_beta_Pa)
        h = 0.02  # of central differences of the angles
        higher, lower = (probe.maps(C_alpha + step, C_beta) for step in (h, -h))
        alpha = alpha + (higher[0] - lower[0]) / (2 * h) * (dp_alpha_Pa / q_c - C_alpha)
        higher, lower = (probe.maps(C_alpha, C_beta + step) for step in (h, -h))
        beta = beta + (higher[1] - lower[1]) / (2 * h) * (dp_beta_Pa / q_c - C_beta)
    for angle, limits in ((alpha, probe.alpha_limits_rad), (beta, probe.beta_limits_rad)):
        if limits is not None:
            inside &= (angle > limits[0] - MAP.angle_margin_rad) & (angle < limits[1] + MAP.angle_margin_rad)
    h = 0.01  # relative, of a central difference; its error is a sixth of its square times the third derivative
    less, more = (probe.maps(C_alpha * factor, C_beta) for factor in (1 - h, 1 + h))
    dalpha, _, dratio = ((b - a) / (2 * h) for a, b in zip(less, more, strict=True))
    return ProbeFlow(q_c / ratio, alpha, beta, inside, dalpha, -dratio / (2 * ratio))


def _moving_mean(values: Array, samples: int) -> Array:
    return pd.Series(values).rolling(samples, center=True, min_periods=1).mean().to_numpy()


def _inside(corners: Array, x: Array, y: Array) -> NDArray[np.bool_]:
    """Whether points lie in a convex polygon given counter-clockwise (as ConvexHull gives it)."""
    inside = np.isfinite(x) & np.isfinite(y)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside &= (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) >= 0
    return inside
