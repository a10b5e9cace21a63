"""Air data of a flight with missing sensors: the rest stays right, the missing ones are reported, and nothing
breaks."""

import flights
import numpy as np
import pytest

from flightpower.analysis.air.air import _slow_flight, air_data, specific_force_at_cg
from flightpower.analysis.sources.daemon import speed_scale
from flightpower.analysis.sources.rest import rest_segments, without_zeros, zeros
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.sensors import load_budget

NEXSTAR = load_aircraft("nexstar")
IMU = ["ax_mps2", "ay_mps2", "az_mps2", "p_radps", "q_radps", "r_radps"]
CRUISE_S = (45.0, 75.0)
# Limits of the errors: about the noise of Table 4.1 at 12 m/s, the slowest speed.
SPEED_MPS, ANGLE_RAD = 0.5, np.radians(1.0)


@pytest.fixture(scope="module")
def flown():
    """Truth and table of the demonstration flight, without the vibration that the part's own filter takes out."""
    flight, _, table = flights.flown(NEXSTAR, flights.draw_errors(load_budget("bench"), 0), "accel-decel", 0)
    return flight.truth, table


def result(table, probe):
    still = rest_segments(table, 25.0)
    corrected, notes = without_zeros(table, zeros(table, still))
    propeller = load_propeller(NEXSTAR.propulsion.propeller)
    air = air_data(specific_force_at_cg(corrected, NEXSTAR), NEXSTAR, probe, propeller, speed_scale(NEXSTAR))
    return air._replace(notes=notes + air.notes)


def errors_of(air, truth, rows=CRUISE_S):
    """(speed, alpha) minus the truth, where both are known; rms over the seconds `rows`."""
    part = air.table.loc[rows[0] : rows[1]]
    t = part.index.to_numpy()
    speed = part["V_mps"] - np.interp(t, truth["time_s"], truth["V_mps"])
    alpha = part["alpha_rad"] - np.interp(t, truth["time_s"], truth["alpha_rad"])
    return float(np.sqrt(np.nanmean(speed**2))), float(np.sqrt(np.nanmean(alpha**2)))


def test_a_sound_flight_says_nothing(flown, probe) -> None:
    truth, table = flown
    air = result(table, probe)
    speed, alpha = errors_of(air, truth)
    assert speed < SPEED_MPS and alpha < ANGLE_RAD
    assert air.notes == []


def test_speed_follows_a_single_sample_of_dynamic_pressure_by_its_root(flown, probe) -> None:
    """Two percent of q_c are two percent of dynamic pressure and one percent of speed, at that sample only."""
    _, table = flown
    before = result(table, probe).table
    row = table.index.get_indexer([CRUISE_S[0]], method="nearest")[0]
    gust = table.copy()
    gust.iloc[row, gust.columns.get_loc("q_c_Pa")] += 0.02 * before["q_c_Pa"].iloc[row]
    ratio = (result(gust, probe).table / before.select_dtypes("float"))[["V_mps", "qbar_Pa"]].iloc[row - 1 : row + 2]
    assert ratio["V_mps"].tolist() == pytest.approx([1.0, 1.01, 1.0], abs=5e-4)
    assert ratio["qbar_Pa"].tolist() == pytest.approx([1.0, 1.02, 1.0], abs=1e-3)


@pytest.mark.parametrize("how", ["silent", "stuck"])
def test_a_dead_sideslip_transducer_costs_the_sideslip_only(flown, probe, how: str) -> None:
    """Speed and angle of attack stay as good as before: the maps hardly depend on a degree or two of sideslip."""
    truth, table = flown
    air = result(table.assign(dp_beta_Pa=np.nan if how == "silent" else 3.7), probe)
    complete = result(table, probe)
    assert errors_of(air, truth) == pytest.approx(errors_of(complete, truth), rel=0.05)
    assert air.table["beta_rad"].isna().all()
    assert air.table["flying"].sum() == pytest.approx(complete.table["flying"].sum(), rel=0.01)
    assert any("sideslip is not known" in note for note in air.notes)
    assert any("/probe/beta never changed" in note for note in air.notes) == (how == "stuck")


def test_moments_without_sideslip_cost_no_speed(flown, probe) -> None:
    _, table = flown
    holed = table.copy()
    holed.loc[50.0:52.0, "dp_beta_Pa"] = np.nan
    air = result(holed, probe)
    lost = air.table["beta_rad"].isna() & result(table, probe).table["beta_rad"].notna()
    assert lost.sum() == len(holed.loc[50.0:52.0])
    assert air.table.loc[50.0:52.0, ["V_mps", "alpha_rad"]].notna().all(axis=None)


def test_a_gap_of_everything_stays_a_gap(flown, probe) -> None:
    truth, table = flown
    holed = table.copy()
    holed.loc[55.0:60.0] = np.nan
    air = result(holed, probe)
    assert air.table.loc[55.0:60.0, ["V_mps", "alpha_rad", "beta_rad"]].isna().all(axis=None)
    assert not air.table.loc[55.0:60.0, "flying"].any()
    elsewhere = errors_of(air, truth, (45.0, 54.0)), errors_of(air, truth, (61.0, 75.0))
    assert all(speed < SPEED_MPS and alpha < ANGLE_RAD for speed, alpha in elsewhere)


def test_a_clipped_angle_is_not_taken_for_a_measurement(flown, probe) -> None:
    """Status removes clipped readings, so the table has gaps; speed also needs alpha's pressure and has the same
    gaps."""
    _, table = flown
    clipped = table.assign(dp_alpha_Pa=table["dp_alpha_Pa"].where(table["dp_alpha_Pa"] < 60.0))
    air = result(clipped, probe)
    lost = clipped["dp_alpha_Pa"].isna()
    assert lost.loc[CRUISE_S[0] : CRUISE_S[1]].any()
    assert air.table.loc[lost, ["V_mps", "alpha_rad"]].isna().all(axis=None)


def test_without_gps_and_without_rest_there_is_air_data_all_the_same(flown, probe) -> None:
    truth, table = flown
    deaf = table.assign(gps_north_mps=np.nan, gps_east_mps=np.nan, gps_down_mps=np.nan).loc[22.0:90.0]
    air = result(deaf, probe)
    speed, alpha = errors_of(air, truth)
    assert speed < SPEED_MPS and alpha < 2 * ANGLE_RAD  # zeros of 3 Pa are not subtracted
    assert any("never stood still" in note for note in air.notes)


def test_an_alpha_transducer_that_is_stuck_leaves_no_speed_and_says_why(flown, probe) -> None:
    _, table = flown
    air = result(table.assign(dp_alpha_Pa=12.0), probe)
    assert air.table["V_mps"].isna().all() and not air.table["flying"].any()
    assert any("/probe/alpha never changed" in note for note in air.notes)


def test_time_aloft_that_is_too_slow_to_be_flight_is_reported_in_per_cent_of_it() -> None:
    height_m = np.where(np.arange(200) < 100, 0.0, 50.0)
    slow = np.where(np.arange(200) >= 175, 20.0, 100.0)  # a quarter of the time aloft
    (message,) = _slow_flight(height_m, slow, 40.0, 1.0)
    assert message.startswith("25 % of the time above ") and "below 40 Pa" in message
    assert _slow_flight(height_m, np.where(np.arange(200) >= 199, 20.0, 100.0), 40.0, 1.0) == []
    assert _slow_flight(0 * height_m, slow, 40.0, 1.0) == []
    (low,) = _slow_flight(np.full(200, 50.0), slow, 40.0, 0.5)
    above = [float(text.split(" above ")[1].split(" m ")[0]) for text in (message, low)]
    assert above[1] == pytest.approx(above[0] / 2), "a small aircraft flies lower"
    assert _slow_flight(np.full(200, 11.0), slow, 40.0, 0.5) and not _slow_flight(np.full(200, 9.0), slow, 40.0, 0.5)
    assert _slow_flight(height_m, np.where(np.arange(200) >= 197, 20.0, 100.0), 40.0, 1.0), "3 % is reported"


def test_a_log_that_begins_in_the_air_is_high_enough_for_runs(flown, probe) -> None:
    """A segment cut out of a flight begins in the air, as its airspeed shows. The density stays the same."""
    _, table = flown
    segment = table.loc[slice(*CRUISE_S)]
    corrected, _ = without_zeros(table, zeros(table, rest_segments(table, 25.0)))
    propeller = load_propeller(NEXSTAR.propulsion.propeller)
    complete, cut = (
        air_data(specific_force_at_cg(part, NEXSTAR), NEXSTAR, probe, propeller, speed_scale(NEXSTAR))
        for part in (corrected, corrected.loc[segment.index])
    )
    assert complete.notes == [] and "begins and ends in the air" in " ".join(cut.notes)
    assert cut.table["height_m"].min() == pytest.approx(40.0)
    both = complete.table.loc[segment.index]
    apart = np.diff(cut.table["height_m"] - both["height_m"])
    assert np.abs(apart).max() < 0.01 * np.abs(np.diff(both["height_m"])).max()  # the air temperature scales the height
    assert (cut.table["rho"] / both["rho"] - 1).abs().max() < 0.01  # the tray had warmed by 2 K since the log began


def test_a_log_that_begins_in_the_air_and_lands_has_its_heights_above_the_last_point(flown, probe) -> None:
    _, table = flown
    corrected, _ = without_zeros(table, zeros(table, rest_segments(table, 25.0)))
    propeller = load_propeller(NEXSTAR.propulsion.propeller)
    late = specific_force_at_cg(corrected.loc[CRUISE_S[0] :], NEXSTAR)
    air = air_data(late, NEXSTAR, probe, propeller, speed_scale(NEXSTAR))
    assert air.table["height_m"].iloc[-25:].mean() == pytest.approx(0.0, abs=0.5)
    assert air.table["height_m"].iloc[:25].mean() > 30.0
