"""Runs as a file that a person can edit: written with every analysis, and taken back by `--runs`."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.maneuvers import quality
from analysis.maneuvers.kinds import KINDS, LEVEL_RUNS, WHOLE, Maneuvers, Rejected, Run, measured
from analysis.maneuvers.smooth import smooth
from flight.errors import InputError
from flight.units import read_table

HEAD = """\
# What was found in {log}. Edit it and run: analyze {log} --runs {name}
#
# keep = false leaves a run out; keep = true takes one that was rejected. Move start and end (since the log began), or
# give another kind: {kinds}.
# Runs may be added. Lines that begin with # are remarks.
"""
SMOOTHING_S = 2.2
FEWEST_SAMPLES = 60  # twelve of the five-sample blocks that estimators work on: fewer they would leave out, unsaid
DROPPED = "left out by hand"
ROUNDED_S = 0.01


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One [[run]] of the file."""

    kind: str
    start_s: float
    end_s: float
    keep: bool = True


def to_toml(found: Maneuvers, log: str, name: str = "runs.toml") -> str:
    """The runs of a flight, rejected stretches among them, as a file to edit."""
    parts = [HEAD.format(log=log, name=name, kinds=", ".join(KINDS))]
    everything: list[Run | Rejected] = sorted([*found.maneuvers, *found.rejected], key=lambda run: run.start_s)
    for stretch in everything:
        kept = isinstance(stretch, Run)
        remarks = stretch.notes if isinstance(stretch, Run) else (f"not taken: {stretch.reason}",)
        parts.append(
            "\n[[run]]\n"
            + "".join(f"# {remark}\n" for remark in remarks)
            + f'kind = "{stretch.kind}"\nstart = "{stretch.start_s:.2f} s"\nend = "{stretch.end_s:.2f} s"\n'
            + f"keep = {'true' if kept else 'false'}\n"
        )
    return "".join(parts)


def load(path: Path) -> list[Entry]:
    """The entries of a file of runs.

    Raises InputError naming file, entry and key when something is missing, unknown or of a wrong unit.
    """
    try:
        table = tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: not valid TOML ({error})") from None
    raw = table.pop("run", [])
    if table:
        raise InputError(f"{path}: unknown key {next(iter(table))!r}; a file of runs holds [[run]] tables only")
    if not isinstance(raw, list) or not raw:
        raise InputError(f"{path}: has no [[run]]")
    entries = []
    for i, one in enumerate(raw, start=1):
        where = f"{path}: run {i}"
        entry = read_table(Entry, one, where)
        if entry.kind not in KINDS:
            raise InputError(f"{where}: kind: {entry.kind!r} is none of {', '.join(KINDS)}")
        if not 0 <= entry.start_s < entry.end_s:
            raise InputError(f"{where}: start ({entry.start_s:g} s) must lie before end ({entry.end_s:g} s), from 0 on")
        entries.append(entry)
    if not any(entry.keep for entry in entries):
        raise InputError(f"{path}: keeps no run at all")
    return entries


def apply(entries: list[Entry], table: pd.DataFrame, rejected: list[Rejected], where: str) -> Maneuvers:
    """The runs that a file keeps, measured anew, and why the others are left out.

    table: as `air_data` leaves it. rejected: what the software would not take, so that its reasons stay.
    where: names the file in errors.
    Raises InputError for a run outside the log, one without the data that every method needs, and for accelerations or
    decelerations that overlap: what counts twice makes the interval too narrow.
    """
    now = smooth(table, SMOOTHING_S)
    last_s = float(table.index[-1])
    runs: list[Run] = []
    dropped: list[Rejected] = []
    for i, entry in enumerate(entries, start=1):
        if not entry.keep:
            reason = next((stretch.reason for stretch in rejected if _is(entry, stretch)), DROPPED)
            dropped.append(Rejected(entry.kind, entry.start_s, entry.end_s, reason))
            continue
        at = f"{where}: run {i} ({entry.kind}, {entry.start_s:g} to {entry.end_s:g} s)"
        if entry.start_s > last_s or entry.end_s > last_s + 1:
            raise InputError(f"{at}: the log ends at {last_s:.0f} s")
        first, end = np.searchsorted(table.index.to_numpy(), (entry.start_s - 1e-3, entry.end_s + 1e-3))
        rows = slice(int(first), int(end))
        if rows.stop - rows.start < FEWEST_SAMPLES:
            raise InputError(f"{at}: only {rows.stop - rows.start} samples; {FEWEST_SAMPLES} are needed")
        data = table.iloc[rows]
        lacks = "" if entry.kind in WHOLE else quality.without_data(data)
        if lacks:
            raise InputError(f"{at}: {lacks}")
        for other in runs if entry.kind in LEVEL_RUNS else ():
            if other.kind in LEVEL_RUNS and other.rows.start < rows.stop - 1 and rows.start < other.rows.stop - 1:
                raise InputError(f"{at}: overlaps the {other.name}")
        notes = () if entry.kind in WHOLE else quality.notes(data, now.bank[rows])
        runs.append(measured(entry.kind, rows, table, now.V, notes))
    return Maneuvers(sorted(runs, key=lambda run: run.start_s), dropped)


def _is(entry: Entry, stretch: Rejected) -> bool:
    """Whether an entry is that stretch, its times rounded as the file has them."""
    apart = max(abs(entry.start_s - stretch.start_s), abs(entry.end_s - stretch.end_s))
    return entry.kind == stretch.kind and apart < ROUNDED_S
