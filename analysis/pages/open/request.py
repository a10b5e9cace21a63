"""What the page may request, and errors that name the field of the form at fault."""

from typing import Any, NamedTuple

import msgspec

from flightpower.flight.errors import InputError

Json = dict[str, Any]


class Run(msgspec.Struct, forbid_unknown_fields=True):
    """A stretch of the flight as shown on the page. why : why it is left out, and other remarks"""

    kind: str
    start_s: float
    end_s: float
    keep: bool
    why: str = ""


class Values(msgspec.Struct, forbid_unknown_fields=True):
    """Values from the user that replace the log's values.

    runs : None if the analysis is to find them     left_out : stretches of a whole flight [s] that the user left out
    aircraft : changed values of the form, as typed, by key
    propeller : name of a shipped propeller; "" for the log's
    other_condition : mass [kg] and air density [kg/m^3] for the curve; None for those of the flight
    method : name of a method whose curve is drawn next to the report's; "" for none
    polar : name of a file with a predicted polar to draw next to the curve; "" for none
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
    """Limits for requests of the page.

    log_bytes, request_bytes, name_bytes : size of a dropped log, of a request or a polar, of a file's name
    entries : number of runs and of keys in a request     channels : drawn at the same time
    points, strip_px, letters : number of points in a strip; its height; its width in letters
    curves : number kept for a flight, for users who return to earlier values
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
    """A value of the form that cannot be used. field : the key of the field next to which the page shows the message"""

    def __init__(self, text: str, field: str):
        super().__init__(text)
        self.field = field
