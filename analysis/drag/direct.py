"""Direct drag: the force along the path at every instant, regressed on lift (2.18)-(2.21).

From the accelerometers (2.16), with the angle of attack as measured: where it differs from the dynamic method, that
angle is not aligned with the IMU. From speed (2.22), with the pitch attitude that the accelerometer alone would level:
where it differs, the accelerometer is biased. Accelerations and decelerations apart, with airspeed as it comes: where
they differ, air data come late or the propeller's table is off.

What is regressed is drag over mass, whose errors are of one size; C_D's are not.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag.method import Method
from analysis.drag.regression import Piece, TimeSeries
from analysis.maneuvers.kinds import ACCELERATION, DECELERATION, LEVEL_RUNS, LOAD_FACTOR_MANEUVERS, Maneuver
from flight.aircraft import Aircraft
from flight.atmosphere import GRAVITY_MPS2 as g
from flight.errors import InputError

Array = NDArray[np.float64]

SHORTEST = 10  # blocks of a run


class Along(NamedTuple):
    """A run's time (n,) [s], and what a method is given over it, by name, each (n,)."""

    run: Maneuver
    t_s: Array
    f: dict[str, Array]


def along_runs(given: pd.DataFrame, runs: list[Maneuver], columns: tuple[str, ...]) -> list[Along]:
    """The columns over each run, small gaps bridged. Raises InputError when no run has them all."""
    t, values = given.index.to_numpy(), given[list(columns)].to_numpy()
    found = []
    for run in runs:
        rows = slice(*np.searchsorted(t, (run.start_s, np.nextafter(run.end_s, np.inf))))
        data = values[rows]
        if not np.isfinite(data).all():
            data = pd.DataFrame(data).interpolate(limit_direction="both").to_numpy()
        if len(data) >= SHORTEST and np.isfinite(data).all():
            found.append(Along(run, t[rows], dict(zip(columns, data.T, strict=True))))
    if not found:
        raise InputError("no run has all the data it takes")
    return found


Forces = Callable[[dict[str, Array]], tuple[Array, Array, Array]]


def _problem(drag_and_lift: Forces, columns: tuple[str, ...]):
    def problem(given: pd.DataFrame, runs: list[Maneuver], _: Aircraft) -> TimeSeries:
        pieces = []
        for run, t, f in along_runs(given, runs, columns):
            drag, lift, qS = drag_and_lift(f)
            CL = lift / qS
            pieces.append(Piece(run.name, t, qS[:, None] * CL[:, None] ** np.arange(3), drag, CL))
        return TimeSeries(pieces)

    return problem


def from_accelerometers(f: dict[str, Array], alpha: str = "alpha_felt", late: str = "") -> tuple[Array, Array, Array]:
    """Drag (2.16), (2.20), lift (2.19) and dynamic pressure times area, all over mass [m/s^2]."""
    a, az = f[alpha], f["az"]
    forward = f["ax"] - f[f"thrust{late}"]
    return -forward * np.cos(a) - az * np.sin(a), forward * np.sin(a) - az * np.cos(a), f[f"qS{late}"]


def from_speed(f: dict[str, Array]) -> tuple[Array, Array, Array]:
    """Drag (2.22), its angle of climb from pitch attitude and angle of attack, and lift as above [m/s^2]."""
    _, lift, qS = from_accelerometers(f, "alpha")
    a, theta = f["alpha"], f["theta_felt"]
    sin_gamma = np.cos(a) * np.sin(theta) - np.sin(a) * np.cos(theta) * np.cos(f["bank"])
    return f["thrust"] * np.cos(a) - f["Vdot"] - g * sin_gamma, lift, qS


def along_path(f: dict[str, Array]) -> tuple[Array, Array, Array]:
    """Drag from the accelerometers, everything else from the path."""
    return from_accelerometers(f, "alpha")


def at_late_speed(f: dict[str, Array]) -> tuple[Array, Array, Array]:
    """Drag from the accelerometers along the path, dynamic pressure and thrust from airspeed as late as it comes."""
    return from_accelerometers(f, "alpha", "_late")


DIRECT = Method(
    name="direct",
    title="direct drag, accelerometers",
    equations="(2.16), (2.18)-(2.21)",
    kinds=(*LEVEL_RUNS, *LOAD_FACTOR_MANEUVERS),
    takes=("alpha_bias", "alpha_scale", "lag", "thrust_scale", "thrust_slope"),
    problem=_problem(from_accelerometers, ("alpha_felt", "ax", "az", "thrust", "qS")),
)
FROM_SPEED = Method(
    name="direct-speed",
    title="direct drag, speed and pitch attitude",
    equations="(2.22), (2.18)-(2.21)",
    kinds=(*LEVEL_RUNS, *LOAD_FACTOR_MANEUVERS),
    takes=("pitch", "thrust_scale", "thrust_slope"),
    problem=_problem(from_speed, ("alpha", "theta_felt", "bank", "Vdot", "ax", "az", "thrust", "qS")),
)
ONE_RUN = Method(
    name="run",
    title="one run alone, propeller table as it is",
    equations="(2.16), (2.18)-(2.21) along the path",
    kinds=LEVEL_RUNS,
    takes=("thrust_scale", "thrust_slope"),
    problem=_problem(along_path, ("alpha", "ax", "az", "thrust", "qS")),
)
VARIED_LIFT = Method(
    name="varied-lift",
    title="roller coasters and wind-up turns",
    equations="(2.16), (2.18)-(2.21) along the path",
    kinds=LOAD_FACTOR_MANEUVERS,
    takes=("thrust_scale", "thrust_slope"),
    problem=_problem(along_path, ("alpha", "ax", "az", "thrust", "qS")),
)
ACCELERATIONS, DECELERATIONS = (
    Method(
        name=f"{kind}s",
        title=f"{kind}s alone, propeller table as it is",
        equations="(2.16), (2.18)-(2.21)",
        kinds=(kind,),
        takes=("lag", "thrust_scale", "thrust_slope"),
        problem=_problem(at_late_speed, ("alpha", "ax", "az", "thrust_late", "qS_late")),
    )
    for kind in (ACCELERATION, DECELERATION)
)
