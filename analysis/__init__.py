"""From a log to power required: air data, trajectory, maneuvers, drag polar, performance, report.

Imports only `flight` of ours.
"""
