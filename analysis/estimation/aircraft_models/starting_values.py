"""Starting values from the data: aerodynamic parameters by least squares, and the initial state of level flight."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.estimation.aircraft_models.parameters import Constants, Priors, aerodynamic_parameters
from analysis.estimation.data import Segment
from flight.aerodynamics import stability_axes
from flight.aircraft import Aircraft

Array = NDArray[np.float64]


def starting_values(aircraft: Aircraft, segments: Segment | Sequence[Segment], CLde: float = 0.4) -> dict[str, float]:
    """Starting values of CL0, CLa, A0, A1, A2: CL and CD of each sample, and a least-squares line and parabola.

    Biases of the sensors and noise in the regressors are ignored. Where lift falls with alpha, or the parabola is
    unphysical (A0 <= 0 or A2 <= 0), the default starting values remain.
    """
    c = Constants.of(aircraft)
    segments = (segments,) if isinstance(segments, Segment) else tuple(segments)

    def pooled(name: str) -> Array:
        return np.concatenate([segment.z[name] if name in segment.z else segment.u[name] for segment in segments])

    V, alpha, ax, az = (pooled(name) for name in ("V", "alpha", "ax", "az"))
    qS = pooled("rho") * V**2 / 2 * c.S
    CL, CD = stability_axes((c.m * ax - pooled("thrust")) / qS, c.m * az / qS, alpha)
    good = np.isfinite(CL) & np.isfinite(CD) & (qS > 0)
    CL, CD, alpha, elevator = CL[good], CD[good], alpha[good], pooled("elevator")[good]
    start = {q.name: q.start for q in aerodynamic_parameters(c, Priors()) if q.free and q.name != "CLde"}
    if len(CL) < len(start):
        return start
    line = np.linalg.lstsq(np.stack([np.ones_like(alpha), alpha], axis=1), CL - CLde * elevator, rcond=None)[0]
    if line[1] > 0:
        start |= {"CL0": float(line[0]), "CLa": float(line[1])}
    polar = np.linalg.lstsq(np.stack([np.ones_like(CL), CL, CL**2], axis=1), CD, rcond=None)[0]
    if polar[0] > 0 and polar[2] > 0:
        start |= {name: float(value) for name, value in zip(("A0", "A1", "A2"), polar, strict=True)}
    return start


def level_flight_state(segment: Segment) -> Mapping[str, float]:
    """V, alpha, theta, q, h at a segment's start, from its first second: theta = alpha + climb angle, q = 0.

    States without data are left out.
    """
    first_second = slice(0, max(2, round(1 / segment.step_s)))
    t = segment.t_s[first_second] - segment.t_s[0]

    def line(name: str) -> tuple[float, float]:
        """(value, slope) at the start, of a least-squares line; NaN with fewer than two samples."""
        if name not in segment.z:
            return np.nan, np.nan
        values = segment.z[name][first_second]
        good = np.isfinite(values)
        if good.sum() < 2:
            return np.nan, np.nan
        slope, value = np.polyfit(t[good], values[good], 1)
        return float(value), float(slope)

    (V, _), (alpha, _), (h, hdot) = line("V"), line("alpha"), line("h")
    theta = alpha + np.arcsin(np.clip(hdot / V, -1, 1))
    state = {"V": V, "alpha": alpha, "theta": float(theta), "q": 0.0, "h": h}
    return {name: value for name, value in state.items() if np.isfinite(value)}
