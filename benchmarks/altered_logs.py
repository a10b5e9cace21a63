"""Feeds altered logs, tables, missions and propeller tables to their readers: no traceback, warning or hang is allowed.

    python benchmarks/altered_logs.py --inputs 1000000 --minutes 30

The logs are as short as their reader, or the estimate, permits. Each input has one to eight alterations, which its
number determines: changed bytes and bits; integers and floats at their limits; stretches cut, repeated or moved. In
every second text, numbers, words and lines are replaced instead, so that parsing gets past the first line. Messages
of the daemon are altered before they are packed into a log. A defect is any exception except a refusal, a warning from
a library, more than 10 s for one input, or more than 2 GB of memory; its input is kept in tests/data/fuzz.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import io
import json
import random
import re
import resource
import signal
import struct
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Annotated

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
import typer

from flightpower.analysis.missions.mission import Assumed
from flightpower.analysis.missions.mission_files import load_mission
from flightpower.analysis.pages.predicted_polar import read_predicted_polar
from flightpower.analysis.sources.ardupilot import read_ardupilot
from flightpower.analysis.sources.map_draft import draft
from flightpower.analysis.sources.open import open_source
from flightpower.analysis.sources.paparazzi import read_paparazzi
from flightpower.analysis.sources.px4 import read_px4
from flightpower.analysis.sources.structure import check_log, receiver_notes
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import read_log
from flightpower.flight.log_writer import LogWriter
from flightpower.flight.messages import TYPE_OF_TOPIC
from flightpower.flight.propeller_files import load_propeller
from flightpower.flight.shipped_propellers import FOLDER
from flightpower.sim.dataflash_writer import DataflashMessages, write_dataflash, write_text
from flightpower.sim.telemetry_writer import write_telemetry
from flightpower.sim.ulog_writer import UlogContents, UlogTopic, write_ulog
from tests.fuzz_targets import electrical

KEPT = Path(__file__).resolve().parent.parent / "tests" / "data" / "fuzz"
IN_MEMORY = Path("/dev/shm") if Path("/dev/shm").is_dir() else None
READ_S, FLOWN_S = 4.4, 64.0  # shortest that is read at 5 messages a second; shortest that gives a curve at 1
SLOWEST_S, MEMORY_BYTES = 10.0, 2 << 30
BATCH = 500
LIMITS = [struct.pack(code, x) for code, x in (
    ("<f", np.nan), ("<f", np.inf), ("<f", -3e38), ("<f", 1e-40), ("<d", np.nan), ("<d", -np.inf), ("<d", 1e300),
    ("<I", 0), ("<I", 2**32 - 1), ("<i", 2**31 - 1), ("<q", -1), ("<Q", 2**63), ("<H", 0), ("<H", 2**16 - 1),
    ("<B", 0), ("<B", 255), ("<B", 127),
)]  # fmt: skip
PART_OF_TEXT = re.compile(rb"[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?|[A-Za-z_]+|[^A-Za-z0-9\s]")
OTHER_PARTS = (
    b"", b"0", b"-1", b"1", b"65535", b"4294967296", b"1e400", b"-1e300", b"1e-320", b"nan", b"inf", b"null", b"true",
    b"[]", b"{}", b'"x"', b"abc", b"12:60:61", b"2024-02-30", b"1,5", b"\xff", b"\0", b"\xc3\xa9", b" ", b"\t", b";",
    b"180", b"-90.1", b"1000000000000000000000000000000", b"0x10", b"1_000", b"-0", b"NaN", b"\xe2\x88\x92" b"5",
)  # fmt: skip


def small_table() -> bytes:
    """Return a radio's log that needs no map: times of day, positions in one cell, units in brackets."""
    lines = ["Date,Time,RSSI(dB),GPS,GSpd(kmh),Hdg(@),Alt(m),ASpd(kts),VFAS(V),Curr(A)"]
    for i in range(60):
        wave = np.sin(0.3 * i)
        lines.append(
            f"2024-05-01,12:59:{i:02d}.500,80,{48 + 1e-4 * i:.6f} 11.500000,{60 + 9 * wave:.1f},{i},"
            f"{50 + 5 * wave:.1f},{31 + 4 * wave:.1f},{15 - 0.2 * wave:.2f},{8 + 3 * wave:.2f}"
        )
    return "\n".join(lines).encode()


def jeti_table() -> bytes:
    """Return a log of another radio, with a line for each device and time."""
    lines = ["# one", "000000000;42;0;MSPEED;", "000000000;42;1;Velocity;m/s", "000000000;43;0;MUI-75;",
             "000000000;43;1;Voltage;V", "000000000;43;2;Current;A", "000000000;44;0;MGPS;",
             "000000000;44;2;Latitude; ", "000000000;44;6;Altitude;m"]  # fmt: skip
    for i in range(40):
        wave = np.sin(0.3 * i)
        time_text = f"{200 * i + 3000:09d}"
        lines += [f"{time_text};42;1;1;1;{150 + 30 * wave:.0f}",
                  f"{time_text};43;1;1;2;{1500 + 10 * wave:.0f};2;1;1;{80 + i}",
                  f"{time_text};44;2;9;0;{(48 << 16) + 30_000 + i};6;1;0;{50 + i}"]  # fmt: skip
    return "\n".join(lines).encode()


def european_table() -> bytes:
    """Return a table with semicolons, decimal commas, a line of units, and lines before the names."""
    rows = [
        f"{i / 5:.1f};{15 + np.sin(i / 9):.2f};{50 + np.sin(i / 7):.2f};14,9;{8 + np.sin(i / 9):.2f}" for i in range(60)
    ]
    head = ["recorder 2", "", "Zeit;airspeed;altitude;voltage;current", "s;m/s;m;V;A"]
    return "\n".join([*head, *(row.replace(".", ",") for row in rows)]).encode()


def matlab_structure() -> bytes:
    from scipy.io import savemat

    t_s, stream = np.arange(60) / 5, io.BytesIO()
    v = np.stack([12 + np.sin(t_s), np.cos(t_s), 0 * t_s])
    savemat(stream, {"log": {"times": t_s, "airspeed": 15 + np.sin(t_s), "v": v, "altitude": 50 + t_s}})
    return stream.getvalue()


def matlab_log() -> bytes:
    from scipy.io import savemat

    t_us, stream = 1e6 + 2e5 * np.arange(60), io.BytesIO()
    kinds = {
        "ARSP": ("Airspeed", 15 + np.sin(t_us / 1e6)),
        "BARO": ("Press", 1e5 + t_us * 0),
        "BAT": ("Volt", 15 + 0 * t_us),
    }
    parts: dict[str, object] = {}
    for name, (field, value) in kinds.items():
        parts |= {name: np.column_stack([t_us, value]), f"{name}_label": np.array(["TimeUS", field], dtype=object)}
    names = np.empty((1, 2), dtype=object)
    names[0] = ["TECS_CLMB_MAX", 5.0]
    savemat(stream, parts | {"PARM": names})
    return stream.getvalue()


def paparazzi() -> bytes:
    lines = []
    for i in range(40):
        sent = ("AIR_DATA 95000.0 140.0 15.0 1013.0 500.0 15.1 15.4", "ENERGY 50 15.0 8.0 120 1 1",
                "GPS 3 100 200 900 500000 1500 10")  # fmt: skip
        lines += [f"{i / 4:.2f} 7 {message}" for message in sent]
    return "\n".join(lines).encode()


def daemon_messages() -> bytes:
    """Return messages of the daemon, one per line: topic, time in nanoseconds, JSON."""
    lines = []
    for i in range(30):
        wave = float(np.sin(0.3 * i))
        for topic, values in {
            "/imu": {**{f"specific_force_{axis}_mps2": x for axis, x in zip("xyz", (wave, 0.1, -9.8), strict=True)},
                     **{f"angular_rate_{axis}_radps": 0.1 * wave for axis in "xyz"}, "group_delay_s": 0.004},
            "/probe/airspeed": {"differential_pressure_Pa": 140 + 20 * wave, "temperature_K": 290.0},
            "/probe/alpha": {"differential_pressure_Pa": 20 * wave},
            "/probe/beta": {"differential_pressure_Pa": 2 * wave},
            "/static": {"pressure_Pa": 95000 + 50 * wave, "temperature_K": 295.0},
            "/rpm": {"period_us": 2000, "motor_speed_revps": 100 + wave},
            "/gps": {"itow_ms": 1000 + 40 * i, "fix_type": 3, "satellites": 9, "velocity_north_mps": 15 + wave,
                     "velocity_east_mps": wave, "velocity_down_mps": 0.1 * wave, "dynamic_model": 7},
            "/battery": {"voltage_V": 15.0, "current_A": 8 + wave},
        }.items():  # fmt: skip
            lines.append(f"{topic} {40_000_000 * i} " + json.dumps({"status": "ok", **values}))
    return "\n".join(lines).encode()


def packed_messages(lines: bytes) -> bytes:
    """Return an uncompressed log of these messages, without lines that lack a topic or time, which no log can hold."""
    from mcap.writer import CompressionType, Writer

    stream = io.BytesIO()
    writer = Writer(stream, compression=CompressionType.NONE)
    writer.start("flightpower", "flightpower-log-1")
    channels: dict[bytes, int] = {}
    for i, line in enumerate(lines.split(b"\n")):
        topic, _, rest = line.partition(b" ")
        time_ns, _, message = rest.partition(b" ")
        if not time_ns.isdigit() or int(time_ns) >= 2**64:
            continue
        if topic not in channels:
            schema = writer.register_schema("message", "jsonschema", b"{}")
            channels[topic] = writer.register_channel(topic.decode("utf-8", "replace"), "json", schema)
        writer.add_message(channels[topic], int(time_ns), message, int(time_ns), i)
    writer.finish()
    return stream.getvalue()


def daemon_log() -> bytes:
    from msgspec.json import decode

    stream = io.BytesIO()
    writer = LogWriter(stream, chunk_bytes=4000)
    writer.attach("zero.json", b"{}", "application/json", 0)
    for i, line in enumerate(daemon_messages().splitlines()):
        topic, time_ns, message = line.decode().split(" ", 2)
        writer.write(topic, decode(message, type=TYPE_OF_TOPIC[topic]), time_ns=int(time_ns), tick=i // 8)
    writer.finish()
    return stream.getvalue()


def read_checked(path: Path) -> object:
    """Read and check a log of the daemon up to the point where it would be synchronized."""
    log = read_log(path)
    check_log(log, 0.3)
    return receiver_notes(log)


POLAR = (
    b"xflr5 v6.61\n\n Plane name : one\n QInf = 15.0 m/s\n\n   alpha  Beta  CL  CDi  CDv  CD  CY  Cl  Cm  Cn\n"
    + b"".join(
        b"%8.3f  0.000  %9.6f  %9.6f  %9.6f  %9.6f  0.0  0.0  0.0  0.0\n"
        % (a, 0.2 + 0.09 * a, 0.04 * a * a / 50, 0.02, 0.02 + 0.04 * a * a / 50)
        for a in range(-2, 9)
    )
)
AVL = b"".join(
    b" Vortex Lattice Output -- Total Forces\n  Alpha = %9.5f\n  CYtot = 0.0\n  CLtot = %9.5f\n  CDtot = %9.5f\n\n"
    % (a, 0.2 + 0.09 * a, 0.02 + 0.001 * a * a)
    for a in range(8)
)
WAYPOINTS = b"QGC WPL 110\n" + b"".join(
    b"%d\t%d\t3\t%d\t0\t0\t0\t0\t48.%03d\t11.5\t%d\t1\n" % (i, i == 0, 22 if i == 1 else 16, i, 50 + i)
    for i in range(8)
)
INAV = b'<?xml version="1.0"?>\n<mission><version value="2.3-pre8"/>' + b"".join(
    b'<missionitem no="%d" action="WAYPOINT" lat="48.00%d" lon="11.5" alt="50" parameter1="0" parameter2="0"'
    b' parameter3="0" flag="%d"/>' % (i, i, 165 * (i == 4))
    for i in range(1, 5)
) + b"</mission>"  # fmt: skip
KML = (
    b'<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><LineString><coordinates>'
    b"11.5,48.0,50 11.6,48.1,60 11.7,48.0,50</coordinates></LineString></Placemark></Document></kml>"
)


def plan() -> bytes:
    items = [{"type": "SimpleItem", "command": 22 if i == 1 else 16, "frame": 3, "doJumpId": i, "autoContinue": True,
              "params": [0, 0, 0, None, 48 + 1e-3 * i, 11.5, 50]} for i in range(1, 6)]  # fmt: skip
    mission = {"items": items, "plannedHomePosition": [48.0, 11.5, 500], "vehicleType": 1, "firmwareType": 12,
               "cruiseSpeed": 15, "hoverSpeed": 5, "version": 2}  # fmt: skip
    return json.dumps(
        {"fileType": "Plan", "version": 1, "groundStation": "QGroundControl", "mission": mission}
    ).encode()


def small_log(path: Path, flown_s: float, rate_Hz: float) -> None:
    """Write a log in the format of its suffix, with each kind of message that is read."""
    t_s = np.arange(0.0, flown_s, 1 / rate_Hz)
    time_us = np.round(1e6 * (10 + t_s)).astype(np.uint64)
    zero, unity, wave = 0 * t_s, 0 * t_s + 1, np.sin(0.3 * t_s)
    airspeed, course = 15 + 3 * wave, np.radians(10 * t_s % 360)
    static, current = 1e5 - 100 * np.sin(0.1 * t_s), 10 + 5 * wave
    if path.suffix == ".ulg":
        axes = {f"xyz[{i}]": x for i, x in enumerate((wave, zero, -9.8 * unity))}
        topics = {
            "airspeed_validated": {"indicated_airspeed_m_s": airspeed, "airspeed_source": unity},
            "differential_pressure": {"differential_pressure_pa": 0.6 * airspeed**2, "temperature": 20 * unity},
            "vehicle_air_data": {"baro_pressure_pa": static, "baro_temp_celcius": 40 * unity},
            "battery_status": {"voltage_v": 15 * unity, "current_a": current},
            "esc_status": {f"esc[0].esc_{name}": x for name, x in (("rpm", 6000 * unity), ("voltage", 15 * unity),
                                                                   ("current", current))},
            "vehicle_acceleration": axes,
            "vehicle_thrust_setpoint": {"xyz[0]": 0.5 + 0.4 * wave},
            "vehicle_gps_position": {"vel_n_m_s": airspeed * np.cos(course), "vel_e_m_s": airspeed * np.sin(course),
                                     "vel_d_m_s": zero, "fix_type": 3 * unity},
            "vehicle_status": {"vehicle_type": 2 * unity, "system_type": unity, "in_transition_mode": zero},
        }  # fmt: skip
        write_ulog(path, UlogContents([
            UlogTopic(name, time_us, {key: np.asarray(x, dtype=np.float32) for key, x in columns.items()})
            for name, columns in topics.items()
        ], {"sys_name": "PX4"}, parameters={"FW_AIRSPD_TRIM": 15.0}))  # fmt: skip
        return
    kinds = {
        "MSG": ("QZ", {"Message": np.full(2, b"ArduPlane V4.5.7")}),
        "PARM": ("QNf", {"Name": np.full(2, b"ARSPD_RATIO"), "Value": 2 * unity[:2]}),
        "ARSP": ("QBffcBBB", {"I": zero, "Airspeed": airspeed, "DiffPress": airspeed**2 / 2, "Temp": 20 * unity,
                              "U": unity, "H": unity, "Pri": zero}),
        "BARO": ("QBfcB", {"I": zero, "Press": static, "Temp": 40 * unity, "Health": unity}),
        "BAT": ("QBff", {"Inst": zero, "Volt": 15 * unity, "Curr": current}),
        "CTUN": ("Qf", {"ThO": 50 + 40 * wave}),
        "MODE": ("QMB", {"Mode": 10 * unity[:2], "ModeNum": 10 * unity[:2]}),
        "ESC": ("QBfff", {"Instance": zero, "RPM": 6000 * unity, "Volt": 15 * unity, "Curr": 0.9 * current}),
        "SIM2": ("Qf", {"As": airspeed}),
        "IMU": ("QBfff", {"I": zero, "AccX": wave, "AccY": zero, "AccZ": -9.8 * unity}),
        "GPS": ("QBBfff", {"I": zero, "Status": 3 * unity, "Spd": airspeed, "GCrs": np.degrees(course), "VZ": zero}),
    }  # fmt: skip
    logged = []
    for name, (codes, columns) in kinds.items():
        n = len(next(iter(columns.values())))
        logged.append(DataflashMessages(name, codes, {"TimeUS": time_us[:n], **columns}))
    {".log": write_text, ".tlog": write_telemetry}.get(path.suffix, write_dataflash)(path, logged)


def mission(path: Path) -> object:
    return load_mission(path, Assumed(home_deg=(48.0, 11.5)))


@dataclass(frozen=True)
class Target:
    """A reader and its inputs. share : fraction of all inputs"""

    name: str
    suffix: str
    run: Callable[[Path], object]
    share: float
    log: tuple[float, float] = (READ_S, 5.0)  # duration [s], rate [Hz]
    made: Callable[[], bytes] | None = None  # the input to alter, if it is not a log from `small_log`
    packed: Callable[[bytes], bytes] = bytes  # converts the altered input to the bytes that are written
    is_text: bool = False


TARGETS = (
    Target("dataflash", ".bin", read_ardupilot, 0.2),
    Target("ulog", ".ulg", read_px4, 0.16),
    Target("telemetry", ".tlog", read_ardupilot, 0.05),
    Target("dataflash-text", ".log", read_ardupilot, 0.05, is_text=True),
    Target("daemon", ".mcap", read_checked, 0.04, made=daemon_log),
    Target("daemon-messages", ".mcap", read_checked, 0.05, made=daemon_messages, packed=packed_messages, is_text=True),
    Target("matlab-log", ".mat", open_source, 0.03, made=matlab_log),
    Target("paparazzi", ".data", read_paparazzi, 0.04, made=paparazzi, is_text=True),
    Target("radio-table", ".csv", open_source, 0.04, made=small_table, is_text=True),
    Target("jeti-table", ".log", open_source, 0.02, made=jeti_table, is_text=True),
    Target("european-table", ".csv", draft, 0.04, made=european_table, is_text=True),
    Target("matlab-table", ".mat", draft, 0.03, made=matlab_structure),
    Target("waypoints", ".waypoints", mission, 0.06, made=lambda: WAYPOINTS, is_text=True),
    Target("plan", ".plan", mission, 0.06, made=plan, is_text=True),
    Target("inav-mission", ".mission", mission, 0.03, made=lambda: INAV, is_text=True),
    Target("map-line", ".kml", mission, 0.03, made=lambda: KML, is_text=True),
    Target("propeller", ".csv", load_propeller, 0.036, made=(FOLDER / "apc-12x8e.csv").read_bytes, is_text=True),
    Target("polar", ".txt", read_predicted_polar, 0.015, made=lambda: POLAR, is_text=True),
    Target("avl-polar", ".txt", read_predicted_polar, 0.015, made=lambda: AVL, is_text=True),
    Target("electrical", ".bin", electrical, 0.002, (FLOWN_S, 1.0)),
    Target("electrical-ulog", ".ulg", electrical, 0.002, (FLOWN_S, 1.0)),
)


def altered(data: bytes, number: int, is_text: bool = False) -> bytes:
    """Return the altered input with this number; in every second text, numbers, words and lines are altered."""
    if is_text and number % 2:
        return altered_text(data, number)
    draw, out = random.Random(number), bytearray(data)
    for _ in range(draw.choice((1, 1, 2, 4, 8))):
        offset, length = draw.randrange(len(out) + 1), draw.choice((1, 2, 8, 64, 512))
        match draw.randrange(8):
            case 0:
                out[offset : offset + 1] = draw.randbytes(1)
            case 1 if offset < len(out):
                out[offset] ^= 1 << draw.randrange(8)
            case 2 | 3:
                limit = draw.choice(LIMITS)
                out[offset : offset + len(limit)] = limit
            case 4:
                del out[offset : offset + length]
            case 5:
                out[offset:offset] = out[offset : offset + length]
            case 6:
                target = draw.randrange(len(out) + 1)
                out[target : target + length] = out[offset : offset + length]
            case 7 if draw.random() < 0.2:
                del out[offset:]
            case _:
                out[offset:offset] = draw.randbytes(length)
    return bytes(out)


def altered_text(data: bytes, number: int) -> bytes:
    """Return a text with numbers, words and lines replaced."""
    draw, lines = random.Random(number), data.splitlines(keepends=True)
    for _ in range(draw.choice((1, 1, 2, 4, 8))):
        line_number, other = draw.randrange(len(lines)), draw.randrange(len(lines))
        match draw.randrange(10):
            case 0 if len(lines) > 1:
                del lines[line_number]
            case 1:
                lines.insert(other, lines[line_number])
            case 2:
                lines[line_number], lines[other] = lines[other], lines[line_number]
            case 3:
                lines[line_number] = draw.choice(
                    (
                        b"\n",
                        b"# " + lines[line_number],
                        lines[line_number].rstrip() + b",;\t1\n",
                        lines[line_number].strip(),
                    )
                )
            case _:
                parts = list(PART_OF_TEXT.finditer(lines[line_number]))
                if not parts:
                    continue
                part = draw.choice(parts)
                new = draw.choice((*OTHER_PARTS, draw.choice(parts)[0]))
                in_every_line = draw.random() < 0.1  # the change is made in every line
                rows = range(len(lines)) if in_every_line else (line_number,)
                for row in rows:
                    lines[row] = lines[row].replace(part[0], new) if in_every_line else (
                        lines[row][: part.start()] + new + lines[row][part.end() :])  # fmt: skip
    return b"".join(lines)


class Hang(BaseException):
    """Raised when one input takes too long. It is not an Exception, so readers that catch errors do not catch it."""


@dataclass
class Tally:
    """Numbers of inputs and refusals, inputs with a defect, total seconds, and seconds for the slowest input."""

    inputs: int = 0
    refused: int = 0
    defects: int = 0
    seconds: float = 0.0
    slowest_s: float = 0.0
    last: str = ""

    def add(self, other: "Tally") -> None:
        self.inputs, self.refused = self.inputs + other.inputs, self.refused + other.refused
        self.defects, self.seconds = self.defects + other.defects, self.seconds + other.seconds
        self.slowest_s, self.last = max(self.slowest_s, other.slowest_s), other.last or self.last


def tried(job: tuple[int, bytes, int, int, float]) -> Tally:
    """Run a range of one target's inputs until a deadline."""
    index, data, first, stop, until = job
    target, tally = TARGETS[index], Tally()

    def too_long(_: int, __: FrameType | None) -> None:
        raise Hang(f"longer than {SLOWEST_S:g} s")

    signal.signal(signal.SIGPROF, too_long)  # limits processor time, because another process may have the processor
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    with tempfile.TemporaryDirectory(dir=IN_MEMORY) as folder:
        path = Path(folder) / f"log{target.suffix}"
        for number in range(first, stop):
            if time.time() > until:
                break
            content = target.packed(altered(data, number, target.is_text))
            path.write_bytes(content)
            began = time.process_time()
            signal.setitimer(signal.ITIMER_PROF, SLOWEST_S)
            try:
                with warnings.catch_warnings(record=True) as warned:
                    warnings.simplefilter("always")
                    warnings.simplefilter("ignore", ResourceWarning)  # comes from a slot that Python does not expose
                    target.run(path)
                if warned:
                    raise RuntimeError(
                        f"warned: {warned[0].category.__name__}: {warned[0].message} ({warned[0].filename})"
                    )
            except InputError:
                tally.refused += 1
            except (Exception, Hang):
                tally.defects += 1
                tally.last = f"{target.name} {number}\n{traceback.format_exc(limit=-4)}"
                examples = KEPT / target.name
                examples.mkdir(parents=True, exist_ok=True)
                (examples / f"altered-{number}{target.suffix}").write_bytes(content)
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0)
            took_s = time.process_time() - began
            tally.inputs, tally.seconds = tally.inputs + 1, tally.seconds + took_s
            tally.slowest_s = max(tally.slowest_s, took_s)
    return tally


def original(target: Target) -> bytes:
    """Return the unaltered input; raises InputError if even that is refused."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"log{target.suffix}"
        if target.made is None:
            small_log(path, *target.log)
            data = path.read_bytes()
        else:
            data = target.made()
            path.write_bytes(target.packed(data))
        target.run(path)
        return data


def main(
    inputs: Annotated[int, typer.Option(help="In all, shared out among the targets.")] = 1_000_000,
    minutes: Annotated[float, typer.Option(help="Ends after this time, whatever is left.")] = 30.0,
    seed: Annotated[int, typer.Option(help="The number of the first input.")] = 0,
    processes: Annotated[int, typer.Option(help="At once.")] = 2,
) -> None:
    until, done = time.time() + 60 * minutes, Tally()
    jobs = []
    for index, target in enumerate(TARGETS):
        data, count = original(target), round(inputs * target.share)
        for first in range(seed, seed + count, BATCH):
            jobs.append(((first - seed) / count, (index, data, first, min(first + BATCH, seed + count), until)))
    jobs.sort(key=lambda job: job[0])  # all targets advance equally: the time limit does not cut off one of them
    tallies = [Tally() for _ in TARGETS]
    with ProcessPoolExecutor(processes) as pool:
        for (_, job), tally in zip(jobs, pool.map(tried, [job for _, job in jobs]), strict=True):
            tallies[job[0]].add(tally)
    print(f"{'target':20} {'inputs':>8} {'refused':>8} {'defects':>8} {'mean, ms':>9} {'slowest, s':>11}")
    for target, tally in zip(TARGETS, tallies, strict=True):
        mean_ms = 1e3 * tally.seconds / max(tally.inputs, 1)
        print(f"{target.name:20} {tally.inputs:8} {tally.refused:8} {tally.defects:8} {mean_ms:9.2f} "
              f"{tally.slowest_s:11.2f}")  # fmt: skip
        done.add(tally)
        if tally.last:
            print(tally.last)
    print(f"{done.inputs} altered logs, {done.defects} with a defect; slowest {done.slowest_s:.2f} s")
    raise typer.Exit(bool(done.defects))


if __name__ == "__main__":
    typer.run(main)
