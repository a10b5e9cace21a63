"""Direct drag: the force along the path at every instant, regressed on lift (2.18)-(2.21).

From the accelerometers (2.16), with the angle of attack as measured: where it differs from the dynamic method, that
angle is not aligned with the IMU. From speed (2.22), with the pitch attitude that the accelerometer alone would level:
where it differs, the accelerometer is biased. Accelerations and decelerations apart, with airspeed as it comes: where
they differ, air data come late or the propeller's table is off.

What is regressed is drag over mass, whose errors are of one size; C_D's are not.
"""

from collections.abc import Callable

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.power.method import Method
from analysis.power.regression import Piece, TimeSeries
from analysis.runs.kinds import ACCELERATION, DECELERATION, LEVEL, LOADS, Run
from flight.aircraft import Aircraft
from flight.atmosphere import GRAVITY_MPS2 as g
from flight.errors import InputError

Array = NDArray[np.float64]

SHORTEST = 10  # blocks of a run


def along_runs(given: pd.DataFrame, runs: list[Run], columns: tuple[str, ...]) -> list[tuple[Run, pd.DataFrame]]:
    """The columns over each run, small gaps bridged. Raises InputError when no run has them all."""
    found = []
    for run in runs:
        data = given.loc[run.start_s : run.end_s, list(columns)].interpolate(limit_direction="both")
        if len(data) >= SHORTEST and np.isfinite(data.to_numpy()).all():
            found.append((run, data))
    if not found:
        raise InputError("no run has all the data it takes")
    return found


def _problem(drag_and_lift: Callable[[pd.DataFrame], tuple[Array, Array, Array]], columns: tuple[str, ...]):
    def problem(given: pd.DataFrame, runs: list[Run], _: Aircraft) -> TimeSeries:
        pieces = []
        for run, f in along_runs(given, runs, columns):
            drag, lift, qS = drag_and_lift(f)
            CL = lift / qS
            pieces.append(Piece(run.name, f.index.to_numpy(), qS[:, None] * CL[:, None] ** np.arange(3), drag, CL))
        return TimeSeries(pieces)

    return problem


def from_accelerometers(f: pd.DataFrame, alpha: str = "alpha_felt", felt: str = "") -> tuple[Array, Array, Array]:
    """Drag (2.16), (2.20), lift (2.19) and dynamic pressure times area, all over mass [m/s^2]."""
    a, ax, az = (f[name].to_numpy() for name in (alpha, "ax", "az"))
    forward = ax - f[f"thrust{felt}"].to_numpy()
    drag = -forward * np.cos(a) - az * np.sin(a)
    return drag, forward * np.sin(a) - az * np.cos(a), f[f"qS{felt}"].to_numpy()


def from_speed(f: pd.DataFrame) -> tuple[Array, Array, Array]:
    """Drag (2.22), its angle of climb from pitch attitude and angle of attack, and lift as above [m/s^2]."""
    _, lift, qS = from_accelerometers(f, "alpha")
    a, theta, bank = (f[name].to_numpy() for name in ("alpha", "theta_felt", "bank"))
    sin_gamma = np.cos(a) * np.sin(theta) - np.sin(a) * np.cos(theta) * np.cos(bank)
    return f["thrust"].to_numpy() * np.cos(a) - f["Vdot"].to_numpy() - g * sin_gamma, lift, qS


def at_late_speed(f: pd.DataFrame) -> tuple[Array, Array, Array]:
    """Drag from the accelerometers along the path, dynamic pressure and thrust from airspeed as late as it comes."""
    return from_accelerometers(f, "alpha", "_late")


DIRECT = Method(
    name="direct",
    title="direct drag, accelerometers",
    equations="(2.16), (2.18)-(2.21)",
    kinds=(*LEVEL, *LOADS),
    takes=("alpha_bias", "alpha_scale", "lag", "thrust_scale", "thrust_slope"),
    problem=_problem(from_accelerometers, ("alpha_felt", "ax", "az", "thrust", "qS")),
)
FROM_SPEED = Method(
    name="direct-speed",
    title="direct drag, speed and pitch attitude",
    equations="(2.22), (2.18)-(2.21)",
    kinds=(*LEVEL, *LOADS),
    takes=("pitch", "thrust_scale", "thrust_slope"),
    problem=_problem(from_speed, ("alpha", "theta_felt", "bank", "Vdot", "ax", "az", "thrust", "qS")),
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
