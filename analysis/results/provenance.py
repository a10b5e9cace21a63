"""The origin of the results, in the form of `results.json`: the log, the files used, the health of the sensors."""

import hashlib
from datetime import UTC, datetime, timedelta
from pathlib import Path

from flightpower.analysis.air.contents import LogContents, Replacements
from flightpower.analysis.flight import Recorded
from flightpower.analysis.records.flight import Clock, ImplausibleReadings, Provenance, SensorHealth, SourceFile
from flightpower.analysis.sources.recognize import autopilot_of
from flightpower.analysis.sources.recording import Fix, FlightRecording
from flightpower.flight.files import sha256_of
from flightpower.flight.log_entries import STATUS_CODE
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import Comparison, Event, Status, Tick
from flightpower.flight.shipped_propellers import FOLDER, shipped_propellers

FAULTS = (Status.FAULT, Status.SATURATED, Status.NO_REPLY, Status.TIMEOUT, Status.CORRUPT, Status.WRONG_DEVICE)
NOT_SENSORS = ("/time", "/daq/tick", "/daq/event")
ROLES = {
    "aircraft.toml": "aircraft file",
    "propeller.csv": "propeller table",
    "probe.json": "probe calibration",
    "magnetometer.json": "magnetometer calibration",
    "transducers.json": "transducer calibration",
    "thrust_stand.json": "thrust on a stand",
    "airspeed.json": "airspeed calibration",
    "zero.json": "still-air zero",
}


def provenance(flight: Recorded, runs_file: Path | None, command_line: str) -> Provenance:
    """Return where log, aircraft, calibrations and weight come from. Files that can no longer be read have no hash."""
    log, contents, replacements = flight.log, flight.contents, flight.replacements
    ends_ns = [(entries[0].time_ns, entries[-1].time_ns) for entries in log.entries.values() if entries]
    start_ns, end_ns = min(start for start, _ in ends_ns), max(end for _, end in ends_ns)
    start_utc, clock = _start(flight.fix, 0.0)
    ticks = [entry.message for entry in log.entries.get("/daq/tick", []) if isinstance(entry.message, Tick)]
    return Provenance(
        command_line=command_line,
        log_sha256=sha256_of(log.path),
        log_bytes=log.path.stat().st_size if log.path.is_file() else 0,
        recorded_by=log.metadata.get("flightpower", {}).get("version", ""),
        start_utc=start_utc,
        clock=clock,
        duration_s=(end_ns - start_ns) / 1e9,
        latitude_deg=flight.fix.latitude_deg,
        longitude_deg=flight.fix.longitude_deg,
        height_msl_m=flight.fix.height_msl_m,
        weight_source=_weight_source(replacements),
        files=_files(log, contents, replacements, runs_file),
        ticks=len(ticks) if ticks else None,
        ticks_missed=sum(tick.missed for tick in ticks) if ticks else None,
        sensors=[
            _health(topic, entries.status.tobytes())
            for topic, entries in log.entries.items()
            if entries and topic not in NOT_SENSORS
        ],
        events=[
            f"{(entry.time_ns - start_ns) * 1e-9:.0f} s: {entry.message.text}"
            for entry in log.entries.get("/daq/event", [])
            if isinstance(entry.message, Event) and entry.message.severity != "info"
        ],
        implausible=_implausible(log, end_ns),
    )


def provenance_of_file(
    log: Path, weight_source: str, aircraft: Path | None, command_line: str, recording: FlightRecording | None = None
) -> Provenance:
    """Return the provenance of another program's log: hashes, weight, command, and the recording's date and place."""
    files = []
    if aircraft:
        origin, sha256 = _origin_and_hash(str(aircraft))
        files.append(SourceFile(role=ROLES["aircraft.toml"], name="", origin=origin, sha256=sha256))
    fix = recording.fix if recording else Fix()
    ends_s = (
        [(channel.t_s[0], channel.t_s[-1]) for channel in recording.channels.values() if len(channel.t_s)]
        if recording
        else []
    )
    first_s, last_s = (min(a for a, _ in ends_s), max(b for _, b in ends_s)) if ends_s else (0.0, 0.0)
    start_utc, clock = _start(fix, first_s)
    return Provenance(
        command_line=command_line, log_sha256=sha256_of(log), log_bytes=log.stat().st_size,
        recorded_by=(recording.recorded_by if recording else "") or str(autopilot_of(log) or ""),
        start_utc=start_utc, clock=clock, duration_s=float(last_s - first_s) if ends_s else None,
        latitude_deg=fix.latitude_deg, longitude_deg=fix.longitude_deg, height_msl_m=fix.height_msl_m,
        weight_source=weight_source, files=files, ticks=None, ticks_missed=None, sensors=[], events=[],
    )  # fmt: skip


def _start(fix: Fix, first_s: float) -> tuple[str | None, Clock]:
    """Return date and time of the first measurement, `first_s` on the recording's clock, and which clock gave them."""
    start_utc = None if fix.unix_at_zero_s is None else _iso(round(1e9 * (fix.unix_at_zero_s + first_s)))
    return start_utc, Clock.NONE if start_utc is None else Clock.SATELLITES if fix.by_satellites else Clock.COMPUTER


def _implausible(log: Log, end_ns: int) -> list[ImplausibleReadings]:
    """Return the stretches of time from each warning to its all-clear, or to the end of the log."""
    start_ns = next((entry.time_ns for entry in log.entries.get("/imu", [])), 0)
    implausible_readings: list[ImplausibleReadings] = []
    since_ns: dict[Comparison, int] = {}
    for entry in log.entries.get("/daq/event", []):
        event = entry.message
        if not isinstance(event, Event) or event.compared is None:
            continue
        if event.severity != "info":
            since_ns.setdefault(event.compared, entry.time_ns)
        elif event.compared in since_ns:
            implausible_readings.append(
                _period(event.compared, since_ns.pop(event.compared) - start_ns, entry.time_ns - start_ns)
            )
    return implausible_readings + [
        _period(compared, at_ns - start_ns, end_ns - start_ns) for compared, at_ns in since_ns.items()
    ]


def _period(compared: Comparison, start_ns: int, end_ns: int) -> ImplausibleReadings:
    return ImplausibleReadings(compared=compared, start_s=start_ns / 1e9, end_s=end_ns / 1e9)


def _iso(unix_ns: int) -> str | None:
    try:
        moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=unix_ns // 1000)
    except OverflowError:
        return None
    return moment.strftime("%Y-%m-%dT%H:%M:%SZ")


def _health(topic: str, statuses: bytes) -> SensorHealth:
    """Count statuses from the first measurement on; before it the sensor was starting. statuses: of `STATUS_CODE`."""
    first = statuses.find(STATUS_CODE[Status.OK])
    since = statuses[first:] if first >= 0 else statuses
    counts = {str(status.value): since.count(STATUS_CODE[status]) for status in FAULTS}
    return SensorHealth(
        topic=topic,
        messages=len(since),
        measurements=since.count(STATUS_CODE[Status.OK]),
        faults={status: number for status, number in counts.items() if number},
    )


def _weight_source(replacements: Replacements) -> str:
    if replacements.weight_N is not None:
        return "given with --weight"
    return f"mass.weight of the aircraft file {'given' if replacements.aircraft else 'in the log'}"


def _files(log: Log, contents: LogContents, replacements: Replacements, runs_file: Path | None) -> list[SourceFile]:
    names = {
        "aircraft.toml": contents.aircraft.name,
        "propeller.csv": contents.propeller.name,
        "probe.json": contents.probe.source,
        "magnetometer.json": "" if contents.magnetometer else None,
        "transducers.json": contents.transducers.source if contents.transducers else None,
        "thrust_stand.json": contents.thrust_stand.source if contents.thrust_stand else None,
        "airspeed.json": contents.airspeed.source if contents.airspeed else None,
        "zero.json": None if contents.zero is None else "",
    }
    files = []
    for attachment, name in names.items():
        if name is None:
            continue
        replacement = replacements.files.get(attachment)
        if replacement is not None:
            origin, sha256 = _origin_and_hash(replacement)
        elif attachment == "propeller.csv" and not _propeller_in_log(log, contents):
            origin, sha256 = _origin_and_hash(contents.aircraft.propulsion.propeller or contents.propeller.name)
        else:
            origin, sha256 = "the log", hashlib.sha256(log.attachments.get(attachment, b"")).hexdigest()
        files.append(SourceFile(role=ROLES[attachment], name=name, origin=origin, sha256=sha256))
    if runs_file:
        origin, sha256 = _origin_and_hash(str(runs_file))
        files.append(SourceFile(role="list of runs", name="", origin=origin, sha256=sha256))
    return files


def _propeller_in_log(log: Log, contents: LogContents) -> bool:
    """Whether the log's own table was used, which is valid for the propeller named in the aircraft file."""
    return "propeller.csv" in log.attachments and contents.aircraft.propulsion.propeller in (
        None,
        contents.propeller.name,
    )


def _origin_and_hash(name_or_path: str) -> tuple[str, str]:
    """Return origin and hash of a shipped propeller or a file."""
    if name_or_path in shipped_propellers():
        table = FOLDER.joinpath(f"{name_or_path}.csv").read_bytes()
        return "shipped with flightpower", hashlib.sha256(table).hexdigest()
    return name_or_path, sha256_of(Path(name_or_path))
