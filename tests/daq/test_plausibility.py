"""Readings that are plausible one by one but cannot be true together."""

import pytest

from flightpower.daq.plausibility import Plausibility
from flightpower.daq.sensors import Sample
from flightpower.daq.still_air_zero import DIFFERENCE, Zero, ZeroReading
from flightpower.flight.messages import (
    AbsolutePressure,
    Attitude,
    Battery,
    Comparison,
    DifferentialPressure,
    Event,
    Gps,
    Rpm,
    Status,
)
from flightpower.flight.probe_maps import FORMAT, PolynomialMap, ProbeMaps

SECOND_NS = 10**9
GPS = {
    "velocity_north_mps": 15.0, "velocity_east_mps": 0.0, "velocity_down_mps": 0.0,
    "fix_type": 3, "satellites": 12, "speed_accuracy_mps": 0.2,
    "dynamic_model": 8, "height_msl_m": 120.0,
}  # fmt: skip
ALPHA_RAD = 0.1
PROBE = ProbeMaps(  # alpha = 0.5 C_alpha, q_c is qbar
    format=FORMAT,
    alpha_rad=PolynomialMap([(1, 0)], [0.5]),
    beta_rad=PolynomialMap([(0, 1)], [0.5]),
    q_ratio=PolynomialMap([(0, 0)], [1.0]),
    hull=[(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)],
)
GOOD = {
    "/probe/alpha": DifferentialPressure(differential_pressure_Pa=135.0 * ALPHA_RAD / 0.5),
    "/attitude": Attitude(roll_rad=0.0, pitch_rad=ALPHA_RAD, yaw_rad=0.0),
    "/probe/airspeed": DifferentialPressure(differential_pressure_Pa=135.0),  # 15 m/s
    "/gps": Gps(**GPS),
    "/baro": AbsolutePressure(pressure_Pa=99_000.0),
    "/static": AbsolutePressure(pressure_Pa=98_950.0),
    "/battery": Battery(voltage_V=14.0, current_A=12.0),
    "/rpm": Rpm(motor_speed_revps=90.0),
}


def flown(plausibility: Plausibility, seconds: range, **changes) -> list[Event]:
    """Readings at 4 Hz; `changes` are by topic, with _ in place of /."""
    readings = GOOD | {f"/{topic.replace('_', '/')}": message for topic, message in changes.items()}
    events = []
    for quarter in range(4 * seconds.start, 4 * seconds.stop):
        now_ns = quarter * SECOND_NS // 4
        samples = [Sample(topic, now_ns, message) for topic, message in readings.items() if message is not None]
        events += plausibility.add(samples, now_ns)
    return events


def climbing(mps: float) -> Gps:
    return Gps(**{**GPS, "velocity_down_mps": -mps})


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
        (
            {"probe_alpha": DifferentialPressure(differential_pressure_Pa=-27.0)},
            Comparison.ANGLE_OF_ATTACK,
        ),  # exchanged
        ({"attitude": Attitude(roll_rad=0.0, pitch_rad=0.22)}, Comparison.ANGLE_OF_ATTACK),  # 7 deg
        ({"attitude": Attitude(roll_rad=0.0, pitch_rad=0.18)}, None),  # 4.6 deg
        ({"attitude": Attitude(roll_rad=0.6, pitch_rad=0.5)}, None),  # a turn
        ({"attitude": Attitude(roll_rad=0.0, pitch_rad=0.3), "gps": climbing(3.0)}, None),  # 0.2 rad steep
        ({"attitude": Attitude(roll_rad=0.0, pitch_rad=ALPHA_RAD), "gps": climbing(3.0)}, Comparison.ANGLE_OF_ATTACK),
        ({"probe_airspeed_2": DifferentialPressure(differential_pressure_Pa=140.0)}, None),
        ({"probe_airspeed_2": LINE_OFF}, Comparison.SECOND_SENSORS),
        ({"gps_2": Gps(velocity_north_mps=9.0, velocity_east_mps=0.0)}, Comparison.SECOND_SENSORS),
        ({"gps": None, "baro": None, "battery": None}, None),  # a sensor that is not there
    ],
)
def test_what_cannot_be_true_together_is_reported_once(changes, comparison):
    plausibility = Plausibility(PROBE)
    events = flown(plausibility, range(60), **changes)
    assert [event.compared for event in events] == [comparison] * (comparison is not None)
    assert [event.severity for event in events] == ["warning"] * (comparison is not None)
    assert list(plausibility._notified) == [comparison] * (comparison is not None)
    assert plausibility.implausible == [event.text for event in events]


def test_an_autopilots_attitude_is_not_believed_while_speed_changes():
    """The autopilot mistakes 3 m/s^2 for 17 deg of pitch: seven decelerations of 5 s, each followed by 3 s of steady
    speed."""
    plausibility, wrong = Plausibility(PROBE), {"attitude": Attitude(roll_rad=0.0, pitch_rad=0.4)}
    for start in range(0, 56, 8):
        for second in range(5):
            q_c = DifferentialPressure(differential_pressure_Pa=0.6 * (20 - 1.5 * second) ** 2)
            assert flown(plausibility, range(start + second, start + second + 1), probe_airspeed=q_c, **wrong) == []
        assert flown(plausibility, range(start + 5, start + 8)) == []


def test_zeros_of_the_ground_are_subtracted():
    reading = ZeroReading(mean=-54.0, standard_deviation=1.0, samples=250)
    zero = Zero(
        format="", taken_unix_ns=0, seconds=10.0, temperature_K={}, readings={"/probe/alpha": {DIFFERENCE: reading}}
    )
    plausibility = Plausibility(PROBE, zero)
    assert flown(plausibility, range(60), probe_alpha=DifferentialPressure(differential_pressure_Pa=-27.0)) == []


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
