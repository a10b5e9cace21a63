"""From a log to power required: air data, trajectory, maneuvers, drag polar, performance, report.

Of this project's packages it imports only `flight`. Other programs import `flightpower` (docs/understand/python.md),
whose names stay.
"""
