"""Porpoising to a load factor: the pilot moves the stick as much as the aircraft needs."""

import pytest

from flightpower.sim.integration import Observation
from flightpower.sim.maneuvers import PorpoiseSegment
from flightpower.sim.pilot import PilotWander, Targets, drawn_phases
from flightpower.sim.plan_segment import FlightContext


@pytest.mark.parametrize("load_per_rad", [2.0, 8.0])
def test_the_load_factor_reaches_what_is_asked(load_per_rad: float):
    context = FlightContext(10.0, 25.0, 0.02, 40.0, 0.0, 17.0)
    seen = Observation(17.0, *[0.0] * 10, load_factor=1.0, forward_mps2=0.0)
    flying = PorpoiseSegment(duration_s=30.0, load=0.6, elevator_rad=0.14, speed_mps=17.0).fly(seen, context)
    loads, targets = [], next(flying)
    for _ in range(1400):
        loads.append(1 + load_per_rad * targets.elevator_rad)
        targets = flying.send(seen._replace(load_factor=loads[-1]))
    expected = min(0.6, load_per_rad * 0.3142)  # 18 deg of elevator at most
    assert max(loads[-200:]) - 1 == pytest.approx(expected, rel=0.1)


def test_speed_wanders_within_its_size():
    wander = PilotWander(speed_mps=1.0)
    phases = drawn_phases(3)
    speeds = [wander.wandering(Targets(speed_mps=15.0), 0.1 * i, phases).speed_mps for i in range(600)]
    assert 0.5 < max(speeds) - 15.0 <= 1.0 and -1.0 <= min(speeds) - 15.0 < -0.5
