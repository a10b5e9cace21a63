"""Watches a Raspberry Pi for a low supply and heat in flight. The readings are taken in a separate thread."""

import enum
import threading
import time
from collections import deque
from pathlib import Path
from typing import NamedTuple

from flightpower.daq.computer_check import supply_check
from flightpower.daq.process_setup import use_every_processor
from flightpower.flight.messages import Event

CHECK_EVERY_S = 1.0
HELD_S = 10.0  # a dip lasts milliseconds, but is reported for this long
CELSIUS_K = 273.15
HOT_K = 80 + CELSIUS_K  # the firmware slows a Pi 3, 4 or 5 down from here on (documentation of frequency management)
# Bits of the firmware's get_throttled for the present moment. Sixteen bits higher are those for the time since
# power-on.
LOW_SUPPLY, CAPPED, THROTTLED, HOT = 0x1, 0x2, 0x4, 0x8
GET_THROTTLED = "devices/platform/soc*/soc*:firmware/get_throttled"
TEMPERATURE = "class/thermal/thermal_zone0/temp"  # [m°C]


class Strain(enum.Enum):
    """Conditions that the crew is warned of."""

    SUPPLY = enum.auto()
    HEAT = enum.auto()


class Computer(NamedTuple):
    """The state of the computer; fields are None if unknown."""

    supply_low: bool | None = None
    slowed: bool | None = None  # whether heat or the supply slows it down
    temperature_K: float | None = None  # temperature of the processor


def read_computer(sysfs: Path) -> Computer:
    """Read supply and temperature from a Pi's firmware, or from its drivers."""
    supply = supply_check(sysfs / "class/hwmon")
    low = None if supply is None else not supply.ok
    slowed = temperature_K = None
    for path in sysfs.glob(GET_THROTTLED):
        try:
            bits = int(path.read_text().strip().removeprefix("0x"), 16)
        except (OSError, ValueError):
            continue
        low = bool(low) or bool(bits & LOW_SUPPLY)
        slowed = bool(bits & (CAPPED | THROTTLED | HOT))
    try:
        temperature_K = int((sysfs / TEMPERATURE).read_text()) / 1e3 + CELSIUS_K
    except (OSError, ValueError):
        temperature_K = None
    return Computer(low, slowed, temperature_K)


class ComputerWatch:
    """Checks the computer once a second: in a thread after `start`; without that, call `check`."""

    def __init__(self, sysfs: Path = Path("/sys")):
        self._sysfs = sysfs
        self.latest = Computer()
        self._last_s: dict[Strain, float] = {}  # when each strain was last seen
        self._notified: dict[Strain, str] = {}
        self._events: deque[Event] = deque()
        self._stop = threading.Event()

    @property
    def trouble(self) -> list[str]:
        """Conditions that the crew should know about, one clause each."""
        return list(self._notified.values())

    def start(self) -> None:
        """Check every second from now on."""
        threading.Thread(target=self._work, name="computer", daemon=True).start()

    def stop(self) -> None:
        self._stop.set()

    def events(self) -> list[Event]:
        """The events since the last call."""
        return [self._events.popleft() for _ in range(len(self._events))]

    def check(self, now_s: float) -> None:
        """Read the computer's state. now_s: monotonic time."""
        self.latest = now = read_computer(self._sysfs)
        hot = now.temperature_K is not None and now.temperature_K >= HOT_K
        for strain, seen in ((Strain.SUPPLY, now.supply_low), (Strain.HEAT, now.slowed or hot)):
            if seen:
                self._last_s[strain] = now_s
        temperature_text = "" if now.temperature_K is None else f", {now.temperature_K - CELSIUS_K:.0f} °C"
        texts = {
            Strain.SUPPLY: "the supply is below 4.63 V",
            Strain.HEAT: f"the processor is hot or slowed down{temperature_text}",
        }
        strained = [strain for strain, last_s in self._last_s.items() if now_s - last_s < HELD_S]
        for strain in strained:
            if strain not in self._notified:
                self._events.append(Event(severity="warning", sensor="computer", text=texts[strain]))
        if self._notified and not strained:
            self._events.append(Event(sensor="computer", text="supply and heat of the computer are in order again"))
        self._notified = {strain: texts[strain] for strain in strained}

    def _work(self) -> None:
        use_every_processor(whole_process=False)  # reading the firmware takes long, and must not hold up the sampling
        while not self._stop.wait(CHECK_EVERY_S):
            self.check(time.monotonic())
