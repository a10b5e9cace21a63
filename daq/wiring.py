"""From the configuration to drivers on their buses."""

from collections.abc import Callable

from daq import config
from daq.bus import Buses
from daq.config import SensorTable, Tray
from daq.sensors import Sensor
from daq.sensors.ak8963 import AK8963
from daq.sensors.autopilot import Autopilot
from daq.sensors.bridge import BridgeTransducer
from daq.sensors.esc_counter import EscCounter
from daq.sensors.mpu9250 import MPU9250
from daq.sensors.ms56xx import MS5611, MS5805, MS56xx
from daq.sensors.navio2 import Navio2Receiver
from daq.sensors.ublox import UBlox
from daq.sensors.ublox_ddc import DdcPort
from flight.aircraft import Aircraft
from flight.errors import InputError

Maker = Callable[[], Sensor]


def maker(table: SensorTable, tray: Tray, buses: Buses, aircraft: Aircraft | None) -> Maker:
    """A function that opens the sensor's bus or port and makes a fresh driver on it; it raises OSError.

    Raises InputError when the configuration lacks something the driver needs.
    """
    period_s = 1 / tray.rate_Hz
    match table:
        case config.Mpu9250():
            return lambda: MPU9250(
                buses.i2c(table.bus),
                table.address,
                range_g=table.range_g,
                range_dps=table.range_dps,
                fifo=table.sampling == "fifo",
                axes=table.parsed_axes,
            )
        case config.Ak8963():
            return lambda: AK8963(buses.i2c(table.bus), table.address, axes=table.parsed_axes)
        case config.Ms5611() | config.Ms5805():
            variant = MS5611 if isinstance(table, config.Ms5611) else MS5805
            topic = table.topics[0]
            return lambda: MS56xx(buses.i2c(table.bus), table.address, variant, topic=topic, period_s=period_s)
        case config.Ms45xxDo() | config.Honeywell():
            return lambda: BridgeTransducer(
                buses.i2c(table.bus),
                table.address,
                table.transfer,
                topic=table.topics[0],
                reversed_ports=table.reversed_ports,
            )
        case config.UBlox():
            return lambda: UBlox(
                buses.port(table.port, table.baud),
                rate_Hz=table.rate_Hz,
                baud=table.baud,
                reopen=lambda baud: buses.port(table.port, baud),
            )
        case config.UBloxDdc():
            return lambda: UBlox(DdcPort(buses.i2c(table.bus), table.address), rate_Hz=table.rate_Hz, baud=None)
        case config.Navio2():
            return lambda: Navio2Receiver(buses.port(table.port, 0), aircraft=aircraft)
        case config.EscCounter():
            pole_pairs = table.pole_pairs or (aircraft.propulsion.pole_pairs if aircraft else None)
            if pole_pairs is None:
                raise InputError("the pulse counter needs pole_pairs, or an aircraft whose file gives them")
            return lambda: EscCounter(buses.port(table.port, table.baud), pole_pairs=pole_pairs, framed=table.framed)
        case config.Autopilot():
            return lambda: Autopilot(
                buses.port(table.port, table.baud), aircraft=aircraft, rate_Hz=tray.rate_Hz, rpm=table.rpm
            )
