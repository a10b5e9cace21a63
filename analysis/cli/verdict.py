"""Prints evidence against results on the terminal: doubts before the results, reasons not to trust them after."""

import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from flightpower.flight.command_line import ExitCode

if TYPE_CHECKING:
    from flightpower.analysis.records.flight import Evidence
    from flightpower.analysis.records.pool import ComparisonResults, PooledResults


def report_evidence(evidence: Sequence["Evidence"], print_results: Callable[[], None]) -> ExitCode:
    """Print doubts on stderr, then the results, then on stderr reasons not to trust them. Returns the exit code."""
    from flightpower.analysis.records.flight import Trust
    from flightpower.analysis.results.evidence import sentence

    def lines_at(level: Trust) -> list[str]:
        return [f"{level}: {sentence(piece)}" for piece in evidence if piece.level is level]

    for line in lines_at(Trust.DOUBTFUL):
        print(line, file=sys.stderr)
    print_results()
    against = lines_at(Trust.NOT_TO_BE_TRUSTED)
    for line in against:
        print(line, file=sys.stderr)
    return ExitCode.FAILURE if against else ExitCode.DONE


def evidence_of_kinds(results: "PooledResults | ComparisonResults") -> list["Evidence"]:
    """Return the evidence against the estimates from both kinds of power, each piece once."""
    of_other = results.other_kind.evidence if results.other_kind else []
    return [*results.evidence, *(piece for piece in of_other if piece not in results.evidence)]
