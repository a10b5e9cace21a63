"""The file of maneuvers, `runs.toml`: written with every analysis, edited by the user, read with `--runs`."""

import math
import tomllib
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.maneuvers import quality
from flightpower.analysis.maneuvers.find import find
from flightpower.analysis.maneuvers.kinds import (
    CONTEXT_KINDS,
    FOR_DRAG,
    KINDS,
    LEVEL_RUNS,
    Maneuver,
    Maneuvers,
    RejectedManeuver,
    Unsuitable,
    maneuver_in,
    reason_in_words,
)
from flightpower.analysis.maneuvers.quality import smooth
from flightpower.analysis.maneuvers.settings import FLIGHT
from flightpower.analysis.records.flight import MethodTried
from flightpower.analysis.sources.daemon import COLUMNS, speed_scale_of
from flightpower.flight.errors import InputError
from flightpower.flight.files import read_text
from flightpower.flight.runs import LEVEL_RUN, Rejection, RunRejected, flying_Pa
from flightpower.flight.units import read_table

HEAD = """\
# Maneuvers found in {log}. Edit this file and run: analyze {log} --runs {name}
# In a folder of several logs: edit it, and give the same command as before.
#
# keep = false leaves a maneuver out; keep = true takes one that was rejected. Start and end count from the beginning of
# the log and may be moved. The kind may be changed: {kinds}.
# Further [[run]] tables may be added. Lines that begin with # are remarks.
"""
LEFT_OUT = Rejection(Unsuitable.LEFT_OUT)


class NoCurve(InputError):
    """Raised if no maneuver of a log gives a curve. maneuvers: those found, and rejected stretches with reasons; tried:
    the methods that were applied to the maneuvers, the best first.
    """

    def __init__(self, text: str, maneuvers: Maneuvers, tried: Sequence[MethodTried] = ()):
        super().__init__(text)
        self.maneuvers, self.tried = maneuvers, tried


@dataclass(frozen=True, kw_only=True)
class ManeuverEntry:
    """One [[run]] of the file."""

    kind: str
    start_s: float
    end_s: float
    keep: bool = True


class Block(NamedTuple):
    """One [[run]] of the file as text; run: name of the maneuver, empty for a rejected stretch."""

    run: str
    text: str


def blocks(maneuvers: Maneuvers, left_out: Collection[str] = ()) -> list[Block]:
    """The maneuvers of a flight and the rejected stretches in order of time. left_out: maneuvers not to keep."""
    everything: list[Maneuver | RejectedManeuver] = sorted([*maneuvers.maneuvers, *maneuvers.rejected], key=_start)
    return [_block(stretch, left_out) for stretch in everything]


def _block(stretch: Maneuver | RejectedManeuver, left_out: Collection[str]) -> Block:
    if isinstance(stretch, Maneuver):
        run, remarks = stretch.name, stretch.notes
    else:
        run, remarks = "", (f"rejected: {stretch.reason}",)
    entry = ManeuverEntry(
        kind=stretch.kind, start_s=stretch.start_s, end_s=stretch.end_s, keep=bool(run) and run not in left_out
    )
    return Block(run, entry_text(entry, remarks))


def entry_text(entry: ManeuverEntry, remarks: Sequence[str] = ()) -> str:
    """One [[run]] of the file; times are rounded to 0.01 s."""
    return (
        "\n[[run]]\n"
        + "".join(f"# {remark}\n" for remark in remarks)
        + f'kind = "{entry.kind}"\nstart = "{entry.start_s:.2f} s"\nend = "{entry.end_s:.2f} s"\n'
        + f"keep = {str(entry.keep).lower()}\n"
    )


def mistake_in(entry: ManeuverEntry) -> str:
    """The fault of an entry, whether it is kept or not; empty if it has none."""
    if entry.kind not in KINDS:
        return f"kind: {entry.kind[:40]!r} is not one of {', '.join(KINDS)}"
    if not 0 <= entry.start_s < entry.end_s < math.inf:
        return f"start ({entry.start_s:g} s) must lie before end ({entry.end_s:g} s), and not before 0"
    return ""


def head(log: str, name: str = "runs.toml") -> str:
    """The remarks at the top of the file."""
    return HEAD.format(log=log, name=name, kinds=", ".join(KINDS))


def to_toml(maneuvers: Maneuvers, log: str, name: str = "runs.toml") -> str:
    """The maneuvers of a flight and the rejected stretches as a file to edit."""
    return head(log, name) + "".join(block.text for block in blocks(maneuvers))


def load(path: Path) -> list[ManeuverEntry]:
    """The entries of a file of maneuvers.

    Raises InputError naming file, entry and key if something is missing, unknown or has a wrong unit.
    """
    try:
        table = tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not valid TOML ({error})") from None
    raw = table.pop("run", [])
    if table:
        raise InputError(f"{path}: unknown key {next(iter(table))!r}; only [[run]] tables are allowed")
    if not isinstance(raw, list) or not raw:
        raise InputError(f"{path}: has no [[run]] table")
    entries = []
    for i, row in enumerate(raw, start=1):
        where = f"{path}: run {i}"
        entry = read_table(ManeuverEntry, row, where)
        if mistake := mistake_in(entry):
            raise InputError(f"{where}: {mistake}")
        entries.append(entry)
    if not any(entry.keep for entry in entries):
        raise InputError(f"{path}: no [[run]] has keep = true")
    return entries


def apply(entries: list[ManeuverEntry], table: pd.DataFrame, rejected: list[RejectedManeuver], where: str) -> Maneuvers:
    """The maneuvers that a file keeps, and the reasons why the others are left out.

    table: from `air_data`. rejected: the stretches rejected in this log; their reasons are kept. where: names the file
    in errors.
    Raises InputError for a maneuver outside the log, one without the data that every method needs, and for runs that
    overlap: data counted twice make the interval too narrow.
    """
    motion = smooth(table, LEVEL_RUN.smoothing_s)
    last_s = float(table.index[-1])
    maneuvers_left: list[Maneuver] = []
    left_out: list[RejectedManeuver] = []
    for i, entry in enumerate(entries, start=1):
        if not entry.keep:
            rejection = next((stretch.rejection for stretch in rejected if _same(entry, stretch)), LEFT_OUT)
            left_out.append(RejectedManeuver(entry.kind, entry.start_s, entry.end_s, rejection))
            continue
        place = f"{where}: run {i} ({entry.kind}, {entry.start_s:g} to {entry.end_s:g} s)"
        if entry.start_s > last_s or entry.end_s > last_s + 1:
            raise InputError(f"{place}: the log ends at {last_s:.0f} s")
        first, end = np.searchsorted(table.index.to_numpy(), (entry.start_s - 1e-3, entry.end_s + 1e-3))
        rows = slice(int(first), int(end))
        if rows.stop - rows.start < FLIGHT.fewest_samples:
            raise InputError(f"{place}: only {rows.stop - rows.start} samples; {FLIGHT.fewest_samples} are needed")
        data = table.iloc[rows]
        missing = None if entry.kind in CONTEXT_KINDS else quality.without_data(data)
        if missing:
            raise InputError(f"{place}: {reason_in_words(missing)}")
        for other in maneuvers_left if entry.kind in LEVEL_RUNS else ():
            if other.kind in LEVEL_RUNS and other.rows.start < rows.stop - 1 and rows.start < other.rows.stop - 1:
                raise InputError(f"{place}: overlaps the {other.name}")
        notes = () if entry.kind in CONTEXT_KINDS else quality.notes(data, motion.bank[rows])
        maneuvers_left.append(maneuver_in(entry.kind, rows, table, motion.V, notes))
    return Maneuvers(sorted(maneuvers_left, key=_start), left_out)


def _start(stretch: Maneuver | RejectedManeuver) -> float:
    return stretch.start_s


def _same(entry: ManeuverEntry, stretch: RejectedManeuver) -> bool:
    """Whether an entry is the same as a stretch; times in the file are rounded to 0.01 s."""
    apart = max(abs(entry.start_s - stretch.start_s), abs(entry.end_s - stretch.end_s))
    return entry.kind == stretch.kind and apart < 0.01


PRESSURES = ("q_c_Pa", "dp_alpha_Pa", "static_Pa")  # a flight is recognized only if all of these are measured


def select(table: pd.DataFrame, rest: list[slice], log: str, runs_file: Path | None = None) -> Maneuvers:
    """The maneuvers found, or the ones that `runs_file` keeps.

    table: from `air_data`. rest: rows in which the aircraft stood still.
    Raises InputError naming the log or the file if no maneuver allows drag to be estimated; for the log it is NoCurve.
    """
    entries = load(runs_file) if runs_file else None
    maneuvers = find(table, rest)
    if entries:
        maneuvers = apply(entries, table, maneuvers.rejected, str(runs_file))
    if maneuvers.of(*FOR_DRAG):
        return maneuvers
    if runs_file:
        raise InputError(f"{runs_file}: no maneuver to analyze; keep one of these: {', '.join(FOR_DRAG)}")
    missed = nearest_miss(maneuvers.rejected, table, rested=bool(rest))
    raise NoCurve(f"{log}: no acceleration or deceleration to analyze{missed}", maneuvers)


def nearest_miss(rejected: list[RejectedManeuver], table: pd.DataFrame, *, rested: bool = True) -> str:
    """Why there is no run: the reason for the longest rejected one, or why no flight was recognized.

    rested: the aircraft stood still somewhere in the log.
    """
    if not table["flying"].any():
        dead = sorted({COLUMNS[name][0] for name in PRESSURES if table[name].isna().all()})
        if dead:
            return f": {', '.join(dead)} showed nothing (a broken transducer or a blocked tube)"
        return (
            f": no flight in it (dynamic pressure below {flying_Pa(speed_scale_of(table)):.0f} Pa,"
            " or flow angles outside the probe calibration)"
        )
    missed = [stretch for stretch in rejected if stretch.kind in LEVEL_RUNS]
    if not missed:
        return " (speed never changed steadily in level flight)"
    longest = max(missed, key=lambda r: r.end_s - r.start_s)
    reason = f"; the longest stretch, {longest.start_s:.0f} to {longest.end_s:.0f} s: {longest.reason}"
    if rested or longest.rejection.reason is not RunRejected.TOO_LOW:
        return reason
    return (
        f"{reason}; there is no rest on the ground in the log, and the height where it begins is taken as the ground's"
    )
