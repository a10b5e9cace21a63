"""Energy: what thrust puts in and what speed and height keep; drag has taken the rest (2.23)-(2.26).

Edot = (T cos(alpha) - D) V is used in its integral, E(t) - E(0): nothing noisy is differentiated. Speed and height are
as the transducers give them, and no accelerometer, gyro or angle is needed but for the lift that thrust takes off the
wing: where it differs from the dynamic method by more than airspeed, lag and thrust explain, the pitch attitude of the
path is wrong.
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from analysis.drag.direct import along_runs
from analysis.drag.method import Method
from analysis.drag.regression import Piece, TimeSeries
from analysis.maneuvers.kinds import LEVEL_RUNS, Maneuver
from flight.aircraft import Aircraft
from flight.atmosphere import GRAVITY_MPS2 as g
from flight.errors import InputError

Array = NDArray[np.float64]
ROUGH_MPS = 0.4  # of vertical gusts: W20 = 3 kt makes 0.15, 15 kt 0.8


def problem(given: pd.DataFrame, runs: list[Maneuver], _: Aircraft) -> TimeSeries:
    """Work of drag since a run's start against its forms: integrals of qS V, qS V CL, qS V CL^2 (over mass)."""
    if given["gust_mps"].iloc[0] > ROUGH_MPS:
        raise InputError("too turbulent for a balance of energy: gusts come and go in speed as slowly as the run does")
    pieces = []
    columns = ("V_felt", "height_felt", "thrust_felt", "qS_felt", "alpha", "bank")
    for run, t, f in along_runs(given, runs, columns):
        V, h, T, qS, a, bank = (f[name] for name in columns)
        CL = (g / np.cos(bank) - T * np.sin(a)) / qS  # level: n_z = 1 (2.19)
        kept = V**2 / 2 + g * h  # (2.23)
        work = _integral(T * np.cos(a) * V, t) - kept
        X = np.stack([_integral(qS * V * CL**i, t) for i in range(3)], axis=1)
        # The energy at the start is not known better than at any other instant: only differences count.
        gusts = _work_of_gusts(given, t, V)
        pieces.append(Piece(run.name, t, X - X.mean(axis=0), work - work.mean(), CL, gusts))
    return TimeSeries(pieces)


def _work_of_gusts(given: pd.DataFrame, t: Array, V: Array) -> Array:
    """Covariance (n, n) of what gusts add to the balance over a run, about its mean [(m^2/s^2)^2].

    Air that rises lifts, g w a second; air that comes on faster adds V times the change of its speed.
    """
    apart = np.abs(t[:, None] - t)
    vertical, along = (_alike(given, name, apart) for name in ("gust", "gust_along"))
    lifted = np.tril(np.full_like(apart, t[1] - t[0]))
    centre = np.eye(len(t)) - 1 / len(t)
    work = centre @ lifted * g, centre * V
    return work[0] @ vertical @ work[0].T + work[1] @ along @ work[1].T


def _alike(given: pd.DataFrame, name: str, apart_s: Array) -> Array:
    """Covariance of first-order gusts at instants apart_s (n, n) from each other."""
    sigma, time_s = (float(given[f"{name}_{unit}"].iloc[0]) for unit in ("mps", "s"))
    return sigma**2 * np.exp(-apart_s / time_s)


def _integral(rate: Array, t: Array) -> Array:
    return np.asarray(cumulative_trapezoid(rate, t, initial=0))


ENERGY = Method(
    name="energy",
    title="energy",
    equations="(2.23)-(2.26)",
    kinds=LEVEL_RUNS,
    takes=("airspeed_scale", "lag", "thrust_scale", "thrust_slope"),
    problem=problem,
)
