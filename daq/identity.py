"""What each part says of itself, for `daq check`; read after the drivers have brought the parts up."""

from daq import config
from daq.bus import Buses, I2CBus
from daq.config import SensorTable
from daq.sensors.ms56xx import MS5611, MS5805, PROM_WORDS, READ_PROM

MPU_WHO_AM_I = 0x75
MPU_NAMES = {0x71: "MPU-9250", 0x73: "MPU-9255"}
AK8963_WIA, AK8963_ID = 0x00, 0x48


def identity(table: SensorTable, buses: Buses) -> str:
    """One line: the part and where it is; a part that does not answer says why."""
    try:
        return f"{_of_itself(table, buses)}, {_place(table)}"
    except OSError as error:
        return f"{_driver(table)}, {_place(table)}: {error.strerror or error}"


def _of_itself(table: SensorTable, buses: Buses) -> str:
    match table:
        case config.Mpu9250():
            code = buses.i2c(table.bus).write_read(table.address, bytes([MPU_WHO_AM_I]), 1)[0]
            return MPU_NAMES.get(code, f"unknown (WHO_AM_I 0x{code:02x})")
        case config.Ak8963():
            code = buses.i2c(table.bus).write_read(table.address, bytes([AK8963_WIA]), 1)[0]
            return "AK8963" if code == AK8963_ID else f"unknown (WIA 0x{code:02x})"
        case config.Ms5611() | config.Ms5805():
            variant = MS5611 if isinstance(table, config.Ms5611) else MS5805
            words = _prom(buses.i2c(table.bus), table.address)
            crc = words[variant.crc_word] >> variant.crc_shift & 0xF
            return f"{variant.name} with C1 {words[1]}, CRC 0x{crc:x}"
        case config.Ms45xxDo() | config.Honeywell():
            buses.i2c(table.bus).read(table.address, 4)
            return f"{table.part} (answers; it has no identity)"
    return _driver(table)


def _prom(bus: I2CBus, address: int) -> list[int]:
    words = [bus.write_read(address, bytes([READ_PROM + 2 * i]), 2) for i in range(PROM_WORDS)]
    return [int.from_bytes(word, "big") for word in words]


def _place(table: SensorTable) -> str:
    address = getattr(table, "address", None)
    return f"0x{address:02x} on {table.lane}" if address is not None else table.lane


def _driver(table: SensorTable) -> str:
    return str(type(table).__struct_config__.tag)
