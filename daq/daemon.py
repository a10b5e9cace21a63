"""Records a tray into log files: on the aircraft with a real clock, in tests with a simulated one."""

import errno
import threading
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Protocol

from flightpower.daq.arm_switch import ArmSwitch
from flightpower.daq.attachments import Attachments, load_attachments, write_attachments
from flightpower.daq.background_recovery import BackgroundRecovery, Recovery
from flightpower.daq.bus import Buses
from flightpower.daq.bus_recording import BusRecording
from flightpower.daq.clock import Clock
from flightpower.daq.computer_watch import ComputerWatch
from flightpower.daq.config import EscCounterConfig, SensorTable, Tray
from flightpower.daq.crew_light import CrewLight
from flightpower.daq.disk_space import DiskSpace
from flightpower.daq.driver_factory import DriverFactory, driver_factory
from flightpower.daq.flight_card import load_card
from flightpower.daq.log_files import FileLimits, LogFiles
from flightpower.daq.log_names import numbered_logs, numbered_names, part_names
from flightpower.daq.missed_ticks import MissedTicks
from flightpower.daq.plausibility import Plausibility
from flightpower.daq.recorder import Recorder
from flightpower.daq.recording_status import RecordingState, RecordingStatus, RunNews, readable
from flightpower.daq.sampling_loop import Cycle, StopFlag, cycles
from flightpower.daq.sensor_supervisor import SensorSupervisor, cause_of
from flightpower.daq.sensors import Sample
from flightpower.daq.still_air_zero import parse_zero
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.messages import Event, Time
from flightpower.flight.probe_maps import load_probe_maps

REPORT_EVERY_NS = 1_000_000_000
STOP_SERVICE = "sudo systemctl stop flightpower-daq"
OWN_TOPICS = ("/time", "/daq/tick", "/daq/event", "/daq/state")


class RecordingResult(NamedTuple):
    """The logs and counts of a finished recording."""

    paths: list[Path]  # the logs, in order
    ticks: int  # ticks recorded
    missed: int  # ticks skipped
    errors: dict[str, int]  # number of messages without a measurement, by sensor
    write_error: str  # why a part of the recording may be missing; empty when it is complete

    @property
    def path(self) -> Path:
        """The first log."""
        return self.paths[0]


class NoDeviceOpened(Exception):
    """None of the tray's buses and ports can be opened."""


class DeviceInUse(InputError):
    """Another program has the tray's devices open."""

    def __init__(self, cause: str):
        super().__init__(f"{cause}; if the service records, stop it: {STOP_SERVICE}")


class CycleListener(Protocol):
    """Receives every cycle, and the state once a second, before the cycle.

    Called from the sampling thread: must not wait and must not raise.
    """

    def on_cycle(self, cycle: Cycle, events: list[Event]) -> None: ...

    def on_status(self, status: RecordingStatus) -> None: ...

    def run_news(self) -> RunNews:
        """News of the runs: verdicts since the last call, and the progress of the run being flown."""


def sensor_supervisors(
    tray: Tray, buses: Buses, aircraft: Aircraft | None, bus_recording: BusRecording | None = None
) -> list[SensorSupervisor]:
    """Make one supervisor for each sensor of the tray, in the tray's order.

    Raises InputError if the configuration is incomplete.
    """

    def make(table: SensorTable) -> DriverFactory:
        if bus_recording is None:
            return driver_factory(table, tray, buses, aircraft)
        recording = bus_recording.sensor(table.name)
        return recording.driver_factory(driver_factory(table, tray, recording.buses(buses), aircraft))

    return [
        SensorSupervisor(
            table.name,
            table.device,
            table.topics,
            make(table),
            blocking=table.blocking,
            silent_at_rest=isinstance(table, EscCounterConfig) and not table.framed,
        )
        for table in tray.sensors
    ]


def open_devices(supervisors: list[SensorSupervisor], now_ns: int) -> None:
    """Open the buses and ports. Raises NoDeviceOpened if none can be opened, DeviceInUse if they are in use."""
    errors = [error for supervisor in supervisors if (error := supervisor.open(now_ns)) is not None]
    if len(errors) < len(supervisors):
        return
    for error in errors:
        if error.errno == errno.EBUSY:
            raise DeviceInUse(cause_of(error))
    causes = sorted({cause_of(error) for error in errors})
    raise NoDeviceOpened(
        f"none of the tray's buses and ports can be opened: {'; '.join(causes)}; run `daq check` to see what to do"
    )


def check_configuration(tray: Tray, buses: Buses) -> None:
    """Raises InputError if the tray, or a file that it names, is wrong. Opens no device."""
    if tray.card is not None:
        load_card(tray.card)
    sensor_supervisors(tray, buses, load_attachments(tray).aircraft)


def refuse_devices_in_use(tray: Tray, buses: Buses) -> None:
    """Raises DeviceInUse when another program has one of the tray's buses or ports open. Other errors are ignored."""
    for table in tray.sensors:
        try:
            if table.blocking:
                buses.i2c(table.device)
            else:
                buses.port(table.device, getattr(table, "baud", 0))
        except OSError as error:
            if error.errno == errno.EBUSY:
                raise DeviceInUse(f"{table.device}: {error.strerror}") from None


def record(
    tray: Tray,
    *,
    buses: Buses,
    clock: Clock,
    log_path: str | Path | None = None,
    until_ns: int | None = None,
    stop: StopFlag | None = None,
    new_file: threading.Event | None = None,
    threaded: bool = False,
    listener: CycleListener | None = None,
    bus_recording: BusRecording | None = None,
    progress: Callable[[float], None] | None = None,
    report: Callable[[RecordingStatus], None] | None = None,
    on_event: Callable[[Event], None] | None = None,
    light: CrewLight | None = None,
) -> RecordingResult:
    """Record the tray into new logs until `until_ns` (monotonic time of `clock`) or until `stop` is set.

    log_path: the first log; by default the next free log-NNNN.mcap in the tray's directory. new_file: when set, a new
    log is started and the flag is cleared. threaded: see `cycles`. bus_recording: receives every bus transaction.
    The sampling thread calls `progress` with the elapsed time [s] and `report` with the status, each once a second of
    the clock, and `on_event` with each event. light: shows the state.
    Raises InputError before anything is written (wrong configuration, unreadable file, existing log, devices in use),
    and NoDeviceOpened when no bus and no port can be opened.
    """
    attachments = load_attachments(tray)
    supervisors = sensor_supervisors(tray, buses, attachments.aircraft, bus_recording)
    if bus_recording is not None:
        bus_recording.begin(tray.text, attachments.aircraft)
    start_ns = clock.now_ns()
    open_devices(supervisors, start_ns)
    path = Path(log_path) if log_path is not None else None
    directory = Path(tray.directory) if path is None else path.parent
    name = numbered_names(directory) if path is None else part_names(path)
    old_logs = numbered_logs(directory) if path is None else []
    recovery = BackgroundRecovery(old_logs) if threaded else Recovery(old_logs)
    disk_space = DiskSpace(directory, round(tray.files.keep_free_MB * 1e6), tray.files.when_full)
    disk_space.check()
    if path is not None and not disk_space.sufficient:
        raise InputError(f"{path}: {disk_space.events()[0].text}")

    def begin(recorder: Recorder, number: int, now_ns: int, previous: Path | None) -> None:
        write_header(
            recorder, attachments, supervisors, rate_Hz=tray.rate_Hz, start_ns=now_ns, number=number, previous=previous
        )

    offset_ns = clock.unix_ns() - start_ns
    limits = FileLimits(round(tray.files.new_after_min * 60e9), round(tray.files.new_after_MB * 1e6))
    log_files = LogFiles(name, begin, offset_ns=offset_ns, limits=limits, disk_space=disk_space)
    arm_switch = ArmSwitch(tray.arm)
    probe = load_probe_maps(Path(tray.probe_calibration)) if tray.probe_calibration else None
    plausibility = Plausibility(probe, parse_zero(attachments.zero, tray.zero) if attachments.zero else None)
    missed_ticks = MissedTicks(round(1e9 / tray.rate_Hz))
    if disk_space.sufficient and arm_switch.recording:
        log_files.open(start_ns, waits=path is None)
    disk_space.start()
    recovery.start()
    computer = ComputerWatch()
    if threaded:
        computer.start()
    tell = on_event or (lambda event: None)
    ticks = missed = 0
    reported_ticks, reported_ns, report_ns = 0, start_ns, start_ns
    try:
        for cycle in cycles(
            supervisors,
            rate_Hz=tray.rate_Hz,
            clock=clock,
            stop=stop or threading.Event(),
            until_ns=until_ns,
            threaded=threaded,
        ):
            ticks, missed = ticks + 1, missed + cycle.tick.missed
            new_file_requested = new_file is not None and new_file.is_set()
            if new_file_requested and new_file is not None:
                new_file.clear()
            if (offset := satellite_offset_ns(cycle.samples)) is not None:
                log_files.satellite_offset_ns = offset
            events = recovery.events() + missed_ticks.add(cycle.tick, cycle.now_ns)
            events += plausibility.add(cycle.samples, cycle.now_ns) + computer.events()
            if light is not None:
                events += light.events()
            events += cycle.events + arm_switch.update(cycle.samples)
            events += log_files.update(cycle.now_ns, wanted=arm_switch.recording, new_file=new_file_requested)
            news = RunNews() if listener is None else listener.run_news()
            for event in [*events, *news.verdicts]:
                event.text = readable(event.text)
                tell(event)
            own = [Sample("/daq/event", cycle.now_ns, event) for event in [*events, *news.verdicts]]
            if cycle.now_ns >= report_ns:
                if not threaded:
                    computer.check(cycle.now_ns / 1e9)
                report_ns += REPORT_EVERY_NS * (1 + (cycle.now_ns - report_ns) // REPORT_EVERY_NS)
                elapsed_s = (cycle.now_ns - start_ns) / 1e9
                since_s = (cycle.now_ns - reported_ns) / 1e9
                status = RecordingStatus(
                    state=recording_state(log_files, armed=arm_switch.recording),
                    log=readable(log_files.path.name) if log_files.path else "",
                    elapsed_s=elapsed_s,
                    ticks=ticks,
                    missed=missed,
                    rate_Hz=(ticks - reported_ticks) / since_s if since_s else tray.rate_Hz,
                    free_bytes=disk_space.free_bytes if disk_space.free_bytes >= 0 else None,
                    error=readable(log_files.error),
                    sensors={each.name: each.health.state for each in supervisors},
                    slow=cycle.slow,
                    implausible=plausibility.implausible,
                    recent_missed=missed_ticks.recent(cycle.now_ns),
                    trouble=arm_switch.trouble + computer.trouble,
                    supply_low=computer.latest.supply_low,
                    processor_temperature_K=computer.latest.temperature_K,
                    values=plausibility.values(cycle.now_ns),
                    run=news.progress,
                    card=news.card,
                    reached=news.reached,
                )
                reported_ticks, reported_ns = ticks, cycle.now_ns
                own.append(Sample("/daq/state", cycle.now_ns, status.message))
                if progress is not None:
                    progress(elapsed_s)
                if report is not None:
                    report(status)
                if light is not None:
                    light.show(status)
                if listener is not None:
                    listener.on_status(status)
            log_files.write(cycle.samples + own, tick=cycle.tick.number, now_ns=cycle.now_ns)
            if listener is not None:
                listener.on_cycle(cycle, events)
    finally:
        recovery.stop()
        computer.stop()
        write_error = log_files.close()
    if log_files.dropped:
        write_error = write_error or f"the disk was too slow, and {log_files.dropped} messages were dropped"
    if not disk_space.sufficient:
        write_error = write_error or f"the disk of {directory} was full"
    errors = {supervisor.name: supervisor.errors for supervisor in supervisors}
    return RecordingResult(log_files.paths, ticks, missed, errors, write_error)


def satellite_offset_ns(samples: list[Sample]) -> int | None:
    """Unix time by the satellites minus monotonic time, from a tick's messages; None if they do not have it."""
    for topic, _, message, _ in reversed(samples):
        if topic == "/time" and isinstance(message, Time) and message.gps_utc_ns is not None:
            return None if message.monotonic_ns is None else message.gps_utc_ns - message.monotonic_ns
    return None


def write_header(
    recorder: Recorder,
    attachments: Attachments,
    supervisors: list[SensorSupervisor],
    *,
    rate_Hz: float,
    start_ns: int,
    number: int,
    previous: Path | None,
) -> None:
    """Start a log: write the attachments, and declare every topic, even if no message ever arrives on it."""
    write_attachments(
        recorder.log,
        attachments,
        rate_Hz=rate_Hz,
        start_unix_ns=start_ns + recorder.offset_ns,
        start_monotonic_ns=start_ns,
        part=number + 1,
        previous_log=readable(previous.name) if previous else "",
    )
    for topic in [*(topic for supervisor in supervisors for topic in supervisor.topics), *OWN_TOPICS]:
        recorder.log.declare(topic)


def recording_state(log_files: LogFiles, *, armed: bool) -> RecordingState:
    """Whether the daemon records, and if not, why. armed: whether the arm switch, if any, permits recording."""
    if log_files.recording:
        return RecordingState.RECORDING
    return RecordingState.CARD_FULL if armed else RecordingState.WAITING
