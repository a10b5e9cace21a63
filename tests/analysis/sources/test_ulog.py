"""The reader of PX4 logs gives what pyulog gives, for sound logs and damaged ones, whatever its blocks."""

import contextlib
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyulog import ULog

from flightpower.analysis.sources.dataflash import DataflashLog
from flightpower.analysis.sources.ulog import BlockwiseULog, _Advancing
from flightpower.flight.errors import InputError
from flightpower.sim.dataflash_writer import DataflashMessages, write_dataflash
from flightpower.sim.ulog_writer import UlogContents, UlogTopic, write_ulog

TOPICS = ("airspeed", "battery_status")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A log with two topics that are read, one of them in two instances, and one topic that is not."""
    t = 1_000_000 + 10_000 * np.arange(900, dtype=np.uint64)
    rng = np.random.default_rng(1)
    results = [
        UlogTopic("airspeed", t[::3], {"indicated_airspeed_m_s": rng.normal(15, 1, 300).astype(np.float32)}),
        UlogTopic("battery_status", t[::9], {"voltage_v": rng.normal(12, 1, 100).astype(np.float32)}),
        UlogTopic("battery_status", t[::9], {"voltage_v": rng.normal(5, 1, 100).astype(np.float32)}, 1),
        UlogTopic("vehicle_attitude", t, {"q[0]": rng.normal(0, 1, 900), "mode": np.ones(900, dtype=np.uint8)}),
    ]
    path = tmp_path_factory.mktemp("ulog") / "log.ulg"
    info = {"sys_name": "PX4", "sys_uuid": "0001"}
    write_ulog(path, UlogContents(results, info, [], {"FW_AIRSPD_TRIM": 15.0}, ["a text of a crash"]))
    return path.read_bytes()


def read_by(reader: Callable[[], ULog]) -> Any:
    """The data that this project's readers use, or the name of the error."""
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            result = reader()
    except Exception as error:
        return type(error).__name__
    topics = {
        (item.name, item.multi_id): {name: x.tolist() for name, x in item.data.items()} for item in result.data_list
    }
    dropouts = [dropout.duration for dropout in result.dropouts]
    return topics, result.file_corruption, dropouts, result.initial_parameters, result.msg_info_dict


def both(data: bytes) -> tuple[Any, Any]:
    return (
        read_by(lambda: BlockwiseULog(io.BytesIO(data), TOPICS)),
        read_by(lambda: ULog(_Advancing(io.BytesIO(data)), list(TOPICS))),
    )


@pytest.mark.parametrize("block_bytes", [1 << 22, 4000, 500])
def test_a_sound_log_is_read_from_block_to_block(log: bytes, monkeypatch: pytest.MonkeyPatch, block_bytes: int) -> None:
    monkeypatch.setattr(BlockwiseULog, "BLOCK_BYTES", block_bytes)
    ours, reference = both(log)
    assert [len(item["timestamp"]) for item in ours[0].values()] == [300, 100, 100]
    assert ours == reference


def test_a_damaged_log_gives_what_pyulog_gives(log: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bytes are altered or cut out, or the end is cut off."""
    monkeypatch.setattr(BlockwiseULog, "BLOCK_BYTES", 6000)
    rng = np.random.default_rng(2)
    corrupt = 0
    for number in range(40):
        data = bytearray(log)
        for offset in rng.integers(16, len(data), rng.integers(1, 6)):
            data[offset] = rng.integers(256)
        if number % 3 == 0:
            del data[rng.integers(400, len(data)) :]
        if number % 5 == 0:
            offset = int(rng.integers(400, max(401, len(data) - 300)))
            del data[offset : offset + int(rng.integers(1, 300))]
        ours, reference = both(bytes(data))
        assert ours == reference, number
        corrupt += isinstance(ours, str) or ours[1]
    assert corrupt > 10


@pytest.fixture
def dataflash_log(tmp_path: Path) -> Path:
    t = 10_000 * np.arange(2000, dtype=np.uint64)
    write_dataflash(tmp_path / "log.BIN", [
        DataflashMessages("IMU", "Qfc", {"TimeUS": t, "AccX": np.arange(2000.0), "AccY": -0.1 * np.arange(2000.0)}),
        DataflashMessages("BARO", "Qf", {"TimeUS": t[::10], "Press": 1e5 + np.arange(200.0)}),
    ])  # fmt: skip
    return tmp_path / "log.BIN"


def columns_of(log: DataflashLog) -> dict[str, dict[str, bytes]]:
    """The columns by kind, to the bit, since damaged ones hold NaN."""
    return {kind: {name: x.tobytes() for name, x in log.columns(kind).items()} for kind in log.names()}


def test_a_dataflash_log_holds_what_was_written(dataflash_log: Path) -> None:
    log = DataflashLog(dataflash_log)
    assert log.columns("IMU")["AccX"] == pytest.approx(np.arange(2000.0))
    # The file stores it as an integer of hundredths.
    assert log.columns("IMU")["AccY"] == pytest.approx(-0.1 * np.arange(2000.0), abs=1e-9)
    assert list(log.columns("IMU", {"AccY"})) == ["AccY"]


@pytest.mark.parametrize("block_bytes", [64, 257, 1000, 1 << 23])
@pytest.mark.parametrize("damaged", [False, True])
def test_a_dataflash_log_is_read_from_block_to_block(
    monkeypatch: pytest.MonkeyPatch, dataflash_log: Path, block_bytes: int, damaged: bool
) -> None:
    """Blocks end within messages, within heads of messages and between them; a damaged file also has false heads."""
    data = bytearray(dataflash_log.read_bytes())
    if damaged:
        rng = np.random.default_rng(3)
        for offset in rng.integers(400, len(data) - 300, 200):
            data[offset : offset + 3] = (b"\xa3\x95\x80", b"\xa3\x95\xff", b"\xa3\xa3\x95")[offset % 3]
        del data[-7:]
        dataflash_log.write_bytes(data)
    complete = columns_of(DataflashLog(bytes(data)))
    monkeypatch.setattr(DataflashLog, "BLOCK_BYTES", block_bytes)
    assert columns_of(DataflashLog(dataflash_log)) == complete
    assert len(complete["IMU"]["AccX"]) > 8 * (1500 if damaged else 1999)


def test_a_dataflash_log_that_is_cut_off_or_taken_away_meanwhile_ends_in_one_line(dataflash_log: Path) -> None:
    log, data = DataflashLog(dataflash_log), dataflash_log.read_bytes()
    dataflash_log.write_bytes(data[:-100])
    with pytest.raises(InputError, match="became shorter while it was read; copy the log"):
        log.columns("IMU")
    dataflash_log.unlink()
    with pytest.raises(InputError, match="cannot be read any longer"):
        log.columns("IMU")
