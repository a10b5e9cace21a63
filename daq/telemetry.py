"""Telemetry for the pilot's ground station: MAVLink, a few messages a second, sent by a separate process.

The daemon writes the latest readings into a pipe (`TelemetryLink`) and discards them when the pipe is full, so neither
a slow radio nor an error in this module delays a tick. The other end of the pipe is this module, run as a program.
"""

import math
import os
import select
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from flightpower.daq.config import AutopilotConfig, TelemetryConfig, Tray
from flightpower.daq.flight_card import FlightCard, load_card
from flightpower.daq.linux_bus import LinuxSerial
from flightpower.daq.recording_status import IN_ORDER, NO_NEWS_S, RecordingState, RecordingStatus, RunNews
from flightpower.daq.run_monitor import Progress, RunMonitor
from flightpower.daq.sampling_loop import Cycle
from flightpower.daq.still_air_zero import DIFFERENCE, Zero, parse_zero
from flightpower.daq.telemetry_port import UdpSender, open_port
from flightpower.daq.tick_means import FIELDS, Means, TickMeans
from flightpower.flight.aircraft import Aircraft, load_aircraft
from flightpower.flight.messages import OK, Event
from flightpower.flight.probe_maps import ProbeMaps, load_probe_maps
from flightpower.flight.units import GAS_CONSTANT_AIR

RESTART_AFTER_S = 5.0
HEARTBEAT_PERIOD_S = 1.0
STATE_PERIOD_S = 4.0  # period of the state as a text, so that a ground station that joins knows the state within 5 s
CHUNK_BYTES = 50  # length of a STATUSTEXT; a longer text is sent in several
TEXT_LENGTH = 200  # characters of a text; a line in the pipe must hold four texts
KEPT_EVENTS = 20  # number of latest events kept while the pipe is full
EVENTS_PER_LINE = 4  # a line must fit into PIPE_BUF
KEPT_MEANS = 25  # number of latest means of the readings kept while the pipe is full
MEANS_PER_LINE = 6
SEVERITIES = {"error": 3, "warning": 4, "info": 6}  # MAV_SEVERITY
TOPICS = frozenset(
    ("/gps", "/static", "/rpm", "/controls", "/probe/alpha", "/probe/beta", "/probe/airspeed", "/attitude")
)
MAX_AGE_S = 2.0  # older readings are not sent
VEHICLE_SYSTEM = 25  # system number without an autopilot
AUTOPILOT_SYSTEM = 1  # assumed until the autopilot has been heard: the default of ArduPilot and PX4


# Bits of SYS_STATUS (MAV_SYS_STATUS_SENSOR) by topic.
SENSOR_BITS = {
    "/imu": 0x1 | 0x2,  # gyroscopes, accelerometers
    "/imu/2": 0x20000 | 0x40000,
    "/mag": 0x4,
    "/baro": 0x8,
    "/static": 0x8,
    "/probe/alpha": 0x10,
    "/probe/beta": 0x10,
    "/probe/airspeed": 0x10,
    "/probe/airspeed/2": 0x10,
    "/gps": 0x20,
    "/gps/2": 0x20,
    "/rpm": 0x8000,  # motor outputs
    "/controls": 0x10000,  # RC receiver
    "/battery": 0x2000000,
}
LOGGING_BIT = 0x1000000
ALL_BITS = 0xFFFFFFFF  # missing sensors are reported as healthy, or MAVProxy would say "fence breach"


class SensorBits(NamedTuple):
    """Bits for SYS_STATUS: the kinds of sensors present, and the kinds without a failed sensor."""

    present: int
    healthy: int


class Snapshot(msgspec.Struct, kw_only=True):
    """One line of JSON in the pipe: the latest good messages by topic, their ages, new means and new events."""

    elapsed_s: float
    status: RecordingStatus | None = None  # status of the last second
    bits: SensorBits = SensorBits(0, 0)
    autopilot_system: int | None = None
    messages: dict[str, dict[str, Any]] = {}
    ages_s: dict[str, float] = {}
    events: list[Event] = []
    means: list[Means] = []


class TelemetryLink:
    """The daemon's end of the pipe. Satisfies `daq.daemon.CycleListener`."""

    def __init__(self, telemetry: TelemetryConfig, tray: Tray):
        self._period_ns = round(1e9 / telemetry.rate_Hz)
        self._due_ns: int | None = None
        self._start_ns = 0
        self._latest: dict[str, tuple[int, Any]] = {}
        self._events: deque[Event] = deque(maxlen=KEPT_EVENTS)
        self._tick_means = TickMeans()
        self._means: deque[Means] = deque(maxlen=KEPT_MEANS)
        self._encoder = msgspec.json.Encoder()
        self._status: RecordingStatus | None = None
        self._topics = {sensor.name: sensor.topics for sensor in tray.sensors}
        self._read_end, self._write_end = os.pipe2(os.O_CLOEXEC)
        os.set_blocking(self._write_end, False)
        self._news_end, self._news_write_end = os.pipe2(os.O_CLOEXEC)
        os.set_blocking(self._news_end, False)
        self._unfinished_news = b""
        self._last_news = RunNews()
        if telemetry.vehicle is None:
            alone = not any(isinstance(sensor, AutopilotConfig) for sensor in tray.sensors)
            telemetry = msgspec.structs.replace(telemetry, vehicle=alone)
        self._command = [
            sys.executable,
            "-m",
            "flightpower.daq.telemetry",
            msgspec.json.encode(telemetry).decode(),
            tray.probe_calibration or "",
            tray.zero if Path(tray.zero).exists() else "",
            tray.aircraft or "",
            tray.card or "",
        ]
        self._process: subprocess.Popen[bytes] | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._keep_alive, name="telemetry", daemon=True)
        self._thread.start()

    def on_status(self, status: RecordingStatus) -> None:
        """Keep the recording's state; each line carries it until the next state."""
        self._status = status

    def on_cycle(self, cycle: Cycle, events: list[Event]) -> None:
        """Keep this cycle's good messages and events, and write them to the pipe if a line is due."""
        for topic, time_ns, message, _ in cycle.samples:
            if topic in TOPICS and message.status is OK:
                self._latest[topic] = (time_ns, message)
        for event in events:  # a text is cut to the length that is sent
            self._events.append(Event(severity=event.severity, text=event.text[:TEXT_LENGTH]))
        means = self._tick_means.add(cycle.now_ns, cycle.samples)
        if means is not None:
            self._means.append(means)
        if self._due_ns is None:
            self._due_ns = self._start_ns = cycle.now_ns
        if cycle.now_ns < self._due_ns:
            return
        self._due_ns += self._period_ns * (1 + (cycle.now_ns - self._due_ns) // self._period_ns)
        content: dict[str, Any] = {
            "elapsed_s": (cycle.now_ns - self._start_ns) / 1e9,
            "status": self._status,
            "bits": sensor_bits(self._status, self._topics) if self._status else SensorBits(0, 0),
            "autopilot_system": cycle.autopilot_system,
            "messages": {topic: message for topic, (_, message) in self._latest.items()},
            "ages_s": {topic: (cycle.now_ns - at_ns) / 1e9 for topic, (at_ns, _) in self._latest.items()},
            "events": list(self._events)[:EVENTS_PER_LINE],
            "means": list(self._means)[:MEANS_PER_LINE],
        }
        line = self._encoder.encode(content)
        if len(line) >= select.PIPE_BUF:  # a write of this length is not atomic (pipe(7)); events and means alone fit
            line = self._encoder.encode(content | {"messages": {}})
        try:
            os.write(self._write_end, line + b"\n")
        except OSError:  # the pipe is full
            return
        for _ in content["events"]:
            self._events.popleft()
        for _ in content["means"]:
            self._means.popleft()

    def run_news(self) -> RunNews:
        """Messages about runs from the other process since the last call."""
        try:
            data = os.read(self._news_end, select.PIPE_BUF)
        except OSError:  # no news has come
            return self._last_news
        *lines, self._unfinished_news = (self._unfinished_news + data).split(b"\n")
        verdicts: list[Event] = []
        for line in lines:
            try:
                news = msgspec.json.decode(line, type=RunNews)
            except msgspec.MsgspecError:  # a fragment of a line, after the process was restarted
                continue
            verdicts += news.verdicts
            self._last_news = msgspec.structs.replace(news, verdicts=[])
        return msgspec.structs.replace(self._last_news, verdicts=verdicts)

    def close(self) -> None:
        """End the other process; wait at most 1 s before killing it."""
        self._closing.set()
        process = self._process
        if process is not None:
            process.terminate()
            try:
                process.wait(1.0)
            except subprocess.TimeoutExpired:
                process.kill()
        self._thread.join(1.0)
        for end in (self._write_end, self._read_end, self._news_end, self._news_write_end):
            os.close(end)

    def _keep_alive(self) -> None:
        """Start the other process, and restart it whenever it has ended."""
        while not self._closing.is_set():
            try:
                self._process = subprocess.Popen(self._command, stdin=self._read_end, stdout=self._news_write_end)
                self._process.wait()
                self._last_news = msgspec.structs.replace(self._last_news, progress="")
            except OSError as error:
                self._events.append(
                    Event(severity="warning", sensor="telemetry", text=f"telemetry cannot be started: {error}")
                )
            self._closing.wait(RESTART_AFTER_S)


class MavlinkEncoder:
    """Encodes snapshots as MAVLink packets for one ground station.

    Without an autopilot the packets come from component 1 of a fixed-wing aircraft: QGroundControl creates a vehicle
    for component 1 only, and for no onboard computer (its MultiVehicleManager). With an autopilot they come from
    component 191 of its system, and belong to its vehicle. The autopilot then reports speeds and position:
    QGroundControl does not distinguish which component sent VFR_HUD and GLOBAL_POSITION_INT.
    """

    def __init__(self, telemetry: TelemetryConfig, probe: ProbeMaps | None, zero: Zero | None):
        from pymavlink.dialects.v20 import ardupilotmega as mavlink  # the only dialect that install.sh keeps

        self._mavlink: Any = mavlink
        self._vehicle = telemetry.vehicle is not False
        self._system_id = telemetry.system_id
        component = mavlink.MAV_COMP_ID_AUTOPILOT1 if self._vehicle else mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
        self._link = mavlink.MAVLink(None, srcComponent=component)
        self._probe = probe
        self._zero = zero
        self._heartbeat_s: float | None = None
        self._said_well: bool | None = None
        self._state_s: float | None = None
        self._text_id = 0
        self._first_height_m: float | None = None

    def packets(self, snapshot: Snapshot) -> Iterator[bytes]:
        """The packets for a snapshot."""
        own = VEHICLE_SYSTEM if self._vehicle else snapshot.autopilot_system or AUTOPILOT_SYSTEM
        self._link.srcSystem = self._system_id or own
        for message in self._messages(snapshot):
            yield message.pack(self._link)

    def _messages(self, snapshot: Snapshot) -> Iterator[Any]:
        m, link = self._mavlink, self._link
        boot_ms = round(snapshot.elapsed_s * 1e3) & 0xFFFFFFFF
        if self._heartbeat_s is None or snapshot.elapsed_s - self._heartbeat_s >= HEARTBEAT_PERIOD_S:
            self._heartbeat_s = snapshot.elapsed_s
            # QGroundControl expects no parameters from a generic autopilot.
            kind = (
                (m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_GENERIC)
                if self._vehicle
                else (m.MAV_TYPE_ONBOARD_CONTROLLER, m.MAV_AUTOPILOT_INVALID)
            )
            yield link.heartbeat_encode(*kind, 0, 0, self._state_of(snapshot.status))
            if self._vehicle and snapshot.status is not None:  # an autopilot sends its own heartbeat and status
                yield self._sys_status(snapshot.bits)
        for event in snapshot.events:
            yield from self._text(event)
        status = snapshot.status
        due = self._state_s is None or snapshot.elapsed_s - self._state_s >= STATE_PERIOD_S
        if status is not None and (due or status.well is not self._said_well):
            self._state_s, self._said_well = snapshot.elapsed_s, status.well
            yield from self._text(Event(severity="info" if status.well else "warning", text=status.summary))
        fresh = {topic: values for topic, values in snapshot.messages.items() if snapshot.ages_s[topic] <= MAX_AGE_S}
        gps, static, controls = fresh.get("/gps", {}), fresh.get("/static", {}), fresh.get("/controls", {})
        flow = self._flow(fresh)
        airspeed = airspeed_mps(flow.get("qbar_Pa"), static.get("pressure_Pa"), static.get("temperature_K"))
        if self._vehicle:
            if gps.get("latitude_deg") is not None:
                yield self._position(gps, boot_ms)
            yield self._hud(gps, airspeed, controls.get("throttle") or 0.0)
        elif airspeed:
            yield link.named_value_float_encode(boot_ms, b"airspeed", airspeed)
        rpm = fresh.get("/rpm", {}).get("motor_speed_revps")
        named = {name: value for name, value in flow.items() if name != "qbar_Pa"}
        for name, value in {**named, "rpm": None if rpm is None else 60 * rpm}.items():
            if value is not None:
                yield link.named_value_float_encode(boot_ms, name.encode(), value)

    def _state_of(self, status: RecordingStatus | None) -> int:
        """MAV_STATE: booting, standing by, active when all is well, critical when not."""
        m = self._mavlink
        if status is None:
            state: int = m.MAV_STATE_BOOT
        elif not status.well:
            state = m.MAV_STATE_CRITICAL
        else:
            state = m.MAV_STATE_ACTIVE if status.state is RecordingState.RECORDING else m.MAV_STATE_STANDBY
        return state

    def _sys_status(self, bits: SensorBits) -> Any:
        """SYS_STATUS with the sensors' bits; load, battery and errors of the link are unknown."""
        return self._link.sys_status_encode(
            bits.present, bits.present, bits.healthy, 0, 0xFFFF, -1, -1, 0, 0, 0, 0, 0, 0
        )

    def _text(self, event: Event) -> Iterator[Any]:
        """STATUSTEXT, in chunks if it is long. A zero byte ends a text, so a text that fills its last chunk needs
        another, empty chunk."""
        severity, text = SEVERITIES.get(event.severity, 6), event.text.encode("ascii", "replace")
        if len(text) <= CHUNK_BYTES:
            yield self._link.statustext_encode(severity, text)
            return
        self._text_id = self._text_id % 0xFFFF + 1
        for number, begin in enumerate(range(0, len(text) + 1, CHUNK_BYTES)):
            yield self._link.statustext_encode(severity, text[begin : begin + CHUNK_BYTES], self._text_id, number)

    def _hud(self, gps: dict[str, Any], airspeed: float, throttle: float) -> Any:
        north, east, down = (gps.get(f"velocity_{axis}_mps") or 0.0 for axis in ("north", "east", "down"))
        return self._link.vfr_hud_encode(
            airspeed,
            math.hypot(north, east),
            round(course_deg(north, east)),
            round(100 * throttle),
            gps.get("height_msl_m") or 0.0,
            -down,
        )

    def _position(self, gps: dict[str, Any], boot_ms: int) -> Any:
        north, east, down = (gps.get(f"velocity_{axis}_mps") or 0.0 for axis in ("north", "east", "down"))
        height_m = gps.get("height_msl_m") or 0.0
        if self._first_height_m is None:
            self._first_height_m = height_m
        return self._link.global_position_int_encode(
            boot_ms,
            round(gps["latitude_deg"] * 1e7),
            round(gps["longitude_deg"] * 1e7),
            round(1e3 * height_m),
            round(1e3 * (height_m - self._first_height_m)),
            round(100 * north),
            round(100 * east),
            round(100 * down),
            round(100 * course_deg(north, east)) % 36000,
        )

    def _flow(self, fresh: dict[str, dict[str, Any]]) -> dict[str, float]:
        """Flow angles [deg] and dynamic pressure. Without a calibration, pressure ratios instead of angles."""
        alpha, beta, q_c = (
            self._difference(fresh, topic) for topic in ("/probe/alpha", "/probe/beta", "/probe/airspeed")
        )
        if q_c is None or q_c <= 0:
            return {}
        ratios = {"dpa_per_qc": alpha, "dpb_per_qc": beta}
        angles = {name: dp / q_c for name, dp in ratios.items() if dp is not None}
        if self._probe is None or alpha is None or beta is None:
            return {**angles, "qbar_Pa": q_c}
        flow = self._probe.flow(alpha / q_c, beta / q_c)
        return {
            "alpha_deg": math.degrees(flow.alpha_rad),
            "beta_deg": math.degrees(flow.beta_rad),
            "qbar_Pa": q_c / flow.q_ratio,
        }

    def _difference(self, fresh: dict[str, dict[str, Any]], topic: str) -> float | None:
        value: float | None = fresh.get(topic, {}).get(DIFFERENCE)
        if value is None or self._zero is None or topic not in self._zero.readings:
            return value
        return value - self._zero.readings[topic][DIFFERENCE].mean


def sensor_bits(status: RecordingStatus, topics: Mapping[str, Sequence[str]]) -> SensorBits:
    """The bits of SYS_STATUS. topics: each sensor's topics, by the sensor's name."""
    present = LOGGING_BIT
    failed = 0 if status.state is RecordingState.RECORDING and not status.error else LOGGING_BIT
    for name, state in status.sensors.items():
        for topic in topics.get(name, ()):
            bits = SENSOR_BITS.get(topic, 0)
            present |= bits
            failed |= 0 if state in IN_ORDER else bits
    return SensorBits(present, ALL_BITS & ~failed)


def airspeed_mps(qbar_Pa: float | None, static_Pa: float | None, temperature_K: float | None) -> float:
    """True airspeed, V = sqrt(2 qbar/rho) with rho = p/(R T) [m/s]; 0 if an argument is missing."""
    if not qbar_Pa or qbar_Pa < 0 or not static_Pa or not temperature_K:
        return 0.0
    return math.sqrt(2 * qbar_Pa * GAS_CONSTANT_AIR * temperature_K / static_Pa)


def course_deg(north: float, east: float) -> float:
    """Course over ground, 0 to 360 degrees."""
    return math.degrees(math.atan2(east, north)) % 360


def main(arguments: list[str]) -> None:
    """Read snapshots from standard input until it ends, and send them. A port that fails is reopened."""
    drop_priority()
    telemetry = msgspec.json.decode(arguments[0], type=TelemetryConfig)
    probe = load_probe_maps(Path(arguments[1])) if arguments[1] else None
    zero = parse_zero(Path(arguments[2]).read_text("utf-8"), arguments[2]) if arguments[2] else None
    card = load_card(arguments[4]) if arguments[4] else None
    monitor = run_monitor(load_aircraft(arguments[3]), probe, zero, card) if arguments[3] else None
    ground = MavlinkEncoder(telemetry, probe, zero)
    port: LinuxSerial | UdpSender | None = None
    progress: Progress | None = None
    previous = RunNews()
    decoder = msgspec.json.Decoder(Snapshot)
    snapshot, heard_s = Snapshot(elapsed_s=0.0), time.monotonic()
    for lines in newest_lines(0):
        if lines:
            snapshot, heard_s = decoder.decode(lines[-1]), time.monotonic()
        else:  # the recording stalls
            snapshot = without_news(snapshot, time.monotonic() - heard_s)
        earlier = [decoder.decode(line) for line in lines[:-1]]
        snapshot.events = [event for some in (*earlier, snapshot) for event in some.events]
        if monitor is not None and lines:
            means = [each for some in (*earlier, snapshot) for each in some.means]
            news, new_events = run_news(monitor, means, before=progress)
            snapshot.events += new_events
            if news != previous:
                os.write(1, msgspec.json.encode(news) + b"\n")
                previous = msgspec.structs.replace(news, verdicts=[])
            progress = monitor.progress()
        try:
            port = port or open_port(telemetry)
            for packet in ground.packets(snapshot):
                port.write(packet)
        except OSError as error:
            print(f"telemetry to {telemetry.to}: {error}", file=sys.stderr)
            port = None
            time.sleep(1.0)


def run_news(monitor: RunMonitor, means: list[Means], *, before: Progress | None) -> tuple[RunNews, list[Event]]:
    """Add `means` to the monitor. Returns news for the daemon, and events for the ground station. before: the last
    progress.

    The ground station gets two messages on the run being flown: how long to hold it, and that it is long enough.
    """
    verdicts = [
        Event(severity=severity, sensor="runs", text=text) for each in means for severity, text in monitor.texts(each)
    ]
    now = monitor.progress()
    begun = now is not None and (before is None or before.kind != now.kind)
    reached = now is not None and before is not None and before.more_s > 0 and now.more_s == 0
    new_events = [Event(sensor="runs", text=now.text)] if now is not None and (begun or reached) else []
    card = monitor.card.lines if monitor.card else []
    so_far = monitor.interval_text() if monitor.runs else ""
    return RunNews(
        verdicts=verdicts, progress=now.text if now else "", card=card, reached=so_far
    ), new_events + verdicts


def run_monitor(aircraft: Aircraft, probe: ProbeMaps | None, zero: Zero | None, card: FlightCard | None) -> RunMonitor:
    """Make the monitor of an aircraft's runs, with the zeros of `daq zero` and the card, if any."""
    readings = zero.readings if zero else {}
    zeros = {
        name: readings[topic][field].mean
        for topic, fields in FIELDS.items()
        for name, field in fields
        if field in readings.get(topic, {})
    }
    return RunMonitor(aircraft, probe, zeros, card)


def drop_priority() -> None:
    """Give up the real-time priority inherited from the daemon, if there is one."""
    try:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    except OSError:
        return


def without_news(last: Snapshot, silent_s: float) -> Snapshot:
    """The snapshot to send when nothing has come for `silent_s` [s] since the last snapshot."""
    status = last.status and msgspec.structs.replace(last.status, age_s=silent_s)
    bits = SensorBits(last.bits.present, last.bits.healthy & ~LOGGING_BIT)
    elapsed_s = last.elapsed_s + silent_s - (last.status.age_s if last.status else 0.0)
    return Snapshot(elapsed_s=elapsed_s, status=status, bits=bits, autopilot_system=last.autopilot_system)


def newest_lines(file: int) -> Iterator[list[bytes]]:
    """Yield whole lines as they arrive: all that have accumulated, or an empty list after NO_NEWS_S without any."""
    rest, heard_s = b"", time.monotonic()
    while True:
        wait_s = HEARTBEAT_PERIOD_S if time.monotonic() - heard_s >= NO_NEWS_S else NO_NEWS_S
        if not select.select([file], [], [], wait_s)[0]:
            yield []
            continue
        data, heard_s = os.read(file, 2**16), time.monotonic()
        if not data:
            return
        *lines, rest = (rest + data).split(b"\n")
        if lines:
            yield lines


if __name__ == "__main__":
    main(sys.argv[1:])
