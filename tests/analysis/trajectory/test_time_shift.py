"""Tests time shifts between channels: a late probe is found to be late, and a punctual one raises no alarm."""

import flights
import numpy as np
import pytest

from flightpower.analysis.trajectory.consistency import calibrate, time_shift_notes, time_shifts
from flightpower.analysis.trajectory.reconstruction import reconstruct
from flightpower.flight.aircraft import load_aircraft
from flightpower.sim.sensors import load_budget

NEXSTAR = load_aircraft("nexstar")
LATE_S = 0.060


@pytest.fixture(scope="module")
def flight(probe):
    """Return drawn errors, simulated flight, table and probe of a calm full test flight; there is no extra lag."""
    errors = flights.draw_errors(load_budget("bench"), 2)
    flown, _, table = flights.flown(NEXSTAR, errors, "full-test-flight", 2)
    return errors, flown, table, probe


def reconstructed(table, probe):
    air, still, _ = flights.air_of(table, NEXSTAR, probe)
    return air, reconstruct(air, still)


@pytest.fixture(scope="module")
def as_flown(flight):
    """Return the air data and path of the flight as it is."""
    _, _, table, probe = flight
    return reconstructed(table, probe)


@pytest.fixture(scope="module")
def delayed(flight):
    """Return the trajectory of the same flight with a late probe."""
    _, _, table, probe = flight
    t = table.index.to_numpy()
    late = table.assign(
        **{name: np.interp(t - LATE_S, t, table[name]) for name in ("dp_alpha_Pa", "dp_beta_Pa", "q_c_Pa")}
    )
    return reconstructed(late, probe)[1]


@pytest.mark.slow
def test_a_delay_of_the_probe_is_found_to_a_twentieth(as_flown, delayed) -> None:
    """The comparison is with the undelayed flight, so noise cancels; 5 % are required of a calibration of the tubes.
    It comes out 4 % too small, more than its standard error; estimators.md lists this as known."""
    as_it_is, late = (
        {s.error: s for s in time_shifts(trajectory)}["air_data_lag"] for trajectory in (as_flown[1], delayed)
    )
    assert abs(as_it_is.delay_s) < 4 * as_it_is.standard_error_s
    assert late.delay_s - as_it_is.delay_s == pytest.approx(LATE_S, rel=0.05)


@pytest.mark.slow
def test_a_late_probe_is_reported_and_a_punctual_one_is_not(flight, as_flown, delayed) -> None:
    errors, flown, _, _ = flight
    air, as_it_is = as_flown
    assert time_shift_notes(as_it_is) == []
    assert any("The probe is" in note and "late against the IMU" in note for note in time_shift_notes(delayed))
    results = {s.error: s for s in time_shifts(delayed)}
    assert results["air_data_lag"].determined and results["gps_latency"].determined
    assert (
        abs(results["gps_latency"].delay_s - errors.values.gps_latency_s) < 4 * results["gps_latency"].standard_error_s
    )

    # `calibrate airspeed` is right on the same flight, whose legs go both ways.
    speed = calibrate(air, as_it_is)
    assert abs(speed.scale - errors.values.V_scale) < 4 * speed.scale_error
    truth = flown.truth[flown.truth["phase"] == "flight"]
    wind = np.hypot(truth["wind_north_mps"], truth["wind_east_mps"]).mean()
    assert speed.wind_mps == pytest.approx(wind, abs=0.3)
    assert speed.wind_from_deg == pytest.approx(310, abs=5)
    assert speed.notes == []


@pytest.mark.slow
def test_one_heading_and_a_missing_gps_are_noted(flight) -> None:
    _, _, table, probe = flight
    one_leg = table.loc[95.0:190.0]
    assert any("one direction" in note for note in calibrate(*reconstructed(one_leg, probe)).notes)
    without_gps = table.loc[:300.0].assign(gps_north_mps=np.nan, gps_east_mps=np.nan, gps_down_mps=np.nan)
    air, trajectory = reconstructed(without_gps, probe)
    assert any("No GPS" in note for note in calibrate(air, trajectory).notes)
    assert "does not show" in {s.error: s for s in time_shifts(trajectory)}["gps_latency"].in_words()


@pytest.mark.slow
def test_without_sideslip_the_reconstruction_converges_with_larger_errors(flight, as_flown) -> None:
    _, _, table, probe = flight
    _, as_it_is = as_flown
    _, without = reconstructed(table.assign(dp_beta_Pa=np.nan), probe)
    assert without.converged and np.isfinite(without.states.to_numpy()).all()
    assert without.standard_error("beta_bias") > 2 * as_it_is.standard_error("beta_bias")
