"""The files that the analysis of a log reads beside the log itself: what its results depend on."""

import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Attachment, AttachmentIndex, Footer, SummaryOffset

from analysis.autopilot_logs.read import firmware_of
from analysis.cli.options import ATTACHMENTS, LogOptions, option_name
from flight.aircraft import load_aircraft, parse_aircraft
from flight.errors import InputError
from flight.log_index import FOOTER_BYTES, MAGIC, RECORD_HEAD
from flight.shipped_propellers import shipped_propellers


def files_used(log: Path, options: LogOptions) -> list[tuple[str, Path]]:
    """(option, file) of every file that the analysis of `log` reads.

    Raises InputError when the aircraft file cannot be used.
    """
    given = ((option_name(field), getattr(options, field)) for field in ATTACHMENTS)
    files = [(option, path) for option, path in given if isinstance(path, Path) and path.is_file()]
    propeller = options.propeller or _named_propeller(log, options.aircraft)
    return files + [(option_name("propeller"), path) for path in _propeller_files(propeller)]


def _named_propeller(log: Path, aircraft: Path | None) -> str | None:
    """The propeller in the aircraft file given, or in the log's where the log has no table of it."""
    if aircraft is not None:
        return load_aircraft(aircraft).propulsion.propeller
    if firmware_of(log):
        return None
    attached = _attachments(log)
    if "propeller.csv" in attached or "aircraft.toml" not in attached:
        return None
    try:
        text = attached["aircraft.toml"].decode("utf-8", errors="replace")
        return parse_aircraft(text, f"{log}: aircraft.toml").propulsion.propeller
    except InputError:
        return None  # the analysis says so


def _attachments(log: Path) -> dict[str, bytes]:
    """Attachments of a log by name, by its index; none of a torn log, whose index is missing."""
    try:
        with log.open("rb") as stream:
            return {one.name: one.data for one in _indexed_attachments(stream)}
    except Exception:  # the reader raises errors of many kinds; the analysis says what is wrong with the log
        return {}


def _indexed_attachments(stream: IO[bytes]) -> Iterator[Attachment]:
    """By the offsets at the end of the file: the rest of the index, a record for each chunk, is not read."""
    end = stream.seek(-(RECORD_HEAD.size + FOOTER_BYTES + len(MAGIC)), os.SEEK_END)
    footer = Footer.read(_contents(stream.read(RECORD_HEAD.size + FOOTER_BYTES))[0][1])
    if not footer.summary_offset_start:
        yield from SeekingReader(stream).iter_attachments()
        return
    stream.seek(footer.summary_offset_start)
    for _, content in _contents(stream.read(end - footer.summary_offset_start)):
        group = SummaryOffset.read(content)
        if group.group_opcode == Opcode.ATTACHMENT_INDEX:
            stream.seek(group.group_start)
            for _, entry in _contents(stream.read(group.group_length)):
                index = AttachmentIndex.read(entry)
                stream.seek(index.offset)
                yield Attachment.read(_contents(stream.read(index.length))[0][1])


def _contents(records: bytes) -> list[tuple[int, ReadDataStream]]:
    """Operation code and content of each whole record."""
    found, at = [], 0
    while at < len(records):
        opcode, length = RECORD_HEAD.unpack_from(records, at)
        begin = at + RECORD_HEAD.size
        found.append((opcode, ReadDataStream(io.BytesIO(records[begin : begin + length]))))
        at = begin + length
    return found


def _propeller_files(name_or_path: str | None) -> list[Path]:
    """The files in which `flight.propeller_files.load_propeller` finds a propeller; none of a shipped one."""
    if name_or_path is None or name_or_path in shipped_propellers():
        return []
    path = Path(name_or_path)
    if path.is_dir() or path.suffix == ".txt":  # tables of UIUC: the others in the folder belong to it
        return sorted((path if path.is_dir() else path.parent).glob("*.txt"))
    return [path] if path.is_file() else []
