"""Wind, thermals, and gusts with the spectra of MIL-F-8785C."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from flightpower.sim.air import FOOT_M, Air, GustStates, ambient, dryden, gust_scales, mean_wind

V, H, SPAN, W20 = 17.0, 60.0, 1.75, 7.7
N = len(GustStates._fields)


def linear_system():
    """The filters as x' = A x + B n, y = C x + D n: they are linear, so unit inputs give the columns."""

    def evaluate(x, n):
        rates, gust = dryden(GustStates(*x), n, V=V, span_m=SPAN, scales=gust_scales(W20, H))
        return np.array(rates, dtype=float), np.array(gust, dtype=float)

    columns = [evaluate(np.eye(N)[i], np.zeros(4)) for i in range(N)]
    inputs = [evaluate(np.zeros(N), np.eye(4)[i]) for i in range(4)]
    return tuple(
        np.column_stack([c[k] for c in group]) for group, k in ((columns, 0), (inputs, 0), (columns, 1), (inputs, 1))
    )


def test_spectra_are_those_of_the_standard():
    """One-sided in spatial frequency, MIL-F-8785C sec. 3.7.1.2 (u, v, w) and 3.7.5 (p, q, r)."""
    A, B, C, D = linear_system()
    s = gust_scales(W20, H)
    omegas = np.geomspace(0.05, 60, 25)
    for omega in omegas:
        response = C @ np.linalg.solve(1j * omega * np.eye(N) - A, B) + D
        # An intensity of one, two-sided in time, is 1/pi one-sided in angular frequency and V/pi in spatial frequency.
        result = np.sum(np.abs(response) ** 2, axis=1) * V / np.pi
        Om = omega / V

        def lateral(sigma, L, Om=Om):
            return sigma**2 * L / np.pi * (1 + 3 * (L * Om) ** 2) / (1 + (L * Om) ** 2) ** 2

        u = s.sigma_u**2 * 2 * s.L_u / np.pi / (1 + (s.L_u * Om) ** 2)
        v, w = lateral(s.sigma_u, s.L_u), lateral(s.sigma_w, s.L_w)
        p = s.sigma_w**2 / s.L_w * 0.8 * (np.pi * s.L_w / (4 * SPAN)) ** (1 / 3) / (1 + (4 * SPAN * Om / np.pi) ** 2)
        q = Om**2 / (1 + (4 * SPAN * Om / np.pi) ** 2) * w
        r = Om**2 / (1 + (3 * SPAN * Om / np.pi) ** 2) * v
        assert np.allclose(result, [u, v, w, p, q, r], rtol=1e-10)


def test_variances_are_those_of_the_standard():
    A, B, C, _ = linear_system()
    s = gust_scales(W20, H)
    P = solve_continuous_lyapunov(A, -B @ B.T)
    assert np.sqrt(np.diag(C @ P @ C.T)[:3]) == pytest.approx([s.sigma_u, s.sigma_u, s.sigma_w])
    # Low-altitude model (sec. 3.7.3.4.1): sigma_w is a tenth of the wind at 20 ft, scale of w is the height.
    assert s.sigma_w == pytest.approx(0.1 * W20)
    assert s.L_w == pytest.approx(H)
    h = 1000 * FOOT_M  # where the model meets that of high altitude, 1000 ft: everything is isotropic
    top = gust_scales(W20, h)
    assert (top.L_u, top.sigma_u) == pytest.approx((top.L_w, top.sigma_w), rel=1e-9)


def test_noise_held_over_a_step_gives_the_same_variance():
    """400 gusts run side by side for 40 s and, once they have forgotten their start, agree within four standard
    errors."""
    rng = np.random.default_rng(5)
    dt, members = 0.02, 400
    x = GustStates(*np.zeros((N, members)))
    last = []
    for step in range(2000):
        white = rng.standard_normal((4, members)) / np.sqrt(dt)

        def rate(state, white=white):
            return np.array(dryden(GustStates(*state), tuple(white), V=V, span_m=SPAN, scales=gust_scales(W20, H))[0])

        # The trapezoidal predictor-corrector is of second order, as good as exact at a hundredth of the filters' time.
        a = np.array(x)
        k1 = rate(a)
        k2 = rate(a + dt * k1)
        x = GustStates(*(a + dt * (k1 + k2) / 2))
        if step in (1000, 1500, 1999):
            _, gust = dryden(x, tuple(np.zeros((4, members))), V=V, span_m=SPAN, scales=gust_scales(W20, H))
            last.append(np.array(gust[:3]))
    sigma = np.std(np.concatenate(last, axis=1), axis=1)
    s = gust_scales(W20, H)
    # Samples 10 s apart are independent for w (L/V = 3.5 s) and nearly so for u and v (7 s): count half of them.
    standard_error = 1 / np.sqrt(2 * members * len(last) / 2)
    assert np.all(np.abs(sigma / [s.sigma_u, s.sigma_u, s.sigma_w] - 1) < 4 * standard_error)


def test_wind_profile():
    air = Air(wind_mps=5.0, wind_from_rad=np.deg2rad(270))
    north, east, down = mean_wind(air, 0.0, 0.0, 20 * FOOT_M)
    assert (float(north), float(east), float(down)) == pytest.approx((0, 5, 0), abs=1e-12)  # from the west, to the east
    speeds = [float(mean_wind(air, 0, 0, h)[1]) for h in (0.0, 1.0, 10.0, 50.0, 100.0)]
    assert speeds[0] == 0 and speeds == sorted(speeds)


def test_updraft_and_thermal_rise_above_the_ground():
    air = Air(thermal_mps=2.0, thermal_north_m=100.0, thermal_radius_m=50.0)
    assert mean_wind(air, 100.0, 0.0, 100.0, 0.3)[2] == pytest.approx(-2.3)
    assert mean_wind(air, 1000.0, 0.0, 100.0, 0.3)[2] == pytest.approx(-0.3)
    assert mean_wind(air, 100.0, 0.0, 0.0, 0.3)[2] == 0


def test_ambient_is_hydrostatic():
    day = ambient(Air(ground_pressure_Pa=98_000.0, ground_temperature_K=300.0), np.array([0.0, 100.0]))
    assert day.pressure[0] == 98_000.0
    assert day.temperature[1] == pytest.approx(299.35)
    assert day.pressure[1] == pytest.approx(98_000 - day.density.mean() * 9.80665 * 100, abs=0.1)
