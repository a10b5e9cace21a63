"""What the page may ask for, and what is wrong with it at which of its fields."""

from typing import Any, NamedTuple

import msgspec

from flightpower.flight.errors import InputError

Json = dict[str, Any]


class Run(msgspec.Struct, forbid_unknown_fields=True):
    """A stretch of the flight as the page has it. why : what it is left out for, and other remarks"""

    kind: str
    start_s: float
    end_s: float
    keep: bool
    why: str = ""


class Values(msgspec.Struct, forbid_unknown_fields=True):
    """What the user gives in place of the log's values.

    runs : None where they are to be found in the data     left_out : stretches of a whole flight [s], by hand
    aircraft : values of the form that were changed, by key, as typed
    propeller : the name of a shipped one; "" for that of the log
    other_condition : mass [kg] and air density [kg/m^3] for which the curve is drawn; None for those of the flight
    method : name of one whose curve is asked for beside that of the report; "" for none
    polar : name of a file with a predicted polar, to draw beside it; "" for none
    channels : names of further channels to draw over time
    """

    file: str
    runs: list[Run] | None = None
    left_out: list[tuple[float, float]] = []
    aircraft: dict[str, str] = {}
    propeller: str = ""
    other_condition: tuple[float, float] | None = None
    method: str = ""
    polar: str = ""
    channels: list[str] = []


class Limits(NamedTuple):
    """Limits of what the page may ask.

    log_bytes, request_bytes, name_bytes : of a dropped log, of a request or a polar, of a file's name
    entries, channels : runs and keys in a request; channels that are drawn at a time
    points, strip_px, letters : of a strip; its height; how many letters it is wide
    curves : that are kept of a flight, for who goes back to what was there before
    """

    log_bytes: int = 500_000_000
    request_bytes: int = 200_000
    name_bytes: int = 200
    entries: int = 500
    channels: int = 12
    points: int = 1500
    strip_px: int = 96
    letters: int = 110
    curves: int = 10


LIMITS = Limits()


class FieldError(InputError):
    """A value of the form that cannot be used. field : its key, at which the page shows the message"""

    def __init__(self, text: str, field: str):
        super().__init__(text)
        self.field = field
