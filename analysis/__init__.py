"""From a log to power required: air data, flight path, runs, estimates, curve, report.

Imports only `flight` of ours.
"""
