"""A simulated flight as PX4 and ArduPilot log it, with the traps of real logs: the true power is in the interval."""

import dataclasses
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.whole_flight import curve as estimate_module
from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate, estimate
from flightpower.analysis.methods.whole_flight.drag import (
    DragEstimate,
    DragLacks,
    DragWithheld,
    ThrustSource,
    drag_estimate,
)
from flightpower.analysis.methods.whole_flight.flight_table import FlightTable, flight_table
from flightpower.analysis.methods.whole_flight.thrust_balance import motor_constants
from flightpower.analysis.sources.ardupilot import read_ardupilot
from flightpower.analysis.sources.px4 import read_px4
from flightpower.analysis.sources.recording import AIRSPEED_PRESSURE, GPS, MOTOR, Channel, FlightRecording
from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.ardupilot_log import write_ardupilot_log
from flightpower.sim.fly import Flight, fly
from flightpower.sim.plan import load_plan
from flightpower.sim.px4_log import write_px4_log
from flightpower.sim.sensors import FlightSensorTruth, load_budget
from flightpower.sim.sensors.budget import DrawnErrors
from flightpower.sim.ulog_writer import UlogContents, UlogTopic, write_ulog
from tests.analysis.added_sensors import (
    SENSORS,
    Flown,
    assert_more_is_never_less,
    curves_by_sensors,
    with_sensors,
)

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
from electrical import true_power
from flights import draw_errors

AIRCRAFT = load_complete_aircraft("nexstar")
WEIGHT_N, GEOMETRY = AIRCRAFT.mass.weight_N, AIRCRAFT.geometry
PROPELLER = load_propeller(AIRCRAFT.propulsion.propeller)


@pytest.fixture(scope="module")
def flown() -> tuple[Flight, FlightSensorTruth, DrawnErrors]:
    errors = draw_errors(load_budget("study"), 3)
    flight = fly(AIRCRAFT, load_plan("ordinary-flight"), seed=3, deviations=errors.deviations)
    return flight, FlightSensorTruth(flight, errors), errors


def analyzed(recording: FlightRecording) -> tuple[FlightTable, ElectricalEstimate]:
    table = flight_table(recording, WEIGHT_N, GEOMETRY.wing_area_m2)
    return table, estimate(table, WEIGHT_N, GEOMETRY.wing_area_m2, GEOMETRY.span_m)


@pytest.mark.thorough
def test_text_and_telemetry_give_the_curve_of_the_dataflash_log(
    tmp_path: Path, flown: tuple[Flight, FlightSensorTruth, DrawnErrors]
) -> None:
    powers = []
    for name in ("log.BIN", "log.log", "log.tlog"):
        write_ardupilot_log(tmp_path / name, *flown)
        _, result = analyzed(read_ardupilot(tmp_path / name))
        powers.append(np.interp(np.linspace(14.0, 22.0, 5), result.V_mps, result.power_W))
    assert powers[1] == pytest.approx(powers[0], rel=1e-4)
    assert powers[2] == pytest.approx(powers[0], rel=1e-3)  # telemetry counts in mV, cA and hundredths of m/s


@pytest.mark.parametrize(
    ("write", "read", "faults", "note"),
    [
        (write_ardupilot_log, read_ardupilot, ["landed", "wrong-battery-first", "appended"], "BAT 1 measures"),
        (write_ardupilot_log, read_ardupilot, ["pressure-offset", "dropouts"], ""),
        (write_ardupilot_log, read_ardupilot, ["clock-jump"], "clock jumped"),
        (write_ardupilot_log, read_ardupilot, ["airborne-start", "truncated"], ""),
        (write_px4_log, read_px4, ["landed", "wrong-battery-first", "appended"], "battery_status 1 measures"),
        (write_px4_log, read_px4, ["pressure-offset", "dropouts"], "dropped"),
        (write_px4_log, read_px4, ["clock-jump"], "clock jumped"),
        (write_px4_log, read_px4, ["airborne-start", "truncated"], "no time on the ground"),
    ],
)
def test_traps(
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    flown: tuple[Flight, FlightSensorTruth, DrawnErrors],
    write: Callable[..., None],
    read: Callable[[Path], FlightRecording],
    faults: list[str],
    note: str,
) -> None:
    write(tmp_path / "log", *flown, faults)
    table, result = analyzed(read(tmp_path / "log"))
    true_W = true_power(AIRCRAFT, flown[0], flown[2], result.V_mps[::15], result.conditions.rho)
    assert (np.abs(result.power_W[::15] - true_W) < NORMAL_95 * result.standard_error_W[::15]).all()
    assert note in " ".join(table.notes)
    assert capfd.readouterr() == ("", "")  # the reader's library prints damaged bytes


def test_hovering_is_left_out(tmp_path: Path, px4_log: Path) -> None:
    """A VTOL that is a multicopter from 250 s on, while still flying."""
    ulog_topics = [
        UlogTopic(
            item.name, item.data["timestamp"], {k: x for k, x in item.data.items() if k != "timestamp"}, item.multi_id
        )
        for item in ULog(str(px4_log)).data_list
    ]
    late = ulog_topics[0].time_us[0] + np.uint64(250_000_000)
    for ulog_topic in ulog_topics:
        if ulog_topic.name == "vehicle_status":
            ulog_topic.columns["vehicle_type"] = np.where(ulog_topic.time_us > late, 1, 2).astype(np.uint8)
    path = tmp_path / "log.ulg"
    write_ulog(path, UlogContents(ulog_topics))
    table = flight_table(read_px4(path), WEIGHT_N, GEOMETRY.wing_area_m2)
    assert 220 < table.table.index[table.flown].max() < 251


@pytest.mark.slow
def test_without_airspeed(
    tmp_path: Path, flown: tuple[Flight, FlightSensorTruth, DrawnErrors], px4: FlightRecording
) -> None:
    """Velocity by GPS less the wind: 4 m/s at 20 ft, from 300 deg, which is 5.9 m/s at the median height of 60 m."""
    write_ardupilot_log(tmp_path / "00000001.BIN", *flown, ["no-airspeed"])
    recording = read_ardupilot(tmp_path / "00000001.BIN")
    table, result = analyzed(recording)
    assert result.airspeed.wind_mps == pytest.approx(5.9, abs=0.2)
    assert result.airspeed.wind_from_deg == pytest.approx(300.0, abs=2.0)
    V = result.V_mps[::15]
    true_W = true_power(AIRCRAFT, flown[0], flown[2], V, result.conditions.rho)
    assert (np.abs(result.power_W[::15] - true_W) < NORMAL_95 * result.standard_error_W[::15]).all()
    _, measured = analyzed(px4)
    widest = 2.5 * np.interp(V, measured.V_mps, measured.standard_error_W)
    assert (result.standard_error_W[::15] < widest).all()
    drag = drag_estimate(table, result, GEOMETRY.span_m, ThrustSource(PROPELLER))
    assert isinstance(drag, DragEstimate)
    without_gps = replace(recording, channels={k: x for k, x in recording.channels.items() if k not in GPS})
    with pytest.raises(InputError, match="lacks airspeed"):
        analyzed(without_gps)


@pytest.mark.thorough
@pytest.mark.slow
def test_a_wind_that_turns_hardly_show_is_reported(px4: FlightRecording, monkeypatch: pytest.MonkeyPatch) -> None:
    """One turn determines the wind less well than five; if it is too uncertain there is no curve."""
    blind = {k: x for k, x in px4.channels.items() if k != AIRSPEED_PRESSURE}
    until_s = px4.channels[GPS[0]].t_s[0] + 110.0
    one_turn = {k: Channel(x.t_s[x.t_s < until_s], x.value[x.t_s < until_s]) for k, x in blind.items()}
    few, many = (analyzed(replace(px4, channels=of))[1].airspeed.wind_covariance for of in (one_turn, blind))
    assert few is not None and many is not None
    worst = [float(np.sqrt(np.linalg.eigvalsh(item[:2, :2])[-1])) for item in (few, many)]
    assert worst[0] > 2 * worst[1]
    limit = dataclasses.replace(estimate_module.GPS, known_wind=(worst[0] + worst[1]) / 2 / 15.0)
    monkeypatch.setattr(estimate_module, "GPS", limit)
    with pytest.raises(InputError, match="headings hardly change"):
        analyzed(replace(px4, channels=one_turn))
    analyzed(replace(px4, channels=blind))


@pytest.fixture(scope="module")
def px4_log(tmp_path_factory, flown: tuple[Flight, FlightSensorTruth, DrawnErrors]) -> Path:
    path = tmp_path_factory.mktemp("px4") / "log.ulg"
    write_px4_log(path, *flown)
    return path


@pytest.fixture(scope="module")
def px4(px4_log: Path) -> FlightRecording:
    return read_px4(px4_log)


@pytest.mark.parametrize("without_speed", [False, True])
def test_drag_by_propeller_table_and_motor_speed_or_constants(
    px4: FlightRecording, flown: tuple[Flight, FlightSensorTruth, DrawnErrors], without_speed: bool
) -> None:
    channels = {name: channel for name, channel in px4.channels.items() if not (without_speed and name == MOTOR)}
    table, electrical = analyzed(replace(px4, channels=channels))
    estimate = drag_estimate(
        table, electrical, GEOMETRY.span_m, ThrustSource(PROPELLER, motor_constants(AIRCRAFT.propulsion))
    )
    assert isinstance(estimate, DragEstimate) and estimate.measured_speed != without_speed
    truth = flown[0].power_required
    faster = np.sqrt(truth["density_kgpm3"].iloc[0] / electrical.conditions.rho)
    V, error_W = estimate.V_mps[::15], estimate.curve.power_W.standard_error
    true_W = V * np.interp(V / faster, truth["speed_mps"], truth["drag_N"])
    assert (np.abs(estimate.power_W[::15] - true_W) < NORMAL_95 * error_W[::15]).all()
    assert (error_W[::15] < 0.09 * true_W).all()
    assert (estimate.shaft.value > estimate.power_W).all() and (estimate.shaft.value < electrical.power_W).all()


def test_what_drag_would_take(px4: FlightRecording) -> None:
    table, electrical = analyzed(px4)
    span_m, constants = GEOMETRY.span_m, motor_constants(AIRCRAFT.propulsion)
    assert drag_estimate(table, electrical, span_m, ThrustSource(None, constants)) == DragWithheld(DragLacks.PROPELLER)
    without = table._replace(table=table.table.assign(**{MOTOR: np.nan}))
    assert drag_estimate(without, electrical, span_m, ThrustSource(PROPELLER)) == DragWithheld(DragLacks.MOTOR_SPEED)
    electrical_speed = table._replace(table=table.table.assign(**{MOTOR: 7 * table.table[MOTOR]}))
    doubled = drag_estimate(electrical_speed, electrical, span_m, ThrustSource(PROPELLER))
    assert isinstance(doubled, DragWithheld) and doubled.lacks is DragLacks.POSSIBLE_EFFICIENCY
    assert "pole pairs" in doubled.sentence()


def test_motor_speed_and_parameters_are_read(
    tmp_path: Path, px4: FlightRecording, flown: tuple[Flight, FlightSensorTruth, DrawnErrors]
) -> None:
    write_ardupilot_log(tmp_path / "log.bin", *flown)
    ardupilot = read_ardupilot(tmp_path / "log.bin")
    assert px4.parameters["FW_AIRSPD_TRIM"] == 15.0 and ardupilot.parameters["ARSPD_RATIO"] == 2.0
    for recording in (px4, ardupilot):
        t_s, revps = recording.channels[MOTOR]
        true = flown[1].motor_speed_revps(t_s - (35.0 if recording is px4 else 81.0))
        assert np.abs(revps - true)[50:-50].max() < 3.0


def test_a_sensor_that_is_added_makes_no_curve_worse(
    px4: FlightRecording, flown: tuple[Flight, FlightSensorTruth, DrawnErrors]
) -> None:
    flight, _, errors = flown
    V = np.linspace(14.0, 20.0, 5)
    aircraft = Flown(
        WEIGHT_N, GEOMETRY.wing_area_m2, GEOMETRY.span_m, V,
        lambda result: true_power(AIRCRAFT, flight, errors, V, result.conditions.rho),
    )  # fmt: skip
    assert_more_is_never_less(curves_by_sensors(SENSORS, lambda sensors: with_sensors(px4, sensors), aircraft))
