"""Files that firmware wrote: each curve, or each refusal, is the one that is known of it (their README)."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from analysis.autopilot_logs.ardupilot import read_ardupilot
from analysis.autopilot_logs.dataflash import DataflashLog
from analysis.autopilot_logs.px4 import read_px4
from analysis.autopilot_logs.recording import CURRENT, VOLTAGE
from analysis.autopilot_logs.telemetry import TelemetryLog
from analysis.electrical.estimate import ElectricalEstimate, estimate
from analysis.electrical.flight_table import flight_table
from analysis.estimation.noise import NORMAL_95
from analysis.results.autopilot_parameters import typed_in
from analysis.results.electrical import UNKNOWN
from analysis.results.electrical_parameters import flight_values
from flight.errors import InputError
from flight.units import GRAVITY_MPS2 as g
from tests.shared_data import beside, needs

SHARED = beside("firmware")
pytestmark = needs(SHARED)
WEIGHT_N, AREA_M2, SPAN_M = 2.0 * g, 0.45, 1.88
# Level flight in calm air: true airspeed [m/s] and electrical power [W], by the simulation's own state.
SPEEDS_MPS = np.array([14.4, 16.5, 17.6, 19.6, 22.7, 25.7, 28.9])
TRUTH_W = np.array([31.6, 47.0, 59.8, 89.9, 157.1, 255.7, 396.5])
MIDDLE = slice(1, 6)  # 16 to 26 m/s


def curve(name: str, folder: Path) -> ElectricalEstimate:
    path = folder / "log.BIN"
    path.write_bytes(gzip.decompress((SHARED / name).read_bytes()))
    return estimate(flight_table(read_ardupilot(path), WEIGHT_N, AREA_M2), WEIGHT_N, AREA_M2, SPAN_M)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "most", "widest"),
    [("arduplane-4.6-dev-sitl-calm.BIN.gz", 0.05, 0.07), ("arduplane-4.6-dev-sitl-4mps.BIN.gz", 0.08, 0.12)],
)
def test_power_under_an_energy_controller(name: str, most: float, widest: float, tmp_path: Path) -> None:
    """Laps at ten airspeeds under TECS, calm and in wind with turbulence: the truth is that of calm air."""
    found = curve(name, tmp_path)
    power = np.interp(SPEEDS_MPS, found.V_mps, found.power_W)
    half = NORMAL_95 * np.interp(SPEEDS_MPS, found.V_mps, found.standard_error_W)
    assert np.abs(power / TRUTH_W - 1)[MIDDLE].max() < most
    assert (np.abs(power - TRUTH_W) < half).sum() >= 6
    assert (half / TRUTH_W).max() < widest
    parameters, _ = typed_in(flight_values(found, UNKNOWN, {"ARSPD_RATIO": 2.0}))
    (ratio,) = (one for one in parameters if one.name == "ARSPD_RATIO")
    assert ratio.lo < 2.0 < ratio.hi and ratio.hi - ratio.lo < 0.3  # SIM_ARSPD_RATIO is 1.99


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("arducopter-3.1.3-2014.bin", "multicopter"),
        ("arduplane-4.8-dev-kind0.BIN", r"lacks battery.*BATT_MONITOR is 0"),
        ("arduplane-4.7-dev-44s.BIN", r"4[345] s in the air"),
        ("arduplane-4.7-dev-ground.BIN", r"12.6 V and no current"),
        ("arduplane-4.2.3-aerobatic.BIN", r"airspeed.*ARSPD_TYPE.*barometer.*battery.*BATT_MONITOR is 0"),
        ("px4-1.11.3-f16.ulg", "current sensor shows at most 1[0-9] W"),
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
