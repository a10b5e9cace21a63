"""Injects faults inside parts into the fake tray in flight: counts wrong readings marked ok, and times the reports.

    .venv/bin/python benchmarks/injected_faults.py                # all of them, some 20 s
    .venv/bin/python benchmarks/injected_faults.py imu_range      # those whose names begin with this

A reading is wrong if it is marked ok and off by more than its noise in CHECKS. Exit code 1 if a reading is wrong in a
fault that readings show, or if a fault is not reported within 5 s. Faults that no reading shows are listed with the
reason.
"""

import struct
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import typer
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flightpower.daq.config import parse_tray
from flightpower.daq.daemon import record
from flightpower.daq.sensors.ublox import take_frames
from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import Status
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.tray import ADDRESSES, AUTOPILOT_PORT, ESC_PORT, GPS_PORT, FakeTray, TrayVariant
from flightpower.hw_fakes.ublox import ubx

ROOT = Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT / "tests" / "hw_fakes"))
from analytic_sensor_truth import AnalyticSensorTruth, sine  # noqa: E402

BEGIN_S, END_S = 9.0, 19.0  # start of the fault, and end of the flight
REPORTED_S = 5.0
IMU, MAG, BARO, STATIC = (ADDRESSES[name] for name in ("imu", "magnetometer", "baro", "static"))
AIRSPEED = ADDRESSES["airspeed"]
MERIDIAN_M = 111_320.0  # length of a degree of latitude


def rows(*functions: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda t_s: np.column_stack([function(t_s) + 0 * t_s for function in functions])


NORTH, EAST = sine(15.0, 2.0, 0.05), sine(1.0, 0.7, 0.08)
FORCE = rows(sine(0.0, 0.5, 0.16), sine(0.0, 0.3, 0.21), sine(-9.8, 1.0, 0.11))
RATE = rows(sine(0.0, 0.1, 0.16), sine(0.0, 0.1, 0.32), sine(0.0, 0.05, 0.08))
FIELD = rows(sine(10e-6, 10e-6, 0.07), sine(1e-6, 10e-6, 0.09), sine(45e-6, 4e-6, 0.15))
ATTITUDE = rows(sine(0.0, 0.1, 0.16), sine(0.05, 0.02, 0.06), sine(-2.0, 0.3, 0.04))
DIFFERENCE, STATIC_PA, REVS = sine(150.0, 40.0, 0.05), sine(99_000.0, 60.0, 0.04), sine(100.0, 10.0, 0.1)
PULSE = sine(1500.0, 100.0, 0.1)


def truth() -> AnalyticSensorTruth:
    """Return a flight in which everything moves, without noise, so that every deviation comes from the fault."""
    return AnalyticSensorTruth(
        differential_Pa=DIFFERENCE,
        absolute_Pa=STATIC_PA,
        force_mps2=FORCE,
        rate_radps=RATE,
        field_T=FIELD,
        attitude_rad=ATTITUDE,
        motor_revps=REVS,
        velocity_mps=rows(NORTH, EAST, lambda t_s: 0.0 * t_s),
        latitude_deg=lambda t_s: 47 + 15 * t_s / MERIDIAN_M,
        pulses_us=rows(*[PULSE] * 8),
    )


class Check(NamedTuple):
    """A field of a topic, its true value over time, its age when it is recorded, and its noise."""

    topic: str
    value: Callable[[Any], float | None]
    true: Callable[[float], float]
    age_s: float
    noise: float


def altered_at(function: Callable[[Any], Any], axis: int | None = None) -> Callable[[float], float]:
    return lambda t_s: float(np.asarray(function(np.array([t_s])))[(0,) if axis is None else (0, axis)])


def reading_check(topic: str, name: str, true: Callable[[float], float], age_s: float, noise: float) -> Check:
    return Check(topic, lambda message: getattr(message, name), true, age_s, noise)


CHECKS = (
    *(
        reading_check("/imu", f"specific_force_{axis}_mps2", altered_at(FORCE, i), 0.031, 0.1)
        for i, axis in enumerate("xyz")
    ),
    *(
        reading_check("/imu", f"angular_rate_{axis}_radps", altered_at(RATE, i), 0.03, 0.01)
        for i, axis in enumerate("xyz")
    ),
    *(reading_check("/mag", f"field_{axis}_T", altered_at(FIELD, i), 0.005, 1e-6) for i, axis in enumerate("xyz")),
    reading_check("/baro", "pressure_Pa", altered_at(STATIC_PA), 0.0, 5.0),
    reading_check("/static", "pressure_Pa", altered_at(STATIC_PA), 0.0, 5.0),
    *(
        reading_check(f"/probe/{w}", "differential_pressure_Pa", altered_at(DIFFERENCE), 0.0, 3.0)
        for w in ("alpha", "beta", "airspeed")
    ),
    reading_check("/gps", "velocity_north_mps", altered_at(NORTH), 0.1, 0.2),
    reading_check("/gps", "latitude_deg", lambda t_s: 47 + 15 * t_s / MERIDIAN_M, 0.1, 3.0 / MERIDIAN_M),
    reading_check("/rpm", "motor_speed_revps", altered_at(REVS), 0.02, 2.0),
    *(
        reading_check("/attitude", f"{name}_rad", altered_at(ATTITUDE, i), 0.02, 0.01)
        for i, name in enumerate(("roll", "pitch"))
    ),
    Check("/controls", lambda message: message.pulse_us and message.pulse_us[1], altered_at(PULSE), 0.02, 5.0),
)
DRAWN = np.random.default_rng(11)


DEFAULT = TrayVariant()


@dataclass
class Fault:
    """A part's behavior after BEGIN_S.

    once: changes the fake part. reply: turns (address, sent, reply) into the faulty reply on the bus. received: turns
    (device, bytes) into the faulty bytes on a line. shown_after_s: until then no reading shows the fault, for the
    reason in `hidden`. reported: whether the crew must hear of it; single damaged replies are only marked.
    """

    name: str
    once: Callable[[FakeTray, int], None] = lambda fake, now_ns: None
    reply: Callable[["Fault", int, bytes, bytes], bytes] = lambda fault, address, sent, reply: reply
    received: Callable[["Fault", str, bytes], bytes] = lambda fault, device, data: data
    variant: TrayVariant = DEFAULT
    from_start: bool = False
    shown_after_s: float = 0.0
    hidden: str = ""
    reported: bool = True
    tray: Callable[[str], str] = lambda text: text
    state: dict[Any, Any] = field(default_factory=dict)


class Wires:
    """The fake tray's buses with the fault in effect."""

    def __init__(self, fake: FakeTray, fault: Fault, clock: SimulatedClock):
        self._fake, self._fault, self._clock = fake, fault, clock
        self._start_ns, self._done = clock.now_ns(), False
        fault.state.clear()

    def active(self) -> bool:
        now_ns = self._clock.now_ns() - self._start_ns
        if now_ns < BEGIN_S * 1e9 and not self._fault.from_start:
            return False
        if not self._done:
            self._done = True
            self._fault.once(self._fake, now_ns)
        return True

    def i2c(self, device: str) -> Any:
        bus, wires = self._fake.i2c(device), self

        class Bus:
            def write(self, address: int, data: bytes) -> None:
                wires.active()
                bus.write(address, data)

            def read(self, address: int, count: int) -> bytes:
                return wires.replied(address, b"", bus.read(address, count))

            def write_read(self, address: int, data: bytes, count: int) -> bytes:
                wires.active()
                return wires.replied(address, data, bus.write_read(address, data, count))

        return Bus()

    def replied(self, address: int, sent: bytes, reply: bytes) -> bytes:
        fault = self._fault
        if not self.active():
            fault.state.setdefault("before", {})[(address, sent)] = reply
            return reply
        return fault.reply(fault, address, sent, reply)

    def port(self, device: str, baud: int) -> Any:
        port, wires = self._fake.port(device, baud), self

        class Port:
            def read_available(self) -> bytes:
                active, data = wires.active(), port.read_available()
                return wires._fault.received(wires._fault, device, data) if active else data

            def write(self, data: bytes) -> None:
                port.write(data)

        return Port()


# --- effects of faults inside parts


def registers(**values: int) -> Callable[[FakeTray, int], None]:
    """Change registers of the IMU, as a disturbance does."""

    def lose(fake: FakeTray, now_ns: int) -> None:
        for register, value in values.items():
            fake.imu._registers[int(register[1:], 16)] = value
        fake.imu._restart_sampling(now_ns)

    return lose


def frozen(address: int, sent: bytes, size: int | None = None) -> Any:
    """Repeat the last reply, or for a FIFO the last sample."""

    def again(fault: Fault, to: int, request: bytes, reply: bytes) -> bytes:
        if (to, request) != (address, sent):
            return reply
        frozen_reply = fault.state.setdefault("frozen", fault.state["before"][(address, sent)])
        return (frozen_reply[: size or len(frozen_reply)] * (len(reply) // (size or len(frozen_reply)) + 1))[
            : len(reply)
        ]

    return again


def frozen_pressure(fault: Fault, to: int, request: bytes, reply: bytes) -> bytes:
    """Repeat the barometer's last pressure; its temperature keeps changing."""
    if to != STATIC or request != b"\0":
        return reply
    value = int.from_bytes(reply, "big")
    pressure = fault.state.setdefault("pressure", value if abs(value - 6_400_000) < 900_000 else None)
    if pressure is None:
        del fault.state["pressure"]
        return reply
    return pressure.to_bytes(3, "big") if abs(value - pressure) < 20_000 else reply


def shifted(share: float, *addresses: int) -> Any:
    """Shift replies by a bit, as the Raspberry Pi's controller does when a part stretches the clock."""

    def shift(fault: Fault, to: int, request: bytes, reply: bytes) -> bytes:
        if to not in addresses or DRAWN.random() >= share:
            return reply
        return (int.from_bytes(reply, "big") >> 1).to_bytes(len(reply), "big")

    return shift


def one_wrong_bit(share: float, *addresses: int) -> Any:
    """Flip one bit of a reply."""

    def flip(fault: Fault, to: int, request: bytes, reply: bytes) -> bytes:
        if to not in addresses or DRAWN.random() >= share:
            return reply
        place = int(DRAWN.integers(len(reply)))
        return reply[:place] + bytes([reply[place] ^ 1 << int(DRAWN.integers(8))]) + reply[place + 1 :]

    return flip


def second_part(fault: Fault, to: int, request: bytes, reply: bytes) -> bytes:
    """Put another transducer at the same address: both pull the line down."""
    other = (8192 << 16 | 900 << 5).to_bytes(4, "big")
    return bytes(a & b for a, b in zip(reply, other, strict=True)) if to == AIRSPEED else reply


def solutions(change: Callable[[Fault, bytes], bytes]) -> Any:
    """Replace each solution of the receiver."""

    def replaced(fault: Fault, device: str, data: bytes) -> bytes:
        if device != GPS_PORT:
            return data
        buffer = fault.state.setdefault("buffer", bytearray())
        buffer += data
        return b"".join(change(fault, f) if f[2:4] == b"\x01\x07" else f for f in take_frames(buffer)[0])

    return replaced


def patched(**values: tuple[int, str, int]) -> Callable[[Fault, bytes], bytes]:
    def patch(fault: Fault, frame: bytes) -> bytes:
        payload = bytearray(frame[6:-2])
        for offset, kind, value in values.values():
            struct.pack_into(kind, payload, offset, value)
        return ubx(1, 7, bytes(payload))

    return patch


def frozen_solution(fault: Fault, frame: bytes) -> bytes:
    """Send a new time of week and date, with everything else as before."""
    return ubx(1, 7, frame[6:30] + fault.state.setdefault("frame", frame)[30:-2])


def restarted(rate_ms: int) -> Callable[[FakeTray, int], None]:
    """Interrupt the receiver's supply; with its saved configuration it then smooths velocity with a filter."""

    def restart(fake: FakeTray, now_ns: int) -> None:
        fake.gps.power_cycle(now_ns)
        fake.gps._protocols_out, fake.gps._rates[(1, 7)] = 1, 1
        fake.gps._set_period(rate_ms, now_ns)

    return restart


def refuses(*message_ids: int) -> Callable[[FakeTray, int], None]:
    def refuse(fake: FakeTray, now_ns: int) -> None:
        original = fake.gps._command

        def command(kind: int, number: int, payload: bytes, at_ns: int) -> None:
            if kind == 6 and number in message_ids:
                fake.gps._replies.append((at_ns + 2_000_000, ubx(5, 0, bytes([6, number]))))
            else:
                original(kind, number, payload, at_ns)

        fake.gps._command = command  # type: ignore[method-assign]

    return refuse


def does_5_Hz(fake: FakeTray, now_ns: int) -> None:
    fake.gps._configure_rate = lambda payload, at_ns: fake.gps._set_period(200, at_ns) or True  # type: ignore


def sender(system: int, component: int, *messages: Any) -> Any:
    """Add another sender to the autopilot's line."""
    link = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)

    def mixed(fault: Fault, device: str, data: bytes) -> bytes:
        return data + b"".join(bytes(each.pack(link)) for each in messages) if device == AUTOPILOT_PORT else data

    return mixed


def slow_streams(fake: FakeTray, now_ns: int) -> None:
    fake.autopilot._period_ms |= {"ATTITUDE": 240, "SERVO_OUTPUT_RAW": 240, "RC_CHANNELS": 240}


def frozen_attitude(fake: FakeTray, now_ns: int) -> None:
    original = fake.autopilot._message
    frozen_message = original("ATTITUDE", now_ns // 20_000_000 * 20)
    fake.autopilot._message = lambda name, at_ms: frozen_message if name == "ATTITUDE" else original(name, at_ms)  # type: ignore


def frozen_period(fault: Fault, device: str, data: bytes) -> bytes:
    if device != ESC_PORT or not data:
        return data
    return fault.state.setdefault("frame", data[-4:]) * (len(data) // 4)


def damaged_line(device: str, share: float) -> Any:
    def damage(fault: Fault, at_device: str, data: bytes) -> bytes:
        if at_device != device:
            return data
        return bytes(b ^ 1 << int(DRAWN.integers(8)) if DRAWN.random() < share else b for b in data)

    return damage


HELD = "a held value looks like one for as long as others have been the same"
GIMBAL = mavlink.MAVLink_attitude_message(0, 0, 1.0, 0, 0, 0, 0)
VEHICLE = mavlink.MAVLink_servo_output_raw_message(0, 0, *[1111] * 8)
HEARTBEAT = mavlink.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3)
FRAMED = TrayVariant(rpm_with_crc=True)
FAULTS = [
    Fault("imu_ranges_lost", registers(x1B=0, x1C=0)),
    Fault("imu_gyro_range_lost", registers(x1B=0)),
    Fault("imu_accelerometer_range_lost", registers(x1C=0)),
    Fault("imu_rate_lost", registers(x19=0)),
    Fault("imu_filter_lost", registers(x1A=0x40)),
    Fault("imu_fifo_lost", registers(x23=0)),
    Fault("imu_bypass_lost", registers(x37=0)),
    Fault("imu_loses_supply", lambda fake, now_ns: fake.imu.power_cycle(now_ns)),
    Fault("imu_frozen", reply=frozen(IMU, b"\x74", 14)),
    Fault("imu_shifted", reply=shifted(0.01, IMU), reported=False),
    Fault("imu_wrong_bit", reply=one_wrong_bit(0.05, IMU), reported=False),
    Fault("mag_frozen", reply=frozen(MAG, b"\x02"), shown_after_s=1.05, hidden=HELD),
    Fault("mag_shifted", reply=shifted(0.02, MAG), reported=False),
    Fault("static_frozen", reply=frozen_pressure, shown_after_s=1.05, hidden=HELD),
    Fault("static_shifted", reply=shifted(0.02, STATIC, BARO), reported=False),
    Fault("baro_is_an_ms5607", variant=TrayVariant(ms5607=True), from_start=True),
    Fault("baro_resets", lambda fake, now_ns: fake.baro.power_cycle(now_ns), reported=False),
    Fault("airspeed_frozen", reply=frozen(AIRSPEED, b""), shown_after_s=1.05, hidden=HELD),
    Fault("airspeed_shifted", reply=shifted(0.05, AIRSPEED), reported=False),
    Fault("airspeed_wrong_bit_above_10_Pa", reply=one_wrong_bit(0.02, AIRSPEED), reported=False, shown_after_s=99,
          hidden="a wrong bit of less than 10 Pa is a gust, for all that one reading shows"),
    Fault("airspeed_second_part", reply=second_part),
    Fault("airspeed_latched_fault", lambda fake, now_ns: setattr(fake.airspeed, "fault", True)),
    Fault("gps_repeats", received=solutions(lambda fault, frame: fault.state.setdefault("frame", frame))),
    Fault("gps_frozen_and_counts_time", shown_after_s=0.5, hidden=HELD,
          received=solutions(frozen_solution)),
    Fault("gps_restarts_at_1_Hz", restarted(1000), shown_after_s=3.0,
          hidden="velocity is smoothed until the filter is set again; its model is logged as unknown meanwhile"),
    Fault("gps_restarts_at_10_Hz", restarted(100), shown_after_s=3.0, reported=False,
          hidden="as before; if no solution is missing, the model is found wrong within 2 s"),
    Fault("gps_refuses_the_rate", refuses(0x08), from_start=True),
    Fault("gps_does_5_Hz", does_5_Hz, from_start=True),
    Fault("gps_refuses_an_m8s_commands", refuses(0x00, 0x01, 0x08, 0x24), from_start=True),
    Fault("gps_300_mps", received=solutions(patched(north=(48, "<i", 300_000)))),
    Fault("gps_damaged_line", received=damaged_line(GPS_PORT, 0.02)),
    Fault("autopilot_streams_slowly", slow_streams),
    Fault("autopilot_gimbal", received=sender(1, 154, GIMBAL), reported=False),
    Fault("autopilot_other_vehicle", received=sender(2, 1, GIMBAL, VEHICLE, HEARTBEAT), reported=False),
    Fault("autopilot_65535", received=sender(1, 1, mavlink.MAVLink_servo_output_raw_message(0, 0, *[65535] * 8))),
    Fault("autopilot_attitude_of_1e9", received=sender(1, 1, mavlink.MAVLink_attitude_message(0, 0, 1e9, 0, 0, 0, 0))),
    Fault("autopilot_frozen_attitude", frozen_attitude, shown_after_s=1.05, hidden=HELD),
    Fault("rpm_frozen", received=frozen_period, shown_after_s=1.05, hidden=HELD),
    Fault("rpm_wrong_bits_with_crc", received=damaged_line(ESC_PORT, 0.02), variant=FRAMED, reported=False,
          tray=lambda text: text.replace("framed = false", "framed = true")),
    Fault("rpm_wrong_bits_without_crc", received=damaged_line(ESC_PORT, 0.005), reported=False, shown_after_s=99,
          hidden="without a CRC, a wrong bit of less than 5 % is the speed of another moment"),
]  # fmt: skip


class Outcome(NamedTuple):
    """hidden, wrong: readings marked ok that are off by more than their noise, before and after readings show the fault

    worst: largest deviation of `wrong`, in units of noise. event_s, state_s: time from fault to event and to state
    """

    ok: int
    hidden: int
    wrong: int
    worst: float
    by_topic: dict[str, int]
    event_s: float | None
    state_s: float | None
    event: str
    last_second_ok: int  # number of readings


def run(fault: Fault) -> Outcome:
    """Fly until END_S with the fault."""
    clock = SimulatedClock(start_ns=3_000_000_000, unix_at_start_ns=1_700_000_000 * 10**9)
    start_ns = clock.now_ns()
    fake = FakeTray(truth(), clock, 2, variant=fault.variant)
    text = fault.tray((ROOT / "daq" / "tray.example.toml").read_text("utf-8"))
    began_s = 0.0 if fault.from_start else BEGIN_S
    events: list[tuple[float, str]] = []
    states: list[tuple[float, bool]] = []

    def now_s() -> float:
        return (clock.now_ns() - start_ns) * 1e-9

    with tempfile.TemporaryDirectory() as folder:
        tray = parse_tray(text, "tray.toml", Path(folder))
        recording = record(
            tray,
            buses=Wires(fake, fault, clock),
            clock=clock,
            until_ns=start_ns + round(END_S * 1e9),
            on_event=lambda event: events.append((now_s(), event.text)) if event.severity != "info" else None,
            report=lambda status: states.append((now_s(), status.well)),
        )
        (log,) = map(read_log, recording.paths)
    first_ns = log.entries["/daq/tick"][0].time_ns
    ok = hidden = wrong = last_ok = 0
    worst, by_topic = 0.0, dict[str, int]()
    for topic, checked in ((topic, [c for c in CHECKS if c.topic == topic]) for topic in {c.topic for c in CHECKS}):
        for entry in log.entries[topic]:
            t_s = (entry.time_ns - first_ns) * 1e-9
            if entry.message.status is not Status.OK or t_s < began_s:
                continue
            ok += 1
            last_ok += t_s >= END_S - 1
            offs = [
                abs(value - check.true(t_s - check.age_s)) / check.noise
                for check in checked
                if (value := check.value(entry.message)) is not None
            ]
            if max(offs, default=0.0) <= 1:
                continue
            if t_s < began_s + fault.shown_after_s:
                hidden += 1
            else:
                wrong += 1
                by_topic[topic] = by_topic.get(topic, 0) + 1
                worst = max(worst, *offs)
    first = next(((s, text) for s, text in events if s >= began_s and "autopilot degraded: no_data" not in text), None)
    settled_s = max(began_s, 3.0) if fault.from_start else began_s
    ill = next((s for s, well in states if s >= settled_s and not well), None)
    event_s = None if first is None else first[0] - began_s
    state_s = None if ill is None else ill - began_s
    return Outcome(ok, hidden, wrong, worst, by_topic, event_s, state_s, first[1] if first else "", last_ok)


def outcomes(begin: str = "") -> Iterator[tuple[Fault, Outcome]]:
    for fault in FAULTS:
        if fault.name.startswith(begin):
            yield fault, run(fault)


def is_reported(fault: Fault, outcome: Outcome) -> bool:
    """Return whether events and state reported the fault within REPORTED_S."""
    return not fault.reported or all(s is not None and s <= REPORTED_S for s in (outcome.event_s, outcome.state_s))


def main(begin: str = typer.Argument("")) -> None:
    """Print a table and the verdict."""
    failed, names = 0, []
    print(f"{'fault':32} {'ok':>5} {'hidden':>6} {'wrong':>5} {'event':>6} {'state':>6}")
    for fault, outcome in outcomes(begin):
        times = [f"{s:6.1f}" if s is not None else "     -" for s in (outcome.event_s, outcome.state_s)]
        good = not outcome.wrong and is_reported(fault, outcome)
        failed += not good
        print(
            f"{fault.name:32} {outcome.ok:5} {outcome.hidden:6} {outcome.wrong:5} {' '.join(times)}"
            f" {'' if good else 'BAD '}{outcome.event[:90]} {outcome.by_topic or ''}"
        )
        if fault.hidden:
            names.append(f"{fault.name}: {fault.hidden}")
    print("what no reading shows:", *names, sep="\n  ")
    raise typer.Exit(failed > 0)


if __name__ == "__main__":
    typer.run(main)
