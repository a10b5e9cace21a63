"""The contents of a fleet's `fleet.json`: airframes with their curves and changes, and the curves of the fleet.

`flights.fleet_summary` fills it; the page and the terminal only need the form.
"""

from enum import StrEnum

import msgspec

from flightpower.analysis.records.flight import ConditionResult, Evidence, Kind, PowerPoint, Trust

FORMAT = "flightpower-fleet-1"


class Shape(StrEnum):
    """How a change came."""

    STEP = "step"
    DRIFT = "drift"


class What(StrEnum):
    """What changed."""

    DRAG = "drag"
    PROPULSION = "propulsion"
    BOTH = "drag and propulsion"


class Contradiction(StrEnum):
    """Why flights of one name cannot be of one airframe."""

    SIZE = "wing area or span"
    FLIGHT = "one flight of two airframes"
    INSTALLATION = "installation that returns"  # the probe was remounted meanwhile, so its errors changed


class ContradictionResult(msgspec.Struct, frozen=True, kw_only=True):
    """A contradiction between two flights of one name that one airframe cannot explain."""

    kind: Contradiction
    airframe: str
    log: str
    earlier_log: str
    text: str


class ChangeResult(msgspec.Struct, frozen=True, kw_only=True):
    """A change from one flight on; percent of the airframe's own, with 95 % half widths."""

    what: What
    shape: Shape
    since_log: str
    since_unix_s: float | None
    found_log: str
    drag_percent: float
    drag_half_width_percent: float
    thrust_percent: float
    thrust_half_width_percent: float
    text: str


class FlightShareResult(msgspec.Struct, frozen=True, kw_only=True):
    """Drag and thrust from one flight alone, minus their mean before the first change.

    In percent, with 95 % half widths without the errors that all flights of the airframe share.
    """

    log: str
    start_unix_s: float
    drag_percent: float
    drag_half_width_percent: float
    thrust_percent: float
    thrust_half_width_percent: float


class FleetFlightResult(msgspec.Struct, frozen=True, kw_only=True):
    """One flight of an airframe. report : its page, from the folder of the fleet's page; "" where it is not there"""

    log: str
    start_unix_s: float | None
    report: str = ""


class AirframeResult(msgspec.Struct, frozen=True, kw_only=True):
    """An airframe in one configuration. The curve is of the flights since the last change, `pooled_flights`."""

    name: str
    title: str
    configuration: str
    installation: str
    propeller: str
    flights: int
    pooled_flights: int
    first_unix_s: float | None
    last_unix_s: float | None
    test: ConditionResult
    kind: Kind = Kind.POWER_REQUIRED  # of the curve:
    power_required: list[PowerPoint]
    trust: Trust  # as bad as the worst of:
    evidence: list[Evidence]  # against the pooled flights
    changes: list[ChangeResult]
    history: list[FlightShareResult] = []  # of its dated flights, of three or more
    logs: list[FleetFlightResult] = []  # all its flights, by date


class FleetCurveResult(msgspec.Struct, frozen=True, kw_only=True):
    """Airframes of one wing and propeller: power of their mean, and of another airframe that has not flown yet.

    airframes : in the mean     changed : shown separately; in the mean where fewer than three others are
    """

    airframes: list[str]
    changed: list[str] = []
    test: ConditionResult
    mean: list[PowerPoint]
    another: list[PowerPoint]


class FleetResults(msgspec.Struct, frozen=True, kw_only=True):
    format: str = FORMAT
    software_version: str
    flights: int
    airframes: list[AirframeResult]
    curves: list[FleetCurveResult]
    contradictions: list[ContradictionResult] = []
    notes: list[str] = []  # a line for each airframe with flights that have no date
    left_out: list[str]  # a line for each file of the dataset that could not be read
