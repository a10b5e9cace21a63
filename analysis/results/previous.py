"""Tells whether results in a folder came from a different log or other options than those that replace them."""

import shlex
from collections.abc import Collection
from pathlib import Path

from flightpower.analysis.records.flight import Results
from flightpower.analysis.results.read import read_results
from flightpower.flight.errors import InputError

OUTPUT, QUIET = ("-o", "--output"), ("-q", "--quiet")  # options that do not change results


TABLES = ("power_required.csv", "path.csv", "field_table.md", "field_table.csv", "electrical_power.csv")


def replaced(folder: Path, results: Results, written: Collection[str] = TABLES) -> str:
    """Return a sentence on what `results` replace in the folder; empty if the folder is empty or has the same analysis.
    written: names of the files that are written. The sentence names tables of an earlier analysis that stay.
    """
    return "; ".join(text for text in (_replaced(folder, results), tables_left(folder, written)) if text)


def tables_left(folder: Path, written: Collection[str]) -> str:
    """Return a sentence that names tables of an earlier analysis that stay in the folder; empty if there are none."""
    left = [name for name in TABLES if name not in written and (folder / name).exists()]
    if not left:
        return ""
    return f"{', '.join(left)} in {folder} {'is' if len(left) == 1 else 'are'} of an earlier analysis"


def _replaced(folder: Path, results: Results) -> str:
    path = folder / "results.json"
    if not path.exists():
        return ""
    previous: Results | None
    try:
        previous = read_results(path)
    except InputError:
        previous = None
    before, now = previous.provenance if previous else None, results.provenance
    if before is None or now is None:
        return f"the report in {folder} was replaced; the options of the earlier one are not known"
    if before.log_sha256 != now.log_sha256:
        return f"the report in {folder} was replaced; the earlier one was of another log: {before.command_line}"
    if _options(before.command_line) != _options(now.command_line):
        return f"the report in {folder} was replaced; the earlier one had other options: {before.command_line}"
    hashes = {file.role: file.sha256 for file in before.files}
    changed = [file.role for file in now.files if hashes.get(file.role, "") != file.sha256]
    return f"the report in {folder} was replaced; the earlier one used another {', '.join(changed)}" if changed else ""


def _options(command_line: str) -> list[str]:
    """Return the options that change results, sorted alphabetically, without the log, which its hash identifies."""
    arguments, options = shlex.split(command_line)[1:], []
    while arguments:
        argument = arguments.pop(0)
        name, _, value = argument.partition("=")
        if not name.startswith("-") or name in QUIET:
            continue
        if not value and arguments and name not in QUIET:
            value = arguments.pop(0)
        if name not in OUTPUT:
            options.append(f"{name}={value}")
    return sorted(options)
