"""Electrical power of level flight from any flight with pitot, barometer and battery monitor.

`flight_table` puts the channels of a recording on one time base and finds where the aircraft flew. `airspeed_gps`
corrects airspeed by GPS. `energy_balance` compares the battery's power with drag and the change of energy, `fit` gives
its most probable parameters and their covariance, and `curve` gives the curve with its interval. Where a propeller's
table gives thrust, `thrust_balance` and `drag` also give power required. `method` does this with a complete log of the
daemon. `settings` has the thresholds and priors.
"""
