"""Drafts the map of a table's columns: quantities by name, units by name or by which values are possible.

For each quantity the best-named column is proposed. A quantity that contradicts others by a law is proposed in another
unit or with the other sign if that removes the contradiction, and is left out if nothing does.
"""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from flightpower.analysis.sources.column_map import ColumnMap, MappedColumn, mapped_channels
from flightpower.analysis.sources.laws import Finding, findings
from flightpower.analysis.sources.quantities import KINDS, Quantity
from flightpower.analysis.sources.recognize import autopilot_of
from flightpower.analysis.sources.recorders import known_columns, recorder_of
from flightpower.analysis.sources.table_file import Columns, read_table
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2 as g
from flightpower.flight.units import to_si

Q = Quantity

# Words that show that a name means another quantity: a set point, a servo's supply voltage, one cell, the time of day.
UNSPECIFIC = r"(?!.*\b(indicated|calibrated|equivalent|ground|demand|desired|target|set ?point|sp|error)\b)"
PROPULSION = r"(?!.*\b(cells?|servos?|[rt]x|receiver|bec|vcc|board|time|date|state|mode|limit|waypoint|wp|mission)\b)"
NO_PRESSURE = r"(?!.*\b(temp|temperature|alt|altitude|height|density)\b)"  # named by the port, the level or the air
VECTOR = r"(.*\.)?v(el|elocity)? {}"  # one component of a vector
CLIMB = r".*\bclimb( ?rate)?\b.*|vspd|vs|vario|.*\bvertical speed\b.*"  # rates that are positive up
# Patterns for a column's name, without a unit in brackets and in lower case, by quantity; earlier patterns are better
# names. Names with "nav vel", "acc smooth", "vbat" and "amperage" come from blackbox_decode (INAV).
NAMES: dict[Quantity, tuple[str, ...]] = {
    Q.TIME: (
        r"(^|.*[. ])(times?|timestamp|t|zeit)( s| sec| ms| us)?$",
        r"seconds?|.*\belapsed\b.*",
        r".*\b(time|clock)\b.*",
        r".*timestamp.*",
    ),
    Q.AIRCRAFT: (r"(ac|aircraft|vehicle|sys|system) ?(id|number)",),
    Q.TRUE_AIRSPEED: (
        r".*true air ?speed.*",
        r".*\btas\b.*",
        rf"{UNSPECIFIC}(.*[. ])?air ?speed( m ?ps)?( filt.*)?",
        r"v (m/s|m ?ps|kts?|kn|knots|km/?h|mph|fps)",
    ),
    Q.INDICATED_AIRSPEED: (r".*(indicated|calibrated|equivalent) air ?speed.*", r".*\b(ias|cas|eas)\b.*", r"aspd"),
    Q.DYNAMIC_PRESSURE: (r".*(dynamic|differential|impact) pressure.*", r".*\b(diff|dyn) p(ress)?\b.*", r".*\bqc\b.*"),
    Q.STATIC_PRESSURE: (
        r".*static pressure.*",
        r".*\bbaro(meter)? press.*",
        rf"{NO_PRESSURE}.*\b(p static|static|ps)\b.*",
        rf"{NO_PRESSURE}pressure.*",
    ),
    Q.HEIGHT: (
        r".*(baro|pressure) (alt|height).*",
        r".*\b(altitude|height|alt|hgt)\b.*",
        r"galt",
    ),
    Q.AIR_TEMPERATURE: (r".*(static|outside|air|ambient) (air )?temp.*", r".*\b(sat|oat)\b.*", r"temp(erature)?\b.*"),
    Q.ANGLE_OF_ATTACK: (r".*angle of attack.*", r".*\b(alpha|aoa)\b.*"),
    Q.SIDESLIP: (r".*(sideslip|side slip).*", r".*\b(beta|aos)\b.*"),
    Q.FORCE_FORWARD: (
        r".*(longitudinal|forward) (specific force|acc).*",
        r".*\b(ax|acc x|accel x|fx|acc ?body x|specific force x)\b.*",
        r"acc smooth 0",
    ),
    Q.FORCE_RIGHT: (
        r".*lateral (specific force|acc).*",
        r".*\b(ay|acc y|accel y|fy|specific force y)\b.*",
        r"acc smooth 1",
    ),
    Q.FORCE_DOWN: (
        r".*(upward|vertical|normal|down) (specific force|acc).*",
        r".*\b(az|acc z|accel z|fz|specific force z)\b.*",
        r"acc smooth 2",
    ),
    Q.ROLL_RATE: (r".*roll rate.*", r".*\b(gyro ?[px]|angular rate x)\b.*", r"(.*\.)?p( (rad|deg).*)?$"),
    Q.PITCH_RATE: (r".*pitch rate.*", r".*\b(gyro ?[qy]|angular rate y)\b.*", r"(.*\.)?q( (rad|deg).*)?$"),
    Q.YAW_RATE: (r".*yaw rate.*", r".*\b(gyro ?[rz]|angular rate z)\b.*", r"(.*\.)?r( (rad|deg).*)?$"),
    Q.ROLL: (r".*\b(roll|phi|bank)\b.*",),
    Q.PITCH: (r".*\b(pitch|theta|tht)\b.*",),
    Q.HEADING: (r".*\b(heading|yaw|psi)\b.*",),
    Q.VELOCITY_NORTH: (r".*\bv(el|elocity)? ?n(orth)?\b.*", r"nav vel 0", VECTOR.format("1")),
    Q.VELOCITY_EAST: (r".*\bv(el|elocity)? ?e(ast)?\b.*", r"nav vel 1", VECTOR.format("2")),
    Q.VELOCITY_DOWN: (r".*\bv(el|elocity)? ?d(own)?\b.*", r"nav vel 2", VECTOR.format("3"), CLIMB),
    Q.GROUND_SPEED: (r".*ground ?speed.*", r".*\b(gs|sog)\b.*", r"g ?spd|gps speed"),
    Q.COURSE: (r".*\b(course|track|cog)\b.*", r"hdg"),
    Q.LATITUDE: (r"(.* )?lat(itude)?( (deg|rad))?",),
    Q.LONGITUDE: (r"(.* )?(lon|lng|longitude)( (deg|rad))?",),
    Q.VOLTAGE: (rf"{PROPULSION}.*\bvolt(age)?s?\b.*", rf"{PROPULSION}.*\bbat(t|tery)? (m )?v\b.*", r"vbat\b.*|vfas"),
    Q.CURRENT: (rf"{PROPULSION}.*\b(current|amps?|ampere)\b.*", rf"{PROPULSION}(.* )?curr", r"amperage\b.*|i ?bat"),
    Q.POWER: (r".*\b(electrical|battery|elec) power\b.*",),
    Q.MOTOR_SPEED: (r".*\brpm\b.*", r".*(motor|prop(eller)?|rotor) (speed|revps).*"),
    Q.THRUST: (r".*\bthrust\b.*",),
    Q.THROTTLE: (r".*\bthrottle\b.*",),
}
# Names that are used for accelerations as well as gyros: they are accelerations if the vertical one shows gravity.
GRAVITY_NAMES = {Q.FORCE_FORWARD: "[gn] ?x", Q.FORCE_RIGHT: "[gn] ?y", Q.FORCE_DOWN: "[gn] ?z"}
# Units by the last word of a column's name.
SUFFIXES = {
    "mps": "m/s",
    "m/s": "m/s",
    "ms-1": "m/s",
    "kt": "knot",
    "kts": "knot",
    "knots": "knot",
    "kmh": "km/h",
    "km/h": "km/h",
    "mph": "mile/hour",
    "fps": "ft/s",
    "ft/s": "ft/s",
    "fpm": "ft/min",
    "ft/min": "ft/min",
    "pa": "Pa",
    "hpa": "hPa",
    "mbar": "mbar",
    "kpa": "kPa",
    "inhg": "inHg",
    "m": "m",
    "cm": "cm",
    "ft": "ft",
    "k": "K",
    "degc": "degC",
    "c": "degC",
    "degf": "degF",
    "rad": "rad",
    "deg": "deg",
    "radps": "rad/s",
    "rad/s": "rad/s",
    "degps": "deg/s",
    "deg/s": "deg/s",
    "dps": "deg/s",
    "mps2": "m/s^2",
    "m/s2": "m/s^2",
    "m/s/s": "m/s^2",
    "m/s^2": "m/s^2",
    "v": "V",
    "mv": "mV",
    "a": "A",
    "ma": "mA",
    "w": "W",
    "kw": "kW",
    "rpm": "rpm",
    "revps": "turn/s",
    "hz": "turn/s",
    "n": "N",
    "lbf": "lbf",
    "s": "s",
    "sec": "s",
    "ms": "ms",
    "us": "us",
    "ns": "ns",
    "percent": "percent",
    "%": "percent",
}
# Units in brackets: all suffixes, and units that count only in brackets. Some belong to quantities no method reads.
IN_BRACKETS = SUFFIXES | {
    "°": "deg", "@": "deg", "degrees": "deg", "°c": "degC", "@c": "degC", "°f": "degF", "f": "degF",
    "feet": "ft", "kn": "knot", "f/s": "ft/s", "cm/s": "cm/s", "mm/s": "mm/s",
    "°/s": "deg/s", "m/s²": "m/s^2", "g": "standard_gravity", "mm": "mm", "rev/s": "turn/s", "1/min": "rpm",
    "mah": "mA h", "ah": "A h", "wh": "W h", "db": "dB", "dbm": "dBm", "mw": "mW",
}  # fmt: skip
UNITS = {
    "s": ("s", "ms", "us", "ns"),
    "m/s": ("m/s", "knot", "km/h", "ft/s", "cm/s", "mm/s"),
    "Pa": ("Pa", "hPa", "kPa"),
    "m": ("m", "ft", "mm", "cm"),
    "K": ("K", "degC"),
    "rad": ("rad", "deg"),
    "rad/s": ("rad/s", "deg/s"),
    "m/s^2": ("m/s^2", "standard_gravity", "ft/s^2"),
    "V": ("V", "mV"),
    "A": ("A", "mA"),
    "W": ("W", "kW"),
    "turn/s": ("rpm", "turn/s", "rad/s"),
    "N": ("N", "lbf"),
    "dimensionless": ("dimensionless", "percent"),
}
UNITS_BY_NAME_ALONE = ("mbar", "inHg", "mile/hour", "ft/min", "degF")  # known by name, never found by values
ANGLES = (Q.ROLL, Q.PITCH, Q.HEADING, Q.COURSE, Q.ANGLE_OF_ATTACK, Q.SIDESLIP)
UNSIGNED = {Q.TRUE_AIRSPEED, Q.INDICATED_AIRSPEED, Q.DYNAMIC_PRESSURE, Q.STATIC_PRESSURE, Q.HEIGHT, Q.AIR_TEMPERATURE,
            Q.GROUND_SPEED, Q.VOLTAGE, Q.MOTOR_SPEED}  # fmt: skip
MOTION = {Q.TRUE_AIRSPEED, Q.INDICATED_AIRSPEED, Q.DYNAMIC_PRESSURE, Q.VELOCITY_NORTH, Q.GROUND_SPEED, Q.LATITUDE}
ALIKE = (
    (Q.ROLL_RATE, Q.PITCH_RATE, Q.YAW_RATE), (Q.ROLL, Q.PITCH, Q.HEADING),
    (Q.FORCE_FORWARD, Q.FORCE_RIGHT, Q.FORCE_DOWN), (Q.VELOCITY_NORTH, Q.VELOCITY_EAST, Q.VELOCITY_DOWN),
)  # fmt: skip


def draft(table: Path, output: Path | None = None) -> str:
    """Return the text of a map. Raises InputError if the table cannot be read, or none of its columns is a time."""
    if autopilot := autopilot_of(table):
        raise InputError(f"{table}: a log of {autopilot}, which needs no map of columns: analyze it as it is")
    columns, notes = read_table(table)
    proposed = proposal(table, columns, output or table)
    left_out: dict[Quantity, tuple[MappedColumn, str]] = {}
    tried = [proposed]
    while wrong := _findings(table, columns, proposed):
        corrected = _corrected_map(table, columns, proposed, wrong, tried)
        tried += [corrected] if corrected else []
        if corrected is not None:
            proposed = corrected
            continue
        suspect = _suspect(wrong)
        left_out[suspect] = (proposed.columns[suspect], wrong[0].text)
        proposed = replace(proposed, columns={q: note for q, note in proposed.columns.items() if q is not suspect})
    return _text(table, columns, proposed, left_out) + "".join(f"\n# {note}\n" for note in notes)


def proposal(table: Path, columns: Columns, path: Path) -> ColumnMap:
    """Propose a map from the known recorder that named the columns, or else from names and possible values.

    Raises InputError if no column is named as a time or runs like a clock.
    """
    mapped = _of_recorder(columns)
    if not mapped.keys() & MOTION:  # columns other than the recorder's may show motion
        mapped = _by_names(columns) | mapped
    if Q.TIME not in mapped and (name := _running_clock(columns)) is not None:
        unit = _unit_by_name(name, Q.TIME) or _unit_by_values(columns[name], Q.TIME) or "s"
        mapped = {Q.TIME: MappedColumn(name, unit)} | mapped
    if Q.TIME not in mapped:
        raise InputError(
            f"{table}: no column is named as a time, and none ascends as one; it has"
            f" {', '.join(columns) or 'no column of numbers or times'}: write the clock into a column called time_s"
        )
    return ColumnMap(path, mapped)


def _running_clock(columns: Columns) -> str | None:
    """Return the first column that rises throughout in similar steps; None if there is none."""
    for name, value in columns.items():
        step = np.diff(value[np.isfinite(value)])
        regular = len(step) and step.min() > 0 and np.percentile(step, 95) < 2 * np.median(step)
        if regular and _unit_by_values(value, Q.TIME) is not None:
            return name
    return None


def map_without_question(table: Path, columns: Columns) -> tuple[ColumnMap, str] | None:
    """Return a map that needs no review, because a known program named the columns, and that program's title.

    Returns None if the program is not known, its columns show no motion, or laws of motion contradict its names.
    """
    recorder = recorder_of(columns)
    mapped = _of_recorder(columns)
    if recorder is None or Q.TIME not in mapped or not mapped.keys() & MOTION:
        return None
    proposed = ColumnMap(table, mapped)
    try:
        return None if _findings(table, columns, proposed) else (proposed, recorder.title)
    except InputError:  # its times cannot be used
        return None


def _of_recorder(columns: Columns) -> dict[Quantity, MappedColumn]:
    """Map the columns that vary, by the known recorder that named them; empty if the recorder is not known."""
    recorder = recorder_of(columns)
    if recorder is None:
        return {}
    varying = [name for name, value in columns.items() if np.nanstd(value) > 0]
    recorder_columns = known_columns(recorder, varying)
    units = {
        quantity: column.unit or _unit_by_name(name, quantity) for quantity, (name, column) in recorder_columns.items()
    }
    return {
        quantity: MappedColumn(name, unit, -1.0 if column.opposite else 1.0)
        for quantity, (name, column) in recorder_columns.items()
        if (unit := units[quantity]) is not None
    }


def _by_names(columns: Columns) -> dict[Quantity, MappedColumn]:
    mapped_columns: dict[Quantity, MappedColumn] = {}
    taken: set[str] = set()
    gravity_shown = _shows_gravity(columns)
    for quantity, patterns in NAMES.items():
        if gravity_shown and quantity in GRAVITY_NAMES:
            patterns = (*patterns, GRAVITY_NAMES[quantity])
        named = (
            name
            for pattern in patterns
            for name in columns
            if name not in taken and _is_named(name, pattern, quantity) and np.nanstd(columns[name]) > 0
        )
        if quantity is Q.AIRCRAFT:
            named = (name for name in columns if re.fullmatch(NAMES[quantity][0], _words(name)))
        for name in named:
            unit = _unit_by_name(name, quantity) or _unit_by_values(columns[name], quantity)
            if unit is not None:
                climbing = quantity is Q.VELOCITY_DOWN and _is_named(name, CLIMB, quantity)
                mapped_columns[quantity] = MappedColumn(name, unit, -1.0 if climbing else 1.0, _offset(quantity, name))
                taken.add(name)
                break
    return _with_alike_angles(mapped_columns, columns)


def _shows_gravity(columns: Columns) -> bool:
    """Return whether the vertical column of GRAVITY_NAMES has a median near +1 g or -1 g, in g or in m/s^2."""
    named = [x for name, x in columns.items() if re.fullmatch(GRAVITY_NAMES[Q.FORCE_DOWN], _words(_plain(name)))]
    loads = [abs(float(np.nanmedian(x))) / size for x in named for size in (1.0, g)]
    return any(0.9 < load < 1.3 for load in loads)


def _with_alike_angles(mapped: dict[Quantity, MappedColumn], columns: Columns) -> dict[Quantity, MappedColumn]:
    """Put all angles without a unit in their names in degrees if one of them cannot be in radians.

    A logger writes all angles in one unit, and the values of small angles do not show which.
    """
    unnamed = [q for q in ANGLES if q in mapped and _unit_by_name(mapped[q].column, q) is None]
    if all(_may_be_radians(columns[mapped[q].column], q) for q in unnamed):
        return mapped
    return mapped | {q: replace(mapped[q], unit="deg") for q in unnamed}


def _may_be_radians(value: Array, quantity: Quantity) -> bool:
    """Return whether an angle's values are possible in radians.

    A direction beyond two pi is possible only if it got there without a jump, counted on through full circles.
    """
    finite = value[np.isfinite(value)]
    if quantity not in (Q.HEADING, Q.COURSE):
        kind = KINDS[quantity]
        return bool(np.mean((finite >= kind.least) & (finite <= kind.greatest)) > 0.95)
    within = np.abs(finite) <= 2 * np.pi
    return bool(np.mean(within) > 0.95 or (within[0] and np.max(np.abs(np.diff(finite))) < np.pi))


def _is_named(name: str, pattern: str, quantity: Quantity) -> bool:
    """Return whether a name, with or without its unit, fits the pattern, and a unit in brackets fits the quantity."""
    units = (*UNITS[KINDS[quantity].unit], *UNITS_BY_NAME_ALONE)
    unit = _in_brackets(name)
    if unit is not None and unit not in units:
        return False
    texts = [_plain(name), name]
    if unit is None and (stem := _without_suffix(name)) and _unit_by_name(name, quantity) is not None:
        texts.append(stem)
    return any(re.fullmatch(pattern, words) for text in texts for words in (_words(text), _words(text.lower())))


def _without_suffix(name: str) -> str:
    """Return a name without its last word; empty if it has only one."""
    return re.sub(r"[^A-Za-z0-9%/^]*[A-Za-z0-9%/^]+$", "", name)


def _words(name: str) -> str:
    split = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return re.sub(r"[^a-z0-9.%/^]+", " ", split.lower()).strip().removeprefix("data.")


BRACKET = re.compile(r"\s*[\[(]([^\])]*)[\])]\s*$")


def _in_brackets(name: str) -> str | None:
    """Return the unit in brackets at the end of a name; None if there is none, or it is unknown."""
    bracket = BRACKET.search(name)
    return IN_BRACKETS.get(bracket[1].strip().lower()) if bracket else None


def _plain(name: str) -> str:
    """Return a name without its unit in brackets."""
    return name if _in_brackets(name) is None else BRACKET.sub("", name)


def _unit_by_name(name: str, quantity: Quantity) -> str | None:
    """Return the unit in brackets, or else the unit that is the last word; None if neither suits the quantity."""
    unit = _in_brackets(name)
    if unit is None and not BRACKET.search(name):
        unit = SUFFIXES.get(re.split(r"[^a-z0-9%/^]+", name.lower())[-1])
    si = KINDS[quantity].unit
    return unit if unit in UNITS[si] or (unit in UNITS_BY_NAME_ALONE and _converts(unit, si)) else None


def _converts(unit: str, si: str) -> bool:
    try:
        to_si(f"1 {unit}", si, unit)
    except InputError:
        return False
    return True


def _unit_by_values(value: Array, quantity: Quantity) -> str | None:
    """Return the first unit in which nearly all values are possible, and a motor speed is not mostly below 5 rev/s."""
    kind = KINDS[quantity]
    if quantity is Q.TIME:
        step = np.diff(value[np.isfinite(value)])
        usual = float(np.median(step[step > 0])) if np.any(step > 0) else 0.0
        scales = zip(UNITS["s"], (1.0, 1e-3, 1e-6, 1e-9), strict=True)
        return next((unit for unit, scale in scales if 5e-4 < usual * scale < 5.0), None)
    for unit in UNITS[kind.unit]:
        si = MappedColumn("", unit).in_si(value, quantity, "draft")
        si = si[np.isfinite(si)]
        slow = quantity is Q.MOTOR_SPEED and np.percentile(si, 90) < 5.0
        if not slow and len(si) and np.mean((si >= kind.least) & (si <= kind.greatest)) > 0.95:
            return unit
    return None


def _offset(quantity: Quantity, name: str) -> str:
    """Return an offset of -1 g for a column that gives the load less 1 g, as some tables do; else nothing."""
    return f"{-g:.5f} m/s^2" if quantity is Q.FORCE_DOWN and re.search(r"less.?1.?g", name.lower()) else ""


def _findings(table: Path, columns: Columns, proposed: ColumnMap) -> list[Finding]:
    return findings(mapped_channels(table, columns, _without_aircraft(proposed)), proposed.named)


def _without_aircraft(proposed: ColumnMap) -> ColumnMap:
    return replace(proposed, columns={q: column for q, column in proposed.columns.items() if q is not Q.AIRCRAFT})


def _corrected_map(
    table: Path, columns: Columns, proposed: ColumnMap, wrong: list[Finding], tried: list[ColumnMap]
) -> ColumnMap | None:
    """Return the map with one change that leaves fewer contradictions; None if no change helps.

    An untried change that leaves as many, but not the one that it fixes, also helps: one mistake can hide another.
    """
    as_many = None
    for finding in wrong:
        best, fewest = None, len(wrong)
        for changed in _changes(proposed, finding):
            left = _findings(table, columns, changed)
            if len(left) < fewest:
                best, fewest = changed, len(left)
            is_mended = all(
                (other.mistake, other.quantities) != (finding.mistake, finding.quantities) for other in left
            )
            if as_many is None and len(left) == len(wrong) and is_mended and changed not in tried:
                as_many = changed
        if best is not None:
            return best
    return as_many


def _changes(proposed: ColumnMap, wrong: Finding) -> Iterator[ColumnMap]:
    """Yield maps with other units or signs for each quantity in the finding.

    A unit is changed for all quantities of the same sensor together, a sign for one quantity alone.
    """
    for quantity in wrong.quantities:
        if quantity not in proposed.columns:
            continue
        column = proposed.columns[quantity]
        alike = next((group for group in ALIKE if quantity in group), (quantity,))
        # The values of angles already decided their unit.
        fixed = KINDS[quantity].unit == "rad" or _unit_by_name(column.column, quantity) is not None
        for unit in (column.unit,) if fixed else UNITS[KINDS[quantity].unit]:
            entries = dict(proposed.columns)
            if unit != column.unit:
                entries |= {q: replace(entries[q], unit=unit) for q in alike if q in entries}
                yield replace(proposed, columns=dict(entries))
            if quantity not in UNSIGNED:
                entries[quantity] = replace(entries[quantity], factor=-entries[quantity].factor)
                yield replace(proposed, columns=entries)


def _suspect(wrong: list[Finding]) -> Quantity:
    """Return the quantity that is in most findings; among equals, the one that is needed least."""
    needed = [Q.TIME, Q.TRUE_AIRSPEED, Q.VOLTAGE, Q.CURRENT, Q.VELOCITY_NORTH, Q.VELOCITY_EAST, Q.HEIGHT, Q.THRUST]
    rank = {q: i for i, q in enumerate(needed)} | {Q.HEADING: len(needed) + 1}  # no method requires a heading
    count = {q: sum(q in finding.quantities for finding in wrong) for q in wrong[0].quantities}
    return max(count, key=lambda q: (count[q], rank.get(q, len(needed)), q))


def _text(
    table: Path, columns: Columns, proposed: ColumnMap, left_out: dict[Quantity, tuple[MappedColumn, str]]
) -> str:
    lines = [
        f"# Columns of {table.name}: look through units and signs. Every entry has column and unit; also factor (-1",
        '# reverses the sign), offset = "0 m/s", and delay = "0.3 s" of a value that is late.',
    ]
    for quantity, column in proposed.columns.items():
        lines += ["", f"# {KINDS[quantity].meaning}; {_range(columns[column.column])}", *_entry(quantity, column)]
    for quantity, (mapped, why) in left_out.items():
        lines += ["", f"# Left out: {why}.", *(f"# {line}" for line in _entry(quantity, mapped))]
    used = {column.column for column in proposed.columns.values()} | {column.column for column, _ in left_out.values()}
    if unused := [name for name in columns if name not in used]:
        lines += ["", f"# Not used: {', '.join(unused)}"]
    return "\n".join(lines) + "\n"


def _range(value: Array) -> str:
    low, middle, high = np.nanpercentile(value, (1, 50, 99))
    return f"from {low:.4g} to {high:.4g}, {middle:.4g} in the middle"


def _entry(quantity: Quantity, mapped_column: MappedColumn) -> list[str]:
    entry = [f"[{quantity}]", f'column = "{mapped_column.column}"', f'unit = "{mapped_column.unit}"']
    if mapped_column.factor != 1:
        entry.append(f"factor = {mapped_column.factor:g}")
    return [*entry, f'offset = "{mapped_column.offset}"'] if mapped_column.offset else entry
