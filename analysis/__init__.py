"""From a log to power required: air data, trajectory, maneuvers, drag polar, performance, report.

Imports only `flight` of ours. Programs of others import `flightpower` (docs/understand/python.md), whose names stay.
"""
