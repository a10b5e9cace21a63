"""Recognizes a file's format by its first bytes, and says for each unreadable format how to get a readable file."""

import codecs
import gzip
import re
import zipfile
import zlib
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from flightpower.flight.errors import InputError
from flightpower.flight.log_index import MAGIC as MCAP_MAGIC

GZIP_MAGIC, ZIP_MAGIC = b"\x1f\x8b", b"PK\x03\x04"
TEXT_MAGIC = b"FMT,"  # start of a dataflash log that a ground station has converted to text
MAVLINK_MARKERS = b"\xfe\xfd"
BYTE_ORDER_MARKS = {b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be", b"\xef\xbb\xbf": "utf-8"}
START_BYTES = 20_000
FEWEST_BLANK = 64  # fewest equal bytes that count as a blank file; shorter files are text
CONTROL_CHARACTERS = re.compile(rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]")


class Format(StrEnum):
    """The kind of a file. The formats up to TEXT are read, though not by every command."""

    DAEMON = "a log of flightpower's daemon"
    ULOG = "a log of PX4 (ULog)"
    DATAFLASH = "a log of ArduPilot (dataflash)"
    DATAFLASH_TEXT = "a log of ArduPilot as text"
    TELEMETRY = "a ground station's recording of telemetry (.tlog)"
    PAPARAZZI = "a telemetry log of Paparazzi (.data)"
    PARQUET = "a table (Parquet)"
    MAT = "a .mat file"
    JETI = "a telemetry log of a Jeti radio"
    MAT_7_3 = "a .mat file of version 7.3"
    TEXT = "text"
    EMPTY = "empty"
    ENCRYPTED_ULOG = "an encrypted log of PX4"
    ENCRYPTED_ULOG_KEY = "the key of an encrypted log of PX4"
    BLACKBOX = "a blackbox log of INAV or Betaflight"
    SPEKTRUM = "a telemetry log of a Spektrum radio (.TLM)"
    GRAUPNER = "a telemetry log of a Graupner radio (HoTT)"
    RAW_MAVLINK = "MAVLink frames without times"
    DUMP = "a log as mavlogdump.py prints it"
    MISSION = "a mission"
    MAP_TRACK = "a track or mission for maps (KML)"
    POSITIONS = "a track of positions (GPX)"
    GLIDER = "a glider's log (IGC)"
    NMEA = "the sentences of a GPS receiver (NMEA)"
    WEB_PAGE = "a web page"
    XML = "an XML file"
    JSON = "a JSON file"
    SPREADSHEET = "a spreadsheet"
    MAP_ARCHIVE = "a track for maps (KMZ)"
    ZIP = "a ZIP archive"
    COMPRESSED = "a compressed file"
    ROS_BAG = "a ROS bag"
    DATABASE = "an SQLite database"
    HDF5 = "an HDF5 file"
    IMAGE = "an image"
    VIDEO = "a video"
    PDF = "a PDF document"
    BLANK = "blank"
    UNKNOWN = "unknown"


# Suffixes of logs, in lower case. The content shows what a file is; the suffix is for lists, dialogs and folders.
SUFFIXES: Mapping[Format, str] = {
    Format.DAEMON: ".mcap", Format.ULOG: ".ulg", Format.DATAFLASH: ".bin", Format.DATAFLASH_TEXT: ".log",
    Format.TELEMETRY: ".tlog", Format.PAPARAZZI: ".data",
}  # fmt: skip
READ_BY_OTHERS = (
    Format.ULOG, Format.DATAFLASH, Format.DATAFLASH_TEXT, Format.TELEMETRY, Format.PAPARAZZI, Format.PARQUET,
    Format.MAT, Format.JETI,
)  # fmt: skip
READ_PACKED = (
    Format.ULOG, Format.DATAFLASH, Format.DATAFLASH_TEXT, Format.TELEMETRY, Format.PAPARAZZI, Format.TEXT,
)  # fmt: skip
ONLY_CHARTS = "it has no battery and no airspeed; analyze the log that it was made from"
# Advice for each format that is not read.
REMEDY: Mapping[Format, str] = {
    Format.MAT_7_3: "in MATLAB, save(file, '-v7') writes one that is read",
    Format.TEXT: "logs are .mcap, .ulg, .BIN, .log, .tlog and .data; a table needs a line of names above its numbers",
    Format.ENCRYPTED_ULOG: "decrypt it with PX4's Tools/log_encryption/decrypt_logs.py and the private key; the .ulg"
    " that this writes is read",
    Format.ENCRYPTED_ULOG_KEY: "decrypt the log beside it (.ulgc) with PX4's Tools/log_encryption and the private key;"
    " the .ulg that this writes is read",
    Format.BLACKBOX: "decode it with blackbox_decode --merge-gps --unit-acceleration m/s2, and analyze the CSV file",
    Format.SPEKTRUM: "export it as CSV, a column for each sensor, and analyze that",
    Format.GRAUPNER: "export it as CSV, a column for each sensor, and analyze that",
    Format.RAW_MAVLINK: "give the .tlog of the ground station, which has the time of each frame",
    Format.DUMP: "analyze the .BIN or .tlog that it was printed from",
    Format.MISSION: "`flightpower route` reads it; a flight needs its log",
    Format.MAP_TRACK: ONLY_CHARTS,
    Format.POSITIONS: ONLY_CHARTS,
    Format.GLIDER: ONLY_CHARTS,
    Format.NMEA: ONLY_CHARTS,
    Format.WEB_PAGE: "was a sign-in page saved in place of a log? Download the log itself",
    Format.XML: "logs are .mcap, .ulg, .BIN, .log, .tlog and .data",
    Format.JSON: "logs are .mcap, .ulg, .BIN, .log, .tlog and .data; results.json is read by"
    " `flightpower route`, `flightpower parameters` and `flightpower plan --after`",
    Format.SPREADSHEET: "save the sheet with the flight as CSV, and analyze that",
    Format.MAP_ARCHIVE: ONLY_CHARTS,
    Format.ZIP: "unpack it and give the log in it; a spreadsheet (.xlsx, .ods): save the sheet as CSV",
    Format.COMPRESSED: "unpack it and give the log in it",
    Format.ROS_BAG: "write its topics into a table (CSV or Parquet), one row a time, and analyze that",
    Format.DATABASE: "write the flight into a table (CSV or Parquet), and analyze that",
    Format.HDF5: "write the flight into a table (CSV or Parquet), and analyze that",
    Format.IMAGE: "give the log of the flight",
    Format.VIDEO: "give the log of the flight",
    Format.PDF: "give the log of the flight",
    Format.BLANK: "the card or the copy is damaged: copy it again, or read the card with recovery software",
    Format.UNKNOWN: "logs are .mcap, PX4's .ulg, ArduPilot's .BIN, .log and .tlog, Paparazzi's .data; tables are CSV,"
    " Parquet and .mat",
}


class _Sign(NamedTuple):
    """A format, and the bytes by which it is recognized: `magic`, at `offset`."""

    format: Format
    magic: bytes
    offset: int = 0


SIGNS = (
    _Sign(Format.DAEMON, MCAP_MAGIC),
    _Sign(Format.ULOG, b"ULog\x01\x12\x35"),
    _Sign(Format.ENCRYPTED_ULOG, b"ULogEnc"),
    _Sign(Format.ENCRYPTED_ULOG_KEY, b"ULogKey"),
    _Sign(Format.DATAFLASH, b"\xa3\x95\x80"),  # a format message
    _Sign(Format.DATAFLASH_TEXT, TEXT_MAGIC),
    _Sign(Format.PARQUET, b"PAR1"),
    _Sign(Format.MAT, b"MATLAB 5.0"),
    _Sign(Format.MAT_7_3, b"MATLAB 7.3"),
    _Sign(Format.GRAUPNER, b"GRAUPNER SD LOG"),
    _Sign(Format.ROS_BAG, b"#ROSBAG"),
    _Sign(Format.DATABASE, b"SQLite format 3\0"),
    _Sign(Format.HDF5, b"\x89HDF\r\n\x1a\n"),
    _Sign(Format.SPREADSHEET, b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"),
    _Sign(Format.COMPRESSED, b"BZh"),
    _Sign(Format.COMPRESSED, b"\xfd7zXZ\0"),
    _Sign(Format.COMPRESSED, b"\x28\xb5\x2f\xfd"),
    _Sign(Format.COMPRESSED, b"7z\xbc\xaf\x27\x1c"),
    _Sign(Format.COMPRESSED, b"Rar!\x1a\x07"),
    _Sign(Format.COMPRESSED, b"\x04\x22\x4d\x18"),
    _Sign(Format.IMAGE, b"\x89PNG\r\n\x1a\n"),
    _Sign(Format.IMAGE, b"\xff\xd8\xff"),
    _Sign(Format.IMAGE, b"GIF8"),
    _Sign(Format.IMAGE, b"II*\0"),
    _Sign(Format.IMAGE, b"MM\0*"),
    _Sign(Format.IMAGE, b"WEBP", 8),
    _Sign(Format.VIDEO, b"ftyp", 4),
    _Sign(Format.VIDEO, b"AVI ", 8),
    _Sign(Format.PDF, b"%PDF-"),
)
BLACKBOX_LINE = b"H Product:Blackbox"
SPEKTRUM_HEAD = re.compile(rb"\xff{4}[\x00-\x7f]{3}", re.DOTALL)  # number and kind of the model
# Text formats, recognized by their first line after empty lines and comments.
TEXTS: Mapping[Format, re.Pattern[str]] = {
    Format.PAPARAZZI: re.compile(r"\d+\.\d+ \d+ [A-Z][A-Z0-9_]+( |\r?\n|$)"),  # time, aircraft, message
    Format.JETI: re.compile(r"(#[^\n]*\n)?\d{9};\d+;\d+;"),  # time, device, sensor
    Format.DUMP: re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d+: \w+ \{"),
    Format.MISSION: re.compile(r"QGC WPL|\{[^\0]*\"fileType\"\s*:\s*\"Plan\"|(<\?xml[^\0]*?)?<mission[ >]", re.I),
    Format.MAP_TRACK: re.compile(r"(<\?xml[^\0]*?)?<kml[ >]", re.I),
    Format.POSITIONS: re.compile(r"(<\?xml[^\0]*?)?<gpx[ >]", re.I),
    Format.WEB_PAGE: re.compile(r"(<\?xml[^\0]*?)?(<!doctype html|<html[ >])", re.I),
    Format.XML: re.compile(r"<\?xml"),
    Format.GLIDER: re.compile(r"A[A-Z0-9]{3}[^\0]*?\nH[FOP]DTE"),
    Format.NMEA: re.compile(r"\$(G[APLNB]|BD)[A-Z]{3},"),
    Format.JSON: re.compile(r"\{\s*(\"|\})|\[\s*[\{\[\"]"),
}


def format_of(path: Path) -> Format:
    """The format of a file. Tables in text and logs of autopilots may be compressed by gzip.

    Raises InputError when the file cannot be read.
    """
    start = first_bytes(path)
    if start.startswith(GZIP_MAGIC):
        inside = recognized(unpacked_start(path))
        return inside if inside in READ_PACKED else Format.COMPRESSED
    return _in_archive(path) if start.startswith(ZIP_MAGIC) else recognized(start)


def refusal(path: Path, wanted: str = "") -> InputError:
    """Say what kind of file it is and how to get a readable one. wanted : kinds that a command reads, if not all."""
    file_format = format_of(path)
    if file_format is Format.EMPTY:
        return InputError(f"{path}: the file is empty")
    if file_format in READ_BY_OTHERS:
        return InputError(
            f"{path}: {file_format}, which `analyze` reads; here {wanted or 'a log of the daemon'} is needed"
        )
    what = {Format.BLANK: _blank, Format.UNKNOWN: _unknown}.get(file_format, lambda _: str(file_format))(
        first_bytes(path)
    )
    return InputError(f"{path}: {what}, which is not read: {REMEDY[file_format]}")


def _blank(start: bytes) -> str:
    return f"a file that begins with {len(start)} bytes of {start[0]:#04x}"


def _unknown(start: bytes) -> str:
    return f"a file that begins with the bytes {start[:8].hex(' ')}, neither a log nor a table"


def first_bytes(path: Path, count: int = START_BYTES) -> bytes:
    """The first bytes of a file, not unpacked. Raises InputError if it cannot be read.

    Pipes and devices are refused: opening one may wait forever, and a file is read several times.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        raise InputError(f"{path}: is a pipe or a device; save the log as a file, and give that")
    try:
        with path.open("rb") as stream:
            return stream.read(count)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def unpacked_start(path: Path, count: int = START_BYTES) -> bytes:
    """The first bytes of a gzip file's content. Raises InputError if they cannot be unpacked."""
    try:
        with gzip.open(path) as stream:
            return stream.read(count)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be unpacked ({error}): copy or download it again") from None


def recognized(start: bytes) -> Format:
    """The format of a file that is not packed, by its first bytes."""
    if not start:
        return Format.EMPTY
    for sign in SIGNS:
        if start.startswith(sign.magic, sign.offset):
            return sign.format
    if BLACKBOX_LINE in start:
        return Format.BLACKBOX
    if SPEKTRUM_HEAD.match(start):
        return Format.SPEKTRUM
    if is_telemetry(start):
        return Format.TELEMETRY
    if _is_mavlink(start):
        return Format.RAW_MAVLINK
    if len(start) >= FEWEST_BLANK and len(set(start)) == 1:
        return Format.BLANK
    text = text_of(start)
    if text is None:
        return Format.UNKNOWN
    lines = text.lstrip()
    return next((file_format for file_format, pattern in TEXTS.items() if pattern.match(lines)), Format.TEXT)


def text_of(start: bytes) -> str | None:
    """The text at the start of a file, in UTF-8, UTF-16 with a byte order mark, or Latin-1; None if it is not text."""
    for mark, encoding in BYTE_ORDER_MARKS.items():
        if start.startswith(mark):
            return start[len(mark) :].decode(encoding, "ignore")
    if CONTROL_CHARACTERS.search(start):
        return None
    try:
        return codecs.getincrementaldecoder("utf-8")().decode(start)  # the start may end in the middle of a character
    except UnicodeDecodeError:
        plain = sum(byte < 0x80 for byte in start)
        return start.decode("latin-1") if plain > 0.9 * len(start) else None


def is_telemetry(start: bytes) -> bool:
    """Whether a .tlog starts like this: time of reception (8 bytes, big-endian, us since 1970), a MAVLink frame."""
    time_s, marker = int.from_bytes(start[:8], "big") * 1e-6, start[8:9]
    return (
        bool(marker) and marker in MAVLINK_MARKERS and 946_684_800 < time_s < 4_102_444_800
    )  # the years 2000 and 2100


def _is_mavlink(start: bytes) -> bool:
    """Whether the bytes are MAVLink frames: three in succession."""
    offset = 0
    for _ in range(3):
        if start[offset : offset + 1] not in (b"\xfe", b"\xfd") or len(start) < offset + 3:
            return False
        offset += start[offset + 1] + (8 if start[offset] == 0xFE else 12 + 13 * (start[offset + 2] & 1))
    return True


def _in_archive(path: Path) -> Format:
    """The kind of a ZIP archive, by the names of the files in it."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = set(archive.namelist())
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        return Format.ZIP
    if names & {"xl/workbook.xml", "xl/workbook.bin", "content.xml"}:
        return Format.SPREADSHEET
    return Format.MAP_ARCHIVE if any(name.endswith(".kml") for name in names) else Format.ZIP
