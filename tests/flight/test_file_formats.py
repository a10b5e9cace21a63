"""A file is recognized by its content; where it cannot be read, one line says how to get a readable one."""

import gzip
import io
import os
import struct
import zipfile
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flightpower.analysis.flights.campaign.addresses import find_logs
from flightpower.analysis.sources.open import open_source
from flightpower.analysis.sources.recognize import Autopilot, autopilot_of
from flightpower.flight.errors import InputError
from flightpower.flight.formats import READ_BY_OTHERS, REMEDY, Format, format_of
from flightpower.flight.log_reader import read_log


def archive(*names: str) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as new_archive:
        for name in names:
            new_archive.writestr(name, "x")
    return stream.getvalue()


def heartbeats() -> bytes:
    encoder = mavlink.MAVLink(None)
    return b"".join(mavlink.MAVLink_heartbeat_message(1, 3, 0, 0, 0, 3).pack(encoder) for _ in range(5))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.ulg")
    with pytest.raises(InputError, match=r"pipe\.ulg: is a pipe or a device; save the log as a file"):
        format_of(tmp_path / "pipe.ulg")
    logs = find_logs([str(tmp_path)])
    assert not logs.logs and "no logs in this folder" in logs.failures[0]


LINES = b"time [s],speed [m/s]\n" + b"".join(b"%d,12.5\n" % i for i in range(40))
ULOG = b"ULog\x01\x12\x35" + bytes(60)
FOREIGN: dict[str, tuple[bytes, Format, str]] = {
    "blackbox": (b"H Product:Blackbox flight data recorder by N\nH Data version:2\n\x8a\x00\xff", Format.BLACKBOX,
                 "blackbox_decode"),
    "blackbox after erased flash": (b"\xff" * 300 + b"H Product:Blackbox flight\n\x00", Format.BLACKBOX, "CSV"),
    "encrypted ULog": (b"ULogEnc\x01" + bytes(range(200)), Format.ENCRYPTED_ULOG, "private key"),
    "its key": (b"ULogKey\x01" + bytes(range(200)), Format.ENCRYPTED_ULOG_KEY, ".ulgc"),
    "Spektrum's telemetry": (b"\xff" * 4 + b"\x00\x00\x03\x00V\x0e \x00Name\x00" + bytes(90), Format.SPEKTRUM, "CSV"),
    "Graupner's telemetry": (b"GRAUPNER SD LOG8" + bytes(range(90)), Format.GRAUPNER, "CSV"),
    "frames without times": (heartbeats(), Format.RAW_MAVLINK, ".tlog"),
    "a printed log": (b"2024-05-01 12:00:00.00: BAT {TimeUS : 1, Volt : 15.1}\n" * 9, Format.DUMP, ".BIN"),
    "waypoints": (b"QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t1\t2\t3\t1\n", Format.MISSION, "route"),
    "a plan": (b'{\n "fileType": "Plan",\n "mission": {}}', Format.MISSION, "route"),
    "INAV's mission": (b'<?xml version="1.0"?>\n<mission><version value="1"/></mission>', Format.MISSION, "route"),
    "KML": (b'<?xml version="1.0"?><kml xmlns="x"><Document/></kml>', Format.MAP_TRACK, "battery"),
    "KMZ": (archive("doc.kml"), Format.MAP_ARCHIVE, "battery"),
    "GPX": (b'<?xml version="1.0"?>\n<gpx version="1.1"></gpx>', Format.POSITIONS, "battery"),
    "IGC": (b"AXXX001 recorder\r\nHFDTE010524\r\nB1200004807000N01130000E\r\n", Format.GLIDER, "battery"),
    "NMEA": (b"$GPRMC,120000,A,4807.0,N,01130.0,E,12,90,010524,,*00\r\n" * 5, Format.NMEA, "battery"),
    "a web page": (b"<!DOCTYPE html>\n<html><body>sign in</body></html>", Format.WEB_PAGE, "Download"),
    "another XML": (b'<?xml version="1.0"?><model/>', Format.XML, ".ulg"),
    "JSON": (b'{"format": "flightpower-results-2", "curve": []}', Format.JSON, "route"),
    "xlsx": (archive("[Content_Types].xml", "xl/workbook.xml"), Format.SPREADSHEET, "CSV"),
    "ods": (archive("mimetype", "content.xml"), Format.SPREADSHEET, "CSV"),
    "xls": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(90), Format.SPREADSHEET, "CSV"),
    "a packed log": (archive("00000042.BIN"), Format.ZIP, "unpack"),
    "a damaged archive": (b"PK\x03\x04" + bytes(range(200)), Format.ZIP, "unpack"),
    "gzip": (gzip.compress(b"\x89PNG\r\n\x1a\n" + bytes(90)), Format.COMPRESSED, "unpack"),
    "bzip2": (b"BZh91AY&SY" + bytes(90), Format.COMPRESSED, "unpack"),
    "xz": (b"\xfd7zXZ\0" + bytes(90), Format.COMPRESSED, "unpack"),
    "ROS bag": (b"#ROSBAG V2.0\n" + bytes(90), Format.ROS_BAG, "Parquet"),
    "database": (b"SQLite format 3\0" + bytes(90), Format.DATABASE, "Parquet"),
    "HDF5": (b"\x89HDF\r\n\x1a\n" + bytes(90), Format.HDF5, "Parquet"),
    "PNG": (b"\x89PNG\r\n\x1a\n" + bytes(90), Format.IMAGE, "give the log"),
    "JPEG": (b"\xff\xd8\xff\xe0" + bytes(90), Format.IMAGE, "give the log"),
    "video": (struct.pack(">I", 24) + b"ftypmp42" + bytes(90), Format.VIDEO, "give the log"),
    "PDF": (b"%PDF-1.7\n" + bytes(90), Format.PDF, "give the log"),
    "zeros": (bytes(4096), Format.BLANK, "damaged"),
    "erased": (b"\xff" * 4096, Format.BLANK, "damaged"),
    "text": (b"hello world\n", Format.TEXT, "line of names"),
    "noise": (bytes(range(5, 250)), Format.UNKNOWN, "neither a log nor a table"),
    ".mat 7.3": (b"MATLAB 7.3 MAT-file".ljust(600), Format.MAT_7_3, "-v7"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "format", "remedy"), FOREIGN.values(), ids=FOREIGN)
def test_one_line_says_what_it_is_and_what_to_do(content: bytes, format: Format, remedy: str, tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    path.write_bytes(content)
    assert format_of(path) is format
    with pytest.raises(InputError, match=remedy) as raised:
        open_source(path)
    line = str(raised.value)
    assert line.startswith(f"{path}: ") and "\n" not in line and "MCAP" not in line


def test_each_format_is_read_or_has_a_remedy() -> None:
    read = {*READ_BY_OTHERS, Format.DAEMON, Format.EMPTY}
    assert read | REMEDY.keys() == {*Format} and not read & REMEDY.keys()


READ: dict[str, tuple[bytes, Autopilot | None]] = {
    "PX4": (ULOG, Autopilot.PX4),
    "ArduPilot": (b"\xa3\x95\x80\x80\x59FMT", Autopilot.ARDUPILOT),
    "its text": (b"FMT, 128, 89, FMT, BBnNZ, Type,Length\n", Autopilot.ARDUPILOT),
    "telemetry": ((1_700_000_000_000_000).to_bytes(8, "big") + heartbeats(), Autopilot.ARDUPILOT),
    "Paparazzi": (b"12.34 7 GPS 3 1 2 3\n" * 9, Autopilot.PAPARAZZI),
    "packed Paparazzi": (gzip.compress(b"12.34 7 GPS 3 1 2 3\n" * 9), Autopilot.PAPARAZZI),
    "packed PX4": (gzip.compress(ULOG), Autopilot.PX4),
    "packed ArduPilot": (gzip.compress(b"\xa3\x95\x80\x80\x59FMT"), Autopilot.ARDUPILOT),
    "a table": (LINES, None),
    "a packed table": (gzip.compress(LINES), None),
}


@pytest.mark.parametrize(("content", "autopilot"), READ.values(), ids=READ)
def test_a_log_that_another_command_reads_is_named_as_such(
    content: bytes, autopilot: Autopilot | None, tmp_path: Path
) -> None:
    path = tmp_path / "x"
    path.write_bytes(content)
    assert autopilot_of(path) is autopilot
    with pytest.raises(InputError) as raised:
        read_log(path)
    assert ("`analyze` reads" in str(raised.value)) == (autopilot is not None) and "MCAP" not in str(raised.value)


def test_a_packed_file_that_ends_early_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "flight.csv.gz"
    path.write_bytes(gzip.compress(LINES * 200)[:40])
    with pytest.raises(InputError, match="cannot be unpacked"):
        format_of(path)
