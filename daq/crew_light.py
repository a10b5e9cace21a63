"""The crew's light: a lamp that shows from afar whether the daemon records, and a button that begins a new log.

A lamp that stays on or off means that no daemon runs; so a hung computer is not mistaken for a recording one.
"""

import enum
import threading
import time
from collections import deque
from collections.abc import Callable

from flightpower.daq.config import LightConfig
from flightpower.daq.gpio import GpioLine, LineFlag
from flightpower.daq.recording_status import NO_NEWS_S, RecordingState, RecordingStatus
from flightpower.flight.messages import Event

STEP_S = 0.05  # time between two updates of lamp and button; by the next update a bouncing button has settled


class Light(enum.Enum):
    """The lamp's signals. value: how long the lamp is on and off [s]."""

    RECORDING = (1.0, 1.0)
    FAULT = (0.1, 0.1)
    WAITING = (0.1, 1.9)

    def lit(self, at_s: float) -> bool:
        on_s, off_s = self.value
        return at_s % (on_s + off_s) < on_s


def light_of(status: RecordingStatus | None, age_s: float) -> Light:
    """The lamp's signal for a status of this age. It is FAULT before the first status."""
    if status is None or not status.well or age_s > NO_NEWS_S:
        return Light.FAULT
    return Light.RECORDING if status.state is RecordingState.RECORDING else Light.WAITING


class CrewLight:
    """Runs lamp and button in a thread, which calls `on_press`. If the chip fails, an event reports it."""

    def __init__(self, config: LightConfig, *, on_press: Callable[[], None]):
        self._config, self._on_press = config, on_press
        self._status: tuple[RecordingStatus | None, float] = None, 0.0  # the latest status, and when `show` got it
        self._events: deque[Event] = deque()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._work, name="light", daemon=True)
        self._thread.start()

    def show(self, status: RecordingStatus) -> None:
        """Show this state until the next. Never waits."""
        self._status = status, time.monotonic()

    def events(self) -> list[Event]:
        """The events since the last call."""
        return [self._events.popleft() for _ in range(len(self._events))]

    def close(self) -> None:
        """Switch the lamp off and end the thread."""
        self._stop.set()
        self._thread.join(1.0)

    def _work(self) -> None:
        lines: list[GpioLine] = []
        try:
            lamp = GpioLine(self._config.chip, self._config.led, LineFlag.OUTPUT)
            lines.append(lamp)
            if self._config.button is not None:
                flags = LineFlag.INPUT | LineFlag.ACTIVE_LOW | LineFlag.BIAS_PULL_UP
                lines.append(GpioLine(self._config.chip, self._config.button, flags))
            self._run(lamp, lines[1] if len(lines) > 1 else None)
            lamp.set(False)
        except OSError as error:
            text = f"the light fails: {self._config.chip}: {error.strerror or error}"
            self._events.append(Event(severity="warning", sensor="light", text=text))
        finally:
            for line in lines:
                line.close()

    def _run(self, lamp: GpioLine, button: GpioLine | None) -> None:
        set_to: bool | None = None
        pressed = was_pressed = False
        while not self._stop.wait(STEP_S):
            now_s = time.monotonic()
            status, since_s = self._status
            lit = light_of(status, now_s - since_s).lit(now_s)
            if lit is not set_to:
                lamp.set(lit)
                set_to = lit
            if button is None:
                continue
            before, pressed = pressed, button.get()
            if pressed is before and pressed is not was_pressed:  # two equal readings: the button is not bouncing
                was_pressed = pressed
                if pressed:
                    self._events.append(Event(sensor="light", text="the button was pressed: a new log begins"))
                    self._on_press()
