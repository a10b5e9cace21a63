"""Computes the shipped propeller tables that no wind tunnel measured, from a blade's geometry.

    python benchmarks/blade_elements.py 11 5 1200 2000 3000 4200 5500 7000 > flight/data/propellers/blade-11x5.csv
    python benchmarks/blade_elements.py 16 10 1000 2000 3000 4500 6500 > flight/data/propellers/blade-16x10.csv

It uses blade elements in the flow of a helical wake (M. Drela, QPROP formulation, MIT 2006), which hold from standstill
through zero thrust. The propellers have two blades of constant pitch with the thin cambered section of electric
propellers, whose drag falls with the square root of Reynolds number. Simulated aircraft fly them; they do not claim to
match any propeller on sale. For a 10x5 at 6000 rpm and J from 0.15 to 0.55, cT and cP are within 8 % of the values that
UIUC measured for the APC 10x5E.
"""

from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from flightpower.flight.propeller import Propeller, Row
from flightpower.flight.propeller_files import INCH_M

Array = NDArray[np.float64]

BLADES, ELEMENTS, HUB = 2, 40, 0.12  # HUB: fraction of the radius without blade
RHO, NU = 1.225, 1.46e-5  # properties of air at sea level
LIFT_SLOPE, ZERO_LIFT_RAD, MOST_LIFT, LEAST_LIFT = 5.7, np.radians(-4.0), 1.2, -0.7
# Section drag: least value at Re = 100 000, lift coefficient there, rise with lift, and a plate across the flow.
LEAST_DRAG, CL_LEAST_DRAG, DRAG_RISE, PLATE_DRAG = 0.018, 0.4, 0.02, 1.2
POINTS, BEYOND = 25, 0.35  # points in a row, and how far in J it goes beyond zero thrust: windmilling in a dive


def section(alpha: Array, reynolds: Array) -> tuple[Array, Array]:
    """Return cl and cd. cl saturates smoothly; the more of it is lost, the more cd approaches that of a plate."""
    linear = LIFT_SLOPE * (alpha - ZERO_LIFT_RAD)
    limit = np.where(linear > 0, MOST_LIFT, -LEAST_LIFT)
    cl = limit * np.tanh(linear / limit)
    separated = 1 - cl / np.where(np.abs(linear) < 1e-9, 1e-9, linear)
    attached = LEAST_DRAG * np.sqrt(1e5 / reynolds) + DRAG_RISE * (cl - CL_LEAST_DRAG) ** 2
    return cl, attached + np.clip(separated, 0, 1) * PLATE_DRAG * np.sin(alpha) ** 2


def coefficients(J: float, rpm: float, diameter_m: float, pitch_m: float) -> tuple[float, float]:
    """Return cT and cP. Bisection finds each element's wake angle psi: wake and lift have the same circulation."""
    R, n = diameter_m / 2, rpm / 60
    r = R * (HUB + (1 - HUB) * (np.arange(ELEMENTS) + 0.5) / ELEMENTS)
    chord = 0.20 * R * (1 - ((r / R - 0.45) / 0.78) ** 2)
    V, turning = J * n * diameter_m, 2 * np.pi * n * r
    U = np.hypot(V, turning)

    def element(psi: Array) -> tuple[Array, ...]:
        axial, tangential = (V + U * np.sin(psi)) / 2, (turning + U * np.cos(psi)) / 2
        W = np.hypot(axial, tangential)
        wake = r / R * np.maximum(axial, 1e-6) / tangential
        tip_loss = 2 / np.pi * np.arccos(np.exp(-BLADES / 2 * (1 - r / R) / wake))
        circulation = (turning - tangential) * 4 * np.pi * r / BLADES * tip_loss
        circulation *= np.hypot(1, 4 * wake * R / (np.pi * BLADES * r))
        cl, cd = section(np.arctan(pitch_m / (2 * np.pi * r)) - np.arctan2(axial, tangential), W * chord / NU)
        return circulation - W * chord * cl / 2, W, axial, tangential, cl, cd

    low, high = np.full(ELEMENTS, -0.3), np.full(ELEMENTS, np.pi / 2)
    for _ in range(60):
        middle = (low + high) / 2
        above = element(middle)[0] > 0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    _, W, axial, tangential, cl, cd = element((low + high) / 2)
    force = RHO / 2 * W * chord * BLADES * (R - HUB * R) / ELEMENTS
    thrust_N = float(np.sum(force * (cl * tangential - cd * axial)))
    torque_Nm = float(np.sum(force * (cl * axial + cd * tangential) * r))
    return thrust_N / (RHO * n**2 * diameter_m**4), 2 * np.pi * torque_Nm / (RHO * n**2 * diameter_m**5)


def row(rpm: float, diameter_m: float, pitch_m: float) -> Row:
    grid = np.linspace(0, 2 * pitch_m / diameter_m, 200)
    thrust = [coefficients(J, rpm, diameter_m, pitch_m)[0] for J in grid]
    end = grid[int(np.argmax(np.array(thrust) < 0))] + BEYOND
    J = np.round(np.linspace(0, end, POINTS), 3)
    cT, cP = np.round([coefficients(j, rpm, diameter_m, pitch_m) for j in J], 4).T
    return Row(rpm, tuple(J.tolist()), tuple(cT.tolist()), tuple(cP.tolist()))


def main(
    diameter: Annotated[float, typer.Argument(help="[in]")],
    pitch: Annotated[float, typer.Argument(help="[in]")],
    rpm: Annotated[list[float], typer.Argument(help="Speeds of rotation.")],
) -> None:
    name = f"blade-{diameter:g}x{pitch:g}"
    rows = tuple(row(speed, diameter * INCH_M, pitch * INCH_M) for speed in rpm)
    source = f"{diameter:g}x{pitch:g}, two blades of constant pitch, computed (benchmarks/blade_elements.py)"
    print(Propeller(name, round(diameter * INCH_M, 4), rows, source).to_csv(), end="")


if __name__ == "__main__":
    typer.run(main)
