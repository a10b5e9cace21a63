"""A parameter of an autopilot in `results.json`."""

import msgspec


class AutopilotParameter(msgspec.Struct, frozen=True, kw_only=True):
    """A value to type into an autopilot, with its 95 % interval."""

    firmware: str
    name: str
    versions: str  # of the firmware that know this name
    value: float
    lo: float
    hi: float
    unit: str
    basis: str  # what it follows from
    logged: float | None  # as the log has it
