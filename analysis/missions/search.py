"""Finds the sequence of pieces that makes the interval smallest in the time available, by an exchange algorithm.

Information about the sensor errors and about the polar adds up over the pieces of a flight. A piece's information is
what it adds to a short flight (`information.expected` with and without the piece). While time remains, the piece that
lowers the cost most for its duration is added; then single pieces are exchanged as long as that lowers the cost.
Finally the whole flight is computed once more.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from flightpower.analysis.maneuvers.find_level import find_runs
from flightpower.analysis.methods.assumed_values import missing_values
from flightpower.analysis.methods.settings import COMPARISON
from flightpower.analysis.missions.expected_aircraft import ExpectedAircraft
from flightpower.analysis.missions.information import (
    Covariances,
    Expected,
    Question,
    expected,
    question,
    sensor_errors,
)
from flightpower.analysis.missions.navigation import kept_in_place
from flightpower.analysis.missions.pieces import (
    Maneuver,
    Piece,
    PieceKind,
    Pilot,
    Run,
    Space,
    before,
    catalog,
    full_throttle,
    sequence,
    slowest_mps,
)
from flightpower.analysis.missions.plan_settings import MARGINS, PATH, SEARCH
from flightpower.analysis.missions.time_history import TimeHistory, fly
from flightpower.analysis.trajectory import dryden
from flightpower.analysis.trajectory.settings import SOLVER
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.units import FOOT_M, KNOT_MPS


@dataclass(frozen=True)
class Request:
    """A request for a plan. minutes: from standing to standing. wind_kt: W20, the wind at 20 ft.

    heading_deg : of the first leg; None if not given     wind_from_deg : clockwise from north; None if not given
    """

    minutes: float
    wind_kt: float
    space: Space
    pilot: Pilot
    question: str = "curve"
    earlier: Array | None = None  # (m, m) information of earlier flights about the sensor errors of the installation
    alpha_scale_sigma: float = COMPARISON.installation_sigma["alpha_scale"]
    heading_deg: float | None = None
    wind_from_deg: float | None = None

    @property
    def wind_from_leg_deg(self) -> float:
        """Wind direction, clockwise from the first leg, -180 to 180; PATH.wind_from_deg if it cannot be computed."""
        if self.heading_deg is None or self.wind_from_deg is None:
            return PATH.wind_from_deg
        return (self.wind_from_deg - self.heading_deg + 180) % 360 - 180

    @property
    def gust_mps(self) -> float:
        return max(SOLVER.least_gust_mps, 0.1 * self.wind_kt * KNOT_MPS)  # 0.1 W20 (MIL-F-8785C sec. 3.7.3.4)

    @property
    def wind_mps(self) -> float:
        """Mean wind [m/s] at the height of the flight."""
        higher = dryden.mean_wind_profile(self.space.height_m) / dryden.mean_wind_profile(20 * FOOT_M)
        return self.wind_kt * KNOT_MPS * float(higher)


class Contribution(NamedTuple):
    """One kind of piece in a plan: how often it is flown, its total time, and the worst half width without it [%]."""

    title: str
    times: int
    seconds: float
    worst_without: float


@dataclass(frozen=True)
class FlightPlan:
    """A plan. pieces, maneuvers: in order. half_widths: [%] at question.speeds. history: expected time history."""

    request: Request
    aircraft: ExpectedAircraft
    question: Question
    pieces: tuple[Piece, ...]
    maneuvers: tuple[Maneuver, ...]
    history: TimeHistory
    covariances: Covariances
    half_widths: Array
    contributions: tuple[Contribution, ...]
    worst_with_keys: float | None = None  # the worst half width if the aircraft file had all keys [%]
    worst_with_porpoising: float | None = None  # autopilot plans only: the worst with a pilot [%]

    @property
    def seconds(self) -> float:
        return float(self.history.starts_s[-1])

    @property
    def piece_seconds(self) -> list[float]:
        """Duration [s] of each piece in the plan, in the plan's wind."""
        return seconds_by_piece(self.pieces, self.history, self.aircraft)


def seconds_by_piece(pieces: Sequence[Piece], history: TimeHistory, aircraft: ExpectedAircraft) -> list[float]:
    """Return how long each piece takes [s] in the history of a whole plan."""
    ends = np.cumsum([len(before(aircraft)), *(len(piece.maneuvers) for piece in pieces)])
    return [float(seconds) for seconds in np.diff(history.starts_s[ends])]


class _Increment(NamedTuple):
    """What one piece adds. seconds: its duration. errors, polar: information. scores: of `AssumedErrors`."""

    seconds: float
    errors: Array
    polar: Array
    scores: Array


def plan_flight(
    aircraft: ExpectedAircraft, request: Request, progress: Callable[[str], None] = lambda _: None
) -> FlightPlan:
    """Find the plan. progress: called with the name of each step; for a long flight a step takes seconds.

    Raises InputError if the time is too short for any plan, or if no range of speeds is left to fly.
    """
    slow, fast = slowest_mps(aircraft, request.wind_kt), MARGINS.fastest * aircraft.fastest_mps
    if slow >= fast:
        raise InputError(
            f"{aircraft.aircraft.name}: the slowest speed that keeps a margin to the stall in {request.wind_kt:g} kt,"
            f" {slow:.1f} m/s, is not below the fastest that is planned, {fast:.1f} m/s; check stall speed, weight,"
            " propeller and motor"
        )
    objective = question(request.question, aircraft, slow, fast)
    kinds = aircraft, request.space, request.pilot, request.wind_kt
    pairs = _without_gentle_runs(catalog(*kinds), aircraft, request)
    last: tuple[Piece, ...] = (full_throttle(aircraft),) if aircraft.full_throttle else ()
    history = _history([*pairs[:1] * SEARCH.fewest_run_pairs, *last], aircraft, request)
    if _seconds_of(history) > request.minutes * 60:
        last = ()
        history = _history(pairs[:1] * SEARCH.fewest_run_pairs, aircraft, request)
    chosen = _ordered([*pairs[:1] * SEARCH.fewest_run_pairs, *last])
    left = request.minutes * 60 - _seconds_of(history)
    if left < 0:
        raise InputError(
            f"{request.minutes:g} minutes are too short: standing, take-off, {SEARCH.fewest_run_pairs} pairs of runs"
            f" and landing take {_seconds_of(history) / 60:.1f}"
        )
    # Leave room for as many other pieces as pairs; the turns of a piece take about as long as its straight part.
    others = catalog(*kinds, left / (2 * SEARCH.fewest_run_pairs))
    candidates = [*pairs, *(piece for piece in others if piece.kind is not PieceKind.RUNS)]
    pieces = [piece for piece in candidates if not (request.pilot.autopilot and piece.kind.manual_only)]
    base = _evaluated(chosen, aircraft, request)
    start = _covariances(base[0], request)
    every = []
    for number, piece in enumerate(candidates, start=1):
        progress(f"what each piece adds: {number} of {len(candidates)}")
        every.append(_increment(piece, pairs[0], last, base, aircraft=aircraft, request=request))
    increments = [increment for piece, increment in zip(candidates, every, strict=True) if piece in pieces]
    shortest_s = min(increment.seconds for increment in increments)
    room_s, base_s = left, _seconds_of(history)
    fits_s, exceeds_s = 0.0, inf
    for _ in range(8):  # among other pieces and kept over the field, a piece takes a different time than alone
        progress(f"a flight of {request.minutes:g} minutes from them")
        counts = _exchanged(increments, left, start, objective)
        alone_s = sum(n * increment.seconds for n, increment in zip(counts, increments, strict=True))
        planned = [piece for piece, n in zip(pieces, counts, strict=True) for _ in range(n)]
        tried = _ordered([*planned, *pairs[:1] * SEARCH.fewest_run_pairs, *last])
        flown = _history(tried, aircraft, request)
        taken_s = max(_seconds_of(flown) - base_s, 1.0)
        if taken_s > room_s:
            exceeds_s = min(exceeds_s, alone_s)
        else:
            fits_s = max(fits_s, left)
            if _seconds_of(flown) > _seconds_of(history):
                chosen, history = tried, flown
        if room_s - shortest_s < taken_s <= room_s or exceeds_s - fits_s < 1.0:
            break
        left = alone_s * room_s / taken_s
        if not fits_s < left < exceeds_s:
            left = (fits_s + exceeds_s) / 2 if isfinite(exceeds_s) else 2 * room_s
    manual_only = None
    if request.pilot.autopilot:
        manual_only = float(
            np.max(objective.half_widths(_with_pieces(start, every, _exchanged(every, left, start, objective))))
        )
    progress("its interval")

    def covariances_of(aircraft: ExpectedAircraft) -> Covariances:
        expected_errors = expected(history, aircraft, request.gust_mps, alpha_scale_sigma=request.alpha_scale_sigma)
        return _covariances(expected_errors, request)

    covariances, worst_with_keys = covariances_of(aircraft), None
    if missing := missing_values(aircraft.aircraft):
        keys = aircraft.aircraft.keys.union(value.key for value in missing)
        complete = replace(aircraft, aircraft=replace(aircraft.aircraft, keys=keys))
        worst_with_keys = float(np.max(objective.half_widths(covariances_of(complete))))
    seconds = seconds_by_piece(chosen, history, aircraft)
    contributions = _contributions(chosen, seconds, dict(zip(pieces, increments, strict=True)), covariances, objective)
    return FlightPlan(
        request=request,
        aircraft=aircraft,
        question=objective,
        pieces=tuple(chosen),
        maneuvers=tuple(_placed(chosen, aircraft, request)),
        history=history,
        covariances=covariances,
        half_widths=objective.half_widths(covariances),
        contributions=contributions,
        worst_with_keys=worst_with_keys,
        worst_with_porpoising=manual_only,
    )


def predicted(maneuvers: Sequence[Maneuver], aircraft: ExpectedAircraft, request: Request) -> Covariances:
    """Return the covariances after any sequence of maneuvers."""
    history = _flown(maneuvers, aircraft, request)
    expectation = expected(history, aircraft, request.gust_mps, alpha_scale_sigma=request.alpha_scale_sigma)
    return _covariances(expectation, request)


def _without_gentle_runs(pieces: list[Piece], aircraft: ExpectedAircraft, request: Request) -> list[Piece]:
    """Return the pairs of runs that the analysis would recognize as runs, or all pairs if it would recognize none. If
    motor or propeller table leave little thrust to accelerate, moving the throttle slowly is too gentle."""
    pairs = [piece for piece in pieces if piece.kind is PieceKind.RUNS]
    return [piece for piece in pairs if _taken_for_runs(piece, aircraft, request)] or pairs


def _taken_for_runs(piece: Piece, aircraft: ExpectedAircraft, request: Request) -> bool:
    history = _flown(piece.maneuvers, aircraft, request, airborne=True)
    runs, _ = find_runs(history.table, noise_mps=inf)
    middles_s = [
        (start_s + end_s) / 2
        for maneuver, start_s, end_s in zip(piece.maneuvers, history.starts_s, history.starts_s[1:], strict=False)
        if isinstance(maneuver, Run)
    ]
    return all(any(run.start_s <= middle_s <= run.end_s for run in runs) for middle_s in middles_s)


def _history(pieces: Sequence[Piece], aircraft: ExpectedAircraft, request: Request) -> TimeHistory:
    return _flown(_placed(pieces, aircraft, request), aircraft, request)


def _flown(
    maneuvers: Sequence[Maneuver], aircraft: ExpectedAircraft, request: Request, *, airborne: bool = False
) -> TimeHistory:
    height_m, from_deg = request.space.height_m, request.wind_from_leg_deg
    return fly(maneuvers, aircraft, height_m, request.wind_mps, wind_from_deg=from_deg, airborne=airborne)


def _placed(pieces: Sequence[Piece], aircraft: ExpectedAircraft, request: Request) -> list[Maneuver]:
    """Return the maneuvers as they are flown in the wind of the request."""
    from_deg = request.wind_from_leg_deg
    return kept_in_place(sequence(pieces, aircraft, from_deg), aircraft, request.space, request.wind_mps, from_deg)


def _seconds_of(history: TimeHistory) -> float:
    return float(len(history.table) * PATH.step_s)


def _by_itself(pieces: Sequence[Piece], aircraft: ExpectedAircraft, request: Request) -> TimeHistory:
    """Return a history not kept over the field, since a piece's information must not depend on where it begins."""
    return _flown(sequence(pieces, aircraft, request.wind_from_leg_deg), aircraft, request)


def _evaluated(pieces: Sequence[Piece], aircraft: ExpectedAircraft, request: Request) -> tuple[Expected, float]:
    history = _by_itself(pieces, aircraft, request)
    expectation = expected(history, aircraft, request.gust_mps, alpha_scale_sigma=request.alpha_scale_sigma)
    return expectation, _seconds_of(history)


def _covariances(expectation: Expected, request: Request) -> Covariances:
    covariances = expectation.covariances
    if request.earlier is None:
        return covariances
    return covariances._replace(errors=np.asarray(np.linalg.inv(np.linalg.inv(covariances.errors) + request.earlier)))


def _increment(
    piece: Piece,
    pair: Piece,
    last: Sequence[Piece],
    base: tuple[Expected, float],
    *,
    aircraft: ExpectedAircraft,
    request: Request,
) -> _Increment:
    """Return what one piece adds to a base flight, by the difference of two flights.

    base: expectation and time [s] of the base flight
    """
    alone, alone_s = base
    repeated = 2  # times that the piece is flown in the flight that gives its information
    planned = [*[pair] * SEARCH.fewest_run_pairs, *[piece] * repeated, *last]
    if piece.kind is PieceKind.RUNS:
        expectation, seconds = _evaluated(planned, aircraft, request)
        errors, polar = expectation.errors, _gain(expectation.noise, alone.noise) / repeated
        scores = expectation.assumed.scores
    else:
        history = _by_itself(planned, aircraft, request)
        errors, scores = sensor_errors(history, aircraft, request.gust_mps, alpha_scale_sigma=request.alpha_scale_sigma)
        seconds, polar = _seconds_of(history), np.zeros((3, 3))
    gained = (scores - alone.assumed.scores) / repeated
    return _Increment((seconds - alone_s) / repeated, _gain(errors, alone.errors) / repeated, polar, gained)


def _gain(after: Array, before: Array) -> Array:
    """Subtract information matrices; drop the difference's negative part, which comes from rounding and draws."""
    scale = np.sqrt(np.diag(before))
    gain = np.linalg.inv(after / np.outer(scale, scale)) - np.linalg.inv(before / np.outer(scale, scale))
    values, vectors = np.linalg.eigh((gain + gain.T) / 2)
    positive = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return np.asarray(positive / np.outer(scale, scale))


def _with_pieces(start: Covariances, increments: Sequence[_Increment], counts: Sequence[int]) -> Covariances:
    errors, polar, scores = np.linalg.inv(start.errors), np.linalg.inv(start.noise), start.assumed.scores
    for increment, n in zip(increments, counts, strict=True):
        errors, polar = errors + n * increment.errors, polar + n * increment.polar
        scores = scores + n * increment.scores
    assumed = start.assumed._replace(scores=scores)
    return start._replace(errors=np.linalg.inv(errors), noise=np.linalg.inv(polar), assumed=assumed)


def _exchanged(increments: Sequence[_Increment], left_s: float, start: Covariances, question: Question) -> list[int]:
    """Return how often each piece is flown."""
    counts = [0] * len(increments)

    def cost(counts: Sequence[int]) -> float:
        return question.cost(_with_pieces(start, increments, counts))

    def fits(counts: Sequence[int]) -> bool:
        return sum(n * increment.seconds for n, increment in zip(counts, increments, strict=True)) <= left_s

    def changed(*changes: tuple[int, int]) -> list[int]:
        new = counts.copy()
        for i, by in changes:
            new[i] += by
        return new

    now = cost(counts)
    while options := [new for i in range(len(counts)) if fits(new := changed((i, 1)))]:
        gains = [(cost(new), new) for new in options]
        best = min(gains, key=lambda gain: (gain[0] - now) / max(_seconds(gain[1], counts, increments), 1.0))
        if best[0] >= now:
            break
        now, counts = best
    for _ in range(60):
        swaps = [
            new
            for i, n in enumerate(counts)
            if n
            for j in range(len(counts))
            for k in (1, 2)
            if j != i and fits(new := changed((i, -1), (j, k)))
        ] + [new for j in range(len(counts)) if fits(new := changed((j, 1)))]
        costs = [(cost(new), new) for new in swaps]
        if not costs or min(costs)[0] >= now - 1e-4:
            break
        now, counts = min(costs)
    return counts


def _seconds(new: Sequence[int], old: Sequence[int], increments: Sequence[_Increment]) -> float:
    return sum((a - b) * increment.seconds for a, b, increment in zip(new, old, increments, strict=True))


def _ordered(pieces: Sequence[Piece]) -> list[Piece]:
    kinds = list(PieceKind)
    return sorted(pieces, key=lambda piece: (kinds.index(piece.kind), piece.title))


def _contributions(
    chosen: Sequence[Piece],
    seconds: Sequence[float],
    increments: Mapping[Piece, _Increment],
    covariances: Covariances,
    question: Question,
) -> tuple[Contribution, ...]:
    """List each kind of piece with the worst half width without it. seconds: duration of each chosen piece"""
    listed = []
    for piece, n in Counter(chosen).items():
        increment = increments.get(piece)
        if increment is None:
            continue
        taken_s = sum(one_s for other, one_s in zip(chosen, seconds, strict=True) if other == piece)
        without = covariances._replace(
            errors=_without_information(covariances.errors, n * increment.errors),
            noise=_without_information(covariances.noise, n * increment.polar),
            assumed=covariances.assumed._replace(scores=covariances.assumed.scores - n * increment.scores),
        )
        worst = float(np.max(question.half_widths(without)))
        listed.append(Contribution(piece.title, n, taken_s, worst))
    return tuple(listed)


def _without_information(covariance: Array, information: Array) -> Array:
    """Return the covariance after some information is removed."""
    root = np.linalg.cholesky(covariance)
    values, vectors = np.linalg.eigh(root.T @ information @ root)
    vectors = root @ vectors
    return np.asarray((vectors / np.maximum(1 - values, SEARCH.least_left)) @ vectors.T)
