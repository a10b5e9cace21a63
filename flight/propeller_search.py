"""Finds propeller tables by words and size, and estimates the error of using a computed table or one of another size.

The header of a table describes the propeller: `# series = APC thin electric`, `# origin = measured`, `# published = …`,
`# pitch_m = …`, `# blades = 2`. Both errors are estimated from the tables themselves, by comparing thrusts at the same
airspeed and speed of rotation.
"""

import math
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import permutations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.propeller import J_REFERENCE, Origin, Propeller
from flightpower.flight.propeller_files import INCH_M, LARGEST_INCHES, UIUC_NAME, load_propeller
from flightpower.flight.shipped_propellers import shipped_propellers

# Tables are compared between the J at which the propeller's efficiency is this share of its best and the J of its best:
# in climbs and level flight. Closer to zero thrust a relative difference has no meaning.
SHARE_OF_BEST_EFFICIENCY = 0.7
# Two tables are compared if the logarithms of their diameters and pitches differ by no more than this: the requested
# size is rarely further from the nearest table, and within it thrust is nearly a product of powers of the two.
COMPARED_WITHIN = 0.3
LEAST_RATIO = 0.05  # lower limit of ratios: the logarithm of a smaller ratio would dominate
FEWEST_TABLES = 8  # needed for a comparison that estimates two elasticities and a scatter
SAME_SIZE_IN = 0.05  # UIUC and APC round sizes to 0.1 in
SIZE = re.compile(r"(\d+(?:\.\d+)?)x(\d+(?:\.\d+)?)(.*)", re.IGNORECASE)
# 10x5E, 13x8E-3 (three blades), 4.1x4.1E-B4, 10x5(F2B), 15x11(WCAR-T6): the text in parentheses does not count blades.
APC_SIZE = re.compile(r"\s*(\d+(?:\.\d+)?)x(\d+(?:\.\d+)?)((?:\([^)\n]*\)|[^\s(])*)")
APC_BLADES = re.compile(r"-B?([2-6])$", re.IGNORECASE)


@dataclass(frozen=True)
class Table:
    """A propeller's table with the data of its header. pitch_in [in], blades : None if the header lacks it."""

    name: str
    propeller: Propeller
    series: str = ""
    origin: Origin = Origin.UNKNOWN
    published: str = ""
    pitch_in: float | None = None
    blades: int | None = None

    @property
    def diameter_in(self) -> float:
        return float(self.propeller.diameter_m / INCH_M)

    @property
    def size(self) -> str:
        return f"{self.diameter_in:.4g}x{'?' if self.pitch_in is None else f'{self.pitch_in:.4g}'}"

    @property
    def rpm(self) -> tuple[float, float]:
        """The least and largest speed of rotation [1/min]."""
        return self.propeller.rows[0].rpm, self.propeller.rows[-1].rpm

    @property
    def J(self) -> tuple[float, float]:
        """The least and largest advance ratio of any speed of rotation."""
        rows = self.propeller.rows
        return min(row.J[0] for row in rows), max(row.J[-1] for row in rows)

    @property
    def search_text(self) -> str:
        """The text in which the words of a query are searched."""
        return f"{self.name} {self.series} {self.published} {self.origin.value}".lower()

    def to_csv(self) -> str:
        """Return the table with its head in our own format, readable by `flight.propeller_files` and this module."""
        facts = {"series": self.series, "published": self.published, "blades": self.blades}
        pitch = {} if self.pitch_in is None else {"pitch_m": f"{self.pitch_in * INCH_M:.6g}"}
        head = {"origin": self.origin.value, **{key: value for key, value in facts.items() if value}, **pitch}
        text = [line for line in self.propeller.source.splitlines() if line.partition(" = ")[0] not in head]
        lines = [*text, *(f"{key} = {value}" for key, value in head.items())]
        p = self.propeller
        return Propeller(p.name, p.diameter_m, p.rows, "\n".join(lines)).to_csv()


class Query(NamedTuple):
    """A search request. words : all of them must be in a table's name, series or publication."""

    words: tuple[str, ...] = ()
    diameter_in: float | None = None
    pitch_in: float | None = None


@dataclass(frozen=True)
class Cost:
    """How far thrust and power may be from those of a table, at the same airspeed and speed of rotation.

    J : least and largest advance ratio compared       compared : number of propellers or pairs compared
    thrust, power : least and largest relative difference there (-0.2: 20 % less than the table's)
    thrust_scale, thrust_slope : standard deviations for [uncertainty] of the aircraft file
    per_inch : relative change of thrust with an inch of diameter and of pitch; None for a table of the size itself
    """

    table: str
    J: tuple[float, float]
    compared: int
    thrust: tuple[float, float]
    power: tuple[float, float]
    thrust_scale: float
    thrust_slope: float
    per_inch: tuple[float, float] | None = None


def parse_query(words: Iterable[str]) -> Query:
    """Make a query from words such as 11x5.5, graupner, 11 (inches). Raises InputError for a second or absurd size."""
    query = Query()
    for word in words:
        sized = SIZE.fullmatch(word)
        if sized or re.fullmatch(r"\d+(?:\.\d+)?", word):
            if query.diameter_in is not None:
                raise InputError(f"{word}: a size was given before; one size, such as 11x7, or one diameter")
            diameter, pitch = (float(sized[1]), float(sized[2])) if sized else (float(word), None)
            if not 0 < diameter <= LARGEST_INCHES or (pitch is not None and not 0 < pitch <= LARGEST_INCHES):
                raise InputError(
                    f"{word}: sizes are in inches, up to {LARGEST_INCHES:g}, such as 11x7; an inch is 25.4 mm"
                )
            query = query._replace(diameter_in=diameter, pitch_in=pitch)
            if sized and sized[3]:  # 11x7E
                query = query._replace(words=(*query.words, word))
        else:
            query = query._replace(words=(*query.words, word))
    return query


def shipped_tables() -> list[Table]:
    """The tables that come with the package."""
    return [described(name, load_propeller(name)) for name in shipped_propellers()]


def described(name: str, propeller: Propeller) -> Table:
    """A table with the data of the lines `key = value` in its head. Raises InputError if one is not understood."""
    head = propeller.head
    try:
        return Table(
            name,
            propeller,
            head.get("series", ""),
            Origin(head.get("origin", Origin.UNKNOWN)),
            head.get("published", ""),
            float(head["pitch_m"]) / INCH_M if "pitch_m" in head else None,
            int(head["blades"]) if "blades" in head else None,
        )
    except ValueError as error:
        raise InputError(f"propeller {name}: its head is not understood ({error})") from None


def tables_in(folder: Path) -> tuple[list[Table], list[str]]:
    """The tables in a folder and its subfolders, UIUC's, APC's and our own, and the files that could not be read.

    Raises InputError if there is no such folder, or no table in it.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no folder")
    tables, problems = [], []
    seen = set()
    for path in sorted(folder.rglob("*")):
        named = UIUC_NAME.fullmatch(path.name)
        if named and (path.parent, named["name"]) in seen:
            continue
        try:
            if named and re.search(r"_\d{3,5}$", named["test"]):
                seen.add((path.parent, named["name"]))
                tables.append(_of_uiuc(named["name"], load_propeller(path)))
            elif re.fullmatch(r"PER3_.+\.dat", path.name, re.IGNORECASE):
                tables.append(_of_apc(path))
            elif path.suffix == ".csv":
                tables.append(described(str(path), load_propeller(path)))
        except InputError as error:
            problems.append(str(error))
    if not tables:
        why = f" ({problems[0]})" if problems else "; UIUC's are named apce_10x5_kt0821_5000.txt, APC's PER3_10x5E.dat"
        raise InputError(f"{folder}: no propeller table that can be read{why}")
    return tables, problems


def _of_uiuc(name: str, propeller: Propeller) -> Table:
    series, _, size = name.rpartition("_")
    match = SIZE.match(size)
    pitch_in = float(match[2]) if match else None
    if pitch_in and pitch_in > LARGEST_INCHES:  # in millimeters, and so is the diameter
        pitch_in /= 1000 * INCH_M
    return Table(name, propeller, series, Origin.MEASURED, f"UIUC, {name}", pitch_in)


def _of_apc(path: Path) -> Table:
    propeller = load_propeller(path)
    size = APC_SIZE.match(path.read_text("utf-8-sig", errors="replace"))
    table = Table(f"apc-{path.stem[5:].lower()}-computed", propeller, "APC", Origin.COMPUTED, f"APC, {path.name}")
    if size is None:
        return table
    blades = APC_BLADES.search(re.sub(r"\(.*?\)", "", size[3]))
    return replace(table, pitch_in=float(size[2]), blades=int(blades[1]) if blades else 2)


def matching(tables: Iterable[Table], query: Query) -> list[Table]:
    """The tables that have all words and the size of the query, sorted by size, and measured tables first."""
    order = list(Origin)
    matches = [table for table in with_words(tables, query) if has_size(table, query)]
    return sorted(
        matches,
        key=lambda table: (round(table.diameter_in, 2), table.pitch_in or 0.0, order.index(table.origin), table.name),
    )


def with_words(tables: Iterable[Table], query: Query) -> list[Table]:
    """The tables whose name, series or publication has all words of the query."""
    words = [word.lower() for word in query.words]
    return [table for table in tables if all(word in table.search_text for word in words)]


def has_size(table: Table, query: Query) -> bool:
    pairs = ((query.diameter_in, table.diameter_in), (query.pitch_in, table.pitch_in))
    return all(wanted is None or (is_ is not None and abs(wanted - is_) < SAME_SIZE_IN) for wanted, is_ in pairs)


def nearest(tables: Iterable[Table], query: Query, count: int = 3) -> list[Table]:
    """The tables nearest in the ratios of diameter and pitch, and the nearest measured table. Tables with the query's
    words are preferred.

    Computed tables count if the same propeller was not measured; assumed tables never count.
    query : with diameter and pitch
    """
    sized = [table for table in tables if table.pitch_in is not None]
    measured = {(table.series, table.size) for table in sized if table.origin is Origin.MEASURED}
    usable = [
        table
        for table in sized
        if table.origin is Origin.MEASURED
        or (table.origin is Origin.COMPUTED and (table.series, table.size) not in measured)
    ]
    candidates = with_words(usable, _without_sizes(query)) or usable
    candidates.sort(key=lambda candidate: float(np.hypot(*_step(candidate, query))))
    of_measured = [candidate for candidate in candidates if candidate.origin is Origin.MEASURED][:1]
    return candidates[:count] + [table for table in of_measured if table not in candidates[:count]]


def _without_sizes(query: Query) -> Query:
    """The query without words that are themselves sizes (11x7E)."""
    return query._replace(words=tuple(word for word in query.words if not SIZE.fullmatch(word)))


def _log_size(table: Table | Query) -> Array:
    return np.log([table.diameter_in or math.nan, table.pitch_in or math.nan])


def _step(table: Table, query: Query) -> Array:
    """Logarithms of the ratios of the query's diameter and pitch to the table's, (2,)."""
    return _log_size(query) - _log_size(table)


def cost_of(base: Table, query: Query, tables: Sequence[Table], J: tuple[float, float] | None = None) -> Cost:
    """The error of using `base` for the query's propeller, due to another size or make, and to a computed table.

    query : with diameter and pitch      J : advance ratios of the flight; by default those of a climb and level flight
    Raises InputError if there are no tables from which to estimate it.
    """
    costs = []
    if not has_size(base, query) or not with_words([base], query):
        costs.append(_cost_of_size(base, query, tables, J))
    if base.origin is not Origin.MEASURED:
        costs.append(_cost_of_computed(base, tables, J))
    usual = Uncertainty()  # error of a table of the very propeller flown
    return Cost(
        base.name,
        J or flight_J(base),
        min((cost.compared for cost in costs), default=0),
        _combined_ranges([cost.thrust for cost in costs]),
        _combined_ranges([cost.power for cost in costs]),
        math.hypot(usual.thrust_scale_fraction, *(cost.thrust_scale for cost in costs)),
        math.hypot(usual.thrust_slope, *(cost.thrust_slope for cost in costs)),
        costs[0].per_inch if costs else None,
    )


@cache
def computed_table_error() -> tuple[float, float]:
    """Standard deviations of scale and slope of the true thrust relative to a computed table, from the shipped
    propellers that were both measured and computed. They include the usual error of a table of the very propeller
    flown."""
    tables, usual = shipped_tables(), Uncertainty()
    computed = _cost_of_computed(next(table for table in tables if table.origin is Origin.COMPUTED), tables, None)
    return (
        math.hypot(usual.thrust_scale_fraction, computed.thrust_scale),
        math.hypot(usual.thrust_slope, computed.thrust_slope),
    )


def with_table_error(uncertainty: Uncertainty, keys: Collection[str], propeller: Propeller) -> tuple[Uncertainty, str]:
    """The uncertainty of a table's thrust before a flight, and a sentence if it differs from the usual one: a computed
    table is less certain, unless the aircraft file states it.

    uncertainty : of the aircraft file     keys : the keys that this file has ("uncertainty.thrust_scale")
    """
    silent = [key for key in ("thrust_scale", "thrust_slope") if f"uncertainty.{key}" not in keys]
    if propeller.origin is not Origin.COMPUTED or not silent:
        return uncertainty, ""
    scale, slope = computed_table_error()
    if "thrust_scale" in silent:
        uncertainty = replace(uncertainty, thrust_scale_fraction=scale)
    if "thrust_slope" in silent:
        uncertainty = replace(uncertainty, thrust_slope=slope)
    return uncertainty, (
        f"The table of the propeller {propeller.name} was computed, not measured: its thrust is taken to be uncertain"
        f" by {100 * uncertainty.thrust_scale_fraction:.0f} % and its slope by {uncertainty.thrust_slope:.2f}, as for"
        " other propellers that were both computed and measured. A measured table, or `calibrate thrust`, narrows the"
        " interval; or enter thrust_scale and thrust_slope in [uncertainty]."
    )


def _combined_ranges(ranges: list[tuple[float, float]]) -> tuple[float, float]:
    """Combine the ranges of several relative differences: their lower ends, and their upper ends."""
    low, high = (math.prod(1 + ends[end] for ends in ranges) - 1 for end in (0, 1))
    return low, high


def _cost_of_size(base: Table, query: Query, tables: Sequence[Table], J: tuple[float, float] | None) -> Cost:
    """Fit thrust as powers of diameter and pitch to all pairs of measured tables of nearly one size.

    The residual is the scatter between propellers of one size. If there are enough pairs of the series that the query
    names, only these are used.
    """
    measured = [
        table for table in tables if table.origin is Origin.MEASURED and table.pitch_in and table.blades in (None, 2)
    ]
    pairs = _pairs(with_words(measured, _without_sizes(query)), J)
    if len({pair.table_name for pair in pairs}) < FEWEST_TABLES:
        pairs = _pairs(measured, J)
    compared = len({pair.table_name for pair in pairs})
    if compared < FEWEST_TABLES:
        raise InputError(f"{base.name}: too few measured tables to compare at these advance ratios")
    steps, ratios = np.array([pair.step for pair in pairs]), np.array([pair.ratios for pair in pairs])
    elasticities, *_ = np.linalg.lstsq(steps, ratios, rcond=None)
    # Pairs share tables: the independent differences number one less than the tables, and the fit uses up two.
    scatter = np.sqrt(((ratios - steps @ elasticities) ** 2).mean(axis=0) * (compared - 1) / (compared - 3))
    step = _step(base, query)
    leverage = step @ np.linalg.solve(steps.T @ steps / len(pairs), step) / (compared - 1)
    expected, sigma = step @ elasticities, scatter * math.sqrt(1 + leverage)
    scale, slope = np.hypot(expected, sigma)[:2]  # error of an uncorrected table
    least, most = np.expm1(expected - 2 * sigma), np.expm1(expected + 2 * sigma)  # 95 %
    per_inch = np.expm1(elasticities[:, 2] * np.log1p(1 / np.exp(_log_size(base))))
    return Cost(
        base.name,
        J or flight_J(base),
        compared,
        (float(least[2]), float(most[2])),
        (float(least[3]), float(most[3])),
        math.expm1(scale),
        float(slope),
        (float(per_inch[0]), float(per_inch[1])),
    )


class Pair(NamedTuple):
    """Two tables of nearly one size: their step in size (logarithms), and how thrust and power differ (`_ratios`)."""

    table_name: str
    step: Array
    ratios: Array


def _pairs(tables: Iterable[Table], J: tuple[float, float] | None) -> list[Pair]:
    """All ordered pairs of tables of nearly one size."""
    pairs = []
    for table, other in permutations(tables, 2):
        step = _log_size(other) - _log_size(table)
        if np.hypot(*step) <= COMPARED_WITHIN:
            J_range = J or flight_J(table)
            ratios = _ratios(*_log_ratios(table, other, J_range), J_range)
            if ratios is not None:
                pairs.append(Pair(table.name, step, ratios))
    return pairs


def _cost_of_computed(base: Table, tables: Sequence[Table], J: tuple[float, float] | None) -> Cost:
    """How far measured tables are from computed tables of the same propeller: the widest range over all pairs."""
    compared, thrust, power = [], [], []
    for computed, measured in permutations(tables, 2):
        same = computed.series == measured.series and computed.size == measured.size
        if not same or computed.origin is not Origin.COMPUTED or measured.origin is not Origin.MEASURED:
            continue
        J_range = J or flight_J(computed)
        of_thrust, of_power = _log_ratios(computed, measured, J_range)
        ratios = _ratios(of_thrust, of_power, J_range)
        if ratios is not None:
            compared.append(ratios)
            thrust.append(of_thrust)
            power.append(of_power)
    if not compared:
        raise InputError(f"{base.name}: no propeller both measured and computed at these advance ratios")
    scale, slope = np.sqrt(np.mean(np.square(compared), axis=0))[:2]
    ranges = [(math.expm1(np.min(ends)), math.expm1(np.max(ends))) for ends in (thrust, power)]
    return Cost(base.name, J or flight_J(base), len(compared), ranges[0], ranges[1], math.expm1(scale), float(slope))


@cache
def flight_J(table: Table) -> tuple[float, float]:
    """Advance ratios of a climb and of level flight, from the table's efficiency J cT/cP, averaged over its speeds."""
    J = np.linspace(0.02, table.J[1], 101)
    efficiency = np.zeros(J.shape)
    for row in table.propeller.rows:
        cT, cP = table.propeller.table(J, np.full(J.shape, row.rpm))
        efficiency += J * np.where(cP > 0, cT, 0) / np.where(cP > 0, cP, 1) / len(table.propeller.rows)
    best = int(efficiency.argmax())
    first = int(np.argmax(efficiency >= SHARE_OF_BEST_EFFICIENCY * efficiency[best]))
    return float(J[first]), float(J[best])


def _log_ratios(table: Table, other: Table, J: tuple[float, float]) -> tuple[Array, Array]:
    """Logarithms of the ratios of `other`'s thrust and power to `table`'s at one airspeed and speed of rotation, (3,
    21).

    They are given at three speeds of rotation that both tables have (or between their ranges), and at advance ratios J
    of `table`; NaN where `table` has no thrust or absorbs no power.
    """
    low, high = max(table.rpm[0], other.rpm[0]), min(table.rpm[1], other.rpm[1])
    if low > high:
        low = high = (low + high) / 2
    advance, rpm = np.broadcast_arrays(np.linspace(*J, 21), np.linspace(low, high, 3)[:, None])
    smaller = table.propeller.diameter_m / other.propeller.diameter_m
    of_one = table.propeller.table(advance, rpm)
    cT, cP = other.propeller.table(advance * smaller, rpm)
    pairs = ((cT / smaller**4, of_one[0]), (cP / smaller**5, of_one[1]))
    with np.errstate(invalid="ignore", divide="ignore"):
        thrust, power = (np.log(np.maximum(a / np.where(b > 0, b, np.nan), LEAST_RATIO)) for a, b in pairs)
    return thrust, power


def _ratios(thrust: Array, power: Array, J: tuple[float, float]) -> Array | None:
    """Log of the thrust ratio at J_REFERENCE, its slope over J, its mean, and the mean log of the power ratio, (4,).

    None if a ratio does not exist, as when the first table has no thrust.
    """
    if not (np.isfinite(thrust).all() and np.isfinite(power).all()):
        return None
    advance = np.broadcast_to(np.linspace(*J, thrust.shape[-1]), thrust.shape).ravel()
    scale, slope = np.polynomial.polynomial.polyfit(advance - J_REFERENCE, thrust.ravel(), 1)
    return np.array([scale, slope, thrust.mean(), power.mean()])
