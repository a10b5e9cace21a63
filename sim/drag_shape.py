"""Drag that is not parabolic in lift: the part that a simulated aircraft has beyond (3.36), and that its file omits."""

from dataclasses import dataclass

import numpy as np

from flightpower.flight.aerodynamics import Aerodynamics
from flightpower.flight.number import Number

# The low-drag range of a NACA 6-series section at low Reynolds number: some 0.25 of lift coefficient to either side of
# the design lift, and 0.001 to 0.002 deep (Abbott & von Doenhoff, Theory of Wing Sections, sec. 7.4).
BUCKET_CL, BUCKET_HALF_WIDTH = 0.4, 0.25
REFERENCE_CL = 0.5  # the aircraft file's coefficients hold at the speed of this lift coefficient


@dataclass(frozen=True, kw_only=True)
class DragShape:
    """quartic : CD += quartic (CL - CL_minD)^4     bucket : CD -= bucket within a range of lift coefficients
    reynolds_exponent : CD0 changes with V to the power of minus this; friction is 0.2 turbulent and 0.5 laminar
    (Schlichting, Boundary-Layer Theory)
    """

    quartic: float = 0.0
    bucket: float = 0.0
    reynolds_exponent: float = 0.0

    def added_CD(self, aero: Aerodynamics, CL: Number, V: Number, reference_mps: float) -> Number:
        """Difference from the parabola, elementwise. V: airspeed; reference_mps: airspeed where CD0 is the file's."""
        CD = self.quartic * (CL - aero.CL_minD) ** 4
        if self.bucket:
            CD = CD - self.bucket * np.exp(-(((CL - BUCKET_CL) / BUCKET_HALF_WIDTH) ** 4))
        if self.reynolds_exponent:
            # Limited to 0.3 to 3 times the reference, because a stopped aircraft has no Reynolds number.
            ratio = np.clip(V / reference_mps, 0.3, 3.0)
            CD = CD + aero.CD0 * (np.power(ratio, -self.reynolds_exponent) - 1)
        return CD


PARABOLA = DragShape()
