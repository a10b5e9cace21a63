"""Readings that are in order one by one, and cannot be true together."""

import pytest

from daq.plausibility import Comparison, Plausibility
from daq.sensors import Sample
from flight.messages import AbsolutePressure, Battery, DifferentialPressure, Event, Gps, Rpm, Status

SECOND_NS = 10**9
GPS = {
    "velocity_north_mps": 15.0, "velocity_east_mps": 0.0, "fix_type": 3, "satellites": 12, "speed_accuracy_mps": 0.2,
    "dynamic_model": 8, "height_msl_m": 120.0,
}  # fmt: skip
GOOD = {
    "/probe/airspeed": DifferentialPressure(differential_pressure_Pa=135.0),  # 15 m/s
    "/gps": Gps(**GPS),
    "/baro": AbsolutePressure(pressure_Pa=99_000.0),
    "/static": AbsolutePressure(pressure_Pa=98_950.0),
    "/battery": Battery(voltage_V=14.0, current_A=12.0),
    "/rpm": Rpm(motor_speed_revps=90.0),
}


def flown(plausibility: Plausibility, seconds: range, **changes) -> list[Event]:
    """Readings at 4 Hz; changes: by topic, with _ in place of /."""
    readings = GOOD | {f"/{topic.replace('_', '/')}": message for topic, message in changes.items()}
    events = []
    for quarter in range(4 * seconds.start, 4 * seconds.stop):
        now_ns = quarter * SECOND_NS // 4
        samples = [Sample(topic, now_ns, message) for topic, message in readings.items() if message is not None]
        events += plausibility.add(samples, now_ns)
    return events


LINE_OFF = DifferentialPressure(differential_pressure_Pa=0.0)


@pytest.mark.parametrize(
    ("changes", "comparison"),
    [
        ({}, None),
        ({"probe_airspeed": LINE_OFF}, Comparison.AIRSPEED),
        ({"probe_airspeed": DifferentialPressure(differential_pressure_Pa=500.0)}, Comparison.AIRSPEED),
        ({"probe_airspeed": DifferentialPressure(differential_pressure_Pa=30.0)}, None),  # 8 m/s of tail wind
        ({"static": AbsolutePressure(pressure_Pa=100_000.0)}, Comparison.BAROMETERS),
        ({"rpm": Rpm(motor_speed_revps=0.0)}, Comparison.MOTOR),
        ({"rpm": Rpm(status=Status.NO_DATA)}, Comparison.MOTOR),
        ({"rpm": Rpm(motor_speed_revps=0.0), "battery": Battery(current_A=0.8)}, None),
        ({"gps": Gps(**{**GPS, "dynamic_model": 0})}, Comparison.GPS),
        ({"gps": Gps(**{**GPS, "satellites": 4})}, Comparison.GPS),
        ({"gps": Gps(**{**GPS, "speed_accuracy_mps": 1.4})}, Comparison.GPS),
        ({"gps": None, "baro": None, "battery": None}, None),  # a sensor that is not there
    ],
)
def test_what_cannot_be_true_together_is_told_once(changes, comparison):
    plausibility = Plausibility()
    events = flown(plausibility, range(60), **changes)
    assert [event.severity for event in events] == ["warning"] * (comparison is not None)
    assert list(plausibility._told) == [comparison] * (comparison is not None)
    assert plausibility.implausible == [event.text for event in events]


def test_five_seconds_make_it_news_and_five_seconds_end_it():
    plausibility = Plausibility()
    assert flown(plausibility, range(0, 10)) == []
    assert flown(plausibility, range(10, 14), probe_airspeed=LINE_OFF) == []  # a gust, or a drop of water
    assert flown(plausibility, range(14, 20)) == []
    assert len(flown(plausibility, range(20, 27), probe_airspeed=LINE_OFF)) == 1
    (again,) = flown(plausibility, range(27, 40))
    assert again.severity == "info" and plausibility.implausible == []


def test_values_are_those_of_the_latest_readings_and_none_when_they_are_old():
    plausibility = Plausibility()
    flown(plausibility, range(2))
    values = plausibility.values(2 * SECOND_NS)
    assert values.airspeed_mps == pytest.approx(15.0)
    assert (values.height_msl_m, values.satellites, values.motor_speed_revps) == (120.0, 12, 90.0)
    assert plausibility.values(10 * SECOND_NS).airspeed_mps is None
