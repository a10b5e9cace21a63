"""Describes messages that violate the log's format, and the likely mistake of the program that wrote them."""

import re
from dataclasses import dataclass

from flightpower.flight.messages import Status

AT_FIELD = re.compile(r" - at `\$\.(\w+)")
STATUS = re.compile(rb'"status"\s*:\s*("[^"]*"|[\w.-]+)')
NOT_A_NUMBER = re.compile(rb"[\s:\[,](-?Infinity|-?inf|NaN|nan)\b")


@dataclass
class Undecodable:
    """Messages of a topic that cannot be decoded: how many, the first one, and the decoder's reason for it."""

    first: bytes
    reason: str
    count: int = 0

    @property
    def mistake(self) -> str:
        """What is wrong with the first message, and what to write instead."""
        place = AT_FIELD.search(self.reason)
        field, reason = place[1] if place else "", self.reason.split(" - at ")[0]
        if field == "status":
            return f"status is {self._status()}; write one of {', '.join(Status)}"
        if not place and (match := NOT_A_NUMBER.search(self.first)):
            return f"{match[1].decode()} is not JSON; write null where nothing was measured"
        if field and reason.startswith("Expected `float") and reason.endswith("got `str`"):
            return f"{field} is a string; write a number without quotation marks"
        if field and reason.startswith("Expected `int") and reason.endswith("got `str`"):
            return f"{field} is a string; write an integer without quotation marks"
        if field and reason.startswith("Expected `int") and reason.endswith("got `float`"):
            return f"{field} has a fraction; write an integer"
        if reason.startswith("Expected `object"):
            return "a message is not a JSON object with the names of its fields"
        return f"{field}: {reason}" if field else reason

    def _status(self) -> str:
        match = STATUS.search(self.first)
        return match[1].decode(errors="replace") if match else "not text"
