"""Files that firmware wrote: each curve, or each refusal, is the one that is known of it (their README)."""

import gzip
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from pymavlink import DFReader
from pyulog import ULog

from flightpower.analysis.methods.whole_flight.flight_table import flight_table
from flightpower.analysis.sources.ardupilot import read_ardupilot
from flightpower.analysis.sources.dataflash import DataflashLog
from flightpower.analysis.sources.px4 import read_px4
from flightpower.analysis.sources.recording import CURRENT, FORCE_Z, GPS, STATIC, THROTTLE, VOLTAGE
from flightpower.analysis.sources.telemetry import TelemetryLog
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2 as g
from tests.shared_data import beside, needs

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
from firmware_flights import AREA_M2, WEIGHT_N, of_flight

SHARED = beside("firmware")
pytestmark = needs(SHARED)
MIDDLE = slice(1, 6)  # 16 to 26 m/s


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "most", "widest"),
    [("arduplane-4.6-dev-sitl-calm.BIN.gz", 5, 7), ("arduplane-4.6-dev-sitl-4mps.BIN.gz", 8, 12)],
)
def test_power_under_an_energy_controller(name: str, most: float, widest: float) -> None:
    """Laps at ten airspeeds under TECS, calm and in wind with turbulence: the truth is that of calm air."""
    _, error, half, ratio, simulated = of_flight(SHARED / name)
    assert np.abs(error)[MIDDLE].max() < most
    assert (np.abs(error) < half).sum() >= 6
    assert half.max() < widest
    assert ratio[0] < 2.0 < ratio[1] and ratio[1] - ratio[0] < 0.3  # SIM_ARSPD_RATIO is 1.99
    assert simulated is not None and simulated.steady_windows > 20
    assert abs(simulated.airspeed_error) < 0.002 and simulated.airspeed_half_width < 0.01
    assert abs(simulated.power_error) < most / 100


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("arducopter-3.1.3-2014.bin", "multicopter"),
        ("arduplane-4.8-dev-kind0.BIN", r"lacks battery.*BATT_MONITOR is 0"),
        ("arduplane-4.7-dev-44s.BIN", r"4[345] s in the air"),
        ("arduplane-4.7-dev-ground.BIN", r"12.6 V and no current"),
        ("arduplane-4.2.3-aerobatic.BIN", r"barometer.*battery.*BATT_MONITOR is 0"),
        ("px4-1.11.3-f16.ulg", "current sensor never reads more than 1[0-9] W"),
    ],
)
def test_what_cannot_be_analyzed_is_refused_with_what_it_lacks(name: str, reason: str) -> None:
    path = SHARED / name
    read = read_px4 if path.suffix == ".ulg" else read_ardupilot
    with pytest.raises(InputError, match=reason):
        flight_table(read(path), WEIGHT_N, AREA_M2)


def test_old_currents_are_in_hundredths(tmp_path: Path) -> None:
    plane = tmp_path / "plane.bin"
    plane.write_bytes((SHARED / "arducopter-3.1.3-2014.bin").read_bytes().replace(b"ArduCopter", b"ArduPlane "))
    channels = read_ardupilot(plane).channels
    assert channels[VOLTAGE].value[[0, -1]] == pytest.approx([16.40, 15.64])  # 1640 and 1564 in the file
    assert channels[CURRENT].value.max() == pytest.approx(31.1)


def test_messages_of_kind_0_are_read() -> None:
    log = DataflashLog((SHARED / "arduplane-4.8-dev-kind0.BIN").read_bytes())
    assert len(log.columns("CTUN")["TimeUS"]) > 100 and np.all(np.diff(log.columns("CTUN")["TimeUS"]) > 0)


def test_every_message_of_a_ground_stations_recording_is_read() -> None:
    """195 pressures and forces, as pymavlink counts them; GPS and the airspeed shown were sent once less."""
    log = TelemetryLog((SHARED / "arduplane-sitl-2015.tlog").read_bytes())
    assert [len(log.columns(kind)["TimeUS"]) for kind in ("BARO", "IMU", "ARSP", "GPS")] == [195, 195, 194, 194]
    assert log.columns("BARO")["Press"][0] == pytest.approx(101320.58, abs=0.01)
    assert log.columns("IMU")["AccZ"][0] == pytest.approx(-0.968 * g)


# By kind of message, the fields that the reader uses, as pymavlink decodes them.
USED = {
    "ARSP": ("Airspeed", "Temp"), "BARO": ("Press", "Temp"), "BAT": ("Volt", "Curr"), "CURR": ("Volt", "Curr"),
    "IMU": ("AccX", "AccZ"), "GPS": ("Spd", "GCrs", "VZ", "Status", "Lat", "Lng"),
    "CTUN": ("ThO", "ThrOut"), "MODE": ("ModeNum",),
    "AETR": ("Thr",), "RCOU": ("C3",), "QTUN": ("ThO",), "ESC": ("RPM", "Curr"), "SIM2": ("As",),
}  # fmt: skip


@pytest.mark.parametrize(
    "name",
    [
        "arducopter-3.1.3-2014.bin",
        "arduplane-4.2.3-aerobatic.BIN",
        "arduplane-4.7-dev-44s.BIN",
        "arduplane-4.7-dev-ground.BIN",
        "arduplane-4.8-dev-kind0.BIN",
        pytest.param("arduplane-4.6-dev-sitl-calm.BIN.gz", marks=pytest.mark.thorough),
        pytest.param("arduplane-4.6-dev-sitl-4mps.BIN.gz", marks=pytest.mark.thorough),
    ],
)
def test_every_message_and_value_is_that_of_pymavlink(name: str, tmp_path: Path) -> None:
    path, data = tmp_path / "log.BIN", (SHARED / name).read_bytes()
    path.write_bytes(gzip.decompress(data) if name.endswith(".gz") else data)
    log, reader = DataflashLog(path.read_bytes()), DFReader.DFReader_binary(str(path))
    counts = {  # it counts a last message that the file's end cuts off
        kind: sum(offset + reader.formats[i].len <= reader.data_len for offset in reader.offsets[i])
        for i, kind in reader.id_to_name.items()
        if kind != "FMT"
    }
    counted = {kind: n for kind, n in counts.items() if n}
    own = {kind: len(next(iter(columns.values()))) for kind in counted if (columns := log.columns(kind))}
    assert own == counted
    values = defaultdict(list)
    while (message := reader.recv_match(type=list(USED))) is not None:
        for field in USED[message.get_type()]:
            if field in message.get_fieldnames():
                values[message.get_type(), field].append(getattr(message, field))
    assert len(values) >= 4
    for (kind, field), expected in values.items():
        assert log.columns(kind)[field] == pytest.approx(np.array(expected, dtype=float), rel=1e-9, nan_ok=True)


def test_every_value_of_px4_is_that_of_pyulog() -> None:
    """And of a channel no sample is left out, unless PX4 took the airspeed from elsewhere."""
    path = SHARED / "px4-1.11.3-f16.ulg"
    log, read = ULog(str(path)), read_px4(path)
    for channel, topic, field, factor in (
        (VOLTAGE, "battery_status", "voltage_v", 1.0),
        (CURRENT, "battery_status", "current_a", 1.0),
        (THROTTLE, "actuator_controls_0", "control[3]", 1.0),
        (STATIC, "vehicle_air_data", "baro_pressure_pa", 1.0),
        (FORCE_Z, "sensor_combined", "accelerometer_m_s2[2]", 1.0),
        (GPS[0], "vehicle_gps_position", "vel_n_m_s", 1.0),
    ):
        data = log.get_dataset(topic).data
        inside = (data["timestamp"] * 1e-6 >= read.channels[channel].t_s[0] - 1e-6) & (
            data["timestamp"] * 1e-6 <= read.channels[channel].t_s[-1] + 1e-6
        )
        assert read.channels[channel].value == pytest.approx(factor * data[field][inside].astype(float)), channel
