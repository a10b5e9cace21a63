"""Makes the flown propeller, if it differs from the table that the analysis gets, and tables that end too soon."""

import numpy as np

from flightpower.flight.arrays import Array
from flightpower.flight.propeller import Propeller, Row

FARTHEST_J, STEP_J = 3.0, 0.1
# The blade element that stands for the whole blade, at three quarters of the radius (Glauert, Airplane Propellers,
# div. L in Durand, Aerodynamic Theory IV). Beyond zero thrust its angle of attack is negative, and it stalls: measured
# windmilling drag curves away from the straight line (Hartman, NACA Report 464).
ELEMENT_RADIUS = 0.75
LIFT_SLOPE_PER_RAD, STALLED_CL, SECTION_CD0, STALLED_CD_PER_RAD2 = 5.7, -0.7, 0.015, 1.5


def true_propeller(table: Propeller, *, bow: float = 0.0, windmilling: float = 0.0) -> Propeller:
    """Return the table with these differences; without any, the table itself.

    bow : cT times 1 + bow P2(x), the second Legendre polynomial, x from -1 at J = 0 to 1 at zero thrust
    windmilling : share by which a blade element's thrust and torque replace the straight line beyond zero thrust
    """
    if not bow and not windmilling:
        return table
    rows = tuple(_true_row(row, bow, windmilling) for row in table.rows)
    return Propeller(table.name, table.diameter_m, rows, table.source, table.beyond_zero_thrust)


def table_until(table: Propeller, least_cT: float) -> Propeller:
    """Cut each row of the table off before its first point below this thrust coefficient; keep at least two points."""
    rows = []
    for row in table.rows:
        below = [i for i, cT in enumerate(row.cT) if cT < least_cT]
        end = max(below[0] if below else len(row.J), 2)
        rows.append(Row(row.rpm, row.J[:end], row.cT[:end], row.cP[:end]))
    return Propeller(table.name, table.diameter_m, tuple(rows), table.source, table.beyond_zero_thrust)


def _true_row(row: Row, bow: float, windmilling: float) -> Row:
    J, cT, cP = (np.array(values) for values in (row.J, row.cT, row.cP))
    slopes = [float((y[-1] - y[-2]) / (J[-1] - J[-2])) for y in (cT, cP)]
    zero_J = row.J[-1] - row.cT[-1] / slopes[0]
    first, last = int(np.ceil(zero_J / STEP_J + 0.5)), round(FARTHEST_J / STEP_J)
    added_J: Array = np.linspace(first * STEP_J, last * STEP_J, last - first + 1)
    lines = [float(y[-1]) + slope * (added_J - row.J[-1]) for y, slope in zip((cT, cP), slopes, strict=True)]
    cP_at_zero = row.cP[-1] + slopes[1] * (zero_J - row.J[-1])
    branch = _blade_element(added_J, zero_J, slopes[0], cP_at_zero)
    mixed = [line + windmilling * (element - line) for line, element in zip(lines, branch, strict=True)]
    x = 2 * J / zero_J - 1
    bowed = cT * (1 + bow * (3 * x**2 - 1) / 2)
    inside = zero_J - J > 1e-6
    return Row(
        row.rpm,
        (*J[inside].tolist(), zero_J, *added_J.tolist()),
        (*bowed[inside].tolist(), 0.0, *mixed[0].tolist()),
        (*cP[inside].tolist(), cP_at_zero, *mixed[1].tolist()),
    )


def _blade_element(J: Array, zero_J: float, slope: float, cP_at_zero: float) -> tuple[Array, Array]:
    """(cT, cP) beyond zero thrust, each (n,), with the given slope of cT and value of cP at zero_J."""
    small = 1e-4
    steepness = float(_element_forces(np.array([zero_J + small]), zero_J)[0][0]) / small
    scale = slope / steepness
    axial, tangential = _element_forces(J, zero_J)
    torque_at_zero = float(_element_forces(np.array([zero_J]), zero_J)[1][0])
    # Power coefficient: 2 pi times torque, at the element's radius in diameters.
    per_force = 2 * np.pi * ELEMENT_RADIUS / 2
    return scale * axial, cP_at_zero + scale * per_force * (tangential - torque_at_zero)


def _element_forces(J: Array, zero_J: float) -> tuple[Array, Array]:
    """Forces along and across the axis, up to a factor; the force along the axis is zero at zero_J."""
    across = np.pi * ELEMENT_RADIUS
    inflow = np.arctan2(J, across)

    def forces(inflow: Array, J: Array, alpha_offset: float) -> tuple[Array, Array]:
        alpha = np.arctan2(zero_J, across) - inflow + alpha_offset
        CL = -STALLED_CL * np.tanh(LIFT_SLOPE_PER_RAD * alpha / -STALLED_CL)
        CD = SECTION_CD0 + STALLED_CD_PER_RAD2 * alpha**2
        q = J**2 + across**2
        return q * (CL * np.cos(inflow) - CD * np.sin(inflow)), q * (CL * np.sin(inflow) + CD * np.cos(inflow))

    # Zero thrust needs a little lift against the section's drag.
    at_zero = SECTION_CD0 * np.tan(np.arctan2(zero_J, across)) / LIFT_SLOPE_PER_RAD
    axial, tangential = forces(inflow, J, float(at_zero))
    residual = float(forces(np.arctan2([zero_J], across), np.array([zero_J]), float(at_zero))[0][0])
    return axial - residual, tangential
