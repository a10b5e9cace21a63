"""Telemetry of Paparazzi: fields and units, two messages of one airspeed, two aircraft, gaps; and two real flights."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from flightpower.analysis.methods.whole_flight.curve import estimate
from flightpower.analysis.methods.whole_flight.flight_table import flight_table
from flightpower.analysis.sources import recording
from flightpower.analysis.sources.paparazzi import read_paparazzi
from flightpower.analysis.sources.recognize import Autopilot, autopilot_of
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2 as g
from tests.analysis.added_sensors import (
    SENSORS,
    Flown,
    assert_more_is_never_less,
    curves_by_sensors,
    with_sensors,
)
from tests.shared_data import beside, needs

FLOWN = beside("real-flights") / "daredevil-2020-07-10-flight2.data.gz"
WEIGHT_N, WING_AREA_M2, SPAN_M = 0.75 * g, 0.23, 1.0
AIR_DATA, AIRSPEED = b" AIR_DATA ", b" AIRSPEED "


def lines(aircraft: int = 20, seconds: int = 100) -> list[str]:
    """Level flight to the east at 12 m/s with 20 W; the differential pressure's zero is 3 Pa."""
    out = []
    for t in range(1, seconds):
        for message in (
            f"AIR_DATA -1. {0.5 * 1.225 * 144 + 3:.3f} 20. -1. 0. 12. 12.",
            "AIRSPEED 12. 0. 0. 0.",
            "ENERGY 55 11.5 1.74 20.0 0.1 1.0",
            "GPS 3 36028159 481361026 900 250000 1200 -150 2113 30382600 31 0",
            "IMU_ACCEL 0.5 0.1 -9.8",
            "ATTITUDE 0. 0. 0.",
        ):
            out.append(f"{t + 0.001 * len(out) % 1:.3f} {aircraft} {message}")
    return out


def written(path: Path, text: list[str]) -> Path:
    path.write_text("\n".join(text) + "\n")
    return path


def test_fields_have_their_units(tmp_path: Path) -> None:
    path = written(tmp_path / "log.data", lines())
    assert autopilot_of(path) == Autopilot.PAPARAZZI
    read = read_paparazzi(path)
    median = {name: float(np.median(channel.value)) for name, channel in read.channels.items()}
    assert median[recording.AIRSPEED_PRESSURE] == pytest.approx(0.5 * 1.225 * 144 + 3, abs=0.01)
    assert (median[recording.VOLTAGE], median[recording.CURRENT]) == (11.5, 1.74)
    assert median[recording.THROTTLE] == 0.55
    north, east, down = (median[name] for name in recording.GPS)
    assert read.fix.unix_at_zero_s == pytest.approx(1_593_937_564.6, abs=100) and read.fix.latitude_deg is None
    assert (north, east, down) == pytest.approx((0.0, 12.0, 1.5), abs=1e-9)
    assert median[recording.FORCE_Z] == -9.8
    # The barometer is not connected; the GPS height stands in for it, 250 m in the standard atmosphere.
    assert median[recording.STATIC] == pytest.approx(98_358, abs=30)
    assert float(read.thermometers["AIR_DATA"].value[0]) == pytest.approx(293.15)


@pytest.mark.parametrize("damaged", ["1e400", "-inf", "nan", "1e300"])
def test_a_damaged_number_spoils_no_other(tmp_path: Path, damaged: str) -> None:
    """A damaged position, course and pressure are left out without a warning of a library; the others stay."""
    text = lines()
    number = next(i for i, line in enumerate(text) if " GPS " in line)
    for field, row in ((4, number), (6, number + 6)):  # north of the first position, course of the second
        words = text[row].split(" ")
        words[field] = damaged
        text[row] = " ".join(words)
    text[0] = text[0].replace("-1. ", f"{damaged} ", 1)
    read = read_paparazzi(written(tmp_path / "log.data", text))
    assert np.median(read.channels[recording.GPS[1]].value) == pytest.approx(12.0)
    assert all(len(item.t_s) == 97 and np.ptp(item.value) == 0 for item in read.place.values())


def test_two_messages_of_one_sensor_are_used_together(tmp_path: Path) -> None:
    both = read_paparazzi(written(tmp_path / "log.data", lines())).channels[recording.AIRSPEED_PRESSURE]
    alone = read_paparazzi(written(tmp_path / "alone.data", [line for line in lines() if "AIRSPEED" not in line]))
    assert len(both.t_s) == 2 * len(alone.channels[recording.AIRSPEED_PRESSURE].t_s)
    assert np.ptp(both.value) < 0.01  # both have one zero, found from the raw pressure


def test_compressed_file_is_recognized_by_its_content(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    path.write_bytes(gzip.compress("\n".join(lines()).encode()))
    assert autopilot_of(path) == Autopilot.PAPARAZZI
    assert len(read_paparazzi(path).channels[recording.VOLTAGE].t_s) == 99


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (sorted(lines(20) + lines(7)), "2 aircraft, (20, 7|7, 20)"),
        ([line.replace("ENERGY 55 11.5 1.74 20.0 0.1 1.0", "ENERGY 11.5 1.74") for line in lines()], "ENERGY"),
    ],
)
def test_refused_in_one_line(tmp_path: Path, text: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message) as raised:
        read_paparazzi(written(tmp_path / "log.data", text))
    assert "\n" not in str(raised.value)


def test_a_log_of_gaps_is_refused_for_its_gaps(tmp_path: Path) -> None:
    half_of_lines = [line for line in lines(seconds=600) if float(line.split()[0]) % 30 < 15]
    with pytest.raises(InputError, match=r"broken up by gaps, for 1\d s at most"):
        flight_table(read_paparazzi(written(tmp_path / "log.data", half_of_lines)), WEIGHT_N, WING_AREA_M2)


@pytest.mark.slow
@needs(FLOWN)
@pytest.mark.parametrize(
    "without", [None, *(pytest.param(item, marks=pytest.mark.thorough) for item in (AIR_DATA, AIRSPEED))]
)
def test_either_airspeed_message_gives_the_curve_of_level_windows(tmp_path: Path, without: bytes | None) -> None:
    """The reference is the mean battery power in level windows of 8 s of the same flight, by measured airspeed."""
    path = tmp_path / "flight.data"
    with gzip.open(FLOWN) as stream:
        path.write_bytes(b"".join(line for line in stream if without is None or without not in line))
    electrical = estimate(flight_table(read_paparazzi(path), WEIGHT_N, WING_AREA_M2), WEIGHT_N, WING_AREA_M2, SPAN_M)
    measured_mps = np.array([12.4, 12.7, 13.1, 13.4])
    power_W = np.interp(measured_mps / (1 + electrical.airspeed.scale), electrical.V_mps, electrical.power_W)
    assert power_W == pytest.approx([17.9, 19.7, 20.4, 21.5], rel=0.08)


@pytest.mark.thorough
@needs(FLOWN)
def test_a_sensor_that_is_added_makes_no_curve_of_a_real_flight_worse(tmp_path: Path) -> None:
    """The reference is the mean power of its level windows, by measured airspeed (docs/evidence/real-flights.md)."""
    unpacked = tmp_path / "flight.data"
    unpacked.write_bytes(gzip.decompress(FLOWN.read_bytes()))
    read = read_paparazzi(unpacked)
    level_W = np.array([17.9, 19.7, 20.4, 21.5])
    aircraft = Flown(WEIGHT_N, WING_AREA_M2, SPAN_M, np.array([12.4, 12.7, 13.1, 13.4]), lambda _: level_W)
    sensors = curves_by_sensors(SENSORS, lambda sensors: with_sensors(read, sensors), aircraft)
    assert_more_is_never_less(sensors)
    assert sum(curve is not None for curve in sensors.values()) == 4  # those with a pitot: turns do not show the wind
