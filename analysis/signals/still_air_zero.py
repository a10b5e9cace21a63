"""The transducers' readings in still air that `daq zero` took: the file `zero.json`."""

import msgspec

from analysis.signals.rest import CHANNELS
from analysis.signals.synchronize import COLUMNS
from flight.json_file import JsonFormat


class Reading(msgspec.Struct, frozen=True):
    """Of one field of one topic."""

    mean: float
    standard_deviation: float
    samples: int


class StillAirZero(msgspec.Struct, frozen=True):
    """The content of `zero.json`; readings: by topic and field."""

    format: str
    readings: dict[str, dict[str, Reading]]

    def by_channel(self) -> dict[str, float]:
        """The mean reading of each of CHANNELS that was taken."""
        fields = {name: COLUMNS[name] for name in CHANNELS}
        return {
            name: self.readings[topic][field].mean
            for name, (topic, field) in fields.items()
            if field in self.readings.get(topic, {})
        }


ZERO_FILE = JsonFormat(StillAirZero, ("flightpower-zero-1",), "a still-air zero")
