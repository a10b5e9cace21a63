"""Conditions flown: weight, air density, and the lift coefficients over which a polar holds.

Also finds how much of the flight the propeller table covers.
"""

from collections.abc import Set
from enum import StrEnum

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.curve import Condition
from flightpower.analysis.settings import FLOWN
from flightpower.analysis.sources.daemon import least_height_m, speed_scale_of
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.propeller import Propeller
from flightpower.flight.runs import DECELERATION
from flightpower.flight.units import GRAVITY_MPS2


def flown_condition(rows_flown: pd.DataFrame, aircraft: Aircraft) -> Condition:
    """Weight of the aircraft and mean density of the air. rows_flown: from `air_data`."""
    return Condition(aircraft.mass.weight_N, float(rows_flown["rho"].mean()), aircraft.geometry.wing_area_m2)


def flown_lift(rows_flown: pd.DataFrame, aircraft: Aircraft, carried: float = np.inf) -> tuple[float, float]:
    """Range of the lift coefficients of level flight at the speeds flown. rows_flown: from `air_data`.

    For slow aircraft, whose speed is noisy, speeds are averaged: noise would make the slowest speed lower than flown.
    carried : from `largest_lift`; limits the range, as a gust may briefly lower airspeed to where no wing carries the
    weight
    """
    V = rows_flown["V_mps"].rolling(round(speed_scale_of(rows_flown) ** -4), center=True, min_periods=1).mean()
    CL = 2 * aircraft.mass.weight_N / (rows_flown["rho"] * V**2 * aircraft.geometry.wing_area_m2)
    low, high = np.percentile(CL.dropna(), FLOWN.robust_percentiles)
    return float(low), float(np.clip(carried, low, high))


def check_lift(flown_CL: tuple[float, float], condition: Condition, log: str) -> None:
    """Raise InputError if no wing could carry the weight at the speeds flown. flown_CL: from `flown_lift`."""
    largest = flown_CL[1]
    if not FLOWN.possible_CL[0] < largest < FLOWN.possible_CL[1]:
        raise InputError(
            f"{log}: a weight of {condition.weight_N:.3g} N and a wing area of {condition.wing_area_m2:.3g} m^2 need a"
            f" lift coefficient of {largest:.2g} at the slowest speed flown; a wing has 0.5 to 2: check"
            " mass.weight and geometry.wing_area of the aircraft file, and the unit of /probe/airspeed"
        )


def largest_lift(table: pd.DataFrame, condition: Condition) -> float:
    """The largest lift coefficient of a flight, by the vertical accelerometer; infinite where it is not known.

    table: from `air_data`. The value is a mean over half a second that is exceeded in a thousandth of the flight, so
    neither noise nor a bump sets it.
    """
    aloft = table["flying"] & (table["height_m"] > least_height_m(table))
    step_s = float(table.index[1] - table.index[0])
    rows = round(0.5 / step_s)
    force_N = -condition.weight_N / GRAVITY_MPS2 * table["az_mps2"]
    CL = force_N.rolling(rows, center=True).mean() / (
        table["qbar_Pa"].rolling(rows, center=True).mean() * condition.wing_area_m2
    )
    finite = CL[aloft].dropna()
    return float(np.percentile(finite, 99.9)) if len(finite) else np.inf


class TableLimit(StrEnum):
    """The quantities whose range a propeller table limits."""

    MOTOR_SPEED = "motor speed"
    ADVANCE_RATIO = "advance ratio"


def limits_left(rows_flown: pd.DataFrame, propeller: Propeller, V: Array) -> list[TableLimit]:
    """The limits of the propeller table that the flight exceeded near speeds V (k,), in more than a few samples.

    rows_flown : rows of the runs, columns V_mps, n_revps and propeller_covered
    """
    near = (np.abs(rows_flown["V_mps"].to_numpy() / np.asarray(V)[:, None] - 1) < FLOWN.nearby).any(axis=0)
    outside = ~rows_flown["propeller_covered"].to_numpy(dtype=bool)[near]
    rpm = 60 * rows_flown["n_revps"].to_numpy()[near]
    by_motor = outside & ~((propeller.rows[0].rpm <= rpm) & (rpm <= propeller.rows[-1].rpm))
    samples = {TableLimit.MOTOR_SPEED: by_motor, TableLimit.ADVANCE_RATIO: outside & ~by_motor}
    return [limit for limit, left in samples.items() if left.sum() > STATISTICS.unmentioned_share * len(left)]


def thrust_known(rows_flown: pd.DataFrame, V: Array) -> NDArray[np.bool_]:
    """Whether the propeller table covers at least FLOWN.least_covered of the samples flown near each speed V (k,).

    rows_flown : rows of the runs, columns V_mps and propeller_covered. A speed without samples nearby counts as known;
    it is an extrapolation for another reason.
    """
    speed, covered = rows_flown["V_mps"].to_numpy(), rows_flown["propeller_covered"].to_numpy(dtype=float)
    near = np.abs(speed / V[:, None] - 1) < FLOWN.nearby
    return np.asarray((near @ covered >= FLOWN.least_covered * near.sum(axis=1)) | ~near.any(axis=1))


def thrust_coverage(
    rows_flown: pd.DataFrame, propeller: Propeller, kinds: Set[str] = frozenset(), runs_file: str = ""
) -> list[str]:
    """A warning if some of the runs lie outside the propeller table.

    rows_flown : rows of the runs, columns J, n_revps and propeller_covered     kinds : kinds of the runs
    runs_file : the file that selected the runs, for messages; empty if they were found in the data
    Raises InputError if too much of the runs lies outside.
    """
    outside = 1 - float(rows_flown["propeller_covered"].mean())
    if outside <= STATISTICS.unmentioned_share:
        return []
    largest_J = max(row.J[-1] for row in propeller.rows)
    if (rows_flown["J"][~rows_flown["propeller_covered"]] > largest_J).mean() > 0.5:
        low, high = np.nanpercentile(rows_flown["J"], (2.5, 97.5))
        range_text = f"ends at J = {largest_J:.2f} (flown: {low:.2f} to {high:.2f})"
    else:
        low, high = np.nanpercentile(60 * rows_flown["n_revps"], (2.5, 97.5))
        rpm = propeller.rows[0].rpm, propeller.rows[-1].rpm
        range_text = f"goes from {rpm[0]:.0f} to {rpm[1]:.0f} rpm (flown: {low:.0f} to {high:.0f})"
    text = f"propeller {propeller.name}: {100 * outside:.0f} % of the runs lie outside its table, which {range_text}"
    if outside > FLOWN.largest_share_outside:
        if kinds == {DECELERATION} and runs_file:
            raise InputError(f"{runs_file}: keeps decelerations only, and {text}; keep an acceleration as well")
        if kinds == {DECELERATION}:
            raise InputError(f"{text}; all are decelerations: fly accelerations as well")
        raise InputError(f"{text}; is it the propeller that was flown?")
    rest = (
        "thrust is extrapolated linearly there, with an error that grows with the distance, and the curve is dashed"
        " where it depends mostly on that"
    )
    return [f"{text[0].upper()}{text[1:]}; {rest}."]
