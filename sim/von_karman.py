"""Von Karman turbulence: filters whose spectra approximate those of MIL-F-8785C sec. 3.7.1.1.

At high frequency its spectra fall as Omega^(-5/3), as measured in the atmosphere, where Dryden's fall as Omega^-2.
"""

import numpy as np

from flight.number import Number
from sim.air import Gust, GustStates, Scales, gust_of, rotation_rates

# Rational approximations of the spectra, over T s with T = L/V (those of MathWorks' continuous von Karman model):
# longitudinal (1 + 0.25 Ts)/(1 + 1.357 Ts + 0.1987 (Ts)^2), lateral and vertical of second over third order.
LONGITUDINAL_ZERO, LONGITUDINAL_POLES = 0.25, (1.357, 0.1987)
LATERAL_ZEROS, LATERAL_POLES = (2.7478, 0.3398), (2.9958, 1.9754, 0.1539)


def von_karman(
    states: GustStates, white: Number, *, V: Number, span_m: float, scales: Scales
) -> tuple[GustStates, Gust]:
    """Rates of change of the shaping filters, and the gusts they give; arguments as of `sim.air.dryden`."""
    sigma_u, sigma_w, L_u, L_w = scales
    V = np.maximum(V, 5.0)
    T_u, T_w = L_u / V, L_w / V
    n_u, n_v, n_w, n_p = white
    u = sigma_u * np.sqrt(2 * T_u) * (states.u + LONGITUDINAL_ZERO * states.u2)
    v = sigma_u * np.sqrt(T_u) * _lateral(states.v1, states.v2, states.v3)
    w = sigma_w * np.sqrt(T_w) * _lateral(states.w1, states.w2, states.w3)
    p_rate, q_rate, r_rate = rotation_rates(states, v, w, n_p, V=V, span_m=span_m, scales=scales)
    a1, a2 = LONGITUDINAL_POLES
    rates = GustStates(
        u=states.u2 / T_u,
        v1=states.v2 / T_u,
        v2=states.v3 / T_u,
        w1=states.w2 / T_w,
        w2=states.w3 / T_w,
        p=p_rate,
        q=q_rate,
        r=r_rate,
        u2=(n_u - states.u - a1 * states.u2) / (a2 * T_u),
        v3=_last_rate(states.v1, states.v2, states.v3, n_v, T_u),
        w3=_last_rate(states.w1, states.w2, states.w3, n_w, T_w),
    )
    return rates, gust_of(states, rates, (u, v, w), V)


def _lateral(x1: Number, x2: Number, x3: Number) -> Number:
    b1, b2 = LATERAL_ZEROS
    return x1 + b1 * x2 + b2 * x3


def _last_rate(x1: Number, x2: Number, x3: Number, white: Number, T: Number) -> Number:
    a1, a2, a3 = LATERAL_POLES
    return (white - x1 - a1 * x2 - a2 * x3) / (a3 * T)
