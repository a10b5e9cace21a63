"""The tray's configuration: TOML to frozen structs, refused with file and key when something is wrong."""

import re
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import msgspec
from msgspec import Meta

from daq.keeper import Policy
from daq.sensors import honeywell, ms45xxdo
from daq.sensors.axes import Axes, parse_axes
from daq.sensors.bridge import Transfer
from flight.errors import InputError

Address = Annotated[int, Meta(ge=0x03, le=0x77)]
ZERO = "zero.json"
Baud = Annotated[int, Meta(ge=1200)]


def _check_udp(port: str) -> None:
    if port.startswith("udp:") and not re.fullmatch(r"udp:[\w.-]+:\d{1,5}", port):
        raise ValueError(f"{port!r} is not of the form udp:HOST:PORT, such as udp:127.0.0.1:14550")


def parse_port(port: str) -> tuple[str, int]:
    """Host and number of udp:HOST:PORT."""
    _, host, number = port.split(":")
    return host, int(number)


class _Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="driver"):
    """Base of all sensor tables; `topics` is what the sensor writes."""

    @property
    def topics(self) -> tuple[str, ...]:
        raise NotImplementedError

    @property
    def name(self) -> str:
        """How events and tables call the sensor: its first topic."""
        return self.topics[0].strip("/").replace("/", "-")

    @property
    def lane(self) -> str:
        """The bus or port it hangs on."""
        raise NotImplementedError

    may_hang: ClassVar[bool] = False  # whether reading it waits for the part


class _OnBus(_Table, frozen=True):
    bus: str
    may_hang: ClassVar[bool] = True

    @property
    def lane(self) -> str:
        return self.bus


class _OnPort(_Table, frozen=True):
    port: str  # a serial device, or udp:HOST:PORT
    baud: Baud

    def __post_init__(self) -> None:
        _check_udp(self.port)

    @property
    def lane(self) -> str:
        return self.port


class Mpu9250(_OnBus, frozen=True, tag="mpu9250"):
    address: Address = 0x68
    range_g: Literal[2, 4, 8, 16] = 8
    range_dps: Literal[250, 500, 1000, 2000] = 500
    sampling: Literal["fifo", "single"] = "fifo"
    axes: tuple[str, str, str] = ("x", "y", "z")
    topics: ClassVar[tuple[str, ...]] = ("/imu",)

    def __post_init__(self) -> None:
        parse_axes(self.axes)

    @property
    def parsed_axes(self) -> Axes:
        return parse_axes(self.axes)


class Ak8963(_OnBus, frozen=True, tag="ak8963"):
    axes: tuple[str, str, str] = ("x", "y", "z")  # of the MPU9250 around it
    address: ClassVar[int] = 0x0C
    topics: ClassVar[tuple[str, ...]] = ("/mag",)

    def __post_init__(self) -> None:
        parse_axes(self.axes)

    @property
    def parsed_axes(self) -> Axes:
        return parse_axes(self.axes)


class _Barometer(_OnBus, frozen=True):
    address: Literal[0x76, 0x77]
    measures: Literal["baro", "static"]

    @property
    def topics(self) -> tuple[str, ...]:
        return (f"/{self.measures}",)


class Ms5611(_Barometer, frozen=True, tag="ms5611"):
    address: Literal[0x76, 0x77] = 0x77
    measures: Literal["baro", "static"] = "baro"


class Ms5805(_Barometer, frozen=True, tag="ms5805"):
    address: Literal[0x76] = 0x76
    measures: Literal["baro", "static"] = "static"


class _Transducer(_OnBus, frozen=True):
    part: str
    measures: Literal["alpha", "beta", "airspeed"]
    reversed_ports: bool = False

    def __post_init__(self) -> None:
        self._decoded()

    def _decoded(self) -> tuple[int, Transfer]:
        raise NotImplementedError

    @property
    def address(self) -> int:
        return self._decoded()[0]

    @property
    def transfer(self) -> Transfer:
        return self._decoded()[1]

    @property
    def topics(self) -> tuple[str, ...]:
        return (f"/probe/{self.measures}",)


class Ms45xxDo(_Transducer, frozen=True, tag="ms45xxdo"):
    def _decoded(self) -> tuple[int, Transfer]:
        return ms45xxdo.decode_part(self.part)


class Honeywell(_Transducer, frozen=True, tag="honeywell"):
    def _decoded(self) -> tuple[int, Transfer]:
        return honeywell.decode_part(self.part)


class UBlox(_OnPort, frozen=True, tag="ublox"):
    baud: Baud = 38400
    rate_Hz: Annotated[float, Meta(ge=1, le=10)] = 10.0
    topics: ClassVar[tuple[str, ...]] = ("/gps",)


class UBloxDdc(_OnBus, frozen=True, tag="ublox_ddc"):
    address: Address = 0x42
    rate_Hz: Annotated[float, Meta(ge=1, le=10)] = 5.0
    topics: ClassVar[tuple[str, ...]] = ("/gps",)


class EscCounter(_OnPort, frozen=True, tag="esc_counter"):
    baud: Baud = 115200
    framed: bool = False
    pole_pairs: Annotated[int, Meta(ge=1, le=50)] | None = None
    topics: ClassVar[tuple[str, ...]] = ("/rpm",)


class Autopilot(_OnPort, frozen=True, tag="autopilot"):
    baud: Baud = 57600
    rpm: bool = False  # take motor speed from its RPM or RAW_RPM

    @property
    def topics(self) -> tuple[str, ...]:
        return ("/controls", "/attitude", "/battery", "/rpm") if self.rpm else ("/controls", "/attitude", "/battery")

    @property
    def name(self) -> str:
        return "autopilot"


class Navio2(_Table, frozen=True, tag="navio2"):
    port: str = "rcio:/sys/kernel/rcio/rcin"
    topics: ClassVar[tuple[str, ...]] = ("/controls",)

    @property
    def lane(self) -> str:
        return self.port


_Pressure = Ms5611 | Ms5805 | Ms45xxDo | Honeywell
SensorTable = Mpu9250 | Ak8963 | _Pressure | UBlox | UBloxDdc | EscCounter | Autopilot | Navio2


class Files(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How long a log may get, and what happens when the card is nearly full."""

    new_after_min: Annotated[float, Meta(gt=0)] = 60.0
    new_after_MB: Annotated[float, Meta(ge=1)] = 256.0
    keep_free_MB: Annotated[float, Meta(ge=0)] = 100.0
    when_full: Policy = "stop"


class Arm(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A switch on the transmitter, seen as a pulse width on /controls.

    seen_at: the receiver's channels (RC_CHANNELS, or a Navio2's inputs), or the autopilot's servo outputs.
    """

    channel: Annotated[int, Meta(ge=1, le=18)]
    seen_at: Literal["receiver", "servos"] = "receiver"
    above_us: Annotated[float, Meta(ge=800, le=2200)] = 1600.0
    action: Literal["mark", "record"] = "mark"


class Telemetry(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """MAVLink to a ground station."""

    to: str  # udp:HOST:PORT, or a serial device
    baud: Baud = 57600
    rate_Hz: Annotated[float, Meta(ge=1, le=10)] = 4.0
    system_id: Annotated[int, Meta(ge=1, le=255)] = 25

    def __post_init__(self) -> None:
        _check_udp(self.to)


class TrayFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What may stand in a tray file."""

    rate_Hz: Annotated[float, Meta(ge=1, le=200)] = 25.0
    directory: str = "logs"
    aircraft: str | None = None
    probe_calibration: str | None = None
    magnetometer_calibration: str | None = None
    files: Files = Files()
    arm: Arm | None = None
    telemetry: Telemetry | None = None
    sensors: Annotated[tuple[SensorTable, ...], Meta(min_length=1)]


class Tray(TrayFile, frozen=True, kw_only=True):
    """What is recorded, how fast, and where it goes. Its paths no longer count from the tray file."""

    text: str  # the file itself, to travel in the log
    zero: str  # where `daq zero` puts its result: beside the tray file


def load_tray(path: str | Path) -> Tray:
    """The tray of a file.

    Raises InputError naming file and key when it cannot be read, is malformed, has an unknown key, or puts two sensors
    on one address or one topic.
    """
    path = Path(path)
    return parse_tray(read_text(path), str(path), path.parent)


def read_text(path: Path) -> str:
    """A text file; raises InputError when it cannot be read."""
    try:
        return path.read_text("utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file") from None


def parse_tray(text: str, where: str, folder: Path) -> Tray:
    """The tray of a file's text; `where` names it in errors, relative paths count from `folder`."""
    try:
        file = msgspec.toml.decode(text, type=TrayFile)
    except msgspec.ValidationError as error:
        raise InputError(f"{where}: {_with_key(error)}") from None
    except msgspec.DecodeError as error:
        raise InputError(f"{where}: not valid TOML ({error})") from None
    _refuse_collisions(file, where)
    return Tray(
        rate_Hz=file.rate_Hz,
        directory=str(folder / file.directory),
        aircraft=_resolve_name(file.aircraft, folder),
        probe_calibration=_resolve(file.probe_calibration, folder),
        magnetometer_calibration=_resolve(file.magnetometer_calibration, folder),
        files=file.files,
        arm=file.arm,
        telemetry=file.telemetry,
        sensors=file.sensors,
        text=text,
        zero=str(folder / ZERO),
    )


def _with_key(error: msgspec.ValidationError) -> str:
    """msgspec's "what - at `$.sensors[2].range_g`" as "sensors[2].range_g: what"."""
    what, _, key = str(error).partition(" - at `$.")
    if number := re.fullmatch(r"Invalid enum value (\d+)", what):
        what = f"{number[1]} (0x{int(number[1]):02x}) is not among the values it can have; see `daq config --example`"
    return f"{key.rstrip('`')}: {what}" if key else what


def _resolve(path: str | None, folder: Path) -> str | None:
    return str(folder / path) if path else None


def _resolve_name(aircraft: str | None, folder: Path) -> str | None:
    """A bare name is a shipped aircraft; anything else is a path."""
    return str(folder / aircraft) if aircraft and Path(aircraft).suffix else aircraft


def _refuse_collisions(tray: TrayFile, where: str) -> None:
    places: dict[tuple[str, int], str] = {}
    topics: dict[str, str] = {}
    for i, sensor in enumerate(tray.sensors):
        label = f"sensors[{i}] ({_driver(sensor)})"
        place = (sensor.lane, sensor.address if isinstance(sensor, _OnBus) else 0)
        if place in places:
            at = f"address 0x{place[1]:02x} of {sensor.lane}" if isinstance(sensor, _OnBus) else f"port {sensor.lane}"
            raise InputError(f"{where}: {places[place]} and {label} are both on {at}; two parts cannot share it")
        places[place] = label
        for topic in sensor.topics:
            if topic in topics:
                raise InputError(f"{where}: {topics[topic]} and {label} would both write {topic}")
            topics[topic] = label
    if tray.arm is not None and "/controls" not in topics:
        raise InputError(f"{where}: arm: no sensor writes /controls, where the switch would be seen")
    if tray.telemetry is not None and tray.telemetry.to in {sensor.lane for sensor in tray.sensors}:
        raise InputError(f"{where}: telemetry.to: a sensor is on {tray.telemetry.to} already")


def _driver(sensor: SensorTable) -> str:
    return str(type(sensor).__struct_config__.tag)
