"""The first and last bytes of a log say what wrote it and how long it is; nothing is guessed from damaged bytes."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from flightpower.analysis.sources.extent import Extent, extent
from flightpower.sim.dataflash_writer import write_dataflash, write_text
from flightpower.sim.telemetry_writer import BOOTED_US, write_telemetry
from flightpower.sim.ulog_writer import UlogContents, UlogTopic, write_ulog
from tests.analysis.sources.test_ground_station_files import flight
from tests.unchanged.commands import demo_log

LENGTH_S = 59.9


def ulog(path: Path, seconds: float = 700.0) -> None:
    """Writes a log that is longer than the parts at both ends that are read."""
    t_us = (1e6 * np.arange(50.0, 50.0 + seconds, 0.05)).astype(np.uint64)
    columns = {f"value_{i}": np.sin(t_us * 1e-7 * i).astype(np.float32) for i in range(6)}
    write_ulog(path, UlogContents([UlogTopic("airspeed", t_us, columns)]))


@pytest.mark.parametrize(
    ("suffix", "kind"), [(".BIN", "ArduPilot"), (".log", "ArduPilot, as text"), (".tlog", "ArduPilot, by radio")]
)
def test_an_ardupilot_log_has_its_length(tmp_path: Path, suffix: str, kind: str) -> None:
    path = tmp_path / f"flight{suffix}"
    {".BIN": write_dataflash, ".log": write_text, ".tlog": write_telemetry}[suffix](path, flight())
    result = extent(path)
    assert result.kind == kind and result.length_s == pytest.approx(LENGTH_S, abs=0.11)
    assert result.start_s == (pytest.approx(BOOTED_US / 1e6 + 10) if suffix == ".tlog" else None)


def test_a_px4_log_is_read_at_its_ends(tmp_path: Path) -> None:
    path = tmp_path / "flight.ulg"
    ulog(path)
    assert path.stat().st_size > 3 * (1 << 17)
    assert extent(path) == Extent("PX4", None, pytest.approx(699.95, abs=0.1))
    path.write_bytes(path.read_bytes()[:-7])  # cut within its last message
    assert extent(path).length_s == pytest.approx(699.9, abs=0.1)


def test_a_px4_log_has_the_date_that_its_receiver_told(tmp_path: Path) -> None:
    """This includes compressed logs. The first 20 s have no fix; a log without any fix gives no date."""
    t_us = (1e6 * np.arange(50.0, 110.0, 0.2)).astype(np.uint64)
    began_s = 1_795_358_400.0  # 2026-11-22 14:40
    for fixed in (True, False):
        gps = {
            "lat": np.full(len(t_us), 481_000_000, np.int32), "lon": np.full(len(t_us), 115_000_000, np.int32),
            "alt": np.full(len(t_us), 500_000, np.int32),
            "fix_type": np.where(fixed & (t_us > 70e6), 3, 0).astype(np.uint8),
            "time_utc_usec": (1e6 * began_s + (t_us - t_us[0])).astype(np.uint64),
        }  # fmt: skip
        write_ulog(tmp_path / "a.ulg", UlogContents([UlogTopic("vehicle_gps_position", t_us, gps)]))
        (tmp_path / "a.ulg.gz").write_bytes(gzip.compress((tmp_path / "a.ulg").read_bytes()))
        for name in ("a.ulg", "a.ulg.gz"):
            assert extent(tmp_path / name).start_s == (pytest.approx(began_s, abs=1.0) if fixed else None), name


def test_telemetry_of_paparazzi_also_compressed(tmp_path: Path) -> None:
    lines = "".join(f"{k / 2:.3f} 20 ENERGY 55 11.5 1.7\n" for k in range(20, 20_000)).encode()
    for path in (tmp_path / "flight.data", tmp_path / "flight.data.gz"):
        path.write_bytes(gzip.compress(lines) if path.suffix == ".gz" else lines)
        assert extent(path) == Extent("Paparazzi", None, pytest.approx(9989.5))
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    assert extent(path).length_s is None


def test_a_log_of_the_daemon_has_date_and_length(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(demo_log())
    result = extent(path)
    assert result.kind == "flightpower" and 100 < (result.length_s or 0) < 3000
    path.write_bytes(demo_log()[:-1000])
    assert extent(path) == Extent("flightpower")


@pytest.mark.parametrize(
    "content", [b"", b"\xff" * 40, b"ULog\x01\x12\x35", b"\xa3\x95\x80", b"a,b\n1,2\n", b"\x1f\x8b\x08"]
)
def test_what_is_damaged_has_no_length(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "flight.ulg"
    path.write_bytes(content)
    assert extent(path).length_s is None
