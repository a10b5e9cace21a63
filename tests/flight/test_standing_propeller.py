"""The drag of a propeller that stands still: Hoerner's plates in the flow."""

import pytest

from flightpower.flight.propeller import Propeller, Row

DIAMETER_M, SPEED_MPS, DENSITY_KGPM3 = 0.305, 15.0, 1.2
ROWS = (Row(5000, (0.0, 0.8), (0.1, 0.0), (0.05, 0.01)),)


def standing_drag_N(beyond_zero_thrust: str) -> float:
    propeller = Propeller("12x8", DIAMETER_M, ROWS, beyond_zero_thrust=beyond_zero_thrust)
    return -float(propeller.standing_thrust(SPEED_MPS, DENSITY_KGPM3))


def test_standing_blades_have_the_drag_of_two_flat_plates_at_thirty_degrees() -> None:
    """Two blades 21 mm wide and 152 mm long, half of it across the flow, drag coefficient 1.2: 3260 mm^2, 0.53 N."""
    plates_m2 = 2 * 0.0214 * 0.1525 * 0.5
    assert standing_drag_N("windmill") == pytest.approx(1.2 * plates_m2 * 135.0, rel=0.01)


def test_folded_blades_have_skin_friction_only() -> None:
    """Two blades, two sides each, friction coefficient 0.011 of a turbulent plate: 0.019 N."""
    wetted_m2 = 2 * 2 * 0.0214 * 0.1525
    assert standing_drag_N("fold") == pytest.approx(0.011 * wetted_m2 * 135.0, rel=0.01)
