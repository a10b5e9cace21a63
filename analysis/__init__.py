"""From a log to power required: air data, trajectory, maneuvers, drag polar, performance, report.

It imports only `flight` among this project's packages. Other programs import `flightpower`
(docs/understand/python.md), whose names do not change.
"""
