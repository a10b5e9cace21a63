"""A second IMU, receiver, barometer or airspeed transducer has its own topic and its own health."""

from pathlib import Path

import pytest
from test_daemon import SteadySensorTruth, default_tray

from flightpower.daq.config import parse_tray
from flightpower.daq.daemon import record
from flightpower.daq.driver_factory import check_drivers
from flightpower.daq.tray_check import check_tray
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import DOUBLED, SECOND, Status
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.tray import I2C_BUS, FakeTray, TrayVariant

SECOND_BUS = "/dev/i2c-3"
SECOND_SENSORS = f"""
[[sensors]]
driver = "mpu9250"
bus = "{SECOND_BUS}"
second = true
axes = ["y", "-x", "z"]
[[sensors]]
driver = "ms5611"
bus = "{SECOND_BUS}"
second = true
[[sensors]]
driver = "ms5805"
bus = "{SECOND_BUS}"
second = true
[[sensors]]
driver = "honeywell"
bus = "{SECOND_BUS}"
part = "SSCDRRN005ND2A3"
measures = "airspeed"
second = true
[[sensors]]
driver = "ublox_ddc"
bus = "{SECOND_BUS}"
second = true
"""


class OtherTruth(SteadySensorTruth):
    """Gives the second sensors different values, so that an exchange shows."""

    force = (1.5, 0.2, -9.6)
    pressure = {"baro": 98_000.0, "static": 97_000.0}  # noqa: RUF012
    difference = {"alpha": 0.0, "beta": 0.0, "airspeed": 250.0}  # noqa: RUF012


@pytest.fixture
def doubled(tmp_path):
    """Clock, fake parts and tray with a second sensor of each kind."""
    clock = SimulatedClock()
    fake = FakeTray(SteadySensorTruth(), clock)
    other = FakeTray(OtherTruth(), clock, 7, variant=TrayVariant(gps_on_i2c=True))
    fake.buses[SECOND_BUS] = other.buses[I2C_BUS]
    text = default_tray(tmp_path, fake).text + SECOND_SENSORS
    return clock, fake, other, parse_tray(text, "tray.toml", tmp_path)


def test_each_second_sensor_has_its_own_topic(doubled):
    clock, fake, _, tray = doubled
    log = read_log(record(tray, buses=fake, clock=clock, until_ns=clock.now_ns() + 5 * 10**9).path)
    last = {topic: next(e.message for e in reversed(log.entries[topic]) if e.message.status is Status.OK) for topic in
            (name + end for name in DOUBLED for end in ("", SECOND))}  # fmt: skip
    assert last["/imu"].specific_force_x_mps2 == pytest.approx(0.5, abs=0.05)
    assert last["/imu/2"].specific_force_y_mps2 == pytest.approx(-1.5, abs=0.05)
    for topic, first_Pa, second_Pa in (("/baro", 99_000, 98_000), ("/static", 98_500, 97_000)):
        assert last[topic].pressure_Pa == pytest.approx(first_Pa, abs=10)
        assert last[topic + SECOND].pressure_Pa == pytest.approx(second_Pa, abs=10)
    assert last["/probe/airspeed"].differential_pressure_Pa == pytest.approx(310, abs=1)
    assert last["/probe/airspeed/2"].differential_pressure_Pa == pytest.approx(250, abs=1)
    assert last["/gps/2"].dynamic_model == 8 and last["/gps/2"].velocity_north_mps is not None


def test_the_second_imu_keeps_its_magnetometer_to_itself(doubled):
    """Its AK8963 would otherwise answer at the address of the first IMU's."""
    clock, fake, other, tray = doubled
    record(tray, buses=fake, clock=clock, until_ns=clock.now_ns() + 10**9)
    assert fake.imu.bypass and not other.imu.bypass


def test_a_failed_second_sensor_costs_its_own_topic_only(doubled):
    clock, fake, _, tray = doubled
    del fake.buses[SECOND_BUS]
    done = record(tray, buses=fake, clock=clock, until_ns=clock.now_ns() + 5 * 10**9)
    assert {name for name, count in done.errors.items() if count > 20} == {
        topic.strip("/").replace("/", "-") + "-2" for topic in DOUBLED
    }


def test_the_check_judges_a_second_sensor_as_the_first(doubled):
    clock, fake, _, tray = doubled
    lines = {line.topic: line for line in check_tray(tray, buses=fake, clock=clock, seconds=3).lines}
    for topic in DOUBLED:
        assert bool(lines[topic + SECOND].values) and len(lines[topic + SECOND].values) == len(lines[topic].values)
    assert "sky" not in lines["/imu/2"].advice


@pytest.mark.parametrize(
    ("sensors", "words"),
    [
        ('driver="ublox"\nport="/dev/a"\n[[sensors]]\ndriver="ublox"\nport="/dev/b"', "second = true"),
        ('driver="ms45xxdo"\nbus="b"\npart="MS4515DO-DS3AJ002DP"\nmeasures="alpha"\nsecond=true', "alpha"),
    ],
)
def test_two_of_a_kind_have_to_be_distinguished(sensors, words):
    with pytest.raises(InputError) as error:
        check_drivers(parse_tray(f"[[sensors]]\n{sensors}", "tray.toml", Path()), None)
    assert words in str(error.value)
