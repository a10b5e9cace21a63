"""Methods that use runs as measured, to compare with the dynamic method: direct drag, and the energy of a run.

Direct drag is the drag at every instant of a run, regressed on lift (2.18)-(2.21). Three of its forms each test a
quantity:
From the accelerometers (2.16), with the angle of attack as measured. A difference from the dynamic method shows that
this angle is not aligned with the IMU.
From speed (2.22), with the pitch attitude that the accelerometer alone would level. A difference shows that the
accelerometer is biased.
From accelerations and from decelerations separately, with the airspeed not corrected for lag. A difference between them
shows an air-data lag or a wrong propeller table.
The observation is drag over mass [m/s^2], whose errors all have one size, unlike those of C_D.

Energy: work of thrust less the gain of kinetic and potential energy is the work of drag (2.23)-(2.26).
Edot = (T cos(alpha) - D) V is used in its integral, E(t) - E(0), so nothing noisy is differentiated. Speed and height
are used as measured. Accelerometers, gyros and angles only give the part of the weight that thrust carries. If errors
of airspeed, lag and thrust do not explain a difference from the dynamic method, the trajectory's pitch attitude is
wrong.
Energies and work are divided by mass [m^2/s^2].
"""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from flightpower.analysis.maneuvers.kinds import LEVEL_RUNS, LOAD_FACTOR_MANEUVERS, Maneuver
from flightpower.analysis.methods.causes import CAUSES
from flightpower.analysis.methods.method import Method
from flightpower.analysis.methods.regression import RunRegression, Tables, TimeSeriesRegression, run_data
from flightpower.analysis.records.flight import Cause
from flightpower.analysis.trajectory.settings import SHOWN
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.runs import ACCELERATION, DECELERATION
from flightpower.flight.units import GRAVITY_MPS2 as g

# The quantities of the force balance, and the columns of the methods' table that they come from.
ALONG_TRAJECTORY = {
    "ax": "ax",
    "az": "az",
    "alpha": "alpha",
    "thrust_x_over_m": "thrust_x_over_m_mps2",
    "qS_over_m": "qS_over_m_mps2",
}
ALPHA_MEASURED = ALONG_TRAJECTORY | {"alpha": "alpha_measured"}
THETA_MEASURED = ALONG_TRAJECTORY | {"theta": "theta_measured", "bank": "bank", "Vdot": "Vdot"}
AIRSPEED_LAGGED = ALONG_TRAJECTORY | {
    "thrust_x_over_m": "thrust_x_over_m_lagged_mps2",
    "qS_over_m": "qS_over_m_lagged_mps2",
}


def from_accelerometers(f: Mapping[str, Array]) -> tuple[Array, Array]:
    """Drag (2.16), (2.20) and lift (2.19), both over mass [m/s^2]."""
    alpha, az = f["alpha"], f["az"]
    forward = f["ax"] - f["thrust_x_over_m"]
    return -forward * np.cos(alpha) - az * np.sin(alpha), forward * np.sin(alpha) - az * np.cos(alpha)


def from_speed(f: Mapping[str, Array]) -> tuple[Array, Array]:
    """Drag (2.22), with the flight path angle from pitch attitude and angle of attack, and lift (2.19) [m/s^2]."""
    _, lift = from_accelerometers(f)
    alpha, theta = f["alpha"], f["theta"]
    sin_gamma = np.cos(alpha) * np.sin(theta) - np.sin(alpha) * np.cos(theta) * np.cos(f["bank"])
    return f["thrust_x_over_m"] * np.cos(alpha) - f["Vdot"] - g * sin_gamma, lift


def _direct_method(
    name: str,
    title: str,
    equations: str,
    kinds: tuple[str, ...],
    *taken_as_measured: str,
    columns: Mapping[str, str],
    drag_and_lift: Callable[[Mapping[str, Array]], tuple[Array, Array]] = from_accelerometers,
) -> Method:
    """A regression of drag on lift with the uncorrected propeller table. taken_as_measured: other uncorrected errors"""

    def regression(tables: Tables, runs: list[Maneuver], _: Aircraft) -> TimeSeriesRegression:
        regressions = []
        for run, t, data in run_data(tables, runs, tuple(columns.values())):
            f = {quantity: data[column] for quantity, column in columns.items()}
            drag, lift = drag_and_lift(f)
            CL = lift / f["qS_over_m"]
            X = np.stack([f["qS_over_m"], lift, lift * CL], axis=-1)
            regressions.append(RunRegression(run.name, t, X, drag, CL))
        return TimeSeriesRegression(regressions)

    return Method(name, title, equations, kinds, (*taken_as_measured, *CAUSES[Cause.PROPELLER_TABLE]), regression)


DIRECT = _direct_method(
    "direct", "direct drag, accelerometers", "(2.16), (2.18)-(2.21)", (*LEVEL_RUNS, *LOAD_FACTOR_MANEUVERS),
    "alpha_bias", "alpha_scale", "lag", columns=ALPHA_MEASURED,
)  # fmt: skip
FROM_SPEED = _direct_method(
    "direct-speed", "direct drag, speed and pitch attitude", "(2.22), (2.18)-(2.21)",
    (*LEVEL_RUNS, *LOAD_FACTOR_MANEUVERS), "pitch", columns=THETA_MEASURED, drag_and_lift=from_speed,
)  # fmt: skip
ONE_RUN = _direct_method(
    "run", "one run alone, propeller table as it is", "(2.16), (2.18)-(2.21) along the path", LEVEL_RUNS,
    columns=ALONG_TRAJECTORY,
)  # fmt: skip
VARIED_LIFT = _direct_method(
    "varied-lift", "roller coasters and wind-up turns", "(2.16), (2.18)-(2.21) along the path", LOAD_FACTOR_MANEUVERS,
    columns=ALONG_TRAJECTORY,
)  # fmt: skip
ACCELERATIONS, DECELERATIONS = (
    _direct_method(
        f"{kind}s", f"{kind}s alone, propeller table as it is", "(2.16), (2.18)-(2.21)", (kind,), "lag",
        columns=AIRSPEED_LAGGED,
    )
    for kind in (ACCELERATION, DECELERATION)
)  # fmt: skip


COLUMNS = (
    "V_measured", "height_measured", "thrust_x_over_m_measured_mps2", "qS_over_m_measured_mps2", "alpha", "bank",
)  # fmt: skip


def regression(tables: Tables, runs: list[Maneuver], _: Aircraft) -> TimeSeriesRegression:
    """Regress the work of drag since the start of a run on integrals of qS V, qS V CL, qS V CL^2, all over mass."""
    if _constant(tables, "gust_mps") > SHOWN.turbulent_mps:
        raise InputError("too turbulent for the energy method: gusts change the speed as slowly as the run does")
    regressions = []
    for run, t, data in run_data(tables, runs, COLUMNS):
        V, height, thrust_over_m, qS_over_m, alpha, bank = (data[name] for name in COLUMNS)
        CL = (g / np.cos(bank) - thrust_over_m * np.sin(alpha)) / qS_over_m  # level: n_z = 1 (2.19)
        energy = V**2 / 2 + g * height  # (2.23)
        work = _integral(thrust_over_m * np.cos(alpha) * V, t) - energy
        X = np.stack([_integral(qS_over_m * V * CL**i, t) for i in range(3)], axis=-1)
        # The energy at the start is not known better than at any other instant, so only differences count.
        X, work = X - X.mean(axis=-2, keepdims=True), work - work.mean(axis=-1, keepdims=True)
        regressions.append(RunRegression(run.name, t, X, work, CL, partial(_work_of_gusts, tables, t, V)))
    return TimeSeriesRegression(regressions)


def _work_of_gusts(tables: Tables, t: Array, V: Array) -> Array:
    """Covariance (n, n) of the work that gusts add over a run, about its mean [(m^2/s^2)^2].

    Air rising at w adds g w per second; a gust u along the flight path adds V times the change of u.
    """
    apart_s = np.abs(t[:, None] - t)
    vertical, along = (_gust_covariance(tables, name, apart_s) for name in ("gust", "gust_along"))
    integral = np.tril(np.full_like(apart_s, t[1] - t[0]))
    center = np.eye(len(t)) - 1 / len(t)
    by_vertical, by_along = center @ integral * g, center * V
    return by_vertical @ vertical @ by_vertical.T + by_along @ along @ by_along.T


def _constant(tables: Tables, name: str) -> float:
    """The value of a column that is the same in all rows."""
    return float(tables.columns[name].flat[0])


def _gust_covariance(tables: Tables, name: str, apart_s: Array) -> Array:
    """Covariance [m^2/s^2] of first-order gusts at instants apart_s (n, n) from each other."""
    sigma_mps, time_s = (_constant(tables, f"{name}_{unit}") for unit in ("mps", "s"))
    return np.asarray(sigma_mps**2 * np.exp(-apart_s / time_s))


def _integral(rate: Array, t: Array) -> Array:
    """The integral (…, n) of a rate (…, n) from the first of the times t (n,), by the trapezoidal rule."""
    steps = np.diff(t) * (rate[..., 1:] + rate[..., :-1]) / 2
    return np.concatenate([np.zeros((*rate.shape[:-1], 1)), np.cumsum(steps, axis=-1)], axis=-1)


ENERGY = Method(
    name="energy",
    title="energy",
    equations="(2.23)-(2.26)",
    kinds=LEVEL_RUNS,
    taken_as_measured=("airspeed_scale", "lag", "thrust_scale", "thrust_slope"),
    regression=regression,
)
