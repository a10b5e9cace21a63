"""Finds in the data what was flown: accelerations, steady points, manoeuvres; and says why a stretch was not taken.

`kinds` is the vocabulary, `quality` what a stretch is worth; one file finds each sort, `find` all; `edit` writes
them to a file and takes an edited one back.
"""

from analysis.runs.kinds import Found, Rejected, Run
from analysis.runs.level import SMOOTHING_S, find_runs

__all__ = ["SMOOTHING_S", "Found", "Rejected", "Run", "find_runs"]
