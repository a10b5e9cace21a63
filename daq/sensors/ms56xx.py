"""Driver of a family of TE barometers: MS5611-01BA03, MS5607-02BA03 and MS5805-02BA01 (datasheets of these names).

The commands are the same; scale factors and position of the checksum differ. A conversion takes up to 9 ms, and the
driver never waits for it: it starts a conversion at the end of each tick's reading, and reads its result in the next
tick. About once a second the temperature is converted instead of the pressure; that tick has status `busy` and no
pressure. In between, the temperature is extrapolated from the last seconds, because uncompensated pressure changes by
some 250 Pa per kelvin. While the electronics warmed up, a temperature half a second old made pressure 4.5 Pa too low,
or 0.4 m in height, an error that decayed within ten minutes and looked like a descent.

A result has no checksum. A reading that jumps is used only after later readings confirm it. An MS5607, which is sold on
boards meant for an MS5611 and has a valid checksum, gives half the pressure.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

from flightpower.daq.bus import I2CBus
from flightpower.daq.sensors import Sample, SensorFailure, wrong_device
from flightpower.flight.messages import AbsolutePressure, Status

RESET, READ_ADC, START_PRESSURE, START_TEMPERATURE, READ_PROM = 0x1E, 0x00, 0x40, 0x50, 0xA0
RESET_S = 0.004  # the PROM is reloaded in 2.8 ms
PROM_WORDS = 8
# Longest conversion time [ns] by the code added to the start command: oversampling 256, 512, 1024, 2048, 4096.
CONVERSION_NS = {0x0: 600_000, 0x2: 1_170_000, 0x4: 2_280_000, 0x6: 4_540_000, 0x8: 9_040_000}
MARGIN_NS = 1_500_000  # margin for the transfers, and for a short interval after a late tick
TEMPERATURE_EVERY_NS = 1_000_000_000
TREND_LENGTH = 10  # number of temperatures: over so many seconds the slope adds a tenth of their noise
JUMP_COUNTS = 3000  # a step of 0.1 K off the trend is not warming; a new trend is started
ZERO_DEGC_K = 273.15
# Beyond the measuring range of the family (10 to 2000 mbar, -40 to 85 degC).
PLAUSIBLE_PA, PLAUSIBLE_CENTI_DEGC = (1e3, 2e5), (-5000.0, 9000.0)
# Change between ticks by gusts at the static line, noise, and a dive at 40 m/s. A larger change must be confirmed.
JUMP_PA, JUMP_PA_PER_S = 30.0, 500.0
CONFIRMED_BY = 3  # successive conversions that must agree; a shifted reply is wrong by the same factor each time
ON_GROUND_PA = (70e3, 115e3)  # pressures where flights begin: up to 3000 m, and above the highest at sea level
PRESSURES_TO_JUDGE = 25  # pressures after the start by which another part is recognized
IMPLAUSIBLE_LIMIT = 3  # so many in a row are not caused by a single bit error on the bus


@dataclass(frozen=True)
class BarometerVariant:
    """The differences between the parts of the family.

    OFF = C2 2^off_shift + C4 dT / 2^(23 - off_shift), SENS = C1 2^sens_shift + C3 dT / 2^(23 - sens_shift); below
    20 degC T2 = t2 dT^2, OFF2 = off2 (TEMP - 2000)^2, SENS2 likewise; below -15 degC OFF2 += off3 (TEMP + 1500)^2.
    """

    name: str
    prom_words: int
    crc_word: int  # PROM word with the CRC, and position of its lowest bit
    crc_shift: int
    off_shift: int
    sens_shift: int
    t2: float
    off2: float
    sens2: float
    off3: float
    sens3: float
    twin: "BarometerVariant | None" = None  # the part whose calibration memory looks the same


# Datasheet MS5611-01BA03, figures 2 and 3; PROM table on p. 9.
MS5611 = BarometerVariant("MS5611", 8, 7, 0, 16, 15, 2.0**-31, 5 / 2, 5 / 4, 7.0, 11 / 2)
# Datasheet MS5607-02BA03, figures 2 and 3: other scale factors, and the same memory.
MS5607 = BarometerVariant("MS5607", 8, 7, 0, 17, 16, 2.0**-31, 61 / 16, 2.0, 15.0, 8.0, twin=MS5611)
MS5611 = replace(MS5611, twin=MS5607)
# Datasheet MS5805-02BA01, p. 8-9: seven words of PROM (112 bits) with the CRC in the first four bits of word 0, not in
# the last word as in the MS5611. Linux agrees: drivers/iio/pressure/ms5637.c serves the MS5805 with seven words, and in
# drivers/iio/common/ms_sensors/ms_sensors_i2c.c ms_sensors_tp_crc_valid_112 takes the CRC from bits 15 to 12 of word 0,
# ms_sensors_tp_crc_valid_128 (parts of eight words) from the last bits of word 7.
MS5805 = BarometerVariant("MS5805", 7, 0, 12, 17, 16, 11 * 2.0**-35, 31 / 8, 63 / 32, 0.0, 0.0)


VARIANTS = {variant.name.lower(): variant for variant in (MS5611, MS5607, MS5805)}  # by driver's name


class TemperatureTrend:
    """Extrapolates temperature counts along the line through the oldest and the latest conversion kept."""

    def __init__(self) -> None:
        self._conversions: deque[tuple[int, int]] = deque(maxlen=TREND_LENGTH)  # middle of the conversion [ns], counts

    @property
    def last(self) -> int | None:
        return self._conversions[-1][1] if self._conversions else None

    def add(self, time_ns: int, counts: int) -> None:
        if self.jumps(time_ns, counts):
            self._conversions.clear()
        self._conversions.append((time_ns, counts))

    def jumps(self, time_ns: int, counts: int) -> bool:
        """Whether the counts are off the trend."""
        return bool(self._conversions) and abs(counts - self.at(time_ns)) > JUMP_COUNTS

    def at(self, time_ns: int) -> float:
        (first_ns, first), (last_ns, last) = self._conversions[0], self._conversions[-1]
        slope = (last - first) / (last_ns - first_ns) if last_ns > first_ns else 0.0
        return last + slope * (time_ns - last_ns)


class MS56xxDriver:
    """A barometer of the family, writing to `topic`. period_s: tick period, which limits the oversampling."""

    def __init__(self, bus: I2CBus, address: int, variant: BarometerVariant, *, topic: str, period_s: float):
        self._bus, self._address = bus, address
        self._variant = variant
        self._topic = topic
        self._code = oversampling_code(period_s)
        self._prom: tuple[int, ...] = ()
        self._running: int | None = None  # START_PRESSURE or START_TEMPERATURE
        self._started_ns = 0
        self._temperatures = TemperatureTrend()
        self._temperature_due_ns = 0
        self._implausible = 0
        self._odd_temperature: int | None = None  # the latest temperature, if it was off the trend
        self._believed: tuple[int, float] | None = None  # time, and pressure [Pa]
        self._odd_pressures: list[float] = []  # successive, off the believed one but near each other [Pa]
        self._judged = 0

    def start(self) -> Iterator[float]:
        """Reset the part and read its calibration. Raises SensorFailure if the checksum is wrong."""
        self._bus.write(self._address, bytes([RESET]))
        yield RESET_S
        words = []
        for i in range(self._variant.prom_words):
            words.append(int.from_bytes(self._bus.write_read(self._address, bytes([READ_PROM + 2 * i]), 2), "big"))
        self._prom = check_prom(tuple(words), self._variant)

    def read(self, now_ns: int) -> list[Sample]:
        if self._running is None:
            sample = Sample(self._topic, now_ns, AbsolutePressure(status=Status.BUSY))
        elif now_ns - self._started_ns < CONVERSION_NS[self._code]:  # it is still running
            return [Sample(self._topic, now_ns, AbsolutePressure(status=Status.BUSY))]
        else:
            sample = self._finish(now_ns)
        temperature_next = self._temperatures.last is None or now_ns >= self._temperature_due_ns
        command = START_TEMPERATURE if temperature_next else START_PRESSURE
        self._bus.write(self._address, bytes([command | self._code]))
        self._running, self._started_ns = command, now_ns
        return [sample]

    def _finish(self, now_ns: int) -> Sample:
        counts = int.from_bytes(self._bus.write_read(self._address, bytes([READ_ADC]), 3), "big")
        if counts == 0:
            # MS5611 datasheet p. 11: no conversion was running, or it had not ended. The first means that the part was
            # reset, the second that the start command was delayed on its way.
            raise SensorFailure(
                Status.TIMEOUT,
                f"{self._variant.name} had no result: its bus or this computer is slow, or its supply was interrupted",
            )
        middle_ns = self._started_ns + CONVERSION_NS[self._code] // 2
        if self._running == START_TEMPERATURE:
            odd = self._odd_temperature
            if self._temperatures.jumps(middle_ns, counts) and (odd is None or abs(counts - odd) > JUMP_COUNTS):
                self._odd_temperature = counts  # converted once more before it is believed
                return Sample(self._topic, now_ns, AbsolutePressure(status=Status.BUSY))
            self._odd_temperature = None
            self._temperatures.add(middle_ns, counts)
            self._temperature_due_ns = now_ns + TEMPERATURE_EVERY_NS
            return Sample(self._topic, now_ns, AbsolutePressure(status=Status.BUSY))
        d2 = self._temperatures.at(middle_ns)
        centi_degC, pressure_Pa = compensate(self._variant, self._prom, counts, d2)
        if self._judged < PRESSURES_TO_JUDGE:
            self._judge_part(counts, d2, pressure_Pa)
        if not plausible(centi_degC, pressure_Pa):
            self._implausible += 1
            self._temperature_due_ns = now_ns  # pressure or temperature is wrong: measure the temperature again
            self._temperatures = TemperatureTrend()
            if self._implausible >= IMPLAUSIBLE_LIMIT:
                raise SensorFailure(Status.CORRUPT, f"{self._variant.name}: measurements outside the part's range")
            return Sample(self._topic, now_ns, AbsolutePressure(status=Status.CORRUPT))
        self._implausible = 0
        if not self._is_believed(pressure_Pa, middle_ns):
            return Sample(self._topic, now_ns, AbsolutePressure(status=Status.CORRUPT))
        message = AbsolutePressure(
            pressure_counts=counts,
            temperature_counts=self._temperatures.last,
            pressure_Pa=pressure_Pa,
            temperature_K=centi_degC / 100 + ZERO_DEGC_K,
        )
        return Sample(self._topic, middle_ns, message)

    def _is_believed(self, pressure_Pa: float, time_ns: int) -> bool:
        """Whether the pressure is near the last believed pressure, or is the last of several that agree."""
        if self._believed is not None:
            before_ns, before_Pa = self._believed
            limit_Pa = JUMP_PA + JUMP_PA_PER_S * (time_ns - before_ns) * 1e-9
            if abs(pressure_Pa - before_Pa) > limit_Pa:
                odd = [*self._odd_pressures, pressure_Pa]
                self._odd_pressures = odd if max(odd) - min(odd) <= 2 * JUMP_PA else [pressure_Pa]
                if len(self._odd_pressures) < CONFIRMED_BY:
                    return False
        self._believed, self._odd_pressures = (time_ns, pressure_Pa), []
        return True

    def _judge_part(self, d1: int, d2: float, pressure_Pa: float) -> None:
        """Raises SensorFailure if the pressure is plausible only with the scale factors of the other part."""
        self._judged += 1
        twin = self._variant.twin
        low_Pa, high_Pa = ON_GROUND_PA
        if twin is None or low_Pa <= pressure_Pa <= high_Pa:
            self._judged = PRESSURES_TO_JUDGE
        elif low_Pa <= (other_Pa := compensate(twin, self._prom, d1, d2)[1]) <= high_Pa:
            raise wrong_device(
                self._variant.name,
                f"{pressure_Pa / 100:.0f} hPa would be {other_Pa / 100:.0f} by an {twin.name}: set driver ="
                f' "{twin.name.lower()}" in the tray file',
            )


def plausible(centi_degC: float, pressure_Pa: float) -> bool:
    """Whether temperature and pressure are within the measuring range."""
    low_Pa, high_Pa = PLAUSIBLE_PA
    low, high = PLAUSIBLE_CENTI_DEGC
    return low_Pa <= pressure_Pa <= high_Pa and low <= centi_degC <= high


def oversampling_code(period_s: float) -> int:
    """Code of the longest conversion that fits into a tick."""
    fitting = [code for code, duration_ns in CONVERSION_NS.items() if duration_ns + MARGIN_NS < period_s * 1e9]
    return max(fitting, default=0)


def crc4(words: tuple[int, ...]) -> int:
    """The family's checksum (AN520 p. 5); the bits of the checksum must be zero in `words`."""
    remainder = 0
    for word in (words + (0,) * PROM_WORDS)[:PROM_WORDS]:
        for byte in (word >> 8, word & 0xFF):
            remainder ^= byte
            for _ in range(8):
                remainder = (remainder << 1 ^ 0x3000 if remainder & 0x8000 else remainder << 1) & 0xFFFF
    return remainder >> 12


def check_prom(words: tuple[int, ...], variant: BarometerVariant) -> tuple[int, ...]:
    """Return `words` if their checksum is right. An all-zero PROM has a valid checksum and is rejected too."""
    stored_crc = words[variant.crc_word] >> variant.crc_shift & 0xF
    bare = list(words)
    # AN520 clears the whole low byte of the MS5611's last word, not only the four bits of the CRC.
    bare[variant.crc_word] &= 0xFF00 if variant.crc_shift == 0 else ~(0xF << variant.crc_shift)
    if not any(words[1:7]) or crc4(tuple(bare)) != stored_crc:
        raise SensorFailure(Status.CORRUPT, f"{variant.name}: wrong checksum of the calibration memory")
    return words


def compensate(variant: BarometerVariant, prom: tuple[int, ...], d1: int, d2: float) -> tuple[float, float]:
    """Temperature [0.01 degC] and pressure [Pa] from the counts D1, D2 and PROM words, second order included."""
    c1, c2, c3, c4, c5, c6 = prom[1:7]
    dT = d2 - c5 * 2**8
    temperature = 2000 + dT * c6 / 2**23
    offset = c2 * 2**variant.off_shift + c4 * dT / 2 ** (23 - variant.off_shift)
    sensitivity = c1 * 2**variant.sens_shift + c3 * dT / 2 ** (23 - variant.sens_shift)
    below_20 = min(temperature - 2000, 0.0)
    below_minus_15 = min(temperature + 1500, 0.0)
    if below_20:
        temperature -= variant.t2 * dT**2
    offset -= variant.off2 * below_20**2 + variant.off3 * below_minus_15**2
    sensitivity -= variant.sens2 * below_20**2 + variant.sens3 * below_minus_15**2
    return temperature, (d1 * sensitivity / 2**21 - offset) / 2**15
