"""Electrical power of level flight from any flight with pitot, barometer and battery monitor.

`flight_table` puts the channels of a recording on one time base, `airspeed_gps` corrects airspeed by GPS,
`energy_balance` compares the battery's power with drag and the change of energy, `propulsion` is the efficiency between
them, `air_motion` the covariance of what vertical air motion adds, `estimate` the curve with its interval.
"""
