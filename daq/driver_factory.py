"""Makes the driver of a configured sensor on its bus or port."""

from collections.abc import Callable
from typing import NoReturn

from flightpower.daq import config
from flightpower.daq.bus import Buses
from flightpower.daq.config import SensorTable, Tray
from flightpower.daq.sensors import Sensor
from flightpower.daq.sensors.ads1115 import ADS1115Driver
from flightpower.daq.sensors.ak8963 import AK8963Driver
from flightpower.daq.sensors.bridge import BridgeTransducerDriver
from flightpower.daq.sensors.esc_counter import EscCounterDriver
from flightpower.daq.sensors.ina2xx import INA226, INA228, PowerMonitorDriver
from flightpower.daq.sensors.mpu9250 import MPU9250Driver, Ranges
from flightpower.daq.sensors.ms56xx import VARIANTS, MS56xxDriver
from flightpower.daq.sensors.ublox import UBloxDriver
from flightpower.daq.sensors.ublox_ddc import DdcPort
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.errors import InputError

DriverFactory = Callable[[], Sensor]


class _NoBuses:
    """The buses of a computer without buses, for `check_drivers`."""

    def i2c(self, device: str) -> NoReturn:
        raise OSError(f"{device}: not opened")

    def port(self, device: str, baud: int) -> NoReturn:
        raise OSError(f"{device}: not opened")


def check_drivers(tray: Tray, aircraft: Aircraft | None) -> None:
    """Raises InputError when the configuration lacks something that a driver needs. Opens no device."""
    for table in tray.sensors:
        driver_factory(table, tray, _NoBuses(), aircraft)


def driver_factory(table: SensorTable, tray: Tray, buses: Buses, aircraft: Aircraft | None) -> DriverFactory:
    """Return a function that opens the sensor's bus or port and makes a driver on it. That function may raise OSError.

    Raises InputError when the configuration lacks something that the driver needs.
    """
    period_s = 1 / tray.rate_Hz
    match table:
        case config.Mpu9250Config():
            return lambda: MPU9250Driver(
                buses.i2c(table.bus),
                table.address,
                ranges=Ranges(table.range_g, table.range_dps),
                fifo=table.sampling == "fifo",
                axes=table.parsed_axes,
                period_s=period_s,
                topic=table.topics[0],
            )
        case config.Ak8963Config():
            return lambda: AK8963Driver(buses.i2c(table.bus), table.address, axes=table.parsed_axes)
        case config.Ms5611Config() | config.Ms5607Config() | config.Ms5805Config():
            variant = VARIANTS[table.driver]
            topic = table.topics[0]
            return lambda: MS56xxDriver(buses.i2c(table.bus), table.address, variant, topic=topic, period_s=period_s)
        case config.Ms45xxDoConfig() | config.HoneywellConfig():
            return lambda: BridgeTransducerDriver(
                buses.i2c(table.bus),
                table.address,
                table.transfer,
                topic=table.topics[0],
                reversed_ports=table.reversed_ports,
            )
        case config.UBloxConfig():
            return lambda: UBloxDriver(
                buses.port(table.port, table.baud),
                rate_Hz=table.rate_Hz,
                baud=table.baud,
                reopen=lambda baud: buses.port(table.port, baud),
                topic=table.topics[0],
            )
        case config.UBloxDdcConfig():
            return lambda: UBloxDriver(
                DdcPort(buses.i2c(table.bus), table.address),
                rate_Hz=table.rate_Hz,
                baud=None,
                topic=table.topics[0],
            )
        case config.Navio2Config():
            from flightpower.daq.sensors.navio2 import Navio2Driver  # this module also needs pymavlink

            return lambda: Navio2Driver(buses.port(table.port, 0), aircraft=aircraft)
        case config.EscCounterConfig():
            pole_pairs = table.pole_pairs or (aircraft.propulsion.pole_pairs if aircraft else None)
            if pole_pairs is None:
                raise InputError(
                    "the pulse counter needs the motor's pole pairs, such as pole_pairs = 7, in the tray file or in"
                    " [propulsion] of the aircraft file"
                )
            return lambda: EscCounterDriver(
                buses.port(table.port, table.baud), pole_pairs=pole_pairs, framed=table.framed
            )
        case config.AutopilotConfig():
            from flightpower.daq.sensors.autopilot import (
                AutopilotDriver,  # pymavlink doubles the time of the daemon's imports
            )

            return lambda: AutopilotDriver(
                buses.port(table.port, table.baud),
                aircraft=aircraft,
                rate_Hz=tray.rate_Hz,
                rpm=table.rpm,
                battery=table.battery,
            )
        case config.Ina226Config() | config.Ina228Config():
            part = INA226 if isinstance(table, config.Ina226Config) else INA228
            return lambda: PowerMonitorDriver(
                buses.i2c(table.bus), table.address, part, shunt_ohm=table.shunt_ohm, period_s=period_s
            )
        case config.Ads1115Config():
            return lambda: ADS1115Driver(
                buses.i2c(table.bus),
                table.address,
                inputs=table.inputs,
                full_scale_V=table.full_scale_V,
                period_s=period_s,
            )
    return lambda: table.make_driver(buses, period_s)
