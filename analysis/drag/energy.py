"""Energy: work of thrust less the gain of kinetic and potential energy is the work of drag (2.23)-(2.26).

Edot = (T cos(alpha) - D) V is used in its integral, E(t) - E(0): nothing noisy is differentiated. Speed and height are
taken as measured. Accelerometers, gyros and angles serve only for the part of the weight that thrust carries. A
difference from the dynamic method that errors of airspeed, lag and thrust do not explain shows a wrong pitch attitude
of the trajectory.

Energies and work are over mass [m^2/s^2].
"""

from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag.method import Method
from analysis.drag.regression import RunRegression, TimeSeriesRegression
from analysis.drag.run_data import run_data
from analysis.maneuvers.kinds import LEVEL_RUNS, Maneuver
from flight.aircraft import Aircraft
from flight.errors import InputError
from flight.units import GRAVITY_MPS2 as g

Array = NDArray[np.float64]
LARGEST_GUST_MPS = 0.4  # vertical, standard deviation: W20 = 3 kt makes 0.15, 15 kt 0.8
COLUMNS = (
    "V_measured", "height_measured", "thrust_x_over_m_measured_mps2", "qS_over_m_measured_mps2", "alpha", "bank",
)  # fmt: skip


def regression(table: pd.DataFrame, runs: list[Maneuver], _: Aircraft) -> TimeSeriesRegression:
    """Work of drag since the start of a run on the integrals of qS V, qS V CL, qS V CL^2, all over mass."""
    if table["gust_mps"].iloc[0] > LARGEST_GUST_MPS:
        raise InputError("too turbulent for the energy method: gusts change the speed as slowly as the run does")
    regressions = []
    for run, t, data in run_data(table, runs, COLUMNS):
        V, height, thrust_over_m, qS_over_m, alpha, bank = (data[name] for name in COLUMNS)
        CL = (g / np.cos(bank) - thrust_over_m * np.sin(alpha)) / qS_over_m  # level: n_z = 1 (2.19)
        energy = V**2 / 2 + g * height  # (2.23)
        work = _integral(thrust_over_m * np.cos(alpha) * V, t) - energy
        X = np.stack([_integral(qS_over_m * V * CL**i, t) for i in range(3)], axis=1)
        # The energy at the start is not known better than at any other instant: only differences count.
        gusts = partial(_work_of_gusts, table, t, V)
        regressions.append(RunRegression(run.name, t, X - X.mean(axis=0), work - work.mean(), CL, gusts))
    return TimeSeriesRegression(regressions)


def _work_of_gusts(table: pd.DataFrame, t: Array, V: Array) -> Array:
    """Covariance (n, n) of the work that gusts add over a run, about its mean [(m^2/s^2)^2].

    Air rising at w adds g w per second; a gust u along the flight path adds V times its change.
    """
    apart_s = np.abs(t[:, None] - t)
    vertical, along = (_gust_covariance(table, name, apart_s) for name in ("gust", "gust_along"))
    integral = np.tril(np.full_like(apart_s, t[1] - t[0]))
    centre = np.eye(len(t)) - 1 / len(t)
    by_vertical, by_along = centre @ integral * g, centre * V
    return by_vertical @ vertical @ by_vertical.T + by_along @ along @ by_along.T


def _gust_covariance(table: pd.DataFrame, name: str, apart_s: Array) -> Array:
    """Covariance [m^2/s^2] of first-order gusts at instants apart_s (n, n) from each other."""
    sigma_mps, time_s = (float(table[f"{name}_{unit}"].iloc[0]) for unit in ("mps", "s"))
    return np.asarray(sigma_mps**2 * np.exp(-apart_s / time_s))


def _integral(rate: Array, t: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(np.diff(t) * (rate[1:] + rate[:-1]) / 2)])


ENERGY = Method(
    name="energy",
    title="energy",
    equations="(2.23)-(2.26)",
    kinds=LEVEL_RUNS,
    taken_as_measured=("airspeed_scale", "lag", "thrust_scale", "thrust_slope"),
    regression=regression,
)
