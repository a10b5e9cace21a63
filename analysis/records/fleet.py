"""The contents of a fleet's `fleet.json`: airframes with their curves and changes, and the curves of the fleet.

`flights.fleet_summary` fills these records; the page and the terminal only read them.
"""

from enum import StrEnum

import msgspec

from flightpower.analysis.records.flight import ConditionResult, Evidence, Kind, PowerPoint, Trust

FORMAT = "flightpower-fleet-1"


class Shape(StrEnum):
    """Whether a change came at once or slowly."""

    STEP = "step"
    DRIFT = "drift"


class What(StrEnum):
    """The part of the airframe that changed."""

    DRAG = "drag"
    PROPULSION = "propulsion"
    BOTH = "drag and propulsion"


class Contradiction(StrEnum):
    """The reason why flights under one name cannot all be of one airframe."""

    SIZE = "wing area or span"
    FLIGHT = "one flight of two airframes"
    INSTALLATION = "installation that returns"  # between its flights the probe was remounted, so its errors changed


class ContradictionResult(msgspec.Struct, frozen=True, kw_only=True):
    """A contradiction between two flights under one name, which a single airframe cannot explain."""

    kind: Contradiction
    airframe: str
    log: str
    earlier_log: str
    text: str


class ChangeResult(msgspec.Struct, frozen=True, kw_only=True):
    """A lasting change of an airframe from one flight on, in percent of its drag and thrust, with 95 % half widths."""

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
    """Drag and thrust from one flight alone, minus their mean before the first change, in percent.

    The 95 % half widths leave out the errors that all flights of the airframe share.
    """

    log: str
    start_unix_s: float
    drag_percent: float
    drag_half_width_percent: float
    thrust_percent: float
    thrust_half_width_percent: float


class FleetFlightResult(msgspec.Struct, frozen=True, kw_only=True):
    """One flight of an airframe. report : path of its page from the folder of the fleet's page; "" if there is none"""

    log: str
    start_unix_s: float | None
    report: str = ""


class AirframeResult(msgspec.Struct, frozen=True, kw_only=True):
    """An airframe in one configuration. Its curve comes from the `pooled_flights` flights since the last change."""

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
    kind: Kind = Kind.POWER_REQUIRED  # kind of the curve
    power_required: list[PowerPoint]  # points of the curve, whatever its kind
    trust: Trust  # as bad as the worst evidence
    evidence: list[Evidence]  # evidence against the pooled flights
    changes: list[ChangeResult]
    history: list[FlightShareResult] = []  # shares of its flights with a date, if there are three or more
    logs: list[FleetFlightResult] = []  # all its flights, by date


class FleetCurveResult(msgspec.Struct, frozen=True, kw_only=True):
    """Mean power of airframes with the same wing and propeller, and the power expected of one that has not flown yet.

    airframes : those in the mean     changed : those with a change; the mean has them only if fewer than three others
    remain
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
