"""The configuration of the tray: a TOML file, validated into frozen structs. Errors name file and key.

More than 350 lines: one struct for each part that the file may name, and their common checks.
"""

import re
import socket
from functools import reduce
from importlib import metadata
from operator import or_
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, cast, get_args, get_type_hints

import msgspec
from msgspec import Meta

from flightpower.daq.bus import Buses
from flightpower.daq.sensors import Sensor, honeywell, ms45xxdo
from flightpower.daq.sensors.ads1115 import FULL_SCALE_V
from flightpower.daq.sensors.axes import Axes, parse_axes
from flightpower.daq.sensors.bridge import TransferFunction
from flightpower.flight.errors import InputError
from flightpower.flight.files import read_text
from flightpower.flight.messages import DOUBLED, SECOND, TYPE_OF_TOPIC

Address = Annotated[int, Meta(ge=0x03, le=0x77)]
ZERO_FILE = "zero.json"
# The rates for which termios(3) has names: any other rate is a typing mistake.
Baud = Literal[
    1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000, 921600, 1000000, 1500000, 2000000
]  # fmt: skip
LARGEST_PORT = 65535
FullDiskPolicy = Literal["stop", "delete_oldest"]


def parse_port(port: str) -> tuple[str, int]:
    """Return host and port number of udp:HOST:PORT."""
    _, host, number = port.split(":")
    return host, int(number)


def _check_udp(port: str) -> None:
    if port.startswith("udp:") and not re.fullmatch(r"udp:[\w.-]+:\d{1,5}", port):
        raise ValueError(f"{port!r} is not of the form udp:HOST:PORT, such as udp:127.0.0.1:14550")
    if port.startswith("udp:") and not 0 < parse_port(port)[1] <= LARGEST_PORT:
        raise ValueError(f"{port!r}: a port is a number from 1 to {LARGEST_PORT}")


class SensorTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="driver"):
    """Base of all sensor tables. topics: the topics that the sensor writes.

    Drivers of other packages derive their tables from `BusSensorTable` or `PortSensorTable`, with the driver's name as
    tag, and define `make_driver`.
    """

    @property
    def topics(self) -> tuple[str, ...]:
        raise NotImplementedError

    @property
    def name(self) -> str:
        """Name of the sensor in events and tables: its first topic."""
        return self.topics[0].strip("/").replace("/", "-")

    @property
    def device(self) -> str:
        """The bus or port that the sensor is connected to."""
        raise NotImplementedError

    @property
    def driver(self) -> str:
        """Name of the driver in the tray file."""
        return str(self.__struct_config__.tag)

    def make_driver(self, buses: Buses, period_s: float) -> Sensor:
        """Make a driver on the opened bus or port; drivers of other packages define this. period_s: tick period.

        Raises OSError if bus or port cannot be opened.
        """
        raise NotImplementedError

    def identify(self, buses: Buses) -> str:
        """Name the part that answers, for `daq check`. Drivers of other packages define this. Raises OSError."""
        return self.driver

    blocking: ClassVar[bool] = False  # whether a read waits for the sensor's answer


def topic_of(topic: str, *, second: bool) -> str:
    """The topic that a sensor writes, which depends on whether it is the first or the second of its kind."""
    return topic + SECOND if second else topic


class BusSensorTable(SensorTable, frozen=True):
    """A sensor on an I2C bus; a subclass adds the field `address`."""

    bus: str
    blocking: ClassVar[bool] = True

    @property
    def device(self) -> str:
        return self.bus


class PortSensorTable(SensorTable, frozen=True):
    """A sensor on a serial line or UDP port."""

    port: str  # a serial device, or udp:HOST:PORT
    baud: Baud

    def __post_init__(self) -> None:
        _check_udp(self.port)

    @property
    def device(self) -> str:
        return self.port


LOWEST_FIFO_RATE_HZ = 6.0  # the MPU-9250's FIFO is full after 36 samples of 14 bytes, at 200 Hz


class Mpu9250Config(BusSensorTable, frozen=True, tag="mpu9250"):
    address: Address = 0x68
    range_g: Literal[2, 4, 8, 16] = 8
    range_dps: Literal[250, 500, 1000, 2000] = 500
    sampling: Literal["fifo", "single"] = "fifo"
    axes: tuple[str, str, str] = ("x", "y", "z")
    second: bool = False

    def __post_init__(self) -> None:
        parse_axes(self.axes)

    @property
    def topics(self) -> tuple[str, ...]:
        return (topic_of("/imu", second=self.second),)

    @property
    def parsed_axes(self) -> Axes:
        return parse_axes(self.axes)


class Ak8963Config(BusSensorTable, frozen=True, tag="ak8963"):
    axes: tuple[str, str, str] = ("x", "y", "z")  # axes of the MPU9250 that contains it
    address: ClassVar[int] = 0x0C
    topics: ClassVar[tuple[str, ...]] = ("/mag",)

    def __post_init__(self) -> None:
        parse_axes(self.axes)

    @property
    def parsed_axes(self) -> Axes:
        return parse_axes(self.axes)


class _BarometerConfig(BusSensorTable, frozen=True):
    address: Literal[0x76, 0x77]
    measures: Literal["baro", "static"]
    second: bool = False

    @property
    def topics(self) -> tuple[str, ...]:
        return (topic_of(f"/{self.measures}", second=self.second),)


class Ms5611Config(_BarometerConfig, frozen=True, tag="ms5611"):
    address: Literal[0x76, 0x77] = 0x77
    measures: Literal["baro", "static"] = "baro"


class Ms5607Config(_BarometerConfig, frozen=True, tag="ms5607"):
    address: Literal[0x76, 0x77] = 0x77
    measures: Literal["baro", "static"] = "baro"


class Ms5805Config(_BarometerConfig, frozen=True, tag="ms5805"):
    address: Literal[0x76] = 0x76
    measures: Literal["baro", "static"] = "static"


class _TransducerConfig(BusSensorTable, frozen=True):
    part: str
    measures: Literal["alpha", "beta", "airspeed"]
    reversed_ports: bool = False
    second: bool = False

    def __post_init__(self) -> None:
        self._decoded()
        if self.second and f"/probe/{self.measures}" not in DOUBLED:
            raise ValueError(f"second = true: a tray has one transducer for {self.measures}")

    def _decoded(self) -> tuple[int, TransferFunction]:
        raise NotImplementedError

    @property
    def address(self) -> int:
        return self._decoded()[0]

    @property
    def transfer(self) -> TransferFunction:
        return self._decoded()[1]

    @property
    def topics(self) -> tuple[str, ...]:
        return (topic_of(f"/probe/{self.measures}", second=self.second),)


class Ms45xxDoConfig(_TransducerConfig, frozen=True, tag="ms45xxdo"):
    def _decoded(self) -> tuple[int, TransferFunction]:
        return ms45xxdo.decode_part(self.part)


class HoneywellConfig(_TransducerConfig, frozen=True, tag="honeywell"):
    def _decoded(self) -> tuple[int, TransferFunction]:
        return honeywell.decode_part(self.part)


SOLUTION_BITS = 1000  # NAV-PVT is 100 bytes, of ten bits each on a serial line
LINE_SHARE = 0.8  # usable share of a line's time; the rest is for answers, and for solutions that are a little late
BAUDS = (9600, 19200, 38400, 57600, 115200)


class UBloxConfig(PortSensorTable, frozen=True, tag="ublox"):
    baud: Baud = 38400
    rate_Hz: Annotated[float, Meta(ge=1, le=10)] = 10.0
    second: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        needed = self.rate_Hz * SOLUTION_BITS / LINE_SHARE
        if self.baud < needed and not self.port.startswith("udp:"):
            enough = next(baud for baud in BAUDS if baud >= needed)
            raise ValueError(
                f"baud = {self.baud} carries {int(self.baud * LINE_SHARE / SOLUTION_BITS)} solutions a second, and"
                f" rate_Hz is {self.rate_Hz:g}: set baud = {enough}, or a lower rate_Hz"
            )

    @property
    def topics(self) -> tuple[str, ...]:
        return (topic_of("/gps", second=self.second),)


class UBloxDdcConfig(BusSensorTable, frozen=True, tag="ublox_ddc"):
    address: Address = 0x42
    rate_Hz: Annotated[float, Meta(ge=1, le=10)] = 5.0
    second: bool = False

    @property
    def topics(self) -> tuple[str, ...]:
        return (topic_of("/gps", second=self.second),)


class EscCounterConfig(PortSensorTable, frozen=True, tag="esc_counter"):
    baud: Baud = 115200
    framed: bool = False
    pole_pairs: Annotated[int, Meta(ge=1, le=50)] | None = None
    topics: ClassVar[tuple[str, ...]] = ("/rpm",)


class AutopilotConfig(PortSensorTable, frozen=True, tag="autopilot"):
    baud: Baud = 57600
    rpm: bool = False  # whether to take motor speed from its messages RPM or RAW_RPM
    battery: bool = True  # whether to take the battery's values from it; false if a power monitor measures them

    @property
    def topics(self) -> tuple[str, ...]:
        return ("/controls", "/attitude", *["/battery"] * self.battery, *["/rpm"] * self.rpm)

    @property
    def name(self) -> str:
        return "autopilot"


class _PowerMonitorConfig(BusSensorTable, frozen=True):
    shunt_ohm: Annotated[float, Meta(gt=0, le=1)]  # 0.0005 for 0.5 milliohm
    address: Annotated[int, Meta(ge=0x40, le=0x4F)] = 0x40
    topics: ClassVar[tuple[str, ...]] = ("/battery",)


class Ina226Config(_PowerMonitorConfig, frozen=True, tag="ina226"):
    """The INA226, which measures up to 36 V, and up to 82 mV at the shunt."""


class Ina228Config(_PowerMonitorConfig, frozen=True, tag="ina228"):
    """The INA228, which measures up to 85 V, and up to 164 mV at the shunt."""


class Ads1115Config(BusSensorTable, frozen=True, tag="ads1115"):
    address: Annotated[int, Meta(ge=0x48, le=0x4B)] = 0x48
    inputs: Annotated[tuple[Annotated[int, Meta(ge=0, le=3)], ...], Meta(min_length=1, max_length=4)] = (0, 1, 2, 3)
    full_scale_V: float = 4.096
    topics: ClassVar[tuple[str, ...]] = ("/analog",)

    def __post_init__(self) -> None:
        if self.full_scale_V not in FULL_SCALE_V:
            raise ValueError(f"full_scale_V is one of {', '.join(map(str, FULL_SCALE_V))}")
        if len(set(self.inputs)) < len(self.inputs):
            raise ValueError("inputs: each at most once")


class Navio2Config(SensorTable, frozen=True, tag="navio2"):
    port: str = "rcio:/sys/kernel/rcio/rcin"
    topics: ClassVar[tuple[str, ...]] = ("/controls",)

    @property
    def device(self) -> str:
        return self.port


BarometerConfig = Ms5611Config | Ms5607Config | Ms5805Config
_PressureConfig = BarometerConfig | Ms45xxDoConfig | HoneywellConfig
SensorConfig = (
    Mpu9250Config
    | Ak8963Config
    | _PressureConfig
    | UBloxConfig
    | UBloxDdcConfig
    | EscCounterConfig
    | AutopilotConfig
    | Navio2Config
    | Ina226Config
    | Ina228Config
    | Ads1115Config
)


DRIVERS = tuple(str(table.__struct_config__.tag) for table in get_args(SensorConfig))
DRIVER_GROUP = "flightpower.drivers"  # group of other packages' entry points: name of the driver, and its table


def installed_drivers() -> dict[str, str]:
    """The drivers that a tray file may name, each with the package that provides it (empty for this package)."""
    others = {point.name: _package(point) for point in metadata.entry_points(group=DRIVER_GROUP)}
    return others | dict.fromkeys(DRIVERS, "")


def load_driver(point: metadata.EntryPoint) -> type[SensorTable]:
    """The sensor table of an entry point. Raises InputError if it cannot be loaded or is not a sensor table."""
    failed = f"driver {point.name} of {_package(point)}"
    try:
        table = point.load()
    except Exception as error:  # code of another package may raise anything
        raise InputError(f"{failed} cannot be loaded ({type(error).__name__}: {error})") from None
    if not (isinstance(table, type) and issubclass(table, SensorTable)):
        raise InputError(
            f"{failed}: {point.value} is no sensor table (flightpower.daq.config.BusSensorTable or PortSensorTable)"
        )
    if table.__struct_config__.tag != point.name:
        raise InputError(f"{failed}: {point.value} has the tag {table.__struct_config__.tag!r}, not its name")
    return table


def _package(point: metadata.EntryPoint) -> str:
    return f"{point.dist.name} {point.dist.version}" if point.dist else "an unknown package"


class FilesConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Settings for when to start a new log, and what to do when the card is nearly full."""

    new_after_min: Annotated[float, Meta(gt=0)] = 60.0
    new_after_MB: Annotated[float, Meta(ge=1)] = 256.0
    keep_free_MB: Annotated[float, Meta(ge=0)] = 100.0
    when_full: FullDiskPolicy = "stop"


class ArmSwitchConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A switch on the transmitter, read as a pulse width on /controls.

    seen_at: whether the channel is one of the receiver's (RC_CHANNELS, or a Navio2's inputs) or a servo output of the
    autopilot.
    """

    channel: Annotated[int, Meta(ge=1, le=18)]
    seen_at: Literal["receiver", "servos"] = "receiver"
    above_us: Annotated[float, Meta(ge=800, le=2200)] = 1600.0
    action: Literal["mark", "record"] = "mark"


class TelemetryConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """MAVLink to a ground station."""

    to: str  # udp:HOST:PORT, or a serial device
    baud: Baud = 57600
    rate_Hz: Annotated[float, Meta(ge=1, le=10)] = 4.0
    vehicle: bool | None = None  # whether to appear as the aircraft itself; default: only if the tray has no autopilot
    system_id: Annotated[int, Meta(ge=1, le=255)] | None = None  # default: the autopilot's, or 25 without an autopilot

    def __post_init__(self) -> None:
        _check_udp(self.to)


class LightConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A lamp, and an optional button, on lines of a GPIO chip."""

    led: Annotated[int, Meta(ge=0, le=255)]  # number of the line; on a Pi the number of the GPIO
    button: Annotated[int, Meta(ge=0, le=255)] | None = None  # line of a button that connects it to ground
    chip: Annotated[str, Meta(pattern="^/dev/")] = "/dev/gpiochip0"


class InstallationConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Name of the installation of probe, tubes and tray, if the aircraft file does not give it."""

    name: str


class TrayFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The contents of a tray file."""

    rate_Hz: Annotated[float, Meta(ge=1, le=200)] = 25.0
    directory: str = "logs"
    aircraft: str | None = None
    card: str | None = None
    probe_calibration: str | None = None
    magnetometer_calibration: str | None = None
    transducer_calibration: str | None = None
    installation: InstallationConfig | None = None
    files: FilesConfig = FilesConfig()
    arm: ArmSwitchConfig | None = None
    telemetry: TelemetryConfig | None = None
    light: LightConfig | None = None
    sensors: Annotated[tuple[SensorConfig, ...], Meta(min_length=1)]


class Tray(TrayFile, frozen=True, kw_only=True):
    """The configuration of a recording. Relative paths have been resolved against the tray file's folder."""

    text: str  # text of the tray file, to be attached to the log
    zero: str  # path of the still-air zero, next to the tray file


def load_tray(path: str | Path) -> Tray:
    """Read a tray file.

    Raises InputError naming file and key when the file cannot be read, is malformed, has an unknown key, or has two
    sensors at one address or on one topic.
    """
    path = Path(path)
    return parse_tray(read_text(path), str(path), path.parent)


def check_places(tray: Tray, where: str) -> None:
    """Raises InputError if the logs' path cannot be a folder, or a host has no address here. where: the tray file."""
    folder = Path(tray.directory)
    for part in (folder, *folder.parents):
        if part.exists():
            if not part.is_dir():
                raise InputError(f"{where}: directory: {part} is a file")
            break
    places = [sensor.device for sensor in tray.sensors] + ([tray.telemetry.to] if tray.telemetry else [])
    for host in (parse_port(place)[0] for place in places if place.startswith("udp:")):
        try:
            socket.getaddrinfo(host, None, socket.AF_INET)
        except OSError as error:
            raise InputError(
                f"{where}: {host} has no address here ({error.strerror}): correct it, or give the address in numbers"
            ) from None


def parse_tray(text: str, where: str, folder: Path) -> Tray:
    """Parse a tray file's text. where: its name in errors. folder: base of relative paths."""
    try:
        document = msgspec.toml.decode(text)
        file = msgspec.convert(document, _tray_type(document), str_keys=True)
    except msgspec.ValidationError as error:
        raise InputError(f"{where}: {_with_key(error, document)}") from None
    except msgspec.DecodeError as error:
        raise InputError(f"{where}: not valid TOML ({error})") from None
    _reject_conflicts(file, where)
    resolved = {
        "directory": str(folder / file.directory),
        "aircraft": _resolve_name(file.aircraft, folder),
        "card": _resolve(file.card, folder),
        "probe_calibration": _resolve(file.probe_calibration, folder),
        "magnetometer_calibration": _resolve(file.magnetometer_calibration, folder),
        "transducer_calibration": _resolve(file.transducer_calibration, folder),
    }
    return Tray(**(msgspec.structs.asdict(file) | resolved), text=text, zero=str(folder / ZERO_FILE))


def _tray_type(document: Any) -> type[TrayFile]:
    """`TrayFile`, extended by the tables of those drivers of other packages that the document names."""
    sensors = document.get("sensors") if isinstance(document, dict) else None
    tables = sensors if isinstance(sensors, list) else []
    names = {name for table in tables if isinstance(table, dict) and isinstance(name := table.get("driver"), str)}
    if names <= set(DRIVERS):
        return TrayFile
    points = {point.name: point for point in metadata.entry_points(group=DRIVER_GROUP)}
    others = [load_driver(points[name]) for name in sorted(names & points.keys() - set(DRIVERS))]
    union: Any = reduce(or_, others, SensorConfig)
    field = ("sensors", Annotated[tuple[union, ...], Meta(min_length=1)])
    extended: Any = msgspec.defstruct(
        "TrayFile", [field], bases=(TrayFile,), frozen=True, forbid_unknown_fields=True, kw_only=True
    )
    return cast(type[TrayFile], extended)


def _with_key(error: msgspec.ValidationError, document: Any) -> str:
    """Turn msgspec's "what - at `$.sensors[2].range_g`" into "sensors[2].range_g: what"."""
    what, _, key = str(error).partition(" - at `$.")
    if number := re.fullmatch(r"Invalid enum value (\d+)", what):
        form = hex if key.endswith(".address`") else str
        values = " or ".join(map(form, _permitted(key.rstrip("`"), document)))
        what = f"{form(int(number[1]))} must be {values or 'one of the permitted values'}"
    if key.endswith(".driver`"):
        what += f"; the drivers are {', '.join(installed_drivers())}"
    if unknown := re.fullmatch(r"Object contains unknown field `(.*)`", what):
        what = f"unknown key {unknown[1]!r}; `daq config --example` shows every key"
    return f"{key.rstrip('`')}: {what}" if key else what


def _permitted(key: str, document: Any) -> tuple[int, ...]:
    """The numbers allowed for a key such as sensors[2].range_g or telemetry.baud; empty if they are not listed."""
    table, _, name = key.rpartition(".")
    kind: Any = TelemetryConfig
    if number := re.fullmatch(r"sensors\[(\d+)\]", table):
        driver = document["sensors"][int(number[1])]["driver"]
        tables = [*get_args(SensorConfig), *map(load_driver, metadata.entry_points(group=DRIVER_GROUP, name=driver))]
        kind = next(each for each in tables if each.__struct_config__.tag == driver)
    return get_args(get_type_hints(kind).get(name))


def _resolve(path: str | None, folder: Path) -> str | None:
    return str(folder / path) if path else None


def _resolve_name(aircraft: str | None, folder: Path) -> str | None:
    """Resolve a path, which has a suffix, against the folder; leave the name of a shipped aircraft as it is."""
    return str(folder / aircraft) if aircraft and Path(aircraft).suffix else aircraft


def _reject_conflicts(tray: TrayFile, where: str) -> None:
    labels: dict[tuple[str, int], str] = {}
    topics: dict[str, str] = {}
    for i, sensor in enumerate(tray.sensors):
        label = f"sensors[{i}] ({sensor.driver})"
        place = (sensor.device, getattr(sensor, "address", 0) if isinstance(sensor, BusSensorTable) else 0)
        if place in labels:
            place_text = (
                f"address 0x{place[1]:02x} of {sensor.device}"
                if isinstance(sensor, BusSensorTable)
                else f"port {sensor.device}"
            )
            raise InputError(f"{where}: {labels[place]} and {label} are both on {place_text}; change one of them")
        labels[place] = label
        if isinstance(sensor, BusSensorTable) and sensor.bus.startswith(("udp:", "rcio:")):
            raise InputError(f"{where}: {label}: {sensor.bus} is no I2C bus, such as /dev/i2c-1")
        if isinstance(sensor, Mpu9250Config) and sensor.sampling == "fifo" and tray.rate_Hz < LOWEST_FIFO_RATE_HZ:
            raise InputError(
                f'{where}: {label}: sampling = "fifo" overflows at rate_Hz = {tray.rate_Hz:g}; '
                f'use "single", or {LOWEST_FIFO_RATE_HZ:g} Hz or more'
            )
        for topic in sensor.topics:
            if topic not in TYPE_OF_TOPIC:
                raise InputError(f"{where}: {label} would write {topic}, which is no topic of a log")
            if topic in topics:
                remedy = "; a second sensor needs second = true" if topic in DOUBLED else ""
                raise InputError(f"{where}: {topics[topic]} and {label} would both write {topic}{remedy}")
            topics[topic] = label
    mounted = {
        sensor.parsed_axes
        for sensor in tray.sensors
        if isinstance(sensor, Ak8963Config) or (isinstance(sensor, Mpu9250Config) and not sensor.second)
    }
    if len(mounted) > 1:
        raise InputError(f"{where}: ak8963 is inside mpu9250, so give both the same axes")
    if tray.arm is not None and "/controls" not in topics:
        raise InputError(f"{where}: arm: no sensor writes /controls, which the switch is read from")
    if tray.light is not None and tray.light.led == tray.light.button:
        raise InputError(f"{where}: light: led and button are both line {tray.light.led}; change one of them")
    if tray.card is not None and (tray.telemetry is None or tray.aircraft is None):
        raise InputError(f"{where}: card: needs aircraft and [telemetry], whose process judges the runs")
    if tray.telemetry is not None and tray.telemetry.to in {sensor.device for sensor in tray.sensors}:
        raise InputError(f"{where}: telemetry.to: {tray.telemetry.to} is already used by a sensor")
