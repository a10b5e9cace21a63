"""A drag polar predicted by another program, for comparison with the measured curve: `analyze --polar FILE`.

This reads polars that XFLR5 and flow5 export (text or CSV), AVL's total forces of one case after another, and any table
with columns CL and CD, such as pandas writes for results of AeroSandbox. Coefficients are for the whole aircraft, based
on the wing area of the aircraft file. The polar of an airfoil has no induced drag and is rejected.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flightpower.analysis.curve import Condition, lift_coefficient
from flightpower.analysis.records.flight import Results
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.units import number_or_nan

# Possible names of a column, the most specific first: in XFLR5, Cl is the rolling moment; its old versions call drag
# TCd.
LIFT, DRAG = ("CL", "C_L", "CLtot", "cl"), ("CD", "C_D", "CDtot", "TCd", "cd")
# Columns for transition of the boundary layer on top and bottom, which XFOIL, XFLR5 and AeroSandbox write for airfoils
# only.
AIRFOIL = re.compile(r"\bxtrf\b|\b(?:top|bot)[_ ]xtr\b", re.IGNORECASE)
AVL_CASE = re.compile(r"\bCLtot\s*=\s*(\S+).*?\bCDtot\s*=\s*(\S+)", re.DOTALL)


class PredictedPolar(NamedTuple):
    """Lift coefficients CL (n,), increasing, and drag coefficients CD (n,). name : of the file"""

    name: str
    CL: Array
    CD: Array

    def power_W(self, V_mps: Array, condition: Condition) -> Array:
        """Return power required (n,) at speeds (n,), interpolated; NaN outside the range of the polar."""
        CL = lift_coefficient(V_mps, condition)
        CD = np.interp(CL, self.CL, self.CD, left=np.nan, right=np.nan)
        return np.asarray(condition.rho / 2 * V_mps**3 * condition.wing_area_m2 * CD)


def read_predicted_polar(path: Path) -> PredictedPolar:
    """Read a polar. Raises InputError if the file cannot be read, or has no three points with lift and drag."""
    try:
        text = path.read_text("utf-8-sig", errors="replace")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if AIRFOIL.search(text):
        raise InputError(
            f"{path}: the polar of an airfoil, which has no induced drag; export that of the whole aircraft, in XFLR5"
            " that of a plane"
        )
    cases = sorted((number_or_nan(lift), number_or_nan(drag)) for lift, drag in AVL_CASE.findall(text))
    pairs = cases or _table(text.splitlines())
    points = np.array([pair for pair in pairs if np.isfinite(pair).all()]).reshape(-1, 2)
    if not len(points):
        raise InputError(
            f"{path}: no polar: neither columns CL and CD nor AVL's CLtot and CDtot; export the polar of the whole"
            " aircraft, not of an airfoil"
        )
    if len(points) > 1 and points[0, 0] > points[-1, 0]:
        points = points[::-1]
    # Points beyond the highest lift are left out: there the wing is stalled, which level flight never reaches.
    before_stall = points[points[:, 0] >= np.maximum.accumulate(points[:, 0])]
    CL, first = np.unique(before_stall[:, 0], return_index=True)
    CD = before_stall[first, 1]
    lifting = CL > 0
    if lifting.sum() < 3 or CD[lifting].min() <= 0:
        raise InputError(f"{path}: needs three points or more of positive lift, each with positive drag")
    return PredictedPolar(path.name, CL, CD)


def _table(lines: Sequence[str]) -> list[tuple[float, float]]:
    """Return pairs of lift and drag coefficient from the first table that has both; empty if there is none."""
    for start, line in enumerate(lines):
        names = _cells(line)
        lift, drag = (next((name for name in titles if name in names), None) for titles in (LIFT, DRAG))
        if lift is None or drag is None:
            continue
        columns, pairs = (names.index(lift), names.index(drag)), list[tuple[float, float]]()
        for row in map(_cells, lines[start + 1 :]):
            if lift in row:
                break
            if len(row) > max(columns):
                pairs.append((number_or_nan(row[columns[0]]), number_or_nan(row[columns[1]])))
        return pairs
    return []


def _cells(line: str) -> list[str]:
    separator = next((mark for mark in (",", ";", "\t") if mark in line), None)
    return [cell.strip().strip('"') for cell in line.split(separator)]


def check_of_aircraft(polar: PredictedPolar, aspect_ratio: float) -> None:
    """Raise InputError if the drag of a polar is below the least induced drag for the aircraft's span.

    The least induced drag is that of elliptic lift, C_L^2/(pi AR). A polar below it is from an airfoil, or has a
    different aircraft or reference area.
    """
    lifting = polar.CL > 0
    CL, CD = polar.CL[lifting], polar.CD[lifting]
    induced = CL**2 / (np.pi * aspect_ratio)
    worst = int(np.argmin(CD / induced))
    if CD[worst] < induced[worst]:
        raise InputError(
            f"{polar.name}: its drag coefficient of {CD[worst]:.4f} at a lift coefficient of {CL[worst]:.2f} is below"
            f" the induced drag of this span alone, {induced[worst]:.4f}; export that of the whole aircraft, not of an"
            " airfoil, for the wing area of the aircraft file"
        )


def comparison(polar: PredictedPolar, results: Results) -> str:
    """Say in a sentence how far the prediction is from the curve at the speeds flown."""
    V, P = np.array([(p.speed_mps, p.power_W) for p in results.power_required]).T
    percent = 100 * (polar.power_W(V, flown_at(results)) / P - 1)
    finite = np.isfinite(percent)
    if not finite.any():
        CL = lift_coefficient(V, flown_at(results))
        return (
            f"{polar.name} predicts nothing at the speeds flown: its lift coefficients end at {polar.CL[-1]:.2f}, those"
            f" of the flight are {CL.min():.2f} to {CL.max():.2f}."
        )
    least, most = percent[finite].min(), percent[finite].max()
    part = "" if finite.all() else f" between {V[finite][0]:.1f} and {V[finite][-1]:.1f} m/s"
    return (
        f"Dotted: {polar.name}, predicted. It lies {least:+.0f} to {most:+.0f} % from the measured curve{part}, at the"
        " weight and air density of the flight."
    )


def flown_at(results: Results) -> Condition:
    """Return weight, air density and wing area of the curve."""
    condition = results.test
    return Condition(condition.weight_N, condition.air_density_kgpm3, results.aircraft.wing_area_m2)
