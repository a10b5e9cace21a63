"""The tray file: what is accepted, and that every mistake is refused by file and key."""

from pathlib import Path

import pytest

from flightpower.daq.config import check_places, load_tray, parse_tray
from flightpower.flight.errors import InputError
from flightpower.flight.messages import SECOND_TOPICS, TYPE_OF_TOPIC

EXAMPLE = Path("daq/tray.example.toml")


@pytest.fixture
def example(request) -> Path:
    return request.config.rootpath / EXAMPLE


def refused(text: str) -> str:
    with pytest.raises(InputError) as error:
        parse_tray(text, "tray.toml", Path())
    message = str(error.value)
    assert message.startswith("tray.toml: ") and "\n" not in message
    return message


def test_the_example_is_the_default_tray(example):
    tray = load_tray(example)
    assert tray.rate_Hz == 25 and tray.aircraft == "nexstar"
    addresses = {sensor.name: sensor.address for sensor in tray.sensors if hasattr(sensor, "address")}
    assert addresses == {
        "imu": 0x68, "mag": 0x0C, "baro": 0x77, "static": 0x76,
        "probe-alpha": 0x36, "probe-beta": 0x46, "probe-airspeed": 0x28,
    }  # fmt: skip
    assert {t for s in tray.sensors for t in s.topics} == set(TYPE_OF_TOPIC) - SECOND_TOPICS - {
        "/analog",
        "/time",
        "/daq/tick",
        "/daq/event",
        "/daq/state",
    }
    assert tray.text == example.read_text()


def test_paths_count_from_the_file(tmp_path):
    names = 'directory="logs"\naircraft="mine.toml"\nprobe_calibration="/p.json"\n'
    names += 'magnetometer_calibration="m.json"\n'
    text = names + '[[sensors]]\ndriver="ublox"\nport="/dev/x"'
    (tmp_path / "t.toml").write_text(text)
    tray = load_tray(tmp_path / "t.toml")
    assert tray.directory == str(tmp_path / "logs")
    assert tray.aircraft == str(tmp_path / "mine.toml")
    assert tray.probe_calibration == "/p.json"
    assert tray.magnetometer_calibration == str(tmp_path / "m.json")


def test_the_installation_may_be_named():
    tray = parse_tray('[installation]\nname = "boom, May"\n[[sensors]]\ndriver="ublox"\nport="/dev/x"', "t", Path())
    assert tray.installation is not None and tray.installation.name == "boom, May"


BARO = '[[sensors]]\ndriver="{}"\nbus="b"\naddress=0x76\n'
MAG = '[[sensors]]\ndriver="ak8963"\nbus="b"\n'
PORT = '[[sensors]]\ndriver="{}"\nport="/dev/ttyUSB0"\n'
IMU = '[[sensors]]\ndriver="mpu9250"\nbus="/dev/i2c-1"\n'


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("rate = 25\n" + IMU, "'rate'"),
        (IMU + "adress = 0x68", "sensors[0]: unknown key 'adress'"),
        ("rate_Hz = 0.5\n" + IMU, "rate_Hz"),
        ("rate_Hz = 500\n" + IMU, "rate_Hz"),
        (IMU + "range_g = 3", "sensors[0].range_g: 3 must be 2 or 4 or 8 or 16"),
        (IMU + 'address = "0x68"', "sensors[0].address"),
        (
            '[[sensors]]\ndriver="ms5611"\nbus="b"\naddress=0x75',
            "sensors[0].address: 0x75 must be 0x76 or 0x77",
        ),
        (IMU + 'axes = ["x", "y", "-z"]', "right-handed"),
        (IMU + '[[sensors]]\ndriver="bmp280"', "sensors[1].driver: Invalid value 'bmp280'"),
        (IMU + '[[sensors]]\ndriver="bmp280"', "the drivers are mpu9250, ak8963"),
        ('[telemetry]\nto = "udp:192.168.4.2:99999"\n' + IMU, "a port is a number from 1 to 65535"),
        ('[[sensors]]\ndriver="ublox"\nport="/dev/ttyUSB0"\nbaud=3840', "sensors[0].baud: 3840 must be 1200 or 2400"),
        ('[telemetry]\nto = "/dev/ttyS0"\nbaud=3840\n' + IMU, "telemetry.baud: 3840 must be 1200 or 2400"),
        ('[[sensors]]\ndriver="mpu9250"\nbus="udp:127.0.0.1:9"', "udp:127.0.0.1:9 is no I2C bus"),
        (IMU + '[[sensors]]\ndriver="ak8963"\nbus="/dev/i2c-1"\naxes=["y", "-x", "z"]', "ak8963 is inside mpu9250"),
        ('[[sensors]]\nbus="/dev/i2c-1"', "sensors[0]: Object missing required field `driver`"),
        ("", "missing required field `sensors`"),
        ("sensors = []", "sensors"),
        ("rate_Hz = ", "not valid TOML"),
        (
            '[[sensors]]\ndriver="honeywell"\nbus="b"\npart="SSC"\nmeasures="alpha"',
            "sensors[0]: 'SSC' is not a supported part number",
        ),
        ('[[sensors]]\ndriver="autopilot"\nport="udp:14550"', "udp:HOST:PORT"),
        (
            IMU + BARO.format("ms5611") + BARO.format("ms5805"),
            "sensors[1] (ms5611) and sensors[2] (ms5805) are both on",
        ),
        (MAG + '[[sensors]]\ndriver="mpu9250"\nbus="b"\naddress=0x0C', "both on address 0x0c of b"),
        (PORT.format("ublox") + PORT.format("esc_counter"), "both on port /dev/ttyUSB0"),
        (IMU + IMU + "address=0x69", "would both write /imu"),
        ("[files]\nrotate = 3\n" + IMU, "files: unknown key 'rotate'"),
        ('[files]\nwhen_full = "panic"\n' + IMU, "files.when_full"),
        ("[arm]\nchannel = 7\n" + IMU, "no sensor writes /controls"),
        ('card = "card.toml"\n' + IMU, "needs aircraft and [telemetry]"),
    ],
)
def test_mistakes_are_named(text, expected):
    assert expected in refused(text)


def test_a_part_number_can_collide_too():
    airspeed = '[[sensors]]\ndriver="honeywell"\nbus="b"\npart="SSCDRRN005ND2A5"\nmeasures="airspeed"\n'
    alpha = '[[sensors]]\ndriver="ms45xxdo"\nbus="b"\npart="MS4515DO-DS5AI002DP"\nmeasures="alpha"\n'
    assert "address 0x28" in refused(airspeed + alpha)
    assert len(parse_tray(airspeed + alpha.replace('"b"', '"c"'), "tray.toml", Path()).sensors) == 2


def test_a_file_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match=r"no\.toml: cannot be read"):
        load_tray(tmp_path / "no.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a text file"):
        load_tray(tmp_path / "binary.toml")


def test_a_rate_at_which_the_fifo_overflows_is_refused(example):
    text = example.read_text()
    assert "(mpu9250)" in refused(text.replace("rate_Hz = 25 ", "rate_Hz = 5 ", 1))
    parse_tray(text.replace("rate_Hz = 25 ", "rate_Hz = 6 ", 1), "tray.toml", Path())
    single = text.replace('sampling = "fifo"', 'sampling = "single"')
    parse_tray(single.replace("rate_Hz = 25 ", "rate_Hz = 5 ", 1), "tray.toml", Path())


@pytest.mark.parametrize(
    ("head", "expected"),
    [
        ('directory = "taken/logs"\n', "taken is a file"),
        ('[telemetry]\nto = "udp:laptop.invalid:14550"\n', "laptop.invalid has no address here"),
    ],
)
def test_places_that_cannot_be_used_are_named(tmp_path, head, expected):
    (tmp_path / "taken").touch()
    with pytest.raises(InputError, match=expected):
        check_places(parse_tray(head + IMU, "tray.toml", tmp_path), "tray.toml")


@pytest.mark.parametrize(
    ("baud", "rate_Hz", "enough"), [(9600, 10, 19200), (9600, 8, 19200), (9600, 7, None), (19200, 10, None)]
)
def test_a_line_that_cannot_carry_the_solutions_is_refused(baud, rate_Hz, enough):
    """A solution of 100 bytes takes 1000 bits of the line, a fifth of which is kept free."""
    text = f'[[sensors]]\ndriver = "ublox"\nport = "/dev/ttyAMA0"\nbaud = {baud}\nrate_Hz = {rate_Hz}\n'
    if enough is None:
        assert parse_tray(text, "tray.toml", Path()).sensors
        return
    with pytest.raises(InputError, match=f"carries 7 solutions a second.*set baud = {enough}"):
        parse_tray(text, "tray.toml", Path())
