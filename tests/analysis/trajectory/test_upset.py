"""If gusts of W20 = 15 kt stall a slow aircraft and turn it over, the rest of its flight is reconstructed."""

from dataclasses import replace

import numpy as np
import pytest
from flights import AirOf, Flown, air_of, draw_errors, flown, tunnel_probe

from flightpower.analysis.trajectory.observability import lost_notes
from flightpower.analysis.trajectory.reconstruction import reconstruct
from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.sim.like import scaled_from
from flightpower.sim.sensors import load_budget

SEED, KNOTS = 6, 15.0
SLOW = """name = "slow"
[geometry]
span = "1.741 m"
wing_area = "0.2837 m^2"
[mass]
weight = "9.64 N"
"""
IN_TURBULENCE_S = (162.0, 174.0)  # when it stalls, pitches through the vertical, and recovers


@pytest.fixture(scope="module")
def upset() -> tuple[Flown, AirOf]:
    model = load_complete_aircraft("nexstar")
    aircraft = replace(scaled_from(SLOW, "slow.toml", model), aerodynamics=model.aerodynamics)  # more induced drag
    flight = flown(aircraft, draw_errors(load_budget("study"), SEED), "two-pairs", SEED, KNOTS)
    return flight, air_of(flight.table, aircraft, tunnel_probe())


def test_after_an_upset_through_the_vertical_attitude_and_sensor_errors_are_found(upset) -> None:
    """Iterations that follow attitude through the vertical would diverge to angles of hundreds of radians."""
    flight, air = upset
    truth = flight.flight.truth
    assert np.degrees(truth["pitch_rad"].min()) < -75 and np.degrees(truth["roll_rad"].abs().max()) > 90
    trajectory = reconstruct(air.table, air.still)
    assert trajectory.converged
    assert 0 < len(trajectory.lost_s) <= 10  # blocks, two seconds
    assert all(IN_TURBULENCE_S[0] < lost_s < IN_TURBULENCE_S[1] for lost_s in trajectory.lost_s)
    errors = flight.sensor_truth._errors.values
    for name, true in (("alpha_scale", errors.alpha_scale), ("V_scale", errors.V_scale)):
        assert abs(trajectory.value(name) - true) < 3 * trajectory.standard_error(name) < 0.1
    t_s = trajectory.states.index.to_numpy()
    flying = trajectory.block_means.flying & ((t_s < IN_TURBULENCE_S[0] - 2) | (t_s > IN_TURBULENCE_S[1] + 2))
    for name, column in (("theta", "pitch_rad"), ("phi", "roll_rad")):
        off = trajectory.states[name].to_numpy() - np.interp(t_s, truth["time_s"], truth[column])
        assert np.degrees(np.sqrt(np.mean(np.angle(np.exp(1j * off[flying])) ** 2))) < 1.5
    (note,) = lost_notes(trajectory)
    assert f"{trajectory.lost_s[0]:.1f}" in note
    assert not lost_notes(replace(trajectory, lost_s=()))
