"""The pieces of 20 to 100 s from which a flight plan is made, and their catalog for one aircraft, space and pilot.

Speeds are true airspeeds [m/s], angles in rad, times in s.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from math import ceil, copysign, cos, degrees, inf, pi, tan

from flightpower.analysis.missions.expected_aircraft import ExpectedAircraft
from flightpower.analysis.missions.plan_settings import MANEUVERS, MARGINS, PATH
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2

BANK_RAD, STEEP_BANK_RAD = MANEUVERS.banks_rad


@dataclass(frozen=True)
class Stand:
    """Stand still on the ground, motor off."""

    duration_s: float


@dataclass(frozen=True)
class TakeOff:
    """Take off and climb to the height of the flight."""

    speed_mps: float


@dataclass(frozen=True)
class Hold:
    """Hold height, heading and speed; the duration includes the change to this speed."""

    duration_s: float
    speed_mps: float


@dataclass(frozen=True)
class Turn:
    """A level turn at a bank and a speed, then wings level; angle positive to the right."""

    speed_mps: float
    angle_rad: float = pi
    bank_rad: float = BANK_RAD

    @property
    def width_m(self) -> float:
        """Width across the preceding flight path, in still air: two radii V^2/(g tan(bank))."""
        return 2 * self.speed_mps**2 / (GRAVITY_MPS2 * tan(self.bank_rad))


@dataclass(frozen=True)
class Run:
    """An acceleration or deceleration: the throttle moves to `throttle` over `ramp_s`, until `until_mps` is reached."""

    throttle: float
    ramp_s: float
    until_mps: float
    longest_s: float = 20.0


@dataclass(frozen=True)
class Porpoise:
    """Stick fore and aft about level flight: the load factor swings by `load` to each side of 1."""

    duration_s: float
    speed_mps: float
    load: float
    first_period_s: float = 1.8
    last_period_s: float = 1.3


@dataclass(frozen=True)
class Land:
    """Descend, approach, land."""

    speed_mps: float


Maneuver = Stand | TakeOff | Hold | Turn | Run | Porpoise | Land


@dataclass(frozen=True)
class Space:
    """Where the flight may go. leg_m: longest straight flight over the ground. height_m: height of the flight. side_m:
    room for turns on each side of the legs, in still air."""

    leg_m: float
    height_m: float
    side_m: float = inf


@dataclass(frozen=True)
class Pilot:
    """What the pilot or the autopilot can fly. load: largest deviation of the load factor from 1."""

    autopilot: bool
    load: float


class PieceKind(StrEnum):
    """Kinds of pieces, in the order of the flight: runs while the battery is full, full throttle last."""

    RUNS = "runs"
    CIRCUIT = "circuit"
    PORPOISE = "porpoise"
    CIRCLES = "circles"
    FULL_THROTTLE = "full throttle"

    @property
    def manual_only(self) -> bool:
        """Whether an autopilot's mission cannot express this kind."""
        return self is PieceKind.PORPOISE


@dataclass(frozen=True)
class Piece:
    """A piece of a plan. title: text for the card."""

    title: str
    maneuvers: tuple[Maneuver, ...]
    kind: PieceKind


def margin_over_stall(wind_kt: float) -> float:
    """Return the ratio to stall speed at the largest lift planned: ends of decelerations, turns, porpoising."""
    return MARGINS.slowest + MARGINS.slowest_per_kt * wind_kt


def slowest_mps(expected: ExpectedAircraft, wind_kt: float) -> float:
    """Return the slowest speed that is planned [m/s]."""
    return margin_over_stall(wind_kt) * expected.stall_mps


def before(expected: ExpectedAircraft) -> tuple[Maneuver, ...]:
    """Return the beginning of every flight. `kept_in_place` extends the hold upwind, where the first piece begins."""
    V = expected.cruise_mps
    return Stand(MANEUVERS.stand_s[0]), TakeOff(V), Hold(2.0, V), Turn(V)


def after(expected: ExpectedAircraft) -> tuple[Maneuver, ...]:
    """Return the end of every flight."""
    V = expected.cruise_mps
    return Turn(V), Land(V), Stand(MANEUVERS.stand_s[1])


def run_pairs(expected: ExpectedAircraft, space: Space, wind_kt: float) -> Iterator[Piece]:
    """Yield an acceleration and a deceleration, with a turn at the end; on two legs if one is too short for both."""
    slow, fast = slowest_mps(expected, wind_kt), MARGINS.fastest * expected.fastest_mps
    turn = Turn(expected.cruise_mps, pi, BANK_RAD)
    for ramp_s, settle_s, hold_s in ((13.0, 16.0, 5.0), (8.0, 10.0, 3.0)):
        up = Run(expected.acceleration_throttle, ramp_s, fast)
        down = Run(MANEUVERS.deceleration_throttle, MANEUVERS.deceleration_ramp_s, slow)
        settle = Hold(settle_s, MARGINS.hold * slow)
        one_leg_m = slow * settle_s + (slow + fast) / 2 * 38 + hold_s * fast
        rest = Hold(4.0, 1.3 * expected.stall_mps)
        if one_leg_m <= space.leg_m:
            legs: tuple[Maneuver, ...] = (settle, up, Hold(hold_s, fast), down, rest, turn)
        else:
            fast_turn = Turn(fast, pi, BANK_RAD)
            legs = (Hold(settle_s / 2, MARGINS.hold * slow), up, fast_turn, Hold(hold_s, fast), down, rest, turn)
        title = f"accelerate and decelerate, throttle over {ramp_s:.0f} s"
        yield Piece(title, legs, PieceKind.RUNS)


def circuits(expected: ExpectedAircraft, space: Space, wind_kt: float, longest_s: float = inf) -> Iterator[Piece]:
    """Yield a leg at one speed and a turn back at the same speed."""
    slow, stall, fastest = slowest_mps(expected, wind_kt), expected.stall_mps, expected.fastest_mps
    fast = MARGINS.fastest * fastest
    for V in (MARGINS.hold * slow, 1.3 * stall, 1.6 * stall, 0.77 * fastest, 0.85 * fastest, fast):
        if not MARGINS.hold * slow <= V <= fast:
            continue
        turn = Turn(max(V, _turning_mps(expected, BANK_RAD, wind_kt)), pi, BANK_RAD)
        seconds = min(max(min(space.leg_m / V, longest_s / 2), 8.0), 60.0)
        yield Piece(f"level at {V:.1f} m/s, there and back", 2 * (Hold(seconds, V), turn), PieceKind.CIRCUIT)


def circles(expected: ExpectedAircraft, wind_kt: float) -> Iterator[Piece]:
    """Yield two full circles at one speed."""
    fastest = expected.fastest_mps
    for bank in MANEUVERS.banks_rad:
        slowest = _turning_mps(expected, bank, wind_kt)
        for V in (slowest, 0.8 * fastest, MARGINS.fastest * fastest):
            if V >= slowest:
                title = f"two circles at {V:.1f} m/s, bank {bank * 180 / pi:.0f}°"
                yield Piece(title, (Hold(4.0, V), Turn(V, 4 * pi, bank)), PieceKind.CIRCLES)


def porpoising(
    expected: ExpectedAircraft, space: Space, pilot: Pilot, wind_kt: float, longest_s: float = inf
) -> Iterator[Piece]:
    """Yield porpoising, with the stick fore and aft along a leg, and a turn back."""
    stall, fast = expected.stall_mps, MARGINS.fastest * expected.fastest_mps
    for V in (1.5 * stall, 1.6 * stall, 1.75 * stall, 1.95 * stall, fast):
        if V < margin_over_stall(wind_kt) * (1 + pilot.load) ** 0.5 * stall or V > fast:
            continue
        for first, last in ((1.8, 1.3), (2.4, 1.8)):
            seconds = min(max(min(space.leg_m / V - 4.0, longest_s), 10.0), 75.0)
            turn = Turn(max(V, _turning_mps(expected, BANK_RAD, wind_kt)), pi, BANK_RAD)
            title = f"porpoise for {seconds:.0f} s at {V:.1f} m/s, {first:g} to {last:g} s a cycle"
            pieces = (Hold(4.0, V), Porpoise(seconds, V, pilot.load, first, last), turn)
            yield Piece(title, pieces, PieceKind.PORPOISE)


def full_throttle(expected: ExpectedAircraft) -> Piece:
    """Return one acceleration at full throttle, for power available, climb and ceiling."""
    run = Run(1.0, 1.0, 0.95 * expected.fastest_mps)
    hold = Hold(8.0, 1.3 * expected.stall_mps)
    return Piece("accelerate at full throttle", (hold, run), PieceKind.FULL_THROTTLE)


def catalog(
    expected: ExpectedAircraft, space: Space, pilot: Pilot, wind_kt: float, longest_s: float = inf
) -> list[Piece]:
    """Return all pieces that this pilot can fly here. longest_s: limit for level flight and porpoising.

    Raises InputError if there is no room for the turns.
    """
    pieces = [
        *run_pairs(expected, space, wind_kt),
        *circuits(expected, space, wind_kt, longest_s),
        *circles(expected, wind_kt),
        *porpoising(expected, space, pilot, wind_kt, longest_s),
    ]
    narrowest_mps = _turning_mps(expected, STEEP_BANK_RAD, wind_kt)
    affordable = [
        piece for piece in (_with_room(piece, narrowest_mps, space.side_m) for piece in pieces) if piece is not None
    ]
    if not any(piece.kind is PieceKind.RUNS for piece in affordable):
        raise InputError(
            f"--side {space.side_m:g}: too narrow for a turn of {expected.aircraft.name}; its narrowest, at"
            f" {narrowest_mps:.1f} m/s and a bank of {degrees(STEEP_BANK_RAD):.0f}°, needs"
            f" {ceil(Turn(narrowest_mps, pi, STEEP_BANK_RAD).width_m)} m"
        )
    return affordable


def _with_room(piece: Piece, narrowest_mps: float, side_m: float) -> Piece | None:
    """Return the piece with turns that fit: steeper, and if necessary slower. None if no turn fits, or if circles do
    not fit as they are: their speed and bank are their purpose."""
    maneuvers: list[Maneuver] = []
    for maneuver in piece.maneuvers:
        if isinstance(maneuver, Turn) and maneuver.width_m > side_m:
            steeper = replace(maneuver, speed_mps=max(maneuver.speed_mps, narrowest_mps), bank_rad=STEEP_BANK_RAD)
            maneuver = steeper if steeper.width_m <= side_m else replace(steeper, speed_mps=narrowest_mps)
            if maneuver.width_m > side_m or piece.kind is PieceKind.CIRCLES:
                return None
        maneuvers.append(maneuver)
    return replace(piece, maneuvers=tuple(maneuvers))


def sequence(
    pieces: Sequence[Piece], expected: ExpectedAircraft, wind_from_deg: float = PATH.wind_from_deg
) -> list[Maneuver]:
    """Return the whole plan from standing to standing; right and left turns alternate, so that all turn into the wind.

    wind_from_deg : clockwise from the first leg
    """
    side, plan = copysign(1.0, wind_from_deg), list[Maneuver]()
    of_pieces = [maneuver for piece in pieces for maneuver in piece.maneuvers]
    for maneuver in [*before(expected), *of_pieces, *after(expected)]:
        if isinstance(maneuver, Turn):
            maneuver = replace(maneuver, angle_rad=side * abs(maneuver.angle_rad))
            side = -side
        plan.append(maneuver)
    return plan


def _turning_mps(expected: ExpectedAircraft, bank_rad: float, wind_kt: float) -> float:
    """Return the slowest speed for a turn: 15 % above the speed that keeps the margin over the stall at this bank."""
    load = 1 / max(1e-3, cos(bank_rad))
    return float(load**0.5 * 1.15 * slowest_mps(expected, wind_kt))
