"""The runs of a flight plan, from the `card.toml` that `flightpower plan` writes. Flown runs are ticked off."""

from pathlib import Path
from typing import Literal

import msgspec

from flightpower.flight.errors import InputError
from flightpower.flight.files import read_text

COVERED = 0.7  # needed share of the planned change of speed: pilots turn a little early, and smoothing cuts both ends


class PlannedRun(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An acceleration or deceleration that the plan requires a number of times."""

    kind: Literal["acceleration", "deceleration"]
    from_mps: float
    to_mps: float
    times: int = 1

    def flown_by(self, kind: str, first_mps: float, last_mps: float) -> bool:
        """Whether a run of that kind and those speeds matches this line."""
        low, high = sorted((self.from_mps, self.to_mps))
        shared = min(high, max(first_mps, last_mps)) - max(low, min(first_mps, last_mps))
        return kind == self.kind and shared >= COVERED * (high - low)


class CardFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The contents of a card."""

    run: list[PlannedRun]


class FlightCard:
    """The planned runs, and how often each was flown well."""

    def __init__(self, planned: list[PlannedRun]):
        self._planned = planned
        self._flown = [0] * len(planned)

    def tick_off(self, kind: str, first_mps: float, last_mps: float) -> bool:
        """Count a good run as the first planned run still to be flown that it covers. Returns whether there is one."""
        for i, planned in enumerate(self._planned):
            if self._flown[i] < planned.times and planned.flown_by(kind, first_mps, last_mps):
                self._flown[i] += 1
                return True
        return False

    @property
    def text(self) -> str:
        """How many runs are flown and which is next, for the pilot; at most 50 characters."""
        done, all_ = sum(self._flown), sum(planned.times for planned in self._planned)
        left = zip(self._planned, self._flown, strict=True)
        following = next((planned for planned, flown in left if flown < planned.times), None)
        if following is None:
            return f"card: all {all_} runs flown"
        return f"card: {done} of {all_}, next {following.kind} to {following.to_mps:.1f} m/s"

    @property
    def lines(self) -> list[str]:
        """One line for each kind of run, for the status page."""
        return [
            f"{flown} of {planned.times}: {planned.kind} {planned.from_mps:.1f} to {planned.to_mps:.1f} m/s"
            for planned, flown in zip(self._planned, self._flown, strict=True)
        ]


def load_card(path: str) -> FlightCard:
    """Load a card. Raises InputError naming the file if it cannot be read, or is no card."""
    try:
        return FlightCard(msgspec.toml.decode(read_text(Path(path)), type=CardFile).run)
    except msgspec.MsgspecError as error:
        raise InputError(f"{path}: no card of `flightpower plan` ({error})") from None
