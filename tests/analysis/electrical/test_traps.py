"""What real logs do to the reader: handled with a curve that stays within its interval, or said in one line."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from analysis.autopilot_logs.px4 import read_px4
from analysis.electrical.estimate import ElectricalEstimate, estimate
from analysis.electrical.flight_table import FlightTable, flight_table
from flight.units import GRAVITY_MPS2
from sim.log_faults import begun_at, with_clock_set, with_dropouts, without
from sim.ulog_writer import UlogContents, UlogTopic, write_ulog

LOG = Path(__file__).parents[2] / "data" / "autopilot_logs" / "seaway-mini-flight3.ulg"
WEIGHT_N, WING_AREA_M2, SPAN_M = 9.4 * GRAVITY_MPS2, 1.499, 4.0
TAKE_OFF_S = 110.0  # after the first message


def topics() -> list[UlogTopic]:
    return [
        UlogTopic(
            one.name, one.data["timestamp"], {k: x for k, x in one.data.items() if k != "timestamp"}, one.multi_id
        )
        for one in ULog(str(LOG)).data_list
    ]


def analyzed(path: Path) -> tuple[FlightTable, ElectricalEstimate]:
    table = flight_table(read_px4(path), WEIGHT_N, WING_AREA_M2)
    return table, estimate(table, WEIGHT_N, WING_AREA_M2, SPAN_M)


@pytest.fixture(scope="module")
def nominal() -> ElectricalEstimate:
    return analyzed(LOG)[1]


def clock_set(found: list[UlogTopic]) -> list[UlogTopic]:
    start = int(found[0].time_us[0])
    return with_clock_set(found, start + 60_000_000, 7_200_000_000)


def airborne_start(found: list[UlogTopic]) -> list[UlogTopic]:
    start = int(found[0].time_us[0])
    end = int(found[0].time_us[-1])
    return [without(one, end - 75_000_000, end + 1) for one in begun_at(found, start + int(1e6 * TAKE_OFF_S))]


def raw_pressure_alone(found: list[UlogTopic]) -> list[UlogTopic]:
    """Differential pressure once a second with an offset of 110 Pa, in steps of 6 Pa."""
    return [one for one in found if one.name != "airspeed_validated"]


@pytest.mark.parametrize(
    ("trap", "note"),
    [
        (lambda found: with_dropouts(found, seed=3)[0], ""),
        (clock_set, "clock jumped"),
        (airborne_start, "no time on the ground"),
        (raw_pressure_alone, ""),
    ],
)
def test_handled(
    tmp_path: Path, nominal: ElectricalEstimate, trap: Callable[[list[UlogTopic]], list[UlogTopic]], note: str
) -> None:
    path = tmp_path / "log.ulg"
    write_ulog(path, UlogContents(trap(topics())))
    table, found = analyzed(path)
    V = np.linspace(9.5, 15.0, 6)
    power, error = np.interp(V, found.V_mps, found.power_W), np.interp(V, found.V_mps, found.standard_error_W)
    assert np.abs(power - np.interp(V, nominal.V_mps, nominal.power_W)).max() < 1.5 * error.max()
    assert (np.abs(power / np.interp(V, nominal.V_mps, nominal.power_W) - 1) < 0.15).all()
    assert note in " ".join(table.notes)


def test_a_truncated_file_is_analyzed_as_far_as_it_goes(tmp_path: Path, nominal: ElectricalEstimate) -> None:
    path = tmp_path / "log.ulg"
    path.write_bytes(LOG.read_bytes()[:180_000])
    table, found = analyzed(path)
    assert table.flown.sum() < 1160  # of 1183
    V = np.linspace(9.5, 15.0, 6)
    assert np.interp(V, found.V_mps, found.power_W) == pytest.approx(
        np.interp(V, nominal.V_mps, nominal.power_W), rel=0.15
    )


def test_hovering_is_left_out(tmp_path: Path) -> None:
    """A VTOL that is a multicopter from 250 s on, while still flying."""
    found = topics()
    late = found[0].time_us[0] + np.uint64(250_000_000)
    for one in found:
        if one.name == "vehicle_status":
            one.columns["vehicle_type"] = np.where(one.time_us > late, 1, 2).astype(np.uint8)
    path = tmp_path / "log.ulg"
    write_ulog(path, UlogContents(found))
    table = flight_table(read_px4(path), WEIGHT_N, WING_AREA_M2)
    assert 120 < table.table.index[table.flown].max() < 251
